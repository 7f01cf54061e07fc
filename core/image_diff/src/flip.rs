//! Perceived difference when two images alternate on a screen: ꟻLIP, after Andersson, Nilsson, Akenine-Möller, Oskarsson,
//! Åström and Fairchild, "FLIP: A Difference Evaluator for Alternating Images", HPG 2020; section numbers below are the
//! paper's. Written from the paper; tests compare with numbers of its authors' program.
//!
//! Differences too fine for the eye are filtered out, colors are compared perceptually, and a difference at an edge or a point
//! has a larger weight. The viewing distance gives 67 pixels per degree: a 4K screen 0.7 m wide, seen from 0.7 m.

use crate::pixels::{CompareError, check_sizes};
use choreo_asset::linear_from_srgb_f32;
use choreo_plugin::Frame;

/// Pixels per degree of the field of view.
const PIXELS_PER_DEGREE: f32 = 67.020_64;

/// Perceived difference of two images, 0 = none, 1 = the largest.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipDifference {
    /// Mean over all pixels.
    pub mean: f64,
    pub worst: f64,
    /// The pixel with the worst difference (the first of equals).
    pub worst_at: [u32; 2],
    /// The difference of each pixel, rows from the top.
    pub map: Vec<f32>,
}

impl FlipDifference {
    /// The difference in words, as an observer would describe it. It depends on the worst pixel, because one wrong spot is enough.
    /// The bounds were chosen by viewing images of choreo with known faults: the table is in core/test_runner/README.md.
    pub fn description(&self) -> &'static str {
        match self.worst {
            0.0 => "equal to the eye",
            w if w <= MAX_INVISIBLE => "not visible, even when the two images alternate",
            w if w <= MAX_INVISIBLE_SIDE_BY_SIDE => {
                "not visible side by side; visible to a careful eye when the two images alternate"
            }
            w if w <= MAX_SUBTLY_VISIBLE => {
                "visible when the two images alternate; visible side by side only at a known place"
            }
            _ if self.mean <= 0.02 => "visible side by side, in a part of the image",
            w if self.mean <= 0.2 || w <= 0.6 => "visible at first sight",
            _ => "different images",
        }
    }
}

/// Largest value of [`FlipDifference::worst`] that is not visible, even when the images alternate.
pub const MAX_INVISIBLE: f64 = 0.05;
/// Largest value of [`FlipDifference::worst`] that is not visible side by side.
pub const MAX_INVISIBLE_SIDE_BY_SIDE: f64 = 0.12;
/// Largest value of [`FlipDifference::worst`] that is visible side by side only at a known place.
pub const MAX_SUBTLY_VISIBLE: f64 = 0.3;

/// Compares two images of one size. Transparent images are viewed over black and over white, and the larger difference counts.
/// About 10 ms for 256×144 pixels.
pub fn flip(a: &Frame, b: &Frame) -> Result<FlipDifference, CompareError> {
    check_sizes(a, b)?;
    let mut map = vec![0.0; a.rgba.len() / 4];
    if a.rgba != b.rgba {
        let opaque = [a, b].iter().all(|f| f.rgba.chunks_exact(4).all(|p| p[3] == 255));
        let backgrounds: &[f32] = if opaque { &[0.0] } else { &[0.0, 1.0] };
        for background in backgrounds {
            let [p, q] = [a, b].map(|f| PerceivedImage::new(f, *background));
            let difference = p.difference(&q);
            map.iter_mut().zip(difference).for_each(|(m, d): (&mut f32, f32)| *m = m.max(d));
        }
    }
    let (mut sum, mut worst, mut at) = (0.0, 0.0f32, 0);
    for (i, value) in map.iter().enumerate() {
        sum += f64::from(*value);
        if *value > worst {
            (worst, at) = (*value, i);
        }
    }
    let width = (a.width as usize).max(1);
    Ok(FlipDifference {
        mean: sum / map.len().max(1) as f64,
        worst: f64::from(worst),
        worst_at: [(at % width) as u32, (at / width) as u32],
        map,
    })
}

