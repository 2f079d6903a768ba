//! Numbers as a person reads them.

/// Stands for a number that is not finite.
const UNKNOWN: &str = "unknown";

/// Below this, and from [`LARGE`] on, numbers are written with a power of ten.
const SMALL: f64 = 1e-4;
const LARGE: f64 = 1e6;

/// An uncertainty below this share of its value is shown as none: the digits would not end.
const NEGLIGIBLE: f64 = 1e-9;

/// `value ± u`: u to two significant digits, the value to the same place.
///
/// An uncertainty of 0 means that the value is exact, and it stands alone.
///
/// # Example
///
/// ```
/// assert_eq!(report::uncertain(0.0041234, 0.000052), "0.004123 ± 0.000052");
/// assert_eq!(report::uncertain(2.6e-5, 4e-6), "(2.60 ± 0.40) × 10⁻⁵");
/// ```
pub fn uncertain(value: f64, u: f64) -> String {
    if !value.is_finite() {
        return UNKNOWN.to_owned();
    }
    if !(u.is_finite() && u >= 0.0) {
        return format!("{} ± {UNKNOWN}", significant(value, 3));
    }
    if u == 0.0 || u < NEGLIGIBLE * value.abs() {
        return exact(value);
    }
    let size = value.abs().max(u);
    if (SMALL..LARGE).contains(&size) {
        let places = places(u, 2);
        return format!("{} ± {}", fixed(value, places), fixed(u, places));
    }
    let exponent = exponent(size, 3);
    let (value, u) = (scaled(value, exponent), scaled(u, exponent));
    let places = places(u, 2);
    format!(
        "({} ± {}) × {}",
        fixed(value, places),
        fixed(u, places),
        power_of_ten(exponent)
    )
}

/// `value` to `digits` significant digits, with a power of ten where it is very small or large.
///
/// # Example
///
/// ```
/// assert_eq!(report::significant(0.380952, 3), "0.381");
/// assert_eq!(report::significant(1.5e-6, 2), "1.5 × 10⁻⁶");
/// ```
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return UNKNOWN.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.max(1);
    if (SMALL..LARGE).contains(&value.abs()) {
        return fixed(value, places(value, digits));
    }
    let text = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!(
        "{mantissa} × {}",
        power_of_ten(exponent.parse().unwrap_or(0))
    )
}

/// `low to high`, both to the place where they tell an uncertainty of two digits.
pub(crate) fn interval((low, high): (f64, f64)) -> String {
    // A 95 % interval is about four standard uncertainties wide.
    let u = (high - low) / 4.0;
    if !(u.is_finite() && u > NEGLIGIBLE * high.abs()) {
        return format!("{} to {}", exact(low), exact(high));
    }
    let size = low.abs().max(high.abs());
    if (SMALL..LARGE).contains(&size) {
        let places = places(u, 2);
        return format!("{} to {}", fixed(low, places), fixed(high, places));
    }
    let exponent = exponent(size, 3);
    let (low, high, u) = (
        scaled(low, exponent),
        scaled(high, exponent),
        scaled(u, exponent),
    );
    let places = places(u, 2);
    format!(
        "({} to {}) × {}",
        fixed(low, places),
        fixed(high, places),
        power_of_ten(exponent)
    )
}

/// A value that somebody chose: to six significant digits, without zeros at the end.
pub(crate) fn exact(value: f64) -> String {
    let text = significant(value, 6);
    let (digits, power) = text.split_once(" × ").unwrap_or((&text, ""));
    let short = if digits.contains('.') {
        digits.trim_end_matches('0').trim_end_matches('.')
    } else {
        digits
    };
    if power.is_empty() {
        short.to_owned()
    } else {
        format!("{short} × {power}")
    }
}

/// `< limit`, the limit to two significant digits and never below what it was.
pub fn at_most(limit: f64) -> String {
    format!("< {}", significant(rounded(limit, f64::ceil), 2))
}

/// `> limit`, the limit to two significant digits and never above what it was.
pub fn at_least(limit: f64) -> String {
    format!("> {}", significant(rounded(limit, f64::floor), 2))
}

/// `limit` moved up or down to two significant digits.
fn rounded(limit: f64, direction: impl Fn(f64) -> f64) -> f64 {
    if !limit.is_finite() || limit == 0.0 {
        return limit;
    }
    // What is already round to 12 digits stays: 0.1 + 0.2 is 0.3 here.
    let limit: f64 = format!("{limit:.11e}").parse().unwrap_or(limit);
    let places = 1 - limit.abs().log10().floor() as i32;
    let step = 10f64.powi(places.abs());
    if places >= 0 {
        direction(limit * step) / step
    } else {
        direction(limit / step) * step
    }
}

/// `value` over a power of ten, in two steps: a single power below 1e-308 would be 0.
fn scaled(value: f64, exponent: i32) -> f64 {
    let half = -exponent / 2;
    value * 10f64.powi(half) * 10f64.powi(-exponent - half)
}

