//! The known name that a misspelt one most likely meant.

/// The candidate that continues `word`, as a unit does that was left out, or else the one with the
/// smallest edit distance, unless every one is too far to be what was meant.
pub(crate) fn nearest<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let distance = |candidate: &str| {
        if word.len() > 2 && candidate.starts_with(word) {
            0
        } else {
            edit_distance(word, candidate)
        }
    };
    candidates
        .into_iter()
        .map(|candidate| (distance(candidate), candidate))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, candidate)| 2 * distance <= word.len().max(candidate.len()))
        .map(|(_, candidate)| candidate)
}

/// Levenshtein's distance: insertions, deletions and substitutions of one character.
fn edit_distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.chars().count()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.chars().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[row.len() - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textbook_distances() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("flaw", "lawn"), 2);
    }

    #[test]
    fn a_typo_finds_its_key_and_nonsense_finds_none() {
        let keys = ["mm_per_pixel", "u_mm_per_pixel", "center_px"];
        assert_eq!(nearest("mm_per_pixl", keys), Some("mm_per_pixel"));
        assert_eq!(
            nearest("sigma_a_per_cm", ["sigma_a_per_mm"]),
            Some("sigma_a_per_mm")
        );
        assert_eq!(nearest("q", keys), None);
        let units = ["sigma_a_per_mm", "sigma_s_prime_per_mm"];
        assert_eq!(
            nearest("sigma_s_prime", units),
            Some("sigma_s_prime_per_mm")
        );
    }
}