/// The difference map as an image in colors from black (no visible difference) through violet and orange to pale yellow (1).
pub fn flip_heatmap(visible: &FlipDifference, size: [u32; 2]) -> Frame {
    // Some color stops of matplotlib's color map "magma", which is in the public domain.
    const COLOR_STOPS: [[f32; 3]; 7] = [
        [0.0, 0.0, 4.0],
        [40.0, 17.0, 89.0],
        [113.0, 31.0, 129.0],
        [182.0, 54.0, 121.0],
        [241.0, 96.0, 93.0],
        [254.0, 175.0, 119.0],
        [252.0, 253.0, 191.0],
    ];
    let color = |v: f32| {
        let at = v.clamp(0.0, 1.0) * (COLOR_STOPS.len() - 1) as f32;
        let low = (at as usize).min(COLOR_STOPS.len() - 2);
        let part = at - low as f32;
        let channel = |k: usize| {
            (COLOR_STOPS[low][k] + (COLOR_STOPS[low + 1][k] - COLOR_STOPS[low][k]) * part + 0.5) as u8
        };
        [channel(0), channel(1), channel(2), 255]
    };
    Frame { width: size[0], height: size[1], rgba: visible.map.iter().flat_map(|v| color(*v)).collect() }
}

/// An image as an observer perceives it.
struct PerceivedImage {
    /// L*, a* and b* after the contrast sensitivity filters, with a* and b* reduced in dark colors (Hunt effect).
    color: [Vec<f32>; 3],
    /// Strength of edges and of points.
    edges: Vec<f32>,
    points: Vec<f32>,
}

impl PerceivedImage {
    /// `background`: linear gray behind a transparent image.
    fn new(frame: &Frame, background: f32) -> PerceivedImage {
        let size = [frame.width as usize, frame.height as usize];
        let linear: Vec<f32> = (0..=255).map(|v: i32| linear_from_srgb_f32(v as f32 / 255.0)).collect();
        let mut opponent = [const { Vec::new() }; 3];
        for p in frame.rgba.as_chunks::<4>().0 {
            let alpha = f32::from(p[3]) / 255.0;
            let rgb = [0, 1, 2].map(|k| linear[usize::from(p[k])] * alpha + background * (1.0 - alpha));
            let values = opponent_from_rgb(rgb);
            opponent.iter_mut().zip(values).for_each(|(plane, v)| plane.push(v));
        }
        let [edges, points] = edge_and_point_strength(&opponent[0], size);
        let [y, cx, cz] = &opponent;
        // Section 4.1.1 and table 1: (weight, spread) of the Gaussians that make up each channel's filter, spread in degrees².
        let [y, cx, cz] = [
            filter_by_contrast_sensitivity(y, size, &[(1.0, 0.0047)]),
            filter_by_contrast_sensitivity(cx, size, &[(1.0, 0.0053)]),
            filter_by_contrast_sensitivity(cz, size, &[(34.1, 0.04), (13.5, 0.025)]),
        ];
        let mut color = [const { Vec::new() }; 3];
        for ((y, cx), cz) in y.iter().zip(&cx).zip(&cz) {
            let rgb = rgb_from_opponent([*y, *cx, *cz]).map(|v| v.clamp(0.0, 1.0));
            color.iter_mut().zip(hunt_adjusted_lab(rgb)).for_each(|(plane, v)| plane.push(v));
        }
        PerceivedImage { color, edges, points }
    }

