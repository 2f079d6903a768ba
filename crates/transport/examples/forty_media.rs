//! The table model against photons at forty random media.
//!
//! `cargo run --release -p beamspot-transport --example forty_media -- RINGS.csv [PHOTONS]`
//!
//! Simulates the media into RINGS.csv (10⁷ photons each, 2·10⁶ where a photon scatters over 2,000
//! times) as far as they are not there already, then compares: deviation per decade of radius, total,
//! χ² with the stated error included, time per profile. The media are drawn from a seed of their
//! own; nothing in the table or in its stated error was tuned on them.
#![expect(clippy::print_stdout, reason = "an example prints")]

use montecarlo::{Incidence, LayeredMedium, PHOTONS_PER_BLOCK, Side, Simulation, TallySpec};
use physics::{Blur, Coefficients, Footprints, ForwardModel, Medium, ProfilePoint, fresnel};
use std::error::Error;
use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::hint::black_box;
use std::io::Write as _;
use std::time::Instant;
use transport::TransportModel;

const MEDIA: usize = 40;
const SEED: u64 = 0x40_3ED1A;
/// Rings to a decade of radius.
const RINGS: f64 = 12.0;
/// Least radius of the rings' edges, 1/σₜ′; the disk inside is a ring as well.
const FIRST: f64 = 0.01;
/// Scatterings of one photon above which fewer photons have to do.
const DEAR: f64 = 2_000.0;
/// Rings whose simulated value is less certain than this are left out.
const WORST_U: f64 = 0.1;

/// η, g and α′ of one medium; σₜ′ is 1 per mm.
#[derive(Clone, Copy, PartialEq)]
struct Case {
    eta: f64,
    g: f64,
    albedo_prime: f64,
}

impl Case {
    fn coefficients(self) -> Coefficients {
        Coefficients {
            sigma_a: 1.0 - self.albedo_prime,
            sigma_s_prime: self.albedo_prime,
        }
    }

    fn label(self) -> String {
        let Self {
            eta,
            g,
            albedo_prime,
        } = self;
        format!("eta {eta:.3} g {g:+.3} a' {albedo_prime:.4}")
    }
}

/// Half of the media have an α′ even between 0.02 and 1, half a 1 − α′ even in its logarithm.
fn cases() -> Vec<Case> {
    let mut state = SEED;
    let mut draw = move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..MEDIA)
        .map(|i| {
            let (eta, g) = (1.0 + 0.6 * draw(), -0.3 + 1.25 * draw());
            let x = draw();
            let albedo_prime = if i.is_multiple_of(2) {
                0.02 + 0.98 * x
            } else {
                1.0 - 10.0_f64.powf(-3.5 * x)
            };
            Case {
                eta,
                g,
                albedo_prime: albedo_prime.max(0.02),
            }
        })
        .collect()
}

/// One simulated medium: photons, total with its u, and rings (inner, outer, value, u).
struct Walk {
    case: Case,
    photons: u64,
    total: [f64; 2],
    rings: Vec<[f64; 4]>,
}

/// Edges from 0 to the radius beyond which 0.1 % of the light leaves.
fn edges(case: Case) -> Result<Vec<f64>, Box<dyn Error>> {
    let model = TransportModel::new(case.eta, case.g)?;
    let at = case.coefficients();
    let all = model.within(at, f64::INFINITY).value;
    let mut edges = vec![0.0];
    let mut i = 0.0;
    loop {
        let r = FIRST * 10.0_f64.powf(i / RINGS);
        edges.push(r);
        if model.beyond(at, r) < 1e-3 * all {
            return Ok(edges);
        }
        i += 1.0;
    }
}

