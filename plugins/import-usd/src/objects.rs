//! Cameras and lights, with their time samples.

use crate::clips::Clips;
use crate::layer::Prim;
use crate::nodes::Tree;
use crate::transforms;
use choreo_asset::{Asset, AssetCamera, AssetLight, Light, LightKind, Projection};
use choreo_importer_kit::rows::{SamplingLimits, sample_rows};
use choreo_importer_kit::{Notes, Result};
use choreo_motion::{Interpolation, PropertyCurve, PropertyTarget, Time};
use glam::Vec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Accuracy of the keys that are added for nonlinear properties, such as field of view from focal length.
const SAMPLING_LIMITS: SamplingLimits = SamplingLimits { tolerance: 5e-5, depth: 9, rows: 1_000_000 };

/// A prim evaluated at a time code.
#[derive(Clone, Copy)]
struct PrimAtTime<'a> {
    prim: &'a Prim,
    time_code: f64,
}

impl PrimAtTime<'_> {
    fn numbers(&self, name: &str) -> Vec<f64> {
        self.prim.attributes.get(name).map(|a| transforms::numbers_at(a, self.time_code)).unwrap_or_default()
    }

    fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).first().copied().filter(|v| v.is_finite())
    }

    /// An input of a light, under its current name, or the one that files before 2022 use.
    fn input(&self, name: &str, default: f64) -> f64 {
        self.number(&format!("inputs:{name}")).or_else(|| self.number(name)).unwrap_or(default)
    }

    fn projection(&self, metres: f64) -> Projection {
        let number = |name: &str, default: f64| self.number(name).filter(|v| *v > 0.0).unwrap_or(default);
        let range = self.numbers("clippingRange").first_chunk::<2>().copied();
        let [near, far] = range.unwrap_or([1.0, 1e6]).map(|v| (v * metres) as f32);
        let near = if near > 0.0 && near.is_finite() { near } else { 0.05 };
        let far = if far > near && far.is_finite() { far } else { near * 1e6 };
        let height = number("verticalAperture", 15.2908);
        match self.prim.text("projection") {
            // Apertures are in tenths of a scene unit.
            "orthographic" => Projection::Orthographic { height: (0.1 * height * metres) as f32, near, far },
            _ => {
                let yfov = 2.0 * libm::atan(0.5 * height / number("focalLength", 50.0));
                let far = (far < 0.9e6).then_some(far);
                Projection::Perspective { yfov: yfov.clamp(1e-3, 3.1) as f32, near, far }
            }
        }
    }

    fn color(&self) -> Vec3 {
        let color = ["inputs:color", "color"].map(|name| self.numbers(name));
        let color = color.iter().find_map(|color| color.first_chunk::<3>());
        let color = color.map_or(Vec3::ONE, |color| Vec3::from(color.map(|v| v as f32)));
        if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ONE }
    }

    /// The light's luminance; illuminance for a distant light.
    fn strength(&self) -> f64 {
        self.input("intensity", 1.0).max(0.0) * libm::exp2(self.input("exposure", 0.0).clamp(-64.0, 64.0))
    }

    /// The light; `None` for types without an equivalent. Area lights become points, with luminance times visible frontal area as
    /// intensity. Flat area lights shine with the cosine of the angle, which a spot of 90 degrees approximates.
    fn light(&self, metres: f64) -> Option<Light> {
        let length = |name: &str, default: f64| self.input(name, default).abs() * metres;
        let strength = self.strength();
        // The luminance of a normalized light is divided by its surface area.
        let of = |seen: f64, surface: f64| match self.input("normalize", 0.0) != 0.0 {
            true => strength * seen / surface.max(1e-12),
            false => strength * seen,
        };
        let flat = LightKind::Spot { inner: 0.0, outer: FRAC_PI_2 as f32 };
        let (kind, intensity) = match self.prim.kind.as_str() {
            "DistantLight" => (LightKind::Directional, strength),
            "SphereLight" => {
                let disc = PI * length("radius", 0.5) * length("radius", 0.5);
                // The surface area cancels, which keeps a radius of 0 valid.
                let normalized = self.input("normalize", 0.0) != 0.0;
                (LightKind::Point, if normalized { 0.25 * strength } else { of(disc, 4.0 * disc) })
            }
            "DiskLight" => {
                let disc = PI * length("radius", 0.5) * length("radius", 0.5);
                (flat, of(disc, disc))
            }
            "RectLight" => {
                let area = length("width", 1.0) * length("height", 1.0);
                (flat, of(area, area))
            }
            "CylinderLight" => {
                let side = length("length", 1.0) * length("radius", 0.5);
                (LightKind::Point, of(2.0 * side, 2.0 * PI * side))
            }
            _ => return None,
        };
        let angle = self.input("shaping:cone:angle", 90.0);
        let kind = match angle < 90.0 && angle > 0.0 && !kind.is_directional() {
            true => {
                let outer = angle.to_radians() as f32;
                let softness = self.input("shaping:cone:softness", 0.0).clamp(0.0, 1.0) as f32;
                LightKind::Spot { inner: (outer * (1.0 - softness)).min(outer * 0.999), outer }
            }
            false => kind,
        };
        let intensity = (intensity as f32).min(f32::MAX);
        Some(Light { kind, color: self.color(), intensity, range: None })
    }
}

