//! `cargo xtask notices`: writes the table of THIRD-PARTY.md with the crates that are linked into the two programs.

use crate::licences::{Deny, PLAIN, satisfied};
use crate::{cargo, root};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Target of the table on every system, since crates differ slightly between systems.
const PLATFORM: &str = "x86_64-unknown-linux-gnu";
pub(crate) const PROGRAMS: [(&str, &str); 2] = [("choreo", "`choreo`"), ("choreo-viewer", "`choreo-view`")];
const BEGIN: &str = "<!-- Written by `cargo xtask notices` from here to the end of the file. -->\n";

/// Cargo's metadata of one crate in the lock file.
#[derive(Debug)]
pub(crate) struct Package {
    pub name: String,
    pub version: String,
    /// SPDX expression.
    pub licence: String,
    pub is_ours: bool,
    /// Whether the source is not crates.io, but another registry or a repository.
    pub is_foreign: bool,
    is_macro: bool,
    /// Whether its build script compiles C or C++, or may do so.
    pub has_c: bool,
    /// Folder of the sources.
    pub folder: PathBuf,
    /// Crates that are linked with it, by cargo's identifier.
    linked: Vec<String>,
}

/// The output of `cargo metadata`.
pub(crate) fn output_of_metadata(options: &[&str]) -> Result<Value, String> {
    let mut command = cargo(&["metadata", "--offline", "--locked", "--format-version", "1"]);
    let output = command.args(options).output().map_err(|e| format!("cargo metadata did not start: {e}"))?;
    if !output.status.success() {
        return Err(format!("cargo metadata failed: {}", String::from_utf8_lossy(&output.stderr)));
    }
    serde_json::from_slice(&output.stdout).map_err(|e| format!("cargo metadata: {e}"))
}

/// Packages of the workspace's dependency graph, by cargo's identifier.
pub(crate) fn packages() -> Result<BTreeMap<String, Package>, String> {
    let all = output_of_metadata(&["--filter-platform", PLATFORM])?;
    let mut packages: BTreeMap<String, Package> =
        list(&all["packages"]).map(|package| (text(&package["id"]), Package::new(package))).collect();
    for node in list(&all["resolve"]["nodes"]) {
        // Dependencies that are neither for tests nor for build scripts.
        let is_normal = |kind: &Value| kind["kind"].is_null();
        let linked = list(&node["deps"]).filter(|dep| list(&dep["dep_kinds"]).any(is_normal));
        if let Some(package) = packages.get_mut(&text(&node["id"])) {
            package.linked = linked.map(|dep| text(&dep["pkg"])).collect();
        }
    }
    Ok(packages)
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_string()
}

impl Package {
    fn new(package: &Value) -> Package {
        let source = text(&package["source"]);
        Package {
            name: text(&package["name"]),
            version: text(&package["version"]),
            licence: text(&package["license"]),
            is_ours: source.is_empty(),
            is_foreign: !source.is_empty()
                && source != "registry+https://github.com/rust-lang/crates.io-index",
            is_macro: list(&package["targets"]).any(|t| list(&t["kind"]).any(|kind| kind == "proc-macro")),
            has_c: list(&package["dependencies"]).any(|dep| dep["name"] == "cc" && dep["kind"] == "build"),
            folder: PathBuf::from(text(&package["manifest_path"]))
                .parent()
                .map(Path::to_path_buf)
                .unwrap_or_default(),
            linked: Vec::new(),
        }
    }

    /// Version range that cargo considers compatible, so that a patch update does not change the notices: `1`, `0.25`, `0.0.7`.
    pub(crate) fn range(&self) -> String {
        let numbers: Vec<&str> = self.version.split(['.', '-', '+']).take(3).collect();
        let zeros = numbers.iter().take_while(|n| **n == "0").count();
        numbers[..=zeros.min(numbers.len() - 1)].join(".")
    }
}

/// Crates of other people that are linked into a program, by cargo's identifier. Procedural macros run at build time and are not included.
pub(crate) fn linked(packages: &BTreeMap<String, Package>, program: &str) -> BTreeSet<String> {
    let is_program = |(_, package): &(&String, &Package)| package.is_ours && package.name == program;
    let mut open: Vec<&String> = packages.iter().filter(is_program).map(|(id, _)| id).collect();
    let mut found = BTreeSet::new();
    while let Some(id) = open.pop() {
        let Some(package) = packages.get(id).filter(|package| !package.is_macro) else { continue };
        if found.insert(id.clone()) {
            open.extend(&package.linked);
        }
    }
    found.retain(|id| !packages[id].is_ours);
    found
}

