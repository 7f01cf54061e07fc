//! Importer of `.example`: points and faces as text. The one to copy for a format of your own.

#[doc(hidden)]
pub mod files;

use choreo_plugin::asset::Asset;
use choreo_plugin::{
    AssetBuilder, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, MeshData, Source,
};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("example", env!("CARGO_PKG_VERSION"), "points and faces as text")
        .extensions(["example"])
        .magic(b"example 1")
        .number("scale", "metres per file unit", 1.0, 1e-6..=1e6)
});

/// Line limit, far above what points written as text need.
const MOST_LINES: usize = 1_000_000;

#[derive(Clone, Copy, Debug, Default)]
pub struct ExampleImporter;

// Makes a plugin file of the crate in builds for WebAssembly; expands to nothing in others.
choreo_plugin::wasm_importer!(ExampleImporter);

impl Importer for ExampleImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn import(
        &self,
        source: &Source,
        _files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let error = |(line, what): (usize, String)| ImportError {
            file: source.name.clone(),
            place: if line == 0 { String::new() } else { format!("line {line}") },
            what,
            hint: None,
        };
        let mut builder = AssetBuilder::default();
        let scale = options.number("scale").unwrap_or(1.0) as f32;
        let mesh = read(&source.bytes, scale, &mut builder).map_err(error)?;
        // Callers state what they need; a mesh that nobody requests is not made.
        if needs.geometry {
            builder.mesh(mesh).map_err(|e| error((0, e.to_string())))?;
        }
        let mut asset = builder.finish(&source.name).map_err(|e| error((0, e.to_string())))?;
        asset.origin.format = "example 1".into();
        asset.origin.metres_per_unit = Some(f64::from(scale));
        Ok(asset)
    }
}

/// A line number (from 1), and what is wrong in the line.
type LineError = (usize, String);

fn read(bytes: &[u8], scale: f32, builder: &mut AssetBuilder) -> Result<MeshData, LineError> {
    let text =
        std::str::from_utf8(bytes).map_err(|e| (0, format!("byte {} is not UTF-8 text", e.valid_up_to())))?;
    let mut mesh = MeshData { name: "example".into(), ..MeshData::default() };
    for (i, line) in text.lines().enumerate() {
        let at = i + 1;
        if at > MOST_LINES {
            return Err((at, format!("more than {MOST_LINES} lines")));
        }
        let mut words = line.split('#').next().unwrap_or("").split_whitespace();
        match words.next() {
            None | Some("example") => {}
            Some("point") => {
                let point = numbers::<f32>(words).map_err(|e| (at, e))?;
                if point.len() != 3 {
                    return Err((at, format!("a point has 3 numbers, this one has {}", point.len())));
                }
                mesh.positions.extend(point.iter().map(|v| v * scale));
            }
            Some("face") => {
                let vertices = numbers::<u32>(words).map_err(|e| (at, e))?;
                let points = mesh.positions.len() / 3;
                if let Some(bad) = vertices.iter().find(|c| **c as usize >= points) {
                    return Err((at, format!("point {bad} does not exist (count so far: {points})")));
                }
                // Triangulates a convex polygon as a fan around its first vertex.
                if let [first, rest @ ..] = vertices.as_slice() {
                    mesh.indices.extend(rest.windows(2).flat_map(|edge| [*first, edge[0], edge[1]]));
                }
            }
            Some(word) => builder.warn(&format!("line {at}"), &format!("unknown word \"{word}\": left out")),
        }
    }
    Ok(mesh)
}

fn numbers<'a, T: std::str::FromStr>(words: impl Iterator<Item = &'a str>) -> Result<Vec<T>, String> {
    words.map(|w| w.parse().map_err(|_| format!("\"{w}\" is not a valid number"))).collect()
}
