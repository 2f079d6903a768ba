//! Homogeneous media of Mitsuba 3, written and read.

use crate::csv_table::number;
use crate::export::{Band, Bands, Header, Shade, bare_row, spectrum, triple, xml_comment};
use physics::{Material, ReducedMedium};
use roxmltree::{Document, Node};
use thiserror::Error;

/// A scene to `<include>`: for every shade a `dielectric` and the `homogeneous` medium inside it.
///
/// Mitsuba takes σₜ and the albedo, times `scale`, per unit of the scene; scattering is given as
/// isotropic (σₜ′, α′). It takes no colour above 1, so that the largest σₜ′ goes into `scale`
/// together with the length of a unit in mm.
pub fn write(header: &Header, shades: &[Shade]) -> String {
    let mut out = String::from("<!--\n");
    out += &xml_comment(&header.lines, "  ");
    out += "-->\n<scene version=\"3.0.0\">\n";
    for shade in shades {
        let (name, eta) = (&shade.name, number(shade.eta));
        let shortest = shade
            .bands
            .all()
            .map(|b| b.mean_free_path_mm)
            .fold(f64::INFINITY, f64::min);
        let scale = number(header.scene_unit_mm / shortest);
        let extinction = |b: &Band| shortest / b.mean_free_path_mm;
        let albedo = |b: &Band| b.albedo_prime;
        let (kind, sigma_t, albedo) = match &shade.bands {
            Bands::Rgb(bands) => (
                "rgb",
                triple(bands, extinction, ", "),
                triple(bands, albedo, ", "),
            ),
            Bands::Spectrum(bands) => (
                "spectrum",
                spectrum(bands, extinction, ":", ", "),
                spectrum(bands, albedo, ":", ", "),
            ),
        };
        out += &format!("  <!--\n{}  -->\n", xml_comment(&shade.notes, "    "));
        out += &format!(
            "  <bsdf type=\"dielectric\" id=\"{name}\">\n    <float name=\"int_ior\" value=\"{eta}\"/>\n    \
             <float name=\"ext_ior\" value=\"1\"/>\n  </bsdf>\n"
        );
        out += &format!(
            "  <medium type=\"homogeneous\" id=\"{name}_medium\">\n    \
             <{kind} name=\"sigma_t\" value=\"{sigma_t}\"/>\n    <{kind} name=\"albedo\" value=\"{albedo}\"/>\n    \
             <float name=\"scale\" value=\"{scale}\"/>\n    <phase type=\"isotropic\"/>\n  </medium>\n"
        );
    }
    out += "</scene>\n";
    out
}

/// A scene of Mitsuba cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MitsubaError {
    /// Not UTF-8.
    #[error("not a scene of Mitsuba: byte {0} is no UTF-8")]
    Text(usize),
    /// Not XML.
    #[error("not a scene of Mitsuba: {0}")]
    Xml(#[from] roxmltree::Error),
    /// No medium.
    #[error("no `<medium type=\"homogeneous\">`; expected at least one with sigma_t and albedo")]
    Empty,
    /// A field that is missing or not what it should be.
    #[error("line {line}, medium `{medium}`, `{field}`: found {found}, expected {expected}")]
    Field {
        /// Line of the medium, from 1.
        line: u32,
        /// Its id.
        medium: String,
        /// The field.
        field: &'static str,
        /// What stood there.
        found: String,
        /// What should stand there.
        expected: &'static str,
    },
}

