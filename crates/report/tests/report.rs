//! What is drawn and written holds together, whatever goes in.

#[path = "../examples/figure/synthetic.rs"]
mod synthetic;

use fit::{Constraint, Contribution, Estimate, Fit, Residual, Termination, Warning};
use physics::{Coefficients, ProfilePoint, RadialProfile};
use report::{
    ChannelReport, CurvePoint, ExposureRow, Input, Outline, Picture, Report, Swatch, figure_svg,
    preview_text, report_html,
};
use roxmltree::{Document, Node, ParsingOptions};

const MARBLE_GREEN: Coefficients = Coefficients {
    sigma_a: 0.0041,
    sigma_s_prime: 2.62,
};

fn page<'a>(material: &'a str, channels: Vec<ChannelReport<'a>>) -> Report<'a> {
    Report {
        material,
        eta: 1.5,
        u_eta: 0.01,
        model: "dipole",
        constraint: Constraint::Joint,
        channels,
        warnings: vec![],
        assumptions: vec![],
        comparison: vec![],
        verdict: vec![],
        confirmation: vec![],
        beam: vec![],
        merge: vec![],
        exposures: vec![],
        pictures: vec![],
        swatch: Err("none was asked for".to_owned()),
        tool: "beamspot 0.1.0",
        settings: vec![],
        inputs: vec![],
    }
}

/// Parses `text`, which is well-formed then, and checks that it refers to nothing outside itself
/// and holds no number that is none.
fn parsed(text: &str) -> Document<'_> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options).expect("well-formed XML");
    for node in document.descendants() {
        assert!(!matches!(node.tag_name().name(), "link" | "a"));
        if node.tag_name().name() == "script" {
            assert_eq!(node.text(), Some(include_str!("../src/zoom.js")));
            assert_eq!(node.attributes().count(), 0);
            continue;
        }
        for attribute in node.attributes() {
            let (name, value) = (attribute.name(), attribute.value());
            if matches!(name, "href" | "src") {
                assert!(value.starts_with("data:image/png;base64,"), "{value}");
                continue;
            }
            assert!(name != "id" && !name.starts_with("on"), "{name}");
            assert!(
                !value.contains("NaN") && !value.contains("inf"),
                "{name}=\"{value}\""
            );
            assert!(
                name == "content" || !value.contains("e-"),
                "{name}=\"{value}\""
            );
        }
        for shown in node
            .text()
            .into_iter()
            .filter(|_| !matches!(node.tag_name().name(), "style" | "script"))
        {
            assert!(!shown.contains("NaN") && !shown.contains("inf "), "{shown}");
        }
    }
    assert!(!text.contains("url(") && !text.contains("@import"));
    document
}

/// All the text of a node, elements within it ignored.
fn text_of(node: Node) -> String {
    node.descendants()
        .filter(Node::is_text)
        .filter_map(|n| n.text())
        .collect()
}

fn shows(document: &Document, wanted: &str) -> bool {
    let text = |n: &Node| {
        matches!(
            n.tag_name().name(),
            "text" | "td" | "th" | "li" | "p" | "h1"
        )
    };
    document
        .descendants()
        .filter(text)
        .any(|n| text_of(n).contains(wanted))
}

#[test]
fn a_figure_shows_every_point_and_says_what_it_shows() {
    let green = synthetic::channel("G", MARBLE_GREEN, 1.5, 1).unwrap();
    let svg = figure_svg("Marble", &green.report());
    let document = parsed(&svg);
    let circles = document
        .descendants()
        .filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "circle")));
    // Each point above, each fitted one once more as a residual, and two signs in the legend.
    let points = green.profile.points.len() + green.fit.residuals.len() + 2;
    assert_eq!(circles.count(), points);
    // The pointer finds the numbers of each: of the first point, and of the first residual.
    let titles: Vec<String> = (document.descendants())
        .filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "title")))
        .map(text_of)
        .collect();
    assert_eq!(titles.len(), 1 + points - 2);
    let first = &green.profile.points[0];
    let value = report::uncertain(first.reflectance_per_mm2, first.u_reflectance_per_mm2);
    let radius = report::significant(first.radius_mm, 4);
    assert!(
        titles.contains(&format!("r = {radius} mm: {value} mm⁻²")),
        "{titles:?}"
    );
    let first = &green.fit.residuals[0];
    let z = (first.measured_per_mm2 - first.model_per_mm2) / first.u_per_mm2;
    let radius = report::significant(first.radius_mm, 4);
    assert!(
        titles.contains(&format!("r = {radius} mm: {z:+.2} u")),
        "{titles:?}"
    );
    for wanted in [
        "Marble · G",
        "distance from the beam r (mm)",
        "residual / u",
        "fitted range",
    ] {
        assert!(shows(&document, wanted), "{wanted}");
    }
    assert!(shows(&document, "diffuse reflectance Rd (mm−2)"));
    assert!(shows(
        &document,
        &format!("reduced χ2 = {:.2}", green.fit.reduced_chi2)
    ));
    assert!(shows(&document, "true: σs′ = 2.62, σa = 0.0041 mm−1"));
}

