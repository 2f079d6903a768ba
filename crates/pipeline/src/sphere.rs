//! What an integrating sphere measured, inverted.

use crate::error::{Blame, Error, Kind, Result};
use crate::files::{Outputs, read};
use crate::fit_json::SCHEMA_VERSION;
use crate::monitor::Monitor;
use formats::sphere_csv::{self, SampleRow};
use layers::{Found, Inversion, Measured, SphereSample, Third};
use rayon::prelude::*;
use serde::Serialize;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

/// Taken where a sample states no uncertainty of a share: half a percent of it.
pub const DEFAULT_U_RELATIVE: f64 = 0.005;

/// All samples, in the order of the file.
#[derive(Clone, Debug, Serialize)]
pub struct SphereResult {
    schema_version: u32,
    /// One entry a sample.
    pub samples: Vec<SampleResult>,
}

/// One sample: its medium, or why there is none.
#[derive(Clone, Debug, Serialize)]
pub struct SampleResult {
    /// Its name.
    pub sample: String,
    /// Wavelength, nm.
    pub wavelength_nm: Option<f64>,
    /// What it was found to be.
    pub found: Option<SampleFound>,
    /// Why it was not, in a sentence.
    pub error: Option<String>,
    /// What was taken for what the file does not say.
    pub assumed: Vec<String>,
}

/// The medium of a sample.
#[derive(Clone, Debug, Serialize)]
pub struct SampleFound {
    /// Absorption coefficient, mm⁻¹.
    pub sigma_a_per_mm: Number,
    /// Scattering coefficient, mm⁻¹.
    pub sigma_s_per_mm: Number,
    /// Reduced scattering coefficient, mm⁻¹, without uncertainty where g is not known.
    pub sigma_s_prime_per_mm: f64,
    /// Mean cosine.
    pub g: Number,
    /// Of σₐ and σₛ.
    pub correlation: f64,
    /// Whether the interval of σₐ is an upper limit.
    pub at_bound: bool,
    /// Smallest σₐ that this measurement would tell from 0, mm⁻¹.
    pub sigma_a_detectable_per_mm: f64,
    /// Whether no other medium gives the same shares.
    pub unique: bool,
    /// σₐ, σₛ (mm⁻¹) and g of the others.
    pub others: Vec<(f64, f64, f64)>,
}

/// A number with its uncertainty.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Number {
    /// Best estimate.
    pub value: f64,
    /// Standard uncertainty.
    pub u: f64,
    /// 95 % interval.
    pub ci95: (f64, f64),
}

impl From<Found> for Number {
    fn from(found: Found) -> Self {
        Self {
            value: found.value,
            u: found.u,
            ci95: found.ci95,
        }
    }
}

impl From<Inversion> for SampleFound {
    fn from(inversion: Inversion) -> Self {
        Self {
            sigma_s_prime_per_mm: inversion.sigma_s.value * (1.0 - inversion.g.value),
            sigma_a_per_mm: inversion.sigma_a.into(),
            sigma_s_per_mm: inversion.sigma_s.into(),
            g: inversion.g.into(),
            correlation: inversion.correlation,
            at_bound: inversion.at_bound,
            sigma_a_detectable_per_mm: inversion.sigma_a_detectable,
            unique: inversion.others.is_empty(),
            others: inversion.others,
        }
    }
}

/// Inverts every sample of the file `samples` and writes `sphere.csv` and `sphere.json` to
/// `folder`. A sample that cannot be inverted says why and stops no other.
///
/// # Errors
///
/// The file cannot be read, or an output is in the way.
pub fn sphere(
    samples: &Path,
    folder: &Path,
    force: bool,
    monitor: &dyn Monitor,
) -> Result<SphereResult> {
    let rows = sphere_csv::read(read(samples)?.as_slice()).input(samples.display())?;
    let outputs = Outputs::new(
        folder,
        ["sphere.csv", "sphere.json"],
        &[samples.to_owned()],
        force,
    )?;
    monitor.begin("samples", rows.len() as u64);
    let results: Vec<SampleResult> = rows
        .par_iter()
        .map(|row| {
            monitor.check()?;
            let result = invert(row);
            monitor.step();
            Ok(result)
        })
        .collect::<Result<_>>()?;
    let result = SphereResult {
        schema_version: SCHEMA_VERSION,
        samples: results,
    };
    outputs.write("sphere.csv", |out| {
        Ok(out.write_all(csv(&result).as_bytes())?)
    })?;
    outputs.write("sphere.json", |out| {
        Ok(serde_json::to_writer_pretty(out, &result)?)
    })?;
    outputs.commit()?;
    Ok(result)
}

