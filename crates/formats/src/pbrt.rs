//! Materials of pbrt-v4: subsurface materials and media, written and read.

use crate::csv_table::number;
use crate::export::{Bands, Header, Shade, bare_row, spectrum, triple};
use physics::{Material, ReducedMedium};
use thiserror::Error;

/// Materials and media for every shade: `MakeNamedMaterial` with the diffusion model of pbrt, and
/// `MakeNamedMedium` with a dielectric around it for its volume integrators.
///
/// pbrt-v4 takes σₐ and σₛ in mm⁻¹ times `scale`; scattering is given as isotropic (σₛ = σₛ′,
/// g = 0), so that `scale` is the length of a unit of the scene in mm.
pub fn write(header: &Header, shades: &[Shade]) -> String {
    let mut out = header.marked("#");
    for shade in shades {
        out.push('\n');
        for note in &shade.notes {
            out += &format!("# {note}\n");
        }
        let (kind, sigma_a, sigma_s) = match &shade.bands {
            Bands::Rgb(bands) => (
                "rgb",
                triple(bands, |b| b.sigma_a_per_mm, " "),
                triple(bands, |b| b.sigma_s_prime_per_mm, " "),
            ),
            Bands::Spectrum(bands) => (
                "spectrum",
                spectrum(bands, |b| b.sigma_a_per_mm, " ", " "),
                spectrum(bands, |b| b.sigma_s_prime_per_mm, " ", " "),
            ),
        };
        let (name, eta, scale) = (&shade.name, number(shade.eta), number(header.scene_unit_mm));
        let medium = format!(
            "\"{kind} sigma_a\" [ {sigma_a} ]\n  \"{kind} sigma_s\" [ {sigma_s} ]\n  \"float g\" [ 0 ] \
             \"float scale\" [ {scale} ]"
        );
        out += &format!(
            "MakeNamedMaterial \"{name}\" \"string type\" [ \"subsurface\" ]\n  {medium}\n  \
             \"float eta\" [ {eta} ] \"float roughness\" [ 0 ]\n"
        );
        out += &format!(
            "MakeNamedMaterial \"{name}_surface\" \"string type\" [ \"dielectric\" ] \"float eta\" [ {eta} ]\n"
        );
        out += &format!(
            "MakeNamedMedium \"{name}_medium\" \"string type\" [ \"homogeneous\" ]\n  {medium}\n"
        );
    }
    out
}

/// A scene of pbrt cannot be used.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PbrtError {
    /// Not text.
    #[error("not a scene of pbrt: byte {0} is no UTF-8")]
    Text(usize),
    /// A string without its end.
    #[error("line {0}: a string that begins here has no end: close it with `\"`")]
    OpenString(usize),
    /// A parameter that is not what it should be.
    #[error("line {line}, `{parameter}`: found {found}, expected {expected}")]
    Parameter {
        /// Line of the statement, from 1.
        line: usize,
        /// Name of the parameter.
        parameter: String,
        /// What stood there.
        found: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// A medium by what beamspot does not turn into coefficients.
    #[error(
        "line {line}: `{name}` has no `sigma_a` and `sigma_s`: give both in the file (pbrt's own \
         names of media, `reflectance` and `mfp` are not read)"
    )]
    NoCoefficients {
        /// Line of the statement, from 1.
        line: usize,
        /// Name of the material or medium.
        name: String,
    },
    /// Nothing to read.
    #[error(
        "no subsurface material and no homogeneous medium; expected `MakeNamedMaterial`, `Material` \
         or `MakeNamedMedium` with `sigma_a` and `sigma_s`"
    )]
    Empty,
}

/// A word of a scene.
#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    Text(String),
    Open,
    Close,
}

