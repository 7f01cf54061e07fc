//! Clips of cameras and lights: field of view, color, intensity, and the angles of a spot. Where a single layer drives a
//! property, its keys are the file's and exact, as for nodes. Blended layers and repeating curves are sampled.

use crate::clips::ClipBuilder;
use crate::curve;
use crate::driven::PropertySource;
use crate::emit::{self, KeyIntervals};
use crate::joined::JoinedCurves;
use crate::keys::{self, Blend, Keys};
use crate::objects::Object;
use crate::refine::Quantity;
use crate::sampled;
use crate::value_conversion::{self, ValueConversion};
use choreo_importer_kit::Result;
use choreo_motion::{Path, PropertyCurve, PropertyTarget};
use std::f64::consts::PI;
use ufbx::{AnimCurve, Element};

/// Parts of an interval between two keys, at most, where the value is no cubic.
const MAX_PARTS: u32 = 64;
/// Positions in a part at which its cubic is compared with the exact value.
const PROBES: [f64; 3] = [0.25, 0.5, 0.75];

/// One property of one camera or light.
struct Channel<'a> {
    element: &'a Element,
    name: &'static str,
    target: PropertyTarget,
    conversion: ValueConversion,
    /// Value at rest, in the asset's units.
    rest: [f64; 3],
}

/// All properties of a camera or light that a clip can change. Newer names come later and replace older ones.
fn channels<'a>(object: &Object<'a>) -> Vec<Channel<'a>> {
    let index = object.index;
    let Some(light) = object.light else {
        let Some(camera) = object.camera else { return Vec::new() };
        let (name, conversion, at) = value_conversion::of_camera(camera);
        let target = match name {
            "OrthoZoom" => PropertyTarget::CameraHeight(index),
            _ => PropertyTarget::CameraYfov(index),
        };
        let rest = [conversion.at(at).0, 0.0, 0.0];
        return vec![Channel { element: &camera.element, name, target, conversion, rest }];
    };
    let channel = |name, target, factor, rest: [f64; 3]| Channel {
        element: &light.element,
        name,
        target,
        conversion: ValueConversion::Proportional(factor),
        rest: rest.map(|v| v * factor),
    };
    let one = |v: f64| [v, 0.0, 0.0];
    let color = light.color;
    let mut out = vec![
        channel("Color", PropertyTarget::LightColor(index), 1.0, [color.x, color.y, color.z]),
        // The file has percent.
        channel(
            "Intensity",
            PropertyTarget::LightIntensity(index),
            object.intensity_unit / 100.0,
            one(light.intensity * 100.0),
        ),
    ];
    if light.type_ == ufbx::LightType::Spot {
        // The file has full angles in degrees.
        let half = PI / 360.0;
        for name in ["HotSpot", "InnerAngle"] {
            out.push(channel(name, PropertyTarget::SpotInner(index), half, one(light.inner_angle)));
        }
        for name in ["Cone angle", "ConeAngle", "OuterAngle"] {
            out.push(channel(name, PropertyTarget::SpotOuter(index), half, one(light.outer_angle)));
        }
    }
    out
}

/// Whether a property of a camera or light is read here, or is known to have no visible effect.
pub(crate) fn is_known(object: &Object<'_>, name: &str) -> bool {
    channels(object).iter().any(|c| c.name == name)
        || object.camera.is_some() && value_conversion::PROJECTION_PROPERTIES.contains(&name)
}

impl ClipBuilder<'_, '_> {
    /// Curves of all cameras and lights. Curves that only hold the value at rest are left out.
    pub(crate) fn property_curves(&mut self) -> Result<Vec<PropertyCurve>> {
        let mut out: Vec<PropertyCurve> = Vec::new();
        for object in self.objects {
            for channel in channels(object) {
                let Some(keys) = self.property_keys(&channel)? else { continue };
                let width = channel.target.width();
                let near =
                    |(v, rest): (&f32, &f64)| (f64::from(*v) - rest).abs() <= 1e-6 * (1.0 + rest.abs());
                if keys.times.len() == 1 && keys.values[..width].iter().zip(&channel.rest).all(near) {
                    continue;
                }
                out.retain(|c| c.target != channel.target);
                out.push(PropertyCurve {
                    target: channel.target,
                    interpolation: keys.interpolation,
                    times: self.times.share(keys.times),
                    values: keys.values.into(),
                });
            }
        }
        Ok(out)
    }

    fn property_keys(&mut self, channel: &Channel<'_>) -> Result<Option<Keys>> {
        let repeats = self.repeating_elements.contains(&channel.element.element_id);
        match self.driven.property_source(channel.element, channel.name) {
            PropertySource::Nothing => Ok(None),
            PropertySource::One(value) if !repeats && self.span.length().0 > 2 => {
                self.exact_keys(channel, value).map(Some)
            }
            PropertySource::One(value) => {
                self.sampled_keys(channel, value.curves.iter().flatten().map(|c| c.as_ref()).collect())
            }
            PropertySource::Mixed(curves) => self.sampled_keys(channel, curves),
        }
    }

