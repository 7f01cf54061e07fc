//! Equal bits on machines with different processors, as far as one machine can test it: stored hashes of poses and images, and a search of
//! the sources for functions whose results depend on the processor or the system.
//!
//! The hashes were the same with AVX2, on `qemu-x86_64 -cpu Nehalem` (no AVX, no FMA) and `-cpu Haswell`. When a change
//! of formulas is meant to change images, `CHOREO_ACCEPT=1 cargo test -p choreo --test machines -- --nocapture` prints
//! the new ones.

#[path = "common/long_time_limits.rs"]
mod long_time_limits;

use choreo_motion::{Level, LocalToModel, Pose, Sample, Time};
use choreo_plugin::{Files, ImportScope, Importer, Registry, Source};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_script::run_file;
use choreo_stage::Evaluator;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

struct NoFiles;

impl Files for NoFiles {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("{relative}: no such file"))
    }
}

/// Hash of every joint of every clip of the built-in character at 25 times, some of them before the start and after the end of the clip.
fn pose_hash(level: Level) -> String {
    let source = Source { name: "choreo:mannequin".into(), bytes: Arc::default() };
    let asset =
        import_mannequin::Mannequin.import(&source, &NoFiles, ImportScope::ALL, &Default::default()).unwrap();
    let mut hasher = blake3::Hasher::new();
    for clip in &asset.clips {
        for i in -2..23 {
            let time = clip.duration.scaled(f64::from(i) / 20.0);
            let mut pose = Pose::rest(&asset.skeleton);
            Sample { clip, time, pose: &mut pose }.run_on(level);
            let mut model = vec![glam::Affine3A::IDENTITY; asset.skeleton.len()];
            let mut job =
                LocalToModel { skeleton: &asset.skeleton, pose: &pose, model_from_joint: &mut model };
            job.run_on(level);
            for number in model.iter().flat_map(|m| m.to_cols_array()) {
                hasher.update(&number.to_bits().to_le_bytes());
            }
        }
    }
    assert!(asset.clips.len() >= 8);
    hasher.finalize().to_hex()[..16].to_string()
}

fn image_hash(name: &str, secs: &[f64]) -> String {
    let mut registry = Registry::default();
    registry.add_importer(import_mannequin::Mannequin);
    effects::named(&["vignette"]).into_iter().for_each(|effect| registry.add_effect(effect));
    let mut stage =
        run_file(&root().join("scripts").join(name), &registry, &long_time_limits::script_options())
            .unwrap()
            .stage;
    stage.settings.size = [160, 90];
    let resources = Arc::new(SceneResources::new(&stage));
    let mut renderer = CpuRenderer::new(registry.effects());
    renderer.load(resources.clone()).unwrap();
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let options = PlanOptions { effects: registry.effects(), ..PlanOptions::new([160, 90], 4) };
    let mut hasher = blake3::Hasher::new();
    for secs in secs {
        let snapshot = evaluator.at(Time::from_secs(*secs)).unwrap();
        renderer.submit(Plan::new(&resources, evaluator.stage(), &snapshot, &options)).unwrap();
        hasher.update(&renderer.collect(None).unwrap().rgba);
    }
    hasher.finalize().to_hex()[..16].to_string()
}

fn assert_stored_hash(what: &str, found: &str, stored: &str) {
    if std::env::var_os("CHOREO_ACCEPT").is_some() {
        println!("{what}: {found}");
        return;
    }
    assert_eq!(
        found, stored,
        "{what}: the hash differs from that of other machines. After an intended change of formulas, write the new hash into this test; \
         if only the machine changed, some code depends on the processor"
    );
}

#[test]
fn poses_have_the_hash_of_other_machines() {
    assert_eq!(pose_hash(Level::Portable), pose_hash(Level::best()), "one machine's own levels");
    assert_stored_hash("poses", &pose_hash(Level::best()), POSE_HASH);
}

#[test]
fn images_have_the_hashes_of_other_machines() {
    for (name, secs, stored) in IMAGE_HASHES {
        assert_stored_hash(name, &image_hash(name, secs), stored);
    }
}

