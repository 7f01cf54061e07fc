//! Script text: any bytes that are text are run within low limits; what becomes of them is evaluated at some times.
#![no_main]

use choreo_fuzz::assert_finite;
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_script::{Limits, ScriptOptions, run_text};
use choreo_stage::Evaluator;
use libfuzzer_sys::{Corpus, fuzz_target};
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

static REGISTRY: LazyLock<Registry> = LazyLock::new(|| {
    let mut registry = Registry::default();
    registry.add_importer(import_mannequin::Mannequin);
    registry.add_importer(import_gltf::GltfImporter::new());
    effects::named(&["vignette"]).into_iter().for_each(|effect| registry.add_effect(effect));
    registry
});

/// An empty folder, so that scripts can load only built-in assets.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("choreo-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for temporary files can be made");
    folder
});

fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Ok(text) = std::str::from_utf8(bytes) else { return Corpus::Reject };
    let limits = Limits {
        operations: 20_000,
        frame_operations: 2_000,
        seconds: 2.0,
        actors: 20,
        lights: 20,
        things: 50,
        keys: 2_000,
        string: 10_000,
        array: 2_000,
        map: 500,
        ..Limits::default()
    };
    let options = ScriptOptions { limits, ..ScriptOptions::default() };
    match run_text("fuzz.rhai", text, &FOLDER, &REGISTRY, &options) {
        Err(errors) => {
            assert!(!errors.is_empty());
            errors.iter().for_each(|e| assert!(e.to_string().len() < 20_000));
        }
        Ok(script) => {
            let stage = Arc::new(script.stage);
            assert!(stage.check().is_empty(), "{:?}", stage.check());
            let mut evaluator = Evaluator::new(stage);
            for secs in [0.0, 0.5, 3.9] {
                if let Ok(snapshot) = evaluator.at(Time::from_secs(secs)) {
                    assert_finite(&snapshot);
                }
            }
        }
    }
    Corpus::Keep
});
