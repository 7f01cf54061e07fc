//! Licenses: SPDX expressions, and a check of the lock file against deny.toml without cargo-deny.

use crate::notices::Package;
use std::collections::{BTreeMap, BTreeSet};

/// Licenses that require only their text and the names of the authors.
pub(crate) const PLAIN: &[&str] =
    &["MIT", "Apache-2.0", "Zlib", "BSD-2-Clause", "BSD-3-Clause", "ISC", "CC0-1.0", "Unlicense", "0BSD"];

/// Whether these licenses satisfy an SPDX expression with `OR`, `AND`, parentheses, and the old `/` for `OR`.
pub(crate) fn satisfied(expression: &str, allowed: &[&str]) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    or_expression_fits(&mut rest, allowed) && rest.is_empty()
}

fn or_expression_fits(words: &mut &[&str], allowed: &[&str]) -> bool {
    let mut fits = and_expression_fits(words, allowed);
    while let ["OR", rest @ ..] = words {
        *words = rest;
        fits |= and_expression_fits(words, allowed);
    }
    fits
}

fn and_expression_fits(words: &mut &[&str], allowed: &[&str]) -> bool {
    let mut fits = term_fits(words, allowed);
    while let ["AND", rest @ ..] = words {
        *words = rest;
        fits &= term_fits(words, allowed);
    }
    fits
}

fn term_fits(words: &mut &[&str], allowed: &[&str]) -> bool {
    match *words {
        ["(", rest @ ..] => {
            *words = rest;
            let fits = or_expression_fits(words, allowed);
            let closed = words.first() == Some(&")");
            *words = words.get(1..).unwrap_or_default();
            fits && closed
        }
        // An exception (`WITH …`) only adds permissions.
        [licence, "WITH", _, rest @ ..] | [licence, rest @ ..] => {
            *words = rest;
            // The suffix `+` means this version or a later one.
            allowed.contains(&licence.trim_end_matches('+'))
        }
        [] => false,
    }
}

/// Lists of deny.toml that are checked here; cargo-deny checks the rest, above all advisories.
pub(crate) struct Deny {
    allow: Vec<String>,
    /// Crates with their additional licenses.
    exceptions: Vec<(String, Vec<String>)>,
    banned: Vec<String>,
    /// Entries of the form `name:^range`.
    skipped: BTreeSet<String>,
}

impl Deny {
    /// Parses the lists; each entry must be on its own line.
    pub(crate) fn read(text: &str) -> Deny {
        let list = |start: &str| -> Vec<Vec<String>> {
            let lines = text.lines().skip_while(|l| *l != start).skip(1).take_while(|l| *l != "]");
            let entries = lines.filter(|line| !line.trim_start().starts_with('#'));
            let quoted = |line: &str| line.split('"').skip(1).step_by(2).map(str::to_string).collect();
            entries.map(quoted).filter(|words: &Vec<String>| !words.is_empty()).collect()
        };
        let first = |start: &str| list(start).into_iter().map(|words| words[0].clone());
        Deny {
            allow: first("allow = [").collect(),
            exceptions: list("exceptions = [").iter().map(|w| (w[0].clone(), w[1..].to_vec())).collect(),
            banned: first("deny = [").collect(),
            skipped: first("skip = [").collect(),
        }
    }

    /// Violations of these lists in the dependency graph, one line each.
    pub(crate) fn faults(&self, packages: &BTreeMap<String, Package>) -> Vec<String> {
        let mut faults = Vec::new();
        for package in packages.values().filter(|p| !p.is_ours) {
            let name = &package.name;
            let own = self.exceptions.iter().filter(|(of, _)| of == name).flat_map(|(_, licences)| licences);
            let allowed: Vec<&str> = self.allow.iter().chain(own).map(String::as_str).collect();
            if !satisfied(&package.licence, &allowed) {
                faults.push(format!("{name}: the licence {} is not allowed", package.licence));
            }
            if self.banned.contains(name) {
                faults.push(format!("{name} is banned"));
            }
            if package.is_foreign {
                faults.push(format!("{name} is not from crates.io"));
            }
        }
        let twice = duplicate_packages(packages);
        faults.extend(
            twice
                .difference(&self.skipped)
                .map(|old| format!("{old} is a dependency beside a newer version")),
        );
        faults.extend(self.skipped.difference(&twice).map(|old| format!("{old} no longer has two versions")));
        faults
    }
}