/// The homogeneous media of a Mitsuba scene, one unit of which is `scene_unit_mm` long, as σₐ and
/// σₛ(1 - g). η is that of the dielectric which a shape has around the medium, or else of the one
/// that has the medium's id without `_medium`.
///
/// # Errors
///
/// [`MitsubaError`] names line, medium and field.
pub fn read(bytes: &[u8], scene_unit_mm: f64) -> Result<Vec<Material>, MitsubaError> {
    let text = std::str::from_utf8(bytes).map_err(|e| MitsubaError::Text(e.valid_up_to()))?;
    let document = Document::parse(text)?;
    let media: Vec<Node> = document
        .descendants()
        .filter(|n| n.has_tag_name("medium") && n.attribute("type") == Some("homogeneous"))
        .collect();
    if media.is_empty() {
        return Err(MitsubaError::Empty);
    }
    let mut rows = vec![];
    for (at, medium) in media.iter().enumerate() {
        let id = medium
            .attribute("id")
            .map_or_else(|| format!("medium_{}", at + 1), str::to_owned);
        let place = Place {
            line: document.text_pos_at(medium.range().start).row,
            medium: &id,
        };
        let eta = place.eta(&document, medium)?;
        let scale = match child(medium, "scale") {
            Some(node) => place.number("scale", node.attribute("value"))?,
            None => 1.0,
        };
        let g = place.g(medium)?;
        let sigma_t = place.samples("sigma_t", medium)?;
        let albedo = place.samples("albedo", medium)?;
        let keys = |s: &[Sample]| -> Vec<_> { s.iter().map(|s| s.0.clone()).collect() };
        if keys(&sigma_t) != keys(&albedo) {
            return Err(place.wrong(
                "albedo",
                "other colours or wavelengths",
                "those of `sigma_t`",
            ));
        }
        let per_mm = scale / scene_unit_mm;
        let name = id.strip_suffix("_medium").unwrap_or(&id);
        for ((key, t), (_, albedo)) in sigma_t.into_iter().zip(albedo) {
            let medium = ReducedMedium {
                sigma_a: t * (1.0 - albedo) * per_mm,
                sigma_s_prime: t * albedo * per_mm * (1.0 - g),
                eta,
            };
            rows.push(bare_row(name, key, medium, g, "mitsuba"));
        }
    }
    Ok(rows)
}

/// Channel, wavelength and value.
type Sample = ((String, Option<f64>), f64);

/// The child of `node` whose field is called `name`.
fn child<'a, 'i>(node: &Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.attribute("name") == Some(name))
}

/// Where a fault is.
struct Place<'a> {
    line: u32,
    medium: &'a str,
}

