//! Scenes as glTF 2.0: `.glb`, or `.gltf` with its buffer and images beside it. What is written, and how exact it is: README.md.

mod actors;
mod animations;
mod bake;
mod buffer;
mod cameras;
mod container;
mod document;
mod lights;
mod losses;
mod materials;
mod meshes;
mod textures;

use actors::Parts;
use animations::Nodes;
use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
use document::Scene;
use serde_json::json;
use std::sync::LazyLock;
use textures::Textures;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "gltf",
        env!("CARGO_PKG_VERSION"),
        "glTF 2.0: meshes, materials, skins, cameras, lights, and the timeline as animations",
    )
    .extensions(["glb", "gltf"])
    .number("tolerance", "how far a joint may be from the scene at any time", 0.0001, 1e-7..=1.0)
    .unit("m")
    .text(
        "animations",
        "timeline: one animation of all; actors: one for each actor, and one for cameras and lights",
        "timeline",
        &["timeline", "actors"],
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
        let split = scene.options.text("animations") == Some("actors");
        let stage = &*scene.stage;
        let baked = bake::bake(scene, tolerance)?;
        let worst = bake::check::worst(scene, &baked)?;
        files.deviation(worst);
        let beside = scene.extension == "gltf";
        let mut parts = Parts { textures: Textures::new(beside.then_some(&*scene.stem)), ..Parts::default() };
        parts.document.scenes.push(Scene { name: scene.stem.clone(), ..Scene::default() });
        let mut nodes = Nodes { actors: Vec::new(), shots: Vec::new(), lights: Vec::new() };
        for index in 0..stage.actors.len() {
            let seen = !baked.motions[index].hidden;
            nodes.actors.push(seen.then(|| parts.actor(stage, &baked, index)).transpose()?);
        }
        nodes.shots = cameras::of_stage(&mut parts, stage, &baked);
        nodes.lights = lights::of_stage(&mut parts, stage, &baked);
        animations::add(&mut parts, stage, baked, &nodes, split);
        losses::of_stage(stage, &mut parts.losses);
        let losses = losses::note(&parts.losses.union(&parts.materials.losses).copied().collect());
        write(scene, parts, beside, files)?;
        Ok(vec![losses])
    }
}

fn write(
    scene: &ExportedScene,
    parts: Parts<'_>,
    beside: bool,
    files: &mut dyn SceneFiles,
) -> Result<(), ExportError> {
    let Parts { mut document, buffer, textures, materials, lights, mut extensions, .. } = parts;
    let provenance: serde_json::Map<String, serde_json::Value> =
        scene.provenance.iter().map(|(keyword, text)| (keyword.clone(), text.clone().into())).collect();
    let generator = format!("choreo export-gltf {}", MANIFEST.version);
    document.asset = json!({ "version": "2.0", "generator": generator, "extras": provenance });
    document.materials = materials.list;
    extensions.extend(materials.extensions);
    if textures.transformed {
        extensions.insert("KHR_texture_transform");
    }
    if !lights.list.is_empty() {
        extensions.insert("KHR_lights_punctual");
        document.extensions = Some(json!({ "KHR_lights_punctual": { "lights": lights.list } }));
    }
    document.extensions_used = extensions.into_iter().collect();
    if beside {
        textures.write_beside(files)?;
    }
    (document.images, document.samplers, document.textures) =
        (textures.images, textures.samplers, textures.textures);
    match beside {
        true => container::write_gltf(document, buffer, &scene.stem, files),
        false => container::write_glb(document, buffer, files),
    }
}
