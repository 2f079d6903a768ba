//! Several tables as one.

use physics::Material;
use thiserror::Error;

/// Where a row stands among the tables to merge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Which table, from 0, in the order given.
    pub table: usize,
    /// Which row of it, from 0.
    pub row: usize,
    /// Its σₐ, mm⁻¹.
    pub sigma_a_per_mm: f64,
    /// Its σₛ′, mm⁻¹.
    pub sigma_s_prime_per_mm: f64,
}

/// Two rows for one channel of one material that do not say the same.
#[derive(Clone, Debug, Error, PartialEq)]
#[error(
    "{material} {channel} is given twice with different numbers: sigma_s' {} and sigma_a {} mm^-1 \
     in table {}, row {}; {} and {} mm^-1 in table {}, row {}: rename one of the materials, or \
     remove one row",
    first.sigma_s_prime_per_mm, first.sigma_a_per_mm, first.table + 1, first.row + 1,
    second.sigma_s_prime_per_mm, second.sigma_a_per_mm, second.table + 1, second.row + 1
)]
pub struct Conflict {
    /// Name of the material.
    pub material: String,
    /// Name of the channel.
    pub channel: String,
    /// The first of the rows.
    pub first: Place,
    /// The other one.
    pub second: Place,
}

/// All rows in the order given; of rows that agree in every number the first is kept.
///
/// # Errors
///
/// [`Conflict`] for one channel of one material with different numbers.
pub fn merge(tables: &[Vec<Material>]) -> Result<Vec<Material>, Conflict> {
    let mut merged: Vec<(&Material, Place)> = Vec::new();
    for (table, rows) in tables.iter().enumerate() {
        for (row, material) in rows.iter().enumerate() {
            let place = Place {
                table,
                row,
                sigma_a_per_mm: material.medium.sigma_a,
                sigma_s_prime_per_mm: material.medium.sigma_s_prime,
            };
            let key = |m: &Material| (m.material.clone(), m.channel.clone());
            match merged.iter().find(|(m, _)| key(m) == key(material)) {
                None => merged.push((material, place)),
                Some((before, _)) if same_numbers(before, material) => {}
                Some((_, first)) => {
                    let (material, channel) = key(material);
                    return Err(Conflict {
                        material,
                        channel,
                        first: *first,
                        second: place,
                    });
                }
            }
        }
    }
    Ok(merged
        .into_iter()
        .map(|(material, _)| material.clone())
        .collect())
}

/// All rows in the order given, several for one channel of one material among them; each says in its
/// source which of `names`, one a table, it is from.
pub fn keep_all(tables: Vec<Vec<Material>>, names: &[String]) -> Vec<Material> {
    let tagged = |(rows, name): (Vec<Material>, &String)| -> Vec<Material> {
        let tag = |row: Material| Material {
            source: format!("{}, {name}", row.source),
            ..row
        };
        rows.into_iter().map(tag).collect()
    };
    tables.into_iter().zip(names).flat_map(tagged).collect()
}

fn same_numbers(a: &Material, b: &Material) -> bool {
    Material {
        source: String::new(),
        ..a.clone()
    } == Material {
        source: String::new(),
        ..b.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::ReducedMedium;

    fn row(name: &str, channel: &str, sigma_a: f64) -> Material {
        Material {
            material: name.to_owned(),
            channel: channel.to_owned(),
            wavelength_nm: None,
            medium: ReducedMedium {
                sigma_a,
                sigma_s_prime: 1.0,
                eta: 1.3,
            },
            u_sigma_a_per_mm: None,
            u_sigma_s_prime_per_mm: None,
            correlation: None,
            total_reflectance: None,
            g: None,
            model: "dipole".to_owned(),
            source: "a".to_owned(),
        }
    }

    #[test]
    fn rows_are_kept_in_order_and_equal_ones_once() {
        let first = vec![row("milk", "R", 0.1), row("milk", "G", 0.2)];
        let again = Material {
            source: "b".to_owned(),
            ..row("milk", "G", 0.2)
        };
        let second = vec![again, row("skin", "G", 0.2)];
        let merged = merge(&[first.clone(), second.clone()]).unwrap();
        assert_eq!(
            merged,
            [first[0].clone(), first[1].clone(), second[1].clone()]
        );
    }

    #[test]
    fn a_contradiction_names_both() {
        let error = merge(&[
            vec![row("milk", "R", 0.1)],
            vec![row("skin", "R", 1.0), row("milk", "R", 0.3)],
        ])
        .unwrap_err();
        assert_eq!(
            (error.first.table, error.second.table, error.second.row),
            (0, 1, 1)
        );
        assert_eq!(
            error.to_string(),
            "milk R is given twice with different numbers: sigma_s' 1 and sigma_a 0.1 mm^-1 in \
             table 1, row 1; 1 and 0.3 mm^-1 in table 2, row 2: rename one of the materials, or \
             remove one row"
        );
        let mut uncertain = row("milk", "R", 0.1);
        uncertain.u_sigma_a_per_mm = Some(0.01);
        assert!(merge(&[vec![row("milk", "R", 0.1), uncertain]]).is_err());
    }

    #[test]
    fn all_are_kept_and_say_where_they_are_from() {
        let tables = vec![
            vec![row("milk", "R", 0.1), row("milk", "G", 0.2)],
            vec![row("milk", "R", 0.3)],
        ];
        let kept = keep_all(tables.clone(), &["monday".into(), "tuesday".into()]);
        let sources: Vec<&str> = kept.iter().map(|row| row.source.as_str()).collect();
        let own = &tables[0][0].source;
        let from = |day: &str| format!("{own}, {day}");
        assert_eq!(sources, [from("monday"), from("monday"), from("tuesday")]);
        assert_eq!(kept[2].medium.sigma_a, 0.3);
    }
}
