//! Vulkan against the CPU reference on every glTF file of the shared assets: mean and worst difference, share of differing
//! pixels, bounded. Skipped aloud where assets or a Vulkan driver are missing.

use choreo_image_diff::compare;
use choreo_motion::Time;
use choreo_plugin::{Files, Frame, ImportOptions, ImportScope, Importer, Source};
use choreo_render::*;
use choreo_stage::{Camera, Cue, Rig, Stage};
use std::path::{Path, PathBuf};
use std::sync::Arc;

struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        std::fs::read(self.0.join(relative)).map(Arc::new).map_err(|e| e.to_string())
    }
}

fn assets() -> PathBuf {
    match std::env::var_os("CHOREO_ASSETS") {
        Some(folder) => folder.into(),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets"),
    }
}

fn gltf_files(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            gltf_files(&path, out);
        } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
            out.push(path);
        }
    }
}

fn stage_of(path: &Path) -> Stage {
    let bytes = Arc::new(std::fs::read(path).unwrap());
    let source = Source { name: path.display().to_string(), bytes };
    let folder = Folder(path.parent().unwrap().into());
    let importer = import_gltf::GltfImporter::new();
    let asset =
        Arc::new(importer.import(&source, &folder, ImportScope::ALL, &ImportOptions::default()).unwrap());
    let mut stage = Stage::default();
    let actor = stage.cast("file", asset.clone());
    stage.actors[actor].file_lights = true;
    if let Some(clip) = asset.clips.first() {
        stage.play(actor, Cue::new(clip.clone()));
    }
    stage.shoot(Camera::new("frame", Rig::Frame { azimuth: 0.3, elevation: 0.2 }));
    stage
}

fn draw_plan(r: &mut dyn Renderer, resources: &Arc<SceneResources>, plan: &Plan) -> Frame {
    r.load(resources.clone()).unwrap();
    r.submit(plan.clone()).unwrap();
    r.collect(None).unwrap()
}

#[test]
fn both_renderers_draw_every_asset_file_the_same() {
    let mut files = Vec::new();
    gltf_files(&assets().join("gltf"), &mut files);
    files.sort();
    if files.is_empty() {
        println!("SKIP 1: no files in {}", assets().display());
        return;
    }
    let mut vulkan = match VulkanRenderer::new(GpuOptions { validation: true, ..GpuOptions::default() }) {
        Ok(r) => r,
        Err(RenderError::NoVulkan { why }) => {
            println!("SKIP 1: {why}");
            return;
        }
        Err(e) => panic!("{e}"),
    };
    let mut cpu = CpuRenderer::new(&[]);
    let mut bad = Vec::new();
    for path in &files {
        let stage = stage_of(path);
        let resources = Arc::new(SceneResources::new(&stage));
        let snapshot = stage.at(Time::from_secs(0.4)).unwrap();
        for samples in [1, 4] {
            let plan = Plan::new(&resources, &stage, &snapshot, &PlanOptions::new([240, 180], samples));
            let (a, b) = (draw_plan(&mut vulkan, &resources, &plan), draw_plan(&mut cpu, &resources, &plan));
            let c = compare(&a, &b, 4).unwrap();
            let line = format!("{} ×{samples}: {c}", path.file_name().unwrap().display());
            println!("{line}");
            // Single pixels may differ: an edge that passes a sample within the rasterizer's 1/256 of a pixel, two surfaces at
            // the same depth.
            if c.mean > 0.2 || c.share_beyond > 0.002 {
                bad.push(line);
            }
        }
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}
