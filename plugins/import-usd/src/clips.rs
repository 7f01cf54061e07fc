//! Time samples become one clip: prim transforms, skeleton joints, blend shape weights.

use crate::layer::Prim;
use crate::nodes::{Rig, Tree};
use crate::transforms;
use choreo_importer_kit::{Budget, Notes, Problem, Result};
use choreo_motion::{Clip, Curve, Interpolation, Path, PropertyCurve, Time, Transform};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Seconds from the start within which keys are read.
const MAX_KEY_SECS: f64 = 1e6;

pub(crate) struct Clips<'a> {
    pub budget: &'a Budget,
    pub notes: &'a Notes,
    pub start_time_code: f64,
    pub time_codes_per_second: f64,
    pub curves: Vec<Curve>,
    /// Curves of cameras and lights.
    pub properties: Vec<PropertyCurve>,
}

impl Clips<'_> {
    /// Key times of time codes, with the codes that are kept: increasing, and within the limit. `None` where fewer than two are
    /// left.
    pub(crate) fn key_times(&self, codes: &[f64]) -> Option<(Vec<f64>, Arc<[Time]>)> {
        let mut kept: Vec<f64> = Vec::new();
        let mut times: Vec<Time> = Vec::new();
        for code in codes {
            let secs = (code - self.start_time_code) / self.time_codes_per_second;
            let time = Time::from_secs(secs.clamp(-MAX_KEY_SECS, MAX_KEY_SECS));
            if secs.abs() < MAX_KEY_SECS && times.last().is_none_or(|last| *last < time) {
                kept.push(*code);
                times.push(time);
            }
        }
        (times.len() > 1).then(|| (kept, times.into()))
    }

    /// Adds the curves of a joint from its transforms at the given times. A channel that does not change gets a single key.
    fn add_transform_curves(&mut self, joint: u32, times: &Arc<[Time]>, list: &[Transform]) -> Result<()> {
        self.budget.charge(list.len() as u64, 40)?;
        let mut before = list[0].rotation;
        let rotations: Vec<f32> = list
            .iter()
            .flat_map(|t| {
                // A rotation has two quaternions; the one nearer to the key before is used.
                before = if before.dot(t.rotation) < 0.0 { -t.rotation } else { t.rotation };
                before.to_array()
            })
            .collect();
        let translations = list.iter().flat_map(|t| t.translation.to_array()).collect();
        let scales = list.iter().flat_map(|t| t.scale.to_array()).collect();
        self.add_curve(joint, Path::Translation, times, translations);
        self.add_curve(joint, Path::Rotation, times, rotations);
        self.add_curve(joint, Path::Scale, times, scales);
        Ok(())
    }

    fn add_curve(&mut self, joint: u32, path: Path, times: &Arc<[Time]>, values: Vec<f32>) {
        let width = path.width();
        let is_still = values.chunks(width).all(|value| *value == values[..width]);
        let (times, values): (Arc<[Time]>, Vec<f32>) = match is_still {
            true => ([times[0]].into(), values[..width].to_vec()),
            false => (times.clone(), values),
        };
        let (interpolation, values) = (Interpolation::Linear, values.into());
        self.curves.push(Curve { joint, path, interpolation, times, values });
    }

    /// Adds the curves of animated prim transforms.
    pub(crate) fn add_prim_curves(&mut self, tree: &Tree<'_>) -> Result<()> {
        for node in &tree.nodes {
            let codes = transforms::sample_times(node.prim);
            let Some((codes, times)) = self.key_times(&codes) else { continue };
            self.budget.charge(codes.len() as u64, 256)?;
            let list: Vec<Transform> = codes
                .iter()
                .map(|code| transforms::to_transform(&transforms::local_matrix(node.prim, *code)))
                .collect();
            self.add_transform_curves(node.joint, &times, &list)?;
        }
        Ok(())
    }

    /// Adds the curves of a skeleton's joints from a SkelAnimation.
    pub(crate) fn add_skeleton_curves(&mut self, rig: &Rig<'_>, animation: &Prim, path: &str) -> Result<()> {
        let own = animation.texts("joints");
        let parts = ["translations", "rotations", "scales"].map(|name| animation.attributes.get(name));
        let mut codes: Vec<f64> =
            parts.iter().flatten().flat_map(|a| a.samples.iter().map(|(time, _)| *time)).collect();
        codes.sort_by(f64::total_cmp);
        codes.dedup();
        let still = codes.len() < 2;
        let (codes, times) = match self.key_times(&codes) {
            Some(found) => found,
            None if still => (vec![self.start_time_code], [Time::ZERO].into()),
            None => return Ok(()),
        };
        self.budget.charge(codes.len() as u64 * own.len() as u64, 64)?;
        let mut all: Vec<Vec<Transform>> = vec![Vec::with_capacity(codes.len()); own.len()];
        for code in &codes {
            let [translations, rotations, scales] =
                parts.map(|part| part.map(|part| transforms::numbers_at(part, *code)).unwrap_or_default());
            for (index, list) in all.iter_mut().enumerate() {
                let vector = |numbers: &[f64], default: f64| {
                    let found = numbers.get(3 * index..3 * index + 3);
                    found.map_or(glam::DVec3::splat(default), glam::DVec3::from_slice).as_vec3()
                };
                let rotation = rotations.get(4 * index..4 * index + 4).map(transforms::quaternion);
                let transform = Transform {
                    translation: vector(&translations, 0.0),
                    rotation: rotation.unwrap_or_default().as_quat().normalize(),
                    scale: vector(&scales, 1.0),
                };
                if !transform.is_finite() {
                    return Err(Problem::new(path, "has a transform that is not finite"));
                }
                list.push(transform);
            }
        }
        for (token, list) in own.iter().zip(all) {
            match rig.index_of_path.get(token.as_str()) {
                Some(joint) => self.add_transform_curves(rig.joints[*joint], &times, &list)?,
                None => self.notes.warn(path, format!("moves \"{token}\", which the skeleton does not have")),
            }
        }
        Ok(())
    }

    /// Adds the curve of a mesh's blend shape weights from a SkelAnimation. Returns the weights at the start.
    pub(crate) fn add_weight_curve(
        &mut self,
        joint: u32,
        shapes: &[String],
        animation: &Prim,
    ) -> Result<Vec<f32>> {
        let tokens = animation.texts("blendShapes");
        let known: BTreeMap<&String, usize> = tokens.iter().zip(0..).collect();
        let places: Vec<Option<usize>> = shapes.iter().map(|shape| known.get(shape).copied()).collect();
        let Some(attribute) = animation.attributes.get("blendShapeWeights") else {
            return Ok(vec![0.0; shapes.len()]);
        };
        let row = |numbers: &[f64]| -> Vec<f32> {
            let weight = |place: &Option<usize>| place.and_then(|place| numbers.get(place)).copied();
            places.iter().map(|place| weight(place).unwrap_or(0.0) as f32).collect()
        };
        let codes: Vec<f64> = attribute.samples.iter().map(|(time, _)| *time).collect();
        if let Some((codes, times)) = self.key_times(&codes) {
            self.budget.charge(codes.len() as u64 * shapes.len() as u64, 4)?;
            let values =
                codes.iter().flat_map(|code| row(&transforms::numbers_at(attribute, *code))).collect();
            self.add_curve(joint, Path::Weights(shapes.len() as u32), &times, values);
        }
        Ok(row(&transforms::numbers_at(attribute, self.start_time_code)))
    }

    /// The clip of all curves; `None` where nothing is animated.
    pub(crate) fn finish(self, name: &str, joints: usize) -> Result<Option<Clip>> {
        if self.curves.is_empty() && self.properties.is_empty() {
            return Ok(None);
        }
        let clip = Clip::new(name.to_string(), joints, self.curves);
        let clip = clip.and_then(|clip| clip.with_properties(self.properties));
        clip.map(Some).map_err(|e| Problem::new("timeSamples", e.to_string()))
    }
}
