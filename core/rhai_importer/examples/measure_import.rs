//! How long an importer in a script takes for 5 MB of vertices and indices:
//! `cargo run --release -p choreo-rhai-importer --example measure_import`.

use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Source};
use choreo_rhai_importer::RhaiImporter;
use std::sync::Arc;
use std::time::Instant;

const IMPORTER: &str = r#"
fn manifest() { #{ name: "grid" } }

fn load(file) {
    let b = file.bytes;
    let vertices = b.u32(0);
    let uvs = 4 + vertices * 24;
    let indices = uvs + vertices * 8;
    mesh(#{
        positions: b.f32s(4, vertices, #{ width: 3, stride: 24 }),
        normals: b.f32s(16, vertices, #{ width: 3, stride: 24 }),
        uvs: b.f32s(uvs, vertices * 2),
        indices: b.u32s(indices, (b.len - indices) / 4),
    });
}
"#;

struct None;

impl Files for None {
    fn read(&self, name: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("no file {name}"))
    }
}

fn main() {
    const SIDE: u32 = 300;
    let mut bytes = (SIDE * SIDE).to_le_bytes().to_vec();
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    for i in 0..SIDE * SIDE {
        bytes.extend(floats(&[(i % SIDE) as f32, 0.0, (i / SIDE) as f32, 0.0, 1.0, 0.0]));
    }
    for i in 0..SIDE * SIDE {
        bytes.extend(floats(&[(i % SIDE) as f32 / SIDE as f32, (i / SIDE) as f32 / SIDE as f32]));
    }
    for z in 0..SIDE - 1 {
        for x in 0..SIDE - 1 {
            let a = z * SIDE + x;
            bytes.extend(
                [a, a + SIDE, a + 1, a + 1, a + SIDE, a + SIDE + 1].iter().flat_map(|i| i.to_le_bytes()),
            );
        }
    }
    let size = bytes.len();
    let source = Source { name: "grid.bin".into(), bytes: Arc::new(bytes) };
    let importer = RhaiImporter::from_text("grid.importer.rhai", IMPORTER).unwrap_or_else(|e| panic!("{e}"));
    let mut times: Vec<f64> = (0..5)
        .map(|_| {
            let start = Instant::now();
            let asset = importer
                .import(&source, &None, ImportScope::ALL, &ImportOptions::default())
                .unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(asset.meshes[0].primitives[0].positions.len(), (SIDE * SIDE) as usize);
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{:.2} MB, {} vertices: {:.1} ms (median of 5)", size as f64 / 1e6, SIDE * SIDE, times[2]);
}
