//! Joint positions over time as text, one line for each frame, actor and joint. The one to copy for a format of your own.

#[doc(hidden)]
pub mod files;

use choreo_plugin::{ExportError, ExportedScene, Manifest, SceneExporter, SceneFiles};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("csv", env!("CARGO_PKG_VERSION"), "joint positions over time, comma-separated")
        .extensions(["csv"])
        .number("digits", "decimal places of the metres", 6.0, 0.0..=15.0)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct CsvExporter;

// Makes a plugin file of the crate in builds for WebAssembly; expands to nothing in others.
choreo_plugin::wasm_exporter!(CsvExporter);

impl SceneExporter for CsvExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        let digits = scene.options.number("digits").unwrap_or(6.0) as usize;
        let mut evaluator = scene.evaluator();
        let out = files.main();
        writeln!(out, "seconds,actor,joint,x,y,z")?;
        for time in &scene.times {
            let snapshot = evaluator.at(*time)?;
            for (actor, state) in scene.stage.actors.iter().zip(&snapshot.actors) {
                for (joint, name) in actor.asset.skeleton.names().iter().enumerate() {
                    let Some(world_from_joint) = state.world_from_joint(joint) else { continue };
                    let [x, y, z] = world_from_joint.translation.to_array();
                    let (secs, actor, joint) = (time.as_secs(), field(&actor.name), field(name));
                    writeln!(out, "{secs:.6},{actor},{joint},{x:.digits$},{y:.digits$},{z:.digits$}")?;
                }
            }
        }
        Ok(Vec::new())
    }
}

/// A field that holds a separator stands in quotes (RFC 4180).
fn field(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    }
}
