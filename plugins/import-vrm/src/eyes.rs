//! How the eyes follow a target: VRM 1.0 `lookAt` ("lookAt.md"), `firstPerson` of VRM 0.x.

use crate::json::At;
use choreo_asset::{Eyes, EyesMovedBy, RangeMap};
use choreo_importer_kit::Result;
use glam::Vec3;

pub fn read(vrm: &At<'_>) -> Result<Option<Eyes>> {
    let Some(look) = vrm.get("lookAt") else { return Ok(None) };
    let moved_by = match look.text("type") {
        Some("expression") => EyesMovedBy::Expressions,
        _ => EyesMovedBy::Bones,
    };
    let map = |key: &str| -> Result<RangeMap> {
        let map = look.get(key);
        let number = |name: &str, default: f32| match &map {
            Some(map) => Ok(map.number(name)?.unwrap_or(default)),
            None => Ok(default),
        };
        let default = if moved_by == EyesMovedBy::Bones { 10.0 } else { 1.0 };
        Ok(range(number("inputMaxValue", 90.0)?, number("outputScale", default)?, moved_by))
    };
    Ok(Some(Eyes {
        offset_from_head: look.vec3("offsetFromHeadBone")?.unwrap_or(Vec3::ZERO),
        moved_by,
        inner: map("rangeMapHorizontalInner")?,
        outer: map("rangeMapHorizontalOuter")?,
        down: map("rangeMapVerticalDown")?,
        up: map("rangeMapVerticalUp")?,
    }))
}

/// Curves other than straight lines are taken as straight lines: 1.0 has no others either.
pub fn read_v0(vrm: &At<'_>) -> Result<Option<Eyes>> {
    let Some(person) = vrm.get("firstPerson").filter(|p| p.text("lookAtTypeName").is_some()) else {
        return Ok(None);
    };
    let moved_by = match person.text("lookAtTypeName") {
        Some("BlendShape") => EyesMovedBy::Expressions,
        _ => EyesMovedBy::Bones,
    };
    let map = |key: &str| -> Result<RangeMap> {
        let map = person.get(key);
        let number = |name: &str, default: f32| match &map {
            Some(map) => Ok(map.number(name)?.unwrap_or(default)),
            None => Ok(default),
        };
        Ok(range(number("xRange", 90.0)?, number("yRange", 10.0)?, moved_by))
    };
    let offset = person.vec3("firstPersonBoneOffset")?.unwrap_or(Vec3::ZERO);
    Ok(Some(Eyes {
        offset_from_head: crate::facing::from_unity(offset),
        moved_by,
        inner: map("lookAtHorizontalInner")?,
        outer: map("lookAtHorizontalOuter")?,
        down: map("lookAtVerticalDown")?,
        up: map("lookAtVerticalUp")?,
    }))
}

/// A range from degrees.
fn range(input_max: f32, output_scale: f32, moved_by: EyesMovedBy) -> RangeMap {
    let output_scale = match moved_by {
        EyesMovedBy::Bones => output_scale.to_radians(),
        EyesMovedBy::Expressions => output_scale,
    };
    RangeMap { input_max: input_max.to_radians(), output_scale }
}
