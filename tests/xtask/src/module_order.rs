//! Imports between the modules of a crate point one way: a test reads every crate's sources and refuses cycles that contain a folder.
//! Files that lie side by side in a flat crate may know each other.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A top-level module of a crate.
#[derive(Default)]
struct Module {
    is_folder: bool,
    /// The module's files without comments and tests, one after the other.
    code: String,
}

type Modules = BTreeMap<String, Module>;

/// The modules of a `src` folder. Texts of files with tests alone are left out.
fn modules(src: &Path) -> Modules {
    let mut modules = Modules::new();
    for entry in std::fs::read_dir(src).unwrap().flatten() {
        let path = entry.path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let module = modules.entry(name).or_default();
        module.is_folder |= path.is_dir();
        read(&path, &mut module.code);
    }
    modules
}

fn read(path: &Path, code: &mut String) {
    if path.is_dir() {
        std::fs::read_dir(path).unwrap().flatten().for_each(|entry| read(&entry.path(), code));
    } else if path.extension().is_some_and(|e| e == "rs")
        && path.file_stem().is_some_and(|stem| stem != "tests")
    {
        let text = std::fs::read_to_string(path).unwrap();
        let text = text.split("#[cfg(test)]\nmod").next().unwrap_or_default();
        let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        lines.for_each(|line| *code += &format!("{line}\n"));
    }
}

fn first_name(text: &str) -> &str {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default()
}

/// The names that follow each `prefix` in a text: `crate::a`, or `crate::{a, b::c}`.
fn names_after<'t>(text: &'t str, prefix: &str) -> Vec<&'t str> {
    let mut names = Vec::new();
    for rest in text.split(prefix).skip(1) {
        match rest.strip_prefix('{') {
            None => names.push(first_name(rest)),
            Some(list) => {
                let list = list.split(';').next().unwrap_or_default();
                let mut depth = 0;
                let items = list.split(|c: char| {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    c == ',' && depth == 0
                });
                names.extend(items.map(|item| first_name(item.trim_start())));
            }
        }
    }
    names
}

/// The module that each name re-exported by `lib.rs` comes from.
fn re_exports(lib: &str) -> BTreeMap<&str, &str> {
    let mut from = BTreeMap::new();
    for item in lib.split("pub use ").skip(1) {
        let item = item.split(';').next().unwrap_or_default().trim_start_matches("crate::");
        let words = item.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
        words.skip(1).for_each(|word| {
            from.insert(word, first_name(item));
        });
    }
    from
}

/// The modules that each module imports.
fn imports(modules: &Modules) -> BTreeMap<&str, BTreeSet<&str>> {
    let exported = modules.get("lib").map(|lib| re_exports(&lib.code)).unwrap_or_default();
    let own = |name: &str| modules.get_key_value(name).map(|(name, _)| name.as_str());
    let of = |(name, module): (&'_ String, &Module)| -> BTreeSet<&str> {
        let names = names_after(&module.code, "crate::").into_iter();
        let found = names.filter_map(|n| own(n).or_else(|| exported.get(n).and_then(|from| own(from))));
        found.filter(|found| found != name).collect()
    };
    modules
        .iter()
        .filter(|(name, _)| *name != "lib" && *name != "main")
        .map(|m| (m.0.as_str(), of(m)))
        .collect()
}

/// All that can be reached from a module, step by step along imports.
fn reached<'m>(from: &str, imports: &BTreeMap<&'m str, BTreeSet<&'m str>>) -> BTreeSet<&'m str> {
    let mut seen = BTreeSet::new();
    let mut next: Vec<&str> = imports[from].iter().copied().collect();
    while let Some(module) = next.pop() {
        if seen.insert(module) {
            next.extend(imports.get(module).into_iter().flatten());
        }
    }
    seen
}

/// Pairs of modules that import each other, directly or through others, and of which one is a folder.
fn cycles(modules: &Modules) -> Vec<String> {
    let imports = imports(modules);
    let reached: BTreeMap<&str, _> = imports.keys().map(|name| (*name, reached(name, &imports))).collect();
    let mut found = Vec::new();
    for (a, from_a) in &reached {
        for b in from_a.iter().filter(|b| *b > a && reached.get(*b).is_some_and(|from_b| from_b.contains(a)))
        {
            if modules[*a].is_folder || modules[*b].is_folder {
                found.push(format!("{a} and {b}"));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imports_between_the_modules_of_a_crate_point_one_way() {
        let (mut crates, mut found) = (0, Vec::new());
        for group in ["core", "plugins", "tests"] {
            for entry in std::fs::read_dir(crate::root().join(group)).unwrap().flatten() {
                let src = entry.path().join("src");
                if src.is_dir() {
                    crates += 1;
                    let cycles = cycles(&modules(&src)).into_iter();
                    found.extend(cycles.map(|pair| format!("{}: {pair} import each other", src.display())));
                }
            }
        }
        assert!(found.is_empty(), "{}", found.join("\n"));
        assert!(crates > 50, "{crates} crates were read");
    }

    #[test]
    fn planted_cycles_are_found() {
        let planted = |folder: bool, a: &str, b: &str, lib: &str| {
            let of = |code: &str| Module { is_folder: folder, code: code.into() };
            let modules = [("a", of(a)), ("b", of(b)), ("c", of("use crate::b;")), ("lib", of(lib))];
            cycles(&modules.into_iter().map(|(name, module)| (name.to_string(), module)).collect())
        };
        assert_eq!(planted(true, "use crate::b::B;", "use crate::{x::y, a};", ""), ["a and b"]);
        assert_eq!(
            planted(true, "use crate::c::{B, D};", "use crate::A;", "pub use a::{A};"),
            ["a and b", "a and c", "b and c"]
        );
        assert_eq!(planted(true, "use crate::c;", "", ""), Vec::<String>::new());
        assert_eq!(planted(false, "use crate::b;", "use crate::a;", ""), Vec::<String>::new());
    }
}
