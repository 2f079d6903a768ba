//! Aligned columns for a terminal.

/// `header` and `rows` in columns, the first flush left and the others flush right, two spaces
/// apart, one line each.
///
/// A row may be shorter than the header. Widths are counted in characters.
///
/// # Example
///
/// ```
/// let rows = [vec!["R".to_owned(), "2.19 ± 0.02".to_owned()]];
/// let table = report::text_table(&["channel", "sigma_s' (mm⁻¹)"], &rows);
/// assert_eq!(table, "channel  sigma_s' (mm⁻¹)\nR            2.19 ± 0.02\n");
/// ```
pub fn text_table(header: &[&str], rows: &[Vec<String>]) -> String {
    let header: Vec<String> = header.iter().map(|&cell| cell.to_owned()).collect();
    let lines = || std::iter::once(&header).chain(rows);
    let columns = lines().map(Vec::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns)
        .map(|i| {
            lines()
                .filter_map(|l| l.get(i))
                .map(|c| c.chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    let mut table = String::new();
    for line in lines() {
        let cells = line
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(i, (cell, &width))| {
                if i == 0 {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
        table.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
        table.push('\n');
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_align_on_characters_and_not_on_bytes() {
        let rows = [
            vec!["Crème".to_owned(), "σ".to_owned(), "1.00".to_owned()],
            vec!["Milk".to_owned()],
        ];
        let table = text_table(&["", "a", "b"], &rows);
        assert_eq!(table, "       a     b\nCrème  σ  1.00\nMilk\n");
    }

    #[test]
    fn nothing_makes_an_empty_line() {
        assert_eq!(text_table(&[], &[]), "\n");
    }
}
