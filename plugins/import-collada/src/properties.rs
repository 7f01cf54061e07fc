//! Channels of cameras and lights: field of view or height of the view, colors, cones of spots.
//!
//! All are sampled at their keys, and between keys where linear interpolation would exceed the tolerance: a vertical angle is not
//! linear in a horizontal one, and the intensity depends on a color brighter than 1.

use crate::bake::{MAX_DEPTH, MAX_KEYS, TOLERANCE, held_keys, key_times};
use crate::objects::{Numbers, Object};
use crate::sampler::Sampler;
use crate::xml::{Node, NodeId, Xml, name_of};
use choreo_asset::{AssetCamera, AssetLight};
use choreo_importer_kit::Result;
use choreo_importer_kit::rows::{SamplingLimits, sample_rows};
use choreo_motion::{Interpolation, PropertyCurve, PropertyTarget, Time};
use std::rc::Rc;
use std::sync::Arc;

/// The cameras and lights of the asset, with their elements.
pub(crate) struct Objects<'a> {
    pub cameras: Vec<Object<'a, AssetCamera>>,
    pub lights: Vec<Object<'a, AssetLight>>,
    pub metres: f64,
}

/// A number of a camera or light that a channel drives.
pub(crate) struct Driven {
    /// The `<camera>` or `<light>`.
    pub object: NodeId,
    name: String,
    component: usize,
    sampler: Rc<Sampler>,
}

/// The names (see [`Numbers`]) of the numbers that a channel drives; `None` where it drives nothing that is read.
pub(crate) fn names(element: Node<'_>, member: &str) -> Option<Vec<String>> {
    let colors = ["r", "g", "b"].map(String::from);
    match (name_of(element), member) {
        ("color", "") => Some(colors.to_vec()),
        ("color", ".R" | "(0)") => Some(vec!["r".into()]),
        ("color", ".G" | "(1)") => Some(vec!["g".into()]),
        ("color", ".B" | "(2)") => Some(vec!["b".into()]),
        // Animated clip planes are not supported.
        ("znear" | "zfar", _) => None,
        (name, "") => Numbers::default().set(name, 0.0).then(|| vec![name.into()]),
        _ => None,
    }
}

impl Driven {
    /// One driven number for each name, from consecutive values of the sampler.
    pub(crate) fn all(
        object: NodeId,
        names: Vec<String>,
        sampler: &Rc<Sampler>,
    ) -> impl Iterator<Item = Driven> {
        let driven = move |(component, name)| Driven { object, name, component, sampler: sampler.clone() };
        names.into_iter().enumerate().map(driven)
    }

    pub(crate) fn sampler(&self) -> &Rc<Sampler> {
        &self.sampler
    }
}

/// Computes the asset's values of a camera or light, in the order of its targets.
type ValuesOf<'f> = &'f dyn Fn(&Numbers) -> Vec<f32>;

/// An animated camera or light.
struct AnimatedObject<'d> {
    rest: Numbers,
    driven: Vec<&'d Driven>,
    value: ValuesOf<'d>,
}

impl AnimatedObject<'_> {
    fn at(&self, time: Time) -> Vec<f32> {
        let mut numbers = self.rest.clone();
        for driven in &self.driven {
            numbers.set(&driven.name, driven.sampler.value(time, driven.component));
        }
        (self.value)(&numbers)
    }
}

/// The property curves of all cameras and lights.
pub(crate) fn curves(
    xml: &Xml<'_>,
    objects: &Objects<'_>,
    driven: &[Driven],
    range: (Time, Time),
) -> Result<Vec<PropertyCurve>> {
    let of = |element: Node<'_>| -> Vec<&Driven> {
        driven.iter().filter(|driven| driven.object == element.id()).collect()
    };
    let mut out = Vec::new();
    for (index, camera) in (0u32..).zip(&objects.cameras) {
        let driven = of(camera.element);
        let kind = name_of(camera.numbers_of);
        let metres = objects.metres;
        let angle = |n: &Numbers| vec![n.angle().unwrap_or(0.7).clamp(1e-3, 3.1) as f32];
        let height = move |n: &Numbers| vec![(n.height() * metres).max(1e-6) as f32];
        let (target, value): (_, ValuesOf<'_>) = match kind {
            "orthographic" => (PropertyTarget::CameraHeight(index), &height),
            _ => (PropertyTarget::CameraYfov(index), &angle),
        };
        let moving = AnimatedObject { rest: Numbers::read(xml, camera.numbers_of)?, driven, value };
        add(xml, &moving, &[target], range, &mut out)?;
    }
    for (index, light) in (0u32..).zip(&objects.lights) {
        let (driven, kind) = (of(light.element), name_of(light.numbers_of));
        let value = |n: &Numbers| {
            let Some(light) = n.light(kind, objects.metres) else { return vec![0.0; 4] };
            let cone = light.kind.cone().into_iter().flatten();
            light.color.to_array().into_iter().chain([light.intensity]).chain(cone).collect()
        };
        let moving = AnimatedObject { rest: Numbers::read(xml, light.numbers_of)?, driven, value: &value };
        let all = [
            PropertyTarget::LightColor(index),
            PropertyTarget::LightIntensity(index),
            PropertyTarget::SpotInner(index),
            PropertyTarget::SpotOuter(index),
        ];
        let count = if light.object.light.kind.cone().is_some() { 4 } else { 2 };
        add(xml, &moving, &all[..count], range, &mut out)?;
    }
    Ok(out)
}

/// Adds the curves of one object, except those that stay at their rest value.
fn add(
    xml: &Xml<'_>,
    moving: &AnimatedObject<'_>,
    targets: &[PropertyTarget],
    range: (Time, Time),
    out: &mut Vec<PropertyCurve>,
) -> Result<()> {
    if moving.driven.is_empty() {
        return Ok(());
    }
    let samplers = || moving.driven.iter().map(|driven| &*driven.sampler);
    let key_times = held_keys(&key_times(samplers(), range.0, range.1), samplers);
    let limits = SamplingLimits { tolerance: TOLERANCE as f32, depth: MAX_DEPTH, rows: MAX_KEYS };
    let Some(keys) = sample_rows(&key_times, limits, |time| moving.at(time)) else {
        return Err(format!("its animation comes to more than {MAX_KEYS} keys, which is the limit").into());
    };
    xml.budget.charge(keys.len() as u64, 64)?;
    let rest = (moving.value)(&moving.rest);
    let times: Arc<[Time]> = keys.iter().map(|(time, _)| *time - range.0).collect();
    let step = moving.driven.iter().all(|driven| driven.sampler.steps().1);
    let mut from = 0;
    for target in targets {
        let part = from..from + target.width();
        from = part.end;
        if keys.iter().all(|(_, row)| row[part.clone()] == rest[part.clone()]) {
            continue;
        }
        out.push(PropertyCurve {
            target: *target,
            interpolation: if step { Interpolation::Step } else { Interpolation::Linear },
            times: times.clone(),
            values: keys.iter().flat_map(|(_, row)| &row[part.clone()]).copied().collect(),
        });
    }
    Ok(())
}
