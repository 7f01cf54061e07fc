//! Benchmark of script importers: 5 MB of binary vertices and indices, and an ASCII PLY of a million vertices. Prints import
//! times and the peak memory of the process: `cargo run --release -p choreo-rhai-importer --example measure_import`.

use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Source};
use choreo_rhai_importer::RhaiImporter;
use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Instant;

const BINARY_IMPORTER: &str = r#"
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

const ASCII_PLY_IMPORTER: &str = r#"
fn manifest() { #{ name: "ascii_ply", extensions: "ply", magic: "ply" } }

fn load(file) {
    let lines = file.bytes.lines();
    let vertices = 0;
    let faces = 0;
    let header = 0;
    for line in lines {
        header += 1;
        let words = line.words();
        switch words[0] {
            "element" if words[1] == "vertex" => vertices = parse_int(words[2]),
            "element" if words[1] == "face" => faces = parse_int(words[2]),
            "end_header" => break,
        }
    }
    let table = lines.part(header, vertices).numbers();
    let positions = table.columns(6, [0, 1, 2]);
    let normals = table.columns(6, [3, 4, 5]);
    table = ();
    mesh(#{ positions: positions, normals: normals, indices: lines.part(header + vertices, faces).numbers().fans() });
}
"#;

struct NoFiles;

impl Files for NoFiles {
    fn read(&self, name: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("no file {name}"))
    }
}

/// Vertex indices of the triangles of a square grid, two per cell.
fn grid_triangles(side: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..side - 1).flat_map(move |z| {
        (0..side - 1).flat_map(move |x| {
            let a = z * side + x;
            [[a, a + side, a + 1], [a + 1, a + side, a + side + 1]]
        })
    })
}

fn binary_grid(side: u32) -> Vec<u8> {
    let mut bytes = (side * side).to_le_bytes().to_vec();
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    for i in 0..side * side {
        bytes.extend(floats(&[(i % side) as f32, 0.0, (i / side) as f32, 0.0, 1.0, 0.0]));
    }
    for i in 0..side * side {
        bytes.extend(floats(&[(i % side) as f32 / side as f32, (i / side) as f32 / side as f32]));
    }
    bytes.extend(grid_triangles(side).flatten().flat_map(u32::to_le_bytes));
    bytes
}

fn ascii_ply_grid(side: u32) -> Vec<u8> {
    let (vertices, faces) = (side * side, 2 * (side - 1) * (side - 1));
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\nelement face {faces}\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    for i in 0..vertices {
        let (x, z) = (f64::from(i % side) * 0.01, f64::from(i / side) * 0.01);
        let _ = writeln!(text, "{x:.4} {:.6} {z:.4} 0 1 0", libm::sin(x) * libm::cos(z));
    }
    for [a, b, c] in grid_triangles(side) {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text.into_bytes()
}

fn measure_import(name: &str, importer: &str, bytes: Vec<u8>, vertices: u32) {
    let size = bytes.len();
    let source = Source { name: name.into(), bytes: Arc::new(bytes) };
    let importer = RhaiImporter::from_text("my.importer.rhai", importer).unwrap_or_else(|e| panic!("{e}"));
    let mut times: Vec<f64> = (0..5)
        .map(|_| {
            let start = Instant::now();
            let asset = importer
                .import(&source, &NoFiles, ImportScope::ALL, &ImportOptions::default())
                .unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(asset.meshes[0].primitives[0].positions.len(), vertices as usize);
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!(
        "{name}: {:.2} MB, {vertices} vertices: {:.1} ms (median of 5, {:.1}–{:.1}), peak {} MB",
        size as f64 / 1e6,
        times[2],
        times[0],
        times[4],
        peak_mb()
    );
}

/// Peak resident memory of the process in MB (Linux; 0 elsewhere), the test files included.
fn peak_mb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) * 1024
        / 1_000_000
}

fn main() {
    measure_import("grid.bin", BINARY_IMPORTER, binary_grid(300), 300 * 300);
    measure_import("grid.ply", ASCII_PLY_IMPORTER, ascii_ply_grid(1000), 1000 * 1000);
}
