//! Text made safe for SVG and HTML, with the symbols of the field raised and lowered.

/// `text` with every character that means something to XML or HTML spelled out, and those that XML
/// forbids replaced.
pub(crate) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            '\t' | '\n' | '\r' => safe.push(' '),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// The same for HTML with subscripts and superscripts as elements, which every font can draw.
pub(crate) fn html(text: &str) -> String {
    let element = |(level, run): (Level, String)| match level {
        Level::Line => escaped(&run),
        Level::Sub => format!("<sub>{}</sub>", escaped(&run)),
        Level::Super => format!("<sup>{}</sup>", escaped(&run)),
    };
    runs(text).into_iter().map(element).collect()
}

/// The same for the content of an SVG `text`.
pub(crate) fn svg(text: &str) -> String {
    // By dy and not by baseline-shift, which not every viewer knows; dy adds up along the text.
    let mut height = 0.0;
    let element = |(level, run): (Level, String)| {
        let (target, class) = match level {
            Level::Line => (0.0, ""),
            Level::Sub => (3.5, " class=\"small\""),
            Level::Super => (-4.5, " class=\"small\""),
        };
        let dy = target - height;
        height = target;
        let run = escaped(&run);
        if dy == 0.0 {
            run
        } else {
            format!("<tspan{class} dy=\"{dy}\">{run}</tspan>")
        }
    };
    runs(text).into_iter().map(element).collect()
}

/// A sentence of a library, whose symbols are spelled for a terminal, with the symbols themselves.
pub(crate) fn sentence(text: &str) -> String {
    let symbols = text
        .replace("sigma_s'", "σₛ′")
        .replace("sigma_a", "σₐ")
        .replace("mm^-1", "mm⁻¹")
        .replace("mm^-2", "mm⁻²");
    html(&symbols)
}

/// A picture inside a page: the URL that holds the bytes of a PNG.
pub(crate) fn data_url(png: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut url = String::from("data:image/png;base64,");
    for three in png.chunks(3) {
        let bits = (0..3).fold(0, |bits, k| {
            bits << 8 | u32::from(three.get(k).copied().unwrap_or(0))
        });
        for k in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * k) & 63) as usize];
            url.push(if k > three.len() {
                '='
            } else {
                char::from(digit)
            });
        }
    }
    url
}

#[derive(Clone, Copy, PartialEq)]
enum Level {
    Line,
    Sub,
    Super,
}

/// The level of a character, and what it is on the line.
fn level(c: char) -> (Level, char) {
    match c {
        'ₐ' => (Level::Sub, 'a'),
        'ₛ' => (Level::Sub, 's'),
        'ₜ' => (Level::Sub, 't'),
        'ᵣ' => (Level::Sub, 'r'),
        // There is no lowered d; the raised one stands for it.
        'ᵈ' => (Level::Sub, 'd'),
        '⁻' => (Level::Super, '−'),
        '¹' => (Level::Super, '1'),
        '²' => (Level::Super, '2'),
        '³' => (Level::Super, '3'),
        '⁰' | '⁴'..='⁹' => (
            Level::Super,
            char::from_digit(c as u32 - '⁰' as u32, 10).unwrap_or(c),
        ),
        c => (Level::Line, c),
    }
}

/// `text` cut wherever the level changes.
fn runs(text: &str) -> Vec<(Level, String)> {
    let mut runs: Vec<(Level, String)> = vec![];
    for c in text.chars() {
        let (level, c) = level(c);
        match runs.last_mut() {
            Some((last, run)) if *last == level => run.push(c),
            _ => runs.push((level, c.to_string())),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_from_outside_gets_through() {
        assert_eq!(
            escaped("<img src=x onerror=\"a('b')\">&\u{0}\u{ffff}\n"),
            "&lt;img src=x onerror=&quot;a(&#39;b&#39;)&quot;&gt;&amp;\u{fffd}\u{fffd} "
        );
        assert_eq!(html("a<b⁻¹"), "a&lt;b<sup>−1</sup>");
    }

    /// The examples of RFC 4648, section 10.
    #[test]
    fn bytes_are_spelled_in_base_64() {
        for (bytes, expected) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            let url = data_url(bytes.as_bytes());
            assert_eq!(url, format!("data:image/png;base64,{expected}"));
        }
        assert!(data_url(&[0xfb, 0xff]).ends_with("+/8="));
    }

    #[test]
    fn symbols_are_raised_and_lowered() {
        assert_eq!(html("σₜᵣ 10⁻⁴²"), "σ<sub>tr</sub> 10<sup>−42</sup>");
        assert_eq!(
            sentence("sigma_a < 1 mm^-1"),
            "σ<sub>a</sub> &lt; 1 mm<sup>−1</sup>"
        );
        assert_eq!(html("Rᵈ(r)"), "R<sub>d</sub>(r)");
        let small = "tspan class=\"small\"";
        assert_eq!(
            svg("σₐ⁻ b"),
            format!(
                "σ<{small} dy=\"3.5\">a</tspan><{small} dy=\"-8\">−</tspan><tspan dy=\"4.5\"> b</tspan>"
            )
        );
    }
}
