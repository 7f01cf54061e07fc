//! Conversion from RGB to the video's luma and half-size chroma.

use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_bench::truth::Spread;
use choreo_plugin::yuv::{Matrix, Yuv420};

const WIDTH: usize = 640;
const HEIGHT: usize = 360;
const OURS: &str = "1/2^15 fixed point, [1 2 1] across (what runs)";

type Convert = fn(&[u8]) -> Planes;

pub fn section() -> Result<Section, String> {
    let rgba = picture();
    let exact = exact(&rgba);
    let ways: [(&str, Convert); 4] = [
        ("f64, [1 2 1] across", in_f64),
        (OURS, ours),
        ("1/2^8 fixed point, [1 2 1] across", in_8_bits),
        ("f64, mean of 2 × 2", mean_of_four),
    ];
    let mut choice = Choice::new("yuv", "How are images turned to Y′CbCr 4:2:0?");
    choice.error_unit = "steps of 255";
    choice.reference = "BT.709 in f64, chroma where H.264 says it sits, of an image of smooth waves whose color at any place is known".into();
    choice.per = "pixel".into();
    let mut cases: Vec<Case> = Vec::new();
    for (name, way) in ways {
        let got = way(&rgba);
        let mut error = Spread::default();
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
        cases.push(Case::new(WIDTH * HEIGHT, move || drop(std::hint::black_box(way(rgba)))));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(OURS, "as exact as bytes can hold, at the speed of SIMD");
    Ok(Section {
        title: "Video colors",
        text: "The image's rounding to bytes and the result's make nine tenths of a step at worst. Weights in 1/256 add half a step more; a \
               plain mean of four pixels puts chroma half a pixel to the right of where players expect it."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}

/// Y, Cb, Cr.
type Planes = [Vec<u8>; 3];

/// The color at a place in pixels, 0..255.
fn color(x: f64, y: f64) -> [f64; 3] {
    [0.031, 0.023, 0.017]
        .map(|k: f64| 127.5 + 120.0 * libm::sin(k * x + 0.7 * k * y) * libm::cos(0.4 * k * y))
}

fn picture() -> Vec<u8> {
    let at = |i: usize| color((i % WIDTH) as f64, (i / WIDTH) as f64);
    (0..WIDTH * HEIGHT).flat_map(|i| at(i).map(|c| (c + 0.5) as u8).into_iter().chain([255])).collect()
}

fn ycc([r, g, b]: [f64; 3]) -> [f64; 3] {
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (cb, cr) = ((b - y) / 1.8556, (r - y) / 1.5748);
    [16.0 + 219.0 * y / 255.0, 128.0 + 224.0 * cb / 255.0, 128.0 + 224.0 * cr / 255.0]
}

/// Not rounded: luma of the bytes that are there, chroma of the color between the two rows of each pair.
fn exact(rgba: &[u8]) -> [Vec<f64>; 3] {
    let luma = rgba.chunks_exact(4).map(|p| ycc([p[0], p[1], p[2]].map(f64::from))[0]).collect();
    let chroma = |plane: usize| {
        let at = |i: usize| color((i % (WIDTH / 2) * 2) as f64, (i / (WIDTH / 2) * 2) as f64 + 0.5);
        (0..WIDTH * HEIGHT / 4).map(|i| ycc(at(i))[plane]).collect()
    };
    [luma, chroma(1), chroma(2)]
}

fn ours(rgba: &[u8]) -> Planes {
    let mut yuv = Yuv420::default();
    yuv.convert(rgba, WIDTH, HEIGHT, Matrix::Bt709, true);
    [yuv.y, yuv.u, yuv.v]
}

/// Taps across: (column, weight).
fn filtered(
    rgba: &[u8],
    taps: &[(isize, f64)],
    luma: impl Fn([f64; 3]) -> f64,
    chroma: impl Fn([f64; 3]) -> [f64; 2],
) -> Planes {
    let y = rgba.chunks_exact(4).map(|p| (luma([p[0], p[1], p[2]].map(f64::from)) + 0.5) as u8).collect();
    let (mut u, mut v) = (Vec::new(), Vec::new());
    for cy in 0..HEIGHT / 2 {
        for cx in 0..WIDTH / 2 {
            let mut sum = [0.0f64; 3];
            for row in [2 * cy, 2 * cy + 1] {
                for (dx, weight) in taps {
                    let x = (2 * cx as isize + dx).clamp(0, WIDTH as isize - 1) as usize;
                    let p = &rgba[(row * WIDTH + x) * 4..][..3];
                    for (sum, c) in sum.iter_mut().zip(p) {
                        *sum += f64::from(*c) * weight * 0.5;
                    }
                }
            }
            let [cb, cr] = chroma(sum);
            u.push((cb + 0.5) as u8);
            v.push((cr + 0.5) as u8);
        }
    }
    [y, u, v]
}

const TENT: [(isize, f64); 3] = [(-1, 0.25), (0, 0.5), (1, 0.25)];

fn in_f64(rgba: &[u8]) -> Planes {
    filtered(rgba, &TENT, |c| ycc(c)[0], |c| [ycc(c)[1], ycc(c)[2]])
}

fn mean_of_four(rgba: &[u8]) -> Planes {
    filtered(rgba, &[(0, 0.5), (1, 0.5)], |c| ycc(c)[0], |c| [ycc(c)[1], ycc(c)[2]])
}

/// The usual integers: 47 157 16, −26 −87 112, 112 −102 −10, in 1/256.
fn in_8_bits(rgba: &[u8]) -> Planes {
    let dot =
        |c: [f64; 3], w: [f64; 3], offset: f64| (c[0] * w[0] + c[1] * w[1] + c[2] * w[2]) / 256.0 + offset;
    filtered(
        rgba,
        &TENT,
        |c| dot(c, [47.0, 157.0, 16.0], 16.0),
        |c| [dot(c, [-26.0, -87.0, 112.0], 128.0), dot(c, [112.0, -102.0, -10.0], 128.0)],
    )
}
