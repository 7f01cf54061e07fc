//! The sample file is imported completely, and errors name their line.

use choreo_plugin::asset::Asset;
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Source};
use import_example::ExampleImporter;
use std::sync::Arc;

struct NoFiles;

impl Files for NoFiles {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("cannot read \"{relative}\": there are no files"))
    }
}

fn source(text: &str) -> Source {
    Source { name: "a.example".into(), bytes: Arc::new(text.as_bytes().to_vec()) }
}

fn import(text: &str) -> Result<Asset, ImportError> {
    ExampleImporter.import(&source(text), &NoFiles, ImportScope::ALL, &ImportOptions::default())
}

#[test]
fn the_sample_is_imported_completely() {
    let asset = import(include_str!("sample.example")).unwrap();
    let mesh = &asset.meshes[0].primitives[0];
    assert_eq!((mesh.positions.len(), mesh.indices.len() / 3), (5, 6));
    let size = asset.rest_bounds();
    assert_eq!((size.min.to_array(), size.max.to_array()), ([-1.0, 0.0, -1.0], [1.0, 1.5, 1.0]));
    assert!(asset.warnings.is_empty());
}

#[test]
fn files_are_claimed_by_their_first_word() {
    assert_eq!(ExampleImporter.claim(&source("example 1\n")), Claim::Content(90));
    let other = Source { name: "a.txt".into(), ..source("v 1 2 3") };
    assert_eq!(ExampleImporter.claim(&other), Claim::NotMine);
}

#[test]
fn errors_name_their_line() {
    let text = |file: &str| import(file).unwrap_err().to_string();
    assert_eq!(text("point 1 2"), "a.example: line 1: a point has 3 numbers, this one has 2");
    assert_eq!(text("point 1 2 x"), "a.example: line 1: \"x\" is not a valid number");
    assert_eq!(text("\nface 0 1 2"), "a.example: line 2: point 0 does not exist (count so far: 0)");
    assert_eq!(text(""), "a.example: mesh \"example\": positions must have 3 numbers for each vertex, has 0");
    let odd = import("point 0 0 0\npoint 1 0 0\npoint 0 1 0\nface 0 1 2\ncolor red").unwrap();
    assert_eq!((odd.warnings[0].place.as_str(), odd.warnings.len()), ("line 5", 1));
}