/// The materials of a pbrt scene, one unit of which is `scene_unit_mm` long: σₐ and σₛ(1 - g) of
/// each subsurface material and homogeneous medium, without those media whose coefficients a
/// subsurface material of the file has as well.
///
/// # Errors
///
/// [`PbrtError`] names the line.
pub fn read(bytes: &[u8], scene_unit_mm: f64) -> Result<Vec<Material>, PbrtError> {
    let text = std::str::from_utf8(bytes).map_err(|e| PbrtError::Text(e.valid_up_to()))?;
    let tokens = tokens(text)?;
    let mut rows: Vec<Material> = vec![];
    let mut at = 0;
    let mut unnamed = 0;
    while at < tokens.len() {
        let (line, token) = &tokens[at];
        at += 1;
        let Token::Word(statement) = token else {
            continue;
        };
        let named = match statement.as_str() {
            "MakeNamedMaterial" | "MakeNamedMedium" => true,
            "Material" => false,
            _ => continue,
        };
        let Some((_, Token::Text(first))) = tokens.get(at) else {
            continue;
        };
        at += 1;
        let parameters = parameters(&tokens, &mut at, *line)?;
        let kind = if named {
            texts(&parameters, "type")
                .first()
                .cloned()
                .unwrap_or_default()
        } else {
            first.clone()
        };
        let name = if named {
            first.clone()
        } else {
            unnamed += 1;
            format!("material_{unnamed}")
        };
        if kind != "subsurface" && kind != "homogeneous" {
            continue;
        }
        let found = bands(&parameters, *line, &name, scene_unit_mm)?;
        let known = |row: &Material, new: &Material| {
            row.medium.sigma_a == new.medium.sigma_a
                && row.medium.sigma_s_prime == new.medium.sigma_s_prime
                && row.channel == new.channel
        };
        let repeats = kind == "homogeneous"
            && found
                .iter()
                .all(|new| rows.iter().any(|row| known(row, new)));
        if !repeats {
            rows.extend(found);
        }
    }
    if rows.is_empty() {
        return Err(PbrtError::Empty);
    }
    Ok(rows)
}

/// Words, texts and brackets of a scene with their lines, comments left out.
fn tokens(text: &str) -> Result<Vec<(usize, Token)>, PbrtError> {
    let mut found = vec![];
    let mut line = 1;
    let mut rest = text.char_indices().peekable();
    while let Some((start, c)) = rest.next() {
        match c {
            '\n' => line += 1,
            '#' => while rest.next_if(|(_, c)| *c != '\n').is_some() {},
            '[' => found.push((line, Token::Open)),
            ']' => found.push((line, Token::Close)),
            '"' => {
                let mut word = String::new();
                loop {
                    match rest.next() {
                        Some((_, '"')) => break,
                        Some((_, c)) if c != '\n' => word.push(c),
                        _ => return Err(PbrtError::OpenString(line)),
                    }
                }
                found.push((line, Token::Text(word)));
            }
            c if c.is_whitespace() => {}
            _ => {
                let mut end = start + c.len_utf8();
                while let Some((at, c)) =
                    rest.next_if(|(_, c)| !c.is_whitespace() && !"[]\"#".contains(*c))
                {
                    end = at + c.len_utf8();
                }
                found.push((line, Token::Word(text[start..end].to_owned())));
            }
        }
    }
    Ok(found)
}

/// One parameter: its type, its name and the words of its value.
struct Parameter {
    kind: String,
    name: String,
    values: Vec<String>,
}

/// The parameters that follow from `at`, which is moved behind them.
fn parameters(
    tokens: &[(usize, Token)],
    at: &mut usize,
    line: usize,
) -> Result<Vec<Parameter>, PbrtError> {
    let mut found = vec![];
    while let Some((_, Token::Text(declared))) = tokens.get(*at) {
        *at += 1;
        let wrong = |expected| PbrtError::Parameter {
            line,
            parameter: declared.clone(),
            found: "nothing of the kind".to_owned(),
            expected,
        };
        let (kind, name) = declared
            .split_once(char::is_whitespace)
            .ok_or_else(|| wrong("a type and a name, as \"rgb sigma_a\""))?;
        let mut values = vec![];
        let list = matches!(tokens.get(*at), Some((_, Token::Open)));
        if list {
            *at += 1;
        }
        loop {
            match tokens.get(*at) {
                Some((_, Token::Word(word) | Token::Text(word))) => values.push(word.clone()),
                Some((_, Token::Close)) if list => {
                    *at += 1;
                    break;
                }
                _ => return Err(wrong("a value, or values between `[` and `]`")),
            }
            *at += 1;
            if !list {
                break;
            }
        }
        found.push(Parameter {
            kind: kind.to_owned(),
            name: name.trim().to_owned(),
            values,
        });
    }
    Ok(found)
}