fn simulate(case: Case, seed: u64, photons: u64) -> Result<Walk, Box<dyn Error>> {
    let Coefficients {
        sigma_a,
        sigma_s_prime,
    } = case.coefficients();
    let medium = LayeredMedium::half_space(&Medium {
        sigma_a,
        sigma_s: sigma_s_prime / (1.0 - case.g),
        g: case.g,
        eta: case.eta,
    });
    let spec = TallySpec {
        radius_mm: edges(case)?,
        ..TallySpec::default()
    };
    let simulation = Simulation::new(medium, Incidence::PENCIL, &spec, seed)?;
    let pilot = simulation.run_photons(4 * PHOTONS_PER_BLOCK)?;
    let dear = pilot.events() as f64 / pilot.photons() as f64 > DEAR;
    let tally = simulation.run_photons(if dear { photons / 5 } else { photons })?;
    let reflectance = tally.reflectance();
    Ok(Walk {
        case,
        photons: tally.photons(),
        total: [reflectance.value, reflectance.u],
        rings: tally
            .profile(Side::Above)
            .into_iter()
            .filter_map(|p| {
                let (inner, outer) = p.ring_mm?;
                Some([inner, outer, p.reflectance_per_mm2, p.u_reflectance_per_mm2])
            })
            .collect(),
    })
}

const HEADER: &str = "eta,g,albedo_prime,photons,total,u_total,inner_mm,outer_mm,reflectance_per_mm2,u_reflectance_per_mm2";

/// What the file holds already; the rest is simulated and added to it, medium by medium.
fn walks(path: &str, photons: u64) -> Result<Vec<Walk>, Box<dyn Error>> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(_) => {
            std::fs::write(path, HEADER)?;
            HEADER.to_owned()
        }
    };
    let rows = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(str::parse::<f64>).collect())
        .collect::<Result<Vec<Vec<f64>>, _>>()?;
    let mut known: Vec<Walk> = rows
        .chunk_by(|a, b| a[..3] == b[..3])
        .map(|rows| Walk {
            case: Case {
                eta: rows[0][0],
                g: rows[0][1],
                albedo_prime: rows[0][2],
            },
            photons: rows[0][3] as u64,
            total: [rows[0][4], rows[0][5]],
            rings: rows.iter().map(|r| [r[6], r[7], r[8], r[9]]).collect(),
        })
        .collect();
    // The evenly drawn media first: their photons scatter less.
    let mut numbered: Vec<(u64, Case)> = (1000..).zip(cases()).collect();
    numbered.sort_by_key(|(seed, _)| seed % 2);
    for (seed, case) in numbered {
        if known.iter().any(|walk| walk.case == case) {
            continue;
        }
        let clock = Instant::now();
        let walk = simulate(case, seed, photons)?;
        println!(
            "{}: {} photons, {:.1} s",
            case.label(),
            walk.photons,
            clock.elapsed().as_secs_f64()
        );
        let Case {
            eta,
            g,
            albedo_prime,
        } = case;
        let mut rows = String::new();
        for ring in &walk.rings {
            let [total, u_total] = walk.total;
            let [inner, outer, value, u] = ring;
            write!(
                rows,
                "\n{eta},{g},{albedo_prime},{},{total},{u_total},{inner},{outer},{value},{u}",
                walk.photons
            )?;
        }
        // A medium is in the file as a whole or not at all.
        OpenOptions::new()
            .append(true)
            .open(path)?
            .write_all(rows.as_bytes())?;
        known.push(walk);
    }
    Ok(known)
}

