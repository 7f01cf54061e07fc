//! Benchmark of CPU time: the same importer as a WebAssembly plugin and compiled into the program, on ASCII and binary PLY files
//! of a million vertices. The argument is the plugin: `cargo run --release -p choreo-wasm-plugin --features engine --example
//! measure_import import_ply.wasm`.

#[path = "../tests/import-ply/src/lib.rs"]
mod import_ply;

use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Source};
use choreo_wasm_plugin::WasmImporter;
use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::{TimeVal, TimeValLike};
use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Instant;

struct NoFiles;

impl Files for NoFiles {
    fn read(&self, name: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("no file {name}"))
    }
}

fn header(format: &str, side: u32) -> String {
    let (vertices, faces) = (side * side, 2 * (side - 1) * (side - 1));
    let properties: String =
        ["x", "y", "z", "nx", "ny", "nz"].map(|p| format!("property float {p}\n")).concat();
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\n{properties}element face {faces}\n\
         property list uchar int vertex_indices\nend_header\n"
    )
}

fn vertex(i: u32, side: u32) -> [f32; 6] {
    let (x, z) = (f64::from(i % side) * 0.01, f64::from(i / side) * 0.01);
    [x as f32, (libm::sin(x) * libm::cos(z)) as f32, z as f32, 0.0, 1.0, 0.0]
}

/// Vertex indices of the triangles of a square grid, two per cell.
fn triangles(side: u32) -> impl Iterator<Item = [u32; 3]> {
    let square = move |i: u32| {
        let a = i / (side - 1) * side + i % (side - 1);
        [[a, a + side, a + 1], [a + 1, a + side, a + side + 1]]
    };
    (0..(side - 1) * (side - 1)).flat_map(square)
}

fn ascii(side: u32) -> Vec<u8> {
    let mut text = header("ascii", side);
    for i in 0..side * side {
        let [x, y, z, ..] = vertex(i, side);
        let _ = writeln!(text, "{x:.4} {y:.6} {z:.4} 0 1 0");
    }
    for [a, b, c] in triangles(side) {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text.into_bytes()
}

fn binary(side: u32) -> Vec<u8> {
    let mut bytes = header("binary_little_endian", side).into_bytes();
    bytes.extend((0..side * side).flat_map(|i| vertex(i, side)).flat_map(f32::to_le_bytes));
    for triangle in triangles(side) {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}

/// CPU time of all threads of the process in milliseconds.
fn cpu_ms() -> f64 {
    let usage = getrusage(UsageWho::RUSAGE_SELF).unwrap_or_else(|e| panic!("{e}"));
    let ms = |time: TimeVal| time.num_microseconds() as f64 / 1e3;
    ms(usage.user_time()) + ms(usage.system_time())
}

/// CPU milliseconds of each import by two importers, sorted. The importers take turns, so that neither has the quieter machine.
fn measure(importers: [&dyn Importer; 2], source: &Source) -> [Vec<f64>; 2] {
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..7 {
        for (importer, times) in importers.iter().zip(&mut times) {
            let options = importer.manifest().complete(&ImportOptions::default());
            let options = options.unwrap_or_else(|e| panic!("{e}"));
            let start = cpu_ms();
            let asset = importer.import(source, &NoFiles, ImportScope::ALL, &options);
            times.push(cpu_ms() - start);
            assert_eq!(
                asset.unwrap_or_else(|e| panic!("{e}")).meshes[0].primitives[0].positions.len(),
                1_000_000
            );
        }
    }
    times.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
    times
}

fn main() {
    let path = std::env::args().nth(1).unwrap_or_else(|| "import_ply.wasm".into());
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let start = Instant::now();
    let guest = WasmImporter::from_bytes(&bytes).unwrap_or_else(|e| panic!("{path}: {e}"));
    println!("{path}: {} KB, compiled in {:.0} ms", bytes.len() / 1000, start.elapsed().as_secs_f64() * 1e3);
    for (name, bytes) in [("ascii.ply", ascii(1000)), ("binary.ply", binary(1000))] {
        let size = bytes.len() as f64 / 1e6;
        let source = Source { name: name.into(), bytes: Arc::new(bytes) };
        let [native, wasm] = measure([&import_ply::PlyImporter, &guest], &source);
        println!(
            "{name}, {size:.0} MB: crate {:.0} ms ({:.0}–{:.0}), WebAssembly {:.0} ms ({:.0}–{:.0}): {:.2} times (medians of 7, ms of CPU)",
            native[3],
            native[0],
            native[6],
            wasm[3],
            wasm[0],
            wasm[6],
            wasm[3] / native[3]
        );
    }
}
