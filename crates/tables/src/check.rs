//! Whether the rows of a table agree with themselves.

use crate::fresnel_of;
use physics::{Coefficients, InvalidMedium, Material, dipole};
use std::fmt;
use thiserror::Error;

/// By how much the numbers of a row may be off because they were rounded: half a unit in the
/// last place of each, as printed.
///
/// An `f64` does not know how it was printed: `0.0090` and `0.009` are one number and differ
/// tenfold in what they claim. So whoever reads the text says it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rounding {
    /// Of σₐ, mm⁻¹.
    pub sigma_a_per_mm: f64,
    /// Of σₛ′, mm⁻¹.
    pub sigma_s_prime_per_mm: f64,
    /// Of the total reflectance.
    pub total_reflectance: f64,
}

/// What is wrong with a row.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// The row describes no medium.
    #[error("no medium: {0}")]
    Impossible(#[from] InvalidMedium),
    /// A reflectance that no medium has.
    #[error("total reflectance must lie between 0 and 1, found {0}")]
    ImpossibleTotal(f64),
    /// The printed total does not follow from the printed coefficients, whatever they were
    /// before they were rounded.
    #[error(
        "total reflectance is printed as {printed}, but the coefficients give {lowest:.4} to \
         {highest:.4} within their rounding: off by {:.4}",
        self.excess()
    )]
    TotalDoesNotFollow {
        /// The total as printed.
        printed: f64,
        /// Half a unit in its last place.
        half_unit: f64,
        /// The smallest total within the rounding of the coefficients.
        lowest: f64,
        /// The largest total within the rounding of the coefficients.
        highest: f64,
    },
    /// The stated total lies more than 3 u from the one that the coefficients give.
    #[error(
        "total reflectance is stated as {stated}, but the coefficients give {recomputed:.4} with \
         u = {u:.4}"
    )]
    TotalBeyondUncertainty {
        /// The total as stated.
        stated: f64,
        /// The total of the coefficients.
        recomputed: f64,
        /// Its standard uncertainty, from that of the coefficients.
        u: f64,
    },
}

impl Fault {
    /// How far the printed total lies outside everything that rounding explains; 0 for faults
    /// of another kind.
    pub fn excess(&self) -> f64 {
        match *self {
            Self::TotalDoesNotFollow {
                printed,
                half_unit,
                lowest,
                highest,
            } => (lowest - printed).max(printed - highest) - half_unit,
            _ => 0.0,
        }
    }
}

/// A row and what is wrong with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Name of the material.
    pub material: String,
    /// Name of the channel.
    pub channel: String,
    /// What is wrong.
    pub fault: Fault,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}: {}", self.material, self.channel, self.fault)
    }
}

/// Every row that is impossible, or whose total does not follow from its coefficients.
///
/// A row with uncertainties is judged by them, to 3 u; one without by the rounding of what was
/// printed: the total may lie anywhere in the totals over the box of coefficients ± half a unit
/// in the last place, widened by half a unit of its own. The total is recomputed with the F_dr
/// of the row's model ([`fresnel_of`]); that of another model than the dipole's is not judged.
pub fn check<'a>(rows: impl IntoIterator<Item = (&'a Material, Rounding)>) -> Vec<Finding> {
    rows.into_iter()
        .filter_map(|(row, rounding)| {
            Some(Finding {
                material: row.material.clone(),
                channel: row.channel.clone(),
                fault: fault(row, rounding)?,
            })
        })
        .collect()
}

fn fault(row: &Material, rounding: Rounding) -> Option<Fault> {
    if let Err(invalid) = row.medium.validated() {
        return Some(Fault::Impossible(invalid));
    }
    let total = row.total_reflectance?;
    if !(0.0..=1.0).contains(&total) {
        return Some(Fault::ImpossibleTotal(total));
    }
    let a = fresnel_of(&row.model)?.a(row.medium.eta);
    let c = row.medium.coefficients();
    let half_unit = rounding.total_reflectance;
    if let (Some(u_a), Some(u_s)) = (row.u_sigma_a_per_mm, row.u_sigma_s_prime_per_mm) {
        let u = u_total(c, u_a, u_s, row.correlation.unwrap_or(0.0), a);
        let recomputed = dipole::total_reflectance(c.albedo_prime(), a);
        return ((total - recomputed).abs() > 3.0 * u + half_unit).then_some(
            Fault::TotalBeyondUncertainty {
                stated: total,
                recomputed,
                u,
            },
        );
    }
    // The total grows with α′, which grows with σₛ′ and falls with σₐ: extremes lie at corners.
    let corner = |sign: f64| {
        let corner = Coefficients {
            sigma_a: (c.sigma_a - sign * rounding.sigma_a_per_mm).max(0.0),
            sigma_s_prime: (c.sigma_s_prime + sign * rounding.sigma_s_prime_per_mm)
                .max(f64::MIN_POSITIVE),
        };
        dipole::total_reflectance(corner.albedo_prime(), a)
    };
    let fault = Fault::TotalDoesNotFollow {
        printed: total,
        half_unit,
        lowest: corner(-1.0),
        highest: corner(1.0),
    };
    // Far above the rounding of the arithmetic, far below any unit that is printed.
    (fault.excess() > 1e-9).then_some(fault)
}