#[test]
fn a_point_stands_where_its_axes_put_it() {
    let green = synthetic::channel("G", MARBLE_GREEN, 1.5, 1).unwrap();
    let svg = figure_svg("Marble", &green.report());
    let document = parsed(&svg);
    let number = |n: Node, name: &str| n.attribute(name).unwrap().parse::<f64>().unwrap();
    // The places of two labelled ticks give the scale of an axis, independently of its code.
    let label = |text: &str, class: &str, along: &str| {
        let labels = |n: &Node| n.attribute("class") == Some(class) && text_of(*n) == text;
        number(document.descendants().find(labels).unwrap(), along)
    };
    let (one, ten) = (label("1", "middle", "x"), label("10", "middle", "x"));
    let baseline = 4.5;
    let (centi, milli) = (
        label("10−2", "end", "y") - baseline,
        label("10−3", "end", "y") - baseline,
    );
    let expected: Vec<(f64, f64)> = green
        .profile
        .points
        .iter()
        .map(|p| {
            (
                one + (ten - one) * p.radius_mm.log10(),
                centi + (milli - centi) * (-2.0 - p.reflectance_per_mm2.log10()),
            )
        })
        .collect();
    // Above zero stands what was measured above the model.
    let (zero, two) = (
        label("0", "end", "y") - baseline,
        label("2", "end", "y") - baseline,
    );
    let residuals = green.fit.residuals.iter().map(|r| {
        let z = (r.measured_per_mm2 - r.model_per_mm2) / r.u_per_mm2;
        (
            one + (ten - one) * r.radius_mm.log10(),
            zero + 0.5 * (two - zero) * z,
        )
    });
    let drawn: Vec<(f64, f64)> = document
        .descendants()
        .filter(|n| n.attribute("cx").is_some() && n.attribute("class").is_none())
        .map(|n| (number(n, "cx"), number(n, "cy")))
        .collect();
    for (x, y) in expected.into_iter().chain(residuals) {
        // Coordinates have two decimals, and so have the ticks that scaled them.
        let near = |(cx, cy): &(f64, f64)| (cx - x).abs() < 0.05 && (cy - y).abs() < 0.05;
        assert!(drawn.iter().any(near), "nothing at {x} {y}");
    }
}

