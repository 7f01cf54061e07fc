//! Texts of the licenses of all crates that are linked into the programs; they are distributed with the programs.

use super::tree::copy;
use crate::notices::{PROGRAMS, Package, linked, packages};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// First parts of the names of license files, in lower case.
const NAMES: [&str; 5] = ["license", "licence", "copying", "copyright", "notice"];

/// Writes `CRATE-VERSION/LICENSE…` for each crate, and a list of the crates without a text.
pub(super) fn write(to: &Path) -> Result<(), String> {
    let packages = packages()?;
    let mut without = String::new();
    for package in all(&packages).values() {
        let texts = texts(&package.folder);
        if texts.is_empty() {
            without += &format!("{} {}: {}\n", package.name, package.version, package.licence);
        }
        for text in texts {
            let of = format!("{}-{}", package.name, package.version);
            copy(&package.folder.join(&text), &to.join(of).join(&text))?;
        }
    }
    let head = "The folders beside this file hold the licences of the crates that choreo is made of. The archives of these crates hold no\n\
                text; their licences, as they state them, are:\n\n";
    std::fs::write(to.join("README.txt"), format!("{head}{without}"))
        .map_err(|e| format!("{}: {e}", to.display()))
}

/// Crates of both programs, by cargo's identifier.
fn all(packages: &BTreeMap<String, Package>) -> BTreeMap<String, &Package> {
    let ids = PROGRAMS.iter().flat_map(|(program, _)| linked(packages, program));
    ids.filter_map(|id| Some((id.clone(), packages.get(&id)?))).collect()
}

/// Folders of a crate that may contain license texts, including those of C sources and fonts.
const FOLDERS: [&str; 4] = ["", "LICENSES", "upstream", "fonts"];

/// Paths of license texts in the folder of a crate.
fn texts(folder: &Path) -> Vec<PathBuf> {
    let mut texts = Vec::new();
    for inner in FOLDERS {
        for entry in std::fs::read_dir(folder.join(inner)).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().to_lowercase();
            // Every text beside a font is a license.
            let is_text = inner == "fonts" && name.ends_with(".txt")
                || NAMES.iter().any(|start| name.starts_with(start));
            if is_text && entry.path().is_file() {
                texts.push(Path::new(inner).join(entry.file_name()));
            }
        }
    }
    texts.sort();
    texts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearly_every_crate_has_a_licence_file() {
        let packages = packages().unwrap();
        let all = all(&packages);
        let without: Vec<&str> =
            all.values().filter(|p| texts(&p.folder).is_empty()).map(|p| p.name.as_str()).collect();
        assert!(
            all.len() > 100 && without.len() * 8 < all.len(),
            "{} of {}: {without:?}",
            without.len(),
            all.len()
        );
        for (name, text) in [
            ("rhai", "LICENSE-MIT.txt"),
            ("openh264-sys2", "upstream/LICENSE"),
            ("epaint_default_fonts", "fonts/UFL.txt"),
        ] {
            let package = all.values().find(|p| p.name == name).unwrap();
            assert!(texts(&package.folder).contains(&PathBuf::from(text)), "{name}: {text}");
        }
    }
}
