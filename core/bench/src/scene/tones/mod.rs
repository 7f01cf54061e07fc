//! The choice of tone mapping: curves fitted to the transforms of ACES and AgX, against those transforms in f64.

mod reference;

use super::{MeasuredScene, SceneChoices};
use crate::error::BenchError;
use crate::moment::Moment;
use crate::plots::{Choice, Row};
use crate::reference::ErrorStats;
use crate::timing::{Case, Clock, interleaved};
use choreo_asset::srgb_from_linear;
use choreo_render::scene_resources::mipmap::srgb_to_linear_table;
use choreo_render::{CpuRenderer, Renderer};
use choreo_stage::ViewTransform;
use glam::{DVec3, Vec3, Vec4};
use std::hint::black_box;
use std::sync::Arc;

/// A color in linear sRGB, and its name.
pub type Light = (String, Vec3);

/// Largest size in pixels of the image from which colors are taken.
const MAX_PIXELS: u32 = 160 * 90;
/// Stops below the scene's exposure at which images are drawn, so that every pixel is unclipped in one of them.
const BRACKETS: [f32; 3] = [0.0, 4.0, 8.0];

/// Compares the transforms that the scene uses, on the colors of its image.
pub fn choices(scene: &MeasuredScene) -> Result<SceneChoices, BenchError> {
    let snapshot = scene.stage.at(scene.at)?;
    let tonemap = snapshot.effects.iter().find(|e| scene.stage.effects[e.effect].plugin == "tonemap");
    let parameter = |name: &str| {
        let found = tonemap?.parameters.iter().find(|(parameter, _)| parameter == name);
        Some(found.map_or(0.0, |(_, value)| *value))
    };
    // The effect stands in for the stage's view transform; its curves are aces, agx, neutral and none.
    let (aces_runs, agx_runs) = match parameter("curve") {
        Some(curve) => (curve < 0.5, (0.5..1.5).contains(&curve)),
        None => (false, scene.stage.settings.view_transform == ViewTransform::Agx),
    };
    if !aces_runs && !agx_runs {
        let why = "the scene uses neither AgX nor ACES; the other view transforms are computed exactly";
        return Ok(SceneChoices::None(why.into()));
    }
    let lights = scene_lights(scene, parameter("exposure").unwrap_or(0.0))?;
    let of = format!("{} pixels of the scene's image", lights.len());
    let mut choices = Vec::new();
    if aces_runs {
        choices.push(aces(&lights, &of, scene.budget_secs));
    }
    if agx_runs {
        choices.push(agx(&lights, &of, scene.budget_secs));
    }
    Ok(SceneChoices::Choices(choices))
}

/// Linear light of the scene's pixels, from raw images at several exposures, `further` stops brighter than the camera's.
fn scene_lights(scene: &MeasuredScene, further: f64) -> Result<Vec<Light>, BenchError> {
    let smaller = (1..=128).find(|n| (scene.size[0] / n) * (scene.size[1] / n) <= MAX_PIXELS).unwrap_or(128);
    let size = scene.size.map(|side| (side / smaller).max(16));
    let linear = srgb_to_linear_table();
    let mut lights: Vec<Light> = Vec::new();
    for (i, stops) in BRACKETS.iter().enumerate() {
        let mut stage = (**scene.stage).clone();
        stage.settings.view_transform = ViewTransform::None;
        stage.settings.exposure += further as f32 - stops;
        stage.effects.clear();
        let moment = Moment::new(&Arc::new(stage), scene.at, &[])?;
        let mut renderer = CpuRenderer::new(&[]);
        renderer.load(moment.resources.clone())?;
        let frame = moment.draw(&mut renderer, size, 1)?;
        for (pixel, code) in frame.rgba.as_chunks::<4>().0.iter().enumerate() {
            let light =
                Vec3::from_array(std::array::from_fn(|c| linear[usize::from(code[c])])) * libm::exp2f(*stops);
            let place = || format!("pixel {}, {}", pixel as u32 % size[0], pixel as u32 / size[0]);
            match lights.get_mut(pixel) {
                None => lights.push((place(), light)),
                // The pixel was clipped at the exposure before.
                Some(known) if known.1.max_element() >= libm::exp2f(BRACKETS[i - 1]) => known.1 = light,
                Some(_) => {}
            }
        }
    }
    Ok(lights)
}

/// sRGB code of 0 to 255.
fn srgb_code(linear: f64) -> f64 {
    255.0 * srgb_from_linear(linear.clamp(0.0, 1.0))
}