/// Transport a tenth above the model: a line above, one among the residuals, both in the legend;
/// and the band of the model, twice its u wide.
#[test]
fn what_transport_says_lies_beside_the_model() {
    let green = synthetic::channel("G", MARBLE_GREEN, 1.5, 1).unwrap();
    let mut channel = green.report();
    let at = |p: &physics::ProfilePoint, factor: f64| CurvePoint {
        radius_mm: p.radius_mm,
        reflectance_per_mm2: factor / p.radius_mm.powi(3),
    };
    let points = &green.profile.points;
    channel.model_curve = points.iter().map(|p| at(p, 0.1)).collect();
    channel.transport = points.iter().map(|p| at(p, 0.11)).collect();
    channel.u_model_per_mm2 = points.iter().map(|p| 0.01 / p.radius_mm.powi(3)).collect();
    let svg = figure_svg("Marble", &channel);
    let document = parsed(&svg);
    let drawn = |class: &str| -> Vec<Vec<(f64, f64)>> {
        let of_class = |n: &Node| {
            n.attribute("class") == Some(class)
                && n.has_tag_name(("http://www.w3.org/2000/svg", "path"))
        };
        let corners = |d: &str| {
            let ends = d.trim_end_matches('Z').split(['M', 'L']).skip(1);
            let pairs = ends.filter_map(|end| {
                let (x, y) = end.split_once(' ')?;
                Some((x.parse().ok()?, y.parse().ok()?))
            });
            pairs.collect()
        };
        (document.descendants().filter(of_class))
            .filter_map(|n| n.attribute("d").map(corners))
            .collect()
    };
    let ten = {
        let label = |text: &str| {
            let labels = |n: &Node| n.attribute("class") == Some("end") && text_of(*n) == text;
            let node = document.descendants().find(labels).unwrap();
            node.attribute("y").unwrap().parse::<f64>().unwrap()
        };
        label("10−4") - label("10−3")
    };
    // The sample in the legend comes after panel's line, and has one corner.
    let transport = drawn("transport");
    let (lines, samples): (Vec<_>, Vec<_>) = transport.into_iter().partition(|l| l.len() > 1);
    assert_eq!((lines.len(), samples.len()), (2, 1));
    // These lines are straight, and of a straight line the ends alone are drawn.
    let model = &drawn("model")[0];
    assert_eq!((model.len(), lines[0].len()), (2, 2));
    let [from, to] = [lines[0][0], lines[0][1]];
    for (x, y) in model {
        let line = from.1 + (to.1 - from.1) * (x - from.0) / (to.0 - from.0);
        let above = y - line;
        assert!((above - ten * 1.1_f64.log10()).abs() < 0.03, "{above}");
    }
    // (0.11 - 0.10)/0.10 of the model, in u.
    let r = &green.fit.residuals[3];
    let z = 0.1 * r.model_per_mm2 / r.u_per_mm2;
    assert!(z > 0.0 && lines[1].len() > 1);
    let band = &drawn("band")[0];
    assert_eq!(band.len(), 4);
    for (upper, lower) in [(band[0], band[3]), (band[1], band[2])] {
        assert_eq!(upper.0, lower.0);
        let wide = lower.1 - upper.1;
        let expected = ten * (1.1_f64 / 0.9).log10();
        assert!((wide - expected).abs() < 0.03, "{wide} {expected}");
    }
    assert!(shows(&document, "its medium by transport") && shows(&document, "model ± u"));
}

#[test]
fn the_same_in_gives_the_same_out() {
    let make = || {
        let green = synthetic::channel("G", MARBLE_GREEN, 1.5, 1).unwrap();
        report_html(&page("Marble", vec![green.report()]))
    };
    assert_eq!(make(), make());
}

#[test]
fn text_from_outside_stays_text() {
    let evil = "</title><script>alert('1')</script>\u{0}\u{1b}[31m\"&amp;";
    let mut green = synthetic::channel("G", MARBLE_GREEN, 1.5, 1).unwrap();
    green.fit.channel = evil.to_owned();
    parsed(&figure_svg(evil, &green.report()));
    let report = Report {
        model: evil,
        warnings: vec![evil.to_owned()],
        assumptions: vec![evil.to_owned()],
        comparison: vec![],
        verdict: vec![],
        confirmation: vec![],
        beam: vec![],
        merge: vec![evil.to_owned()],
        settings: vec![(evil.to_owned(), evil.to_owned())],
        pictures: vec![picture(evil)],
        swatch: Ok(Swatch {
            png: b"png".to_vec(),
            size: [1, 1],
            caption: evil.to_owned(),
        }),
        tool: evil,
        inputs: vec![Input {
            name: evil.to_owned(),
            blake3: evil.to_owned(),
        }],
        ..page(evil, vec![green.report()])
    };
    let html = report_html(&report);
    assert!(!html.contains("alert('1')"));
    assert_eq!(html.matches("<script").count(), 1);
    let document = parsed(&html);
    // It is there for all to read, apart from what no document may hold.
    assert!(shows(
        &document,
        "</title><script>alert('1')</script>\u{fffd}\u{fffd}[31m\"&amp;"
    ));
}

