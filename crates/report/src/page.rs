//! One page that holds a whole measurement.

use crate::channel::{ChannelReport, ModelReport};
use crate::figure::{STYLE, comparison, drawing, shown_chi2};
use crate::markup::{data_url, escaped, html, sentence};
use crate::number::{at_most, exact, fixed, interval, significant, uncertain};
use crate::picture::{self, Picture};
use fit::{Constraint, Estimate, Termination};
use std::fmt::Write;

const PAGE_STYLE: &str = include_str!("page.css");
/// Enlarges figures; it has neither `<` nor `&`, which would mean one thing to HTML and another to
/// XML.
const SCRIPT: &str = include_str!("zoom.js");
/// SHA-256 of [`SCRIPT`]: the policy of the page lets this script run and no other. A test in Python
/// computes it anew.
const SCRIPT_SHA256: &str = "o8LIqZLlnFkRIpNL8feE3HOtegtPSaqfQXTupPEsuWw=";

/// Of more channels than this each has its figures folded away under a line with its numbers, and its
/// points without words for the pointer, which would be half of the page.
const MANY: usize = 8;

/// A measurement of one material, as the page shows it.
///
/// All text may come from outside: it is made safe here.
#[derive(Clone, Debug)]
pub struct Report<'a> {
    /// Name of the material.
    pub material: &'a str,
    /// Index of the material over that of its surroundings.
    pub eta: f64,
    /// Its standard uncertainty; 0 if it was taken as exact.
    pub u_eta: f64,
    /// Name of the forward model, as in the table of materials.
    pub model: &'a str,
    /// What the total reflectance did to the fit.
    pub constraint: Constraint,
    /// The channels, in the order in which they are shown.
    pub channels: Vec<ChannelReport<'a>>,
    /// What a user should know of the measurement as a whole, one sentence each. The warnings of
    /// the fits are taken from the fits.
    pub warnings: Vec<String>,
    /// Defaults and estimates that stood in for what was not given, one sentence each.
    pub assumptions: Vec<String>,
    /// What every model that applies makes of each channel, in the order of `channels`; empty where
    /// it was not asked.
    pub comparison: Vec<Vec<ModelReport<'a>>>,
    /// How far the numbers can be trusted, one sentence each.
    pub verdict: Vec<String>,
    /// What photon counting says of the fits, one sentence each.
    pub confirmation: Vec<String>,
    /// What the beam and the blur of each channel are, and how they are known; one sentence each.
    pub beam: Vec<String>,
    /// What else became of the frames, one sentence each.
    pub merge: Vec<String>,
    /// What each exposure gave.
    pub exposures: Vec<ExposureRow>,
    /// The merged picture of each channel; empty where there is none.
    pub pictures: Vec<Picture>,
    /// The material as a renderer shows it, or a sentence on why there is no such picture.
    pub swatch: Result<Swatch, String>,
    /// Name and version of the program.
    pub tool: &'a str,
    /// What was chosen, seeds among it: a name and its value each.
    pub settings: Vec<(String, String)>,
    /// The files that were read.
    pub inputs: Vec<Input>,
}

/// A picture of the material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Swatch {
    /// A PNG.
    pub png: Vec<u8>,
    /// Pixels of a row, and rows.
    pub size: [usize; 2],
    /// What it shows, in a sentence or two.
    pub caption: String,
}

/// One exposure of one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct ExposureRow {
    /// Of the sample or of the reference.
    pub subject: String,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Share of the pixels that were used, and of those left out as saturated, channel by channel.
    pub used_and_saturated: Vec<[f64; 2]>,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Its name as the capture gives it; no absolute path.
    pub name: String,
    /// BLAKE3 of its bytes, in hexadecimal.
    pub blake3: String,
}

