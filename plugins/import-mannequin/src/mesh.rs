//! The mesh of the figure: all parts meshed and skinned, one primitive for each material.

use crate::cast::{Surface, cast, lens_surface, mirrored};
use crate::figure::{Skinning, inlays, parts};
use crate::rig::{self, Joint, Side};
use crate::skin::influences;
use choreo_asset::{Mesh, Primitive, Skin};
use glam::{Mat4, Quat};

pub(crate) const MATERIALS: u32 = 4;

fn append(primitive: &mut Primitive, skinning: &Skinning, side: Side, surface: &Surface, scale: f32) {
    let first = primitive.positions.len() as u32;
    primitive.indices.extend(surface.indices.iter().map(|i| first + i));
    primitive.normals.extend(&surface.normals);
    for p in &surface.positions {
        let skin = influences(skinning, side, *p);
        primitive.joint_indices.extend(skin.joints);
        primitive.joint_weights.extend(skin.weights);
        primitive.positions.push(*p * scale);
    }
}

pub(crate) fn build(scale: f32) -> Mesh {
    let mut primitives: Vec<Primitive> = (0..MATERIALS)
        .map(|material| Primitive { influences: 4, material: Some(material), ..Primitive::default() })
        .collect();
    for part in parts() {
        let surface = cast(&part.field, &part.grid);
        let primitive = &mut primitives[part.material as usize];
        append(primitive, &part.skinning, Side::Left, &surface, scale);
        if part.paired {
            append(primitive, &part.skinning, Side::Right, &mirrored(&surface), scale);
        }
    }
    let head = Skinning::Rigid(|_| rig::HEAD);
    for inlay in inlays() {
        let surface = lens_surface(&inlay.field, &inlay.lens);
        let primitive = &mut primitives[inlay.material as usize];
        append(primitive, &head, Side::Left, &surface, scale);
        if inlay.paired {
            append(primitive, &head, Side::Right, &mirrored(&surface), scale);
        }
    }
    Mesh { name: "mannequin".into(), primitives, ..Mesh::default() }
}

pub(crate) fn skin(joints: &[Joint], scale: f32) -> Skin {
    Skin {
        joints: (0..joints.len() as u32).collect(),
        inverse_bind: joints
            .iter()
            .map(|joint| {
                let back: Quat = joint.axes.conjugate();
                Mat4::from_rotation_translation(back, back * (joint.at * -scale))
            })
            .collect(),
    }
}
