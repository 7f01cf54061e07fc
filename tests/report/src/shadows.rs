//! Shadow maps: resolution and filter kernel, against ray-cast shadows.

use crate::images::{renderers, stage};
use crate::rays::{Hit, Shapes};
use crate::{BUDGET_SECS, Random, Section};
use choreo_asset::Projection;
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_plugin::{Frame, Registry};
use choreo_render::scene_resources::mipmap::{linear_to_srgb8, srgb_to_linear_table};
use choreo_render::{CpuRenderer, Renderer};
use choreo_stage::SUN_ANGLE;
use glam::{DVec2, DVec3};
use std::cell::RefCell;
use std::f64::consts::PI;
use std::hint::black_box;

const SIZE: [u32; 2] = [640, 360];
/// Width in metres over which a shadow's edge is softened.
const SOFTNESS: f64 = 0.01;
/// Number of rays along a side of the softened area.
const RAYS_PER_SIDE: usize = 6;

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Shadow maps",
        text: "A fence of bars 3 cm wide, a ball and a leaning plank under a sun: thin objects, round \
               objects, a gap that narrows. The reference is rays from the surface in each pixel, many of \
               them where an edge is soft. A map that is too coarse blurs: bars melt together, and shadows \
               detach from the objects that cast them."
            .into(),
        choices: vec![compare_map_sizes()?, compare_kernels()?],
        tables: vec![extents_table()?],
        off_front: vec![(
            "shadow_kernel",
            "kernels of one or four comparisons are cheaper, but show texels as stairs at the requested \
             width of the edge.",
        )],
    })
}

/// The scene with these shadow options and this intensity of the sun.
fn moment(shadow: &str, intensity: f64, registry: &Registry) -> Result<Moment, String> {
    moment_on(12.0, "", shadow, intensity, registry)
}