/// The sources use no function whose result depends on the processor, the system or the time.
#[test]
fn the_sources_use_no_platform_dependent_functions() {
    // Rust does not specify the precision of these methods; `mul_add` may round once or twice; the types read the clock or random numbers.
    const METHODS: &[&str] = &[
        ".sin()",
        ".cos()",
        ".tan()",
        ".asin()",
        ".acos()",
        ".atan()",
        ".atan2(",
        ".sin_cos()",
        ".sinh()",
        ".cosh()",
        ".tanh()",
        ".exp()",
        ".exp2()",
        ".exp_m1()",
        ".ln()",
        ".ln_1p()",
        ".log(",
        ".log2()",
        ".log10()",
        ".powf(",
        ".powi(",
        ".cbrt()",
        ".hypot(",
        ".mul_add(",
    ];
    const TYPES: &[&str] = &["SystemTime", "thread_rng", "RandomState"];
    // `mul_add` rounds once on every machine here: an instruction on 64-bit ARM, f64 arithmetic elsewhere.
    const FUSED_FILES: &[&str] = &["core/motion/src/simd/fused.rs"];
    // These files only compare modification times of files.
    const CLOCK_FILES: &[&str] = &[
        "core/command_line/src/commands/test/watch.rs",
        "core/language_server/src/files.rs",
        "core/language_server/src/view.rs",
        "core/script/src/cache.rs",
        // The thumbnails that were shown last are kept.
        "core/viewer/src/library/thumbnail_file.rs",
    ];
    // A random number makes the name of a folder unique.
    const RANDOM_FILES: &[&str] = &["core/files/src/part_folder.rs"];
    let mut read = 0;
    let mut found = Vec::new();
    let mut open: Vec<PathBuf> = ["core", "plugins"].iter().map(|f| root().join(f)).collect();
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()) {
            let name = entry.file_name().unwrap().to_string_lossy().into_owned();
            // Tests and benchmarks compare with the system's mathematics.
            if entry.is_dir() && !["tests", "benches", "examples", "target"].contains(&name.as_str()) {
                open.push(entry);
            } else if name.ends_with(".rs") {
                read += 1;
                let is = |files: &[&str]| files.iter().any(|file| entry.ends_with(file));
                let allowed = |of: &str| match of {
                    "SystemTime" => is(CLOCK_FILES),
                    "RandomState" => is(RANDOM_FILES),
                    _ => false,
                };
                let types: Vec<&str> = TYPES.iter().copied().filter(|of| !allowed(of)).collect();
                let fused = FUSED_FILES.iter().any(|f| entry.ends_with(f));
                let methods: Vec<&str> =
                    METHODS.iter().copied().filter(|m| !(fused && *m == ".mul_add(")).collect();
                found.extend(platform_dependent_uses(&entry, &methods, &types));
            }
        }
    }
    assert!(read > 100, "{read} files");
    assert!(found.is_empty(), "{} places:\n{}", found.len(), found.join("\n"));
    // A planted fault is found.
    let planted = tempfile::tempdir().unwrap();
    let file = planted.path().join("x.rs");
    std::fs::write(&file, "fn f(x: f32) -> f32 {\n    // x.cos()\n    x.sin()\n}\n").unwrap();
    assert_eq!(platform_dependent_uses(&file, METHODS, TYPES).len(), 1);
}

fn platform_dependent_uses(file: &Path, methods: &[&str], types: &[&str]) -> Vec<String> {
    let text = std::fs::read_to_string(file).unwrap();
    // The code below is the file's own tests.
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let shown = file.strip_prefix(root()).unwrap_or(file).display().to_string();
    let mut found = Vec::new();
    for (number, line) in code.lines().enumerate() {
        let line = line.split("//").next().unwrap_or_default();
        let of_libm = line.contains("libm::");
        for what in methods
            .iter()
            .filter(|m| !of_libm && line.contains(**m))
            .chain(types.iter().filter(|t| line.contains(**t)))
        {
            found.push(format!("{shown}:{}: {what}", number + 1));
        }
    }
    found
}

const POSE_HASH: &str = "28b2f144c66d6d9c";
const IMAGE_HASHES: &[(&str, &[f64], &str)] = &[
    ("01_first_dance.rhai", &[0.5, 3.2], "59125a215dd34854"),
    ("05_lights.rhai", &[1.0], "7d155636b62eb2cd"),
    ("07_keys_and_frames.rhai", &[1.4, 2.9], "bf0da5cfb1084e72"),
];
