//! How eyes follow a target: VRM 1.0 `lookAt` ("lookAt.md"), VRM 0.x `firstPerson`.

use crate::json::At;
use choreo_asset::{Eyes, EyesMovedBy, RangeMap};
use choreo_importer_kit::Result;
use glam::Vec3;

pub(crate) fn read(vrm: &At<'_>) -> Result<Option<Eyes>> {
    let Some(look) = vrm.get("lookAt") else { return Ok(None) };
    let maps =
        ["rangeMapHorizontalInner", "rangeMapHorizontalOuter", "rangeMapVerticalDown", "rangeMapVerticalUp"];
    let by_expressions = look.text("type") == Some("expression");
    let output = ("outputScale", if by_expressions { 1.0 } else { 10.0 });
    let offset = look.vec3_or("offsetFromHeadBone", Vec3::ZERO)?;
    eyes(&look, offset, by_expressions, maps.map(|map| (map, "inputMaxValue", output))).map(Some)
}

/// Reads VRM 0.x. Response curves are read as linear, the only kind in 1.0.
pub(crate) fn read_v0(vrm: &At<'_>) -> Result<Option<Eyes>> {
    let Some(person) = vrm.get("firstPerson").filter(|p| p.text("lookAtTypeName").is_some()) else {
        return Ok(None);
    };
    let maps = ["lookAtHorizontalInner", "lookAtHorizontalOuter", "lookAtVerticalDown", "lookAtVerticalUp"];
    let by_expressions = person.text("lookAtTypeName") == Some("BlendShape");
    let offset = crate::facing::from_unity(person.vec3_or("firstPersonBoneOffset", Vec3::ZERO)?);
    eyes(&person, offset, by_expressions, maps.map(|map| (map, "xRange", ("yRange", 10.0)))).map(Some)
}

/// Member names of a range map: the map, its input, and its output with the default.
type RangeNames = (&'static str, &'static str, (&'static str, f32));

/// Reads the eyes. `maps`: inner, outer, down, up.
fn eyes(at: &At<'_>, offset: Vec3, by_expressions: bool, maps: [RangeNames; 4]) -> Result<Eyes> {
    let map = |(map, input, (output, default)): RangeNames| -> Result<RangeMap> {
        let map = at.part(map);
        let scale = map.number_or(output, default)?;
        Ok(RangeMap {
            input_max: map.number_or(input, 90.0)?.to_radians(),
            output_scale: if by_expressions { scale } else { scale.to_radians() },
        })
    };
    let [inner, outer, down, up] = maps;
    Ok(Eyes {
        offset_from_head: offset,
        moved_by: if by_expressions { EyesMovedBy::Expressions } else { EyesMovedBy::Bones },
        inner: map(inner)?,
        outer: map(outer)?,
        down: map(down)?,
        up: map(up)?,
    })
}