/// Power of ten of the first digit of `value`, after rounding to `digits` significant digits.
fn exponent(value: f64, digits: usize) -> i32 {
    let text = format!("{value:.*e}", digits - 1);
    text.split_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or(0)
}

/// Decimal places that show `digits` significant digits of `value`; negative above the units.
fn places(value: f64, digits: usize) -> i32 {
    digits as i32 - 1 - exponent(value, digits)
}

/// `value` to so many decimal places, without the sign of a rounded zero.
pub(crate) fn fixed(value: f64, places: i32) -> String {
    if !value.is_finite() {
        return UNKNOWN.to_owned();
    }
    let text = if places >= 0 {
        format!("{value:.*}", places as usize)
    } else {
        let step = 10f64.powi(-places);
        format!("{:.0}", (value / step).round() * step)
    };
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        _ => text,
    }
}

/// `10⁻⁵`.
pub(crate) fn power_of_ten(exponent: i32) -> String {
    let plain = exponent.to_string();
    let raised = plain.chars().map(|c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    });
    format!("10{}", raised.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_ends_where_its_uncertainty_ends() {
        for (value, u, expected) in [
            (0.00412, 0.00005, "0.004120 ± 0.000050"),
            (2.6234, 0.0179, "2.623 ± 0.018"),
            (2.6234, 0.179, "2.62 ± 0.18"),
            (1.0, 0.0996, "1.00 ± 0.10"),
            (12345.0, 678.0, "12350 ± 680"),
            (0.00001, 0.00034, "0.00001 ± 0.00034"),
            (-0.00001, 0.0034, "0.0000 ± 0.0034"),
            (0.0, 0.0, "0"),
            (0.038, 0.0, "0.038"),
            (1.0, 1e-300, "1"),
            (1.2e-7, 3.4e-9, "(1.200 ± 0.034) × 10⁻⁷"),
            (2.5e9, 1e7, "(2.500 ± 0.010) × 10⁹"),
            (9.999e-5, 1e-6, "(1.000 ± 0.010) × 10⁻⁴"),
            (3e-308, 1e-308, "(3.0 ± 1.0) × 10⁻³⁰⁸"),
        ] {
            assert_eq!(uncertain(value, u), expected, "{value} {u}");
        }
    }

    #[test]
    fn what_is_not_a_number_is_called_unknown() {
        assert_eq!(uncertain(f64::NAN, 1.0), "unknown");
        assert_eq!(uncertain(2.62, f64::INFINITY), "2.62 ± unknown");
        assert_eq!(uncertain(2.62, f64::NAN), "2.62 ± unknown");
        assert_eq!(significant(f64::NEG_INFINITY, 3), "unknown");
        assert_eq!(at_most(f64::NAN), "< unknown");
    }

    #[test]
    fn limits_are_rounded_to_the_safe_side() {
        assert_eq!(at_most(0.000_451), "< 0.00046");
        assert_eq!(at_most(0.000_45), "< 0.00045");
        assert_eq!(at_most(0.099_1), "< 0.10");
        assert_eq!(at_most(4.51e-6), "< 4.6 × 10⁻⁶");
        assert_eq!(at_most(0.0), "< 0");
        assert_eq!(at_least(58.9), "> 58");
        assert_eq!(at_least(1234.0), "> 1200");
        assert_eq!(at_most(0.1 + 0.2), "< 0.30");
    }

    #[test]
    fn intervals_show_their_width() {
        assert_eq!(interval((11.5818, 11.6137)), "11.5818 to 11.6137");
        assert_eq!(interval((0.0, 0.0612)), "0.000 to 0.061");
        assert_eq!(interval((0.0, 1.01e-5)), "(0.00 to 1.01) × 10⁻⁵");
        assert_eq!(interval((2.5, 2.5)), "2.5 to 2.5");
        assert_eq!(interval((0.0, f64::INFINITY)), "0 to unknown");
    }

    #[test]
    fn chosen_values_have_no_zeros_at_the_end() {
        for (value, expected) in [
            (0.0041, "0.0041"),
            (0.1 + 0.2, "0.3"),
            (20.0, "20"),
            (2.5e-7, "2.5 × 10⁻⁷"),
            (0.0, "0"),
        ] {
            assert_eq!(exact(value), expected);
        }
    }

    #[test]
    fn significant_digits() {
        for (value, digits, expected) in [
            (0.9996, 3, "1.00"),
            (-0.12345, 3, "-0.123"),
            (20.5, 3, "20.5"),
            (123_456.0, 3, "123000"),
            (0.0, 3, "0"),
            (1e-300, 2, "1.0 × 10⁻³⁰⁰"),
        ] {
            assert_eq!(significant(value, digits), expected);
        }
    }
}
