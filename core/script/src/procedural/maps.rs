//! Images computed from other images: sprite sheets, alpha from brightness, normal maps with heights.

use crate::call::{ApiError, Options};
use crate::value::ImageRef;
use choreo_asset::Image;
use glam::Vec3;
use rhai::Array;
use std::sync::Arc;

/// The first image of an array.
///
/// # Errors
/// Returns an error if the array is empty, contains an image sequence, or has images of different sizes.
pub(crate) fn first_of_equal_size<'a>(
    o: &Options,
    name: &str,
    images: &'a [ImageRef],
) -> Result<&'a ImageRef, ApiError> {
    if images.iter().any(|i| i.sequence.is_some()) {
        let text =
            format!("{}: numbered files are a sequence already; give them without an array", o.function);
        return Err(ApiError::new(text).focus(name));
    }
    let Some(first) = images.first() else {
        return Err(ApiError::new(format!("{}: {name} is an empty array", o.function)).focus(name));
    };
    let (width, height) = (first.image.width, first.image.height);
    if let Some(i) = images.iter().position(|i| (i.image.width, i.image.height) != (width, height)) {
        let other = &images[i].image;
        let text = format!(
            "{}: all images of a sequence must have one size; the first is {width} × {height}, number {} is {} × {}",
            o.function,
            i + 1,
            other.width,
            other.height
        );
        return Err(ApiError::new(text).focus(name));
    }
    Ok(first)
}

/// A sprite sheet of images of one size, row by row from the top left, and its numbers of columns and rows.
pub(super) fn sprite_sheet(o: &Options, images: &[ImageRef]) -> Result<(ImageRef, [u32; 2]), ApiError> {
    let first = first_of_equal_size(o, "image", images)?;
    let (width, height) = (first.image.width, first.image.height);
    let count = images.len() as u32;
    let columns = (1..=count).find(|c| c * c >= count).unwrap_or(1);
    let rows = count.div_ceil(columns);
    let mut rgba = vec![0; (columns * width) as usize * (rows * height) as usize * 4];
    let row_bytes = width as usize * 4;
    for (i, given) in images.iter().enumerate() {
        let (column, row) = (i % columns as usize, i / columns as usize);
        let image = given.decoded()?;
        for y in 0..height as usize {
            let from = &image.rgba[y * row_bytes..][..row_bytes];
            let at = ((row * height as usize + y) * columns as usize + column) * row_bytes;
            rgba[at..at + row_bytes].copy_from_slice(from);
        }
    }
    let image = Image {
        name: first.image.name.clone(),
        width: columns * width,
        height: rows * height,
        rgba,
        file: None,
    };
    Ok((ImageRef { image: Arc::new(image), file: None, ..first.clone() }, [columns, rows]))
}

/// The images of an option, which is an image or an array of images. Empty without the option.
pub(super) fn images(o: &Options, name: &str) -> Result<Vec<ImageRef>, ApiError> {
    let Some(value) = o.get(name) else { return Ok(Vec::new()) };
    let all: Array = match value.read_lock::<Array>() {
        Some(array) => array.clone(),
        None => vec![value.clone()],
    };
    let read = |v: &rhai::Dynamic| {
        v.clone().try_cast::<ImageRef>().ok_or_else(|| {
            crate::call::wrong(v, &o.label(name), "an Image, from image(…), or an array of them")
        })
    };
    all.iter().map(read).collect()
}

/// An opaque white image of the size of an opacity map, to combine with the map.
pub(super) fn white_image(map: &ImageRef) -> ImageRef {
    let Image { width, height, .. } = *map.image;
    let rgba = vec![255; width as usize * height as usize * 4];
    let image = Image { name: "opacity".into(), width, height, rgba, file: None };
    ImageRef { image: Arc::new(image), file: None, sequence: None, ..map.clone() }
}

