//! `choreo explain`: what one frame of a scene needs and what requested it, what was left out, and why.

mod inside;
mod reuse;

use crate::args::ExplainArgs;
use crate::args::values;
use crate::commands::compressed;
use crate::failure::{Failure, print, print_json};
use crate::output::svg;
use crate::scene::{self, opening::OpenOptions};
use crate::terminal::{counted, width::columns};
use choreo_bench::plots::{Cell, Table, byte_bars};
use choreo_plugin::{FrameWish, Passes, Registry};
use choreo_render::commands::{RecordOptions, record};
use choreo_render::plan::LeftOut;
use choreo_render::plan::frame_key::scene_key;
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{Plan, PlanOptions, SceneResources};
use choreo_script::Places;
use choreo_stage::{Evaluator, Stage};
use inside::FrameContent;
use reuse::ReuseCounter;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;

pub(crate) fn run(args: ExplainArgs, plugins: &Registry) -> Result<(), Failure> {
    svg::check_plot_path(args.plot.as_deref())?;
    let at = values::parse_at(&args.at)?;
    let size = args.size.as_deref().map(values::parse_size).transpose()?;
    let samples = args.samples.as_deref().map(values::parse_samples).transpose()?;
    let wish = match args.passes.as_deref().map(Passes::parse).transpose() {
        Ok(passes) => passes.map_or(FrameWish::Bytes, FrameWish::Scene),
        Err(unknown) => return Err(Failure::Usage(format!("--passes: {unknown}"))),
    };
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let scene = scene::open(&args.scene, &registry, OpenOptions::TO_INSPECT)?;
    let stage = &scene.stage;
    let size = size.unwrap_or(stage.settings.size);
    let samples = samples.or(stage.settings.samples).unwrap_or(4);
    let resources = SceneResources::without_levels(stage);
    let aspect = f64::from(size[0]) / f64::from(size[1].max(1));
    let mut evaluator = Evaluator::new(stage.clone()).for_images(aspect);
    let snapshot = evaluator.at(at).map_err(|e| Failure::input(e.to_string()))?;
    let costs = evaluator.costs(&snapshot);
    let effects = scene.registry.effects();
    let options = PlanOptions { effects, wish, ..PlanOptions::new(size, samples) };
    let planned = |at| {
        let plan = plan_at(&resources, &mut evaluator, at, &options, None);
        plan.map(|(_, plan)| plan).map_err(|e| Failure::input(e.to_string()))
    };
    let mut reuses =
        ReuseCounter { plan: planned, scene_key: |plan: &Plan| scene_key(plan, &resources, effects) };
    let mut plan = (reuses.plan)(at)?;
    let reuse = reuses.reuse_at(&plan, at, &stage.settings)?;
    let frames = reuses.count_frames(&stage.settings)?;
    let sub_frames = std::mem::take(&mut plan.subframes).len();
    let cpu = json!({
        "poses": costs.poses,
        "constraints": costs.constraints,
        "spring_bones": costs.spring_bones,
        "sub_frames": sub_frames,
        "sub_frames_why": plan.shutter_motion.map(|motion| motion.to_string()),
        "earlier_frames": std::mem::take(&mut plan.history).len(),
        "cameras": 1 + u8::from(plan.dissolve.take().is_some()),
        "reuse": reuse.name(),
        "reuses": frames.json(),
    });
    let mut plan = plan.first_drawn();
    let triangles = |p: u32| resources.primitives[p as usize].primitive().indices.len() / 3;
    let recording = record(&plan, RecordOptions::default(), triangles);
    let parts = choreo_render::explain::frame_costs(&resources, &plan, &recording);
    let content = FrameContent { stage, resources: &resources, places: &scene.places, parts };
    if let Some(path) = &args.plot {
        let title = format!("{} at {} s: what one frame holds on the device", scene.name, at.as_secs());
        svg::write_plot(path, &byte_bars(&title, &content.bytes_by_part()), &scene.inputs)?;
    }
    plan.left_out.extend(recording.preskinning_left_out(&plan));
    plan.left_out.extend(unread_meshes_and_images(&scene.places));
    let mut facts = frame_facts(stage, &resources, &plan, at.as_secs());
    facts["cpu"] = cpu;
    if args.json {
        facts["in"] = content.json();
        return print_json(&facts);
    }
    let (frames, width) = (frames.text(), columns());
    print(&format!(
        "{}frames     {frames}\n\n{}\n{}",
        facts_text(&facts),
        content.table().text_within(width),
        left_out_table(&plan).text_within(width)
    ))
}

/// Parts of the script's files that were not even read.
fn unread_meshes_and_images(places: &Places) -> impl Iterator<Item = LeftOut> {
    places.clips_only.iter().map(|(file, place)| {
        let part = format!("meshes and images of {file}");
        let file = if places.is_main(&place.file) { String::new() } else { format!("{}:", place.file) };
        LeftOut { part, why: format!("only its clips are used ({file}line {})", place.line) }
    })
}

