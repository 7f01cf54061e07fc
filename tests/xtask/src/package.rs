//! `cargo xtask package`: packs every publishable crate as `cargo publish` would upload it. A test checks conditions that cargo does not:
//! that included files are in the package, and that manifests describe their crates.

use crate::notices::output_of_metadata;
use crate::{cargo, run};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Writes the packages below `target/package` without building them, because building them against each other takes as long as a first
/// build.
pub(crate) fn package() -> Result<(), String> {
    let (public, private) = crates()?;
    let faults = faults(&public)?;
    if !faults.is_empty() {
        return Err(faults.join("\n"));
    }
    let mut command = cargo(&["package", "--workspace", "--no-verify", "--allow-dirty", "--quiet"]);
    private.iter().for_each(|name| {
        command.args(["--exclude", name]);
    });
    run(command, "cargo package")
}

/// A publishable crate.
struct Crate {
    name: String,
    folder: PathBuf,
    description: String,
    licence: String,
    readme: String,
}

/// Publishable crates of the workspace, and the names of the others.
fn crates() -> Result<(Vec<Crate>, Vec<String>), String> {
    let metadata = output_of_metadata(&["--no-deps"])?;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_string();
    let (mut public, mut private) = (Vec::new(), Vec::new());
    for package in metadata["packages"].as_array().into_iter().flatten() {
        let name = text(&package["name"]);
        // `publish = false` appears as an empty list of registries.
        if package["publish"].as_array().is_some_and(Vec::is_empty) {
            private.push(name);
            continue;
        }
        let manifest = PathBuf::from(text(&package["manifest_path"]));
        public.push(Crate {
            name,
            folder: manifest.parent().map(Path::to_path_buf).unwrap_or_default(),
            description: text(&package["description"]),
            licence: text(&package["license"]),
            readme: text(&package["readme"]),
        });
    }
    Ok((public, private))
}

/// Errors in crates, one line each.
fn faults(public: &[Crate]) -> Result<Vec<String>, String> {
    let mut faults = Vec::new();
    for one in public {
        let Crate { name, description, licence, readme, folder } = one;
        if description.len() <= 10 || description.ends_with('.') {
            faults.push(format!(
                "{name}: a description has more than ten letters and no full stop: {description:?}"
            ));
        }
        if licence != "MIT" || readme.is_empty() || !folder.join(readme).is_file() {
            faults.push(format!("{name}: licence {licence:?}, readme {readme:?}"));
        }
        let files = files(one)?;
        for file in files.iter().filter(|file| file.extension().is_some_and(|ending| ending == "rs")) {
            let path = folder.join(file);
            let source = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            faults.extend(missing(file, &source, &files).into_iter().map(|fault| format!("{name}: {fault}")));
        }
    }
    Ok(faults)
}

/// Paths of the files in the package of a crate.
fn files(of: &Crate) -> Result<Vec<PathBuf>, String> {
    let mut list = cargo(&["package", "--list", "--allow-dirty", "--offline", "--quiet", "-p", &of.name]);
    let output = list.output().map_err(|e| format!("cargo package did not start: {e}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).lines().map(PathBuf::from).collect()),
        false => Err(format!("{}: {}", of.name, String::from_utf8_lossy(&output.stderr))),
    }
}

/// Paths that a source includes with `include_str!` and similar, as they are written. If a macro completes a path, only its beginning.
fn included(source: &str) -> Vec<&str> {
    const BEGINNINGS: [&str; 4] = ["include_str!(", "include_bytes!(", "include!(", "#[path = "];
    let mut found = Vec::new();
    for beginning in BEGINNINGS {
        for (at, _) in source.match_indices(beginning) {
            let rest = &source[at + beginning.len()..];
            let rest = rest.strip_prefix("concat!(").unwrap_or(rest);
            found.extend(rest.strip_prefix('"').and_then(|text| text.split('"').next()));
        }
    }
    found
}

/// Resolves a path relative to a file; `None` if it leads out of the package.
fn beside(file: &Path, path: &str) -> Option<PathBuf> {
    let mut found = file.parent().unwrap_or(Path::new("")).to_path_buf();
    for part in path.split('/') {
        match part {
            ".." if !found.pop() => return None,
            ".." | "." | "" => {}
            name => found.push(name),
        }
    }
    Some(found)
}

/// Includes in a source that are missing in its package.
fn missing(file: &Path, source: &str, files: &[PathBuf]) -> Vec<String> {
    let is_whole = |path: &str| Path::new(path).extension().is_some();
    let is_held = |path: &&str| match beside(file, path) {
        Some(found) => !is_whole(path) || files.contains(&found),
        None => false,
    };
    let paths = included(source).into_iter().filter(|path| !is_held(path));
    paths.map(|path| format!("{} includes {path}, which is not in the package", file.display())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_can_be_published() {
        let (public, private) = crates().unwrap();
        let faults = faults(&public).unwrap();
        assert!(public.len() > 30 && faults.is_empty(), "{}", faults.join("\n"));
        for name in ["choreo-importer-kit-testing", "extreme", "importers", "manuals", "report", "xtask"] {
            assert!(private.iter().any(|other| other == name), "{name}: publish = false");
        }
    }

    #[test]
    fn a_crate_without_metadata_is_found() {
        let (mut public, _) = crates().unwrap();
        public.truncate(1);
        public[0].description.clear();
        public[0].readme = "none.md".into();
        assert_eq!(faults(&public).unwrap().len(), 2);
    }

    #[test]
    fn an_include_that_is_not_in_the_package_is_found() {
        let files = ["src/a/mod.rs", "src/a/b.txt", "c.txt"].map(PathBuf::from);
        let missing = |text: &str| missing(Path::new("src/a/mod.rs"), text, &files);
        for good in [
            "include_str!(\"b.txt\")",
            "include_bytes!(\"../../c.txt\")",
            "include_str!(concat!(\"../\", $name))",
            "#[path = \"./b.txt\"]",
        ] {
            assert!(missing(good).is_empty(), "{good}");
        }
        for bad in [
            "include_str!(\"d.txt\")",
            "include_str!(\"../../../c.txt\")",
            "include_str!(concat!(\"../../../\", $name))",
            "#[path = \"../b.rs\"]",
        ] {
            assert_eq!(missing(bad).len(), 1, "{bad}");
        }
    }
}
