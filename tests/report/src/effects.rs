//! Effects: cost per frame, number of sub-frames for motion blur, antialiasing with and without multisampling.

use crate::images::{draw_frame, error_and_cost_rows, renderers, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Choice, Table, difference, ratio, time};
use choreo_bench::timing::{Case, Clock, Nanos, interleaved};
use choreo_motion::Time;
use choreo_plugin::{Effect, EffectImage, Hook, LightSample, Registry, Shutter, SurfaceSample};
use choreo_render::plan::motion_blur::{plan_at, times};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources, effect_parameters};
use choreo_stage::{Evaluator, Stage};
use glam::{Vec2, Vec3, Vec4};
use std::cell::RefCell;
use std::sync::Arc;

const SIZE: [u32; 2] = [1280, 720];
/// Image size of the comparisons; the references are drawn at four times this size.
const COMPARISON_SIZE: [u32; 2] = [480, 272];
/// Number of rounds; in each round all effects take turns.
const ROUNDS: usize = 5;

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    Ok(Section {
        title: "Effects",
        text: "The cost of an effect is the time of a frame with it minus that of the same frame without \
               it, where the difference is more than noise. Effects on surfaces cost the time of their \
               function on the covered pixels; effects over the image need float targets and a pass. Motion \
               blur is the mean of images at exact times: the error falls with their number, and so does \
               the speed. On the CPU the WGSL of an effect is evaluated over 32 pixels at a time; it is \
               compared with tone mapping written by hand in Rust, in loops over eight pixels. FXAA detects \
               edges in the finished image, while multisampling knows them."
            .into(),
        choices: vec![compare_motion_blur_samples(&registry)?, compare_edge_effects(&registry)?],
        tables: vec![measure_costs(&registry)?, measure_evaluation(&registry)?],
        off_front: vec![(
            "edges",
            "FXAA is an effect that a script must add: it also softens sharp details within a texture, \
             which no mean over edges shows.",
        )],
    })
}

