//! Profiles of pictures that are integrated over each pixel by brute force.

use super::*;
use crate::{find_center, slice_profile};
use gauss_quad::GaussLegendre;
use physics::{DiffuseFresnel, Dipole, ReducedMedium};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::f64::consts::PI;
use std::num::NonZeroUsize;

const MM: f64 = 0.04;

/// Exitance on the sample against the distance from the spot in mm.
type Glow<'a> = &'a dyn Fn(f64) -> f64;

fn nodes(count: usize) -> Vec<(f64, f64)> {
    let rule = GaussLegendre::new(NonZeroUsize::new(count).unwrap());
    // On [-1/2, 1/2].
    let pairs = rule.as_node_weight_pairs();
    pairs.iter().map(|(x, w)| (0.5 * x, 0.5 * w)).collect()
}

/// Mean of `glow` over the pixel whose middle is (`x`, `y`) px from the spot.
fn pixel_mean(glow: Glow, x: f64, y: f64, rule: &[(f64, f64)]) -> f64 {
    let mut sum = 0.0;
    for (u, uw) in rule {
        for (v, vw) in rule {
            sum += uw * vw * glow((x + u).hypot(y + v) * MM);
        }
    }
    sum
}

/// Fine nodes near the spot, few far from it.
struct Rules {
    near: Vec<(f64, f64)>,
    middle: Vec<(f64, f64)>,
    far: Vec<(f64, f64)>,
}

impl Rules {
    fn new() -> Self {
        Self {
            near: nodes(24),
            middle: nodes(6),
            far: nodes(3),
        }
    }

    fn at(&self, radius: f64) -> &[(f64, f64)] {
        match radius {
            r if r < 4.0 => &self.near,
            r if r < 20.0 => &self.middle,
            _ => &self.far,
        }
    }
}

fn picture(glow: Glow, size: usize, center: [f64; 2]) -> ChannelMap {
    let rules = Rules::new();
    let value: Vec<f32> = (0..size * size)
        .map(|i| {
            let (x, y) = ((i % size) as f64 - center[0], (i / size) as f64 - center[1]);
            pixel_mean(glow, x, y, rules.at(x.hypot(y))) as f32
        })
        .collect();
    let peak = value.iter().fold(0.0_f32, |m, v| m.max(*v));
    ChannelMap {
        name: "Y".to_owned(),
        variance: vec![1e-18 * peak * peak; value.len()],
        value,
    }
}

/// Mean over the ring's area of the pixel mean, on a fine polar grid.
fn ring_mean(glow: Glow, inner: f64, outer: f64) -> f64 {
    let rules = Rules::new();
    let angles = 48;
    let area = 0.5 * (outer - inner) * (outer + inner);
    let mut sum = 0.0;
    for (t, w) in nodes(if outer < 10.0 { 16 } else { 8 }) {
        let r = 0.5 * (inner + outer) + (outer - inner) * t;
        for step in 0..angles {
            // The pixel has eight-fold symmetry.
            let angle = 0.25 * PI * (f64::from(step) + 0.5) / f64::from(angles);
            let (x, y) = (r * angle.cos(), r * angle.sin());
            let mean = pixel_mean(glow, x, y, rules.at(r));
            sum += w * (outer - inner) * r * mean / f64::from(angles);
        }
    }
    sum / area
}

fn truth(glow: Glow, measured: &Measured) -> Vec<f64> {
    measured
        .profile
        .points
        .iter()
        .map(|p| {
            let (inner, outer) = p.ring_mm.unwrap();
            ring_mean(glow, inner / MM, outer / MM)
        })
        .collect()
}

fn dipole(sigma_a: f64, sigma_s_prime: f64) -> Dipole {
    let medium = ReducedMedium {
        sigma_a,
        sigma_s_prime,
        eta: 1.3,
    };
    Dipole::new(&medium, DiffuseFresnel::Exact)
}

