//! Parallax mapping: the intersection of a view ray with a height map, by number of steps.

use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use glam::{DVec2, Vec2};
use std::array::from_fn;
use std::f64::consts::TAU;
use std::hint::black_box;

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Parallax mapping",
        text: "A view ray continues below the surface until it hits the height map, 0.05 of a width deep; \
               there the textures are read. Steps along the map's slopes (Premecz 2006) need few samples of \
               smooth heights, but are wrong behind steep ones; a search through even layers finds the \
               first hit if layers are as thin as the details. View rays up to 70° from straight on, half \
               of them at bumps, half at bricks. Eight pixels are stepped together, as in renderers; the \
               search ends when the last of them has hit the heights."
            .into(),
        choices: vec![compare_step_counts()],
        tables: Vec::new(),
        off_front: vec![(
            "parallax",
            "layers and steps cost nearly the same in this run; in others 8 layers took a third more time.",
        )],
    })
}

const MAP_DEPTH: f64 = 0.05;
const MAP_SIDE: usize = 256;
const LANES: usize = 8;

/// Height map with values from 0 to 1, and the z of its normals: 8-bit, bilinear, periodic.
struct HeightMap {
    texels: Vec<[f32; 2]>,
}

impl HeightMap {
    fn new(height: impl Fn(f64, f64) -> f64) -> HeightMap {
        let at = |x: usize, y: usize| {
            let h = height((x % MAP_SIDE) as f64 / MAP_SIDE as f64, (y % MAP_SIDE) as f64 / MAP_SIDE as f64);
            (h * 255.0).round() / 255.0
        };
        let mut texels = Vec::with_capacity(MAP_SIDE * MAP_SIDE);
        for y in 0..MAP_SIDE {
            for x in 0..MAP_SIDE {
                let slope = |a: f64, b: f64| (a - b) * 0.5 * MAP_SIDE as f64 * MAP_DEPTH;
                let (dx, dy) = (
                    slope(at(x + 1, y), at(x + MAP_SIDE - 1, y)),
                    slope(at(x, y + 1), at(x, y + MAP_SIDE - 1)),
                );
                let z = 1.0 / (1.0 + dx * dx + dy * dy).sqrt();
                texels.push([at(x, y) as f32, ((z * 127.5 + 127.5).round() / 127.5 - 1.0) as f32]);
            }
        }
        HeightMap { texels }
    }

    fn sample(&self, uv: Vec2) -> [f32; 2] {
        let p = (uv - uv.floor()) * MAP_SIDE as f32;
        let low = p.floor();
        let f = p - low;
        let texel = |x: f32, y: f32| {
            let (x, y) = ((low.x + x) as usize % MAP_SIDE, (low.y + y) as usize % MAP_SIDE);
            self.texels[y * MAP_SIDE + x]
        };
        let (a, b, c, d) = (texel(0.0, 0.0), texel(1.0, 0.0), texel(0.0, 1.0), texel(1.0, 1.0));
        let mix = |n: usize| {
            (a[n] * (1.0 - f.x) + b[n] * f.x) * (1.0 - f.y) + (c[n] * (1.0 - f.x) + d[n] * f.x) * f.y
        };
        [mix(0), mix(1)]
    }

    /// Depth of the surface relative to its highest level, at most 0.
    fn surface_depth(&self, uv: Vec2) -> f32 {
        (self.sample(uv)[0] - 1.0) * MAP_DEPTH as f32
    }

    /// Depth of the surface as in [`HeightMap::surface_depth`], in f64.
    fn reference_surface_depth(&self, uv: DVec2) -> f64 {
        let p = (uv - uv.floor()) * MAP_SIDE as f64;
        let low = p.floor();
        let f = p - low;
        let texel = |x: f64, y: f64| {
            let (x, y) = ((low.x + x) as usize % MAP_SIDE, (low.y + y) as usize % MAP_SIDE);
            f64::from(self.texels[y * MAP_SIDE + x][0])
        };
        let top = texel(0.0, 0.0) * (1.0 - f.x) + texel(1.0, 0.0) * f.x;
        let bottom = texel(0.0, 1.0) * (1.0 - f.x) + texel(1.0, 1.0) * f.x;
        (top * (1.0 - f.y) + bottom * f.y - 1.0) * MAP_DEPTH
    }
}

/// Depth of the first intersection of a view ray with the heights.
fn reference_depth(map: &HeightMap, at: DVec2, direction: DVec2) -> f64 {
    let above = |d: f64| d - map.reference_surface_depth(at + direction * d);
    let count = 4096;
    let depth = |i: u32| -MAP_DEPTH * f64::from(i) / f64::from(count);
    let first = (1..=count).find(|i| above(depth(*i)) <= 0.0).unwrap_or(count);
    let (mut high, mut low) = (depth(first - 1), depth(first));
    for _ in 0..40 {
        let middle = 0.5 * (high + low);
        if above(middle) <= 0.0 { low = middle } else { high = middle }
    }
    0.5 * (high + low)
}

/// View rays of neighboring pixels, which renderers and GPUs trace in lockstep.
struct RayGroup {
    map: usize,
    at: [Vec2; LANES],
    direction: [Vec2; LANES],
}