/// A lit walker that casts a shadow on a floor, and an effect.
const SCENE: &str = r##"
    stage(#{ length: 2.0, background: #{ top: "#5f7fa8", bottom: "#cfd6dc" } });
    let moves = load("choreo:mannequin", #{ color: "#f2a93b" });
    let anna = cast("anna", moves);
    anna.play(moves.clip("Run")).loop();
    let floor = cast("floor", shape("plane", #{ size: 20.0, checker: "grey" }));
    sun(#{ direction: [-1.0, -1.6, -0.8], shadow: true });
    camera("front").fov(30).at(0.6, 1.2, 4.6).look_at([0.0, 0.9, 0.0]);
"##;

fn stage_with_effect(effect: &str, registry: &Registry) -> Result<Arc<Stage>, String> {
    stage(&format!("{SCENE}{effect}"), registry)
}

fn plan_frame(stage: &Arc<Stage>, effects: &[Effect], size: [u32; 2], samples: u32) -> Result<Plan, String> {
    let options = PlanOptions { effects, ..PlanOptions::new(size, samples) };
    let at = Time::from_secs(0.4);
    let resources = SceneResources::new(stage);
    let planned = plan_at(&resources, &mut Evaluator::new(stage.clone()), at, &options, None);
    planned.map(|(_, plan)| plan).map_err(|e| e.to_string())
}

const EFFECTS: [(&str, &str); 21] = [
    ("none", ""),
    ("vignette", r#"effect("vignette");"#),
    ("tonemap", r#"effect("tonemap");"#),
    ("fxaa", r#"effect("fxaa");"#),
    ("bloom", r#"effect("bloom");"#),
    ("ambient_occlusion", r#"effect("ambient_occlusion");"#),
    ("depth_of_field", r#"effect("depth_of_field");"#),
    ("god_rays", r#"effect("god_rays");"#),
    ("edge_lines", r#"effect("edge_lines");"#),
    ("heat_haze", r#"effect("heat_haze", #{ start: 1.0, full: 5.0 });"#),
    ("film_grain", r#"effect("film_grain");"#),
    ("fog", r#"effect("fog");"#),
    ("fog of a color", r#"effect("fog", #{ sky: false, falloff: 0.3 });"#),
    ("toon", r#"effect("toon");"#),
    ("views", r#"effect("views");"#),
    ("xray on the actor", r#"effect("xray").on(anna);"#),
    ("outline", r#"effect("outline").on(anna);"#),
    ("wireframe", r#"effect("wireframe").on(anna);"#),
    ("skeleton", r#"effect("skeleton");"#),
    ("grid", r#"effect("grid", #{ height: 0.01 });"#),
    ("shadow_catcher", r#"effect("shadow_catcher").on(floor);"#),
];

fn measure_costs(registry: &Registry) -> Result<Table, String> {
    let effects = registry.effects();
    for effect in effects.iter().filter(|e| e.hook() != Hook::Shutter) {
        let name = &effect.manifest().name;
        if !EFFECTS.iter().any(|(_, script)| script.contains(&format!("\"{name}\""))) {
            return Err(format!("effect {name} is not in the table of costs"));
        }
    }
    let title = format!(
        "Cost of each effect: one lit walker with a shadow, {}×{}, 1 sample, {}",
        SIZE[0],
        SIZE[1],
        Clock::Process.words()
    );
    let columns = [
        ("effect", "effect"),
        (">CPU renderer", "cpu"),
        (">beyond none", "cpu_beyond"),
        (">Vulkan", "vulkan"),
        (">beyond none", "vulkan_beyond"),
    ];
    let mut table = Table::new(title, &columns);
    let stages =
        EFFECTS.iter().map(|(_, text)| stage_with_effect(text, registry)).collect::<Result<Vec<_>, _>>()?;
    // All stages have the same assets.
    let resources = Arc::new(SceneResources::new(&stages[0]));
    let plans: Result<Vec<_>, _> = stages.iter().map(|s| plan_frame(s, effects, SIZE, 1)).collect();
    let plans = plans?;
    let timed = |renderer: &mut dyn Renderer| -> Result<Vec<Nanos>, String> {
        renderer.load(resources.clone()).map_err(|e| e.to_string())?;
        let mut times = vec![Vec::new(); plans.len()];
        for _ in 0..ROUNDS {
            for (plan, times) in plans.iter().zip(&mut times) {
                // Changing the effect creates new targets and pipelines, which a video does only once.
                draw_frame(renderer, plan)?;
                for _ in 0..3 {
                    let start = Clock::Process.now();
                    draw_frame(renderer, plan)?;
                    times.push(Clock::Process.now() - start);
                }
            }
        }
        Ok(times.into_iter().map(Nanos::of).collect())
    };
    let nanos =
        renderers(registry).iter_mut().map(|(_, r)| timed(&mut **r)).collect::<Result<Vec<_>, _>>()?;
    for (i, (name, _)) in EFFECTS.iter().enumerate() {
        let mut row = vec![Cell::text(*name)];
        for renderer in 0..2 {
            let Some(nanos) = nanos.get(renderer) else {
                row.extend([Cell::empty(), Cell::empty()]);
                continue;
            };
            row.push(time(nanos[i]));
            row.push(if i == 0 { Cell::empty() } else { difference(&nanos[0], &nanos[i]) });
        }
        table.rows.push(row);
    }
    Ok(table.without_empty_columns())
}

/// Size of the image, and of the grid of surface points, on which functions are evaluated.
const EVALUATION_SIZE: [u32; 2] = [256, 144];

/// Time of each effect's function on the CPU, compared with tone mapping written by hand in Rust for eight pixels at once.
fn measure_evaluation(registry: &Registry) -> Result<Table, String> {
    let effects: Vec<_> = registry.effects().iter().filter(|e| e.shader().is_some()).cloned().collect();
    let image = disc_image();
    let results = RefCell::new(vec![Vec::new(); effects.len()]);
    let by_hand = RefCell::new(Vec::new());
    let mut cases: Vec<Case> = Vec::new();
    for (i, effect) in effects.iter().enumerate() {
        let (image, results) = (&image, &results);
        cases.push(Case::new(image.len(), move || results.borrow_mut()[i] = evaluate_effect(effect, image)));
    }
    cases.push(Case::new(image.len(), || {
        *by_hand.borrow_mut() = choreo_bench::scene::tones::effect_of_eights(&image);
    }));
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    let title = format!(
        "Evaluation of each effect's function on the CPU, default parameters, all passes of an image of {}×{}, {}",
        EVALUATION_SIZE[0],
        EVALUATION_SIZE[1],
        Clock::Thread.words()
    );
    let columns = [
        ("effect", "effect"),
        (">a pixel", "evaluated"),
        (">by hand in Rust", "by_hand"),
        (">times", "ratio"),
        (">largest difference", "error"),
    ];
    let mut table = Table::new(title, &columns);
    let (results, by_hand) = (results.into_inner(), by_hand.into_inner());
    for (i, effect) in effects.iter().enumerate() {
        let name = effect.manifest().name.as_str();
        let mut row = vec![Cell::text(name), time(nanos[i])];
        if name == "tonemap" {
            let hand = nanos[effects.len()];
            let apart =
                results[i].iter().zip(&by_hand).map(|(a, b): (&Vec4, &Vec4)| (*a - *b).abs().max_element());
            let error = f64::from(apart.fold(0.0, f32::max));
            row.push(time(hand));
            row.push(ratio(&hand, &nanos[i]));
            row.push(Cell::number(format!("{error:.1e}"), error));
        } else {
            row.extend([Cell::empty(), Cell::empty(), Cell::empty()]);
        }
        table.rows.push(row);
    }
    Ok(table)
}

/// Test image: discs with sharp edges over a gradient, some brighter than white; linear.
fn disc_image() -> Vec<Vec4> {
    let [width, height] = EVALUATION_SIZE;
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let (dx, dy) = ((x % 48) as f32 - 24.0, (y % 48) as f32 - 24.0);
        let light = if dx * dx + dy * dy < 300.0 { 0.3 * (1 + x / 48) as f32 } else { 0.1 };
        let across = x as f32 / width as f32;
        Vec4::new(light * across, light, light * (1.0 - across), 1.0)
    };
    (0..width * height).map(pixel).collect()
}

/// Result of an effect's function for an image, or for surfaces of these colors.
fn evaluate_effect(effect: &Effect, image: &[Vec4]) -> Vec<Vec4> {
    let (size, width) = (EVALUATION_SIZE, EVALUATION_SIZE[0] as usize);
    let parameters = effect_parameters(effect, &[]);
    let mut colors = image.to_vec();
    match effect {
        Effect::Image(_) => {
            colors = effect.over_image(EffectImage { size, rgba: image }, None, &parameters);
        }
        Effect::Surface(effect) => {
            let sample = |i: usize| SurfaceSample {
                world: Vec3::new((i % width) as f32 * 0.1, (i / width) as f32 * 0.05, -3.0),
                distance: 3.0 + (i % width) as f32 * 0.1,
                normal: Vec3::Z,
                facing: 0.8,
                ..SurfaceSample::default()
            };
            let samples: Vec<SurfaceSample> = (0..colors.len()).map(sample).collect();
            for (colors, samples) in colors.chunks_mut(width).zip(samples.chunks(width)) {
                effect.surfaces(colors, samples, &parameters);
            }
        }
        Effect::Lighting(effect) => {
            let sample = |color: &Vec4| LightSample {
                cosine: 0.6,
                share: 1.0,
                color: Vec3::ONE,
                base: color.truncate(),
                normal: Vec3::Z,
                viewer: Vec3::Z,
                light: Vec3::Y,
                lit: color.truncate() * 0.6,
            };
            let mut samples: Vec<LightSample> = colors.iter().map(sample).collect();
            effect.lights(&mut samples, &parameters);
            colors = samples.iter().map(|sample| sample.lit.extend(1.0)).collect();
        }
        Effect::Pixel(effect) => {
            let uv = |i: usize| Vec2::new((i % width) as f32, (i / width) as f32) / size[0] as f32;
            let uv: Vec<Vec2> = (0..colors.len()).map(uv).collect();
            for (colors, uv) in colors.chunks_mut(width).zip(uv.chunks(width)) {
                effect.pixels(colors, uv, &parameters);
            }
        }
        _ => {}
    }
    colors
}

fn compare_motion_blur_samples(registry: &Registry) -> Result<Choice, String> {
    let effects = registry.effects();
    let mut choice =
        Choice::new("blur", "How many images make one image with motion blur? (a run, shutter of 180°)");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = "512 times; mean over all channels of all pixels".into();
    choice.per =
        format!("image of {}×{}, {}", COMPARISON_SIZE[0], COMPARISON_SIZE[1], Clock::Process.words());
    let plain = stage_with_effect("", registry)?;
    let (resources, at) = (Arc::new(SceneResources::new(&plain)), Time::from_secs(0.4));
    let options = PlanOptions { effects, ..PlanOptions::new(COMPARISON_SIZE, 4) };
    let one = |time| {
        Ok::<_, String>(Plan::new(&resources, &plain, &plain.at(time).map_err(|e| e.to_string())?, &options))
    };
    // The effect determines the number of sub-frames; it may exceed the limit for scripts.
    let plan = |samples: u32| {
        let mut whole = one(at)?;
        if samples > 1 {
            for time in times(&plain, at, &Shutter { samples, open: 0.5, before: 0.5 }) {
                whole.subframes.push(Plan { linear: true, ..one(time)? });
            }
        }
        Ok::<_, String>(whole)
    };
    let mut renderer = CpuRenderer::new(effects);
    renderer.load(resources.clone()).map_err(|e| e.to_string())?;
    let truth = draw_frame(&mut renderer, &plan(512)?)?;
    let counts = [1, 2, 4, 8, 16, 32, 64];
    let name = |count| if count == 1 { "none".to_string() } else { format!("{count} times") };
    let methods = counts.iter().map(|n| Ok((name(*n), plan(*n)?))).collect::<Result<Vec<_>, String>>()?;
    choice.rows = error_and_cost_rows(&mut renderer, &methods, &truth, 4.0 * BUDGET_SECS)?;
    choice.choose("16 times", "steps of a limb that crosses sixteen pixels are as wide as a pixel");
    Ok(choice)
}

fn compare_edge_effects(registry: &Registry) -> Result<Choice, String> {
    let effects = registry.effects();
    let mut choice = Choice::new("edges", "Smooth edges by samples, or by FXAA over the finished image?");
    choice.error_unit = "steps of 255";
    choice.by_mean = true;
    choice.reference = "64 samples a pixel, textures included; mean over all channels of all pixels".into();
    choice.per =
        format!("image of {}×{}, {}", COMPARISON_SIZE[0], COMPARISON_SIZE[1], Clock::Process.words());
    let at = Time::from_secs(0.4);
    let plain = stage_with_effect("", registry)?;
    let moment = Moment::new(&plain, at, effects).map_err(|e| e.to_string())?;
    let truth = moment.supersampled(COMPARISON_SIZE).map_err(|e| e.to_string())?;
    let smooth = stage_with_effect("effect(\"fxaa\");", registry)?;
    let mut renderer = CpuRenderer::new(effects);
    renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
    let methods = [
        ("1 sample", &plain, 1),
        ("1 sample, FXAA", &smooth, 1),
        ("4 samples", &plain, 4),
        ("4 samples, FXAA", &smooth, 4),
    ];
    let planned = methods
        .iter()
        .map(|(name, stage, samples)| {
            Ok((name.to_string(), plan_frame(stage, effects, COMPARISON_SIZE, *samples)?))
        })
        .collect::<Result<Vec<_>, String>>()?;
    choice.rows = error_and_cost_rows(&mut renderer, &planned, &truth, 3.0 * BUDGET_SECS)?;
    choice.choose("4 samples", "the default: exact edges, and nothing else changes");
    Ok(choice)
}