/// The dipole under a beam with a Gaussian section of 0.3 mm, tabulated on ln r.
fn under_a_beam(dipole: &Dipole) -> impl Fn(f64) -> f64 + use<> {
    let variance = 0.3 * 0.3 / (8.0 * 2_f64.ln());
    let knot = |k: usize| 0.02 * ((k as f64 * 0.01).exp() - 1.0);
    let values: Vec<f64> = (0..760)
        .map(|k| {
            let (mut sum, mut norm) = (0.0, 0.0);
            for (t, w) in nodes(40) {
                let offset = 6.0 * variance.sqrt() * (t + 0.5);
                let weight = w * offset * (-0.5 * offset * offset / variance).exp();
                for step in 0..48 {
                    let cos = (PI * (f64::from(step) + 0.5) / 48.0).cos();
                    let r = knot(k);
                    let square = r * r + offset * offset + 2.0 * r * offset * cos;
                    sum += weight / 48.0 * dipole.diffuse_reflectance(square.sqrt());
                }
                norm += weight;
            }
            (sum / norm).ln()
        })
        .collect();
    move |r: f64| {
        let at = ((1.0 + r / 0.02).ln() / 0.01).min(757.9);
        let i = (at as usize).clamp(1, 757);
        let t = at - i as f64;
        // Lagrange through four knots.
        let [a, b, c, d] = [values[i - 1], values[i], values[i + 1], values[i + 2]];
        (a * t * (1.0 - t) * (t - 2.0) / 6.0
            + b * (t * t - 1.0) * (t - 2.0) / 2.0
            + c * t * (t + 1.0) * (2.0 - t) / 2.0
            + d * t * (t * t - 1.0) / 6.0)
            .exp()
    }
}

fn options(center: [f64; 2]) -> ProfileOptions {
    ProfileOptions {
        center_px: Some(center),
        ..ProfileOptions::default()
    }
}

/// Worst relative error of a ring beyond 8 px, and the relative error of the total.
fn check(label: &str, glow: Glow, size: usize, center: [f64; 2]) -> (f64, f64) {
    let map = picture(glow, size, center);
    let measured = radial_profile(&map, size, size, &options(center)).unwrap();
    assert_eq!(measured.rejected_pixels, 0, "{label}");
    let truth = truth(glow, &measured);
    let (mut worst, mut sum) = (0.0_f64, 0.0);
    for (point, truth) in measured.profile.points.iter().zip(&truth) {
        let error = point.reflectance_per_mm2 / truth - 1.0;
        let radius = point.radius_mm / MM;
        if radius < 14.0 {
            print!("{radius:.1}: {error:+.1e}  ");
        }
        if radius > 8.0 {
            worst = worst.max(error.abs());
        }
        sum += point.area_mm2() * truth;
    }
    let total = measured.total.total_reflectance / sum - 1.0;
    println!("\n{label} {center:?}: worst {worst:.1e}, total {total:+.1e}");
    (worst, total.abs())
}

#[test]
fn rings_are_exact_where_the_fit_looks() {
    let marble = dipole(0.0041, 2.62);
    let white = dipole(1e-5, 20.0);
    let blurred = [under_a_beam(&marble), under_a_beam(&white)];
    let sharp = |d: &Dipole| {
        let d = *d;
        move |r: f64| d.diffuse_reflectance(r)
    };
    let sharp = [sharp(&marble), sharp(&white)];
    for center in [
        [127.5, 127.5],
        [127.0, 127.0],
        [125.31, 129.84],
        [128.22, 127.46],
    ] {
        let all: [(&str, Glow); 4] = [
            ("marble", &blurred[0]),
            ("white", &blurred[1]),
            ("sharp marble", &sharp[0]),
            ("sharp white", &sharp[1]),
        ];
        for (label, glow) in all {
            let (worst, total) = check(label, glow, 256, center);
            // The worst of these spots is no wider than a pixel.
            assert!(worst < 5e-5, "{label} {center:?}: {worst}");
            assert!(total < 1e-5, "{label} {center:?}: {total}");
        }
    }
}

/// A sensor's noise: photons of a full well at the peak, and a floor at 1e-5 of it.
fn variances(map: &ChannelMap) -> Vec<f32> {
    let peak = map.value.iter().fold(0.0_f32, |m, v| m.max(*v));
    let (photons, floor) = (1e-6 * peak, 1e-6 * peak);
    map.value
        .iter()
        .map(|v| v * photons + floor * floor + 2.5e-5 * v * v)
        .collect()
}

fn noisy(clean: &ChannelMap, seed: u64) -> ChannelMap {
    let rng = &mut Pcg64Mcg::seed_from_u64(seed);
    let variance = variances(clean);
    let value = clean
        .value
        .iter()
        .zip(&variance)
        .map(|(v, variance)| v + variance.sqrt() * rng.sample::<f32, _>(StandardNormal))
        .collect();
    ChannelMap {
        name: "Y".to_owned(),
        value,
        variance,
    }
}

