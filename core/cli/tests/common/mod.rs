//! Runs the built program and generates small inputs for it.
#![allow(dead_code)]

use choreo_importer_kit_testing::pypi;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub(crate) struct Run {
    pub code: i32,
    pub out: String,
    pub err: String,
}

pub(crate) fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_choreo"));
    command.current_dir(folder).args(args).stdin(Stdio::null());
    // Plugins that the user has installed must not affect the test.
    command.env("CHOREO_PLUGINS", "");
    command
}

pub(crate) fn run_result(output: Output) -> Run {
    let run = Run {
        code: output.status.code().unwrap_or(-1),
        out: String::from_utf8_lossy(&output.stdout).into_owned(),
        err: String::from_utf8_lossy(&output.stderr).into_owned(),
    };
    assert!(!run.err.contains("panicked") && !run.err.contains("internal error"), "{}", run.err);
    run
}

pub(crate) fn choreo(folder: &Path, args: &[&str]) -> Run {
    run_result(command(folder, args).output().unwrap())
}

/// Waits until a condition holds; panics after ten minutes.
pub(crate) fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(600), "no {what} after ten minutes");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// A child process that is killed when the value is dropped, even if the process is stopped.
pub(crate) struct Process(Option<Child>);

impl Process {
    pub(crate) fn spawn(command: &mut Command) -> Process {
        Process(Some(command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()))
    }

    #[cfg(unix)]
    pub(crate) fn signal(&self, name: &str) {
        let id = self.0.as_ref().unwrap().id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    }

    pub(crate) fn wait(mut self) -> Run {
        run_result(self.0.take().unwrap().wait_with_output().unwrap())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// The names of the entries of a folder, sorted.
pub(crate) fn file_names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The scripts in a folder, sorted.
pub(crate) fn scripts_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "rhai")).collect();
    found.sort();
    found
}

pub(crate) fn part_files(folder: &Path) -> Vec<String> {
    file_names(folder).into_iter().filter(|n| n.contains(".part")).collect()
}

pub(crate) fn sample_assets_folder() -> Option<PathBuf> {
    let folder = std::env::var_os("CHOREO_ASSETS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets"), PathBuf::from);
    if !folder.is_dir() {
        println!("SKIP 1: no folder of sample assets at {}", folder.display());
        return None;
    }
    Some(folder)
}

/// A glTF file with three vertices in an unusual order. The clip "Slide" moves their node from x = 0 to x = 2 in `secs` seconds.
pub(crate) fn triangle(secs: f32) -> String {
    let positions: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0];
    let keys: [f32; 8] = [0.0, secs, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0];
    let mut bytes: Vec<u8> = positions.iter().chain(&keys).flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    format!(
        r#"{{
  "asset": {{ "version": "2.0" }}, "scene": 0, "scenes": [{{ "nodes": [0] }}],
  "nodes": [{{ "name": "Root", "translation": [0, 0.5, 0], "children": [1] }}, {{ "name": "Slider", "mesh": 0 }}],
  "meshes": [{{ "name": "Tri", "primitives": [{{ "attributes": {{ "POSITION": 0 }}, "indices": 3 }}] }}],
  "animations": [{{ "name": "Slide",
    "channels": [{{ "sampler": 0, "target": {{ "node": 1, "path": "translation" }} }}],
    "samplers": [{{ "input": 1, "output": 2 }}] }}],
  "accessors": [
    {{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, 0, 0], "max": [1, 1, 0] }},
    {{ "bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [{secs}] }},
    {{ "bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3" }},
    {{ "bufferView": 3, "componentType": 5123, "count": 3, "type": "SCALAR" }}],
  "bufferViews": [
    {{ "buffer": 0, "byteOffset": 0, "byteLength": 36 }},
    {{ "buffer": 0, "byteOffset": 36, "byteLength": 8 }},
    {{ "buffer": 0, "byteOffset": 44, "byteLength": 24 }},
    {{ "buffer": 0, "byteOffset": 68, "byteLength": 6 }}],
  "buffers": [{{ "byteLength": {}, "uri": "data:application/octet-stream;base64,{}" }}]
}}"#,
        bytes.len(),
        base64(&bytes)
    )
}

pub(crate) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let n = chunk.iter().fold(0u32, |n, b| n << 8 | u32::from(*b)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let letter = LETTERS[(n >> (18 - 6 * i) & 63) as usize] as char;
            text.push(if i <= chunk.len() { letter } else { '=' });
        }
    }
    text
}

/// A folder with the triangle in it.
pub(crate) fn folder_with_triangle() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("tri.gltf"), triangle(1.0)).unwrap();
    folder
}

pub(crate) fn read_file(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A Python with `module`. `None`, with a message, if it cannot be installed.
pub(crate) fn python_with(module: &str, requirement: &str) -> Option<PathBuf> {
    pypi::python_with(env!("CARGO_TARGET_TMPDIR"), module, requirement)
}

/// A Python with Blender. `None`, with a message, if it cannot be installed.
pub(crate) fn blender() -> Option<PathBuf> {
    pypi::blender(env!("CARGO_TARGET_TMPDIR"))
}
