//! Benchmark of the import time, as a whole and by part: `cargo bench -p import-gltf [-- FILE…]`, median and best of 21 runs.
//! Each part is measured alone, by requesting nothing else. Images are decoded in parallel with the rest.

use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Source};
use import_gltf::GltfImporter;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        std::fs::read(self.0.join(relative)).map(Arc::new).map_err(|e| e.to_string())
    }
}

fn main() {
    let assets = std::env::var_os("CHOREO_ASSETS").map(PathBuf::from);
    let assets =
        assets.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets"));
    let given: Vec<PathBuf> =
        std::env::args().skip(1).filter(|a| !a.starts_with('-')).map(PathBuf::from).collect();
    let files = match given.is_empty() {
        true => ["Knight.glb", "Fox.glb", "RobotExpressive.glb", "NormalTangentTest.glb"]
            .map(|f| assets.join("gltf").join(f))
            .to_vec(),
        false => given,
    };
    let nothing =
        ImportScope { geometry: false, clips: false, textures: false, pixels: false, image_files: false };
    let cases = [
        ("all", ImportScope::ALL),
        ("JSON and nodes only", nothing),
        ("+ geometry", ImportScope { geometry: true, ..nothing }),
        ("+ clips", ImportScope { clips: true, ..nothing }),
        ("+ textures", ImportScope { textures: true, pixels: true, ..nothing }),
    ];
    for path in files {
        let Ok(bytes) = std::fs::read(&path) else {
            println!("skipped: {} is not there", path.display());
            continue;
        };
        let source = Source { name: path.display().to_string(), bytes: Arc::new(bytes) };
        let folder = Folder(path.parent().map(Path::to_path_buf).unwrap_or_default());
        for (name, needs) in cases {
            let mut times: Vec<f64> = (0..21)
                .map(|_| {
                    let start = Instant::now();
                    let asset =
                        GltfImporter::new().import(&source, &folder, needs, &ImportOptions::default());
                    let time = start.elapsed().as_secs_f64() * 1000.0;
                    assert!(std::hint::black_box(asset).is_ok());
                    time
                })
                .collect();
            times.sort_by(f64::total_cmp);
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            println!("{file}: {name}: {:.2} ms (best {:.2})", times[times.len() / 2], times[0]);
        }
    }
}
