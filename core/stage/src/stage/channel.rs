//! Keyed properties at a time: glTF's three interpolations (2.0, Appendix C) in f64 on integer times.

use choreo_motion::{Interpolation, Time, slerp};
use glam::{DQuat, DVec3};

/// Keyed property of an actor, camera, light, cue or effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The property that is keyed.
    pub property: Property,
    /// Interpolation between the keys.
    pub interpolation: Interpolation,
    /// Stage times of the keys, strictly increasing.
    pub times: Vec<Time>,
    /// `property.width()` numbers per key (three times that for CubicSpline, glTF order).
    pub values: Vec<f64>,
}

/// Property that keyframes can animate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Property {
    /// Position, metres.
    Translation,
    /// Quaternion x y z w.
    Rotation,
    /// Factor along each axis.
    Scale,
    /// 0 or 1.
    Visible,
    /// Factor of base colors, linear RGBA.
    Tint,
    /// Width of an actor's lines and points.
    LineWidth,
    /// Number of copies of an actor's meshes, rounded down.
    Copies,
    /// Weight of a morph target.
    Morph {
        /// Index into `Asset::instances`.
        instance: u32,
        /// Target of that mesh.
        target: u32,
    },
    /// Weight of an expression.
    Expression {
        /// Index into `Asset::expressions`.
        expression: u32,
    },
    /// Camera: vertical field of view, radians.
    FieldOfView,
    /// Camera: focal length on full-frame film, millimetres.
    FocalLength,
    /// Light: lux or candela. Sky: factor of the panorama's radiance.
    Intensity,
    /// Light: linear RGB.
    Color,
    /// Weight of a cue.
    Weight,
    /// Speed of a cue: clip seconds per second.
    Speed,
    /// Time of a cue's clip in seconds.
    ClipTime,
    /// One number of an effect.
    Parameter,
    /// Sky: radians about +Y.
    Turn,
    /// Opacity of a 2D layer, 0..=1.
    Opacity,
    /// Light: how far it reaches, metres.
    Range,
    /// Light: half angle of the cone, radians.
    Cone,
}

impl Property {
    /// Whether the property sets the field of view of a camera.
    pub fn is_lens(self) -> bool {
        matches!(self, Property::FieldOfView | Property::FocalLength)
    }

    /// Number of components of a value.
    pub fn width(self) -> usize {
        match self {
            Property::Translation | Property::Scale | Property::Color => 3,
            Property::Rotation | Property::Tint => 4,
            _ => 1,
        }
    }
}

impl Channel {
    /// The value at a time, in the first `property.width()` numbers; end values hold outside the keys. `None` if the lengths of the lists
    /// do not match.
    pub fn at(&self, time: Time) -> Option<[f64; 4]> {
        let width = self.property.width();
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let stride = if cubic { 3 * width } else { width };
        if self.times.is_empty() || self.values.len() != self.times.len() * stride {
            return None;
        }
        let key_part = |key: usize, part: usize| -> [f64; 4] {
            let at = key * stride + part * width;
            std::array::from_fn(|i| if i < width { self.values[at + i] } else { 0.0 })
        };
        let value = |key: usize| key_part(key, usize::from(cubic));
        let next = self.times.partition_point(|t| *t <= time);
        if next == 0 {
            return Some(self.normalize_rotation(value(0)));
        }
        if next == self.times.len() || self.interpolation == Interpolation::Step {
            return Some(self.normalize_rotation(value(next - 1)));
        }
        let (t0, t1) = (self.times[next - 1], self.times[next]);
        let s = (time - t0).0 as f64 / (t1 - t0).0 as f64;
        let (a, b) = (value(next - 1), value(next));
        let mixed = match (cubic, self.property) {
            (true, _) => {
                // Appendix C.4; tangents are per second.
                let span = (t1 - t0).as_secs();
                let (out_tangent, in_tangent) = (key_part(next - 1, 2), key_part(next, 0));
                let (s2, s3) = (s * s, s * s * s);
                std::array::from_fn(|i| {
                    (2.0 * s3 - 3.0 * s2 + 1.0) * a[i]
                        + span * (s3 - 2.0 * s2 + s) * out_tangent[i]
                        + (3.0 * s2 - 2.0 * s3) * b[i]
                        + span * (s3 - s2) * in_tangent[i]
                })
            }
            (false, Property::Rotation) => {
                slerp(DQuat::from_array(a).normalize(), DQuat::from_array(b).normalize(), s).to_array()
            }
            (false, _) => std::array::from_fn(|i| a[i] + (b[i] - a[i]) * s),
        };
        Some(self.normalize_rotation(mixed))
    }

    fn normalize_rotation(&self, v: [f64; 4]) -> [f64; 4] {
        if self.property == Property::Rotation {
            let q = DQuat::from_array(v);
            // A spline through the origin has no direction there.
            if q.length_squared() > 0.0 { q.normalize().to_array() } else { DQuat::IDENTITY.to_array() }
        } else {
            v
        }
    }
}

/// Value, at a time, of the last of these channels that animates a property.
pub(crate) fn keyed_value(channels: &[Channel], property: Property, time: Time) -> Option<[f64; 4]> {
    channels.iter().rev().filter(|c| c.property == property).find_map(|c| c.at(time))
}

/// The first three of four numbers.
pub(crate) fn vec3(v: [f64; 4]) -> DVec3 {
    DVec3::new(v[0], v[1], v[2])
}