#[test]
fn the_page_holds_every_channel_and_every_line_it_was_given() {
    let channels: Vec<_> = [("R", 2.19, 0.0021), ("G", 2.62, 0.0041), ("B", 3.0, 0.0071)]
        .into_iter()
        .map(|(name, sigma_s_prime, sigma_a)| {
            synthetic::channel(
                name,
                Coefficients {
                    sigma_a,
                    sigma_s_prime,
                },
                1.5,
                7,
            )
            .unwrap()
        })
        .collect();
    let mut report = page("Marble", channels.iter().map(|c| c.report()).collect());
    report.warnings = vec!["u_eta is large, and sigma_a feels it".to_owned()];
    report.assumptions = vec!["no reference.sigma_a was given".to_owned()];
    report.merge = vec!["13 of 13 frames".to_owned()];
    report.exposures = vec![
        ExposureRow {
            subject: "sample".to_owned(),
            exposure_s: 0.004,
            used_and_saturated: vec![[0.9987, 0.0001], [1.0, 0.0], [0.5, 0.5]],
        },
        ExposureRow {
            subject: "reference".to_owned(),
            exposure_s: 4.0,
            used_and_saturated: vec![[0.0, 1.0]; 3],
        },
    ];
    report.pictures = ["R", "G", "B"].map(picture).to_vec();
    report.settings = vec![("seed of the photons".to_owned(), "6".to_owned())];
    report.swatch = Ok(Swatch {
        png: b"png".to_vec(),
        size: [12, 12],
        caption: "a cube of 20 mm".to_owned(),
    });
    report.inputs = vec![Input {
        name: "a.tif".to_owned(),
        blake3: "af13".to_owned(),
    }];
    let html = report_html(&report);
    let document = parsed(&html);
    assert_eq!(
        document
            .descendants()
            .filter(|n| n.tag_name().name() == "svg" && n.attribute("role").is_some())
            .count(),
        6
    );
    for wanted in [
        "99.87 %",
        "dropped",
        "seed of the photons",
        "u_eta is large, and σa feels it",
        "13 of 13 frames",
        "a.tif",
        "af13",
        "η = 1.500 ± 0.010",
    ] {
        assert!(shows(&document, wanted), "{wanted}");
    }
    assert!(html.contains("<figcaption>a cube of 20 mm</figcaption>"));
    for channel in &channels {
        let fit = &channel.fit;
        let wanted = report::uncertain(fit.sigma_s_prime.value, fit.sigma_s_prime.u);
        assert!(shows(&document, &wanted), "{wanted}");
    }
}

/// 64 channels, each with all that a measurement draws and a picture of noise, whose 65 colours take
/// 6 bits a pixel: under 2 MB, and folded.
#[test]
fn many_channels_make_a_page_that_can_be_sent() {
    let green = synthetic::channel("G", MARBLE_GREEN, 1.5, 1).unwrap();
    let mut channel = green.report();
    channel.u_model_per_mm2 = (channel.model_curve.iter())
        .map(|p| 0.01 * p.reflectance_per_mm2)
        .collect();
    channel.transport = channel.model_curve.clone();
    channel.monte_carlo = channel.model_curve.clone();
    let mut report = page("Marble", vec![channel; 64]);
    let taken = Picture {
        // 320,000 pixels for all, and a few bytes of a header.
        png: vec![0; 320_000 / 64 * 6 / 8 + 300],
        ..picture("G")
    };
    report.pictures = vec![taken; 64];
    let text = report_html(&report);
    assert!(text.len() < 2_000_000, "{}", text.len());
    let document = parsed(&text);
    let folded = |n: &Node| n.tag_name().name() == "details" && n.has_children();
    let figures = document.descendants().filter(folded);
    let figures = figures.filter(|n| n.descendants().any(|n| n.tag_name().name() == "figure"));
    assert_eq!(figures.count(), 2 * 64);
    report.channels.truncate(3);
    assert!(!report_html(&report).contains("<details"));
}

/// A picture of 100 px × 50 px with one ring.
fn picture(channel: &str) -> Picture {
    Picture {
        channel: channel.to_owned(),
        png: b"png".to_vec(),
        size_px: [100.0, 50.0],
        range_per_mm2: (2e-6, 0.3),
        center_px: [49.5, 24.5],
        outlines: vec![Outline {
            name: "fitted range".to_owned(),
            dashed: false,
            corners_px: vec![[9.5, 24.5], [49.5, 14.5], [89.5, 24.5], [49.5, 34.5]],
        }],
        px_per_mm: 10.0,
        any_unmeasured: true,
    }
}

