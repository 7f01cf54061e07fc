//! A registry with an importer and an effect made for these tests, and folders of files for scripts.

#![allow(dead_code, reason = "each test file uses a part")]

use choreo_asset::{Asset, AssetCamera, Mesh, MeshInstance, MorphTarget, Primitive, Projection, Topology};
use choreo_motion::{Clip, Curve, Interpolation, Path, Skeleton, Time, Transform};
use choreo_plugin::*;
use choreo_script::{Diagnostic, Script, ScriptOptions, run_file, run_text};
use glam::Vec3;
use std::path::{Path as FilePath, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};

static TOY: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("toy", "1", "five joints and three clips")
        .extensions(["toy"])
        .number("height", "in metres", 1.8, 0.1..=10.0)
        .text("color", "of the shirt", "red", &["red", "teal"])
});

pub(crate) struct Toy;

/// Number of meshes that toy imports made in this process.
pub(crate) static MESHES_MADE: AtomicUsize = AtomicUsize::new(0);

/// Number of clips whose keys toy imports decoded in this process.
pub(crate) static CLIPS_DECODED: AtomicUsize = AtomicUsize::new(0);

/// Number of images that toy imports decoded in this process.
pub(crate) static IMAGES_DECODED: AtomicUsize = AtomicUsize::new(0);

pub(crate) const JOINTS: [&str; 5] = ["Hips", "Spine", "Head", "LeftHand", "RightHand"];

impl Importer for Toy {
    fn manifest(&self) -> &Manifest {
        &TOY
    }
    fn claim(&self, source: &Source) -> Claim {
        match source.name == "choreo:toy" || source.extension() == "toy" {
            true => Claim::Extension,
            false => Claim::NotMine,
        }
    }
    /// The file's text gives a prefix for joint names; `other_` makes joints that no other character has.
    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        _: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let text = String::from_utf8_lossy(&source.bytes).trim().to_string();
        if text == "broken" {
            return Err(ImportError {
                file: source.name.clone(),
                place: "byte 0".into(),
                what: "this is broken".into(),
                hint: Some("mend it".into()),
            });
        }
        if let Some(beside) = text.strip_prefix("beside ") {
            files.read(beside).map_err(|what| ImportError {
                file: source.name.clone(),
                place: "images[0]".into(),
                what,
                hint: None,
            })?;
        }
        let prefix = if text.starts_with("mixamorig:") || text == "other_" { text.as_str() } else { "" };
        let names = JOINTS.iter().map(|n| format!("{prefix}{n}")).collect();
        let parents = vec![None, Some(0), Some(1), Some(1), Some(1)];
        let rest = vec![Transform { translation: Vec3::Y * 0.5, ..Transform::IDENTITY }; 5];
        let clip = |index: usize, name: &str, secs: f64| {
            if !files.wants_clip(index, name) {
                return Arc::new(Clip::new(name.into(), 5, Vec::new()).unwrap());
            }
            CLIPS_DECODED.fetch_add(1, Ordering::Relaxed);
            let curve = Curve {
                joint: 1,
                path: Path::Translation,
                interpolation: Interpolation::Linear,
                times: Arc::from(vec![Time::ZERO, Time::from_secs(secs)]),
                values: Arc::from(vec![0.0, 0.5, 0.0, 1.0, 0.5, 0.0]),
            };
            Arc::new(Clip::new(name.into(), 5, vec![curve]).unwrap())
        };
        let primitive = Primitive {
            topology: Topology::Triangles,
            indices: vec![0, 1, 2],
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            morphs: vec![MorphTarget { positions: vec![Vec3::Z; 3], ..MorphTarget::default() }],
            ..Primitive::default()
        };
        let mesh = Mesh {
            name: "body".into(),
            primitives: vec![primitive],
            morph_targets: 1,
            morph_names: vec!["smile".into()],
        };
        if needs.geometry {
            MESHES_MADE.fetch_add(1, Ordering::Relaxed);
        }
        if needs.textures && needs.pixels {
            IMAGES_DECODED.fetch_add(1, Ordering::Relaxed);
        }
        let mesh_count = usize::from(needs.geometry);
        Ok(Asset {
            skeleton: Arc::new(Skeleton::new(names, parents, rest).unwrap()),
            meshes: std::iter::repeat_n(Arc::new(mesh), mesh_count).collect(),
            instances: vec![
                MeshInstance {
                    joint: 0,
                    mesh: 0,
                    skin: None,
                    weights: vec![0.0],
                    ..Default::default()
                };
                mesh_count
            ],
            cameras: vec![AssetCamera { name: "eye".into(), joint: 2, projection: Projection::default() }],
            clips: vec![clip(0, "Walk", 1.0), clip(1, "Run", 0.8), clip(2, "Wave", 2.0)],
            ..Asset::default()
        })
    }
}

