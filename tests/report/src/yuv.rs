//! Conversion from RGB to video luma and half-resolution chroma.

use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_plugin::yuv::{Matrix, Yuv420};
use std::ops::Add;

const WIDTH: usize = 640;
const HEIGHT: usize = 360;
const CHOSEN_METHOD: &str = "1/2^15 fixed point, [1 2 1] across (default)";

type Convert = fn(&[u8]) -> Planes;

pub(crate) fn section() -> Result<Section, String> {
    let rgba = test_image();
    let exact = reference_planes(&rgba);
    let methods: [(&str, Convert); 5] = [
        ("f64, [1 2 1] across", in_f64),
        ("f32, [1 2 1] across", in_f32),
        (CHOSEN_METHOD, project_conversion),
        ("1/2^8 fixed point, [1 2 1] across", convert_in_8_bits),
        ("1/2^15 fixed point, mean of 2 × 2", convert_mean_of_four),
    ];
    let mut choice = Choice::new("yuv", "How are images converted to Y′CbCr 4:2:0?");
    choice.error_unit = "steps of 255";
    choice.reference = "BT.709 in f64, chroma where H.264 says it sits, of an image of smooth waves whose color at any place is known".into();
    choice.per =
        "pixel; each way goes through rows of one color channel, in loops that the compiler turns into SIMD"
            .into();
    let mut cases: Vec<Case> = Vec::new();
    for (name, method) in methods {
        let got = method(&rgba);
        let mut error = ErrorStats::default();
        let mut worst = String::new();
        for (plane, (got, exact)) in ["Y", "Cb", "Cr"].iter().zip(got.iter().zip(&exact)) {
            for (i, (got, exact)) in got.iter().zip(exact).enumerate() {
                if error.add((f64::from(*got) - exact).abs()) {
                    worst = format!("{plane} {i}");
                }
            }
        }
        choice.rows.push(Row::new(name).error(error.worst, error.mean()).at(worst));
        let rgba = &rgba;
        cases.push(Case::new(WIDTH * HEIGHT, move || drop(std::hint::black_box(method(rgba)))));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(CHOSEN_METHOD, "as exact as bytes can hold, and the same bytes on every machine");
    Ok(Section {
        title: "Video colors",
        text: "Rounding the image and the result to bytes makes an error of nine tenths of a step at worst. \
               Weights in 1/256 add half a step more; a plain mean of four pixels puts chroma half a pixel \
               to the right of where players expect it."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: vec![(
            "yuv",
            "integers give the same bytes on every machine, however its compiler orders \
                                 sums of floats.",
        )],
    })
}

/// Planes Y, Cb and Cr.
type Planes = [Vec<u8>; 3];

/// Color at a position in pixels, 0..255.
fn color_at(x: f64, y: f64) -> [f64; 3] {
    [0.031, 0.023, 0.017]
        .map(|k: f64| 127.5 + 120.0 * libm::sin(k * x + 0.7 * k * y) * libm::cos(0.4 * k * y))
}

fn test_image() -> Vec<u8> {
    let at = |i: usize| color_at((i % WIDTH) as f64, (i / WIDTH) as f64);
    (0..WIDTH * HEIGHT).flat_map(|i| at(i).map(|c| (c + 0.5) as u8).into_iter().chain([255])).collect()
}

fn ycc_from_rgb([r, g, b]: [f64; 3]) -> [f64; 3] {
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (cb, cr) = ((b - y) / 1.8556, (r - y) / 1.5748);
    [16.0 + 219.0 * y / 255.0, 128.0 + 224.0 * cb / 255.0, 128.0 + 224.0 * cr / 255.0]
}

/// Reference without rounding: luma of the 8-bit pixels, and chroma of the exact color between the two rows of each pair.
fn reference_planes(rgba: &[u8]) -> [Vec<f64>; 3] {
    let luma = rgba.chunks_exact(4).map(|p| ycc_from_rgb([p[0], p[1], p[2]].map(f64::from))[0]).collect();
    let chroma = |plane: usize| {
        let at = |i: usize| color_at((i % (WIDTH / 2) * 2) as f64, (i / (WIDTH / 2) * 2) as f64 + 0.5);
        (0..WIDTH * HEIGHT / 4).map(|i| ycc_from_rgb(at(i))[plane]).collect()
    };
    [luma, chroma(1), chroma(2)]
}

fn project_conversion(rgba: &[u8]) -> Planes {
    let mut yuv = Yuv420::default();
    yuv.convert(rgba, WIDTH, HEIGHT, Matrix::Bt709, true);
    [yuv.y, yuv.u, yuv.v]
}

/// Converts pairs of rows like [`Yuv420`], with separate channels, in a number type. `luma` writes a row. `halve` filters the sums of two
/// rows to half as many columns, with a gain of 8. `chroma` writes a row of both planes.
fn convert_row_pairs<T: Copy + Default + Add<Output = T>>(
    rgba: &[u8],
    of: impl Fn(i32) -> T,
    luma: impl Fn(&[Vec<T>; 3], &mut [u8]),
    halve: impl Fn(&[T], &mut [T]),
    chroma: impl Fn(&[Vec<T>; 3], &mut [u8], &mut [u8]),
) -> Planes {
    let row = || [(); 3].map(|()| vec![T::default(); WIDTH]);
    let (mut rows, mut halves) = ([row(), row()], [(); 3].map(|()| vec![T::default(); WIDTH / 2]));
    let mut sums = vec![T::default(); WIDTH];
    let mut planes = [WIDTH * HEIGHT, WIDTH * HEIGHT / 4, WIDTH * HEIGHT / 4].map(|count| vec![0; count]);
    let [y, u, v] = &mut planes;
    let luma_rows = y.chunks_exact_mut(2 * WIDTH);
    let chroma_rows = u.chunks_exact_mut(WIDTH / 2).zip(v.chunks_exact_mut(WIDTH / 2));
    for ((pixels, y), (u, v)) in rgba.chunks_exact(8 * WIDTH).zip(luma_rows).zip(chroma_rows) {
        let both = pixels.chunks_exact(4 * WIDTH).zip(&mut rows).zip(y.chunks_exact_mut(WIDTH));
        for ((pixels, row), y) in both {
            let [r, g, b] = &mut *row;
            for (((pixel, r), g), b) in pixels.as_chunks::<4>().0.iter().zip(r).zip(g).zip(b) {
                let pixel = u32::from_le_bytes(*pixel) as i32;
                (*r, *g, *b) = (of(pixel & 255), of(pixel >> 8 & 255), of(pixel >> 16 & 255));
            }
            luma(row, y);
        }
        let [upper, lower] = &rows;
        for ((upper, lower), out) in upper.iter().zip(lower).zip(&mut halves) {
            sums.iter_mut().zip(upper).zip(lower).for_each(|((sum, a), b)| *sum = *a + *b);
            halve(&sums, out);
        }
        chroma(&halves, u, v);
    }
    planes
}

/// Horizontal [1 2 1] filter; the edge column is repeated.
fn tent_filter<T: Copy + Add<Output = T>>(sums: &[T], out: &mut [T]) {
    let pairs = sums.as_chunks::<2>().0;
    let [first, second] = pairs[0];
    out[0] = (first + first) + (first + second);
    for ((out, before), here) in out[1..].iter_mut().zip(pairs).zip(&pairs[1..]) {
        *out = (before[1] + here[0]) + (here[0] + here[1]);
    }
}

/// Box filter over 2 × 2 pixels, with a gain of 8.
fn box_filter<T: Copy + Add<Output = T>>(sums: &[T], out: &mut [T]) {
    for (out, [a, b]) in out.iter_mut().zip(sums.as_chunks::<2>().0) {
        *out = (*a + *b) + (*a + *b);
    }
}

/// Rounds by adding a large number and taking the low bits, which vector instructions can do; they have no saturating conversion to bytes.
macro_rules! define_float_conversion {
    ($name:ident, $number:ty, $carry:expr) => {
        fn $name(rgba: &[u8]) -> Planes {
            let rounded = |v: $number| (v + $carry).to_bits() as u8;
            let y = [0.2126, 0.7152, 0.0722].map(|w: $number| w * (219.0 / 255.0));
            let scale = 224.0 / 255.0 / 8.0;
            let u = [-0.2126, -0.7152, 0.9278].map(|w: $number| w * (scale / 1.8556));
            let v = [0.7874, -0.7152, -0.0722].map(|w: $number| w * (scale / 1.5748));
            let row = |[r, g, b]: &[Vec<$number>; 3], w: [$number; 3], offset: $number, out: &mut [u8]| {
                for (((r, g), b), out) in r.iter().zip(g).zip(b).zip(out) {
                    *out = rounded(r * w[0] + g * w[1] + b * w[2] + offset);
                }
            };
            convert_row_pairs(
                rgba,
                |byte| byte as $number,
                |rows, out| row(rows, y, 16.0, out),
                tent_filter,
                |rows, of_u, of_v| {
                    row(rows, u, 128.0, of_u);
                    row(rows, v, 128.0, of_v);
                },
            )
        }
    };
}
define_float_conversion!(in_f32, f32, 12_582_912.0);
define_float_conversion!(in_f64, f64, 6_755_399_441_055_744.0);

/// The weights of [`Yuv420`] in 1/2^15, applied to the plain mean of four pixels.
fn convert_mean_of_four(rgba: &[u8]) -> Planes {
    let row = |[r, g, b]: &[Vec<i16>; 3], w: [i16; 3], shift: u32, offset: i32, out: &mut [u8]| {
        let half = (offset << shift) + (1 << (shift - 1));
        let [wr, wg, wb] = w.map(i32::from);
        for (((r, g), b), out) in r.iter().zip(g).zip(b).zip(out) {
            let sum = i32::from(*r) * wr + i32::from(*g) * wg + i32::from(*b) * wb;
            *out = ((sum + half) >> shift) as u8;
        }
    };
    convert_row_pairs(
        rgba,
        |byte| byte as i16,
        |rows, out| row(rows, [5983, 20127, 2032], 15, 16, out),
        box_filter,
        |rows, u, v| {
            row(rows, [-3298, -11094, 14392], 18, 128, u);
            row(rows, [14392, -13073, -1319], 18, 128, v);
        },
    )
}

/// Common integer weights: 47 157 16, −26 −87 112 + 1 (so that gray stays gray), 112 −102 −10, in 1/256. All sums fit into 16 bits.
fn convert_in_8_bits(rgba: &[u8]) -> Planes {
    let chroma = |[r, g, b]: &[Vec<u16>; 3], w: [i16; 3], out: &mut [u8]| {
        for (((r, g), b), out) in r.iter().zip(g).zip(b).zip(out) {
            // The mean is taken first, since eight times its value would not fit.
            let mean = |sum: &u16| ((*sum + 4) >> 3) as i16;
            let sum = mean(r) * w[0] + mean(g) * w[1] + mean(b) * w[2];
            *out = (((sum + 128) >> 8) + 128) as u8;
        }
    };
    convert_row_pairs(
        rgba,
        |byte| byte as u16,
        |[r, g, b], out| {
            for (((r, g), b), out) in r.iter().zip(g).zip(b).zip(out) {
                *out = (((r * 47 + g * 157 + b * 16 + 128) >> 8) + 16) as u8;
            }
        },
        tent_filter,
        |rows, u, v| {
            chroma(rows, [-26, -86, 112], u);
            chroma(rows, [112, -102, -10], v);
        },
    )
}