/// Adds the cameras and lights of a tree, and the curves of their animated properties.
pub(crate) fn add_cameras_and_lights(
    tree: &Tree<'_>,
    metres: f64,
    clips: &mut Clips<'_>,
    asset: &mut Asset,
) -> Result<()> {
    for node in &tree.nodes {
        let (prim, joint, notes) = (node.prim, node.joint, clips.notes);
        let at = |time_code: f64| PrimAtTime { prim, time_code };
        let rest = at(clips.start_time_code);
        match prim.kind.as_str() {
            "Camera" => {
                let index = asset.cameras.len() as u32;
                let projection = rest.projection(metres);
                asset.cameras.push(AssetCamera { name: name_of(prim), joint, projection });
                let target = match projection {
                    Projection::Perspective { .. } => PropertyTarget::CameraYfov(index),
                    Projection::Orthographic { .. } => PropertyTarget::CameraHeight(index),
                };
                let row = |code| match at(code).projection(metres) {
                    Projection::Perspective { yfov, .. } => vec![yfov],
                    Projection::Orthographic { height, .. } => vec![height],
                };
                add_property_curves(prim, &["focalLength", "verticalAperture"], &[target], clips, row)?;
            }
            "DomeLight" => add_dome_light(&rest, &node.path, notes, asset),
            "GeometryLight" | "PortalLight" | "PluginLight" => {
                notes.warn(&node.path, format!("is a {}, which is left out", prim.kind));
            }
            kind => {
                let Some(light) = rest.light(metres) else { continue };
                if matches!(kind, "DiskLight" | "RectLight" | "CylinderLight") {
                    notes.warn(&node.path, format!("is a {kind}, which becomes a light at its center"));
                }
                let index = asset.lights.len() as u32;
                asset.lights.push(AssetLight { name: name_of(prim), joint, light });
                let all = [
                    PropertyTarget::LightColor(index),
                    PropertyTarget::LightIntensity(index),
                    PropertyTarget::SpotInner(index),
                    PropertyTarget::SpotOuter(index),
                ];
                let targets = if light.kind.cone().is_some() { &all[..] } else { &all[..2] };
                let row = |code| {
                    let Some(light) = at(code).light(metres) else { return Vec::new() };
                    let cone = light.kind.cone().into_iter().flatten();
                    light.color.to_array().into_iter().chain([light.intensity]).chain(cone).collect()
                };
                add_property_curves(prim, &LIGHT_INPUTS, targets, clips, row)?;
            }
        }
    }
    Ok(())
}

/// Light attributes whose time samples are read.
const LIGHT_INPUTS: [&str; 9] = [
    "inputs:color",
    "inputs:intensity",
    "inputs:exposure",
    "inputs:shaping:cone:angle",
    "inputs:shaping:cone:softness",
    "inputs:radius",
    "inputs:width",
    "inputs:height",
    "inputs:length",
];

/// Adds a dome light without an image to the ambient light; warns about one with an image.
fn add_dome_light(at: &PrimAtTime<'_>, path: &str, notes: &Notes, asset: &mut Asset) {
    let image = ["inputs:texture:file", "texture:file"].map(|name| at.prim.text(name));
    match image.into_iter().find(|image| !image.is_empty()) {
        Some(image) => {
            let file = choreo_importer_kit::text::shown(image.as_bytes());
            notes.warn(
                path,
                format!(
                    "is a DomeLight with an image, which is left out; sky(\"{file}\") in a script shows it"
                ),
            );
        }
        None => {
            let ambient = at.color() * at.strength() as f32;
            if ambient.is_finite() {
                asset.ambient = asset.ambient.max(ambient);
            }
        }
    }
}

/// Adds curves of the targets where any of the attributes has time samples. `row` returns the values of all targets,
/// concatenated, at a time code.
fn add_property_curves(
    prim: &Prim,
    attributes: &[&str],
    targets: &[PropertyTarget],
    clips: &mut Clips<'_>,
    row: impl Fn(f64) -> Vec<f32>,
) -> Result<()> {
    let samples = attributes.iter().filter_map(|name| prim.attributes.get(*name)).flat_map(|a| &a.samples);
    let mut codes: Vec<f64> = samples.map(|(code, _)| *code).collect();
    codes.sort_by(f64::total_cmp);
    codes.dedup();
    let Some((_, times)) = clips.key_times(&codes) else { return Ok(()) };
    clips.budget.charge(times.len() as u64, 64)?;
    let (start, rate) = (clips.start_time_code, clips.time_codes_per_second);
    let width: usize = targets.iter().map(|target| target.width()).sum();
    let made = sample_rows(&times, SAMPLING_LIMITS, |time: Time| {
        let mut row = row(start + time.as_secs() * rate);
        // A spot whose cone opens to 90 degrees becomes a point, so its angles are filled in with 90 degrees.
        row.resize(width, FRAC_PI_2 as f32);
        row
    });
    let Some(made) = made else {
        return Err(format!("{} has more than {} keys", prim.name, SAMPLING_LIMITS.rows).into());
    };
    clips.budget.charge(made.len() as u64, 64)?;
    let mut from = 0;
    for target in targets {
        let part = from..from + target.width();
        from = part.end;
        if made.iter().all(|(_, row)| row[part.clone()] == made[0].1[part.clone()]) {
            continue;
        }
        clips.properties.push(PropertyCurve {
            target: *target,
            interpolation: Interpolation::Linear,
            times: made.iter().map(|(time, _)| *time).collect(),
            values: made.iter().flat_map(|(_, row)| &row[part.clone()]).copied().collect(),
        });
    }
    Ok(())
}

fn name_of(prim: &Prim) -> String {
    if prim.display_name.is_empty() { prim.name.clone() } else { prim.display_name.clone() }
}
