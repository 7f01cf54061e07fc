//! What the fuzz targets share: an importer's asset is put on stage, evaluated and drawn, so that what an importer lets
//! through is proved harmless further down.

use choreo_motion::Time;
use choreo_plugin::{Files, Importer, Needs, Source};
use choreo_render::{Catalog, CpuRenderer, Plan, PlanOptions, Renderer};
use choreo_stage::{Asset, Cue, Evaluator, Snapshot, Stage};
use std::sync::Arc;

/// A folder with nothing in it.
pub struct Nothing;

impl Files for Nothing {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("cannot read \"{relative}\": no such file"))
    }
}

/// Imports bytes under a name; what is good is played and drawn.
pub fn import(importer: &dyn Importer, name: &str, bytes: &[u8]) {
    let source = Source { name: name.to_string(), bytes: Arc::new(bytes.to_vec()) };
    importer.claim(&source);
    match importer.import(&source, &Nothing, Needs::ALL, &Default::default()) {
        Ok(asset) => play(Arc::new(asset)),
        Err(error) => assert!(!error.what.is_empty() && error.to_string().starts_with(name)),
    }
}

/// Sums that a picture of sixteen pixels is not worth drawing for.
fn small(asset: &Asset) -> bool {
    let primitives = asset.meshes.iter().flat_map(|m| &m.primitives);
    let vertices: usize = primitives.map(|p| p.positions.len() + p.indices.len()).sum();
    vertices * asset.instances.len().max(1) < 20_000 && asset.skeleton.len() < 2_000
}

fn play(asset: Arc<Asset>) {
    if !small(&asset) {
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
    let catalog = Arc::new(Catalog::new(evaluator.stage()));
    let mut renderer = CpuRenderer::new(&[]);
    let drawable = renderer.load(catalog.clone()).is_ok();
    for secs in [0.0, 0.07, 1e4] {
        let Ok(snapshot) = evaluator.at(Time::from_secs(secs)) else { continue };
        finite(&snapshot);
        if drawable {
            let plan = Plan::new(&catalog, evaluator.stage(), &snapshot, &PlanOptions::new([16, 12], 1));
            renderer.submit(plan).expect("the CPU renderer draws whatever a plan holds");
            renderer.collect(None).expect("a picture was submitted");
        }
    }
}

/// Cameras and places never turn into NaN, whatever the numbers of a file.
pub fn finite(snapshot: &Snapshot) {
    assert!(snapshot.camera.world_from_view.is_finite(), "{:?}", snapshot.camera);
    for actor in &snapshot.actors {
        assert!(!actor.world_from_model.is_nan(), "{:?}", actor.world_from_model);
    }
}