/// Adds a row for each method of one transform: its errors in codes, and its cost per pixel.
fn add_rows(
    choice: &mut Choice,
    lights: &[Light],
    budget_secs: f64,
    truth: fn(DVec3) -> DVec3,
    methods: &[(&str, &dyn Fn(Vec3) -> Vec3)],
) {
    choice.error_unit = "codes of 255";
    choice.per = "pixel".into();
    let exact: Vec<DVec3> = lights.iter().map(|(_, c)| truth(c.as_dvec3())).collect();
    for (name, method) in methods {
        let mut error = ErrorStats::default();
        for ((_, light), exact) in lights.iter().zip(&exact) {
            let got = method(*light).as_dvec3();
            error.add((0..3).map(|c| (srgb_code(got[c]) - srgb_code(exact[c])).abs()).fold(0.0, f64::max));
        }
        let at = lights[error.worst_at].0.clone();
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).at(at));
    }
    let mut cases: Vec<Case> = methods
        .iter()
        .map(|(_, method)| {
            Case::new(lights.len(), move || {
                for (_, light) in lights {
                    black_box(method(black_box(*light)));
                }
            })
        })
        .collect();
    let nanos = interleaved(Clock::Thread, budget_secs, &mut cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
}

/// The formulas of the effect `tonemap`: ACES for a curve below 0.5, else AgX.
pub fn effect(curve: f32, light: Vec3) -> Vec3 {
    let light = light.clamp(Vec3::ZERO, Vec3::splat(16_777_216.0));
    let mapped = if curve < 0.5 { aces_hill(light) } else { agx_wrensch(light) };
    mapped.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Evaluates [`effect`] with curve 0 for many colors, in loops over eight, which compilers turn into vector instructions.
pub fn effect_of_eights(colors: &[Vec4]) -> Vec<Vec4> {
    type Eight = [f32; 8];
    fn rows(m: &[[f32; 3]; 3], [x, y, z]: &[Eight; 3]) -> [Eight; 3] {
        m.map(|r| std::array::from_fn(|i| r[0] * x[i] + r[1] * y[i] + r[2] * z[i]))
    }
    let mut out = colors.to_vec();
    for eight in out.chunks_mut(8) {
        let light =
            |channel: usize, i: usize| eight.get(i).map_or(0.0, |c| c[channel].clamp(0.0, 16_777_216.0));
        let light: [Eight; 3] = std::array::from_fn(|c| std::array::from_fn(|i| light(c, i)));
        let curve = rows(&HILL_IN, &light).map(|channel| channel.map(hill_curve));
        let mapped = rows(&HILL_OUT, &curve);
        for (i, color) in eight.iter_mut().enumerate() {
            *color = Vec4::new(mapped[0][i], mapped[1][i], mapped[2][i], color.w);
            *color = color.truncate().clamp(Vec3::ZERO, Vec3::ONE).extend(color.w);
        }
    }
    out
}

fn rows(m: [[f32; 3]; 3], v: Vec3) -> Vec3 {
    let dot = |r: [f32; 3]| r[0] * v.x + r[1] * v.y + r[2] * v.z;
    Vec3::new(dot(m[0]), dot(m[1]), dot(m[2]))
}

/// Stephen Hill's fit of the ACES reference and output transforms, sRGB to sRGB (BakingLab, ACES.hlsl).
fn aces_hill(color: Vec3) -> Vec3 {
    rows(HILL_OUT, Vec3::from(rows(HILL_IN, color).to_array().map(hill_curve)))
}

const HILL_IN: [[f32; 3]; 3] =
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
const HILL_OUT: [[f32; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

#[inline(always)]
fn hill_curve(v: f32) -> f32 {
    (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081)
}

/// Troy Sobotka's AgX by Benjamin Wrensch's polynomial ("Minimal AgX Implementation", 2023): 16.5 stops, mid gray at 10 of them.
fn agx_wrensch(color: Vec3) -> Vec3 {
    let inset = rows(
        [
            [0.842_479_05, 0.0784336, 0.079_223_745],
            [0.042_328_242, 0.878_468_6, 0.079_166_13],
            [0.042_375_655, 0.0784336, 0.879_143],
        ],
        color,
    );
    let stops = |v: f32| ((libm::log2f(v.max(1e-10)) + 12.47393) / 16.5).clamp(0.0, 1.0);
    let x = Vec3::new(stops(inset.x), stops(inset.y), stops(inset.z));
    let x2 = x * x;
    let x4 = x2 * x2;
    let y =
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let out = rows(
        [
            [1.196_879, -0.098_020_88, -0.099_029_74],
            [-0.052_896_852, 1.151_903_2, -0.098_961_174],
            [-0.052_971_636, -0.098_043_45, 1.151_073_7],
        ],
        y,
    );
    // The curve gives codes of a display with gamma 2.2; the image is linear.
    let linear = |v: f32| libm::powf(v.max(0.0), 2.2);
    Vec3::new(linear(out.x), linear(out.y), linear(out.z))
}

/// Compares approximations of ACES.
pub fn aces(lights: &[Light], of: &str, budget_secs: f64) -> Choice {
    let mut choice = Choice::new("aces", "How is the ACES view transform computed?");
    choice.reference = format!(
        "the reference rendering transform and the output transform for sRGB of 100 nits in a dim room (Academy, ACES 1.0.3), in f64; {of}"
    );
    add_rows(
        &mut choice,
        lights,
        budget_secs,
        reference::aces,
        &[
            ("Hill's fit between two matrices", &|c| effect(0.0, c)),
            ("Narkowicz's curve, channel by channel", &narkowicz),
            ("the transforms themselves", &|c| reference::aces(c.as_dvec3()).as_vec3()),
        ],
    );
    choice.choose(
        "Hill's fit between two matrices",
        "keeps the typical look of ACES, bright colors that turn pale, at a small part of the cost",
    );
    choice
}

/// Krzysztof Narkowicz, "ACES Filmic Tone Mapping Curve" (2016), with the exposure of the article.
fn narkowicz(light: Vec3) -> Vec3 {
    let x = light * 0.6;
    let y = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    y.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Compares approximations of the sigmoid of AgX.
pub fn agx(lights: &[Light], of: &str, budget_secs: f64) -> Choice {
    let mut choice = Choice::new("agx", "How is the sigmoid of AgX computed?");
    choice.reference = format!(
        "the sigmoid in f64 (Sobotka, AgX-S2O3: slope 2 at the pivot, powers 3 and 3.25), between the same matrices; {of}"
    );
    let eighth = Chebyshev::of(reference::sigmoid, 8);
    let sixteenth = Chebyshev::of(reference::sigmoid, 16);
    let through = |curve: &dyn Fn(f32) -> f32, light: Vec3| {
        let x = reference::agx_stops(light.as_dvec3()).as_vec3();
        let y = Vec3::new(curve(x.x), curve(x.y), curve(x.z));
        reference::agx_shown(y.as_dvec3()).as_vec3()
    };
    add_rows(
        &mut choice,
        lights,
        budget_secs,
        |c| reference::agx_shown(reference::agx_stops(c).to_array().map(reference::sigmoid).into()),
        &[
            ("polynomial of degree 6 (Wrensch)", &|c| effect(1.0, c)),
            ("Chebyshev series of degree 8", &|c| through(&|x| eighth.at(x), c)),
            ("Chebyshev series of degree 16", &|c| through(&|x| sixteenth.at(x), c)),
            ("exact sigmoid in f64 via pow", &|c| through(&|x| reference::sigmoid(f64::from(x)) as f32, c)),
        ],
    );
    choice.choose(
        "polynomial of degree 6 (Wrensch)",
        "the fit that other programs use, so that images match theirs; seven coefficients and no branch",
    );
    choice
}

/// Chebyshev series of a function on 0..1, interpolated at the Chebyshev nodes.
struct Chebyshev(Vec<f32>);

impl Chebyshev {
    fn of(f: fn(f64) -> f64, degree: usize) -> Chebyshev {
        let n = degree + 1;
        let angle = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / n as f64;
        let values: Vec<f64> = (0..n).map(|k| f(0.5 + 0.5 * libm::cos(angle(k)))).collect();
        let term = |j: usize| {
            let sum: f64 = values.iter().enumerate().map(|(k, v)| v * libm::cos(j as f64 * angle(k))).sum();
            (sum * if j == 0 { 1.0 } else { 2.0 } / n as f64) as f32
        };
        Chebyshev((0..n).map(term).collect())
    }

    /// Evaluates the series by Clenshaw's recurrence.
    fn at(&self, x: f32) -> f32 {
        let t = 2.0 * x - 1.0;
        let (mut b, mut before) = (0.0, 0.0);
        for c in self.0.iter().skip(1).rev() {
            (b, before) = (2.0 * t * b - before + c, b);
        }
        t * b - before + self.0[0]
    }
}