type Depths = [f32; LANES];

/// Search along slopes, as in `read_parallax` of scene.wgsl.
fn search_by_slopes(map: &HeightMap, group: &RayGroup, steps: usize) -> Depths {
    let mut depth = [0.0; LANES];
    for _ in 0..steps {
        for (lane, depth) in depth.iter_mut().enumerate() {
            let [height, z] = map.sample(group.at[lane] + group.direction[lane] * *depth);
            let below = (height - 1.0) * MAP_DEPTH as f32;
            *depth += (below - *depth) * z.clamp(0.0, 1.0);
        }
    }
    depth
}

/// Linear search in equal layers from the top until all rays have hit, then the secant between the last two layers.
fn search_by_layers(map: &HeightMap, group: &RayGroup, layers: usize) -> Depths {
    let step = -(MAP_DEPTH as f32) / layers as f32;
    let mut found = [-(MAP_DEPTH as f32); LANES];
    let mut left = [true; LANES];
    let mut before: Depths = from_fn(|lane| -map.surface_depth(group.at[lane]));
    for i in 1..=layers {
        let d = step * i as f32;
        for lane in 0..LANES {
            let above = d - map.surface_depth(group.at[lane] + group.direction[lane] * d);
            let share = before[lane] / (before[lane] - above).max(1e-9);
            let meets = left[lane] & (above <= 0.0);
            found[lane] = if meets { d - step * (1.0 - share) } else { found[lane] };
            left[lane] &= !meets;
            before[lane] = above;
        }
        if left == [false; LANES] {
            break;
        }
    }
    found
}

fn compare_step_counts() -> Choice {
    let mut choice = Choice::new("parallax", "How does a view ray find the height map?");
    choice.error_unit = "of the image's width";
    choice.by_mean = true;
    choice.reference = "the first hit in f64, by 4096 layers and 40 bisections, of 4000 view rays".into();
    choice.per = format!("view ray, computed with those of {} pixels beside it", LANES - 1);
    let bumps = |u: f64, v: f64| 0.5 + 0.5 * libm::sin(TAU * 4.0 * u) * libm::sin(TAU * 4.0 * v);
    let bricks = |u: f64, v: f64| {
        let row = libm::floor(v * 8.0);
        let edge = |x: f64| x.min(1.0 - x);
        let (x, y) = (u * 4.0 + 0.5 * (row % 2.0), v * 8.0);
        let from_edge = (edge(x - libm::floor(x)) * 2.0).min(edge(y - libm::floor(y)));
        ((from_edge - 0.05) / 0.08).clamp(0.0, 1.0)
    };
    let maps = [HeightMap::new(bumps), HeightMap::new(bricks)];
    let mut random = Random(61);
    let groups: Vec<(RayGroup, [f64; LANES])> = (0..500)
        .map(|i| {
            let v = loop {
                let v = random.direction();
                if v.z > libm::cos(70f64.to_radians()) {
                    break v;
                }
            };
            let (at, map) = (random.direction(), i % 2);
            // Two rows of four pixels, one texel apart.
            let pixel = |lane: usize| DVec2::new((lane % 4) as f64, (lane / 4) as f64) / MAP_SIDE as f64;
            let at = |lane: usize| DVec2::new(at.x, at.y) * 7.0 + pixel(lane);
            let direction = DVec2::new(v.x, v.y) / v.z;
            let group = RayGroup {
                map,
                at: from_fn(|lane| at(lane).as_vec2()),
                direction: [direction.as_vec2(); LANES],
            };
            (group, from_fn(|lane| reference_depth(&maps[map], at(lane), direction)))
        })
        .collect();
    type Find = fn(&HeightMap, &RayGroup, usize) -> Depths;
    let mut methods: Vec<(String, usize, Find)> =
        vec![("none: textures lie flat".into(), 0, search_by_slopes)];
    for steps in [1, 2, 4, 8, 16] {
        methods.push((
            format!("{steps} step{} by slopes", if steps == 1 { "" } else { "s" }),
            steps,
            search_by_slopes,
        ));
    }
    for layers in [4, 8, 16, 32, 64] {
        methods.push((format!("{layers} layers and a chord"), layers, search_by_layers));
    }
    let mut cases: Vec<Case> = Vec::new();
    for (name, count, find) in &methods {
        let mut error = ErrorStats::default();
        for (group, depths) in &groups {
            let got = find(&maps[group.map], group, *count);
            for lane in 0..LANES {
                let difference = (f64::from(got[lane]) - depths[lane]).abs();
                error.add(group.direction[lane].as_dvec2().length() * difference);
            }
        }
        choice.rows.push(Row::new(name.as_str()).error(error.worst, error.mean()));
        let (maps, groups) = (&maps, &groups);
        cases.push(Case::new(groups.len() * LANES, move || {
            for (group, _) in groups {
                black_box(find(&maps[group.map], black_box(group), *count));
            }
        }));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        "4 steps by slopes",
        "the same number of texels for every pixel, in less time than any layers; 8 layers are four times \
         as exact, for about a third more",
    );
    choice
}