fn texts<'a>(parameters: &'a [Parameter], name: &str) -> &'a [String] {
    parameters
        .iter()
        .find(|p| p.name == name)
        .map_or(&[], |p| p.values.as_slice())
}

/// The rows of one material.
fn bands(
    parameters: &[Parameter],
    line: usize,
    name: &str,
    scene_unit_mm: f64,
) -> Result<Vec<Material>, PbrtError> {
    let numbers = |p: &Parameter| -> Result<Vec<f64>, PbrtError> {
        let number = |text: &String| {
            text.parse()
                .ok()
                .filter(|n: &f64| n.is_finite())
                .ok_or_else(|| PbrtError::Parameter {
                    line,
                    parameter: p.name.clone(),
                    found: format!("`{text}`"),
                    expected: "a finite number",
                })
        };
        p.values.iter().map(number).collect()
    };
    let single = |name: &str, default: f64| -> Result<f64, PbrtError> {
        let Some(p) = parameters.iter().find(|p| p.name == name) else {
            return Ok(default);
        };
        let found = numbers(p)?;
        match found[..] {
            [one] => Ok(one),
            _ => Err(PbrtError::Parameter {
                line,
                parameter: name.to_owned(),
                found: format!("{} numbers", found.len()),
                expected: "one number",
            }),
        }
    };
    let sigma = |wanted: &str| parameters.iter().find(|p| p.name == wanted);
    let (Some(sigma_a), Some(sigma_s)) = (sigma("sigma_a"), sigma("sigma_s")) else {
        return Err(PbrtError::NoCoefficients {
            line,
            name: name.to_owned(),
        });
    };
    let (absorbed, scattered) = (
        samples(sigma_a, numbers, line)?,
        samples(sigma_s, numbers, line)?,
    );
    let keys = |s: &[Sample]| -> Vec<_> {
        s.iter()
            .map(|s| (s.channel.clone(), s.wavelength_nm))
            .collect()
    };
    if keys(&absorbed) != keys(&scattered) {
        return Err(PbrtError::Parameter {
            line,
            parameter: "sigma_s".to_owned(),
            found: "other wavelengths than those of `sigma_a`".to_owned(),
            expected: "the same ones",
        });
    }
    let (g, eta) = (single("g", 0.0)?, single("eta", DEFAULT_ETA)?);
    let per_mm = single("scale", 1.0)? / scene_unit_mm;
    let row = |(a, s): (Sample, Sample)| {
        let medium = ReducedMedium {
            sigma_a: a.value * per_mm,
            sigma_s_prime: s.value * per_mm * (1.0 - g),
            eta,
        };
        bare_row(name, (a.channel, a.wavelength_nm), medium, g, "pbrt")
    };
    Ok(absorbed.into_iter().zip(scattered).map(row).collect())
}

/// The index that pbrt-v4 takes where none is given.
const DEFAULT_ETA: f64 = 1.33;

struct Sample {
    channel: String,
    wavelength_nm: Option<f64>,
    value: f64,
}

