//! The joints of an asset as a UsdSkel skeleton: paths, rest and bind transforms.
//!
//! A UsdSkel skeleton has one bind transform for each joint; an asset has one for each skin and joint. Where two skins differ at a
//! joint, the second one gets a helper joint below it, which does not move relative to it.

use crate::names::{Names, identifier};
use choreo_plugin::asset::{Asset, Skin};
use choreo_plugin::glam::{DMat4, DQuat};
use choreo_plugin::motion::Transform;

/// Largest difference of a matrix entry between equal bind transforms.
const MATRIX_TOLERANCE: f64 = 1e-5;

pub(crate) struct Joints {
    /// Path of each joint, `Hips/Spine`.
    pub paths: Vec<String>,
    /// The names in the asset; `None` unless all are distinct and none is empty.
    pub names: Option<Vec<String>>,
    /// Rest transforms, parent from joint. Helper joints follow the asset's joints and keep this transform.
    pub rest: Vec<DMat4>,
    /// Bind transforms, model from joint.
    pub bind: Vec<DMat4>,
    pub skins: Vec<BoundSkin>,
}

/// A skin whose joints are those of the skeleton.
pub(crate) struct BoundSkin {
    pub joints: Vec<u32>,
    /// Model space of the skeleton from mesh space, at bind time.
    pub geometry: DMat4,
}

pub(crate) fn matrix(t: &Transform) -> DMat4 {
    let rotation: DQuat = t.rotation.as_dquat().normalize();
    DMat4::from_scale_rotation_translation(t.scale.as_dvec3(), rotation, t.translation.as_dvec3())
}

/// Model from joint, for each joint.
pub(crate) fn in_model(asset: &Asset, locals: &[Transform]) -> Vec<DMat4> {
    let mut out: Vec<DMat4> = Vec::with_capacity(locals.len());
    for (local, parent) in locals.iter().zip(asset.skeleton.parents()) {
        let own = matrix(local);
        out.push(parent.map_or(own, |parent| out[parent as usize] * own));
    }
    out
}

impl Joints {
    pub(crate) fn of(asset: &Asset) -> Joints {
        let skeleton = &asset.skeleton;
        let mut names: Vec<Names> = vec![Names::default(); skeleton.len() + 1];
        let mut paths: Vec<String> = Vec::with_capacity(skeleton.len());
        for (name, parent) in skeleton.names().iter().zip(skeleton.parents()) {
            let name = names[parent.map_or(skeleton.len(), |p| p as usize)].add_unique(name);
            paths.push(parent.map_or(name.clone(), |parent| format!("{}/{name}", paths[parent as usize])));
        }
        let mut known = skeleton.names().to_vec();
        known.sort_unstable();
        known.dedup();
        let named = known.len() == skeleton.len() && !known.iter().any(String::is_empty);
        let mut out = Joints {
            names: named.then(|| skeleton.names().to_vec()),
            paths,
            rest: skeleton.rest().iter().map(matrix).collect(),
            bind: Vec::new(),
            skins: Vec::new(),
        };
        let mut bind: Vec<Option<DMat4>> = vec![None; skeleton.len()];
        for (number, skin) in asset.skins.iter().enumerate() {
            let bound = out.add_skin_binding(number, skin, &mut bind);
            out.skins.push(bound);
        }
        let at_rest = in_model(asset, skeleton.rest());
        let fallback = |joint: usize| at_rest.get(joint).copied().filter(is_invertible);
        out.bind = bind
            .into_iter()
            .enumerate()
            .map(|(joint, bind)| bind.or_else(|| fallback(joint)).unwrap_or(DMat4::IDENTITY))
            .collect();
        out
    }

    fn add_skin_binding(&mut self, number: usize, skin: &Skin, bind: &mut Vec<Option<DMat4>>) -> BoundSkin {
        let inverse = |index: usize| {
            skin.inverse_bind.get(index).map_or(DMat4::IDENTITY, |m| without_projection(&m.as_dmat4()))
        };
        // The geometry's bind transform takes the scale of a mesh in centimetres, so that joints need none: some importers ignore
        // the scale of bones.
        let first = (0..skin.joints.len()).map(inverse).find(is_invertible);
        let size = first.map_or(1.0, |m| libm::cbrt(m.determinant().abs()));
        let size = if (size - 1.0).abs() < 1e-4 { 1.0 } else { size };
        let geometry = DMat4::from_scale(choreo_plugin::glam::DVec3::splat(size));
        let mut joints = Vec::with_capacity(skin.joints.len());
        for (index, joint) in skin.joints.iter().enumerate() {
            let inverse = inverse(index);
            let own = is_invertible(&inverse).then(|| geometry * inverse.inverse());
            let known = bind[*joint as usize];
            let is_same =
                |a: &DMat4, b: &DMat4| a.abs_diff_eq(*b, MATRIX_TOLERANCE * a.w_axis.length().max(1.0));
            match (own, known) {
                (Some(own), None) => {
                    bind[*joint as usize] = Some(own);
                    joints.push(*joint);
                }
                (Some(own), Some(known)) if is_same(&own, &known) => joints.push(*joint),
                (own, _) => {
                    // A bind matrix without an inverse becomes the rest transform of the helper joint, whose bind transform is
                    // the identity.
                    let name = identifier(&format!("bind_{number}_{index}"));
                    let above = *joint as usize;
                    self.paths.push(format!("{}/{name}", self.paths[above]));
                    if let Some(names) = &mut self.names {
                        names.push(format!("{} {name}", names[above]));
                    }
                    self.rest.push(if own.is_some() {
                        DMat4::IDENTITY
                    } else {
                        inverse * geometry.inverse()
                    });
                    bind.push(Some(own.unwrap_or(DMat4::IDENTITY)));
                    joints.push(self.rest.len() as u32 - 1);
                }
            }
        }
        BoundSkin { joints, geometry }
    }
}

fn without_projection(m: &DMat4) -> DMat4 {
    let mut m = *m;
    (m.x_axis.w, m.y_axis.w, m.z_axis.w, m.w_axis.w) = (0.0, 0.0, 0.0, 1.0);
    m
}

fn is_invertible(m: &DMat4) -> bool {
    let inverse = m.inverse();
    m.is_finite() && m.determinant().abs() > 1e-18 && inverse.is_finite()
}