#[test]
fn uncertainties_are_true() {
    check_uncertainties(&under_a_beam(&dipole(0.17, 0.88)), 400);
}

#[test]
fn uncertainties_are_true_where_most_rings_are_noise() {
    // Blue light in ketchup, with a floor that drowns it beyond 40 px.
    let ketchup = under_a_beam(&dipole(1.45, 0.03));
    check_uncertainties(&move |r: f64| ketchup(r) * (-2.0 * r * r).exp(), 200);
}

fn check_uncertainties(glow: Glow, seeds: u64) {
    let size = 160;
    let center = [79.31, 80.64];
    let clean = picture(glow, size, center);
    let exact = radial_profile(&clean, size, size, &options(center)).unwrap();
    let truth = truth(glow, &exact);
    let count = truth.len();
    let total: f64 = (0..count)
        .map(|i| exact.profile.points[i].area_mm2() * truth[i])
        .sum();
    let (mut sum, mut square) = (vec![0.0; count], vec![0.0; count]);
    let (mut total_sum, mut total_square, mut rejected) = (0.0, 0.0, 0);
    for seed in 0..seeds {
        let map = noisy(&clean, seed);
        let measured = radial_profile(&map, size, size, &options(center)).unwrap();
        rejected += measured.rejected_pixels;
        for (i, p) in measured.profile.points.iter().enumerate() {
            let z = (p.reflectance_per_mm2 - truth[i]) / p.u_reflectance_per_mm2;
            sum[i] += z;
            square[i] += z * z;
        }
        let z = (measured.total.total_reflectance - total) / measured.total.u_total_reflectance;
        total_sum += z;
        total_square += z * z;
    }
    let n = seeds as f64;
    let (mut pooled, mut rings) = (0.0, 0.0);
    for i in 0..count {
        let (mean, square) = (sum[i] / n, square[i] / n);
        let radius = exact.profile.points[i].radius_mm / MM;
        println!("{radius:6.1} px: z {mean:+.3}, z² {square:.3}");
        if radius > 8.0 {
            assert!(mean.abs() < 4.0 / n.sqrt(), "{radius}: {mean}");
            // Four standard errors of a mean of squares.
            assert!(
                (square - 1.0).abs() < 4.0 * (2.0 / n).sqrt(),
                "{radius}: {square}"
            );
            pooled += square;
            rings += 1.0;
        }
    }
    let (mean, square) = (total_sum / n, total_square / n);
    println!(
        "total: z {mean:+.3}, z² {square:.3}; pooled {:.3}; {rejected} rejected",
        pooled / rings
    );
    assert!((pooled / rings - 1.0).abs() < 0.05, "{}", pooled / rings);
    assert!(mean.abs() < 4.0 / n.sqrt(), "{mean}");
    assert!((square - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{square}");
    // Of 8 million Gaussian pixels five lie beyond five standard deviations.
    assert!(rejected < 20, "{rejected}");
}

#[test]
fn a_found_centre_costs_nothing() {
    let size = 160;
    let center = [79.31, 80.64];
    let skin = under_a_beam(&dipole(0.17, 0.88));
    let clean = picture(&skin, size, center);
    let (mut square, mut n, mut offset) = (0.0, 0.0, 0.0);
    for seed in 0..60 {
        let map = noisy(&clean, 1000 + seed);
        let found = crate::find_center(&map, size, size).unwrap();
        offset += (found[0] - center[0]).powi(2) + (found[1] - center[1]).powi(2);
        let measured = radial_profile(&map, size, size, &options(found)).unwrap();
        let expected = radial_profile(
            &clean,
            size,
            size,
            &ProfileOptions {
                clip: 1e9,
                ..options(center)
            },
        )
        .unwrap();
        // Rings to the edge that both circles have: the outermost edge moves with the centre.
        for (p, e) in measured.profile.points.iter().zip(&expected.profile.points) {
            if p.radius_mm > 8.0 * MM && p.radius_mm < 30.0 * MM {
                // To first order what the shift of the edges does to the value.
                let slope = (skin(p.radius_mm + 1e-4) - skin(p.radius_mm - 1e-4)) / 2e-4;
                let moved = e.reflectance_per_mm2 + slope * (p.radius_mm - e.radius_mm);
                square += ((p.reflectance_per_mm2 - moved) / p.u_reflectance_per_mm2).powi(2);
                n += 1.0;
            }
        }
    }
    let rms = (offset / 120.0_f64).sqrt();
    println!("centre {rms:.1e} px rms, z² {:.3}", square / n);
    // Off by this much, a ring beyond 8 px changes by 4e-6: (offset/2)² times its curvature.
    assert!(rms < 0.01, "{rms}");
    assert!((square / n - 1.0).abs() < 0.15, "{}", square / n);
}

#[test]
fn zingers_are_rejected_and_masked_pixels_skipped() {
    let size = 200;
    let center = [99.2, 100.7];
    let marble = under_a_beam(&dipole(0.0041, 2.62));
    let clean = picture(&marble, size, center);
    let mut map = noisy(&clean, 5);
    let before = radial_profile(&map, size, size, &options(center)).unwrap();
    let peak = clean.value.iter().fold(0.0_f32, |m, v| m.max(*v));
    let at = |x: usize, y: usize| y * size + x;
    // Far out, by up to the peak; one of them dead.
    let zingers = [
        at(30, 100),
        at(100, 160),
        at(150, 150),
        at(60, 60),
        at(99, 145),
    ];
    for (i, by) in zingers
        .into_iter()
        .zip([peak, 0.01 * peak, 1e-3 * peak, -0.1 * peak, peak])
    {
        map.value[i] += by;
    }
    for i in [at(120, 100), at(99, 100), at(40, 40)] {
        map.value[i] = 0.0;
        map.variance[i] = f32::INFINITY;
    }
    let after = radial_profile(&map, size, size, &options(center)).unwrap();
    assert_eq!(after.rejected_pixels, before.rejected_pixels + 5);
    assert_eq!((before.unmeasured_pixels, after.unmeasured_pixels), (0, 3));
    let scatter = after.relative_scatter;
    assert!((scatter - 1.0).abs() < 0.05, "{scatter}");
    for (a, b) in after.profile.points.iter().zip(&before.profile.points) {
        let shift = (a.reflectance_per_mm2 - b.reflectance_per_mm2) / b.u_reflectance_per_mm2;
        // A pixel less moves a mean by a fraction of its uncertainty.
        assert!(shift.abs() < 1.5, "{a:?} {b:?}");
    }
}

#[test]
fn a_glow_that_is_not_round_is_kept_whole() {
    let size = 200;
    let center = [99.2, 100.7];
    let marble = under_a_beam(&dipole(0.0041, 2.62));
    let mut map = noisy(&picture(&marble, size, center), 6);
    for (i, v) in map.value.iter_mut().enumerate() {
        let (x, y) = ((i % size) as f64 - center[0], (i / size) as f64 - center[1]);
        *v *= 1.0 + 0.05 * (3.0 * y.atan2(x)).cos() as f32;
    }
    let measured = radial_profile(&map, size, size, &options(center)).unwrap();
    assert!(measured.rejected_pixels < 5, "{}", measured.rejected_pixels);
    assert!(
        measured.relative_scatter > 2.0,
        "{}",
        measured.relative_scatter
    );
}

#[test]
fn a_slice_has_the_value_at_its_radius() {
    let size = 256;
    let center = [125.31, 129.84];
    let marble = under_a_beam(&dipole(0.0041, 2.62));
    let map = picture(&marble, size, center);
    let sliced = slice_profile(&map, size, size, &options(center)).unwrap();
    let rounded = radial_profile(&map, size, size, &options(center)).unwrap();
    assert_eq!(sliced.total, rounded.total);
    for p in &sliced.profile.points {
        assert_eq!(p.ring_mm, None);
        assert!((1..=10).contains(&p.pixels.unwrap()), "{p:?}");
        let r = p.radius_mm / MM;
        // The pixel average at that distance along the row.
        let expected = pixel_mean(&marble, r, 0.0, Rules::new().at(r));
        let error = p.reflectance_per_mm2 / expected - 1.0;
        assert!(error.abs() < 2e-4, "{r}: {error}");
    }
}

#[test]
fn each_bad_input_is_named() {
    let size = 64;
    let glow = |r: f64| (-r * r).exp();
    let good = picture(&glow, size, [31.0, 32.0]);
    let refused = |map: &ChannelMap, options: &ProfileOptions| {
        radial_profile(map, size, size, options).unwrap_err()
    };
    let default = ProfileOptions::default();
    for bad in [0.0, -0.04, f64::NAN, f64::INFINITY] {
        let options = ProfileOptions {
            view: crate::View::square(bad),
            ..default
        };
        assert!(matches!(
            refused(&good, &options),
            ProfileError::MmPerPixel(_)
        ));
    }
    let thin = ProfileOptions {
        relative_width: 0.0,
        ..default
    };
    assert!(matches!(
        refused(&good, &thin),
        ProfileError::Option {
            name: "relative_width",
            ..
        }
    ));
    for off in [[-5.0, 30.0], [60.0, 30.0], [f64::NAN, 30.0]] {
        assert!(matches!(
            refused(&good, &options(off)),
            ProfileError::SpotAtEdge { width: 64, .. }
        ));
    }
    for (value, variance) in [(f32::NAN, 1.0), (1.0, -1.0), (1.0, f32::NAN)] {
        let mut broken = good.clone();
        (broken.value[130], broken.variance[130]) = (value, variance);
        assert!(matches!(
            refused(&broken, &default),
            ProfileError::Pixel { x: 2, y: 2, .. }
        ));
    }
    let mut unmeasured = good.clone();
    unmeasured.variance.fill(f32::INFINITY);
    assert_eq!(refused(&unmeasured, &default), ProfileError::Empty(4096));
    // The core saturates in every frame.
    let mut saturated = good.clone();
    for y in 28..37 {
        saturated.variance[y * size + 27..y * size + 36].fill(f32::INFINITY);
    }
    assert!(matches!(
        refused(&saturated, &options([31.0, 32.0])),
        ProfileError::UnmeasuredRing { inner_mm: 0.0, .. }
    ));
    // Swapped sample and reference: more light than came in. The Gaussian holds π mm².
    let error = refused(&good, &default);
    let ProfileError::ReferenceDarker {
        sample_sum,
        white_sum,
    } = error
    else {
        panic!("{error}");
    };
    assert!((white_sum - 625.0).abs() < 1e-9, "{white_sum}");
    assert!((sample_sum / white_sum - 2.5).abs() < 0.5, "{sample_sum}");
    let short = ChannelMap {
        value: vec![0.0; 7],
        ..good
    };
    assert_eq!(
        refused(&short, &default),
        ProfileError::Size {
            values: 7,
            variances: 4096,
            pixels: 4096
        }
    );
}

/// A pinhole camera over the surface, its sensor tilted by `tilt` about the rows.
fn tilted_view(tilt: f64, size: usize) -> View {
    let (sin, cos) = tilt.sin_cos();
    let middle = 0.5 * (size as f64 - 1.0);
    let seen = |mm: [f64; 2]| {
        let away = 250.0 + mm[1] * sin;
        let focal = 250.0 / MM;
        [
            middle + focal * mm[0] / away,
            middle - focal * mm[1] * cos / away,
        ]
    };
    let mm = [[-3.0, -2.0], [3.0, -2.0], [3.0, 2.0], [-3.0, 2.0]];
    View::corners(&mm.map(seen), &mm).unwrap()
}

/// The mean of `glow` over what each pixel sees of the surface, about `center`.
fn seen_through(view: &View, glow: Glow, size: usize, center: [f64; 2]) -> ChannelMap {
    let spot = view.at_mm(center);
    let rules = Rules::new();
    let value: Vec<f32> = (0..size * size)
        .map(|i| {
            let (x, y) = ((i % size) as f64, (i / size) as f64);
            let rule = rules.at((x - center[0]).hypot(y - center[1]));
            let (mut sum, mut area) = (0.0, 0.0);
            for (u, uw) in rule {
                for (v, vw) in rule {
                    let px = [x + u, y + v];
                    let [across, down] = view.at_mm(px);
                    let weight = uw * vw * view.area_mm2(px);
                    area += weight;
                    sum += weight * glow((across - spot[0]).hypot(down - spot[1]));
                }
            }
            (sum / area) as f32
        })
        .collect();
    let peak = value.iter().fold(0.0_f32, |m, v| m.max(*v));
    ChannelMap {
        name: "Y".to_owned(),
        variance: vec![1e-18 * peak * peak; value.len()],
        value,
    }
}

/// Rings and total on the surface, whatever the camera's tilt and the shape of its pixels.
#[test]
fn a_tilted_camera_sees_the_same_rings() {
    let marble = under_a_beam(&dipole(0.0041, 2.62));
    for (label, view) in [
        ("30 degrees", tilted_view(30_f64.to_radians(), 256)),
        ("55 degrees", tilted_view(55_f64.to_radians(), 256)),
        ("0.04 x 0.06 mm", View::rectangular([0.04, 0.06])),
    ] {
        let center = [126.3, 129.8];
        let map = seen_through(&view, &marble, 256, center);
        let options = ProfileOptions {
            view,
            ..options(center)
        };
        let measured = radial_profile(&map, 256, 256, &options).unwrap();
        assert_eq!(measured.rejected_pixels, 0, "{label}");
        // A pixel as large on average over directions; what is smeared by another shape differs
        // in fourth order of its side.
        let pixel = view.blur_mm(center);
        let (mut worst, mut sum) = (0.0_f64, 0.0);
        for point in &measured.profile.points {
            let (inner, outer) = point.ring_mm.unwrap();
            let truth = ring_mean(&|r| marble(r * pixel / MM), inner / pixel, outer / pixel);
            let error = point.reflectance_per_mm2 / truth - 1.0;
            if point.radius_mm > 8.0 * pixel {
                worst = worst.max(error.abs());
            }
            sum += point.area_mm2() * truth;
        }
        let total = measured.total.total_reflectance / sum - 1.0;
        let found = find_center(&map, 256, 256).unwrap();
        let off = (found[0] - center[0]).hypot(found[1] - center[1]);
        println!("{label}: rings {worst:.1e}, total {total:+.1e}, centre {off:.4} px");
        assert!(worst < 1e-3, "{label}: {worst}");
        assert!(total.abs() < 2e-4, "{label}: {total}");
        assert!(off < 0.02, "{label}: {off}");
        assert!(measured.unseen_share < 1e-12, "{label}");
    }
}

/// Noise on pixels of unequal areas: the residuals' variance is what u says.
#[test]
fn uncertainties_are_true_in_a_tilted_view() {
    let marble = under_a_beam(&dipole(0.0041, 2.62));
    let (size, center) = (128, [63.2, 65.9]);
    let view = tilted_view(0.96, size);
    let clean = seen_through(&view, &marble, size, center);
    let options = ProfileOptions {
        view,
        ..options(center)
    };
    let truth = radial_profile(&clean, size, size, &options).unwrap();
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let (mut sum, mut count, mut totals) = (0.0, 0.0, 0.0);
    let pictures = 60;
    for _ in 0..pictures {
        let mut map = clean.clone();
        for (value, variance) in map.value.iter_mut().zip(&mut map.variance) {
            let u = 0.01 * *value + 1e-4;
            let noise: f64 = rng.sample(StandardNormal);
            *value += u * noise as f32;
            *variance = u * u;
        }
        let measured = radial_profile(&map, size, size, &options).unwrap();
        for (a, b) in measured
            .profile
            .points
            .iter()
            .zip(&truth.profile.points)
            .skip(6)
        {
            let z = (a.reflectance_per_mm2 - b.reflectance_per_mm2) / a.u_reflectance_per_mm2;
            sum += z * z;
            count += 1.0;
        }
        let (a, b) = (&measured.total, &truth.total);
        totals += ((a.total_reflectance - b.total_reflectance) / a.u_total_reflectance).powi(2);
    }
    println!(
        "rings {:.3}, total {:.3}",
        sum / count,
        totals / pictures as f64
    );
    assert!((sum / count - 1.0).abs() < 4.0 * (2.0_f64 / count).sqrt());
    assert!((totals / pictures as f64 - 1.0).abs() < 4.0 * (2.0 / pictures as f64).sqrt());
}

#[test]
fn a_horizon_in_the_picture_is_refused() {
    let map = picture(&|r: f64| (-r * r).exp(), 64, [31.0, 32.0]);
    let px = [[10.0, 60.0], [54.0, 60.0], [36.0, 20.0], [28.0, 20.0]];
    let mm = [[0.0, 0.0], [4.0, 0.0], [4.0, 9.0], [0.0, 9.0]];
    let options = ProfileOptions {
        view: View::corners(&px, &mm).unwrap(),
        ..options([31.0, 32.0])
    };
    let error = radial_profile(&map, 64, 64, &options).unwrap_err();
    assert_eq!(error, ProfileError::Horizon);
}
