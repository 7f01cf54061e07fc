//! Mipmaps: averaging in linear light or in sRGB, and the filter.

use crate::{BUDGET_SECS, Random, Section};
use choreo_asset::Image;
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::scene::mips::mips;
use choreo_bench::timing::{Case, Clock, interleaved};
use std::f64::consts::TAU;

const TEXTURE_SIDE: usize = 256;

pub(crate) fn section() -> Result<Section, String> {
    let mut light = mips(&test_image(), BUDGET_SECS);
    light.key = "mip_light".into();
    light.choose("linear light, unrounded levels", "exact to the rounding of the last step");
    Ok(Section {
        title: "Mipmaps",
        text: "A level averaged in sRGB codes is too dark wherever neighbors differ, up to a quarter of the range. Of filters, the ideal one \
               keeps every wave that the smaller level can hold and drops all others. The box dims waves \
               near the limit and lets some beyond it alias; long filters do better but ring around edges, \
               the ideal one most of all."
            .into(),
        choices: vec![light, compare_filters()],
        tables: Vec::new(),
        off_front: vec![(
            "mip_light",
            "it runs on all threads of the machine, and their times are added up; the others drop the last \
             column of odd sides, which is less work.",
        )],
    })
}

/// Test image with smooth waves, hard edges and noise, in three bands.
fn test_image() -> Image {
    let mut random = Random(9);
    let mut rgba = Vec::with_capacity(TEXTURE_SIDE * TEXTURE_SIDE * 4);
    for y in 0..TEXTURE_SIDE {
        for x in 0..TEXTURE_SIDE {
            let v = match y * 3 / TEXTURE_SIDE {
                0 => 127.5 + 127.5 * libm::sin(TAU * (x * x) as f64 / 700.0),
                1 => [20.0, 235.0][(x / 5 + y / 5) % 2],
                _ => random.unit() * 255.0,
            };
            rgba.extend([v as u8, (255.0 - v) as u8, (v * 0.5) as u8, 255]);
        }
    }
    Image {
        name: "waves, checks and noise".into(),
        width: TEXTURE_SIDE as u32,
        height: TEXTURE_SIDE as u32,
        rgba,
        file: None,
    }
}

/// A cosine along x and y: cycles over a side, phase and height.
struct Wave {
    cycles: [f64; 2],
    phase: f64,
    height: f64,
}

/// A filter: weights by distance from the center of the new texel, in new texels; 0 beyond the radius.
struct Filter {
    name: &'static str,
    radius: f64,
    weight: fn(f64) -> f64,
}

const FILTERS: [Filter; 4] = [
    Filter { name: "box (default)", radius: 0.5, weight: |_| 1.0 },
    Filter { name: "triangle", radius: 1.0, weight: |x| 1.0 - x },
    Filter { name: "Kaiser, radius 2", radius: 2.0, weight: |x| sinc(x) * kaiser_window(x / 2.0) },
    Filter { name: "Lanczos, radius 3", radius: 3.0, weight: |x| sinc(x) * sinc(x / 3.0) },
];

fn sinc(x: f64) -> f64 {
    let p = std::f64::consts::PI * x;
    if x.abs() < 1e-9 { 1.0 } else { libm::sin(p) / p }
}

/// Kaiser window with β = 4.
fn kaiser_window(x: f64) -> f64 {
    let bessel = |v: f64| {
        let (mut term, mut sum) = (1.0, 1.0);
        for k in 1..24 {
            term *= (v / 2.0 / f64::from(k)) * (v / 2.0 / f64::from(k));
            sum += term;
        }
        sum
    };
    if x >= 1.0 { 0.0 } else { bessel(4.0 * (1.0 - x * x).sqrt()) / bessel(4.0) }
}

