//! Animated properties of the cameras, lights and materials of a clip's asset (KHR_animation_pointer). A clip that is bound to
//! another skeleton has none, since they refer to elements of one file.

use crate::clip::key_search::find_interval;
use crate::clip::{ClipError, Curve, CurveError, Interpolation, Path, check_curve};
use crate::time::Time;
use std::sync::Arc;

/// The property of an element; the number is an index into the asset's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PropertyTarget {
    /// Full vertical angle of a perspective camera, radians.
    CameraYfov(u32),
    /// Full height of an orthographic camera's view, metres.
    CameraHeight(u32),
    /// Color of a light, linear RGB.
    LightColor(u32),
    /// Intensity in the file's unit (lux, candela).
    LightIntensity(u32),
    /// Range of a light, metres.
    LightRange(u32),
    /// Inner half angle of a spot's cone, radians.
    SpotInner(u32),
    /// Outer half angle of a spot's cone, radians.
    SpotOuter(u32),
    /// Linear RGBA factor of a material.
    BaseColor(u32),
    /// Another property of a material.
    Material(u32, MaterialProperty),
}

/// Properties of a material other than its base color. Texture slots, from 0: base color, metallic-roughness, normal, occlusion,
/// emissive, specular, specular color.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum MaterialProperty {
    /// Emitted light, linear RGB, the file's emissive strength multiplied in.
    Emissive,
    /// Factor of the file's own emissive strength.
    EmissiveStrength,
    /// 0 for dielectrics, 1 for metals.
    Metallic,
    /// 0 for a mirror, 1 for matte.
    Roughness,
    /// Alpha below which nothing is drawn.
    AlphaCutoff,
    /// Factor of the normal map's x and y.
    NormalScale,
    /// How much the occlusion texture darkens.
    OcclusionStrength,
    /// Offset of the texture coordinates of a texture.
    UvOffset(u8),
    /// Rotation of the texture coordinates of a texture, radians.
    UvRotation(u8),
    /// Scale of the texture coordinates of a texture.
    UvScale(u8),
}

impl MaterialProperty {
    fn width(self) -> usize {
        match self {
            MaterialProperty::Emissive => 3,
            MaterialProperty::UvOffset(_) | MaterialProperty::UvScale(_) => 2,
            _ => 1,
        }
    }
}

impl PropertyTarget {
    /// Number of floats per key.
    pub fn width(self) -> usize {
        match self {
            PropertyTarget::CameraYfov(_)
            | PropertyTarget::CameraHeight(_)
            | PropertyTarget::LightIntensity(_)
            | PropertyTarget::LightRange(_)
            | PropertyTarget::SpotInner(_)
            | PropertyTarget::SpotOuter(_) => 1,
            PropertyTarget::LightColor(_) => 3,
            PropertyTarget::BaseColor(_) => 4,
            PropertyTarget::Material(_, property) => property.width(),
        }
    }
}

/// Keys of one property. `values.len() == times.len() * target.width() * (3 if CubicSpline else 1)`.
#[derive(Clone, Debug, PartialEq)]
pub struct PropertyCurve {
    /// The property that the curve animates.
    pub target: PropertyTarget,
    /// How values between keys are found.
    pub interpolation: Interpolation,
    /// Strictly increasing, at least one.
    pub times: Arc<[Time]>,
    /// Numbers of the target, key after key.
    pub values: Arc<[f32]>,
}

/// A checked curve: its numbers are stored as a curve of weights, which are interpolated alike.
#[derive(Clone, Debug)]
pub(crate) struct CheckedPropertyCurve {
    target: PropertyTarget,
    curve: Curve,
}

pub(crate) fn check_property_curves(
    curves: Vec<PropertyCurve>,
) -> Result<Vec<CheckedPropertyCurve>, ClipError> {
    let mut out: Vec<CheckedPropertyCurve> = Vec::with_capacity(curves.len());
    for (index, curve) in curves.into_iter().enumerate() {
        let PropertyCurve { target, interpolation, times, values } = curve;
        let path = Path::Weights(target.width() as u32);
        let mut curve = Curve { joint: 0, path, interpolation, times, values };
        let earlier = out.iter().position(|c| c.target == target);
        let checked = check_curve(&mut curve, 1).and(match earlier {
            Some(first) => Err(CurveError::Duplicate(first)),
            None => Ok(()),
        });
        checked.map_err(|what| ClipError::Property { curve: index, target, what })?;
        out.push(CheckedPropertyCurve { target, curve });
    }
    Ok(out)
}

impl CheckedPropertyCurve {
    pub(crate) fn target(&self) -> PropertyTarget {
        self.target
    }

    pub(crate) fn curve(&self) -> &Curve {
        &self.curve
    }

    pub(crate) fn sample(&self, time: Time, out: &mut [f32]) {
        crate::clip::sample::interpolate_curve(&self.curve, find_interval(&self.curve.times, time), out);
    }
}
