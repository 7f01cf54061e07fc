//! Coverage and depth of one triangle in one tile by Vulkan's rules (1.3, "Polygon Rasterization"): a sample on an edge belongs to
//! a triangle by the top-left rule, and samples lie at the standard positions.

use super::setup::{SUBPIXEL, Triangle};

pub(crate) const TILE_WIDTH: i32 = 64;
pub(crate) const TILE_HEIGHT: i32 = 16;
pub(crate) const TILE_PIXELS: usize = (TILE_WIDTH * TILE_HEIGHT) as usize;

/// Standard locations of four samples, in 1/256 pixel (Vulkan 1.3, table "Standard sample locations"); one sample lies
/// in the middle.
const FOUR_SAMPLES: [[i32; 2]; 4] = [[96, 32], [224, 96], [32, 160], [160, 224]];

/// Four neighboring samples in memory: the samples of one pixel, or one sample of four pixels in a row.
struct SampleGroup {
    /// Offsets from the corner of the group's first pixel, 1/256 pixel.
    offsets: [[i32; 2]; 4],
    /// Number of pixels in a group.
    pixels: i32,
}

const fn sample_group<const S: usize>() -> SampleGroup {
    if S == 4 {
        SampleGroup { offsets: FOUR_SAMPLES, pixels: 1 }
    } else {
        SampleGroup { offsets: [[128, 128], [384, 128], [640, 128], [896, 128]], pixels: 4 }
    }
}

/// Calls `hit(first sample index in the tile, [covered; 4], [depth; 4])` for every group of four samples of which any
/// is covered. `tile` is the tile's first pixel. Sample order in a tile: rows, pixels, samples.
#[inline(always)]
pub(super) fn rasterize<const S: usize>(
    t: &Triangle,
    tile: [i32; 2],
    mut hit: impl FnMut(usize, [bool; 4], [f32; 4]),
) {
    let group = const { sample_group::<S>() };
    let [x0, y0, x1, y1] = t.pixel_bounds();
    let x0 = (x0.max(tile[0]) - tile[0]) / group.pixels * group.pixels + tile[0];
    let x1 = x1.min(tile[0] + TILE_WIDTH);
    let (y0, y1) = (y0.max(tile[1]), y1.min(tile[1] + TILE_HEIGHT));
    if x0 >= x1 || y0 >= y1 {
        return;
    }
    let groups = (x1 - x0 + group.pixels - 1) / group.pixels;

    // Edge functions in 1/256² pixel², divided by 256: steps of whole pixels are multiples of 256 of it, so that the
    // floor keeps the sign exact, and every value in a tile that an edge crosses fits 32 bits.
    let mut start = [[0i32; 4]; 3];
    let (mut step_x, mut step_y) = ([0i32; 3], [0i32; 3]);
    for e in 0..3 {
        let (a, b) = (e, (e + 1) % 3);
        let (dx, dy) = (t.x[b] - t.x[a], t.y[b] - t.y[a]);
        // A sample exactly on an edge belongs to it if it is a top or a left edge.
        let bias = i64::from(!(dy < 0 || (dy == 0 && dx > 0)));
        let values: [i64; 4] = std::array::from_fn(|i| {
            let px = i64::from(x0) * i64::from(SUBPIXEL) + i64::from(group.offsets[i][0]) - i64::from(t.x[a]);
            let py = i64::from(y0) * i64::from(SUBPIXEL) + i64::from(group.offsets[i][1]) - i64::from(t.y[a]);
            (i64::from(dx) * py - i64::from(dy) * px - bias) >> 8
        });
        let span_x = -i64::from(dy) * i64::from((groups - 1) * group.pixels);
        let span_y = i64::from(dx) * i64::from(y1 - y0 - 1);
        let (low, high) = values.iter().fold((i64::MAX, i64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        if high + span_x.max(0) + span_y.max(0) < 0 {
            return;
        }
        if low + span_x.min(0) + span_y.min(0) >= 0 {
            // The whole rectangle is inside this edge: its value and steps stay zero.
            continue;
        }
        start[e] = values.map(|v| v as i32);
        step_x[e] = -dy * group.pixels;
        step_y[e] = dx;
    }

    const PIXELS_PER_SUBPIXEL: f32 = 1.0 / SUBPIXEL as f32;
    let offset_x = group.offsets.map(|o| o[0] as f32 * PIXELS_PER_SUBPIXEL);
    let offset_y = group.offsets.map(|o| o[1] as f32 * PIXELS_PER_SUBPIXEL);
    let [zx, zy, z0] = t.depth;
    let mut row = start;
    for y in y0..y1 {
        let mut e = row;
        let mut index = (((y - tile[1]) * TILE_WIDTH + (x0 - tile[0])) as usize) * S;
        let mut x = x0;
        for _ in 0..groups {
            let outside: [i32; 4] = std::array::from_fn(|i| e[0][i] | e[1][i] | e[2][i]);
            if (outside[0] & outside[1] & outside[2] & outside[3]) >= 0 {
                let (fx, fy) = ((x - t.origin[0]) as f32, (y - t.origin[1]) as f32);
                let depth: [f32; 4] = std::array::from_fn(|i| {
                    let z = (fx + offset_x[i]) * zx + ((fy + offset_y[i]) * zy + z0);
                    z.clamp(0.0, 1.0)
                });
                hit(index, outside.map(|o| o >= 0), depth);
            }
            for (e, step) in e.iter_mut().zip(step_x) {
                *e = e.map(|v| v.wrapping_add(step));
            }
            index += 4;
            x += group.pixels;
        }
        for (e, step) in row.iter_mut().zip(step_y) {
            *e = e.map(|v| v.wrapping_add(step));
        }
    }
}