static GLOW: LazyLock<Manifest> =
    LazyLock::new(|| Manifest::new("glow", "1", "for tests").number("strength", "how much", 0.5, 0.0..=1.0));

pub(crate) struct Glow;

impl EffectPlugin for Glow {
    fn manifest(&self) -> &Manifest {
        &GLOW
    }
}

impl ShutterEffect for Glow {
    fn shutter(&self, _: &[f32]) -> Option<Shutter> {
        None
    }
}

static LINE: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("line", "1", "for tests")
        .number("width", "of the line", 2.0, 0.0..=10.0)
        .unit("px")
        .color("color", "of the line", [0.0; 3])
        .integer("count", "how many", 1, 1..=9)
        .text("cap", "its ends", "round", &["round", "square"])
        .vector("drift", "where it goes", &[0.0, 0.0], -1.0..=1.0)
        .unit("m")
        .curve("fall", "how it fades", &[[0.0, 1.0], [1.0, 0.0]], 0.0..=1.0)
});

pub(crate) struct Line;

impl EffectPlugin for Line {
    fn manifest(&self) -> &Manifest {
        &LINE
    }
}

impl OutlineEffect for Line {}

pub(crate) fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add_importer(Toy);
    registry.add_effect(Effect::shutter(Glow));
    registry.add_effect(Effect::outline(Line));
    registry
}

/// Temporary folder with files, removed when dropped.
pub(crate) struct Folder(pub tempfile::TempDir);

impl Folder {
    pub(crate) fn new(files: &[(&str, &str)]) -> Folder {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        Folder(dir)
    }
    pub(crate) fn path(&self) -> &FilePath {
        self.0.path()
    }
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }
    pub(crate) fn run(&self, name: &str) -> Result<Script, Vec<Diagnostic>> {
        run_file(&self.file(name), &registry(), &ScriptOptions::default())
    }
    pub(crate) fn run_text(&self, text: &str, options: &ScriptOptions) -> Result<Script, Vec<Diagnostic>> {
        run_text("t.rhai", text, self.path(), &registry(), options)
    }
}

/// The files that most tests use.
pub(crate) fn assets() -> Folder {
    Folder::new(&[
        ("hero.toy", ""),
        ("moves.toy", "mixamorig:"),
        ("alien.toy", "other_"),
        ("broken.toy", "broken"),
        ("textured.toy", "beside ../secret.png"),
        ("models/knight.toy", ""),
        ("notes.txt", "nothing"),
    ])
}

pub(crate) fn run(text: &str) -> Result<Script, Vec<Diagnostic>> {
    assets().run_text(text, &ScriptOptions::default())
}

/// Runs a script; panics with its messages if there are errors.
pub(crate) fn run_or_panic(text: &str) -> Script {
    run(text).unwrap_or_else(|e| panic!("{}", show(&e)))
}

pub(crate) fn show(diagnostics: &[Diagnostic]) -> String {
    diagnostics.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// The stage of a script that loads characters of the sample files in a folder.
pub(crate) fn stage_of_samples(folder: &FilePath, text: &str) -> choreo_stage::Stage {
    let mut registry = Registry::default();
    registry.add_importer(import_gltf::GltfImporter);
    registry.add_importer(import_fbx::FbxImporter);
    registry.add_importer(import_vrm::VrmImporter);
    registry.add_importer(import_bvh::BvhImporter);
    registry.add_importer(import_collada::ColladaImporter);
    registry.add_importer(import_mannequin::Mannequin);
    let options = ScriptOptions { search_paths: vec![folder.to_path_buf()], ..ScriptOptions::default() };
    let ran = run_text("samples.rhai", text, folder, &registry, &options);
    ran.unwrap_or_else(|e| panic!("{e:?}\n{text}")).stage
}
