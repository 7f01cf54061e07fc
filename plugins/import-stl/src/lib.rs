//! STL into an [`Asset`]. Contents, limits and options: README.md.

mod ascii;
mod binary;
mod build;

use choreo_asset::Asset;
use choreo_importer_kit::{Notes, Progress, Result};
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use glam::Vec3;
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("stl", env!("CARGO_PKG_VERSION"), "STL, binary and ASCII: triangles, solids, facet colors")
        .extensions(["stl"])
        .number("scale", "metres per file unit; 0: guessed from the size", 0.0, 0.0..=1e6)
        .text("up", "the file's upward axis", "z", &["y", "z"])
        .number("smooth", "degrees up to which an edge is smooth; 0 keeps the facets", 0.0, 0.0..=180.0)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct StlImporter;

/// Encoding of an STL file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    /// Binary: the file has exactly the size for the number of triangles in its header.
    Binary,
    Unknown,
}

impl Encoding {
    /// Many binary files also begin with `solid`, so the size is tested before the word.
    fn of(bytes: &[u8]) -> Encoding {
        if binary::announced(bytes).is_some_and(|n| n > 0 && binary::size(n) == bytes.len() as u64) {
            return Encoding::Binary;
        }
        let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
        let head = &text[..text.len().min(1024)];
        let solid = head.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
        match solid && !head.contains(&0) {
            true => Encoding::Ascii,
            false => Encoding::Unknown,
        }
    }
}

impl Importer for StlImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn claim(&self, source: &Source) -> Claim {
        let named = MANIFEST.has_extension(&source.extension());
        match Encoding::of(&source.bytes) {
            Encoding::Binary => Claim::Content(70),
            Encoding::Ascii => Claim::Content(60),
            Encoding::Unknown if named => Claim::Extension,
            Encoding::Unknown => Claim::NotMine,
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> std::result::Result<Asset, ImportError> {
        import(source, files, needs, options).map_err(|p| p.in_file(&source.name))
    }
}

/// The triangles of one solid, as the file has them.
#[derive(Clone, Debug, Default)]
struct Solid {
    name: String,
    /// Three for each triangle, in the file's units and axes.
    positions: Vec<Vec3>,
    /// Stored normals, one for each triangle; zero where the file has none.
    normals: Vec<Vec3>,
    /// sRGB colors, one for each triangle; empty where the file has none.
    colors: Vec<[u8; 3]>,
}

fn import(source: &Source, files: &dyn Files, needs: ImportScope, options: &ImportOptions) -> Result<Asset> {
    let notes = Notes::default();
    let progress = Progress::new(files, source.bytes.len());
    let (solids, format) = match (needs.geometry, Encoding::of(&source.bytes)) {
        (_, Encoding::Ascii) => (ascii::read(&source.bytes, needs.geometry, &progress, &notes)?, "ASCII STL"),
        (false, _) => (vec![Solid::default()], "binary STL"),
        (true, _) => (vec![binary::read(&source.bytes, &progress, &notes)?], "binary STL"),
    };
    build::asset(source, solids, format, needs, options, notes)
}