/// An image with alpha multiplied by the brightness of another.
pub(crate) fn with_opacity(base: &Image, map: &Image) -> Image {
    let mut rgba = base.rgba.clone();
    for (out, m) in rgba.as_chunks_mut::<4>().0.iter_mut().zip(map.rgba.as_chunks::<4>().0) {
        out[3] = (u16::from(out[3]) * u16::from(brightness(m)) / 255) as u8;
    }
    Image { rgba, name: base.name.clone(), file: None, ..*base }
}

/// A normal map with the brightness of a height map as alpha.
pub(crate) fn with_heights(normals: &Image, heights: &Image) -> Image {
    let mut rgba = normals.rgba.clone();
    for (out, h) in rgba.as_chunks_mut::<4>().0.iter_mut().zip(heights.rgba.as_chunks::<4>().0) {
        out[3] = brightness(h);
    }
    Image { rgba, name: normals.name.clone(), file: None, ..*normals }
}

/// Normal map of a height map, by central differences; the image repeats. `depth`: height of white in widths of the texture.
pub(crate) fn normals_from_heights(image: &Image, depth: f32) -> Image {
    let (width, height) = (image.width as usize, image.height as usize);
    let texels = image.rgba.as_chunks::<4>().0;
    let height_at =
        |x: usize, y: usize| f32::from(brightness(&texels[(y % height) * width + x % width])) / 255.0;
    let mut rgba = Vec::with_capacity(image.rgba.len());
    for y in 0..height {
        for x in 0..width {
            let across = (height_at(x + 1, y) - height_at(x + width - 1, y)) * 0.5 * width as f32 * depth;
            // Rows of the image are in order from the top; the second axis of the normal map points up.
            let up = (height_at(x, y + height - 1) - height_at(x, y + 1)) * 0.5 * height as f32 * depth;
            let n = Vec3::new(-across, -up, 1.0).normalize() * 127.5 + 127.5;
            rgba.extend([n.x, n.y, n.z, 255.0].map(|v| (v + 0.5).clamp(0.0, 255.0) as u8));
        }
    }
    Image { rgba, name: image.name.clone(), file: None, ..*image }
}

/// The mean of red, green and blue.
pub(super) fn brightness([r, g, b, _]: &[u8; 4]) -> u8 {
    ((u16::from(*r) + u16::from(*g) + u16::from(*b)) / 3) as u8
}

/// Checks that the images of two options have the same size.
pub(crate) fn check_same_size(
    o: &Options,
    name: &str,
    a: &ImageRef,
    other: &str,
    b: &ImageRef,
) -> Result<(), ApiError> {
    let size = |i: &ImageRef| (i.image.width, i.image.height);
    match size(a) == size(b) {
        true => Ok(()),
        false => {
            let ((w, h), (w2, h2)) = (size(a), size(b));
            let text =
                format!("{}: {name} is {w} × {h}, {other} {w2} × {h2}; both must have one size", o.function);
            Err(ApiError::new(text).focus(name))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gray_image(width: u32, values: &[u8]) -> Image {
        let rgba = values.iter().flat_map(|v| [*v, *v, *v, 255]).collect();
        Image { name: "h".into(), width, height: values.len() as u32 / width, rgba, file: None }
    }

    #[test]
    fn normals_from_heights_follow_the_slope() {
        // The height rises by 16/255 per texel; with 8 texels and a depth of 3 widths the slope is 8 · 3 · 16/255.
        let ramp = gray_image(8, &[0, 16, 32, 48, 64, 80, 96, 112]);
        let made = normals_from_heights(&ramp, 3.0);
        let slope = 8.0 * 3.0 * 16.0 / 255.0;
        let expected = Vec3::new(-slope, 0.0, 1.0).normalize();
        let texel = made.rgba.as_chunks::<4>().0[4];
        let got = Vec3::new(f32::from(texel[0]), f32::from(texel[1]), f32::from(texel[2])) / 127.5 - 1.0;
        assert!(got.distance(expected) < 0.02, "{got} {expected}");
        // The upper rows are higher, so the normals point down in the image.
        let rows = normals_from_heights(&gray_image(1, &[120, 90, 60, 30]), 1.0);
        assert!(rows.rgba[4 + 1] < 120, "{:?}", rows.rgba);
    }
}