/// The page of `report`: one HTML file that loads nothing, follows the reader's choice of light or
/// dark, and prints. Its script enlarges figures; without it a box beside each figure does.
///
/// It is well-formed XML as well.
pub fn report_html(report: &Report) -> String {
    let mut out = String::new();
    let material = escaped(report.material);
    // The policy makes "loads nothing" a promise that the browser keeps.
    let _ = write!(
        out,
        "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n\
         <meta charset=\"utf-8\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src \
         'unsafe-inline'; img-src data:; script-src 'sha256-{SCRIPT_SHA256}'\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{material} – beamspot report</title>\n\
         <style>\n{PAGE_STYLE}{STYLE}</style>\n</head>\n<body>\n<h1>{material}</h1>\n{}",
        lead(report)
    );
    warnings(&mut out, report);
    coefficients(&mut out, report);
    lengths(&mut out, report);
    swatch(&mut out, report);
    fits(&mut out, report);
    totals(&mut out, report);
    if report.channels.iter().any(|c| c.truth.is_some()) {
        truths(&mut out, report);
    }
    list(&mut out, "Verdict", &report.verdict);
    out.push_str("<h2>Profiles, fits and residuals</h2>\n");
    explanation(&mut out, report);
    let many = many(report);
    for channel in &report.channels {
        let name = escaped(&channel.name());
        let about = format!(
            "{name}: σₛ′ {} mm⁻¹, σₐ {} mm⁻¹",
            channel.sigma_s_prime(),
            channel.sigma_a()
        );
        let drawing = drawing(report.material, channel, "", !many);
        folded(&mut out, many, &html(&about), |out| figure(out, &drawing));
    }
    models_side_by_side(&mut out, report);
    pictures(&mut out, report);
    exposures(&mut out, report);
    budgets(&mut out, report);
    list(&mut out, "Confirmation", &report.confirmation);
    list(&mut out, "Beam, blur and stray light", &report.beam);
    list(&mut out, "Assumptions", &report.assumptions);
    provenance(&mut out, report);
    let _ = write!(out, "<script>{SCRIPT}</script>\n</body>\n</html>\n");
    out
}

/// Whether there are more channels than a reader scrolls through.
fn many(report: &Report) -> bool {
    report.channels.len() > MANY
}

/// What a reader opens by its summary, HTML already, where there is much of its kind.
fn folded(out: &mut String, much: bool, summary: &str, content: impl FnOnce(&mut String)) {
    if !much {
        return content(out);
    }
    let _ = writeln!(out, "<details><summary>{summary}</summary>");
    content(out);
    out.push_str("</details>\n");
}

/// A figure that can be enlarged.
fn figure(out: &mut String, drawing: &str) {
    let _ = writeln!(
        out,
        "<figure>\n<label class=\"enlarge\"><input type=\"checkbox\"/> enlarge</label>\n<div \
         class=\"view\">\n{drawing}</div>\n</figure>"
    );
}

fn swatch(out: &mut String, report: &Report) {
    match &report.swatch {
        Ok(swatch) => {
            let [width, height] = swatch.size;
            let _ = writeln!(
                out,
                "<figure class=\"swatch\"><img width=\"{width}\" height=\"{height}\" alt=\"{0}\" \
                 src=\"{1}\"/><figcaption>{0}</figcaption></figure>",
                escaped(&swatch.caption),
                data_url(&swatch.png)
            );
        }
        Err(reason) => {
            let _ = writeln!(
                out,
                "<p class=\"quiet\">No picture of the material: {}.</p>",
                sentence(reason)
            );
        }
    }
}

/// What the lines beside the model are, where there are some.
fn explanation(out: &mut String, report: &Report) {
    let any = |of: fn(&ChannelReport) -> bool| report.channels.iter().any(of);
    let mut text = String::new();
    if any(|c| !c.u_model_per_mm2.is_empty()) {
        text.push_str(
            "The band about the model is what the standard uncertainties of σₛ′ and σₐ, with their \
             correlation, make of it. ",
        );
    }
    if any(|c| !c.transport.is_empty()) {
        text.push_str(
            "A medium with the very coefficients that were found is also shown as the transport \
             equation has it, without noise: where that line leaves the model, the model is wrong, \
             and its error is part of u unless it was told to be left out. Where the model knows no \
             g the line has g = 0, which shows within a mean free path or two of the beam. ",
        );
    }
    if any(|c| !c.monte_carlo.is_empty()) {
        text.push_str("Counted photons say the same, with their noise. ");
    }
    if !text.is_empty() {
        let _ = writeln!(out, "<p class=\"quiet\">{}</p>", html(text.trim_end()));
    }
}