/// Entries `name:^range` for every version of a crate that also exists in a newer version.
fn duplicate_packages(packages: &BTreeMap<String, Package>) -> BTreeSet<String> {
    let number = |range: &str| range.split('.').map(|n| n.parse().unwrap_or(0)).collect::<Vec<u64>>();
    let mut versions: BTreeMap<&str, BTreeMap<Vec<u64>, String>> = BTreeMap::new();
    for package in packages.values().filter(|p| !p.is_ours) {
        let range = package.range();
        versions.entry(&package.name).or_default().insert(number(&range), range);
    }
    let old = |(name, ranges): (&str, BTreeMap<Vec<u64>, String>)| {
        let names = ranges.into_values().map(|range| format!("{name}:^{range}")).collect::<Vec<_>>();
        names.into_iter().rev().skip(1)
    };
    versions.into_iter().flat_map(old).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::notices::packages;

    fn deny() -> Deny {
        Deny::read(&std::fs::read_to_string(crate::root().join("deny.toml")).unwrap())
    }

    #[test]
    fn expressions() {
        let fits = |expression: &str| satisfied(expression, &["MIT", "Unicode-3.0"]);
        for good in
            ["MIT", "Apache-2.0 OR MIT", "Apache-2.0/MIT", "(MIT OR Apache-2.0) AND Unicode-3.0", "MIT+"]
        {
            assert!(fits(good), "{good}");
        }
        for bad in ["", "Apache-2.0", "MIT AND Apache-2.0", "Apache-2.0 AND MIT OR Zlib", "(MIT", "MIT Zlib"]
        {
            assert!(!fits(bad), "{bad}");
        }
        assert!(satisfied("Apache-2.0 WITH LLVM-exception", &["Apache-2.0"]));
    }

    #[test]
    fn the_dependencies_satisfy_deny_toml() {
        let faults = deny().faults(&packages().unwrap());
        assert!(faults.is_empty(), "deny.toml:\n{}", faults.join("\n"));
    }

    /// Removing any entry must cause an error: no entry is superfluous, and the check finds each.
    #[test]
    fn every_licence_and_exception_of_deny_toml_is_needed() {
        let (packages, mut deny) = (packages().unwrap(), deny());
        for n in 0..deny.allow.len() {
            let licence = deny.allow.remove(n);
            assert!(!deny.faults(&packages).is_empty(), "no crate needs {licence}");
            deny.allow.insert(n, licence);
        }
        for n in 0..deny.exceptions.len() {
            let exception = deny.exceptions.remove(n);
            assert!(!deny.faults(&packages).is_empty(), "no crate needs {exception:?}");
            deny.exceptions.insert(n, exception);
        }
    }

    #[test]
    fn planted_faults_are_found() {
        let (mut packages, mut deny) = (packages().unwrap(), deny());
        packages.values_mut().find(|p| p.name == "rhai").unwrap().licence = "AGPL-3.0-only".into();
        packages.values_mut().find(|p| p.name == "gif").unwrap().is_foreign = true;
        deny.banned.push("ash".into());
        deny.skipped.remove("thiserror:^1");
        deny.skipped.insert("rhai:^0.1".into());
        let mut faults = deny.faults(&packages);
        faults.sort();
        assert_eq!(
            faults,
            [
                "ash is banned",
                "gif is not from crates.io",
                "rhai: the licence AGPL-3.0-only is not allowed",
                "rhai:^0.1 no longer has two versions",
                "thiserror:^1 is a dependency beside a newer version",
            ]
        );
    }
}
