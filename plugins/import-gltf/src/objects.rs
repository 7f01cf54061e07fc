//! Cameras, lights and skins: the objects on nodes besides meshes.

use crate::file::File;
use crate::nodes::Tree;
use crate::problem::{Problem, Result, WithPlace, element};
use choreo_asset::{AssetCamera, AssetLight, Light, LightKind, Projection, Skin};
use glam::{Mat4, Vec3};
use gltf::json;
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::Checked;
use std::f32::consts::{FRAC_PI_2, PI};

/// Smallest outer angle of a spot light, radians: narrower spots light nothing.
const MIN_OUTER_RAD: f32 = 1e-4;

pub(crate) fn cameras(file: &File<'_>, tree: &Tree) -> Result<Vec<AssetCamera>> {
    let mut out = Vec::new();
    for (joint, node) in tree.node_of_joint[..tree.scene_joint_count].iter().enumerate() {
        let Some(index) = file.root.nodes[*node].camera else { continue };
        let user = || format!("nodes[{node}].camera");
        let camera = element(&file.root.cameras, index.value(), "cameras", user)?;
        let place = format!("cameras[{}]", index.value());
        let name = camera.name.as_ref().or(file.root.nodes[*node].name.as_ref());
        out.push(AssetCamera {
            name: name.cloned().unwrap_or_else(|| format!("camera {}", index.value())),
            joint: joint as u32,
            projection: read_projection(file, camera, &place)?,
        });
    }
    Ok(out)
}

fn read_projection(file: &File<'_>, camera: &json::Camera, place: &str) -> Result<Projection> {
    let check = |ok: bool, what: &str| if ok { Ok(()) } else { Err(Problem::new(place, what)) };
    match (camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(json::camera::Type::Perspective), Some(p), _) => {
            check(p.yfov > 0.0 && p.yfov < PI, "yfov must be between 0 and π")?;
            let far = p.zfar.filter(|f| f.is_finite());
            check(p.znear > 0.0 && p.znear.is_finite(), "znear must be above 0")?;
            check(far.is_none_or(|f| f > p.znear), "zfar must be above znear")?;
            Ok(Projection::Perspective { yfov: p.yfov, near: p.znear, far })
        }
        (Checked::Valid(json::camera::Type::Orthographic), _, Some(o)) => {
            let size_ok = o.ymag.is_finite() && o.xmag.is_finite() && o.ymag != 0.0 && o.xmag != 0.0;
            check(size_ok, "xmag and ymag must not be 0")?;
            check(
                o.znear >= 0.0 && o.zfar.is_finite() && o.zfar > o.znear,
                "zfar must be above znear, and znear 0 or more",
            )?;
            if o.xmag < 0.0 || o.ymag < 0.0 {
                file.warn(place, "negative xmag or ymag is taken as positive");
            }
            Ok(Projection::Orthographic { height: 2.0 * o.ymag.abs(), near: o.znear, far: o.zfar })
        }
        _ => Err(Problem::new(place, "is neither a complete perspective nor a complete orthographic camera")),
    }
}

pub(crate) fn lights(file: &File<'_>, tree: &Tree) -> Result<Vec<AssetLight>> {
    let listed = match file.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
        Some(list) => list.lights.as_slice(),
        None => &[],
    };
    let mut out = Vec::new();
    for (joint, node) in tree.node_of_joint[..tree.scene_joint_count].iter().enumerate() {
        let node_json = &file.root.nodes[*node];
        let Some(own) = node_json.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else {
            continue;
        };
        let index = own.light.value();
        let user = || format!("nodes[{node}].extensions.KHR_lights_punctual");
        let light = element(listed, index, "lights", user)?;
        let place = format!("extensions.KHR_lights_punctual.lights[{index}]");
        let name = light.name.as_ref().or(node_json.name.as_ref());
        out.push(AssetLight {
            name: name.cloned().unwrap_or_else(|| format!("light {index}")),
            joint: joint as u32,
            light: read_punctual_light(file, light, place)?,
        });
    }
    Ok(out)
}

