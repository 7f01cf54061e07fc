//! Cameras and lights.

use crate::layer::Prim;
use crate::nodes::Tree;
use choreo_asset::{AssetCamera, AssetLight, Light, LightKind, Projection};
use choreo_importer_kit::Notes;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

pub fn cameras(tree: &Tree<'_>, metres: f64, notes: &Notes) -> Vec<AssetCamera> {
    let mut out = Vec::new();
    for node in tree.nodes.iter().filter(|node| node.prim.kind == "Camera") {
        let prim = node.prim;
        let number = |name: &str, default: f64| {
            prim.number(name).filter(|v| v.is_finite() && *v > 0.0).unwrap_or(default)
        };
        if prim.attributes.get("focalLength").is_some_and(|a| a.samples.len() > 1) {
            notes.warn(&node.path, "has a focal length that changes; the first one is read");
        }
        let range = prim.numbers("clippingRange").and_then(|v| v.first_chunk::<2>()).copied();
        let [near, far] = range.unwrap_or([1.0, 1e6]).map(|v| (v * metres) as f32);
        let near = if near > 0.0 && near.is_finite() { near } else { 0.05 };
        let far = if far > near && far.is_finite() { far } else { near * 1e6 };
        let height = number("verticalAperture", 15.2908);
        let projection = match prim.text("projection") {
            // Apertures are in tenths of a unit.
            "orthographic" => Projection::Orthographic { height: (0.1 * height * metres) as f32, near, far },
            _ => {
                let yfov = 2.0 * libm::atan(0.5 * height / number("focalLength", 50.0));
                let far = (far < 0.9e6).then_some(far);
                Projection::Perspective { yfov: yfov.clamp(1e-3, 3.1) as f32, near, far }
            }
        };
        out.push(AssetCamera { name: name_of(prim), joint: node.joint, projection });
    }
    out
}

pub fn lights(tree: &Tree<'_>, metres: f64, notes: &Notes) -> Vec<AssetLight> {
    let mut out = Vec::new();
    for node in &tree.nodes {
        let prim = node.prim;
        let number = |name: &str, default: f64| {
            let found = prim.number(&format!("inputs:{name}")).or_else(|| prim.number(name));
            found.filter(|v| v.is_finite()).unwrap_or(default)
        };
        let strength =
            number("intensity", 1.0).max(0.0) * libm::exp2(number("exposure", 0.0).clamp(-64.0, 64.0));
        let (kind, intensity) = match prim.kind.as_str() {
            "DistantLight" => (LightKind::Directional, strength),
            "SphereLight" => {
                let radius = number("radius", 0.5) * metres;
                let is_normalized = number("normalize", 0.0) != 0.0;
                // Luminance times the disc that is seen; a normalized one is divided by its surface.
                let candela = if is_normalized { 0.25 * strength } else { strength * PI * radius * radius };
                let angle = number("shaping:cone:angle", 90.0);
                let kind = match angle < 90.0 && angle > 0.0 {
                    true => {
                        let outer = angle.to_radians() as f32;
                        let softness = number("shaping:cone:softness", 0.0).clamp(0.0, 1.0) as f32;
                        LightKind::Spot { inner: (outer * (1.0 - softness)).min(outer * 0.999), outer }
                    }
                    false => LightKind::Point,
                };
                (kind, candela)
            }
            "DomeLight" | "RectLight" | "DiskLight" | "CylinderLight" | "GeometryLight" | "PortalLight" => {
                notes.warn(&node.path, format!("is a {}, which is left out", prim.kind));
                continue;
            }
            _ => continue,
        };
        let color = prim.numbers("inputs:color").or_else(|| prim.numbers("color"));
        let color =
            color.and_then(|v| v.first_chunk::<3>()).map_or(Vec3::ONE, |v| DVec3::from_array(*v).as_vec3());
        let intensity = (intensity as f32).min(f32::MAX);
        let light = Light { kind, color: color.max(Vec3::ZERO), intensity, range: None };
        out.push(AssetLight { name: name_of(prim), joint: node.joint, light });
    }
    out
}

fn name_of(prim: &Prim) -> String {
    if prim.display_name.is_empty() { prim.name.clone() } else { prim.display_name.clone() }
}
