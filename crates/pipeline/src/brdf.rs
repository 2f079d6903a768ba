//! BRDF and BTDF of layers by three witnesses: first order, photons, adding-doubling.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::{Outputs, read_text};
use crate::fit_json::SCHEMA_VERSION;
use crate::medium::{layered_medium, shipped};
use crate::monitor::Monitor;
use formats::medium_toml;
use gauss_quad::GaussLegendre;
use montecarlo::{Direction, Estimate, Incidence, Side, SimdPath, Simulation, Tally, TallySpec};
use physics::brdf::Directions;
use physics::{FirstOrder, LayeredMedium, Reflections};
use report::{Chart, Line, Panel, Scale, Stroke, chart_svg};
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write as _;
use std::io::Write;
use std::num::NonZeroUsize;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Bins of the angle of view, 5 degrees each.
const ANGLES: usize = 18;
/// Bins of the azimuth from 0 to 180 degrees, 15 degrees each.
const AZIMUTHS: usize = 12;
/// Orders of scattering told apart.
const ORDERS: usize = 10;

/// What the user chooses.
#[derive(Clone, Debug, PartialEq)]
pub struct BrdfOptions {
    /// Angles of incidence, degrees, in [0, 90).
    pub angles_deg: Vec<f64>,
    /// Photons for each of them.
    pub photons: u64,
    /// Seed of every random number.
    pub seed: u64,
}

/// One angle of incidence.
#[derive(Clone, Debug, Serialize)]
pub struct Angle {
    /// Angle of incidence, degrees.
    pub angle_in_deg: f64,
    /// Share reflected by the first surface.
    pub specular: f64,
    /// Share reflected in all, by adding-doubling.
    pub reflectance: f64,
    /// Share transmitted in all, by adding-doubling.
    pub transmittance: f64,
    /// Share reflected in all, by photons.
    pub reflectance_monte_carlo: Share,
    /// Share transmitted in all, by photons.
    pub transmittance_monte_carlo: Share,
    /// Shares that scattered once, of the reflected and the transmitted light, by formula.
    pub first_order: [f64; 2],
    /// L_m of the paper's section 6 for reflection and transmission: the constant that stands for
    /// everything above first order, sr⁻¹.
    pub constant_per_sr: [f64; 2],
    /// Error of first order plus constant: rms over directions, relative to the mean BRDF or BTDF,
    /// the photons' noise taken off.
    pub constant_error_relative: [f64; 2],
}

/// A share with its standard error.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Share {
    /// The share.
    pub value: f64,
    /// Its standard error.
    pub u: f64,
}

/// All angles.
#[derive(Clone, Debug, Serialize)]
pub struct BrdfResult {
    schema_version: u32,
    photons: u64,
    seed: u64,
    simd: &'static str,
    /// One entry an angle of incidence.
    pub angles: Vec<Angle>,
}

/// One bin of directions on one side.
struct Bin {
    /// Ends of angle and azimuth, radians.
    ends: [f64; 4],
    /// Means over the bin, sr⁻¹: first order by formula, by photons, all orders by photons.
    first_order: f64,
    once: Estimate,
    all: Estimate,
    /// ∫ cos θ dω, both halves of the azimuth.
    measure: f64,
}

/// One side of one angle of incidence.
struct Hemisphere {
    bins: Vec<Bin>,
    /// By angle, mean over azimuth and over the bin, by adding-doubling, sr⁻¹.
    adding_doubling: Vec<f64>,
    constant: f64,
    constant_error: f64,
    first_order: f64,
}

const NAMES: [&str; 6] = [
    "brdf.csv",
    "brdf_mean.csv",
    "orders.csv",
    "brdf.json",
    "brdf.svg",
    "medium.toml",
];

