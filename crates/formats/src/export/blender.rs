//! A Python script that makes materials for Blender's Cycles.

use super::{Band, Header, Shade, SpectrumError, triple};
use crate::csv_table::number;
use std::f64::consts::PI;

/// A script that adds a material with a Principled BSDF for every shade; Blender 4.0 or later runs
/// it (Scripting, Open, Run).
///
/// Cycles' random walk takes 4π times the mean free path as its radius, in units of the scene: it
/// divides what it is given by 4π, so that it looks like the models that it had before
/// (`bssrdf_setup_radius` in its `bssrdf.h`). Its colour is the albedo of a half-space without a
/// reflecting surface (`subsurface_random_walk_remap`); light is refracted on its way in, but what
/// comes to the surface from inside always leaves. What is written is the [`super::IndexMatched`]
/// medium.
///
/// # Errors
///
/// A spectrum has no place in it.
pub fn write(header: &Header, shades: &[Shade]) -> Result<String, SpectrumError> {
    let mut out = header.marked("#");
    out += "import bpy\n\nMATERIALS = {\n";
    for shade in shades {
        let bands = shade.rgb("Blender")?;
        for note in &shade.notes {
            out += &format!("    # {note}\n");
        }
        let radius = |b: &Band| 4.0 * PI * b.index_matched.mean_free_path_mm / header.scene_unit_mm;
        out += &format!(
            "    \"{}\": {{\n        \"color\": ({}),\n        \"radius\": ({}),\n        \"ior\": {},\n    }},\n",
            shade.name,
            triple(bands, |b| b.index_matched.color, ", "),
            triple(bands, radius, ", "),
            number(shade.eta),
        );
    }
    out += SCRIPT;
    Ok(out)
}

const SCRIPT: &str = r#"}


def add(name, color, radius, ior):
    """A material of Blender's whose random walk has these mean free paths and colours."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.subsurface_method = "RANDOM_WALK"
    longest = max(radius)
    values = {
        "Base Color": (*color, 1.0),
        "Roughness": 0.0,
        "IOR": ior,
        "Subsurface Weight": 1.0,
        "Subsurface Radius": [r / longest for r in radius],
        "Subsurface Scale": longest,
    }
    for field, value in values.items():
        shader.inputs[field].default_value = value
    return material


for name, values in MATERIALS.items():
    add(name, **values)
"#;

#[cfg(test)]
mod tests {
    use super::super::tests::{header, shade};
    use super::*;

    #[test]
    fn the_radius_is_what_cycles_divides_by_four_pi() {
        let text = write(&header(), &[shade()]).unwrap();
        let line = text.lines().find(|l| l.contains("\"radius\"")).unwrap();
        let numbers: Vec<f64> = line
            .split(['(', ')', ','])
            .filter_map(|part| part.trim().parse().ok())
            .collect();
        for (found, mean_free_path_mm) in numbers.iter().zip([0.75, 0.75, 0.375]) {
            assert!(
                (found * 10.0 / (4.0 * PI) - mean_free_path_mm).abs() < 1e-12,
                "{line}"
            );
        }
        assert_eq!(numbers.len(), 3);
        assert!(text.contains("\"color\": (0.85, 0.85, 0.85)"), "{text}");
        assert!(text.contains("    # a note\n    \"Marble\": {\n"), "{text}");
    }
}