fn read_punctual_light(
    file: &File<'_>,
    light: &json::extensions::scene::khr_lights_punctual::Light,
    place: String,
) -> Result<Light> {
    let color = Vec3::from(light.color);
    if !color.is_finite() || !light.intensity.is_finite() || light.intensity < 0.0 {
        return Err(Problem::new(place, "color and intensity must be finite, and the intensity 0 or more"));
    }
    let kind = match light.type_ {
        Checked::Valid(LightType::Directional) => LightKind::Directional,
        Checked::Valid(LightType::Point) => LightKind::Point,
        Checked::Valid(LightType::Spot) => {
            let spot = light.spot.as_ref();
            let (inner, outer) = spot.map_or((0.0, PI / 4.0), |s| (s.inner_cone_angle, s.outer_cone_angle));
            if !inner.is_finite() || !outer.is_finite() {
                return Err(Problem::new(place, "cone angles must be finite"));
            }
            let clamped_outer = outer.clamp(MIN_OUTER_RAD, FRAC_PI_2);
            let clamped_inner = inner.clamp(0.0, clamped_outer * 0.9999);
            if clamped_outer != outer || (clamped_inner - inner).abs() > 1e-3 {
                file.warn(
                    place.clone(),
                    format!("cone angles {inner} and {outer} rad are brought into 0 ≤ inner < outer ≤ π/2"),
                );
            }
            LightKind::Spot { inner: clamped_inner, outer: clamped_outer }
        }
        Checked::Invalid => {
            return Err(Problem::new(place, "is of an unknown type")
                .hint("KHR_lights_punctual knows directional, point and spot"));
        }
    };
    let range = light.range.filter(|r| r.is_finite() && *r > 0.0);
    let range = if kind == LightKind::Directional { None } else { range };
    Ok(Light { kind, color: color.max(Vec3::ZERO), intensity: light.intensity, range })
}

/// All skins of the file. A skin whose joints were not all read is empty; it is an error where a shown node uses it.
pub(crate) fn skins(file: &File<'_>, tree: &Tree) -> Result<Vec<Skin>> {
    let mut out = Vec::with_capacity(file.root.skins.len());
    let mut user = vec![None; file.root.skins.len()];
    for node in &tree.node_of_joint[..tree.scene_joint_count] {
        if let Some(slot) = file.root.nodes[*node].skin.and_then(|s| user.get_mut(s.value())) {
            *slot = Some(*node);
        }
    }
    for (index, skin) in file.root.skins.iter().enumerate() {
        let place = || format!("skins[{index}]");
        let mut joints = Vec::with_capacity(skin.joints.len());
        for node in &skin.joints {
            element(&file.root.nodes, node.value(), "nodes", || format!("skins[{index}].joints"))?;
            joints.extend(tree.joint_of_node[node.value()]);
        }
        if joints.len() < skin.joints.len() {
            if let Some(node) = user[index] {
                return Err(Problem::new(
                    place(),
                    format!("is used by nodes[{node}], but not all of its joints are in one tree"),
                ));
            }
            out.push(Skin::default());
            continue;
        }
        let inverse_bind = match skin.inverse_bind_matrices {
            None => vec![Mat4::IDENTITY; joints.len()],
            Some(accessor) => {
                let place = || format!("skins[{index}].inverseBindMatrices");
                let matrices = file
                    .read_floats::<16>(accessor.value(), crate::accessor::Integers::AsFlagged)
                    .at(place)?;
                if matrices.len() < joints.len() {
                    return Err(Problem::new(
                        place(),
                        format!("{} joints, but only {} matrices", joints.len(), matrices.len()),
                    ));
                }
                matrices[..joints.len()].iter().map(Mat4::from_cols_array).collect()
            }
        };
        out.push(Skin { joints, inverse_bind });
    }
    Ok(out)
}