fn compare_filters() -> Choice {
    let mut choice = Choice::new("mip_filter", "With what filter is a level halved?");
    choice.error_unit = "of the range";
    choice.reference = "waves of known length in linear light: the ideal filter keeps those that the level can hold as they are, and drops \
                        the rest; a closed form in f64, over one halving"
        .into();
    choice.per = "pixel of the image".into();
    let mut random = Random(4);
    // Wavelengths are distributed evenly in octaves, and amplitudes fall with the frequency, as in natural images.
    let waves: Vec<Wave> = (0..40)
        .map(|_| {
            let octave = random.unit() * 6.0;
            let cycles = libm::exp2(octave) * 1.5;
            let angle = random.unit() * TAU;
            let cycles = [(cycles * libm::cos(angle)).round(), (cycles * libm::sin(angle)).round()];
            Wave { cycles, phase: random.unit() * TAU, height: 1.0 / (1.0 + libm::exp2(octave) * 0.2) }
        })
        .collect();
    let sum: f64 = waves.iter().map(|w| w.height).sum();
    let value = |x: f64, y: f64, keeps: &dyn Fn(&Wave) -> bool| -> f64 {
        let at = |w: &Wave| w.height * libm::cos(TAU * (w.cycles[0] * x + w.cycles[1] * y) + w.phase);
        0.5 + 0.5 * waves.iter().filter(|w| keeps(w)).map(at).sum::<f64>() / sum
    };
    let center = |i: usize, side: usize| (i as f64 + 0.5) / side as f64;
    let source: Vec<f64> = (0..TEXTURE_SIDE * TEXTURE_SIDE)
        .map(|i| {
            value(center(i % TEXTURE_SIDE, TEXTURE_SIDE), center(i / TEXTURE_SIDE, TEXTURE_SIDE), &|_| true)
        })
        .collect();
    let half = TEXTURE_SIDE / 2;
    let limit = half as f64 / 2.0;
    let held = |w: &Wave| w.cycles.iter().all(|c| c.abs() < limit);
    let exact: Vec<f64> =
        (0..half * half).map(|i| value(center(i % half, half), center(i / half, half), &held)).collect();
    let mut cases: Vec<Case> = Vec::new();
    for filter in &FILTERS {
        let small = halve_image(&source, filter);
        let mut error = ErrorStats::default();
        for (got, exact) in small.iter().zip(&exact) {
            error.add((got - exact).abs());
        }
        choice.rows.push(Row::new(filter.name).error(error.worst, error.mean()));
        let source = &source;
        cases.push(Case::new(TEXTURE_SIDE * TEXTURE_SIDE, move || {
            drop(std::hint::black_box(halve_image(source, filter)))
        }));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        FILTERS[0].name,
        "the filter of drivers and most tools, so files look as their authors saw them; it never rings and \
         never leaves the range",
    );
    choice
}

/// Halves an image horizontally, then vertically; the image is periodic.
fn halve_image(source: &[f64], filter: &Filter) -> Vec<f64> {
    let half = TEXTURE_SIDE / 2;
    // Distances of source pixels from the center of a new texel, in new texels: ±¼, ±¾, …
    let reach = (filter.radius * 2.0).ceil() as i64;
    let taps: Vec<(i64, f64)> = (-reach..reach)
        .map(|i| (i, (i as f64 + 0.5) / 2.0))
        .filter(|(_, x)| x.abs() < filter.radius)
        .map(|(i, x)| (i, (filter.weight)(x.abs())))
        .collect();
    let sum: f64 = taps.iter().map(|t| t.1).sum();
    let side = TEXTURE_SIDE as i64;
    let mut across = vec![0.0; TEXTURE_SIDE * half];
    for y in 0..TEXTURE_SIDE {
        for x in 0..half {
            let taps = taps.iter().map(|(i, w)| {
                w * source[y * TEXTURE_SIDE + (2 * x as i64 + 1 + i).rem_euclid(side) as usize]
            });
            across[y * half + x] = taps.sum::<f64>() / sum;
        }
    }
    let mut out = vec![0.0; half * half];
    for y in 0..half {
        for x in 0..half {
            let taps = taps
                .iter()
                .map(|(i, w)| w * across[(2 * y as i64 + 1 + i).rem_euclid(side) as usize * half + x]);
            out[y * half + x] = taps.sum::<f64>() / sum;
        }
    }
    out
}