    /// The difference at each pixel (sections 4.1.2 to 4.3).
    fn difference(&self, other: &PerceivedImage) -> Vec<f32> {
        const COLOR_EXPONENT: f32 = 0.7;
        const FEATURE_EXPONENT: f32 = 0.5;
        // The color difference is remapped by two linear pieces: the lower 0.4 of its range is mapped to 0.95 of the result's range.
        const KNEE_INPUT: f32 = 0.4;
        const KNEE_OUTPUT: f32 = 0.95;
        // The largest color difference in the gamut: between green and blue.
        let max_difference = libm::powf(
            hyab_distance(hunt_adjusted_lab([0.0, 1.0, 0.0]), hunt_adjusted_lab([0.0, 0.0, 1.0])),
            COLOR_EXPONENT,
        );
        let knee = KNEE_INPUT * max_difference;
        (0..self.edges.len())
            .map(|i| {
                let [p, q] = [self, other].map(|s| [s.color[0][i], s.color[1][i], s.color[2][i]]);
                let raw = libm::powf(hyab_distance(p, q), COLOR_EXPONENT);
                let color = match raw < knee {
                    true => KNEE_OUTPUT / knee * raw,
                    false => KNEE_OUTPUT + (raw - knee) / (max_difference - knee) * (1.0 - KNEE_OUTPUT),
                };
                let edge = (self.edges[i] - other.edges[i]).abs();
                let point = (self.points[i] - other.points[i]).abs();
                let strongest = edge.max(point) * std::f32::consts::FRAC_1_SQRT_2;
                let feature = libm::powf(strongest, FEATURE_EXPONENT).min(1.0);
                libm::powf(color, 1.0 - feature).clamp(0.0, 1.0)
            })
            .collect()
    }
}

/// CIE XYZ of linear sRGB, and back (IEC 61966-2-1 in full digits).
const XYZ_FROM_RGB: [[f32; 3]; 3] = [
    [0.412_390_8, 0.357_584_33, 0.180_480_8],
    [0.212_639, 0.715_168_7, 0.072_192_32],
    [0.019_330_818, 0.119_194_78, 0.950_532_14],
];
const RGB_FROM_XYZ: [[f32; 3]; 3] = [
    [3.240_97, -1.537_383_2, -0.498_610_76],
    [-0.969_243_65, 1.875_967_5, 0.041_555_06],
    [0.055_630_08, -0.203_976_96, 1.056_971_5],
];

