//! Comparison of WebAssembly plugins with the same source compiled into the test: assets, errors and files must be equal.

#[path = "import-ply/src/lib.rs"]
mod import_ply;

use choreo_importer_kit_testing::{Companions, damage, wasm};
use choreo_motion::{Curve, FrameRate, Interpolation, Path, Time, Transform};
use choreo_plugin::{
    AssetBuilder, ExportedScene, ImportOptions, ImportScope, Importer, MemoryFiles, OptionValue, Registry,
    SceneExporter, Source,
};
use choreo_stage::{Cue, FrameCallback, FrameEdits, Stage, StageError};
use choreo_wasm_plugin::{WasmExporter, WasmImporter};
use export_csv::CsvExporter;
use import_ply::PlyImporter;
use std::sync::Arc;

const SQUARE: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0.5\n0 1 0\n4 0 1 2 3\n";

fn binary() -> Vec<u8> {
    let mut bytes =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n"
            .to_vec();
    for vertex in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        bytes.extend(vertex.iter().chain(&[0.0, 0.0, 1.0]).flat_map(|v| v.to_le_bytes()));
    }
    bytes.push(3);
    bytes.extend([0u32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// A grid of `side` × `side` vertices, whose lists are long enough to be passed by address.
fn grid(side: usize) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        side * side,
        (side - 1) * (side - 1)
    );
    for i in 0..side * side {
        let (x, z) = (i % side, i / side);
        text += &format!("{x}.25 {}e-3 {z}\n", x * z);
    }
    for i in (0..side * (side - 1)).filter(|i| i % side != side - 1) {
        text += &format!("4 {i} {} {} {}\n", i + side, i + side + 1, i + 1);
    }
    text
}

fn build_plugin() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::read(wasm::import_ply(folder.path())).unwrap()
}

/// The asset's hash and mesh, or the error.
fn result(importer: impl Importer + 'static, bytes: &[u8], scale: f64) -> Result<String, String> {
    let mut registry = Registry::default();
    registry.add_importer(importer);
    let source = Source { name: "a.ply".into(), bytes: Arc::new(bytes.to_vec()) };
    let options = ImportOptions([("scale".to_string(), OptionValue::Number(scale))].into());
    let asset = registry.import(&source, &Companions::none(), ImportScope::ALL, &options, None);
    asset.map(|asset| format!("{:?} {:?}", asset.meshes, asset.origin)).map_err(|e| e.to_string())
}

#[test]
fn the_wasm_importer_gives_the_results_of_the_compiled_crate() {
    let bytes = build_plugin();
    assert_eq!(WasmImporter::from_bytes(&bytes).unwrap().manifest(), PlyImporter.manifest());
    let large = grid(60);
    for file in
        [SQUARE.as_bytes(), &binary(), large.as_bytes(), b"ply\nformat ascii 1.0\nelement odd 1\n", b"ply\n"]
    {
        for scale in [1.0, 0.25] {
            let guest = WasmImporter::from_bytes(&bytes).unwrap();
            assert_eq!(result(guest, file, scale), result(PlyImporter, file, scale));
        }
    }
    let square = result(PlyImporter, SQUARE.as_bytes(), 1.0).unwrap();
    assert!(square.contains("indices: [0, 1, 2, 0, 2, 3]"), "{square}");
}

#[test]
fn damaged_files_give_errors_or_valid_assets() {
    let guest = WasmImporter::from_bytes(&build_plugin()).unwrap();
    for (name, bytes) in [("square.ply", SQUARE.as_bytes().to_vec()), ("binary.ply", binary())] {
        let outcome = damage::run(&guest, name, &bytes, 50);
        assert!(outcome.refused > 0 && outcome.read > 0, "{name}: {outcome:?}");
    }
}

/// Two actors of one asset, whose arm a clip turns.
fn scene() -> ExportedScene {
    let mut builder = AssetBuilder::default();
    let arm = builder.joint("arm", None, Transform::IDENTITY).unwrap();
    let hand = Transform { translation: glam::Vec3::X * 0.5, ..Transform::IDENTITY };
    builder.joint("hand, left", Some(arm), hand).unwrap();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turn = Curve {
        joint: arm,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: [Time::ZERO, Time::from_secs(1.0)].into(),
        values: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half].into(),
    };
    builder.clip("turn", vec![turn]);
    let asset = Arc::new(builder.finish("arm").unwrap());
    let mut stage = Stage::default();
    let clip = asset.clips[0].clone();
    for (name, x) in [("ada", 2.0), ("bob", 1e7)] {
        let actor = stage.cast(name, asset.clone());
        stage.actors[actor].transform.translation.x = x;
        stage.play(actor, Cue::new(clip.clone()));
    }
    stage.settings.fps = FrameRate { num: 4, den: 1 };
    stage.settings.length = Time::from_secs(1.0);
    ExportedScene::new("a.rhai", Arc::new(stage))
}

/// A callback that fails at half a second and later.
#[derive(Debug)]
struct FailingCallback;

impl FrameCallback for FailingCallback {
    fn run(&self, time: Time, _: &mut FrameEdits) -> Result<(), StageError> {
        match time < Time::from_secs(0.5) {
            true => Ok(()),
            false => Err(StageError::Invalid { place: "frame".into(), what: "no such time".into() }),
        }
    }
}

/// The file and notes, or the error.
fn exported(exporter: &dyn SceneExporter, scene: &ExportedScene) -> Result<String, String> {
    let mut files = MemoryFiles::default();
    let notes = exporter.export(scene, &mut files).map_err(|e| e.to_string())?;
    assert!(notes.is_empty() && files.beside.is_empty());
    Ok(String::from_utf8(files.main).unwrap())
}

#[test]
fn the_wasm_exporter_writes_the_files_of_the_compiled_crate() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(wasm::export_csv(folder.path())).unwrap();
    let guest = WasmExporter::from_bytes(&bytes).unwrap();
    assert_eq!(guest.manifest(), CsvExporter.manifest());
    let mut scene = scene();
    scene.options.0.insert("digits".into(), OptionValue::Number(9.0));
    let text = exported(&guest, &scene).unwrap();
    assert_eq!(text, exported(&CsvExporter, &scene).unwrap());
    // A quarter turn takes the hand from beside the arm to above it.
    assert!(text.contains("0.000000,ada,\"hand, left\",2.500000000,0.000000000,0.000000000\n"), "{text}");
    let last = text.lines().rfind(|line| line.contains("ada,\"hand")).unwrap();
    let height: f64 = last.split(',').nth_back(1).unwrap().parse().unwrap();
    let angle = 0.75 * std::f64::consts::FRAC_PI_2;
    assert!((height - 0.5 * libm::sin(angle)).abs() < 1e-3, "{last}");
    // An error of the stage ends the export with the message of the stage.
    let mut faulty = Stage::clone(&scene.stage);
    faulty.frame_callbacks.push(Arc::new(FailingCallback));
    scene.stage = Arc::new(faulty);
    let error = exported(&guest, &scene);
    assert_eq!(error, Err("frame: no such time".to_string()));
    assert_eq!(error, exported(&CsvExporter, &scene));
}
