//! The header of a FITS file: 80-byte cards in blocks of 2880 bytes (FITS Standard 4.0, §3.3, §4).

/// Bytes of a block.
pub(crate) const BLOCK: usize = 2880;
const CARD: usize = 80;

/// The cards of one header.
#[derive(Clone, Debug)]
pub(crate) struct Header<'a> {
    cards: Vec<Card<'a>>,
    /// Where the header's last block ends, bytes from the start.
    pub(crate) end: usize,
}

/// One card: a keyword, its value and what is said of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Card<'a> {
    keyword: &'a str,
    /// The value as written; a text without its quotes and blanks.
    pub(crate) value: &'a str,
    /// The comment behind the slash.
    pub(crate) comment: &'a str,
}

impl<'a> Header<'a> {
    /// The header that starts `bytes`; `None` where it has no end.
    pub(crate) fn read(bytes: &'a [u8]) -> Option<Self> {
        let mut cards = vec![];
        for (i, card) in bytes.chunks_exact(CARD).enumerate() {
            // Cards are ASCII; one that is not says nothing to us.
            let Ok(text) = std::str::from_utf8(card) else {
                continue;
            };
            if text.trim_end() == "END" {
                let end = ((i + 1) * CARD).div_ceil(BLOCK) * BLOCK;
                return Some(Self { cards, end });
            }
            if text.is_char_boundary(8) && text.is_char_boundary(10) && &text[8..10] == "= " {
                let (value, comment) = split(&text[10..]);
                let keyword = text[..8].trim_end();
                cards.push(Card {
                    keyword,
                    value,
                    comment,
                });
            }
        }
        None
    }

    /// The card of `keyword`.
    pub(crate) fn card(&self, keyword: &str) -> Option<Card<'a>> {
        self.cards.iter().find(|c| c.keyword == keyword).copied()
    }

    /// The value of `keyword`.
    pub(crate) fn value(&self, keyword: &str) -> Option<&'a str> {
        self.card(keyword).map(|card| card.value)
    }
}

impl Card<'_> {
    /// The value as a number; FITS may write its exponent with a D.
    pub(crate) fn number(&self) -> Option<f64> {
        let text = self.value.replace(['D', 'd'], "E");
        text.parse().ok().filter(|number: &f64| number.is_finite())
    }
}

/// Value and comment of what stands behind the equals sign.
fn split(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    if let Some(inside) = text.strip_prefix('\'') {
        // A quote inside a text is doubled; no text that we ask for has one.
        let (value, behind) = inside.split_once('\'').unwrap_or((inside, ""));
        let comment = behind.split_once('/').map_or("", |(_, comment)| comment);
        return (value.trim_end(), comment.trim());
    }
    let (value, comment) = text.split_once('/').unwrap_or((text, ""));
    (value.trim(), comment.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_comments_are_told_apart() {
        let mut text = String::new();
        for card in [
            "SIMPLE  =                    T / Fits standard",
            "BUNIT   = 'adu / px'           / unit",
            "EXPOSURE=  5.0D+01 /Exposure time minutes",
            "COMMENT no value = here",
            "END",
        ] {
            text += &format!("{card:80}");
        }
        let header = Header::read(text.as_bytes()).unwrap();
        assert_eq!(header.value("BUNIT"), Some("adu / px"));
        let exposure = header.card("EXPOSURE").unwrap();
        assert_eq!(exposure.number(), Some(50.0));
        assert_eq!(exposure.comment, "Exposure time minutes");
        assert_eq!(header.end, BLOCK);
        assert!(header.card("COMMENT").is_none());
        assert!(Header::read(&text.as_bytes()[..320]).is_none());
    }
}
