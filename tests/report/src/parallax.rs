//! Heights that are seen as depth: where a look meets them, in steps.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_bench::truth::Spread;
use glam::{DVec2, Vec2};
use std::f64::consts::TAU;
use std::hint::black_box;

pub fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Heights seen as depth",
        text: "A look at a surface goes on below it until it meets the heights of its map, 0.05 of a width deep; there the textures are read. \
               Steps towards it by the map's slopes (Premecz 2006) need few samples of smooth heights, and are wrong behind steep ones; a search \
               through even layers finds the first meeting where layers are as thin as what stands there. Looks up to 70° from straight on, \
               half of them at bumps, half at bricks."
            .into(),
        choices: vec![steps()],
        tables: Vec::new(),
        off_front: vec![(
            "parallax",
            "8 layers and a chord cost the same on this processor and are four times nearer; the slopes' steps read as many samples for every pixel and end \
             nowhere early, which suits devices that run pixels in step, and on one of those it has not been measured.",
        )],
    })
}

const DEPTH: f64 = 0.05;
const SIDE: usize = 256;

/// Heights from 0 to 1 and the z of their normals, bilinear, repeated, as bytes would have them.
struct Map {
    texels: Vec<[f32; 2]>,
}

impl Map {
    fn new(height: impl Fn(f64, f64) -> f64) -> Map {
        let at = |x: usize, y: usize| {
            let h = height((x % SIDE) as f64 / SIDE as f64, (y % SIDE) as f64 / SIDE as f64);
            (h * 255.0).round() / 255.0
        };
        let mut texels = Vec::with_capacity(SIDE * SIDE);
        for y in 0..SIDE {
            for x in 0..SIDE {
                let slope = |a: f64, b: f64| (a - b) * 0.5 * SIDE as f64 * DEPTH;
                let (dx, dy) =
                    (slope(at(x + 1, y), at(x + SIDE - 1, y)), slope(at(x, y + 1), at(x, y + SIDE - 1)));
                let z = 1.0 / (1.0 + dx * dx + dy * dy).sqrt();
                texels.push([at(x, y) as f32, ((z * 127.5 + 127.5).round() / 127.5 - 1.0) as f32]);
            }
        }
        Map { texels }
    }

    fn sample(&self, uv: Vec2) -> [f32; 2] {
        let p = (uv - uv.floor()) * SIDE as f32;
        let low = p.floor();
        let f = p - low;
        let texel = |x: f32, y: f32| {
            let (x, y) = ((low.x + x) as usize % SIDE, (low.y + y) as usize % SIDE);
            self.texels[y * SIDE + x]
        };
        let (a, b, c, d) = (texel(0.0, 0.0), texel(1.0, 0.0), texel(0.0, 1.0), texel(1.0, 1.0));
        let mix = |n: usize| {
            (a[n] * (1.0 - f.x) + b[n] * f.x) * (1.0 - f.y) + (c[n] * (1.0 - f.x) + d[n] * f.x) * f.y
        };
        [mix(0), mix(1)]
    }

    /// Depth of the surface below its highest, at most 0.
    fn below(&self, uv: Vec2) -> f32 {
        (self.sample(uv)[0] - 1.0) * DEPTH as f32
    }

    /// The same in f64.
    fn below_exactly(&self, uv: DVec2) -> f64 {
        let p = (uv - uv.floor()) * SIDE as f64;
        let low = p.floor();
        let f = p - low;
        let texel = |x: f64, y: f64| {
            let (x, y) = ((low.x + x) as usize % SIDE, (low.y + y) as usize % SIDE);
            f64::from(self.texels[y * SIDE + x][0])
        };
        let top = texel(0.0, 0.0) * (1.0 - f.x) + texel(1.0, 0.0) * f.x;
        let bottom = texel(0.0, 1.0) * (1.0 - f.x) + texel(1.0, 1.0) * f.x;
        (top * (1.0 - f.y) + bottom * f.y - 1.0) * DEPTH
    }
}

/// A ray: its map, its position on the map, and its displacement for each metre down.
type Look = (usize, DVec2, DVec2);

