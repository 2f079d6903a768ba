//! The curve of sRGB, IEC 61966-2-1: between light, 0 to 1, and what a picture stores of it.

/// What is stored of light.
pub(super) fn encoded(light: f64) -> f64 {
    if light <= 0.003_130_8 {
        12.92 * light
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

/// The light of what is stored.
pub(super) fn linear(stored: f64) -> f64 {
    if stored <= 0.040_45 {
        stored / 12.92
    } else {
        ((stored + 0.055) / 1.055).powf(2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_back_leads_back() {
        for k in 0..=1000 {
            let x = f64::from(k) / 1000.0;
            // The standard rounds the ends of its straight part.
            assert!((linear(encoded(x)) - x).abs() < 2e-5, "{x}");
        }
        assert!((linear(0.5) - 0.214_041).abs() < 1e-6);
    }
}
