//! Converts arrays of a script to flat lists of numbers, from flat arrays, arrays of rows or blobs.

use crate::call::{ApiError, Options, color, describe, int_or_float, wrong};
use rhai::{Array, Blob, Dynamic};

/// The option `name` as a flat list of vectors of `width` numbers, from `[[x, y, z], …]`, `[x, y, z, x, …]` or a blob of
/// little-endian f32. Empty without the option.
pub(super) fn floats(o: &Options, name: &str, width: usize) -> Result<Vec<f32>, ApiError> {
    let Some(value) = o.map.get(name) else { return Ok(Vec::new()) };
    let error = |text: String| ApiError::new(format!("{}: {text}", o.function)).focus(name);
    if let Some(blob) = value.read_lock::<Blob>() {
        let (numbers, rest) = blob.as_chunks::<4>();
        if !rest.is_empty() || numbers.len() % width != 0 {
            return Err(error(format!(
                "{name} as a blob must be {width} little-endian 32-bit floats, {} bytes, for each vertex; it has {} bytes",
                4 * width,
                blob.len()
            )));
        }
        return Ok(numbers.iter().map(|n| f32::from_le_bytes(*n)).collect());
    }
    let Some(array) = value.read_lock::<Array>() else {
        return Err(
            wrong(value, &o.label(name), "an array of numbers, of arrays of numbers, or a blob").focus(name)
        );
    };
    let has_rows = array.first().is_some_and(Dynamic::is_array);
    let mut flat = Vec::with_capacity(if has_rows { width * array.len() } else { array.len() });
    for (at, v) in array.iter().enumerate() {
        if !has_rows {
            let n = int_or_float(v)
                .ok_or_else(|| error(format!("{name}[{at}] must be a number, got {}", describe(v))))?;
            flat.push(n as f32);
            continue;
        }
        let row = v.read_lock::<Array>().filter(|row| row.len() == width);
        let numbers = row.and_then(|row| row.iter().map(int_or_float).collect::<Option<Vec<f64>>>());
        let numbers = numbers
            .ok_or_else(|| error(format!("{name}[{at}] must be {width} numbers, got {}", describe(v))))?;
        flat.extend(numbers.iter().map(|n| *n as f32));
    }
    Ok(flat)
}

/// The option `name` as vertex indices, from `[0, 1, 2, …]`, `[[0, 1, 2], …]` or a blob of little-endian u32. Empty without the
/// option.
pub(super) fn indices(o: &Options, name: &str) -> Result<Vec<u32>, ApiError> {
    let Some(value) = o.map.get(name) else { return Ok(Vec::new()) };
    let error = |text: String| ApiError::new(format!("{}: {text}", o.function)).focus(name);
    if let Some(blob) = value.read_lock::<Blob>() {
        let (numbers, rest) = blob.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(error(format!(
                "{name} as a blob must be little-endian 32-bit whole numbers; it has {} bytes",
                blob.len()
            )));
        }
        return Ok(numbers.iter().map(|n| u32::from_le_bytes(*n)).collect());
    }
    let Some(array) = value.read_lock::<Array>() else {
        return Err(wrong(value, &o.label(name), "an array of whole numbers, of arrays of them, or a blob")
            .focus(name));
    };
    let mut flat = Vec::with_capacity(array.len());
    let mut push = |at: usize, v: &Dynamic| {
        let n = v.as_int().ok().and_then(|n| u32::try_from(n).ok());
        let n = n.ok_or_else(|| {
            error(format!("{name}[{at}] must be a whole number from 0, got {}", describe(v)))
        })?;
        flat.push(n);
        Ok::<(), ApiError>(())
    };
    for (at, v) in array.iter().enumerate() {
        match v.read_lock::<Array>() {
            Some(row) => row.iter().try_for_each(|v| push(at, v))?,
            None => push(at, v)?,
        }
    }
    Ok(flat)
}

/// The option `name` as linear RGBA, 4 numbers per vertex, from color names, `[r, g, b]` in sRGB as everywhere in scripts, a flat
/// array of these numbers, or a blob of 4 bytes per vertex. Empty without the option.
pub(super) fn colors(o: &Options, name: &str, vertices: usize) -> Result<Vec<f32>, ApiError> {
    let Some(value) = o.map.get(name) else { return Ok(Vec::new()) };
    let error = |text: String| ApiError::new(format!("{}: {text}", o.function)).focus(name);
    if let Some(blob) = value.read_lock::<Blob>() {
        let (pixels, rest) = blob.as_chunks::<4>();
        if !rest.is_empty() || pixels.len() != vertices {
            return Err(error(format!(
                "{name} as a blob must be 4 bytes, red green blue alpha, for each of the {vertices} vertices; it has {} bytes",
                blob.len()
            )));
        }
        let linear = |byte: u8| crate::color::linear_from_srgb(f64::from(byte) / 255.0);
        let linear_rgba =
            |[r, g, b, a]: &[u8; 4]| [linear(*r), linear(*g), linear(*b), f32::from(*a) / 255.0];
        return Ok(pixels.iter().flat_map(linear_rgba).collect());
    }
    let Some(array) = value.read_lock::<Array>() else {
        return Err(wrong(value, &o.label(name), "an array of colors, or a blob").focus(name));
    };
    if array.first().is_some_and(|v| int_or_float(v).is_some()) {
        let flat = floats(o, name, 3)?;
        if flat.len() != 3 * vertices && flat.len() != 4 * vertices {
            return Err(error(format!(
                "{name} must have 3 or 4 numbers for each of the {vertices} vertices, has {}",
                flat.len()
            )));
        }
        let width = flat.len() / vertices.max(1);
        if let Some(at) = flat.iter().position(|v| !(0.0..=1.0).contains(v)) {
            return Err(error(format!("{name}[{at}] is {}, must be from 0 to 1", flat[at])));
        }
        let value = |(at, v): (usize, &f32)| match at % width {
            3 => *v,
            _ => crate::color::linear_from_srgb(f64::from(*v)),
        };
        return Ok(flat.iter().enumerate().map(value).collect());
    }
    if array.len() != vertices {
        let count = array.len();
        return Err(error(format!(
            "{name} must be one color for each of the {vertices} vertices, got {count}"
        )));
    }
    let mut flat = Vec::with_capacity(4 * vertices);
    for (at, v) in array.iter().enumerate() {
        flat.extend(color(v, &format!("{}: {name}[{at}]", o.function))?.to_array());
    }
    Ok(flat)
}
