//! A test against cyclic imports between the modules of a crate: it reads the sources of every crate and refuses cycles that include a
//! folder, in the root of the crate and in each folder. Files in the same folder may import each other.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A module in the root of a crate or in one of its folders.
#[derive(Default)]
struct Module {
    is_folder: bool,
    /// Concatenated text of the module's files, without comments and tests.
    code: String,
}

type Modules = BTreeMap<String, Module>;

/// Modules in a folder. `at`: path of the folder's module, such as `api::`; empty for the root. Files with nothing but tests are left out.
fn modules(folder: &Path, at: &str) -> Modules {
    let mut modules = Modules::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        let name = stem(&path);
        let inside = below(at, &name);
        let module = modules.entry(name).or_default();
        // A folder that contains only tests belongs to the file beside it.
        module.is_folder |= std::fs::read_dir(&path)
            .is_ok_and(|mut files| files.any(|file| file.is_ok_and(|file| stem(&file.path()) != "tests")));
        read(&path, &inside, &mut module.code);
    }
    modules
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap().to_string_lossy().into_owned()
}

/// Module path of a file; for `mod.rs` it is that of the folder.
fn below(at: &str, name: &str) -> String {
    if ["lib", "main", "mod"].contains(&name) { at.to_string() } else { format!("{at}{name}::") }
}

fn read(path: &Path, at: &str, code: &mut String) {
    if path.is_dir() {
        for entry in std::fs::read_dir(path).unwrap().flatten() {
            read(&entry.path(), &below(at, &stem(&entry.path())), code);
        }
    } else if path.extension().is_some_and(|e| e == "rs") && stem(path) != "tests" {
        let text = std::fs::read_to_string(path).unwrap();
        let text = text.split("#[cfg(test)]\nmod").next().unwrap_or_default();
        let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        lines.for_each(|line| *code += &format!("{}\n", from_root(line, at)));
    }
}

/// A line with `crate::a::` in place of `super::`, for a module at this path.
fn from_root(line: &str, at: &str) -> String {
    let names: Vec<&str> = at.split_terminator("::").collect();
    let mut line = line.to_string();
    for up in (1..=names.len()).rev() {
        let around: String = names[..names.len() - up].iter().map(|name| format!("{name}::")).collect();
        line = line.replace(&"super::".repeat(up), &format!("crate::{around}"));
    }
    line
}

fn first_name(text: &str) -> &str {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default()
}

/// Names after each `prefix` in a text: `crate::a`, or `crate::{a, b::c}`.
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

/// The module from which each name is re-exported by `lib.rs` or `mod.rs`.
fn re_exports(head: &str) -> BTreeMap<&str, &str> {
    let mut from = BTreeMap::new();
    for item in head.split("pub use ").chain(head.split("pub(crate) use ").skip(1)).skip(1) {
        let item = item.split(';').next().unwrap_or_default().trim_start_matches("crate::");
        let words = item.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty());
        words.skip(1).for_each(|word| {
            from.insert(word, first_name(item));
        });
    }
    from
}

/// Modules that each module of a folder imports.
fn imports<'m>(modules: &'m Modules, at: &str) -> BTreeMap<&'m str, BTreeSet<&'m str>> {
    let head = modules.get("lib").or(modules.get("mod"));
    let exported = head.map(|head| re_exports(&head.code)).unwrap_or_default();
    let prefix = format!("crate::{at}");
    let own = |name: &str| modules.get_key_value(name).map(|(name, _)| name.as_str());
    let of = |(name, module): (&'m String, &'m Module)| -> BTreeSet<&'m str> {
        let names = names_after(&module.code, &prefix).into_iter();
        let found = names.filter_map(|n| own(n).or_else(|| exported.get(n).and_then(|from| own(from))));
        found.filter(|found| found != name).collect()
    };
    modules
        .iter()
        .filter(|(name, _)| !["lib", "main", "mod"].contains(&name.as_str()))
        .map(|m| (m.0.as_str(), of(m)))
        .collect()
}

/// All modules that can be reached from a module along imports.
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

/// Pairs of modules that import each other, directly or indirectly, if one of them is a folder.
fn cycles(modules: &Modules, at: &str) -> Vec<String> {
    let imports = imports(modules, at);
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

/// Cycles in a folder and in all folders below it.
fn cycles_below(folder: &Path, at: &str) -> Vec<String> {
    let mut found = cycles(&modules(folder, at), at);
    for entry in std::fs::read_dir(folder).unwrap().flatten().filter(|entry| entry.path().is_dir()) {
        found.extend(cycles_below(&entry.path(), &below(at, &stem(&entry.path()))));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_of_a_crate_have_no_import_cycles() {
        let (mut crates, mut found) = (0, Vec::new());
        for group in ["core", "plugins", "tests"] {
            for entry in std::fs::read_dir(crate::root().join(group)).unwrap().flatten() {
                let src = entry.path().join("src");
                if src.is_dir() {
                    crates += 1;
                    let cycles = cycles_below(&src, "").into_iter();
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
            cycles(&modules.into_iter().map(|(name, module)| (name.to_string(), module)).collect(), "")
        };
        assert_eq!(planted(true, "use crate::b::B;", "use crate::{x::y, a};", ""), ["a and b"]);
        assert_eq!(
            planted(true, "use crate::c::{B, D};", "use crate::A;", "pub use a::{A};"),
            ["a and b", "a and c", "b and c"]
        );
        assert_eq!(planted(true, "use crate::c;", "", ""), Vec::<String>::new());
        assert_eq!(planted(false, "use crate::b;", "use crate::a;", ""), Vec::<String>::new());
    }

    #[test]
    fn planted_cycles_within_a_folder_are_found() {
        assert_eq!(from_root("super::super::b + super::c", "x::y::"), "crate::b + crate::x::c");
        let of = |is_folder, code: &str| Module { is_folder, code: code.into() };
        let files = [("a", of(true, "use crate::x::B;")), ("b", of(false, "use crate::x::a::A;"))];
        let head = [("mod", of(false, "pub(crate) use b::B;"))];
        let modules: Modules = files.into_iter().chain(head).map(|(n, module)| (n.into(), module)).collect();
        assert_eq!(cycles(&modules, "x::"), ["a and b"]);
        assert_eq!(cycles(&modules, "y::"), Vec::<String>::new());
    }
}
