//! Scenes as USD: `.usda`, `.usdc`, `.usdz`. What is written, and how exact it is: README.md.

mod actors;
mod cameras;
mod file;
mod frames;
mod joints;
mod layer;
mod lights;
mod materials;
mod meshes;
mod model;
mod motion;
mod names;
mod textures;

use actors::KnownAnimations;
use choreo_exporter_kit::bake::check::{self, FileRounding};
use choreo_exporter_kit::bake::{self, Baked, Style};
use choreo_exporter_kit::losses;
use choreo_plugin::asset::Asset;
use choreo_plugin::motion::Path;
use choreo_plugin::stage::Stage;
use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
use file::binary::{self, HEADER_BYTES};
use file::zip::{Archive, Contents};
use file::{Out, text};
use frames::Frames;
use layer::{Layer, Meta, Prim};
use model::{Common, Model};
use motion::Sets;
use names::Names;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::{Arc, LazyLock};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "usd",
        env!("CARGO_PKG_VERSION"),
        "USD: meshes, skeletons, blend shapes, materials, cameras, lights, and the timeline as time samples",
    )
    .extensions(["usda", "usdc", "usdz"])
    .number(
        "tolerance",
        "how far an exported joint may be from its place in the scene at any time",
        0.0001,
        1e-7..=1.0,
    )
    .unit("m")
});

/// Name of the prim that holds the models.
const MODELS: &str = "_models";

/// Precision of the written numbers, for the error check: times are exact in f64; joint scales are in half precision
/// (UsdSkelAnimation).
const FILE_ROUNDING: FileRounding = FileRounding {
    times: |times, start| times.iter().map(|time| *time - start).collect(),
    number: |path, number| match path {
        Path::Scale => half::f16::from_f32(number).to_f32(),
        _ => number,
    },
};

#[derive(Clone, Copy, Debug, Default)]
pub struct UsdExporter;

impl SceneExporter for UsdExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        let tolerance = scene.options.number("tolerance").unwrap_or(0.0001);
        let mut baked = bake::bake(scene, tolerance, Style::Common)?;
        files.deviation(check::largest_deviation(scene, &baked, &FILE_ROUNDING)?);
        let sets: Vec<_> = std::mem::take(&mut baked.sets).into_iter().map(Rc::new).collect();
        // The writers below ask each set for its constant values.
        baked.sets = sets.iter().map(|set| constant_tracks(set)).collect();
        let mut common = Common::default();
        common.textures.stem = scene.stem.clone();
        let layer = layer(scene, &baked, &sets, &mut common)?;
        write(&scene.extension, &layer, &common, (&scene.stem, files))?;
        Ok(vec![losses::note("USD", "the background", &common.losses)])
    }
}

/// A track set reduced to its constant values.
fn constant_tracks<'a>(set: &bake::tracks::TrackSet<'a>) -> bake::tracks::TrackSet<'a> {
    bake::tracks::TrackSet {
        times: Vec::new(),
        tracks: Vec::new(),
        still: set.still.clone(),
        values: bake::tracks::Values::Lists(Vec::new()),
    }
}

fn layer<'a>(
    scene: &'a ExportedScene,
    baked: &Baked<'a>,
    sets: &Sets<'a>,
    common: &mut Common,
) -> Result<Layer<'a>, ExportError> {
    let stage: &Stage = &scene.stage;
    let frames = Frames { start: baked.start, rate: scene.fps };
    let root = names::identifier(&scene.stem);
    let (models, library) = models(stage, baked, sets, common);
    let mut top = Prim::new("Xform", root.clone());
    let mut names = Names::default();
    let all = actors::ActorWriter { stage, baked, sets, frames, path: format!("/{root}") };
    let mut known = KnownAnimations::new();
    for (index, actor) in stage.actors.iter().enumerate() {
        if baked.motions[index].hidden {
            continue;
        }
        let name = names.add_unique(&actor.name);
        let model = &models[&(Arc::as_ptr(&actor.asset) as usize)];
        top.children.push(all.actor(index, &name, model, (&mut known, common)));
    }
    top.children.extend(cameras::of_stage(stage, baked, frames, &mut names));
    top.children.extend(lights::of_stage(stage, baked, (frames, &mut names), &mut common.losses));
    top.children.extend(lights::of_sky(stage, baked, (scene.extension == "usdz", &mut names), common)?);
    losses::of_stage(stage, &mut common.losses);
    let mut prims = vec![top];
    if !library.is_empty() {
        prims.push(model::library(MODELS, library));
    }
    let provenance: Vec<(String, Meta)> =
        scene.provenance.iter().map(|(keyword, text)| (keyword.clone(), Meta::Text(text.clone()))).collect();
    Ok(Layer {
        default_prim: root,
        end: frames.time_code(baked.end),
        frames_per_second: frames.per_second(),
        comment: format!("choreo export-usd {}", MANIFEST.version),
        custom: provenance,
        prims,
    })
}