/// The scene on a ground of this width in metres. `more`: further lines of the script.
fn moment_on(
    ground: f64,
    more: &str,
    shadow: &str,
    intensity: f64,
    registry: &Registry,
) -> Result<Moment, String> {
    let text = format!(
        r##"
        stage(#{{ length: 1.0, background: "#8aa0b8", view: "none" }});
        cast("floor", shape("plane", #{{ size: {ground:?}, color: "#d8d4cc" }}));
        let bar = shape("box", #{{ size: [0.03, 1.2, 0.03], color: "#b88a5a" }});
        for i in 0..16 {{ cast("bar " + i, bar).at(-1.2 + i * 0.12, 0.0, -0.3); }}
        cast("rail", shape("box", #{{ size: [2.0, 0.05, 0.04], color: "#b88a5a" }})).at(-0.3, 0.9, -0.3);
        cast("ball", shape("sphere", #{{ size: 0.6, color: "#c04a3a" }})).at(1.2, 0.0, 0.2);
        cast("plank", shape("box", #{{ size: [0.3, 1.4, 0.02], color: "#6a8a5a" }})).at(0.2, 0.0, 0.5).rotate(25.0, 0.0, 0.0);
        sun(#{{ direction: [-0.5, -1.0, 0.62], intensity: {intensity}, shadow: {shadow} }});
        {more}
        camera("front").fov(34).at(0.6, 2.2, 4.8).look_at([0.1, 0.35, 0.3]);
        "##
    );
    let stage = stage(&text, registry)?;
    Moment::new(&stage, Time::ZERO, registry.effects()).map_err(|e| e.to_string())
}

fn draw_moment(moment: &Moment, renderer: &mut dyn Renderer) -> Result<Frame, String> {
    renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
    moment.draw(renderer, SIZE, 1).map_err(|e| e.to_string())
}

/// Unit vector towards the sun.
fn to_sun() -> DVec3 {
    -DVec3::new(-0.5, -1.0, 0.62).normalize()
}

/// Lit fraction of a square of the surface that is `width` wide as seen from the sun, by rays from `side` × `side` points.
fn lit_fraction(shapes: &Shapes, hit: &Hit, width: f64, side: usize) -> f64 {
    let l = to_sun();
    let nl = hit.normal.dot(l);
    if nl <= 0.0 {
        return 0.0;
    }
    let (across, up) = perpendicular_axes(l);
    let mut sum = 0.0;
    for i in 0..side * side {
        let part = |i: usize| ((i as f64 + 0.5) / side as f64 - 0.5) * width;
        let off = across * part(i % side) + up * part(i / side);
        // Project along the light direction onto the plane of the surface.
        let at = hit.point + off - l * (off.dot(hit.normal) / nl);
        sum += f64::from(u8::from(!shapes.is_blocked(at + hit.normal * 1e-5, l)));
    }
    sum / (side * side) as f64
}

fn perpendicular_axes(l: DVec3) -> (DVec3, DVec3) {
    let across = l.cross(DVec3::Y).normalize();
    (across, across.cross(l))
}

/// First hit of the camera ray through the center of each pixel.
fn visible_hits(moment: &Moment, shapes: &Shapes) -> Vec<Option<Hit>> {
    let camera = &moment.snapshot.camera;
    let Projection::Perspective { yfov, .. } = camera.projection else { return Vec::new() };
    let [width, height] = SIZE.map(f64::from);
    let tan = libm::tan(f64::from(yfov) * 0.5);
    let at = |i: usize| {
        let (x, y) = ((i % SIZE[0] as usize) as f64 + 0.5, (i / SIZE[0] as usize) as f64 + 0.5);
        let direction = DVec3::new((x * 2.0 - width) / height * tan, (1.0 - y * 2.0 / height) * tan, -1.0);
        let direction = camera.world_from_view.transform_vector3(direction).normalize();
        shapes.first_hit(camera.world_from_view.translation, direction)
    };
    (0..(SIZE[0] * SIZE[1]) as usize).map(at).collect()
}

/// Reference image, computed with rays.
struct ReferenceImage {
    hits: Vec<Option<Hit>>,
    rgba: Vec<u8>,
}

impl ReferenceImage {
    /// `share`: computes the fraction of the sun's light that reaches a hit.
    fn of(
        registry: &Registry,
        cpu: &mut CpuRenderer,
        share: impl Fn(&Shapes, &Hit) -> f64,
    ) -> Result<ReferenceImage, String> {
        let dark = moment("false", 0.0, registry)?;
        let shapes = Shapes::of(&dark.stage, &dark.snapshot);
        let unlit = draw_moment(&dark, cpu)?;
        let bright = draw_moment(&moment("false", 2.0 * PI, registry)?, cpu)?;
        let linear = srgb_to_linear_table();
        let hits = visible_hits(&dark, &shapes);
        let shares: Vec<f64> = hits.iter().map(|h| h.as_ref().map_or(0.0, |h| share(&shapes, h))).collect();
        // Interpolates in linear light between the image without the sun and the image without shadows.
        let rgba = (0..unlit.rgba.len())
            .map(|i| {
                let [a, b] = [&unlit, &bright].map(|f| f64::from(linear[usize::from(f.rgba[i])]));
                if i % 4 == 3 { 255 } else { linear_to_srgb8((a + (b - a) * shares[i / 4]) as f32) }
            })
            .collect();
        Ok(ReferenceImage { hits, rgba })
    }
}

/// Sizes of a frame's shadow maps.
fn shadow_map_sizes(moment: &Moment) -> String {
    let plan = moment.plan(SIZE, 1);
    let views = plan.shadow_maps.iter().flat_map(|s| &s.views);
    let sizes = views.map(|v| format!("{}×{} of {:.1} mm", v.size[0], v.size[1], v.texel * 1e3));
    sizes.collect::<Vec<_>>().join(", ")
}

/// Fraction of the sun's disc that is visible from a point, by rays to those cells of a grid that lie in the disc.
fn lit_fraction_by_disc(shapes: &Shapes, hit: &Hit) -> f64 {
    let l = to_sun();
    if hit.normal.dot(l) <= 0.0 {
        return 0.0;
    }
    let (across, up) = perpendicular_axes(l);
    let part = |i: usize| ((i as f64 + 0.5) / RAYS_PER_SIDE as f64 - 0.5) * 2.0;
    let cells = (0..RAYS_PER_SIDE * RAYS_PER_SIDE)
        .map(|i| DVec2::new(part(i % RAYS_PER_SIDE), part(i / RAYS_PER_SIDE)));
    let (mut lit, mut all) = (0.0, 0.0);
    for cell in cells.filter(|c| c.length() <= 1.0) {
        let direction = l + (across * cell.x + up * cell.y) * libm::tan(0.5 * f64::from(SUN_ANGLE));
        all += 1.0;
        lit += f64::from(u8::from(!shapes.is_blocked(hit.point + hit.normal * 1e-5, direction.normalize())));
    }
    lit / all
}

/// The default shadow by extent of the scene.
fn extents_table() -> Result<Table, String> {
    let registry = choreo::registry();
    let mut cpu = CpuRenderer::new(registry.effects());
    let truth = ReferenceImage::of(&registry, &mut cpu, lit_fraction_by_disc)?;
    // Only the area that the smallest ground covers is compared.
    let near = |pixel: usize| truth.hits[pixel].as_ref().is_some_and(|hit| hit.point.length() < 4.0);
    let mut table = Table::new(
        "By the extent of the scene: the default shadow within 4 m, against rays to the sun's disc, steps of 255",
        &[("ground", "way"), (">worst", "error"), (">mean", "error"), ("maps", "note")],
    );
    let far_box = r#"cast("far", shape("box", #{ size: 0.5 })).at(0.0, 0.0, -5000.0);"#;
    for (name, ground, more) in [
        ("12 m", 12.0, ""),
        ("100 m", 1e2, ""),
        ("1 km", 1e3, ""),
        ("10 km", 1e4, ""),
        ("100 km", 1e5, ""),
        ("100 km, and a box of 0.5 m 5 km away", 1e5, far_box),
    ] {
        let moment = moment_on(ground, more, "true", 2.0 * PI, &registry)?;
        let image = draw_moment(&moment, &mut cpu)?;
        let mut error = ErrorStats::default();
        for (i, (got, exact)) in image.rgba.iter().zip(&truth.rgba).enumerate() {
            if i % 4 != 3 && near(i / 4) {
                error.add(f64::from(got.abs_diff(*exact)));
            }
        }
        table.rows.push(vec![
            Cell::text(name),
            Cell::number(quantity(error.worst), error.worst),
            Cell::number(quantity(error.mean()), error.mean()),
            Cell::text(shadow_map_sizes(&moment)),
        ]);
    }
    Ok(table)
}

fn compare_map_sizes() -> Result<Choice, String> {
    let registry = choreo::registry();
    let mut cpu = CpuRenderer::new(registry.effects());
    let truth = ReferenceImage::of(&registry, &mut cpu, |shapes, hit| {
        lit_fraction(shapes, hit, SOFTNESS, RAYS_PER_SIDE)
    })?
    .rgba;
    let mut choice = Choice::new("shadow_size", "How many texels may each side of a sun's shadow map have?");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = format!(
        "the same image with the lit part of each pixel by {} rays, {}×{}; edges as wide as requested, \
         {:.0} mm",
        RAYS_PER_SIDE * RAYS_PER_SIDE,
        SIZE[0],
        SIZE[1],
        SOFTNESS * 1e3
    );
    let mut moments = Vec::new();
    let with_size = |size: u32| format!("#{{ size: {size}, softness: {SOFTNESS} }}");
    for (name, shadow) in [
        ("no shadow", "false".to_string()),
        ("256", with_size(256)),
        ("512", with_size(512)),
        ("1024", with_size(1024)),
        ("2048", with_size(2048)),
        ("4096", with_size(4096)),
    ] {
        let moment = moment(&shadow, 2.0 * PI, &registry)?;
        let picture = draw_moment(&moment, &mut cpu)?;
        let mut error = ErrorStats::default();
        for (got, exact) in
            picture.rgba.iter().zip(&truth).enumerate().filter(|(i, _)| i % 4 != 3).map(|p| p.1)
        {
            error.add(f64::from(got.abs_diff(*exact)));
        }
        let pixel = error.worst_at / 3;
        choice.rows.push(
            Row::new(name)
                .error(error.worst, error.mean())
                .at(format!("pixel {}, {}", pixel % SIZE[0] as usize, pixel / SIZE[0] as usize))
                .note(shadow_map_sizes(&moment)),
        );
        moments.push(moment);
    }
    let Some((name, renderer)) = renderers(&registry).pop() else { return Err("no renderer".into()) };
    choice.per = format!("image by {name}, {}", Clock::Process.words());
    let renderer = RefCell::new(renderer);
    let mut cases = Vec::new();
    for moment in &moments {
        let renderer = &renderer;
        cases.push(Case::new(1, move || {
            let _ = black_box(draw_moment(moment, renderer.borrow_mut().as_mut()));
        }));
    }
    let nanos = interleaved(Clock::Process, 6.0 * BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        "2048",
        "the default: a map is only as large as its softness needs in the current view, and more makes no \
         visible difference",
    );
    Ok(choice)
}

/// Depth map along the direction of the sun: depth of the first hit in each texel; greater is nearer to the sun.
struct DepthMap {
    origin: DVec2,
    texel: f64,
    side: usize,
    depth: Vec<f32>,
    /// Averages over 3 × 3 texels of depth and squared depth, as used by variance shadow maps.
    moments: Vec<[f32; 2]>,
}

impl DepthMap {
    fn of(shapes: &Shapes, middle: DVec3, width: f64, texel: f64) -> DepthMap {
        let l = to_sun();
        let (across, up) = perpendicular_axes(l);
        let side = (width / texel).ceil() as usize;
        let origin = DVec2::new(across.dot(middle), up.dot(middle)) - width * 0.5;
        const START_DISTANCE: f64 = 20.0;
        let at = |i: usize| {
            let p = origin + (DVec2::new((i % side) as f64, (i / side) as f64) + 0.5) * texel;
            let start = across * p.x + up * p.y + l * START_DISTANCE;
            shapes.first_hit(start, -l).map_or(-1e3, |hit| hit.point.dot(l) as f32)
        };
        let depth: Vec<f32> = (0..side * side).map(at).collect();
        let mean = |i: usize| {
            let (x, y) = ((i % side) as i64, (i / side) as i64);
            let mut sum = [0.0; 2];
            for (dy, dx) in (0..9).map(|k| (k / 3 - 1, k % 3 - 1)) {
                let clamp = |v: i64| v.clamp(0, side as i64 - 1) as usize;
                let d = depth[clamp(y + dy) * side + clamp(x + dx)];
                sum = [sum[0] + d / 9.0, sum[1] + d * d / 9.0];
            }
            sum
        };
        let moments = (0..side * side).map(mean).collect();
        DepthMap { origin, texel, side, depth, moments }
    }

    /// Texel position and depth of a hit, offset from the surface as in the renderer.
    fn place(&self, hit: &Hit) -> [f32; 3] {
        let l = to_sun();
        let (across, up) = perpendicular_axes(l);
        let nl = hit.normal.dot(l).clamp(0.0, 1.0);
        let moved =
            hit.point + hit.normal * (3.0 * (1.0 - nl * nl).sqrt() * self.texel) + l * (0.25 * self.texel);
        let p = (DVec2::new(across.dot(moved), up.dot(moved)) - self.origin) / self.texel;
        [p.x as f32, p.y as f32, moved.dot(l) as f32]
    }

    fn lit_at_texel(&self, x: usize, y: usize, depth: f32) -> f32 {
        f32::from(u8::from(depth >= self.depth[y * self.side + x]))
    }

    /// Fraction that is lit by percentage-closer filtering (PCF): a box of N × N texels over N + 1 × N + 1 comparisons.
    fn lit_by_pcf<const N: usize>(&self, [x, y, depth]: [f32; 3]) -> f32 {
        let reach = N as f32 * 0.5;
        let (left, top) = ((x - reach).floor(), (y - reach).floor());
        let (fx, fy) = (x - reach - left, y - reach - top);
        let mut sum = 0.0;
        for j in 0..=N {
            let wy = if j == 0 {
                1.0 - fy
            } else if j == N {
                fy
            } else {
                1.0
            };
            let mut row = 0.0;
            for i in 0..=N {
                let wx = if i == 0 {
                    1.0 - fx
                } else if i == N {
                    fx
                } else {
                    1.0
                };
                row += wx * self.lit_at_texel(left as usize + i, top as usize + j, depth);
            }
            sum += wy * row;
        }
        sum / (N * N) as f32
    }

    /// Fraction that is lit by Chebyshev's bound (Donnelly & Lauritzen, "Variance Shadow Maps", 2006), bilinear over four texels.
    fn lit_by_variance(&self, [x, y, depth]: [f32; 3]) -> f32 {
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (fx, fy) = (x - 0.5 - left, y - 0.5 - top);
        let at = |i: usize, j: usize| self.moments[(top as usize + j) * self.side + left as usize + i];
        let mix = |c: usize| {
            (at(0, 0)[c] * (1.0 - fx) + at(1, 0)[c] * fx) * (1.0 - fy)
                + (at(0, 1)[c] * (1.0 - fx) + at(1, 1)[c] * fx) * fy
        };
        let (mean, square) = (mix(0), mix(1));
        if depth >= mean {
            return 1.0;
        }
        let variance = (square - mean * mean).max(1e-6);
        let off = mean - depth;
        variance / (variance + off * off)
    }
}

fn compare_kernels() -> Result<Choice, String> {
    let registry = choreo::registry();
    let scene = moment("false", 2.0 * PI, &registry)?;
    let shapes = Shapes::of(&scene.stage, &scene.snapshot);
    // The area is behind the fence and under the plank, away from the border of the map.
    let (middle, reach) = (DVec3::new(-0.4, 0.0, 0.1), 0.5);
    let mut random = Random(31);
    let mut places = Vec::new();
    while places.len() < 6000 {
        let from = middle + DVec3::new(random.signed() * reach, 3.0, random.signed() * reach);
        // Only points near a shadow's edge are used: elsewhere all kernels agree.
        if let Some(hit) = shapes.first_hit(from, DVec3::NEG_Y) {
            let part = lit_fraction(&shapes, &hit, 3.0 * SOFTNESS, 4);
            if part > 0.0 && part < 1.0 {
                places.push((lit_fraction(&shapes, &hit, SOFTNESS, 16), hit));
            }
        }
    }
    let width = 3.2;
    let third = DepthMap::of(&shapes, middle, width, SOFTNESS / 3.0);
    let fifth = DepthMap::of(&shapes, middle, width, SOFTNESS / 5.0);
    let whole = DepthMap::of(&shapes, middle, width, SOFTNESS);
    type Kernel = fn(&DepthMap, [f32; 3]) -> f32;
    let methods: [(&str, &DepthMap, Kernel); 6] = [
        ("1 texel, a third of the edge wide", &third, |m, p| {
            m.lit_at_texel(p[0] as usize, p[1] as usize, p[2])
        }),
        ("2 × 2, texels as wide as the edge", &whole, |m, p| m.lit_by_pcf::<1>(p)),
        ("3 × 3, a third of the edge wide", &third, |m, p| m.lit_by_pcf::<2>(p)),
        ("4 × 4, a third of the edge wide", &third, |m, p| m.lit_by_pcf::<3>(p)),
        ("6 × 6, a fifth of the edge wide", &fifth, |m, p| m.lit_by_pcf::<5>(p)),
        ("variance, a third of the edge wide", &third, |m, p| m.lit_by_variance(p)),
    ];
    let mut choice = Choice::new("shadow_kernel", "With which kernel is a shadow map sampled?");
    choice.error_unit = "of the light";
    choice.by_mean = true;
    choice.per = "lookup, without finding the place in the map".into();
    choice.reference = "6,000 places near the edges of shadows; the lit part of a square as wide as the \
                        edge by 256 rays; maps whose depths are computed by rays, too"
        .into();
    let mut cases = Vec::new();
    for (name, map, kernel) in methods {
        let at: Vec<[f32; 3]> = places.iter().map(|(_, hit)| map.place(hit)).collect();
        let mut error = ErrorStats::default();
        for ((exact, _), at) in places.iter().zip(&at) {
            error.add((f64::from(kernel(map, *at)) - exact).abs());
        }
        choice
            .rows
            .push(Row::new(name).error(error.worst, error.mean()).note(format!("map of {}²", map.side)));
        cases.push(Case::new(at.len(), move || {
            black_box(at.iter().map(|p| kernel(map, black_box(*p))).sum::<f32>());
        }));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        "4 × 4, a third of the edge wide",
        "as wide as requested at any place of the grid; a finer map costs more than the kernel, since it \
         draws all casters",
    );
    Ok(choice)
}
