//! One page that shows what became of many captures.

use crate::figure::shown_chi2;
use crate::markup::{escaped, html, sentence};
use crate::number::{at_most, uncertain};
use std::fmt::Write;

const PAGE_STYLE: &str = include_str!("page.css");

/// What the page has beyond the style of every page.
const STYLE: &str = "\
p.count { font-size: 1.1rem; }
td.said { white-space: normal; min-width: 14rem; overflow-wrap: anywhere; }
.good { color: #1a7f37; }
.bad { color: #b3261e; font-weight: 600; }
@media screen and (prefers-color-scheme: dark) {
a { color: #8ab4f8; }
.good { color: #6fce87; }
.bad { color: #ff8f85; }
}
";

/// A batch, as the page shows it.
///
/// All text may come from outside: it is made safe here.
#[derive(Clone, Debug)]
pub struct BatchPage<'a> {
    /// One row a capture, in the order of the list.
    pub rows: Vec<BatchRow<'a>>,
    /// Name and version of the program.
    pub tool: &'a str,
}

/// What became of one capture.
#[derive(Clone, Debug)]
pub struct BatchRow<'a> {
    /// Its name.
    pub capture: &'a str,
    /// Its material, where the manifest could be read.
    pub material: Option<&'a str>,
    /// Its own page, relative to this one.
    pub page: String,
    /// What was found, or why nothing was.
    pub channels: Result<Vec<BatchChannel<'a>>, &'a str>,
}

/// One channel of a capture; a standard uncertainty is absent where it has no bound.
#[derive(Clone, Debug)]
pub struct BatchChannel<'a> {
    /// Its name.
    pub channel: &'a str,
    /// σₛ′ and its u, mm⁻¹.
    pub sigma_s_prime: (f64, Option<f64>),
    /// σₐ and its u, mm⁻¹.
    pub sigma_a: (f64, Option<f64>),
    /// σₐ that it does not exceed, mm⁻¹, where it could not be told from 0.
    pub upper_limit: Option<f64>,
    /// χ² per degree of freedom, where it is finite.
    pub reduced_chi2: Option<f64>,
    /// What speaks against it, one sentence each.
    pub bad: &'a [String],
}

/// The page of `batch`: one HTML file without script that loads nothing, and links to the page of
/// each capture.
///
/// It is well-formed XML as well.
pub fn batch_html(batch: &BatchPage) -> String {
    let all = batch.rows.len();
    let failed: Vec<(&str, &str)> = (batch.rows.iter())
        .filter_map(|row| Some((row.capture, *row.channels.as_ref().err()?)))
        .collect();
    let measured = all - failed.len();
    let doubtful = (batch.rows.iter())
        .filter(|row| {
            let channels = row.channels.as_ref();
            channels.is_ok_and(|channels| channels.iter().any(|c| !c.bad.is_empty()))
        })
        .count();
    let verdicts = match doubtful {
        0 => "nothing speaks against any of them".to_owned(),
        1 => "one has a bad verdict".to_owned(),
        n => format!("{n} have a bad verdict"),
    };
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n\
         <meta charset=\"utf-8\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src \
         'unsafe-inline'\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{all} captures – beamspot batch</title>\n\
         <style>\n{PAGE_STYLE}{STYLE}</style>\n</head>\n<body>\n<h1>{all} captures</h1>\n\
         <p class=\"count\">{measured} measured; {verdicts}.</p>\n"
    );
    if !failed.is_empty() {
        let _ = write!(
            out,
            "<section class=\"warnings\">\n<h2>{} not measured</h2>\n<ul>\n",
            failed.len()
        );
        for (capture, error) in failed {
            let _ = writeln!(
                out,
                "<li><b>{}</b>: {}</li>",
                escaped(capture),
                sentence(error)
            );
        }
        out.push_str("</ul>\n</section>\n");
    }
    if measured > 0 {
        table(&mut out, &batch.rows);
    }
    let _ = write!(
        out,
        "<p class=\"quiet\">The same numbers stand in <a href=\"materials.csv\">materials.csv</a>, \
         and what became of each capture in <a href=\"status.csv\">status.csv</a>. Made by {}.</p>\n\
         </body>\n</html>\n",
        escaped(batch.tool)
    );
    out
}

fn table(out: &mut String, rows: &[BatchRow]) {
    out.push_str(
        "<p class=\"quiet\">± is the standard uncertainty (one sigma); the sign &lt; marks an upper \
         limit, which holds with 95 %. A name leads to the report of its capture.</p>\n\
         <div class=\"scroll\"><table>\n<thead><tr><th scope=\"col\">capture</th>\
         <th scope=\"col\">material</th>",
    );
    for head in [
        "channel",
        "σₛ′ (mm⁻¹)",
        "σₐ (mm⁻¹)",
        "reduced χ²",
        "verdict",
    ] {
        let _ = write!(out, "<th scope=\"col\">{}</th>", html(head));
    }
    out.push_str("</tr></thead>\n<tbody>\n");
    for row in rows {
        let Ok(channels) = &row.channels else {
            continue;
        };
        for (index, channel) in channels.iter().enumerate() {
            out.push_str("<tr>");
            if index == 0 {
                let span = channels.len();
                let _ = write!(
                    out,
                    "<th scope=\"rowgroup\" rowspan=\"{span}\"><a href=\"{}\">{}</a></th>\
                     <td rowspan=\"{span}\">{}</td>",
                    escaped(&row.page),
                    escaped(row.capture),
                    escaped(row.material.unwrap_or_default())
                );
            }
            cells(out, channel);
            out.push_str("</tr>\n");
        }
    }
    out.push_str("</tbody>\n</table></div>\n");
}

fn cells(out: &mut String, channel: &BatchChannel) {
    // No bound is no number.
    let shown = |(value, u): (f64, Option<f64>)| uncertain(value, u.unwrap_or(f64::INFINITY));
    let sigma_a = match channel.upper_limit {
        Some(limit) => at_most(limit),
        None => shown(channel.sigma_a),
    };
    let chi2 = channel.reduced_chi2.map_or("–".to_owned(), shown_chi2);
    let _ = write!(
        out,
        "<td>{}</td><td>{}</td><td>{}</td><td>{}</td>",
        escaped(channel.channel),
        html(&shown(channel.sigma_s_prime)),
        html(&sigma_a),
        html(&chi2)
    );
    match channel.bad {
        [] => out.push_str("<td class=\"good\">good</td>"),
        bad => {
            let said: Vec<String> = bad.iter().map(|text| sentence(text)).collect();
            let _ = write!(
                out,
                "<td class=\"said\"><span class=\"bad\">bad</span>: {}</td>",
                said.join("; ")
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_capture_is_there_and_text_from_outside_is_made_safe() {
        let bad = ["too <dark>".to_owned()];
        let channel = |channel, bad| BatchChannel {
            channel,
            sigma_s_prime: (2.62, Some(0.013)),
            sigma_a: (0.0041, None),
            upper_limit: None,
            reduced_chi2: None,
            bad,
        };
        let row = |capture, channels| BatchRow {
            capture,
            material: Some("a<b"),
            page: format!("captures/{capture}/report.html"),
            channels,
        };
        let page = BatchPage {
            rows: vec![
                row("one", Ok(vec![channel("G", &[]), channel("B", &bad)])),
                row("two", Err("sample: no <script> & \"no\" frame")),
            ],
            tool: "beamspot",
        };
        let page = batch_html(&page);
        let options = roxmltree::ParsingOptions {
            allow_dtd: true,
            ..Default::default()
        };
        roxmltree::Document::parse_with_options(&page, options).unwrap();
        for wanted in [
            "<h1>2 captures</h1>",
            "1 measured; one has a bad verdict.",
            "1 not measured",
            "<b>two</b>: sample: no &lt;script&gt; &amp; &quot;no&quot; frame",
            "rowspan=\"2\"><a href=\"captures/one/report.html\">one</a>",
            "2.620 ± 0.013",
            "0.00410 ± unknown",
            "too &lt;dark&gt;",
            "a&lt;b",
        ] {
            assert!(page.contains(wanted), "{wanted}: {page}");
        }
    }
}