/// The colours or wavelengths of a coefficient.
fn samples(
    parameter: &Parameter,
    numbers: impl Fn(&Parameter) -> Result<Vec<f64>, PbrtError>,
    line: usize,
) -> Result<Vec<Sample>, PbrtError> {
    let wrong = |expected| PbrtError::Parameter {
        line,
        parameter: parameter.name.clone(),
        found: format!("{} {}", parameter.kind, parameter.values.join(" ")),
        expected,
    };
    match parameter.kind.as_str() {
        "rgb" => {
            let found: [f64; 3] = numbers(parameter)?
                .try_into()
                .map_err(|_| wrong("three numbers"))?;
            let sample = |(channel, value): (&str, f64)| Sample {
                channel: channel.to_owned(),
                wavelength_nm: None,
                value,
            };
            Ok(["R", "G", "B"].into_iter().zip(found).map(sample).collect())
        }
        "spectrum" => {
            let found = numbers(parameter)
                .map_err(|_| wrong("wavelengths and values in turn, not the name of a spectrum"))?;
            if found.is_empty() || found.len() % 2 == 1 {
                return Err(wrong("wavelengths and values in turn"));
            }
            let sample = |pair: &[f64]| Sample {
                channel: number(pair[0]),
                wavelength_nm: Some(pair[0]),
                value: pair[1],
            };
            Ok(found.chunks_exact(2).map(sample).collect())
        }
        _ => Err(wrong("type rgb or spectrum")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::tests::{header, shade};

    fn coefficients(rows: &[Material]) -> Vec<(&str, &str, f64, f64, f64)> {
        rows.iter()
            .map(|r| {
                let m = r.medium;
                (
                    r.material.as_str(),
                    r.channel.as_str(),
                    m.sigma_a,
                    m.sigma_s_prime,
                    m.eta,
                )
            })
            .collect()
    }

    #[test]
    fn what_is_written_comes_back() {
        let text = write(&header(), &[shade()]);
        let rows = read(text.as_bytes(), 10.0).unwrap();
        assert_eq!(
            coefficients(&rows),
            [
                ("Marble", "R", 0.25, 1.75, 1.5),
                ("Marble", "G", 0.5, 1.5, 1.5),
                ("Marble", "B", 0.0, 4.0, 1.5)
            ]
        );
        let mut spectral = shade();
        let Bands::Rgb(bands) = shade().bands else {
            unreachable!()
        };
        spectral.bands = Bands::Spectrum(vec![(500.0, bands[0]), (600.5, bands[1])]);
        let rows = read(write(&header(), &[spectral]).as_bytes(), 10.0).unwrap();
        assert_eq!(
            coefficients(&rows),
            [
                ("Marble", "500", 0.25, 1.75, 1.5),
                ("Marble", "600.5", 0.5, 1.5, 1.5)
            ]
        );
        assert_eq!(rows[1].wavelength_nm, Some(600.5));
    }

    #[test]
    fn a_scene_by_hand_is_read_in_its_own_unit() {
        let scene = "# made by hand\nWorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [.5 .5 .5]\n\
            Material \"subsurface\" \"rgb sigma_a\" [1 2 3] \"rgb sigma_s\" [ 10 20 30 ]\n  \
            \"float g\" 0.5 \"float scale\" 2 \"float eta\" [1.4] # a meter\nShape \"sphere\"\n";
        let rows = read(scene.as_bytes(), 1000.0).unwrap();
        let expected = [(0.002, 0.01), (0.004, 0.02), (0.006, 0.03)];
        for (row, (sigma_a, sigma_s_prime)) in rows.iter().zip(expected) {
            assert!((row.medium.sigma_a / sigma_a - 1.0).abs() < 1e-15);
            assert!((row.medium.sigma_s_prime / sigma_s_prime - 1.0).abs() < 1e-15);
            assert_eq!((row.medium.eta, row.g), (1.4, Some(0.5)));
        }
        assert_eq!(rows.len(), 3);
    }

    #[test]
    fn faults_are_named() {
        let found = |text: &str| read(text.as_bytes(), 1.0).unwrap_err().to_string();
        assert!(found("WorldBegin\n").contains("no subsurface material"));
        assert!(found("Material \"subsurface").contains("line 1: a string"));
        let mfp = "\n\nMaterial \"subsurface\" \"rgb mfp\" [1 1 1] \"rgb reflectance\" [1 1 1]";
        assert!(found(mfp).contains("line 3: `material_1` has no `sigma_a`"));
        let medium = |a: &str| {
            found(&format!(
                "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" {a} \"rgb sigma_s\" [1 1 1]"
            ))
        };
        assert!(medium("\"rgb sigma_a\" [1 x 1]").contains("`sigma_a`: found `x`"));
        assert!(medium("\"rgb sigma_a\" [1 1]").contains("expected three numbers"));
        assert!(medium("\"rgb sigma_a\" [1 1 1").contains("between `[` and `]`"));
        assert!(medium("\"spectrum sigma_a\" \"metal-Cu\"").contains("not the name"));
        assert!(medium("\"spectrum sigma_a\" [500 1]").contains("other wavelengths"));
        assert!(read(&[0xff], 1.0).is_err());
    }
}
