//! One page that shows what every method made of a scene.

use crate::markup::{escaped, sentence};
use std::fmt::Write;

const PAGE_STYLE: &str = include_str!("page.css");

/// A scene under several methods.
#[derive(Clone, Debug)]
pub struct ValidationPage {
    /// Name of the scene.
    pub title: String,
    /// The factor on radiances that all pictures share.
    pub exposure: String,
    /// One row a method.
    pub rows: Vec<ValidationRow>,
    /// What else there is to say, one sentence each.
    pub notes: Vec<String>,
    /// Name and version of the program.
    pub tool: &'static str,
}

/// What one method made of it.
#[derive(Clone, Debug)]
pub struct ValidationRow {
    /// Name of the method.
    pub name: String,
    /// File of its picture, beside the page.
    pub picture: String,
    /// File of the difference to transport, and the radiance that has the full colour.
    pub difference: Option<(String, String)>,
    /// File of HDR-FLIP against transport.
    pub flip: Option<String>,
    /// Its numbers, one line each.
    pub lines: Vec<String>,
    /// Powers through the faces of the solids: the head of a table and its rows; of methods that
    /// follow light from its lamp.
    pub faces: Vec<Vec<String>>,
}

/// The page: one HTML file without script; the pictures lie beside it.
pub fn validation_html(page: &ValidationPage) -> String {
    let title = escaped(&page.title);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <title>{title}: methods of rendering</title>\n<style>\n{PAGE_STYLE}\
         .pictures img {{ max-width: 32%; image-rendering: pixelated; }}\n</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n<p>Every picture shows radiance × {} through the sRGB curve. Beside it, \
         the difference to volume transport: red where the model is brighter, blue where it is \
         darker, gray where they agree; and HDR-FLIP, how different the two look, from 0 (black) to 1 \
         (pale yellow).</p>\n",
        escaped(&page.exposure)
    );
    for row in &page.rows {
        let name = escaped(&row.name);
        let _ = writeln!(out, "<h2>{name}</h2>\n<p class=\"pictures\">");
        let _ = writeln!(
            out,
            "<img src=\"{}\" alt=\"{name}\">",
            escaped(&row.picture)
        );
        if let Some((file, full)) = &row.difference {
            let (file, full) = (escaped(file), escaped(full));
            let _ = writeln!(
                out,
                "<img src=\"{file}\" alt=\"{name} less transport\" title=\"full colour at {full}\">"
            );
        }
        if let Some(file) = &row.flip {
            let file = escaped(file);
            let _ = writeln!(
                out,
                "<img src=\"{file}\" alt=\"HDR-FLIP of {name} against transport\">"
            );
        }
        let _ = writeln!(out, "</p>\n<ul>");
        for line in &row.lines {
            let _ = writeln!(out, "<li>{}</li>", sentence(line));
        }
        let _ = writeln!(out, "</ul>");
        if let [head, rows @ ..] = row.faces.as_slice() {
            let line = |cells: &[String], tag: &str| -> String {
                let cell = |c: &String| format!("<{tag}>{}</{tag}>", sentence(c));
                cells.iter().map(cell).collect()
            };
            let _ = writeln!(out, "<table>\n<tr>{}</tr>", line(head, "th"));
            for row in rows {
                let _ = writeln!(out, "<tr>{}</tr>", line(row, "td"));
            }
            let _ = writeln!(out, "</table>");
        }
    }
    if !page.notes.is_empty() {
        let _ = writeln!(out, "<h2>Notes</h2>\n<ul>");
        for note in &page.notes {
            let _ = writeln!(out, "<li>{}</li>", sentence(note));
        }
        let _ = writeln!(out, "</ul>");
    }
    let _ = writeln!(
        out,
        "<footer>{}</footer>\n</body>\n</html>",
        escaped(page.tool)
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_from_outside_is_made_safe() {
        let page = ValidationPage {
            title: "a<b".into(),
            exposure: "2".into(),
            rows: vec![ValidationRow {
                name: "bssrdf".into(),
                picture: "\"x.png".into(),
                difference: Some(("d.png".into(), "3".into())),
                flip: Some("f.png".into()),
                lines: vec!["1 & 2".into()],
                faces: vec![vec!["face".into()], vec!["<top>".into()]],
            }],
            notes: vec!["<script>".into()],
            tool: "beamspot",
        };
        let html = validation_html(&page);
        assert!(
            html.contains("a&lt;b") && html.contains("&quot;x.png"),
            "{html}"
        );
        assert!(
            html.contains("1 &amp; 2") && !html.contains("<script") && html.contains("&lt;top"),
            "{html}"
        );
    }
}