/// The models of all assets that are visible at some time, by the asset's address.
fn models<'a>(
    stage: &'a Stage,
    baked: &Baked<'a>,
    sets: &Sets<'a>,
    common: &mut Common,
) -> (BTreeMap<usize, Model<'a>>, Vec<Prim<'a>>) {
    let mut rigs: BTreeMap<usize, bool> = BTreeMap::new();
    for (index, actor) in stage.actors.iter().enumerate() {
        let moves = motion::joint_set(baked, sets, index).is_some()
            || baked.still_rig(actor, index)[1..] != *actor.asset.skeleton.rest();
        *rigs.entry(Arc::as_ptr(&actor.asset) as usize).or_default() |= moves || needs_skeleton(&actor.asset);
    }
    let (mut out, mut prims, mut names) = (BTreeMap::new(), Vec::new(), Names::default());
    for (index, actor) in stage.actors.iter().enumerate() {
        let address = Arc::as_ptr(&actor.asset) as usize;
        if baked.motions[index].hidden || out.contains_key(&address) {
            continue;
        }
        let file_name = actor.asset.name.rsplit('/').next().unwrap_or_default();
        let name =
            names.add_unique(file_name.split('.').next().filter(|name| !name.is_empty()).unwrap_or("model"));
        let place = format!("/{MODELS}");
        let (model, prim) = model::model(&actor.asset, &name, (&place, rigs[&address]), common);
        out.insert(address, model);
        prims.push(prim);
    }
    (out, prims)
}

/// Whether an asset needs a skeleton: it has skins or morph targets.
fn needs_skeleton(asset: &Asset) -> bool {
    let is_shaped = |mesh: u32| asset.meshes.get(mesh as usize).is_some_and(|mesh| mesh.morph_targets > 0);
    asset.instances.iter().any(|instance| instance.skin.is_some() || is_shaped(instance.mesh))
}

fn write(
    extension: &str,
    layer: &Layer<'_>,
    common: &Common,
    (stem, files): (&str, &mut dyn SceneFiles),
) -> Result<(), ExportError> {
    if extension != "usda" {
        // Headers are filled in at the end. An output that cannot be overwritten, such as a pipe, is refused here, before it gets
        // a byte.
        files.replace(0, &[])?;
    }
    if extension == "usdz" {
        return write_package(layer, common, stem, files);
    }
    for (ending, file) in common.textures.files()? {
        let out = files.beside(&ending)?;
        out.write_all(&file)?;
        out.flush()?;
    }
    let mut out = Out::file(files.main());
    if extension == "usda" {
        text::write(layer, &mut out)?;
        return Ok(out.finish()?);
    }
    out.put(&[0; HEADER_BYTES])?;
    let head = binary::write_body(layer, &mut out)?;
    out.finish()?;
    files.replace(0, &head)
}

/// Writes a package: the layer as a crate file, then the textures.
fn write_package(
    layer: &Layer<'_>,
    common: &Common,
    stem: &str,
    files: &mut dyn SceneFiles,
) -> Result<(), ExportError> {
    let mut out = Out::file(files.main());
    let mut archive = Archive::default();
    archive.begin(&mut out, format!("{stem}.usdc"), Contents::default())?;
    let at = out.position();
    out.begin_file();
    out.put(&[0; HEADER_BYTES])?;
    out.begin_sum()?;
    let head = binary::write_body(layer, &mut out)?;
    let mut sum = crc32fast::Hasher::new();
    sum.update(&head);
    sum.combine(&out.end_sum()?);
    let (place, checksum_and_lengths) =
        archive.end(Contents { checksum: sum.finalize(), length: out.position() })?;
    out.end_file();
    for (ending, file) in common.textures.files()? {
        let contents = Contents { checksum: crc32fast::hash(&file), length: file.len() as u64 };
        archive.begin(&mut out, format!("{stem}{ending}"), contents)?;
        out.put(&file)?;
    }
    archive.finish(&mut out)?;
    out.finish()?;
    files.replace(at, &head)?;
    files.replace(place, &checksum_and_lengths)
}
