//! Images drawn onto a canvas, minified by a box filter or magnified by bilinear interpolation.

use crate::layers_2d::Canvas;
use crate::scene_resources::mipmap::srgb_to_linear_table;
use choreo_asset::Image;
use choreo_stage::Fit;
use choreo_text::Coverage;
use glam::{DVec2, Vec4};

/// Size of an image fitted into a frame, in pixels.
pub(super) fn fitted_size(image: &Image, fit: Fit, frame: DVec2) -> DVec2 {
    let image_size = DVec2::new(image.width.max(1).into(), image.height.max(1).into());
    let scaled = |factor: f64| image_size * factor;
    let factors = frame / image_size;
    match fit {
        Fit::Height(share) => scaled(share * factors.y),
        Fit::Width(share) => scaled(share * factors.x),
        Fit::Contain => scaled(factors.x.min(factors.y)),
        Fit::Cover => scaled(factors.x.max(factors.y)),
    }
}

pub(super) fn draw_image(canvas: &mut Canvas, image: &Image, at: DVec2, size: DVec2, opacity: f32) {
    let texels = image.width as usize * image.height as usize;
    if texels == 0 || image.rgba.len() != 4 * texels || !(size.x > 0.0 && size.y > 0.0) {
        return;
    }
    let decode = srgb_to_linear_table();
    let texel = |x: i64, y: i64| {
        let x = x.clamp(0, i64::from(image.width) - 1) as usize;
        let y = y.clamp(0, i64::from(image.height) - 1) as usize;
        let [r, g, b, a] = image.rgba.as_chunks::<4>().0[y * image.width as usize + x];
        let alpha = f32::from(a) / 255.0;
        Vec4::new(decode[r as usize], decode[g as usize], decode[b as usize], 1.0) * alpha
    };
    let to = at + size;
    let coverage = Coverage::rectangle([at.x as f32, at.y as f32], [to.x as f32, to.y as f32], canvas.size);
    let image_size = DVec2::new(image.width.into(), image.height.into());
    let texels_per_pixel = image_size / size;
    // Filter weights of the texels around a position along one axis: (texel, weight), at most 64.
    let filter_weights = |middle: f64, step: f64| -> Vec<(i64, f32)> {
        let half = step.max(1.0) * 0.5;
        let (low, high) = (middle - half, middle + half);
        let first = low.floor() as i64;
        let count = ((high.ceil() as i64) - first).clamp(1, 64);
        let share = |i: i64| ((i as f64 + 1.0).min(high) - (i as f64).max(low)).max(0.0) as f32;
        let all: Vec<(i64, f32)> = (first..first + count).map(|i| (i, share(i))).collect();
        let sum: f32 = all.iter().map(|(_, w)| w).sum();
        all.into_iter().map(|(i, w)| (i, w / sum)).collect()
    };
    let column_weights: Vec<Vec<(i64, f32)>> = (0..coverage.size[0])
        .map(|x| {
            filter_weights(
                (f64::from(coverage.at[0] + x) + 0.5 - at.x) * texels_per_pixel.x,
                texels_per_pixel.x,
            )
        })
        .collect();
    let row_weights: Vec<Vec<(i64, f32)>> = (0..coverage.size[1])
        .map(|y| {
            filter_weights(
                (f64::from(coverage.at[1] + y) + 0.5 - at.y) * texels_per_pixel.y,
                texels_per_pixel.y,
            )
        })
        .collect();
    let first = coverage.at;
    canvas.blend_pixels(&coverage, |x, y| {
        let mut sum = Vec4::ZERO;
        for (ty, wy) in &row_weights[(y - first[1]) as usize] {
            for (tx, wx) in &column_weights[(x - first[0]) as usize] {
                sum += texel(*tx, *ty) * (wx * wy);
            }
        }
        sum * opacity
    });
}