fn pictures(out: &mut String, report: &Report) {
    if report.pictures.is_empty() {
        return;
    }
    out.push_str(
        "<h2>Pictures</h2>\n<p class=\"quiet\">All exposures in one, on a logarithmic scale, with \
         what the profile took of it.</p>\n",
    );
    for picture in &report.pictures {
        let drawing = picture::drawing(report.material, picture, "");
        folded(out, many(report), &escaped(&picture.channel), |out| {
            figure(out, &drawing);
        });
    }
}

fn exposures(out: &mut String, report: &Report) {
    if report.exposures.is_empty() && report.merge.is_empty() {
        return;
    }
    out.push_str("<h2>Frames</h2>\n");
    if !report.exposures.is_empty() {
        let names: Vec<String> = report.channels.iter().map(ChannelReport::name).collect();
        let titles = names
            .iter()
            .flat_map(|name| [format!("{name} used"), format!("{name} saturated")]);
        let header: Vec<String> = ["picture".to_owned(), "exposure (s)".to_owned()]
            .into_iter()
            .chain(titles)
            .collect();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let row = |r: &ExposureRow| {
            let shares = r.used_and_saturated.iter().flat_map(|[used, saturated]| {
                let used = match *used {
                    0.0 => "dropped".to_owned(),
                    used => format!("{} %", fixed(100.0 * used, 2)),
                };
                [used, format!("{} %", fixed(100.0 * saturated, 2))]
            });
            let first = [escaped(&r.subject), html(&exact(r.exposure_s))];
            first.into_iter().chain(shares).collect()
        };
        let rows: Vec<Vec<String>> = report.exposures.iter().map(row).collect();
        table(
            out,
            "Share of the pixels that each exposure gave, and share that was left out of it as \
             saturated or beside what is.",
            &header,
            &rows,
        );
    }
    items(out, &report.merge);
}

fn lead(report: &Report) -> String {
    let total = match report.constraint {
        Constraint::Exact => "the total reflectance taken as exact",
        Constraint::Joint => {
            "the total reflectance as one more datum, which shares its scale with the profile"
        }
        Constraint::None => "the profile alone, without its total",
    };
    format!(
        "<p>Relative refractive index η = {}. Model <b>{}</b>, fitted with {total}.</p>\n\
         <p class=\"quiet\">± is the standard uncertainty (one sigma). Coefficients are of a \
         homogeneous medium; lengths are in mm.</p>\n",
        uncertain(report.eta, report.u_eta),
        escaped(report.model)
    )
}

fn warnings(out: &mut String, report: &Report) {
    let mut items: Vec<String> = report.warnings.iter().map(|w| sentence(w)).collect();
    for channel in &report.channels {
        let name = escaped(&channel.name());
        if channel.fit.termination == Termination::OutOfEvaluations {
            items.push(format!(
                "<b>{name}</b>: the search stopped before it converged; the numbers are its best \
                 so far"
            ));
        }
        let sentences = channel
            .fit
            .warnings
            .iter()
            .map(|w| sentence(&w.to_string()));
        items.extend(sentences.map(|w| format!("<b>{name}</b>: {w}")));
    }
    if items.is_empty() {
        return;
    }
    out.push_str("<section class=\"warnings\">\n<h2>Warnings</h2>\n<ul>\n");
    for item in items {
        let _ = writeln!(out, "<li>{item}</li>");
    }
    out.push_str("</ul>\n</section>\n");
}

