//! The choice of the packing of normals and skin weights for the GPU.

use super::{MeasuredScene, SceneChoices};
use crate::moment::Moment;
use crate::plots::{Choice, Row};
use crate::reference::ErrorStats;
use crate::vertex::{NORMALS, WEIGHTS, degrees_between};
use choreo_asset::{Asset, Skin};
use glam::{Affine3A, DAffine3, DVec3, Mat3, Mat4, Vec3};
use std::sync::Arc;

/// Largest number of vertices of one mesh that are measured, taken evenly.
const MAX_VERTICES: usize = 20_000;

pub fn choices(scene: &MeasuredScene, moment: &Moment) -> SceneChoices {
    let mut assets: Vec<(&Arc<Asset>, usize)> = Vec::new();
    for (index, actor) in scene.stage.actors.iter().enumerate() {
        if !assets.iter().any(|(a, _)| Arc::ptr_eq(a, &actor.asset)) {
            assets.push((&actor.asset, index));
        }
    }
    let mut found = Vec::new();
    found.extend(normals(&assets));
    found.extend(weights(&assets, moment));
    match found.is_empty() {
        true => SceneChoices::None("no mesh has normals or a skin".into()),
        false => SceneChoices::Choices(found),
    }
}

fn normals(assets: &[(&Arc<Asset>, usize)]) -> Option<Choice> {
    let mut choice = Choice::new("normals", "How are normals packed for the GPU?");
    choice.error_unit = "°";
    choice.reference = "the angle to the file's normal, in f64".into();
    let mut errors = vec![ErrorStats::default(); NORMALS.len()];
    let mut places = vec![String::new(); NORMALS.len()];
    for (asset, _) in assets {
        for mesh in &asset.meshes {
            let count: usize = mesh.primitives.iter().map(|p| p.normals.len()).sum();
            let step = count.div_ceil(MAX_VERTICES).max(1);
            for normal in mesh.primitives.iter().flat_map(|p| &p.normals).step_by(step) {
                for (method, (_, _, pack)) in NORMALS.iter().enumerate() {
                    if errors[method].add(degrees_between(*normal, pack(*normal))) {
                        places[method] = format!("{}, mesh \"{}\"", asset.name, mesh.name);
                    }
                }
            }
        }
    }
    if errors[0].is_empty() {
        return None;
    }
    for (((name, bytes, _), error), place) in NORMALS.iter().zip(&errors).zip(places) {
        let row = Row::new(*name).error(error.worst, error.mean()).bytes(*bytes as f64).at(place);
        choice.rows.push(row);
    }
    choice.choose(
        NORMALS[1].0,
        "an error too small to see in shading, in a format that every device reads directly",
    );
    Some(choice)
}

fn weights(assets: &[(&Arc<Asset>, usize)], moment: &Moment) -> Option<Choice> {
    let mut choice = Choice::new("weights", "How are skin weights packed for the GPU?");
    choice.error_unit = "mm";
    choice.reference = "skinned positions with the file's own weights, in f64".into();
    let mut errors = vec![ErrorStats::default(); WEIGHTS.len()];
    let mut places = vec![String::new(); WEIGHTS.len()];
    for (asset, actor) in assets {
        let posed = &moment.snapshot.actors[*actor].model_from_joint;
        let posed = if posed.is_empty() { asset.rest_model_from_joint() } else { posed };
        for instance in &asset.instances {
            let (Some(skin), Some(mesh)) = (
                instance.skin.and_then(|s| asset.skins.get(s as usize)),
                asset.meshes.get(instance.mesh as usize),
            ) else {
                continue;
            };
            let carriers = model_from_mesh(skin, posed);
            for primitive in mesh.primitives.iter().filter(|p| p.influences > 0) {
                let n = primitive.influences;
                let step = primitive.positions.len().div_ceil(MAX_VERTICES).max(1);
                for (v, position) in primitive.positions.iter().enumerate().step_by(step) {
                    let given = &primitive.joint_weights[v * n..(v + 1) * n];
                    let joints = &primitive.joint_indices[v * n..(v + 1) * n];
                    let place = |weights: &[f32]| -> DVec3 {
                        let each = weights.iter().zip(joints).filter_map(|(weight, joint)| {
                            let carrier = carriers.get(usize::from(*joint))?;
                            Some(carrier.transform_point3(position.as_dvec3()) * f64::from(*weight))
                        });
                        each.sum()
                    };
                    let exact = place(given);
                    for (method, (_, _, pack)) in WEIGHTS.iter().enumerate() {
                        if errors[method].add((place(&pack(given)) - exact).length() * 1e3) {
                            places[method] = format!("{}, mesh \"{}\", vertex {v}", asset.name, mesh.name);
                        }
                    }
                }
            }
        }
    }
    if errors[0].is_empty() {
        return None;
    }
    for (((name, bytes, _), error), place) in WEIGHTS.iter().zip(&errors).zip(places) {
        let row = Row::new(*name).error(error.worst, error.mean()).bytes(*bytes as f64).at(place);
        choice.rows.push(row);
    }
    choice.choose(WEIGHTS[1].0, "looks as exact as floats, at half their size");
    Some(choice)
}

/// Model-from-mesh matrices of the joints of a skin, for a pose.
pub(super) fn model_from_mesh(skin: &Skin, posed: &[Affine3A]) -> Vec<DAffine3> {
    let pairs = skin.joints.iter().zip(&skin.inverse_bind);
    let map = |(joint, bind): (&u32, &Mat4)| {
        let joint = posed.get(*joint as usize).copied().unwrap_or(Affine3A::IDENTITY);
        let joint = DAffine3::from_mat3_translation(
            Mat3::from(joint.matrix3).as_dmat3(),
            Vec3::from(joint.translation).as_dvec3(),
        );
        joint * DAffine3::from_mat4(bind.as_dmat4())
    };
    pairs.map(map).collect()
}
