//! The choice of the method that makes the mipmaps of a texture.

use super::{MeasuredScene, SceneChoices};
use crate::moment::Moment;
use crate::plots::{Choice, Row};
use crate::reference::ErrorStats;
use crate::timing::{Case, Clock, interleaved};
use choreo_asset::Image;
use choreo_render::scene_resources::mipmap::{levels_below, linear_to_srgb8, srgb_to_linear_table};

/// Side in pixels of the part by which a larger texture is judged.
const MAX_SIDE: u32 = 512;

/// Names of the methods; the program uses the first.
const METHODS: [&str; 3] = ["linear light, unrounded levels", "linear light, rounded levels", "sRGB codes"];

pub fn choices(scene: &MeasuredScene, moment: &Moment) -> SceneChoices {
    let textures = moment.resources.textures.iter().filter(|t| t.srgb && t.mipmaps);
    let largest = textures.max_by_key(|t| u64::from(t.image.width) * u64::from(t.image.height));
    let Some(texture) = largest.filter(|t| t.image.width > 1 && t.image.height > 1) else {
        return SceneChoices::None("no color texture has mipmaps".into());
    };
    SceneChoices::Choices(vec![mips(&crop_to_max_side(&texture.image), scene.budget_secs)])
}

/// The top left part of an image, at most [`MAX_SIDE`] pixels a side.
fn crop_to_max_side(image: &Image) -> Image {
    let (width, height) = (image.width.min(MAX_SIDE), image.height.min(MAX_SIDE));
    let row = |y: u32| {
        let from = (y * image.width) as usize * 4;
        image.rgba[from..from + width as usize * 4].iter().copied()
    };
    Image { name: image.name.clone(), width, height, rgba: (0..height).flat_map(row).collect(), file: None }
}

/// Compares the methods on this image.
pub fn mips(image: &Image, budget_secs: f64) -> Choice {
    let mut choice =
        Choice::new("mips", "In which color space, and from which levels, are mipmaps averaged?");
    choice.error_unit = "steps of 255";
    choice.reference =
        "the mean in linear light, in f64, of all image pixels that a texel covers, at all levels".into();
    choice.per = "pixel of the image".into();
    let made: Vec<Vec<Level>> = (0..METHODS.len()).map(|method| levels(image, method)).collect();
    let mut errors = vec![ErrorStats::default(); METHODS.len()];
    let mut places = vec![String::new(); METHODS.len()];
    let depth = made.iter().map(Vec::len).min().unwrap_or(0);
    for level in 0..depth {
        let (width, height, _) = made[0][level];
        let exact = exact_level(image, width, height);
        for (method, levels) in made.iter().enumerate() {
            for (i, exact) in exact.iter().enumerate() {
                let got = &levels[level].2[i * 4..i * 4 + 3];
                let error = got.iter().zip(exact).map(|(g, e)| (f64::from(*g) - e).abs()).fold(0.0, f64::max);
                if errors[method].add(error) {
                    places[method] = format!("level {} of \"{}\"", level + 1, image.name);
                }
            }
        }
    }
    let pixels = (image.width * image.height) as usize;
    let case = |method: usize| Case::new(pixels, move || drop(std::hint::black_box(levels(image, method))));
    let mut cases: Vec<Case> = (0..METHODS.len()).map(case).collect();
    // The first method uses all threads.
    let nanos = interleaved(Clock::Process, budget_secs, &mut cases);
    drop(cases);
    for (((name, error), place), nanos) in METHODS.iter().zip(&errors).zip(places).zip(nanos) {
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).at(place).nanos(nanos));
    }
    choice.choose(METHODS[0], "exact up to the final rounding; mipmaps are made only once");
    choice
}

type Level = (u32, u32, Vec<u8>);