impl Place<'_> {
    fn wrong(
        &self,
        field: &'static str,
        found: impl Into<String>,
        expected: &'static str,
    ) -> MitsubaError {
        MitsubaError::Field {
            line: self.line,
            medium: self.medium.to_owned(),
            field,
            found: found.into(),
            expected,
        }
    }

    fn number(&self, field: &'static str, text: Option<&str>) -> Result<f64, MitsubaError> {
        let found = text.unwrap_or("nothing");
        found
            .trim()
            .parse()
            .ok()
            .filter(|n: &f64| n.is_finite())
            .ok_or_else(|| self.wrong(field, format!("`{found}`"), "a finite number"))
    }

    fn eta(&self, document: &Document, medium: &Node) -> Result<f64, MitsubaError> {
        let id = medium.attribute("id");
        let holds = |shape: &Node| {
            *shape == medium.parent().unwrap_or(*shape)
                || shape.children().any(|c| {
                    c.has_tag_name("ref")
                        && c.attribute("name") == Some("interior")
                        && c.attribute("id") == id
                })
        };
        let is_dielectric =
            |n: &Node| n.has_tag_name("bsdf") && n.attribute("type") == Some("dielectric");
        let called = |wanted: Option<&str>| {
            document
                .descendants()
                .find(|n| is_dielectric(n) && wanted.is_some() && n.attribute("id") == wanted)
        };
        let around = document
            .descendants()
            .filter(|n| n.has_tag_name("shape") && holds(n))
            .find_map(|shape| {
                shape.children().find_map(|c| {
                    if is_dielectric(&c) {
                        Some(c)
                    } else if c.has_tag_name("ref") && c.attribute("name") != Some("interior") {
                        called(c.attribute("id"))
                    } else {
                        None
                    }
                })
            });
        let surface = around
            .or_else(|| called(id.map(|id| id.strip_suffix("_medium").unwrap_or(id))))
            .ok_or_else(|| {
                self.wrong(
                    "int_ior",
                    "no dielectric around the medium",
                    "a `<bsdf type=\"dielectric\">` in its shape",
                )
            })?;
        let index = |field: &'static str| match child(&surface, field) {
            Some(node) => self.number(field, node.attribute("value")),
            None => Err(self.wrong(field, "nothing", "a number")),
        };
        Ok(index("int_ior")? / index("ext_ior")?)
    }

    fn g(&self, medium: &Node) -> Result<f64, MitsubaError> {
        let Some(phase) = medium.children().find(|c| c.has_tag_name("phase")) else {
            return Ok(0.0);
        };
        match phase.attribute("type") {
            Some("isotropic") => Ok(0.0),
            Some("hg") => match child(&phase, "g") {
                Some(node) => self.number("g", node.attribute("value")),
                None => Err(self.wrong("g", "nothing", "a number")),
            },
            other => Err(self.wrong(
                "phase",
                format!("type `{}`", other.unwrap_or("")),
                "type isotropic or hg, whose mean cosine reduces the scattering",
            )),
        }
    }

    fn samples(&self, field: &'static str, medium: &Node) -> Result<Vec<Sample>, MitsubaError> {
        let given = child(medium, field)
            .ok_or_else(|| self.wrong(field, "nothing", "an rgb, a float or a spectrum"))?;
        let given = if given.has_tag_name("volume") {
            child(&given, "value").unwrap_or(given)
        } else {
            given
        };
        let text = given.attribute("value").unwrap_or("");
        let parts = || {
            text.split([',', ' '])
                .map(str::trim)
                .filter(|t| !t.is_empty())
        };
        let colours = |values: [f64; 3]| {
            ["R", "G", "B"]
                .into_iter()
                .zip(values)
                .map(|(channel, value)| ((channel.to_owned(), None), value))
                .collect()
        };
        match given.tag_name().name() {
            "float" => Ok(colours([self.number(field, Some(text))?; 3])),
            "rgb" => {
                let found: Vec<f64> = parts()
                    .map(|t| self.number(field, Some(t)))
                    .collect::<Result<_, _>>()?;
                match found[..] {
                    [one] => Ok(colours([one; 3])),
                    [r, g, b] => Ok(colours([r, g, b])),
                    _ => Err(self.wrong(field, format!("`{text}`"), "one or three numbers")),
                }
            }
            "spectrum" => {
                let pair = |t: &str| {
                    let (wavelength, value) = t
                        .split_once(':')
                        .ok_or_else(|| self.wrong(field, format!("`{t}`"), "wavelength:value"))?;
                    let wavelength = self.number(field, Some(wavelength))?;
                    Ok((
                        (number(wavelength), Some(wavelength)),
                        self.number(field, Some(value))?,
                    ))
                };
                parts().map(pair).collect()
            }
            other => Err(self.wrong(
                field,
                format!("`<{other}>`"),
                "an rgb, a float or a spectrum",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::tests::{header, shade};

    fn assert_rows(rows: &[Material], expected: &[(&str, &str, f64, f64, f64)]) {
        assert_eq!(rows.len(), expected.len());
        for (row, (name, channel, sigma_a, sigma_s_prime, eta)) in rows.iter().zip(expected) {
            assert_eq!(
                (row.material.as_str(), row.channel.as_str()),
                (*name, *channel)
            );
            // σₐ is a small difference of what the file holds: its last digits are lost there.
            let near =
                |found: f64, wanted: f64| (found - wanted).abs() < 4e-15 * (1.0 + sigma_s_prime);
            assert!(near(row.medium.sigma_a, *sigma_a), "{row:?}");
            assert!(near(row.medium.sigma_s_prime, *sigma_s_prime), "{row:?}");
            assert!(near(row.medium.eta, *eta), "{row:?}");
        }
    }

    #[test]
    fn what_is_written_comes_back() {
        let text = write(&header(), &[shade()]);
        assert_rows(
            &read(text.as_bytes(), 10.0).unwrap(),
            &[
                ("Marble", "R", 0.25, 1.75, 1.5),
                ("Marble", "G", 0.5, 1.5, 1.5),
                ("Marble", "B", 0.0, 4.0, 1.5),
            ],
        );
        let mut spectral = shade();
        let Bands::Rgb(bands) = shade().bands else {
            unreachable!()
        };
        spectral.bands = Bands::Spectrum(vec![(500.0, bands[0]), (600.5, bands[1])]);
        let rows = read(write(&header(), &[spectral]).as_bytes(), 10.0).unwrap();
        assert_rows(
            &rows,
            &[
                ("Marble", "500", 0.25, 1.75, 1.5),
                ("Marble", "600.5", 0.5, 1.5, 1.5),
            ],
        );
    }

    #[test]
    fn a_scene_by_hand_is_read() {
        let scene = r#"<scene version="3.0.0">
            <shape type="sphere">
                <bsdf type="dielectric">
                    <float name="int_ior" value="1.4"/> <float name="ext_ior" value="1.0"/>
                </bsdf>
                <medium type="homogeneous" name="interior">
                    <float name="sigma_t" value="4"/>
                    <volume type="constvolume" name="albedo"><rgb name="value" value="0.5 0.75 1"/></volume>
                    <float name="scale" value="1000"/>
                    <phase type="hg"><float name="g" value="0.5"/></phase>
                </medium>
            </shape>
        </scene>"#;
        assert_rows(
            &read(scene.as_bytes(), 1000.0).unwrap(),
            &[
                ("medium_1", "R", 2.0, 1.0, 1.4),
                ("medium_1", "G", 1.0, 1.5, 1.4),
                ("medium_1", "B", 0.0, 2.0, 1.4),
            ],
        );
    }

    #[test]
    fn faults_are_named() {
        let found = |inner: &str| {
            let text = format!(
                "<scene>\n<bsdf type=\"dielectric\" id=\"m\"><float name=\"int_ior\" value=\"1.5\"/>\
                 <float name=\"ext_ior\" value=\"1\"/></bsdf>\n<medium type=\"homogeneous\" id=\"m\">{inner}</medium></scene>"
            );
            read(text.as_bytes(), 1.0).unwrap_err().to_string()
        };
        let sigma_t = r#"<float name="sigma_t" value="1"/>"#;
        assert!(found("").contains("line 3, medium `m`, `sigma_t`: found nothing"));
        let volume = r#"<volume type="gridvolume" name="sigma_t"/>"#;
        assert!(found(volume).contains("`<volume>`"), "{}", found(volume));
        let spectral = format!("{sigma_t}<spectrum name=\"albedo\" value=\"500:0.9\"/>");
        assert!(found(&spectral).contains("other colours"));
        let phase = format!("{sigma_t}<float name=\"albedo\" value=\"x\"/>");
        assert!(found(&phase).contains("`albedo`: found `x`"));
        let phase = "<phase type=\"rayleigh\"/>";
        assert!(found(phase).contains("type `rayleigh`"));
        assert!(
            read(b"<scene/>", 1.0)
                .unwrap_err()
                .to_string()
                .contains("no `<medium")
        );
        assert!(read(b"<scene", 1.0).is_err() && read(&[0xff], 1.0).is_err());
        let bare = read(
            b"<scene><medium type=\"homogeneous\" id=\"x\"/></scene>",
            1.0,
        )
        .unwrap_err();
        assert!(bare.to_string().contains("no dielectric around"), "{bare}");
    }
}
