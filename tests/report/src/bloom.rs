//! Bloom: size of the image in which the light is blurred, against a Gaussian blur at full size.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_plugin::{Effect, EffectImage};
use glam::{DVec3, Vec3, Vec4};
use std::hint::black_box;

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Bloom",
        text: "Wide bloom is blurred in a smaller image: the Gaussian's 17 taps read pixels that are means \
               of squares, and the result is interpolated between four of them. The image is halved until \
               three standard deviations are at most eight of its pixels. Even smaller images are hardly \
               cheaper, and show the squares."
            .into(),
        choices: vec![compare_downscale_factors()?],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}

const SIZE: [usize; 2] = [640, 360];
/// Radius as a fraction of the image's height: 36 pixels, three standard deviations of 12.
const RADIUS: f32 = 0.1;
/// Parameters of the effect: strength, threshold, radius.
const PARAMETERS: [f32; 8] = [1.0, 0.9, RADIUS, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Lamps of all sizes and colors, and a thin bright line, away from the image's edges.
fn test_image() -> Vec<Vec4> {
    let mut rgba = vec![Vec3::splat(0.2).extend(1.0); SIZE[0] * SIZE[1]];
    let mut random = Random(17);
    let place = |share: f64, side: usize| 80.0 + share * (side as f64 - 160.0);
    for _ in 0..60 {
        let (x, y) = (place(random.unit(), SIZE[0]), place(random.unit(), SIZE[1]));
        let radius = 0.6 + 4.0 * random.unit() * random.unit();
        let color = Vec3::from([0; 3].map(|_| (1.0 + 14.0 * random.unit()) as f32));
        for (i, pixel) in rgba.iter_mut().enumerate() {
            let (dx, dy) = ((i % SIZE[0]) as f64 + 0.5 - x, (i / SIZE[0]) as f64 + 0.5 - y);
            if dx * dx + dy * dy < radius * radius {
                *pixel = color.extend(1.0);
            }
        }
    }
    for x in 120..SIZE[0] - 120 {
        rgba[(100 + x / 7) * SIZE[0] + x] = Vec4::new(6.0, 8.0, 12.0, 1.0);
    }
    rgba
}

/// The part of a color above the threshold, with the same hue, as in the effect.
fn part_above_threshold(c: Vec4) -> Vec3 {
    let c = c.truncate();
    let most = c.max_element();
    c * ((most - PARAMETERS[1]).max(0.0) / most.max(1e-6))
}

/// Blurs in an image that is `shrink` times smaller, with as many taps as three standard deviations need, but no fewer than the effect
/// uses.
fn blur_at_scale(rgba: &[Vec4], shrink: usize) -> Vec<Vec3> {
    let small = SIZE.map(|s| s.div_ceil(shrink));
    let clamped = |v: i32, side: usize| v.clamp(0, side as i32 - 1) as usize;
    let mut now = Vec::with_capacity(small[0] * small[1]);
    for (y, x) in (0..small[1]).flat_map(|y| (0..small[0]).map(move |x| (y, x))) {
        let mut sum = Vec3::ZERO;
        for i in 0..shrink * shrink {
            let (px, py) = (x * shrink + i % shrink, y * shrink + i / shrink);
            sum += part_above_threshold(rgba[py.min(SIZE[1] - 1) * SIZE[0] + px.min(SIZE[0] - 1)]);
        }
        now.push(sum / (shrink * shrink) as f32);
    }
    let sigma = (RADIUS * SIZE[1] as f32 / (3.0 * shrink as f32)).max(0.1);
    let taps = (libm::ceilf(3.0 * sigma) as i32).max(8);
    for along in [[1, 0], [0, 1]] {
        let next = (0..now.len() as i32).map(|i| {
            let (x, y) = (i % small[0] as i32, i / small[0] as i32);
            let at = |n: i32| {
                now[clamped(y + n * along[1], small[1]) * small[0] + clamped(x + n * along[0], small[0])]
            };
            let mut step = libm::expf(-0.5 / (sigma * sigma));
            let steeper = step * step;
            let (mut sum, mut weight, mut weights) = (at(0), 1.0, 1.0);
            for n in 1..=taps {
                weight *= step;
                step *= steeper;
                sum += weight * (at(n) + at(-n));
                weights += 2.0 * weight;
            }
            sum / weights
        });
        now = next.collect();
    }
    let between = |i: usize| {
        let place = |v: usize| (v as f32 + 0.5) / shrink as f32 - 0.5;
        let (x, y) = (place(i % SIZE[0]), place(i / SIZE[0]));
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let at = |dx: i32, dy: i32| {
            now[clamped(top as i32 + dy, small[1]) * small[0] + clamped(left as i32 + dx, small[0])]
        };
        let above = at(0, 0) * (1.0 - fx) + at(1, 0) * fx;
        let below = at(0, 1) * (1.0 - fx) + at(1, 1) * fx;
        above * (1.0 - fy) + below * fy
    };
    (0..SIZE[0] * SIZE[1]).map(between).collect()
}

/// Reference blur: a Gaussian cut off at six standard deviations, in f64.
fn reference_blur(rgba: &[Vec4]) -> Vec<DVec3> {
    let sigma = f64::from(RADIUS) * SIZE[1] as f64 / 3.0;
    let reach = (6.0 * sigma).ceil() as i32;
    let weights: Vec<f64> =
        (-reach..=reach).map(|i| libm::exp(-0.5 * f64::from(i * i) / (sigma * sigma))).collect();
    let whole: f64 = weights.iter().sum();
    let mut now: Vec<DVec3> = rgba.iter().map(|c| part_above_threshold(*c).as_dvec3()).collect();
    for along in [[1, 0], [0, 1]] {
        let next = (0..now.len() as i32).map(|i| {
            let (x, y) = (i % SIZE[0] as i32, i / SIZE[0] as i32);
            let mut sum = DVec3::ZERO;
            for (n, weight) in (-reach..).zip(&weights) {
                let (px, py) = (x + n * along[0], y + n * along[1]);
                if (0..SIZE[0] as i32).contains(&px) && (0..SIZE[1] as i32).contains(&py) {
                    sum += now[py as usize * SIZE[0] + px as usize] * *weight;
                }
            }
            sum / whole
        });
        now = next.collect();
    }
    now
}

/// Light that the effect adds.
fn light_added_by_effect(bloom: &Effect, rgba: &[Vec4]) -> Vec<Vec3> {
    let image = EffectImage { size: SIZE.map(|s| s as u32), rgba };
    let now = bloom.over_image(image, None, &PARAMETERS);
    now.iter().zip(rgba).map(|(with, without)| (*with - *without).truncate()).collect()
}

fn compare_downscale_factors() -> Result<Choice, String> {
    let rgba = test_image();
    let exact = reference_blur(&rgba);
    let bloom = effects::named(&["bloom"]).remove(0);
    let taken = bloom.shrink(0, SIZE.map(|s| s as u32), &PARAMETERS) as usize;
    let difference = |a: &[Vec3], b: &[Vec3]| {
        a.iter().zip(b).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max)
    };
    let same = difference(&blur_at_scale(&rgba, taken), &light_added_by_effect(&bloom, &rgba));
    if same.is_nan() || same > 1e-4 {
        return Err(format!("the measured function is not the effect: {same} apart"));
    }
    let name =
        |shrink: usize| if shrink == 1 { "full size".to_string() } else { format!("{shrink} times smaller") };
    let mut choice = Choice::new("bloom", "How small is the image in which bloom is blurred?");
    choice.error_unit = "of white";
    choice.by_mean = true;
    choice.per = format!("image of {}×{} by the CPU's formulas, one thread", SIZE[0], SIZE[1]);
    choice.reference = "the Gaussian at full size in f64, to six standard deviations; mean over all channels of all pixels; sixty lamps and a line, \
                        up to 15 times as bright as white; three standard deviations are 36 pixels"
        .into();
    let mut cases = Vec::new();
    for shrink in [1, 2, 4, 8, 16, 32] {
        let mut error = ErrorStats::default();
        let mut at = 0;
        for (i, (got, exact)) in blur_at_scale(&rgba, shrink).iter().zip(&exact).enumerate() {
            for error_of in (got.as_dvec3() - *exact).abs().to_array() {
                if error.add(error_of) {
                    at = i;
                }
            }
        }
        let at = format!("pixel {}, {}", at % SIZE[0], at / SIZE[0]);
        choice.rows.push(Row::new(name(shrink)).error(error.worst, error.mean()).at(at));
        let rgba = &rgba;
        cases.push(Case::new(1, move || drop(black_box(blur_at_scale(black_box(rgba), shrink)))));
    }
    let nanos = interleaved(Clock::Thread, 3.0 * BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        &name(taken),
        "17 taps of the Gaussian, three standard deviations on each side, whatever the radius",
    );
    Ok(choice)
}