fn levels(image: &Image, method: usize) -> Vec<Level> {
    if method == 0 {
        return levels_below(image, true).into_iter().map(|l| (l.width, l.height, l.rgba)).collect();
    }
    let mut levels: Vec<Level> = Vec::new();
    let (mut width, mut height) = (image.width, image.height);
    let mut above = image.rgba.clone();
    while width > 1 || height > 1 {
        let next = halve_image(&above, width, height, method == 1);
        (width, height) = ((width / 2).max(1), (height / 2).max(1));
        above.clone_from(&next);
        levels.push((width, height, next));
    }
    levels
}

/// Halves an image by averaging two by two pixels, dropping an odd row or column, as the simplest code does. The level is rounded to bytes.
fn halve_image(rgba: &[u8], width: u32, height: u32, linear: bool) -> Vec<u8> {
    let table = srgb_to_linear_table();
    let (w, h) = ((width / 2).max(1), (height / 2).max(1));
    let mut out = Vec::with_capacity((w * h * 4) as usize);
    let at = |x: u32, y: u32| &rgba[((y.min(height - 1) * width + x.min(width - 1)) * 4) as usize..][..4];
    for y in 0..h {
        for x in 0..w {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| at(2 * x + dx, 2 * y + dy));
            for c in 0..3 {
                out.push(match linear {
                    true => {
                        linear_to_srgb8(four.iter().map(|p| table[usize::from(p[c])]).sum::<f32>() * 0.25)
                    }
                    false => ((four.iter().map(|p| u32::from(p[c])).sum::<u32>() + 2) / 4) as u8,
                });
            }
            out.push(((four.iter().map(|p| u32::from(p[3])).sum::<u32>() + 2) / 4) as u8);
        }
    }
    out
}

/// Reference level: the area average of the image itself, in sRGB codes of 0 to 255, not rounded.
fn exact_level(image: &Image, width: u32, height: u32) -> Vec<[f64; 3]> {
    let table = srgb_to_linear_table();
    // Share of each texel that each pixel of a side covers.
    let shares = |size: u32, level: u32| -> Vec<Vec<(u32, f64)>> {
        let scale = f64::from(size) / f64::from(level);
        let of_texel = |i: u32| {
            let (from, to) = (f64::from(i) * scale, f64::from(i + 1) * scale);
            let last = (to.ceil() as u32).min(size);
            let part = |p: u32| (p, (to.min(f64::from(p + 1)) - from.max(f64::from(p))).max(0.0) / scale);
            (from as u32..last).map(part).collect()
        };
        (0..level).map(of_texel).collect()
    };
    let (columns, rows) = (shares(image.width, width), shares(image.height, height));
    let mut out = Vec::with_capacity((width * height) as usize);
    for row in &rows {
        for column in &columns {
            let mut sum = [0.0f64; 3];
            for (y, wy) in row {
                for (x, wx) in column {
                    let pixel = &image.rgba[((y * image.width + x) * 4) as usize..][..3];
                    for (sum, code) in sum.iter_mut().zip(pixel) {
                        *sum += f64::from(table[usize::from(*code)]) * wx * wy;
                    }
                }
            }
            out.push(sum.map(srgb_code_from_linear));
        }
    }
    out
}

/// sRGB code (IEC 61966-2-1) of a linear value, times 255.
fn srgb_code_from_linear(linear: f64) -> f64 {
    255.0 * choreo_asset::srgb_from_linear(linear)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn averaging_srgb_codes_is_too_dark() {
        // A checkerboard of black and white: half the light, code 188.
        let pixels = (0..64u32).flat_map(|i| [[0, 0, 0, 255], [255; 4]][((i + i / 8) % 2) as usize]);
        let image = Image { name: "check".into(), width: 8, height: 8, rgba: pixels.collect(), file: None };
        let exact = exact_level(&image, 4, 4);
        assert!((exact[0][0] - 187.5).abs() < 0.1, "{:?}", exact[0]);
        let choice = mips(&image, 0.01);
        assert!(choice.rows[0].worst <= 0.501, "{}", choice.rows[0].worst);
        assert!(choice.rows[2].worst > 55.0, "{}", choice.rows[2].worst);
    }
}
