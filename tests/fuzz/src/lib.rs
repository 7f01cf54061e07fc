//! The common part of the fuzz targets: an importer's asset is put on stage, evaluated and drawn, so that a file which an importer
//! accepts is proved harmless further down.

use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Manifest, OptionKind, OptionValue, Source};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_stage::{Cue, Evaluator, Snapshot, Stage};
use std::sync::Arc;

/// A folder with nothing in it.
pub struct NoFiles;

impl Files for NoFiles {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("cannot read \"{relative}\": no such file"))
    }
}

/// A folder in which every name leads to the same bytes.
pub struct SingleFile<'a>(pub &'a [u8]);

impl Files for SingleFile<'_> {
    fn read(&self, _: &str) -> Result<Arc<Vec<u8>>, String> {
        Ok(Arc::new(self.0.to_vec()))
    }
}

/// Imports bytes under a name; what is good is played and drawn. Half of all lengths stand for options and needs other than
/// the default ones: no byte is taken from the format for it.
pub fn import(importer: &dyn Importer, name: &str, bytes: &[u8], files: &dyn Files) {
    let source = Source { name: name.to_string(), bytes: Arc::new(bytes.to_vec()) };
    importer.claim(&source);
    let choice = if bytes.len() & 8 == 0 { 0 } else { bytes.len() as u64 };
    let needs = match choice & 7 {
        1 => ImportScope { clips: false, ..ImportScope::ALL },
        2 => ImportScope { geometry: false, ..ImportScope::ALL },
        _ => ImportScope::ALL,
    };
    match importer.import(&source, files, needs, &options(importer.manifest(), choice)) {
        Ok(asset) => play(Arc::new(asset)),
        Err(error) => assert!(!error.what.is_empty() && error.to_string().starts_with(name)),
    }
}

/// Values within each option's range; the defaults where `choice` is 0.
fn options(manifest: &Manifest, choice: u64) -> ImportOptions {
    let mut random = choice;
    let mut all = ImportOptions::default();
    for option in manifest.options.iter().filter(|_| choice > 0) {
        // Knuth's multiplicative generator (MMIX).
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let pick = (random >> 33) as usize;
        let value = match &option.kind {
            OptionKind::Number { default, min, max } => {
                OptionValue::Number([*default, *min, *max, default / 2.0 + min / 2.0][pick % 4])
            }
            OptionKind::Bool { .. } => OptionValue::Bool(pick % 2 == 1),
            OptionKind::Text { one_of, .. } if !one_of.is_empty() => {
                OptionValue::Text(one_of[pick % one_of.len()].clone())
            }
            _ => option.default(),
        };
        all.0.insert(option.name.clone(), value);
    }
    manifest.complete(&all).expect("the values are within the manifest's ranges")
}

/// Sums that an image of sixteen pixels is not worth drawing for.
fn is_small(asset: &Asset) -> bool {
    let primitives = asset.meshes.iter().flat_map(|m| &m.primitives);
    let vertices: usize = primitives.map(|p| p.positions.len() + p.indices.len()).sum();
    vertices * asset.instances.len().max(1) < 20_000 && asset.skeleton.len() < 2_000
}

fn play(asset: Arc<Asset>) {
    if !is_small(&asset) {
        return;
    }
    let mut stage = Stage::default();
    stage.settings.size = [16, 12];
    stage.settings.length = Time::from_secs(0.2);
    let actor = stage.cast("model", asset.clone());
    if let Some(clip) = asset.clips.last() {
        stage.play(actor, Cue::new(clip.clone()));
    }
    assert!(stage.check().is_empty(), "an importer let something through: {:?}", stage.check());
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let resources = Arc::new(SceneResources::new(evaluator.stage()));
    let mut renderer = CpuRenderer::new(&[]);
    let drawable = renderer.load(resources.clone()).is_ok();
    for secs in [0.0, 0.07, 1e4] {
        let Ok(snapshot) = evaluator.at(Time::from_secs(secs)) else { continue };
        assert_finite(&snapshot);
        if drawable {
            let plan = Plan::new(&resources, evaluator.stage(), &snapshot, &PlanOptions::new([16, 12], 1));
            renderer.submit(plan).expect("the CPU renderer draws whatever a plan holds");
            renderer.collect(None).expect("an image was submitted");
        }
    }
}

/// Asserts that the camera is finite, and that no transform of an actor contains NaN.
pub fn assert_finite(snapshot: &Snapshot) {
    assert!(snapshot.camera.world_from_view.is_finite(), "{:?}", snapshot.camera);
    for actor in &snapshot.actors {
        assert!(!actor.world_from_model.is_nan(), "{:?}", actor.world_from_model);
    }
}