/// Deviations in one decade of radius: of one medium after the other, (weighted mean, its u).
#[derive(Default)]
struct Decade(Vec<(f64, f64)>);

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("the path of the rings is missing")?;
    let photons = arguments.next().map_or(Ok(10_000_000.0), |n| n.parse())?;
    let walks = walks(&path, photons as u64)?;

    let starts = [0.0, 0.01, 0.1, 1.0, 10.0, f64::INFINITY];
    let mut decades: Vec<Decade> = (1..starts.len()).map(|_| Decade::default()).collect();
    let (mut chi_square, mut rings, mut worst_ring) = (0.0, 0.0, 0.0_f64);
    let mut totals = Vec::new();
    println!("permille by decade of radius from {starts:?} / sigma_t'; total in permille");
    for walk in &walks {
        let case = walk.case;
        let at = case.coefficients();
        let model = TransportModel::new(case.eta, case.g)?;
        let entry = fresnel::entry_factor(case.eta, 1.0);
        let points: Vec<ProfilePoint> = walk
            .rings
            .iter()
            .filter(|[.., value, u]| *u < WORST_U * value)
            .map(|&[inner, outer, value, u]| ProfilePoint {
                ring_mm: Some((inner, outer)),
                radius_mm: physics::profile::mean_radius(inner, outer),
                reflectance_per_mm2: value,
                u_reflectance_per_mm2: u,
                pixels: None,
            })
            .collect();
        let mut means = vec![0.0; points.len()];
        Footprints::new(&points, &Blur::NONE).reflectance(&model, at, &mut means);
        let mut sums = vec![[0.0; 2]; decades.len()];
        let (mut z2, mut worst) = (0.0, 0.0_f64);
        for (p, mean) in points.iter().zip(means) {
            let d = entry * mean / p.reflectance_per_mm2 - 1.0;
            let u = p.u_reflectance_per_mm2 / p.reflectance_per_mm2;
            let stated = model.relative_error(at, p.radius_mm);
            let z = d / u.hypot(stated);
            z2 += z * z;
            worst = worst.max(z.abs());
            let decade = starts.partition_point(|&s| s <= p.radius_mm) - 1;
            sums[decade][0] += d / (u * u);
            sums[decade][1] += 1.0 / (u * u);
        }
        let total = entry * model.within(at, f64::INFINITY).value / walk.total[0] - 1.0;
        let u_total = walk.total[1] / walk.total[0];
        print!(
            "{}: total {:+.2}±{:.2}, chi2 {z2:.0}/{}, worst {worst:.1};",
            case.label(),
            1e3 * total,
            1e3 * u_total,
            points.len()
        );
        for (decade, [sum, weight]) in decades.iter_mut().zip(sums) {
            if weight > 0.0 {
                let (d, u) = (sum / weight, weight.sqrt().recip());
                print!(" {:+.1}±{:.1}", 1e3 * d, 1e3 * u);
                decade.0.push((d, u));
            } else {
                print!(" -");
            }
        }
        println!();
        totals.push((total, u_total));
        chi_square += z2;
        rings += points.len() as f64;
        worst_ring = worst_ring.max(worst);
    }

    println!(
        "over all media, permille: mean deviation ± its u; rms less the photons' noise; worst"
    );
    for (pair, decade) in starts.windows(2).zip(&decades) {
        report(&format!("{} to {}", pair[0], pair[1]), &decade.0);
    }
    report("total", &totals);
    // Wilson and Hilferty's normal approximation of chi-square.
    let z =
        ((chi_square / rings).cbrt() - (1.0 - 2.0 / (9.0 * rings))) / (2.0 / (9.0 * rings)).sqrt();
    println!(
        "chi2 with the stated error {chi_square:.0} over {rings} rings ({z:+.1} sigma; p > 0.001 is below +3.1), worst ring {worst_ring:.1}"
    );

    let radii: Vec<f64> = (0..200).map(|i| 0.01 * 1.04_f64.powi(i)).collect();
    let model = TransportModel::new(1.4, 0.8)?;
    let mut out = vec![0.0; radii.len()];
    // The best of many short runs: a machine that others use disturbs the rest.
    let (mut micros, repeats) = (f64::INFINITY, 50);
    for run in 0..100 {
        let clock = Instant::now();
        for i in 0..repeats {
            let at = Coefficients {
                sigma_a: 0.01 + 1e-6 * f64::from(repeats * run + i),
                sigma_s_prime: 1.0,
            };
            model.diffuse_reflectance(black_box(at), &radii, &mut out);
            black_box(&out);
        }
        micros = micros.min(clock.elapsed().as_secs_f64() * 1e6 / f64::from(repeats));
    }
    println!("{micros:.1} us per profile of 200 radii");
    Ok(())
}

/// Mean over the media, root mean square without what the photons' noise adds, and the worst.
fn report(what: &str, deviations: &[(f64, f64)]) {
    let n = deviations.len() as f64;
    if n == 0.0 {
        return;
    }
    let mean = deviations.iter().map(|(d, _)| d).sum::<f64>() / n;
    let u = deviations.iter().map(|(_, u)| u * u).sum::<f64>().sqrt() / n;
    let excess: f64 = deviations.iter().map(|(d, u)| d * d - u * u).sum();
    let worst = deviations.iter().fold(0.0_f64, |w, (d, _)| w.max(d.abs()));
    println!(
        "{what:>16}: {:+.2} ± {:.2}; rms {:.2}; worst {:.1} ({n} media)",
        1e3 * mean,
        1e3 * u,
        1e3 * (excess / n).max(0.0).sqrt(),
        1e3 * worst
    );
}