/// Of a picture of 100 px, 500 units wide: the centre and the ring stand where the pixels are, and
/// the bar of a length is as long as it says.
#[test]
fn a_picture_is_drawn_to_scale() {
    let text = report::picture_svg("Marble", &picture("G"));
    let document = parsed(&text);
    let paths: Vec<&str> = (document.descendants())
        .filter(|n| n.attribute("class") == Some("outline"))
        .filter_map(|n| n.attribute("d"))
        .collect();
    assert!(
        paths.contains(&"M50.00 125.00L250.00 75.00L450.00 125.00L250.00 175.00Z"),
        "{paths:?}"
    );
    assert!(
        paths.contains(&"M244.00 125.00h12M250.00 119.00v12"),
        "{paths:?}"
    );
    // 2 mm are 20 px are 100 units; 5 mm would be more than a third of the picture.
    assert!(paths.contains(&"M12 238.00h100.00"), "{paths:?}");
    for wanted in [
        "2 mm",
        "fitted range",
        "not measured, left out",
        "10−5",
        "10−1",
    ] {
        assert!(shows(&document, wanted), "{wanted}");
    }
    assert!(!shows(&document, "10−6") && !shows(&document, "100"));
}

/// A fit and a profile in which everything is odd.
fn odd(points: &[(f64, f64, f64)], number: f64) -> (Fit, RadialProfile) {
    let estimate = Estimate {
        value: number,
        u: number,
        ci95: (number, number),
        degrees_of_freedom: number,
    };
    let profile = RadialProfile {
        channel: String::new(),
        points: points
            .iter()
            .map(|&(radius_mm, value, u)| ProfilePoint {
                ring_mm: None,
                radius_mm,
                reflectance_per_mm2: value,
                u_reflectance_per_mm2: u,
                pixels: None,
            })
            .collect(),
    };
    let fit = Fit {
        channel: String::new(),
        sigma_a: estimate,
        sigma_s_prime: estimate,
        correlation: number,
        budget: vec![Contribution {
            source: "a <b> & c".to_owned(),
            u_sigma_a: number,
            u_sigma_s_prime: number,
            correlation: number,
            degrees_of_freedom: number,
        }],
        upper_limit: None,
        total: None,
        scale: number,
        range_mm: (number, number),
        share_outside: number,
        reduced_chi2: number,
        evaluations: 0,
        termination: Termination::OutOfEvaluations,
        warnings: vec![Warning::LowAlbedo { albedo_prime: 0.1 }],
        residuals: points
            .iter()
            .map(|&(radius_mm, measured_per_mm2, u_per_mm2)| Residual {
                radius_mm,
                measured_per_mm2,
                u_per_mm2,
                model_per_mm2: number,
                nuisances_per_mm2: 0.0,
            })
            .collect(),
        nuisances: vec![],
    };
    (fit, profile)
}

#[test]
fn odd_numbers_leave_no_trace() {
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    let profiles = [
        vec![],
        vec![(1.0, 1.0, 0.1)],
        vec![(0.0, 1.0, 0.1), (1.0, 0.0, 0.0), (2.0, -1.0, 0.1)],
        vec![(1.0, -3.0, 0.1), (2.0, -1.0, 0.1), (3.0, -1e-300, 1e-300)],
        vec![
            (nan, 1.0, 0.1),
            (1.0, nan, 0.1),
            (2.0, 1.0, nan),
            (inf, inf, inf),
        ],
        vec![
            (1e-308, 1e-308, 1e308),
            (1e308, 1e308, 1e-308),
            (1.0, 5e-324, 5e-324),
        ],
    ];
    for points in profiles {
        for number in [0.0, 1.0, -1.0, nan, inf, -inf, 1e308, 5e-324] {
            for upper_limit in [None, Some(number)] {
                let (mut fit, profile) = odd(&points, number);
                fit.upper_limit = upper_limit;
                let curve = points.iter().map(|&(radius_mm, value, _)| CurvePoint {
                    radius_mm,
                    reflectance_per_mm2: value,
                });
                let channel = ChannelReport {
                    fit: &fit,
                    profile: &profile,
                    wavelength_nm: Some(number),
                    model_curve: curve.collect(),
                    u_model_per_mm2: points.iter().map(|p| p.2).collect(),
                    transport: points
                        .iter()
                        .map(|p| CurvePoint {
                            radius_mm: p.0,
                            reflectance_per_mm2: p.2,
                        })
                        .collect(),
                    total_reflectance: number,
                    monte_carlo: vec![],
                    truth: Some(Coefficients {
                        sigma_a: number,
                        sigma_s_prime: number,
                    }),
                };
                parsed(&figure_svg("", &channel));
                let mut report = page("", vec![channel]);
                report.u_eta = number;
                report.exposures = vec![ExposureRow {
                    subject: String::new(),
                    exposure_s: number,
                    used_and_saturated: vec![[number; 2]],
                }];
                report.pictures = vec![Picture {
                    channel: String::new(),
                    png: vec![],
                    size_px: [3.0, 2.0],
                    range_per_mm2: (number, 1.0),
                    center_px: [number; 2],
                    outlines: vec![Outline {
                        name: String::new(),
                        dashed: true,
                        corners_px: vec![[number; 2], [0.0, number]],
                    }],
                    px_per_mm: number,
                    any_unmeasured: true,
                }];
                parsed(&report_html(&report));
            }
        }
    }
}

