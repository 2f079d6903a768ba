//! One solid, one light, one pixel.

use physics::{DiffuseFresnel, Dipole, Medium};
use render::bssrdf::{Diffusion, Profile};
use render::camera::Lens;
use render::{Camera, Lamp, Light, Material, Object, Scene, Shape, Vec3, View};

pub(crate) fn scene(shape: Shape, media: Vec<Medium>, light: Light) -> Scene {
    let view = View {
        from: Vec3::new(0.0, 0.0, 900.0),
        to: Vec3::ZERO,
        up: Vec3::Y,
        width: 1,
        height: 1,
    };
    Scene {
        channels: (0..media.len()).map(|c| c.to_string()).collect(),
        lamps: vec![Lamp {
            light,
            strength: vec![1.0; media.len()],
        }],
        objects: vec![Object {
            name: "sample".into(),
            shape,
            material: Material {
                media,
                texture: None,
            },
        }],
        camera: Camera::new(view, Lens::Orthographic { height: 1.0 }).expect("a camera"),
    }
    .validated()
    .expect("a scene")
}

/// The dipole of a medium, and its diffusion.
pub(crate) fn dipole(medium: &Medium) -> (Dipole, Diffusion) {
    let dipole = Dipole::new(&medium.reduced(), DiffuseFresnel::Exact);
    let profile = Profile::new(medium, |radii, out| {
        for (r, value) in radii.iter().zip(out) {
            *value = dipole.diffuse_reflectance(*r);
        }
    });
    let diffusion = Diffusion {
        profile,
        share: 1.0,
        source_depth_mm: 1.0 / medium.reduced().coefficients().sigma_t_prime(),
    };
    (dipole, diffusion)
}