fn invert(row: &SampleRow) -> SampleResult {
    let mut assumed = vec![];
    let mut share = |name: &str, (value, u): (f64, Option<f64>)| {
        let u = u.unwrap_or_else(|| {
            assumed.push(format!("u_{name} {DEFAULT_U_RELATIVE} of the value"));
            DEFAULT_U_RELATIVE * value
        });
        Measured { value, u }
    };
    let reflectance = share("reflectance", row.reflectance);
    let transmittance = share("transmittance", row.transmittance);
    let third = match (row.g, row.collimated_transmittance) {
        (Some((value, u)), None) => Ok(Third::MeanCosine(Measured {
            value,
            u: u.unwrap_or(0.0),
        })),
        (None, Some(collimated)) => Ok(Third::Collimated(share(
            "collimated_transmittance",
            collimated,
        ))),
        _ => Err(
            "expected either g or collimated_transmittance: with reflectance and \
                  transmittance they are three numbers for three unknowns"
                .to_owned(),
        ),
    };
    let found = third.and_then(|third| {
        let sample = SphereSample {
            thickness_mm: Measured {
                value: row.thickness_mm.0,
                u: row.thickness_mm.1,
            },
            eta: row.eta,
            eta_slide: row.eta_slide,
            cos_in: row.angle_deg.to_radians().cos(),
            reflectance,
            transmittance,
            third,
        };
        sample.invert().map_err(|e| e.to_string())
    });
    let (found, error) = match found {
        Ok(inversion) => (Some(inversion.into()), None),
        Err(error) => (None, Some(error)),
    };
    SampleResult {
        sample: row.sample.clone(),
        wavelength_nm: row.wavelength_nm,
        found,
        error,
        assumed,
    }
}

fn csv(result: &SphereResult) -> String {
    let mut text = "sample,wavelength_nm,sigma_a_per_mm,u_sigma_a_per_mm,sigma_a_low_per_mm,\
                    sigma_a_high_per_mm,sigma_s_per_mm,u_sigma_s_per_mm,sigma_s_low_per_mm,\
                    sigma_s_high_per_mm,g,u_g,sigma_s_prime_per_mm,correlation,\
                    sigma_a_detectable_per_mm,unique,error\n"
        .to_owned();
    for sample in &result.samples {
        // A name may hold a comma or a quote.
        let name = sample.sample.replace('"', "\"\"");
        let _ = write!(text, "\"{name}\",");
        let _ = match sample.wavelength_nm {
            Some(nm) => write!(text, "{nm},"),
            None => write!(text, ","),
        };
        let _ = match &sample.found {
            Some(f) => {
                let (a, s) = (f.sigma_a_per_mm, f.sigma_s_per_mm);
                writeln!(
                    text,
                    "{},{},{},{},{},{},{},{},{},{},{},{},{},{},",
                    a.value,
                    a.u,
                    a.ci95.0,
                    a.ci95.1,
                    s.value,
                    s.u,
                    s.ci95.0,
                    s.ci95.1,
                    f.g.value,
                    f.g.u,
                    f.sigma_s_prime_per_mm,
                    f.correlation,
                    f.sigma_a_detectable_per_mm,
                    f.unique
                )
            }
            None => {
                let error = sample.error.as_deref().unwrap_or("").replace('"', "\"\"");
                writeln!(text, ",,,,,,,,,,,,,,\"{error}\"")
            }
        };
    }
    text
}

impl SphereResult {
    /// An error that names the samples without a medium, if there are any.
    ///
    /// # Errors
    ///
    /// [`Kind::Input`], after everything has been written.
    pub fn complete(&self) -> Result<()> {
        let failed: Vec<String> = self
            .samples
            .iter()
            .filter_map(|s| Some(format!("{}: {}", s.sample, s.error.as_ref()?)))
            .collect();
        if failed.is_empty() {
            return Ok(());
        }
        let message = format!(
            "{} of {} samples were not inverted; the others were written\n  {}",
            failed.len(),
            self.samples.len(),
            failed.join("\n  ")
        );
        Err(Error::new(Kind::Input, message))
    }
}