#[test]
fn values_that_a_logarithm_cannot_show_become_arrows() {
    let points = vec![
        (1.0, 1.0, 0.01),
        (2.0, 0.1, 0.01),
        (3.0, -0.01, 0.02),
        (4.0, -1.0, 0.01),
    ];
    let (fit, profile) = odd(&points, 1.0);
    let channel = ChannelReport {
        fit: &fit,
        profile: &profile,
        wavelength_nm: None,
        model_curve: vec![],
        u_model_per_mm2: vec![],
        transport: vec![],
        total_reflectance: 0.5,
        monte_carlo: vec![],
        truth: None,
    };
    let svg = figure_svg("Milk", &channel);
    let document = parsed(&svg);
    assert!(shows(&document, "too low: value + 2 u"));
    let arrows = (document.descendants())
        .filter(|n| n.attribute("class").is_some_and(|c| c.contains("arrows")))
        .flat_map(|group| group.children())
        .filter(|n| n.attribute("d").is_some_and(|d| d.contains("v9")));
    assert_eq!(arrows.count(), 2);
}

#[test]
fn an_upper_limit_is_marked() {
    let white = Coefficients {
        sigma_a: 0.0,
        sigma_s_prime: 11.6,
    };
    let red = synthetic::channel("R", white, 1.3, 3).unwrap();
    let limit = red.fit.upper_limit.expect("no absorption can be seen");
    let html = report_html(&page("Spectralon", vec![red.report()]));
    let document = parsed(&html);
    assert!(shows(&document, "which holds with 95 %"));
    assert!(shows(
        &document,
        report::at_most(limit).split(" ×").next().unwrap()
    ));
    assert!(
        shows(&document, "below the limit"),
        "the truth is 0, the limit {limit}"
    );
    // The decay length and α′ are bounded from below.
    let bounded = document
        .descendants()
        .filter(|n| n.tag_name().name() == "td");
    assert_eq!(bounded.filter(|n| text_of(*n).starts_with("> ")).count(), 2);
}

#[test]
fn a_terminal_of_80_columns_shows_data_model_and_residuals() {
    let made = ["R", "G", "B"].map(|name| synthetic::channel(name, MARBLE_GREEN, 1.5, 1).unwrap());
    let profiles = made.each_ref().map(|channel| channel.profile.clone());
    let fits = made.each_ref().map(|channel| channel.fit.clone());
    let text = preview_text(&fits, &profiles);
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    let first = text.lines().next().unwrap();
    for name in ["R: R_d [mm^-2]", "G: R_d", "B: R_d"] {
        assert!(first.contains(name), "{text}");
    }
    let braille = |c: char| ('\u{2801}'..='\u{28ff}').contains(&c);
    assert!(text.contains('o') && text.contains(braille), "{text}");
    assert!(text.contains("10⁻³") && text.contains(" mm"), "{text}");

    // One channel alone is larger. A model that is far too bright has every residual at the bottom,
    // and its line a decade above the data.
    let strip = |text: &str| -> Vec<char> {
        let line = text.lines().rev().nth(1).unwrap();
        line.chars().skip(5).filter(|c| *c != ' ').collect()
    };
    let alone = preview_text(&fits[..1], &profiles[..1]);
    let middle = strip(&alone)
        .iter()
        .filter(|c| ('▃'..='▆').contains(*c))
        .count();
    assert!(2 * middle > strip(&alone).len(), "{alone}");
    let mut bright = fits[0].clone();
    for residual in &mut bright.residuals {
        residual.model_per_mm2 *= 10.0;
    }
    let off = preview_text(&[bright], &profiles[..1]);
    assert!(
        strip(&off).iter().all(|c| *c == '▁') && !strip(&off).is_empty(),
        "{off}"
    );
    let top = |text: &str, what: &dyn Fn(char) -> bool| {
        text.lines().skip(1).position(|line| line.chars().any(what))
    };
    let (line, data) = (top(&off, &braille), top(&off, &|c| c == 'o'));
    assert!(line.is_some() && line < data, "{off}");
}