/// Generated part of the file.
fn table(packages: &BTreeMap<String, Package>) -> String {
    let programs = PROGRAMS.map(|(package, title)| (title, linked(packages, package)));
    let all: BTreeSet<&String> = programs.iter().flat_map(|(_, ids)| ids).collect();
    let row = |id: &&String| {
        let package = &packages[*id];
        let of = programs.iter().filter(|(_, ids)| ids.contains(*id)).map(|(title, _)| *title);
        let of = of.collect::<Vec<_>>().join(", ");
        format!("| {} | {} | {} | {of} |", package.name, package.range(), package.licence)
    };
    let mut rows: Vec<String> = all.iter().map(row).collect();
    rows.sort();
    format!("{BEGIN}\n| crate | versions | licence | linked into |\n|---|---|---|---|\n{}\n", rows.join("\n"))
}

fn split_generated(file: &str) -> Result<(&str, &str), String> {
    let at = file.find(BEGIN).ok_or_else(|| format!("THIRD-PARTY.md has lost its line {BEGIN:?}"))?;
    Ok(file.split_at(at))
}

/// Rewrites the table and keeps the text above it. Fails if that text lacks something.
pub(crate) fn notices() -> Result<(), String> {
    let read = |path: &Path| std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()));
    let (path, packages) = (root().join("THIRD-PARTY.md"), packages()?);
    let text = format!("{}{}", split_generated(&read(&path)?)?.0, table(&packages));
    std::fs::write(&path, &text).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut all = faults(&text, &packages)?;
    all.extend(Deny::read(&read(&root().join("deny.toml"))?).faults(&packages));
    if all.is_empty() { Ok(()) } else { Err(all.join("\n")) }
}

/// Errors in a notices file, one line each.
fn faults(file: &str, packages: &BTreeMap<String, Package>) -> Result<Vec<String>, String> {
    let (by_hand, written) = split_generated(file)?;
    let expected = table(packages);
    let has = |text: &str, line: &str| text.lines().any(|l| l == line);
    let missing = expected.lines().filter(|line| !has(written, line));
    let mut faults: Vec<String> = missing.map(|line| format!("missing line: {line}")).collect();
    let gone = written.lines().filter(|line| !has(&expected, line));
    faults.extend(gone.map(|line| format!("outdated line: {line}")));
    let ids = PROGRAMS.iter().flat_map(|(package, _)| linked(packages, package));
    for package in ids.collect::<BTreeSet<_>>().iter().map(|id| &packages[id]) {
        // Licenses that require more than their text must be described by hand.
        let special = !satisfied(&package.licence, PLAIN);
        if (special || package.has_c) && !by_hand.contains(&format!("`{}`", package.name)) {
            faults.push(format!("the text above the table does not mention `{}`", package.name));
        }
    }
    Ok(faults)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> String {
        std::fs::read_to_string(root().join("THIRD-PARTY.md")).unwrap()
    }

    #[test]
    fn the_notices_name_every_crate_that_is_linked() {
        let faults = faults(&file(), &packages().unwrap()).unwrap();
        assert!(faults.is_empty(), "THIRD-PARTY.md; run `cargo xtask notices`:\n{}", faults.join("\n"));
    }

    #[test]
    fn a_crate_that_is_not_named_or_has_another_licence_is_found() {
        let (file, mut packages) = (file(), packages().unwrap());
        let id = packages.iter().find(|(_, p)| p.name == "ash").unwrap().0.clone();
        packages.get_mut(&id).unwrap().licence = "MPL-2.0".into();
        let found = faults(&file, &packages).unwrap();
        assert_eq!(
            found,
            [
                "missing line: | ash | 0.38 | MPL-2.0 | `choreo`, `choreo-view` |",
                "outdated line: | ash | 0.38 | MIT OR Apache-2.0 | `choreo`, `choreo-view` |",
                "the text above the table does not mention `ash`",
            ]
        );
        let without: String =
            file.lines().filter(|l| !l.starts_with("| rhai ")).map(|l| format!("{l}\n")).collect();
        packages.get_mut(&id).unwrap().licence = "MIT OR Apache-2.0".into();
        let found = faults(&without, &packages).unwrap();
        assert_eq!(found, ["missing line: | rhai | 1 | MIT OR Apache-2.0 | `choreo`, `choreo-view` |"]);
    }

    #[test]
    fn version_ranges_equal_cargos() {
        let range = |version: &str| {
            let packages = packages().unwrap();
            let any = packages.into_values().next().unwrap();
            Package { version: version.into(), ..any }.range()
        };
        let ranges = ["1.27.0", "0.25.10", "0.0.7", "0.38.0+1.3.281", "2.0.0-dev.3"].map(range);
        assert_eq!(ranges, ["1", "0.25", "0.0.7", "0.38", "2"]);
    }
}