/// BRDF and BTDF of the medium of a file, or of a shipped medium (`skin`, `leaf`) by its name,
/// into `folder`.
///
/// # Errors
///
/// The medium cannot be used, an angle is out of range, or an output is in the way.
pub fn brdf(
    medium: &Path,
    folder: &Path,
    options: &BrdfOptions,
    force: bool,
    monitor: &dyn Monitor,
) -> Result<BrdfResult> {
    let (text, inputs) = match medium.to_str().and_then(shipped) {
        Some(text) if !medium.is_file() => (text.to_owned(), vec![]),
        _ => (read_text(medium)?, vec![PathBuf::from(medium)]),
    };
    let file = medium_toml::parse(&text).input(medium.display())?;
    let layered = layered_medium(&file).map_err(|e| e.within(medium.display()))?;
    for angle in &options.angles_deg {
        if !(0.0..90.0).contains(angle) {
            let message = format!("--angle: expected at least 0 and below 90 degrees, got {angle}");
            return Err(Error::new(Kind::Usage, message));
        }
    }
    let outputs = Outputs::new(folder, NAMES, &inputs, force)?;
    let model = FirstOrder::new(layered.clone(), Reflections::All).input(medium.display())?;
    let blocks = Simulation::blocks_for(options.photons)
        .map_err(|e| Error::new(Kind::Usage, e))?
        .end;
    monitor.begin("photons", blocks * options.angles_deg.len() as u64);

    let mut angles = vec![];
    let mut panels = vec![];
    let mut by_direction = "angle_in_deg,side,angle_min_deg,angle_max_deg,azimuth_min_deg,\
                            azimuth_max_deg,first_order_per_sr,monte_carlo_first_per_sr,\
                            u_monte_carlo_first_per_sr,monte_carlo_per_sr,u_monte_carlo_per_sr,\
                            first_order_plus_constant_per_sr\n"
        .to_owned();
    let mut by_angle = "angle_in_deg,side,angle_min_deg,angle_max_deg,first_order_per_sr,\
                        adding_doubling_per_sr,monte_carlo_per_sr,u_monte_carlo_per_sr,\
                        first_order_plus_constant_per_sr\n"
        .to_owned();
    let mut orders = "angle_in_deg,side,order,share,u_share\n".to_owned();
    for &angle_in_deg in &options.angles_deg {
        let angle = angle_in_deg.to_radians();
        let simulation =
            simulation(&layered, angle, options.seed).map_err(|e| e.within(medium.display()))?;
        let tally = follow(&simulation, 0..blocks, monitor)?;
        let solved = solve(&layered, angle).input(medium.display())?;
        let sides = [(Side::Above, "reflected"), (Side::Below, "transmitted")];
        let mut hemispheres = vec![];
        for (side, name) in sides {
            let hemisphere = hemisphere(&model, &solved, &tally, side, angle);
            for bin in &hemisphere.bins {
                let [low, high, from, to] = bin.ends.map(f64::to_degrees);
                let _ = writeln!(
                    by_direction,
                    "{angle_in_deg},{name},{low:.4},{high:.4},{from:.4},{to:.4},{:e},{:e},{:e},{:e},{:e},{:e}",
                    bin.first_order,
                    bin.once.value,
                    bin.once.u,
                    bin.all.value,
                    bin.all.u,
                    bin.first_order + hemisphere.constant
                );
            }
            for (ring, exact) in hemisphere.rings().iter().zip(&hemisphere.adding_doubling) {
                let [low, high] = ring.ends.map(f64::to_degrees);
                let _ = writeln!(
                    by_angle,
                    "{angle_in_deg},{name},{low:.4},{high:.4},{:e},{exact:e},{:e},{:e},{:e}",
                    ring.first_order,
                    ring.all.value,
                    ring.all.u,
                    ring.first_order + hemisphere.constant
                );
            }
            let by_order = tally.by_order(side);
            for (order, share) in by_order.bins.iter().enumerate() {
                let _ = writeln!(
                    orders,
                    "{angle_in_deg},{name},{order},{:e},{:e}",
                    share.value, share.u
                );
            }
            let more = by_order.beyond;
            let _ = writeln!(
                orders,
                "{angle_in_deg},{name},more,{:e},{:e}",
                more.value, more.u
            );
            panels.push(hemisphere.panel(&format!("{name}, in at {angle_in_deg}°")));
            hemispheres.push(hemisphere);
        }
        let specular = tally.specular();
        let share = |a: Estimate, b: f64| Share {
            value: a.value + b,
            u: a.u,
        };
        angles.push(Angle {
            angle_in_deg,
            specular: solved.response.specular[0],
            reflectance: solved.response.reflectance[0],
            transmittance: solved.response.transmittance[0],
            reflectance_monte_carlo: share(tally.reflectance(), specular.value),
            transmittance_monte_carlo: share(tally.transmittance(), 0.0),
            first_order: [0, 1].map(|k| hemispheres[k].first_order),
            constant_per_sr: [0, 1].map(|k| hemispheres[k].constant),
            constant_error_relative: [0, 1].map(|k| hemispheres[k].constant_error),
        });
    }
    let result = BrdfResult {
        schema_version: SCHEMA_VERSION,
        photons: options.photons,
        seed: options.seed,
        simd: SimdPath::best().name(),
        angles,
    };
    let chart = Chart {
        title: "Light scattered in the layers, mean over azimuth".to_owned(),
        columns: 2,
        panels,
    };
    for (name, text) in [
        ("brdf.csv", by_direction),
        ("brdf_mean.csv", by_angle),
        ("orders.csv", orders),
        ("brdf.svg", chart_svg(&chart)),
        ("medium.toml", text),
    ] {
        outputs.write(name, |out| Ok(out.write_all(text.as_bytes())?))?;
    }
    outputs.write("brdf.json", |out| {
        Ok(serde_json::to_writer_pretty(out, &result)?)
    })?;
    outputs.commit()?;
    Ok(result)
}