/// A table with one line per channel under what it says; the cells are HTML already.
fn table(out: &mut String, about: &str, header: &[&str], rows: &[Vec<String>]) {
    let _ = write!(
        out,
        "<p class=\"quiet\">{}</p>\n<div class=\"scroll\"><table>\n<thead><tr>",
        html(about)
    );
    for cell in header {
        let _ = write!(out, "<th scope=\"col\">{}</th>", html(cell));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in rows {
        out.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            let _ = match i {
                0 => write!(out, "<th scope=\"row\">{cell}</th>"),
                _ => write!(out, "<td>{cell}</td>"),
            };
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table></div>\n");
}

fn coefficients(out: &mut String, report: &Report) {
    let interval = |e: &Estimate| html(&interval(e.ci95));
    let rows: Vec<Vec<String>> = report
        .channels
        .iter()
        .map(|c| {
            vec![
                escaped(&c.name()),
                html(&c.sigma_s_prime()),
                interval(&c.fit.sigma_s_prime),
                html(&c.sigma_a()),
                interval(&c.fit.sigma_a),
                fixed(c.fit.correlation, 3).replace('-', "−"),
            ]
        })
        .collect();
    out.push_str("<h2>Coefficients</h2>\n");
    table(
        out,
        "Reduced scattering σₛ′ and absorption σₐ, with 95 % intervals and the correlation of \
         their errors. The sign < marks an upper limit, which holds with 95 %.",
        &[
            "channel",
            "σₛ′ (mm⁻¹)",
            "95 %",
            "σₐ (mm⁻¹)",
            "95 %",
            "correlation",
        ],
        &rows,
    );
}

fn lengths(out: &mut String, report: &Report) {
    let rows: Vec<Vec<String>> = report
        .channels
        .iter()
        .map(|c| {
            vec![
                escaped(&c.name()),
                html(&c.mean_free_path()),
                html(&c.decay_length()),
                html(&c.albedo_prime()),
                html(&significant(c.total_reflectance, 4)),
            ]
        })
        .collect();
    table(
        out,
        "What follows from them: transport mean free path 1/σₜ′ with σₜ′ = σₐ + σₛ′, decay length \
         1/σₜᵣ with σₜᵣ² = 3 σₐ σₜ′, reduced albedo α′ = σₛ′/σₜ′, and the model's total \
         reflectance Rᵈ of the light that enters.",
        &["channel", "1/σₜ′ (mm)", "1/σₜᵣ (mm)", "α′", "Rᵈ"],
        &rows,
    );
}

fn fits(out: &mut String, report: &Report) {
    let row = |c: &ChannelReport| {
        let fit = c.fit;
        let (start, end) = fit.range_mm;
        vec![
            escaped(&c.name()),
            html(&format!(
                "{} to {}",
                significant(start, 3),
                significant(end, 3)
            )),
            format!("{} of {}", fit.residuals.len(), c.profile.points.len()),
            html(&shown_chi2(fit.reduced_chi2)),
            html(ended(fit.termination)),
            fit.evaluations.to_string(),
        ]
    };
    out.push_str("<h2>Quality of the fit</h2>\n");
    table(
        out,
        "The radii that took part, how many of the measured points lie there, and χ² per degree \
         of freedom: 1 where the residuals are as large as their noise.",
        &[
            "channel",
            "range (mm)",
            "points",
            "reduced χ²",
            "search",
            "evaluations",
        ],
        &report.channels.iter().map(row).collect::<Vec<_>>(),
    );
}

fn totals(out: &mut String, report: &Report) {
    let row = |c: &ChannelReport| {
        let fit = c.fit;
        let (measured, model, circle) = match &fit.total {
            Some(total) => (
                uncertain(total.measured, total.u),
                significant(total.model * fit.scale, 4),
                total
                    .radius_max_mm
                    .map_or("whole plane".to_owned(), |r| significant(r, 3)),
            ),
            None => ("not given".to_owned(), "–".to_owned(), "–".to_owned()),
        };
        let outside = format!("{} %", significant(100.0 * fit.share_outside, 2));
        let cells = [measured, model, circle, significant(fit.scale, 4), outside];
        std::iter::once(escaped(&c.name()))
            .chain(cells.iter().map(|c| html(c)))
            .collect()
    };
    out.push_str("<h2>Total reflectance</h2>\n");
    table(
        out,
        "Per incident power, inside the circle of the measured one. Its u is its own part alone; \
         the scale, which it shares with the profile, is fitted along, and the model's total \
         includes it. By the model so much of the light leaves beyond the last radius.",
        &[
            "channel",
            "measured",
            "model",
            "within (mm)",
            "scale",
            "light beyond",
        ],
        &report
            .channels
            .iter()
            .map(row)
            .collect::<Vec<Vec<String>>>(),
    );
}

/// How a search ended.
fn ended(termination: Termination) -> &'static str {
    match termination {
        Termination::Converged => "converged",
        Termination::AtBound => "ended at σₐ = 0",
        Termination::OutOfEvaluations => "stopped early",
    }
}

/// The models side by side.
fn models_side_by_side(out: &mut String, report: &Report) {
    if report.comparison.iter().all(Vec::is_empty) {
        return;
    }
    out.push_str("<h2>Models side by side</h2>\n");
    for (channel, models) in report.channels.iter().zip(&report.comparison) {
        let rows: Vec<Vec<String>> = models
            .iter()
            .map(|model| {
                let fit = model.fit;
                let sigma_a = match fit.upper_limit {
                    Some(limit) => at_most(limit),
                    None => uncertain(fit.sigma_a.value, fit.sigma_a.u),
                };
                vec![
                    escaped(model.name),
                    html(&uncertain(fit.sigma_s_prime.value, fit.sigma_s_prime.u)),
                    html(&sigma_a),
                    html(&significant(model.total_reflectance, 4)),
                    html(&significant(fit.scale, 4)),
                    html(&shown_chi2(fit.reduced_chi2)),
                    html(ended(fit.termination)),
                ]
            })
            .collect();
        let name = escaped(&channel.name());
        table(
            out,
            &format!(
                "Channel {name}. Rᵈ is each model's total of the light that enters; u holds what \
                 the budget names, and not the error of the model itself."
            ),
            &[
                "model",
                "σₛ′ (mm⁻¹)",
                "σₐ (mm⁻¹)",
                "Rᵈ",
                "scale",
                "reduced χ²",
                "search",
            ],
            &rows,
        );
        let drawing = comparison::drawing(report.material, channel, models, !many(report));
        figure(out, &drawing);
        let said = models.iter().flat_map(|model| {
            let warnings = model.fit.warnings.iter();
            warnings.map(|w| format!("{}: {w}", model.name))
        });
        let said: Vec<String> = said.collect();
        items(out, &said);
    }
}

/// The fit beside the coefficients that made the data.
fn truths(out: &mut String, report: &Report) {
    let pull = |e: &Estimate, truth: f64| {
        let pull = (e.value - truth) / e.u;
        if pull.is_finite() {
            format!("{} u", fixed(pull, 2).replace('-', "−"))
        } else {
            "–".to_owned()
        }
    };
    let rows: Vec<Vec<String>> = report
        .channels
        .iter()
        .filter_map(|c| c.truth.map(|truth| (c, truth)))
        .map(|(c, truth)| {
            vec![
                escaped(&c.name()),
                html(&exact(truth.sigma_s_prime)),
                pull(&c.fit.sigma_s_prime, truth.sigma_s_prime),
                html(&exact(truth.sigma_a)),
                match c.fit.upper_limit {
                    Some(limit) if truth.sigma_a <= limit => "below the limit".to_owned(),
                    Some(_) => "above the limit".to_owned(),
                    None => pull(&c.fit.sigma_a, truth.sigma_a),
                },
            ]
        })
        .collect();
    out.push_str("<h2>Against the truth</h2>\n");
    table(
        out,
        "The coefficients that the synthetic data were made with, and how far the fit is from \
         them in its own standard uncertainties.",
        &[
            "channel",
            "true σₛ′ (mm⁻¹)",
            "off by",
            "true σₐ (mm⁻¹)",
            "off by",
        ],
        &rows,
    );
}

/// Where the uncertainty of each channel comes from, the largest part first.
fn budgets(out: &mut String, report: &Report) {
    let channels: Vec<&ChannelReport> = report
        .channels
        .iter()
        .filter(|c| !c.fit.budget.is_empty())
        .collect();
    if channels.is_empty() {
        return;
    }
    out.push_str("<h2>Uncertainty budget</h2>\n");
    for c in channels {
        let fit = c.fit;
        let share = |u: f64, whole: f64| {
            let percent = 100.0 * (u / whole).powi(2);
            if percent.is_finite() { percent } else { 0.0 }
        };
        let mut lines: Vec<_> = fit.budget.iter().collect();
        lines.sort_by(|a, b| b.u_sigma_a.total_cmp(&a.u_sigma_a));
        let rows: Vec<Vec<String>> = lines
            .iter()
            .map(|l| {
                let (of_s, of_a) = (
                    share(l.u_sigma_s_prime, fit.sigma_s_prime.u),
                    share(l.u_sigma_a, fit.sigma_a.u),
                );
                vec![
                    escaped(&l.source),
                    html(&significant(l.u_sigma_s_prime, 2)),
                    bar(of_s),
                    html(&significant(l.u_sigma_a, 2)),
                    bar(of_a),
                    fixed(l.correlation, 2).replace('-', "−"),
                    if l.degrees_of_freedom.is_finite() {
                        fixed(l.degrees_of_freedom, 0)
                    } else {
                        "∞".to_owned()
                    },
                ]
            })
            .collect();
        let about = format!(
            "{}: standard uncertainty of each coefficient that comes from one input, mm⁻¹, its \
             share of u², the correlation of the two, and degrees of freedom.",
            c.name()
        );
        let header = [
            "input",
            "u(σₛ′)",
            "of u²",
            "u(σₐ)",
            "of u²",
            "correlation",
            "ν",
        ];
        folded(out, many(report), &escaped(&c.name()), |out| {
            table(out, &about, &header, &rows);
        });
    }
}

/// A share in percent, as a bar with its number.
fn bar(percent: f64) -> String {
    format!(
        "<span class=\"bar\" style=\"width:{}px\"></span> {} %",
        fixed(0.6 * percent.clamp(0.0, 100.0), 1),
        fixed(percent, 1)
    )
}

fn list(out: &mut String, heading: &str, items: &[String]) {
    if items.is_empty() {
        return;
    }
    let _ = writeln!(out, "<h2>{heading}</h2>");
    self::items(out, items);
}

fn items(out: &mut String, items: &[String]) {
    if items.is_empty() {
        return;
    }
    out.push_str("<ul>\n");
    for item in items {
        let _ = writeln!(out, "<li>{}</li>", sentence(item));
    }
    out.push_str("</ul>\n");
}

fn provenance(out: &mut String, report: &Report) {
    let _ = write!(
        out,
        "<h2>Provenance</h2>\n<p>Made by {}.</p>\n",
        escaped(report.tool)
    );
    if !report.settings.is_empty() {
        let row = |(name, value): &(String, String)| vec![escaped(name), html(value)];
        let rows: Vec<Vec<String>> = report.settings.iter().map(row).collect();
        table(
            out,
            "What was chosen; together with the files below it gives the same bytes again.",
            &["setting", "value"],
            &rows,
        );
    }
    if report.inputs.is_empty() {
        return;
    }
    out.push_str(
        "<div class=\"scroll\"><table>\n<thead><tr><th \
         scope=\"col\">file read</th><th scope=\"col\">BLAKE3</th></tr></thead>\n<tbody>\n",
    );
    for Input { name, blake3 } in &report.inputs {
        let _ = writeln!(
            out,
            "<tr><td class=\"file\">{}</td><td class=\"hash\">{}</td></tr>",
            escaped(name),
            escaped(blake3)
        );
    }
    out.push_str("</tbody>\n</table></div>\n");
}