/// Standard uncertainty of the total, from dα′ = (σₐ dσₛ′ − σₛ′ dσₐ)/σₜ′².
///
/// Half of the way from −1 u to +1 u in α′, because the slope is infinite where nothing absorbs.
fn u_total(c: Coefficients, u_a: f64, u_s: f64, correlation: f64, a: f64) -> f64 {
    let t2 = c.sigma_t_prime().powi(2);
    let (by_a, by_s) = (c.sigma_s_prime / t2 * u_a, c.sigma_a / t2 * u_s);
    let variance = by_a * by_a + by_s * by_s - 2.0 * correlation * by_a * by_s;
    let u = variance.max(0.0).sqrt();
    let total = |albedo: f64| dipole::total_reflectance(albedo.clamp(0.0, 1.0), a);
    0.5 * (total(c.albedo_prime() + u) - total(c.albedo_prime() - u))
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::{DiffuseFresnel, ReducedMedium};

    fn row(name: &str, channel: &str, sigma_s_prime: f64, sigma_a: f64, total: f64) -> Material {
        Material {
            material: name.to_owned(),
            channel: channel.to_owned(),
            wavelength_nm: None,
            medium: ReducedMedium {
                sigma_a,
                sigma_s_prime,
                eta: 1.3,
            },
            u_sigma_a_per_mm: None,
            u_sigma_s_prime_per_mm: None,
            correlation: None,
            total_reflectance: Some(total),
            g: None,
            model: "jensen2001".to_owned(),
            source: String::new(),
        }
    }

    fn half(text: &str) -> f64 {
        let decimals = text.split_once('.').unwrap().1.len();
        0.5 * 10_f64.powi(-(decimals as i32))
    }

    /// The published table with the precision of its text; no cell holds a comma.
    fn jensen() -> Vec<(Material, Rounding)> {
        let parse = |line: &str| {
            let cells: Vec<_> = line.split(',').collect();
            let [sigma_s_prime, sigma_a, total, eta] = [3, 5, 8, 9].map(|i| cells[i]);
            let number = |text: &str| text.parse::<f64>().unwrap();
            let mut row = row(
                cells[0],
                cells[1],
                number(sigma_s_prime),
                number(sigma_a),
                number(total),
            );
            row.medium.eta = number(eta);
            let rounding = Rounding {
                sigma_a_per_mm: half(sigma_a),
                sigma_s_prime_per_mm: half(sigma_s_prime),
                total_reflectance: half(total),
            };
            (row, rounding)
        };
        include_str!("../../../data/materials.csv")
            .lines()
            .skip(1)
            .map(parse)
            .collect()
    }

    #[test]
    fn four_rows_of_the_published_table_do_not_follow() {
        let rows = jensen();
        let found = check(rows.iter().map(|(row, rounding)| (row, *rounding)));
        let names: Vec<_> = found
            .iter()
            .map(|f| format!("{} {}", f.material, f.channel))
            .collect();
        assert_eq!(
            names,
            ["Chicken1 B", "Potato G", "Skimmilk B", "Skin2 G"],
            "{found:#?}"
        );
        let excess: Vec<_> = found.iter().map(|f| f.fault.excess()).collect();
        assert!((excess[0] - 0.018).abs() < 5e-4, "{excess:?}");
        // The others barely: by less than half a unit of the printed total.
        assert!(excess[1..].iter().all(|e| *e < 0.005), "{excess:?}");
    }

    fn fault_of(row: &Material) -> Option<Fault> {
        fault(row, Rounding::default())
    }

    #[test]
    fn a_row_with_uncertainties_is_judged_by_them() {
        let a = DiffuseFresnel::RationalFit.a(1.3);
        let total = dipole::total_reflectance(2.0 / 2.01, a);
        let mut measured = row("m", "G", 2.0, 0.01, total);
        assert_eq!(fault_of(&measured), None);
        measured.u_sigma_a_per_mm = Some(1e-4);
        measured.u_sigma_s_prime_per_mm = Some(0.0);
        // dR/dσₐ by a difference of the closed form, for σₐ alone.
        let slope = (dipole::total_reflectance(2.0 / 2.010001, a) - total) / 1e-6;
        let u = slope.abs() * 1e-4;
        measured.total_reflectance = Some(total + 2.9 * u);
        assert_eq!(fault_of(&measured), None);
        measured.total_reflectance = Some(total - 3.1 * u);
        let Some(Fault::TotalBeyondUncertainty { u: found, .. }) = fault_of(&measured) else {
            panic!("{:?}", fault_of(&measured));
        };
        assert!((found / u - 1.0).abs() < 1e-2, "{found} {u}");
        // Both coefficients too large by one factor leave α′, and so the total, as it is.
        measured.u_sigma_s_prime_per_mm = Some(1e-4 * 200.0);
        measured.correlation = Some(1.0);
        let Some(Fault::TotalBeyondUncertainty { u: found, .. }) = fault_of(&measured) else {
            panic!("{:?}", fault_of(&measured));
        };
        assert!(found < 1e-9, "{found}");
    }

    #[test]
    fn what_cannot_be_is_named() {
        let negative = row("m", "G", 1.0, -0.1, 0.5);
        assert_eq!(
            fault_of(&negative),
            Some(Fault::Impossible(InvalidMedium::SigmaA(-0.1)))
        );
        let bright = row("m", "G", 1.0, 0.0, 1.2);
        assert_eq!(fault_of(&bright), Some(Fault::ImpossibleTotal(1.2)));
        let mut other_model = row("m", "G", 1.0, 0.1, 0.9);
        assert!(matches!(
            fault_of(&other_model),
            Some(Fault::TotalDoesNotFollow { .. })
        ));
        other_model.model = "monte-carlo".to_owned();
        assert_eq!(fault_of(&other_model), None);
    }
}