fn simulation(medium: &LayeredMedium, angle: f64, seed: u64) -> Result<Simulation> {
    let spec = TallySpec {
        angle_bins: ANGLES,
        azimuth_bins: AZIMUTHS,
        orders: ORDERS,
        ..TallySpec::default()
    };
    let incidence = Incidence {
        direction: Direction::Collimated { angle },
        ..Incidence::PENCIL
    };
    Simulation::new(medium.clone(), incidence, &spec, seed).input("medium")
}

/// Follows these blocks of photons.
pub(crate) fn follow(
    simulation: &Simulation,
    blocks: Range<u64>,
    monitor: &dyn Monitor,
) -> Result<Tally> {
    let mut done = 0;
    let tally = simulation.run(blocks, &AtomicBool::new(false), |so_far| {
        let finished = so_far.photons() / montecarlo::PHOTONS_PER_BLOCK;
        for _ in done..finished {
            monitor.step();
        }
        done = finished;
        if monitor.stopped() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    monitor.check()?;
    Ok(tally)
}

/// Adding-doubling at the nodes of a rule over every bin of the angle.
struct Solved {
    response: layers::Response,
    rule: Vec<(f64, f64)>,
}

fn solve(medium: &LayeredMedium, angle: f64) -> std::result::Result<Solved, layers::CannotSolve> {
    let rule: Vec<(f64, f64)> = gauss(3)
        .iter()
        .map(|&(x, w)| (0.5 * (1.0 + x), 0.5 * w))
        .collect();
    let views: Vec<f64> = (0..ANGLES)
        .flat_map(|i| rule.iter().map(move |&(x, _)| edge(i as f64 + x).cos()))
        .collect();
    Ok(Solved {
        response: layers::solve(medium, &[angle.cos()], &views)?,
        rule,
    })
}

/// The angle that is `bins` widths of a bin, radians.
fn edge(bins: f64) -> f64 {
    FRAC_PI_2 * bins / ANGLES as f64
}

fn gauss(points: usize) -> GaussLegendre {
    GaussLegendre::new(NonZeroUsize::new(points).expect("a rule has points"))
}

fn hemisphere(
    model: &FirstOrder,
    solved: &Solved,
    tally: &Tally,
    side: Side,
    angle: f64,
) -> Hemisphere {
    let counted = tally
        .by_order_and_direction(side)
        .expect("the tally was asked for");
    let rule = gauss(4);
    let mut bins = vec![];
    for i in 0..ANGLES {
        for j in 0..AZIMUTHS {
            let azimuth = |k: usize| PI * k as f64 / AZIMUTHS as f64;
            let ends = [
                edge(i as f64),
                edge(i as f64 + 1.0),
                azimuth(j),
                azimuth(j + 1),
            ];
            let [low, high, from, to] = ends;
            let measure = (high.sin().powi(2) - low.sin().powi(2)) * (to - from);
            let share = rule.integrate(low, high, |view: f64| {
                let ring = rule.integrate(from, to, |azimuth: f64| {
                    let directions = Directions {
                        cos_in: angle.cos(),
                        cos_out: view.cos(),
                        cos_azimuth: azimuth.cos(),
                    };
                    match side {
                        Side::Above => model.brdf(&directions),
                        Side::Below => model.btdf(&directions),
                    }
                });
                2.0 * view.cos() * view.sin() * ring
            });
            let cell = i * (AZIMUTHS + 1) + j;
            // Order 0 is the unscattered beam, a peak and not a density.
            let mut all = Estimate { value: 0.0, u: 0.0 };
            for order in &counted[1..] {
                all.value += order.cells[cell].value;
                all.u = all.u.hypot(order.cells[cell].u);
            }
            let per_sr = |e: Estimate| Estimate {
                value: e.value / measure,
                u: e.u / measure,
            };
            bins.push(Bin {
                ends,
                first_order: share / measure,
                once: per_sr(counted[1].cells[cell]),
                all: per_sr(all),
                measure,
            });
        }
    }
    let views = match side {
        Side::Above => &solved.response.brdf[0],
        Side::Below => &solved.response.btdf[0],
    };
    let adding_doubling = (0..ANGLES)
        .map(|i| {
            let (mut sum, mut weights) = (0.0, 0.0);
            for (k, &(x, w)) in solved.rule.iter().enumerate() {
                let view = edge(i as f64 + x);
                let weight = w * view.cos() * view.sin();
                sum += weight * views[i * solved.rule.len() + k];
                weights += weight;
            }
            sum / weights
        })
        .collect();
    let total = |f: &dyn Fn(&Bin) -> f64| bins.iter().map(|b| b.measure * f(b)).sum::<f64>();
    // Least squares with the weight cos θ dω: the mean of what is left.
    let constant = total(&|b| b.all.value - b.first_order) / PI;
    let off = total(&|b| (b.all.value - b.first_order - constant).powi(2) - b.all.u.powi(2)) / PI;
    let mean = total(&|b| b.all.value) / PI;
    Hemisphere {
        constant_error: if mean > 0.0 {
            off.max(0.0).sqrt() / mean
        } else {
            0.0
        },
        first_order: total(&|b| b.first_order),
        adding_doubling,
        constant,
        bins,
    }
}

/// A ring of bins: the mean over azimuth.
struct Ring {
    ends: [f64; 2],
    first_order: f64,
    all: Estimate,
}

impl Hemisphere {
    fn rings(&self) -> Vec<Ring> {
        self.bins
            .chunks(AZIMUTHS)
            .map(|ring| {
                let n = AZIMUTHS as f64;
                Ring {
                    ends: [ring[0].ends[0], ring[0].ends[1]],
                    first_order: ring.iter().map(|b| b.first_order).sum::<f64>() / n,
                    all: Estimate {
                        value: ring.iter().map(|b| b.all.value).sum::<f64>() / n,
                        u: ring.iter().map(|b| b.all.u.powi(2)).sum::<f64>().sqrt() / n,
                    },
                }
            })
            .collect()
    }

    fn panel(&self, title: &str) -> Panel {
        let rings = self.rings();
        let line = |name: &str, stroke, f: &dyn Fn(usize, &Ring) -> f64| Line {
            name: name.to_owned(),
            points: rings
                .iter()
                .enumerate()
                .map(|(k, ring)| {
                    let middle = 0.5 * (ring.ends[0] + ring.ends[1]).to_degrees();
                    (middle, f(k, ring))
                })
                .collect(),
            stroke,
        };
        Panel {
            title: title.to_owned(),
            x: "angle of view (degrees)".to_owned(),
            y: "BRDF, BTDF (sr⁻¹)".to_owned(),
            x_range: Some((0.0, 90.0)),
            scale: Scale::Linear,
            lines: vec![
                line("adding-doubling", Stroke::Full, &|k, _| {
                    self.adding_doubling[k]
                }),
                line("Monte Carlo", Stroke::Dots, &|_, r| r.all.value),
                line("first order", Stroke::Full, &|_, r| r.first_order),
                line("first order + constant", Stroke::Dashed, &|_, r| {
                    r.first_order + self.constant
                }),
            ],
        }
    }
}