fn frame_facts(stage: &Stage, resources: &SceneResources, plan: &Plan, at: f64) -> Value {
    let primitives = || resources.primitives.iter().map(|p| p.primitive());
    let drawn: usize = plan
        .draws
        .iter()
        .map(|d| {
            resources.primitives[d.primitive as usize].primitive().indices.len() / 3
                * d.instance_count as usize
        })
        .sum();
    let mut pipelines: BTreeMap<String, usize> = BTreeMap::new();
    for draw in &plan.draws {
        *pipelines.entry(format!("{:?}", draw.pipeline)).or_default() += 1;
    }
    let texture_bytes: usize = resources
        .textures
        .iter()
        // A mipmap chain adds a third.
        .filter(|t| t.streamed.is_none())
        .map(|t| (t, 4 * t.image.width as usize * t.image.height as usize))
        .map(|(t, bytes)| if t.mipmaps { bytes / 3 * 4 } else { bytes })
        .sum();
    json!({
        "seconds": at,
        "size": plan.size,
        "samples": plan.samples,
        "stage": {
            "actors": stage.actors.len(),
            "assets": resources.assets.len(),
            "frames": stage.settings.fps.frames_in(stage.settings.length),
        },
        "clips": compressed::compression_totals_json(stage),
        "shared": {
            "primitives": resources.primitives.len(),
            "vertices": primitives().map(|p| p.positions.len()).sum::<usize>(),
            "materials": resources.materials.len(),
            "textures": resources.textures.len(),
            "texture_bytes": texture_bytes,
        },
        "frame": {
            "draws": plan.draws.len(),
            "copies": plan.draws.iter().map(|d| d.instance_count).sum::<u32>(),
            "primitives_drawn": drawn,
            "pipelines": pipelines.len(),
            "joint_matrices": plan.joint_matrices.len(),
            "active_morphs": plan.morphs.len(),
            "lights": plan.lights.len(),
            "effects": plan.post.iter().map(|p| p.effect.clone()).collect::<Vec<_>>(),
        },
        "left_out": plan.left_out.iter().map(|l| json!({ "what": l.part, "why": l.why })).collect::<Vec<_>>(),
    })
}

fn facts_text(f: &Value) -> String {
    let mut t = String::new();
    let (stage, shared, frame) = (&f["stage"], &f["shared"], &f["frame"]);
    let counted_value = |number: &Value, noun: &str| counted(number.as_u64().unwrap_or_default(), noun);
    let _ = writeln!(t, "at {} s, {}×{}, {} samples", f["seconds"], f["size"][0], f["size"][1], f["samples"]);
    let _ = writeln!(
        t,
        "stage      {} from {}, {}",
        counted_value(&stage["actors"], "actor"),
        counted_value(&stage["assets"], "asset"),
        counted_value(&stage["frames"], "frame")
    );
    let _ = writeln!(
        t,
        "uploaded   {} with {}, {}, {} ({:.1} MB), each once",
        counted_value(&shared["primitives"], "primitive"),
        counted_value(&shared["vertices"], "vertex"),
        counted_value(&shared["materials"], "material"),
        counted_value(&shared["textures"], "texture"),
        shared["texture_bytes"].as_f64().unwrap_or(0.0) / 1e6
    );
    let _ = writeln!(
        t,
        "drawn      {} of {}, {}, {}",
        counted_value(&frame["draws"], "draw"),
        counted_value(&frame["copies"], "copy"),
        counted_value(&frame["primitives_drawn"], "triangle"),
        counted_value(&frame["pipelines"], "pipeline")
    );
    let _ = writeln!(
        t,
        "for them   {}, {}, {}",
        counted_value(&frame["joint_matrices"], "joint matrix"),
        counted_value(&frame["active_morphs"], "active morph target"),
        counted_value(&frame["lights"], "light")
    );
    let cpu = &f["cpu"];
    let _ = writeln!(
        t,
        "processor  {}, {}, {}, {}",
        counted_value(&cpu["poses"], "pose"),
        counted_value(&cpu["constraints"], "constraint"),
        counted_value(&cpu["spring_bones"], "spring bone"),
        counted_value(&cpu["sub_frames"], "sub-frame")
    );
    if let Some(why) = cpu["sub_frames_why"].as_str() {
        let plural = if cpu["sub_frames"] == 1 { "" } else { "s" };
        let _ = writeln!(t, "blur       {} sub-frame{plural}: {why}", cpu["sub_frames"]);
    }
    match cpu["reuse"].as_str() {
        Some("frame") => t.push_str("reused     equal to the frame before: not drawn again\n"),
        Some("scene") => t.push_str("reused     the scene of the frame before, under other 2D layers\n"),
        _ => {}
    }
    if cpu["cameras"] == 2 {
        t.push_str("dissolve   two cameras are drawn and mixed\n");
    }
    let clips = &f["clips"];
    if clips["compressed"] != 0 {
        let kilobytes = |key: &str| clips[key].as_f64().unwrap_or(0.0) / 1e3;
        let _ = writeln!(
            t,
            "clips      {} of {} compressed: {:.1} kB, before {:.1}, of dense floats {:.1}; no joint is farther off than {:.4} mm",
            clips["compressed"],
            clips["clips"],
            kilobytes("bytes"),
            kilobytes("bytes_before"),
            kilobytes("dense_bytes"),
            clips["worst_mm"].as_f64().unwrap_or(0.0)
        );
    }
    for effect in frame["effects"].as_array().into_iter().flatten() {
        let _ = writeln!(t, "effect     {}", effect.as_str().unwrap_or_default());
    }
    t
}

fn left_out_table(plan: &Plan) -> Table {
    let mut table = Table::new("", &[("left out", "what"), ("why", "why")]);
    table.rows = plan.left_out.iter().map(|l| vec![Cell::text(&l.part), Cell::text(&l.why)]).collect();
    table
}