    fn exact_keys(&mut self, channel: &Channel<'_>, value: &ufbx::AnimValue) -> Result<Keys> {
        let (width, conversion) = (channel.target.width(), channel.conversion);
        let defaults = [value.default_value.x, value.default_value.y, value.default_value.z];
        // The first curve, whatever its name: `d|Intensity` has no axis.
        let curves: Vec<Option<&AnimCurve>> = match width {
            1 => vec![value.curves.iter().flatten().map(|c| c.as_ref()).next()],
            _ => value.curves.iter().map(|c| c.as_deref()).collect(),
        };
        let limit = self.value_tolerance(channel, &curves);
        let mut pieces = Vec::with_capacity(width);
        for (curve, default) in curves.iter().zip(defaults) {
            let count = curve.map_or(1, |c| c.keyframes.len() + 1);
            self.file.charge(count, 4 * 64, || self.place())?;
            let at = |v: f64| conversion.at(v).1.abs();
            let steepest = match curve {
                Some(c) => at(c.min_value).max(at(c.max_value)),
                None => at(default),
            };
            let mut out = Vec::with_capacity(count);
            curve::pieces(*curve, default, self.span, limit / steepest.max(1e-12), &mut out);
            pieces.push(out);
        }
        let slices: Vec<&[curve::Piece]> = pieces.iter().map(Vec::as_slice).collect();
        let joined = JoinedCurves::new(&slices);
        let at = |interval: usize, u: f64| joined.numbers(interval, u, |v| conversion.at(v));
        if joined.is_constant() {
            let values = at(0, 0.0).0[..width].iter().map(|v| *v as f32).collect();
            return Ok(keys::simplify_keys(vec![choreo_motion::Time::ZERO], values, width, Blend::Numbers));
        }
        let parts: Vec<u32> = match self.file.accuracy.rate {
            Some(rate) => {
                let wanted = |i: &(choreo_motion::Time, choreo_motion::Time)| {
                    ((i.1 - i.0).as_secs() * rate).ceil().clamp(1.0, 4096.0) as u32
                };
                joined.intervals.iter().map(wanted).collect()
            }
            None if conversion.is_proportional() => vec![1; joined.intervals.len()],
            None => (0..joined.intervals.len()).map(|i| count_parts(|u| at(i, u), limit)).collect(),
        };
        self.file.charge(parts.iter().map(|n| *n as usize + 1).sum(), 96 + 24 * width, || self.place())?;
        let times = emit::key_times(&joined.intervals, &parts);
        let key_intervals = KeyIntervals { intervals: &joined.intervals, parts: &parts, times: &times };
        Ok(emit::spline_keys(key_intervals, Path::Weights(width as u32), limit, self.file.accuracy, at))
    }

    /// Samples a property of several layers, or with a curve that continues beyond its keys, through ufbx.
    fn sampled_keys(&mut self, channel: &Channel<'_>, curves: Vec<&AnimCurve>) -> Result<Option<Keys>> {
        let place = || self.place();
        let times = match self.repeating_elements.contains(&channel.element.element_id) {
            true => sampled::even_times(self.file, self.span, &place)?,
            false => sampled::sample_times(self.file, curves.iter().copied(), self.span, &place)?,
        };
        if times.is_empty() {
            return Ok(None);
        }
        let of: Vec<Option<&AnimCurve>> = curves.iter().map(|c| Some(*c)).collect();
        let (width, begin) = (channel.target.width(), self.span.begin.as_secs());
        // Values are scaled to be compared with the tolerance of weights.
        let unit = self.file.accuracy.weight / self.value_tolerance(channel, &of);
        let evaluate = |time: choreo_motion::Time, out: &mut Vec<f64>| {
            let at = begin + time.as_secs();
            let value = ufbx::evaluate_prop(&self.stack.anim, channel.element, channel.name, at).value_vec4;
            out.extend(
                [value.x, value.y, value.z][..width].iter().map(|v| channel.conversion.at(*v).0 * unit),
            );
        };
        let rows = sampled::sample_rows(self.file, &[Quantity::Weight; 3][..width], times, evaluate, &place)?;
        let values = rows.values.iter().map(|v| (v / unit) as f32).collect();
        Ok(Some(keys::simplify_keys(rows.times, values, width, Blend::Numbers)))
    }

    /// Tolerance of the value: that of joints for an angle, else a share of the largest value.
    fn value_tolerance(&self, channel: &Channel<'_>, curves: &[Option<&AnimCurve>]) -> f64 {
        let accuracy = self.file.accuracy;
        match channel.target {
            PropertyTarget::LightColor(_) => accuracy.weight,
            PropertyTarget::LightIntensity(_) | PropertyTarget::CameraHeight(_) => {
                let ends = curves.iter().flatten().flat_map(|c| [c.min_value, c.max_value]);
                let most =
                    ends.map(|v| channel.conversion.at(v).0.abs()).fold(channel.rest[0].abs(), f64::max);
                accuracy.weight * most.max(1e-9)
            }
            _ => accuracy.radians,
        }
    }
}

/// Number of parts of an interval whose cubics are close enough to the exact value.
fn count_parts(at: impl Fn(f64) -> ([f64; 4], [f64; 4]), limit: f64) -> u32 {
    let close = |n: u32| {
        let share = 1.0 / f64::from(n);
        (0..n).all(|k| {
            let from = f64::from(k) * share;
            let ((a, m), (b, n)) = (at(from), at(from + share));
            let (a, b, m, n) = (a[0], b[0], m[0] * share, n[0] * share);
            let (c, d) = (3.0 * (b - a) - 2.0 * m - n, 2.0 * (a - b) + m + n);
            let off = |u: f64| (a + u * (m + u * (c + u * d))) - at(from + share * u).0[0];
            PROBES.iter().all(|u| off(*u).abs() <= 0.5 * limit)
        })
    };
    let mut n = 1;
    while n < MAX_PARTS && !close(n) {
        n *= 2;
    }
    n
}
