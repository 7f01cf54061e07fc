//! The compression of a buffer view (EXT_meshopt_compression, KHR_meshopt_compression).

use crate::meshopt::{Filter, Mode, Packed};
use crate::problem::Result;
use crate::repair::as_integer;
use serde_json::{Map, Value};

const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// The compression extension of a buffer view and its content; `None` where the view is not compressed.
pub(crate) fn of(extensions: &Map<String, Value>) -> Option<(&'static str, &Value)> {
    NAMES.iter().find_map(|name| Some((*name, extensions.get(*name)?)))
}

/// Byte range of the compressed data, and its compression parameters.
#[derive(Debug, PartialEq)]
pub(crate) struct PackedView {
    pub buffer: usize,
    pub offset: u64,
    pub length: u64,
    pub packed: Packed,
}

pub(crate) fn read(extension: &Value) -> Result<PackedView> {
    let number = |key: &str, default: Option<u64>| match extension.get(key) {
        None => default.ok_or_else(|| format!("has no {key}")),
        Some(value) => as_integer(value)
            .ok_or_else(|| format!("has a {key} of {value}; whole numbers from 0 are allowed")),
    };
    let size = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
    let text = |key: &str| extension.get(key).map(|value| value.as_str().unwrap_or_default());
    let mode = match text("mode") {
        Some("ATTRIBUTES") => Mode::Attributes,
        Some("TRIANGLES") => Mode::Triangles,
        Some("INDICES") => Mode::Indices,
        other => {
            let other = other.unwrap_or("none");
            return Err(format!("has mode {other:?}; ATTRIBUTES, TRIANGLES and INDICES are known").into());
        }
    };
    let filter = match text("filter") {
        None | Some("NONE") => Filter::None,
        Some("OCTAHEDRAL") => Filter::Octahedral,
        Some("QUATERNION") => Filter::Quaternion,
        Some("EXPONENTIAL") => Filter::Exponential,
        Some("COLOR") => Filter::Color,
        Some(other) => {
            return Err(format!(
                "has filter {other:?}; NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL and COLOR are known"
            )
            .into());
        }
    };
    let packed = Packed {
        mode,
        filter,
        count: size(number("count", None)?),
        stride: size(number("byteStride", None)?),
    };
    packed.check()?;
    Ok(PackedView {
        buffer: size(number("buffer", None)?),
        offset: number("byteOffset", Some(0))?,
        length: number("byteLength", None)?,
        packed,
    })
}
