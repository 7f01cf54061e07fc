//! Scenes as glTF 2.0: `.glb`, or `.gltf` with separate buffer and images. Contents and accuracy: README.md.

mod actors;
mod animations;
mod buffer;
mod cameras;
mod clips;
mod container;
mod document;
mod lights;
mod materials;
mod meshes;
mod textures;

use actors::Parts;
use animations::Nodes;
use choreo_exporter_kit::bake::{self, Style, check};
use choreo_exporter_kit::losses;
use choreo_plugin::motion::Skinning;
use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
use document::Scene;
use serde_json::json;
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "gltf",
        env!("CARGO_PKG_VERSION"),
        "glTF 2.0: meshes, materials, skins, cameras, lights, and the timeline as animations",
    )
    .extensions(["glb", "gltf"])
    .number(
        "tolerance",
        "how far an exported joint may be from its place in the scene at any time",
        0.0001,
        1e-7..=1.0,
    )
    .unit("m")
    .text(
        "animations",
        "timeline: one animation of everything; actors: one for each actor, and one for cameras and \
         lights; clips: one for each clip",
        "timeline",
        &["timeline", "actors", "clips"],
    )
    .text(
        "root_motion",
        "root motion of clips; clip: unchanged; in_place: removed; traveling: moves the actor's node",
        "clip",
        &["clip", "in_place", "traveling"],
    )
});

#[derive(Clone, Copy, Debug, Default)]
pub struct GltfExporter;

impl SceneExporter for GltfExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        let tolerance = scene.options.number("tolerance").unwrap_or(0.0001);
        match scene.options.text("animations") {
            Some("clips") => export_clips(scene, tolerance, files),
            other => export_timeline(scene, tolerance, other == Some("actors"), files),
        }
    }
}

fn export_timeline(
    scene: &ExportedScene,
    tolerance: f64,
    split: bool,
    files: &mut dyn SceneFiles,
) -> Result<Vec<String>, ExportError> {
    let baked = bake::bake(scene, tolerance, Style::Separate)?;
    files.deviation(check::largest_deviation(scene, &baked, &check::SINGLE_SECONDS)?);
    let mut parts = parts_of(scene);
    let nodes = nodes(&mut parts, scene, &baked);
    animations::add(&mut parts, &scene.stage, baked, &nodes, split);
    write(scene, parts, files)
}

fn export_clips(
    scene: &ExportedScene,
    tolerance: f64,
    files: &mut dyn SceneFiles,
) -> Result<Vec<String>, ExportError> {
    let at_rest = clips::at_rest(scene);
    let clips = clips::of_stage(scene, scene.options.text("root_motion").unwrap_or("clip"));
    let (of_clips, worst) = clips::bake(&clips, tolerance)?;
    files.deviation(worst);
    let baked = bake::bake(&at_rest, tolerance, Style::Separate)?;
    let mut parts = parts_of(scene);
    let nodes = nodes(&mut parts, &at_rest, &baked);
    clips::add(&mut parts, &clips, of_clips, &nodes.actors);
    write(scene, parts, files)
}

fn parts_of<'a>(scene: &ExportedScene) -> Parts<'a> {
    let mut parts = Parts::default();
    parts.document.scenes.push(Scene { name: scene.stem.clone(), ..Scene::default() });
    parts
}

/// Adds the nodes of actors, shots and lights.
fn nodes<'a>(parts: &mut Parts<'a>, scene: &'a ExportedScene, baked: &bake::Baked<'_>) -> Nodes {
    let stage = &*scene.stage;
    let mut nodes = Nodes { actors: Vec::new(), shots: Vec::new(), lights: Vec::new() };
    for (index, motion) in baked.motions.iter().enumerate() {
        nodes.actors.push((!motion.hidden).then(|| parts.actor(stage, baked, index)));
    }
    nodes.shots = cameras::of_stage(parts, stage, baked);
    nodes.lights = lights::of_stage(parts, stage, baked);
    losses::of_stage(stage, &mut parts.losses);
    let own = [
        (stage.sky.is_some(), "the sky"),
        (stage.actors.iter().any(|a| a.skinning == Skinning::DualQuaternion), "dual quaternion skinning"),
        (stage.actors.iter().any(|a| !a.shadow.cast || !a.shadow.receive), "actors without shadows"),
    ];
    losses::add(&own, &mut parts.losses);
    nodes
}

fn write(
    scene: &ExportedScene,
    parts: Parts<'_>,
    files: &mut dyn SceneFiles,
) -> Result<Vec<String>, ExportError> {
    let beside = scene.extension == "gltf";
    let all = parts.losses.union(&parts.materials.losses).copied().collect();
    let note = losses::note("glTF", "background and ambient light", &all);
    let Parts { mut document, mut buffer, textures, materials, lights, mut extensions, .. } = parts;
    let provenance: serde_json::Map<String, serde_json::Value> =
        scene.provenance.iter().map(|(keyword, text)| (keyword.clone(), text.clone().into())).collect();
    let generator = format!("choreo export-gltf {}", MANIFEST.version);
    document.asset = json!({ "version": "2.0", "generator": generator, "extras": provenance });
    document.materials = materials.list;
    extensions.extend(materials.extensions);
    if textures.transformed {
        extensions.insert("KHR_texture_transform");
    }
    if textures.webp {
        extensions.insert("EXT_texture_webp");
        document.extensions_required.push("EXT_texture_webp");
    }
    if !lights.list.is_empty() {
        extensions.insert("KHR_lights_punctual");
        document.extensions = Some(json!({ "KHR_lights_punctual": { "lights": lights.list } }));
    }
    document.extensions_used = extensions.into_iter().collect();
    document.images = match beside {
        true => textures.beside(&scene.stem, files)?,
        false => textures.images_in_buffer(&mut buffer)?,
    };
    (document.samplers, document.textures) = (textures.samplers, textures.textures);
    match beside {
        true => container::write_gltf(document, buffer, &scene.stem, files)?,
        false => container::write_glb(document, buffer, files)?,
    }
    Ok(vec![note])
}
