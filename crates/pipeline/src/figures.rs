//! The papers' figures, computed: csv and svg of each.

use crate::brdf::follow;
use crate::energy::{Energy, energy};
use crate::error::{Blame, Error, Kind, Result};
use crate::files::Outputs;
use crate::library;
use crate::monitor::Monitor;
use montecarlo::{Direction, Incidence, Side, Simulation, TallySpec};
use physics::brdf::Directions;
use physics::{
    DiffuseFresnel, Dipole, FirstOrder, HenyeyGreenstein, Layer, LayeredMedium, Phase,
    PhaseFunction, Reflections, fresnel,
};
use report::{Chart, Line, Panel, Scale, Stroke, chart_svg};
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

/// Index of water, the paper's example of a dielectric.
const WATER: f64 = 1.33;
/// Exponent of the lobe that stands for the rough surface in Figure 5; the paper does not name
/// its own.
const SURFACE_EXPONENT: f64 = 60.0;
/// Albedo of the run behind Figure 8: nearly white, so that every other follows from it.
const NEARLY_WHITE: f64 = 0.999;

/// The papers whose figures there are.
pub const PAPERS: [&str; 2] = ["jensen2001", "hk93"];

/// A figure: its name, its chart.
type Figure = (&'static str, Chart);

/// Computes the figures of a paper into `folder`, with `photons` for each of its simulations.
/// Returns the names of the files.
///
/// # Errors
///
/// The paper is unknown, the number of photons makes no sense, or an output is in the way.
pub fn figures(
    paper: &str,
    folder: &Path,
    photons: u64,
    force: bool,
    monitor: &dyn Monitor,
) -> Result<Vec<String>> {
    let blocks = Simulation::blocks_for(photons)
        .map_err(|e| Error::new(Kind::Usage, e))?
        .end;
    let names: &[&str] = match paper {
        "hk93" => &[
            "figure2", "figure3", "figure4", "figure5", "figure8", "figure9",
        ],
        "jensen2001" => &["figure6", "energy"],
        _ => {
            let message = format!(
                "no paper is called `{paper}`; there are {}",
                PAPERS.join(", ")
            );
            return Err(Error::new(Kind::Usage, message));
        }
    };
    let files: Vec<String> = names
        .iter()
        .flat_map(|name| [format!("{name}.csv"), format!("{name}.svg")])
        .collect();
    let outputs = Outputs::new(folder, &files, &[], force)?;
    let figures: Vec<Figure> = if paper == "hk93" {
        monitor.begin("photons", 3 * blocks);
        vec![
            ("figure2", fresnel_of_water()),
            ("figure3", phase_functions()),
            ("figure4", first_orders()),
            ("figure5", surface_and_subsurface()),
            ("figure8", orders(blocks, monitor)?),
            ("figure9", forty_five_degrees(blocks, monitor)?),
        ]
    } else {
        monitor.begin("photons", blocks);
        vec![
            ("figure6", marble(blocks, monitor)?),
            ("energy", energy_by_albedo()?),
        ]
    };
    for (name, chart) in &figures {
        outputs.write(format!("{name}.csv"), |out| {
            Ok(out.write_all(csv(chart).as_bytes())?)
        })?;
        outputs.write(format!("{name}.svg"), |out| {
            Ok(out.write_all(chart_svg(chart).as_bytes())?)
        })?;
    }
    outputs.commit()?;
    Ok(files)
}

/// Every point of every line, as drawn.
fn csv(chart: &Chart) -> String {
    let mut text = "panel,line,x,y\n".to_owned();
    for panel in &chart.panels {
        for line in &panel.lines {
            for (x, y) in &line.points {
                let _ = writeln!(text, "\"{}\",\"{}\",{x:e},{y:e}", panel.title, line.name);
            }
        }
    }
    text
}

fn line(name: impl Into<String>, stroke: Stroke, points: Vec<(f64, f64)>) -> Line {
    Line {
        name: name.into(),
        points,
        stroke,
    }
}

/// Numbers from `low` to `high`.
fn grid(low: f64, high: f64, steps: u32) -> impl Iterator<Item = f64> + Clone {
    (0..=steps).map(move |i| low + (high - low) * f64::from(i) / f64::from(steps))
}

fn fresnel_of_water() -> Chart {
    let panel = |title: &str, eta: f64| {
        let of = |f: &dyn Fn(f64) -> f64| {
            grid(0.0, 90.0, 180)
                .map(|angle| (angle, f(angle.to_radians().cos().max(0.0))))
                .collect()
        };
        Panel {
            title: title.to_owned(),
            x: "angle of incidence (degrees)".to_owned(),
            y: "share of the power".to_owned(),
            x_range: Some((0.0, 90.0)),
            scale: Scale::Linear,
            lines: vec![
                line(
                    "reflected, R",
                    Stroke::Full,
                    of(&|c| fresnel::reflectance(eta, c)),
                ),
                line(
                    "transmitted, T = 1 − R",
                    Stroke::Dashed,
                    of(&|c| 1.0 - fresnel::reflectance(eta, c)),
                ),
            ],
        }
    };
    Chart {
        title: "Hanrahan and Krueger, Figure 2: Fresnel at water".to_owned(),
        columns: 2,
        panels: vec![
            panel("air to water (1.0 to 1.33)", WATER),
            panel("water to air", 1.0 / WATER),
        ],
    }
}

fn phase_functions() -> Chart {
    let panels = [-0.3, 0.6]
        .map(|g| {
            let phase = HenyeyGreenstein { g };
            let points = grid(0.0, 360.0, 360)
                .map(|angle| {
                    let (sin, cos) = angle.to_radians().sin_cos();
                    let p = phase.density(cos);
                    (p * cos, p * sin)
                })
                .collect();
            Panel {
                title: format!("g = {g}"),
                x: "p cos j (sr⁻¹), forward to the right".to_owned(),
                y: "p sin j".to_owned(),
                x_range: None,
                scale: Scale::Equal,
                lines: vec![line("Henyey and Greenstein's p", Stroke::Full, points)],
            }
        })
        .to_vec();
    // Each panel keeps its own scale, as in the paper: the shape is what is shown.
    let panels = panels.into_iter().map(fitted).collect();
    Chart {
        title: "Hanrahan and Krueger, Figure 3: phase functions".to_owned(),
        columns: 2,
        panels,
    }
}

/// The panel with a horizontal range just wide enough.
fn fitted(mut panel: Panel) -> Panel {
    let xs = || {
        panel
            .lines
            .iter()
            .flat_map(|l| l.points.iter().map(|p| p.0))
    };
    let (low, high) = (xs().fold(0.0, f64::min), xs().fold(0.0, f64::max));
    panel.x_range = Some((low, high));
    panel
}

fn slab(albedo: f64, tau: f64, g: f64, eta: f64) -> LayeredMedium {
    LayeredMedium {
        layers: vec![Layer {
            sigma_a: 1.0 - albedo,
            sigma_s: albedo,
            phase: Phase::HenyeyGreenstein { g },
            eta,
            thickness_mm: tau.is_finite().then_some(tau),
        }],
        eta_above: 1.0,
        eta_below: 1.0,
    }
}

fn model(medium: LayeredMedium) -> FirstOrder {
    FirstOrder::new(medium, Reflections::None).expect("the media of figures are media")
}

/// A diagram of directions in the plane of incidence: reflected light above the surface,
/// transmitted light below, light coming in from the upper left.
fn rose(f: impl Fn(f64, f64) -> f64, sign: f64) -> Vec<(f64, f64)> {
    grid(-89.9, 89.9, 180)
        .map(|angle| {
            let radians = angle.to_radians();
            let value = f(radians.cos(), if angle < 0.0 { -1.0 } else { 1.0 });
            (value * radians.sin(), sign * value * radians.cos())
        })
        .collect()
}

/// Light on both sides of the surface, as roses of `f(cos_out, side)`.
fn lobes(reflected: impl Fn(f64, f64) -> f64, transmitted: impl Fn(f64, f64) -> f64) -> Vec<Line> {
    vec![
        line("reflected", Stroke::Full, rose(reflected, 1.0)),
        line("transmitted", Stroke::Full, rose(transmitted, -1.0)),
    ]
}

/// A panel of roses.
fn polar(title: String, lines: Vec<Line>) -> Panel {
    fitted(Panel {
        title,
        x: "along the surface (sr⁻¹)".to_owned(),
        y: "along the normal".to_owned(),
        x_range: None,
        scale: Scale::Equal,
        lines,
    })
}

fn first_orders() -> Chart {
    let mut panels = vec![];
    let cos_in = 45_f64.to_radians().cos();
    for tau in [0.5, 1.0, 2.0] {
        for g in [-0.3, 0.0, 0.6] {
            let model = model(slab(1.0, tau, g, 1.0));
            let at = |cos_out, cos_azimuth| Directions {
                cos_in,
                cos_out,
                cos_azimuth,
            };
            panels.push(polar(
                format!("g = {g}, optical depth {tau}"),
                lobes(|c, s| model.brdf(&at(c, s)), |c, s| model.btdf(&at(c, s))),
            ));
        }
    }
    Chart {
        title: "Hanrahan and Krueger, Figure 4: first order, albedo 1, in at 45°".to_owned(),
        columns: 3,
        panels,
    }
}

fn surface_and_subsurface() -> Chart {
    let mut panels = vec![];
    let model = model(slab(0.9, 1.0, 0.6, WATER));
    for degrees in [10.0, 40.0, 65.0] {
        let (sin_in, cos_in) = f64::to_radians(degrees).sin_cos();
        let at = |cos_out, cos_azimuth| Directions {
            cos_in,
            cos_out,
            cos_azimuth,
        };
        let reflected = fresnel::reflectance(WATER, cos_in);
        // A normalised cosine lobe about the mirror direction.
        let surface = |cos_out: f64, side: f64| {
            let sin_out = (1.0 - cos_out * cos_out).sqrt() * side;
            let away = (cos_in * cos_out + sin_in * sin_out).max(0.0);
            reflected * (SURFACE_EXPONENT + 1.0) / (2.0 * PI) * away.powf(SURFACE_EXPONENT)
        };
        let parts: [(&str, Vec<Line>); 3] = [
            (
                "surface",
                vec![line("reflected", Stroke::Full, rose(surface, 1.0))],
            ),
            (
                "subsurface",
                lobes(|c, s| model.brdf(&at(c, s)), |c, s| model.btdf(&at(c, s))),
            ),
            (
                "sum",
                lobes(
                    |c, s| surface(c, s) + model.brdf(&at(c, s)),
                    |c, s| model.btdf(&at(c, s)),
                ),
            ),
        ];
        for (name, lines) in parts {
            panels.push(polar(format!("{name}, in at {degrees}°"), lines));
        }
    }
    Chart {
        title: format!(
            "Hanrahan and Krueger, Figure 5: n 1.33, albedo 0.9, depth 1, g 0.6; surface: a lobe \
             of exponent {SURFACE_EXPONENT}"
        ),
        columns: 3,
        panels,
    }
}

/// The white limit is left out by a thousandth; the share of order k goes with the k-th power of
/// the albedo, so that one run serves all.
fn orders(blocks: u64, monitor: &dyn Monitor) -> Result<Chart> {
    let spec = TallySpec {
        orders: 10,
        ..TallySpec::default()
    };
    let half_space = |albedo| slab(albedo, f64::INFINITY, 0.0, 1.0);
    let simulation =
        Simulation::new(half_space(NEARLY_WHITE), Incidence::PENCIL, &spec, 1).fault("figure 8")?;
    let tally = follow(&simulation, 0..blocks, monitor)?;
    let by_order = tally.by_order(Side::Above).bins;
    // Denser toward 1, where all orders together rise steeply.
    let albedos = grid(0.0, 1.0, 50).map(|x| 1.0 - (1.0 - x) * (1.0 - x));
    let mut lines = vec![];
    for highest in 1..=10_usize {
        let points = albedos
            .clone()
            .map(|albedo| {
                let shares = (1..=highest)
                    .map(|k| by_order[k].value * (albedo / NEARLY_WHITE).powi(k as i32));
                (albedo, shares.sum())
            })
            .collect();
        let (name, stroke) = match highest {
            1 => ("first order", Stroke::Full),
            2 => ("up to second order", Stroke::Full),
            _ => ("up to third, … tenth order", Stroke::Dashed),
        };
        lines.push(line(name, stroke, points));
    }
    let total = albedos
        .map(|albedo| {
            if albedo == 0.0 {
                return Ok((0.0, 0.0));
            }
            let medium = half_space(albedo.min(1.0 - 1e-9));
            let response = layers::solve(&medium, &[1.0], &[]).fault("figure 8")?;
            Ok((albedo, response.reflectance[0]))
        })
        .collect::<Result<Vec<_>>>()?;
    lines.push(line("all orders", Stroke::Full, total));
    Ok(Chart {
        title: "Hanrahan and Krueger, Figure 8: orders of scattering".to_owned(),
        columns: 1,
        panels: vec![Panel {
            title: "half-space, isotropic, normal incidence".to_owned(),
            x: "albedo".to_owned(),
            y: "reflectance".to_owned(),
            x_range: Some((0.0, 1.0)),
            scale: Scale::Linear,
            lines,
        }],
    })
}

fn forty_five_degrees(blocks: u64, monitor: &dyn Monitor) -> Result<Chart> {
    const BINS: usize = 18;
    let angle = 45_f64.to_radians();
    let mut panels = vec![];
    for albedo in [0.4, 0.8] {
        let medium = slab(albedo, f64::INFINITY, 0.0, 1.0);
        let spec = TallySpec {
            angle_bins: BINS,
            azimuth_bins: 1,
            orders: 1,
            ..TallySpec::default()
        };
        let incidence = Incidence {
            direction: Direction::Collimated { angle },
            ..Incidence::PENCIL
        };
        let simulation = Simulation::new(medium.clone(), incidence, &spec, 2).fault("figure 9")?;
        let tally = follow(&simulation, 0..blocks, monitor)?;
        let counted = tally
            .by_order_and_direction(Side::Above)
            .expect("the tally was asked for");
        let model = model(medium);
        let middle = |i: usize| 90.0 * (i as f64 + 0.5) / BINS as f64;
        // Isotropic scattering does not know the azimuth.
        let exact = |degrees: f64| {
            model.brdf(&Directions {
                cos_in: angle.cos(),
                cos_out: degrees.to_radians().cos(),
                cos_azimuth: 1.0,
            })
        };
        let by_photons = |orders: std::ops::Range<usize>| -> Vec<(f64, f64)> {
            (0..BINS)
                .map(|i| {
                    let edge = |k: usize| (90.0 * k as f64 / BINS as f64).to_radians();
                    let measure = PI * (edge(i + 1).sin().powi(2) - edge(i).sin().powi(2));
                    let share: f64 = orders
                        .clone()
                        .map(|order| counted[order].cells[i * 2].value)
                        .sum();
                    (middle(i), share / measure)
                })
                .collect()
        };
        panels.push(Panel {
            title: format!("albedo {albedo}"),
            x: "angle of reflection (degrees)".to_owned(),
            y: "BRDF (sr⁻¹)".to_owned(),
            x_range: Some((0.0, 90.0)),
            scale: Scale::Linear,
            lines: vec![
                line(
                    "Seeliger's law",
                    Stroke::Full,
                    grid(0.0, 89.9, 90).map(|a| (a, exact(a))).collect(),
                ),
                line("first order, counted", Stroke::Dots, by_photons(1..2)),
                line("all orders, counted", Stroke::Dashed, by_photons(1..3)),
                line("all but the first", Stroke::Dashed, by_photons(2..3)),
            ],
        });
    }
    Ok(Chart {
        title: "Hanrahan and Krueger, Figure 9: BRDF at 45°".to_owned(),
        columns: 2,
        panels,
    })
}

/// Figure 6 of Jensen et al.: the dipole with marble's coefficients, and photons. The paper's
/// measured points were never published.
fn marble(blocks: u64, monitor: &dyn Monitor) -> Result<Chart> {
    let marble = library::material("marble")?;
    let mut panels = vec![];
    let green = marble
        .iter()
        .find(|m| m.channel == "G")
        .expect("the shipped marble has a green channel");
    let reduced = green.medium;
    let radius_mm: Vec<f64> = (0..=120)
        .map(|i| 0.1 * 250_f64.powf(f64::from(i) / 120.0))
        .collect();
    let spec = TallySpec {
        radius_mm: std::iter::once(0.0)
            .chain((0..=60).map(|i| 0.1 * 250_f64.powf(f64::from(i) / 60.0)))
            .collect(),
        ..TallySpec::default()
    };
    let medium = LayeredMedium::half_space(&reduced.with_g(0.0));
    let simulation = Simulation::new(medium, Incidence::PENCIL, &spec, 3).fault("figure 6")?;
    let tally = follow(&simulation, 0..blocks, monitor)?;
    let entering = fresnel::entry_factor(reduced.eta, 1.0);
    let photons = tally.profile(Side::Above)[1..]
        .iter()
        .map(|p| (p.radius_mm, p.reflectance_per_mm2 / entering))
        .collect();
    let dipole = Dipole::new(&reduced, DiffuseFresnel::Exact);
    let closed = radius_mm
        .iter()
        .map(|&r| (r, dipole.diffuse_reflectance(r)))
        .collect();
    let model = library::model(
        &library::ModelChoice {
            name: "monte-carlo".to_owned(),
            g: Some(0.0),
            ..library::ModelChoice::default()
        },
        reduced.eta,
    )?;
    let mut exact = vec![0.0; radius_mm.len()];
    model.diffuse_reflectance(reduced.coefficients(), &radius_mm, &mut exact);
    panels.push(Panel {
        title: "marble, green".to_owned(),
        x: "distance r (mm)".to_owned(),
        y: "Rᵈ (mm⁻²), per power that enters".to_owned(),
        x_range: Some((0.1, 25.0)),
        scale: Scale::Logarithmic,
        lines: vec![
            line("dipole", Stroke::Full, closed),
            line("Monte Carlo", Stroke::Dots, photons),
            line(
                "transport equation",
                Stroke::Dashed,
                radius_mm.iter().copied().zip(exact).collect(),
            ),
        ],
    });
    Ok(Chart {
        title: "Jensen et al. 2001, Figure 6: the dipole and Monte Carlo".to_owned(),
        columns: 1,
        panels,
    })
}

/// What section 2 of Jensen et al. returns of the light, term by term: not a figure of the paper,
/// but what its reader should know.
fn energy_by_albedo() -> Result<Chart> {
    let mut panels = vec![];
    // Indices of the paper's materials.
    for eta in [1.3, 1.5] {
        let audits = grid(0.03, 1.0, 40)
            .map(|x| 1.0 - (1.0 - x).powi(2) - 1e-6)
            .map(|albedo| Ok((albedo, energy(albedo, eta)?)))
            .collect::<Result<Vec<_>>>()?;
        let of = |name, stroke, f: &dyn Fn(&Energy) -> f64| {
            let points = audits.iter().map(|(albedo, e)| (*albedo, f(e))).collect();
            line(name, stroke, points)
        };
        panels.push(Panel {
            title: format!("η {eta}, isotropic, normal incidence"),
            x: "albedo".to_owned(),
            y: "share of the incident light returned".to_owned(),
            x_range: Some((0.0, 1.0)),
            scale: Scale::Linear,
            lines: vec![
                of("exact (adding-doubling)", Stroke::Full, &|e| e.exact),
                of("diffuse term", Stroke::Dashed, &|e| e.diffuse),
                of("single scattering", Stroke::Dashed, &|e| e.single),
                of("both, 1/η² mended", Stroke::Full, &Energy::both),
                of("both, as printed", Stroke::Dashed, &Energy::both_as_printed),
            ],
        });
    }
    Ok(Chart {
        title: "Jensen et al. 2001: the energy of the BSSRDF".to_owned(),
        columns: 2,
        panels,
    })
}