/// First meeting of a look with the heights, as the depth there.
fn truth(map: &Map, at: DVec2, way: DVec2) -> f64 {
    let above = |d: f64| d - map.below_exactly(at + way * d);
    let count = 4096;
    let depth = |i: u32| -DEPTH * f64::from(i) / f64::from(count);
    let first = (1..=count).find(|i| above(depth(*i)) <= 0.0).unwrap_or(count);
    let (mut high, mut low) = (depth(first - 1), depth(first));
    for _ in 0..40 {
        let middle = 0.5 * (high + low);
        if above(middle) <= 0.0 { low = middle } else { high = middle }
    }
    0.5 * (high + low)
}

/// The search of `read_relief` of scene.wgsl.
fn by_slopes(map: &Map, at: Vec2, way: Vec2, steps: usize) -> f32 {
    let mut depth = 0.0;
    for _ in 0..steps {
        let [height, z] = map.sample(at + way * depth);
        let below = (height - 1.0) * DEPTH as f32;
        depth += (below - depth) * z.clamp(0.0, 1.0);
    }
    depth
}

/// Even layers from the top, then the chord between the last two.
fn by_layers(map: &Map, at: Vec2, way: Vec2, layers: usize) -> f32 {
    let step = -(DEPTH as f32) / layers as f32;
    let mut before = (0.0, -map.below(at));
    for i in 1..=layers {
        let d = step * i as f32;
        let above = d - map.below(at + way * d);
        if above <= 0.0 {
            let share = before.1 / (before.1 - above).max(1e-9);
            return before.0 + (d - before.0) * share;
        }
        before = (d, above);
    }
    -(DEPTH as f32)
}

fn steps() -> Choice {
    let mut choice = Choice::new("parallax", "How does a look find the heights?");
    choice.error_unit = "of the image's width";
    choice.by_mean = true;
    choice.reference = "the first meeting in f64, by 4096 layers and 40 halvings, of 4000 looks".into();
    choice.per = "look".into();
    let bumps = |u: f64, v: f64| 0.5 + 0.5 * libm::sin(TAU * 4.0 * u) * libm::sin(TAU * 4.0 * v);
    let bricks = |u: f64, v: f64| {
        let row = libm::floor(v * 8.0);
        let edge = |x: f64| x.min(1.0 - x);
        let (x, y) = (u * 4.0 + 0.5 * (row % 2.0), v * 8.0);
        let from_edge = (edge(x - libm::floor(x)) * 2.0).min(edge(y - libm::floor(y)));
        ((from_edge - 0.05) / 0.08).clamp(0.0, 1.0)
    };
    let maps = [Map::new(bumps), Map::new(bricks)];
    let mut random = Random(61);
    let looks: Vec<(Look, f64)> = (0..4000)
        .map(|i| {
            let v = loop {
                let v = random.direction();
                if v.z > libm::cos(70f64.to_radians()) {
                    break v;
                }
            };
            let at = random.direction();
            let look = (i % 2, DVec2::new(at.x, at.y) * 7.0, DVec2::new(v.x, v.y) / v.z);
            (look, truth(&maps[i % 2], look.1, look.2))
        })
        .collect();
    type Find = fn(&Map, Vec2, Vec2, usize) -> f32;
    let mut ways: Vec<(String, usize, Find)> = vec![("none: textures lie flat".into(), 0, by_slopes)];
    for steps in [1, 2, 4, 8, 16] {
        ways.push((format!("{steps} step{} by slopes", if steps == 1 { "" } else { "s" }), steps, by_slopes));
    }
    for layers in [8, 16, 32, 64] {
        ways.push((format!("{layers} layers and a chord"), layers, by_layers));
    }
    let mut cases: Vec<Case> = Vec::new();
    for (name, count, find) in &ways {
        let mut error = Spread::default();
        for ((map, at, way), depth) in &looks {
            let got = find(&maps[*map], at.as_vec2(), way.as_vec2(), *count);
            error.add(way.length() * (f64::from(got) - depth).abs());
        }
        choice.rows.push(Row::new(name.as_str()).error(error.worst, error.mean()));
        let (maps, looks) = (&maps, &looks);
        cases.push(Case::new(looks.len(), move || {
            for ((map, at, way), _) in looks {
                black_box(find(&maps[*map], black_box(at.as_vec2()), way.as_vec2(), *count));
            }
        }));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        "4 steps by slopes",
        "as many samples for every pixel, without a branch to be masked; even layers are better at steep heights",
    );
    choice
}