fn multiply_matrix(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// CIE XYZ relative to white: [1, 1, 1] is white.
fn relative_xyz(rgb: [f32; 3]) -> [f32; 3] {
    let white = multiply_matrix(&XYZ_FROM_RGB, [1.0; 3]);
    let xyz = multiply_matrix(&XYZ_FROM_RGB, rgb);
    [xyz[0] / white[0], xyz[1] / white[1], xyz[2] / white[2]]
}

/// YCxCz, a linear counterpart of L*a*b*, so that filters can be applied.
fn opponent_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = relative_xyz(rgb);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn rgb_from_opponent([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) / 116.0;
    let white = multiply_matrix(&XYZ_FROM_RGB, [1.0; 3]);
    multiply_matrix(&RGB_FROM_XYZ, [(y + cx / 500.0) * white[0], y * white[1], (y - cz / 200.0) * white[2]])
}

fn hunt_adjusted_lab(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let root = |t: f32| match t > DELTA * DELTA * DELTA {
        true => libm::cbrtf(t),
        false => t / (3.0 * DELTA * DELTA) + 4.0 / 29.0,
    };
    let [x, y, z] = relative_xyz(rgb).map(root);
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// HyAB distance: city-block in lightness, Euclidean in color (Abasi et al. 2020). Suited to large differences, too.
fn hyab_distance(p: [f32; 3], q: [f32; 3]) -> f32 {
    let [l, a, b] = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    l.abs() + libm::sqrtf(a * a + b * b)
}

/// Contrast sensitivity filter of a channel: a weighted sum of Gaussians, each applied along rows and then columns.
fn filter_by_contrast_sensitivity(plane: &[f32], size: [usize; 2], gaussians: &[(f32, f32)]) -> Vec<f32> {
    use std::f32::consts::PI;
    // Three standard deviations of the widest of all channels.
    let radius = libm::ceilf(3.0 * libm::sqrtf(0.04 / (2.0 * PI * PI)) * PIXELS_PER_DEGREE) as usize;
    let mut out = vec![0.0; plane.len()];
    let mut total = 0.0;
    for (weight, spread) in gaussians {
        let tap = |i: usize| {
            let x = (i as f32 - radius as f32) / PIXELS_PER_DEGREE;
            libm::expf(-PI * PI * x * x / spread)
        };
        let taps: Vec<f32> = (0..=2 * radius).map(tap).collect();
        let sum: f32 = taps.iter().sum();
        let weight = weight * libm::sqrtf(PI / spread);
        total += weight * sum * sum;
        let filtered = convolve_columns(&convolve_rows(plane, size, &taps), size, &taps);
        out.iter_mut().zip(filtered).for_each(|(o, v)| *o += weight * v);
    }
    out.iter_mut().for_each(|v| *v /= total);
    out
}

/// Strength of edges and of points at each pixel, 0..=1, from the unfiltered luminance (section 4.2).
fn edge_and_point_strength(luminance: &[f32], size: [usize; 2]) -> [Vec<f32>; 2] {
    /// Peak of the eye's edge detector in degrees.
    const EDGE_DETECTOR_WIDTH: f32 = 0.082;
    let y: Vec<f32> = luminance.iter().map(|y| (y + 16.0) / 116.0).collect();
    let deviation = 0.5 * EDGE_DETECTOR_WIDTH * PIXELS_PER_DEGREE;
    let radius = libm::ceilf(3.0 * deviation) as usize;
    let taps = |value: &dyn Fn(f32) -> f32| -> Vec<f32> {
        let tap = |i: usize| {
            let x = i as f32 - radius as f32;
            value(x) * libm::expf(-x * x / (2.0 * deviation * deviation))
        };
        let taps: Vec<f32> = (0..=2 * radius).map(tap).collect();
        // The sum of the positive taps is 1, and that of the negative taps is −1.
        let positive: f32 = taps.iter().filter(|t| **t > 0.0).sum();
        let negative: f32 = -taps.iter().filter(|t| **t < 0.0).sum::<f32>();
        taps.iter()
            .map(|t| if *t > 0.0 { t / positive } else { t / negative.max(f32::MIN_POSITIVE) })
            .collect()
    };
    let smooth = taps(&|_| 1.0);
    [taps(&|x| -x), taps(&|x| x * x / (deviation * deviation) - 1.0)].map(|slope| {
        let across = convolve_columns(&convolve_rows(&y, size, &slope), size, &smooth);
        let down = convolve_columns(&convolve_rows(&y, size, &smooth), size, &slope);
        across.iter().zip(&down).map(|(x, y)| libm::sqrtf(x * x + y * y)).collect()
    })
}

/// Convolution along rows; the outermost pixels are repeated beyond the border.
fn convolve_rows(plane: &[f32], [width, height]: [usize; 2], taps: &[f32]) -> Vec<f32> {
    let radius = taps.len() / 2;
    let mut out = Vec::with_capacity(plane.len());
    let mut padded = vec![0.0; width + 2 * radius];
    for y in 0..height {
        let row = &plane[y * width..(y + 1) * width];
        padded[radius..radius + width].copy_from_slice(row);
        padded[..radius].fill(row[0]);
        padded[radius + width..].fill(row[width - 1]);
        out.extend(padded.windows(taps.len()).map(|w| w.iter().zip(taps).map(|(v, t)| v * t).sum::<f32>()));
    }
    out
}

/// Convolution along columns.
fn convolve_columns(plane: &[f32], [width, height]: [usize; 2], taps: &[f32]) -> Vec<f32> {
    let radius = taps.len() as isize / 2;
    let mut out = vec![0.0; plane.len()];
    for (y, row) in out.chunks_exact_mut(width.max(1)).enumerate() {
        for (i, tap) in taps.iter().enumerate() {
            let from = (y as isize + i as isize - radius).clamp(0, height as isize - 1) as usize;
            let source = &plane[from * width..(from + 1) * width];
            row.iter_mut().zip(source).for_each(|(o, v)| *o += v * tap);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test image by integer formulas, which another program can compute, too. `fault`: 0 for none.
    fn test_image(fault: usize) -> Frame {
        let (width, height) = (64u32, 48u32);
        let rgba = (0..width * height)
            .flat_map(|i| {
                let (x, y) = (i % width, i / width);
                let mut p = [x * 4, y * 5, if (x / 8 + y / 8) % 2 == 0 { 200 } else { 40 }];
                match fault {
                    1 if [x, y] == [20, 10] => p = [255, 255, 255],
                    2 => p = p.map(|v| v + 2),
                    3 if (30..38).contains(&x) && (20..28).contains(&y) => p.swap(0, 2),
                    4 => p = p.map(|v| 255 - v),
                    5 => p = [(x + 1) * 3, y * 5, if ((x + 1) / 8 + y / 8) % 2 == 0 { 200 } else { 40 }],
                    _ => {}
                }
                [p[0] as u8, p[1] as u8, p[2] as u8, 255]
            })
            .collect();
        Frame { width, height, rgba }
    }

    /// (fault, mean, largest), from the authors' program: flip-evaluator 1.7 for Python, LDR, its default viewing
    /// conditions, on the images above.
    const REFERENCE_VALUES: [(usize, f64, f64); 5] = [
        (1, 0.002699297, 0.602920651),
        (2, 0.065363504, 0.087281346),
        (3, 0.012749185, 0.411558092),
        (4, 0.920359671, 0.994431078),
        (5, 0.303017825, 0.882364273),
    ];

    #[test]
    fn values_match_the_authors_program() {
        for (fault, mean, worst) in REFERENCE_VALUES {
            let v = flip(&test_image(0), &test_image(fault)).unwrap();
            println!("{fault}: {} {}", v.mean, v.worst);
            assert!((v.mean - mean).abs() < 2e-5, "fault {fault}: mean {} and not {mean}", v.mean);
            assert!((v.worst - worst).abs() < 2e-4, "fault {fault}: worst {} and not {worst}", v.worst);
        }
    }

    #[test]
    fn equal_images_have_no_difference_and_a_fault_is_located() {
        let v = flip(&test_image(0), &test_image(0)).unwrap();
        assert_eq!((v.mean, v.worst, v.description()), (0.0, 0.0, "equal to the eye"));
        let v = flip(&test_image(0), &test_image(1)).unwrap();
        assert!(v.worst_at[0].abs_diff(20) <= 1 && v.worst_at[1].abs_diff(10) <= 1, "{:?}", v.worst_at);
        assert_eq!(flip(&test_image(0), &test_image(4)).unwrap().description(), "different images");
        let heatmap = flip_heatmap(&v, [64, 48]);
        assert_eq!(heatmap.rgba.len(), 64 * 48 * 4);
    }

    /// Transparent black is invisible over black and visible over white.
    #[test]
    fn difference_in_alpha_alone_is_visible() {
        let a = Frame { width: 16, height: 16, rgba: vec![0; 16 * 16 * 4] };
        let mut b = a.clone();
        b.rgba.chunks_exact_mut(4).for_each(|p| p[3] = 255);
        assert!(flip(&a, &b).unwrap().worst > 0.5);
    }

    #[test]
    fn empty_images_are_equal_and_different_sizes_are_an_error() {
        let empty = Frame { width: 0, height: 0, rgba: vec![] };
        assert_eq!(flip(&empty, &empty).unwrap().mean, 0.0);
        let e = flip(&empty, &test_image(0)).unwrap_err().to_string();
        assert_eq!(e, "the frames have different sizes: 0x0 and 64x48");
    }
}
