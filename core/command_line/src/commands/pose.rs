//! `choreo pose`: every actor's joints in world space at one time, for other tools and for tests.

use crate::args::PoseArgs;
use crate::args::values;
use crate::failure::{Failure, output_failure, print, print_json, write_failure};
use crate::scene::{self, opening::OpenOptions};
use crate::terminal::page::Page;
use choreo_asset::{Asset, Topology};
use choreo_files::PartFile;
use choreo_plugin::Registry;
use choreo_stage::{Evaluator, Snapshot, Stage, posed_meshes};
use glam::{DAffine3, DMat4};
use serde_json::{Value, json};
use std::io::Write;

pub(crate) fn run(args: PoseArgs, plugins: &Registry) -> Result<(), Failure> {
    let at = values::parse_at(&args.at)?;
    if let Some(path) = &args.mesh
        && !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"))
    {
        // A typing error must not replace a script or a model.
        return Err(Failure::Usage(format!("--mesh {}: write a name that ends in .obj", path.display())));
    }
    let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
    let scene = scene::open(&args.scene, &registry, OpenOptions::TO_INSPECT)?;
    let snapshot = Evaluator::new(scene.stage.clone())
        .posing_hidden()
        .at(at)
        .map_err(|e| Failure::input(e.to_string()))?;
    if let Some(path) = &args.mesh {
        scene.inputs.check_output(path)?;
        let shown = path.display().to_string();
        let failed = |e| write_failure(&shown, e);
        let part = PartFile::create(path).map_err(failed)?;
        let mut out = part.writer().map_err(|e| output_failure(&shown, &e))?;
        write_obj(&scene.stage, &snapshot, &mut out)
            .and_then(|()| out.flush())
            .map_err(|e| output_failure(&shown, &e))?;
        drop(out);
        part.commit().map_err(failed)?;
    }
    match args.json {
        true => print_json(&pose_json(&scene.name, &scene.stage, &snapshot)),
        false => print(pose_text(&scene.stage, &snapshot).as_str()),
    }
}

fn matrix_numbers(m: DAffine3) -> Vec<f64> {
    DMat4::from(m).to_cols_array().to_vec()
}

fn pose_json(name: &str, stage: &Stage, snapshot: &Snapshot) -> Value {
    let actors: Vec<Value> = stage
        .actors
        .iter()
        .zip(&snapshot.actors)
        .map(|(actor, state)| {
            let skeleton = &actor.asset.skeleton;
            let joints: Vec<Value> = skeleton
                .names()
                .iter()
                .zip(skeleton.parents())
                .enumerate()
                .filter_map(|(joint, (name, parent))| {
                    let matrix = matrix_numbers(state.world_from_joint(joint)?);
                    Some(json!({ "name": name, "parent": parent, "world_from_joint": matrix }))
                })
                .collect();
            json!({
                "name": actor.name,
                "asset": actor.asset.name,
                "visible": state.visible,
                "world_from_model": matrix_numbers(state.world_from_model),
                "joints": joints,
                "morph_weights": state.morph_weights,
            })
        })
        .collect();
    let camera = &snapshot.camera;
    json!({
        "source": name,
        "seconds": snapshot.time.as_secs(),
        "matrices": "column-major, metres, y up",
        "actors": actors,
        "camera": {
            "name": camera.camera.and_then(|c| stage.cameras.get(c)).map(|c| c.name.clone()),
            "world_from_view": matrix_numbers(camera.world_from_view),
        },
    })
}

/// Text for people: positions only.
fn pose_text(stage: &Stage, snapshot: &Snapshot) -> Page {
    let mut page = Page::default();
    for (actor, state) in stage.actors.iter().zip(&snapshot.actors) {
        let hidden = if state.visible { "" } else { ", invisible" };
        let p = state.world_from_model.translation;
        page.line(format_args!(
            "{} ({}{hidden}) at {:.4} {:.4} {:.4}",
            actor.name, actor.asset.name, p.x, p.y, p.z
        ));
        for (joint, name) in actor.asset.skeleton.names().iter().enumerate() {
            let Some(p) = state.world_from_joint(joint).map(|m| m.translation) else { continue };
            page.line(format_args!("  {name:<32} {:9.4} {:9.4} {:9.4}", p.x, p.y, p.z));
        }
    }
    page
}

/// Writes Wavefront OBJ: one object per primitive, vertices in the order of the file, so that vertex k of a primitive has number k plus the
/// vertices before it.
fn write_obj(stage: &Stage, snapshot: &Snapshot, out: &mut dyn Write) -> std::io::Result<()> {
    let mut first = 1;
    let mut first_normal = 1;
    // Meshes of hidden actors are not written, although their joints are printed.
    for (actor, state) in stage.actors.iter().zip(&snapshot.actors).filter(|(_, s)| s.visible) {
        for posed in posed_meshes(&actor.asset, state) {
            let asset: &Asset = &actor.asset;
            let mesh = &asset.meshes[asset.instances[posed.instance].mesh as usize];
            for (i, (primitive, shape)) in mesh.primitives.iter().zip(&posed.primitives).enumerate() {
                let join_words = |s: &str| s.split_whitespace().collect::<Vec<_>>().join("_");
                writeln!(
                    out,
                    "o {}/{}/{}/{i}",
                    join_words(&actor.name),
                    posed.instance,
                    join_words(&mesh.name)
                )?;
                for p in &shape.positions {
                    writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
                }
                for n in &shape.normals {
                    writeln!(out, "vn {} {} {}", n.x, n.y, n.z)?;
                }
                let (letter, vertices) = match primitive.topology {
                    Topology::Triangles => ("f", 3),
                    Topology::Lines => ("l", 2),
                    Topology::Points => ("p", 1),
                };
                for element in primitive.indices.chunks_exact(vertices) {
                    write!(out, "{letter}")?;
                    for &index in element {
                        let index = index as usize;
                        match vertices == 3 && !shape.normals.is_empty() {
                            true => write!(out, " {}//{}", first + index, first_normal + index)?,
                            false => write!(out, " {}", first + index)?,
                        }
                    }
                    writeln!(out)?;
                }
                first += shape.positions.len();
                first_normal += shape.normals.len();
            }
        }
    }
    Ok(())
}
