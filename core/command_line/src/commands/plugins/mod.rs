//! `choreo plugins`: importers, effects and exporters with their options, which importer takes a file, and packages of plugins.

mod package_test;
mod packages;

use crate::args::{PluginsAction, PluginsArgs};
use crate::failure::{Failure, Problem, print, print_json};
use crate::plugins::option_rows;
use crate::plugins::plugin_files;
use crate::scene::model;
use crate::terminal::page::Page;
use choreo_plugin::{Claim, Manifest, OptionKind, PluginFile, Registry, Source};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

pub fn run(args: PluginsArgs, plugins: &Registry) -> Result<(), Failure> {
    match &args.action {
        Some(PluginsAction::Install { path, replace }) => packages::install(path, *replace, plugins),
        Some(PluginsAction::List { json }) => packages::list(*json),
        Some(PluginsAction::Remove { name }) => packages::remove(name),
        Some(PluginsAction::Test { path }) => package_test::run(path, plugins),
        None => show(&args, plugins),
    }
}

fn show(args: &PluginsArgs, plugins: &Registry) -> Result<(), Failure> {
    let beside: Vec<&Path> = std::iter::once(Path::new(".")).chain(args.file.as_deref()).collect();
    let listing = plugin_files::listing(plugins, &args.plugins, &beside)?;
    // All are compiled here, used or not.
    let problems: Vec<Problem> = listing.problems().into_iter().map(Problem::Text).collect();
    let registry = listing.registry.settled();
    if let Some(file) = &args.file {
        claims(file, &registry, args.json)?;
    } else {
        list(&registry, args.json)?;
    }
    // The working plugins are listed all the same.
    if problems.is_empty() { Ok(()) } else { Err(Failure::Input(problems)) }
}

fn list(registry: &Registry, as_json: bool) -> Result<(), Failure> {
    type Row<'a> = (&'a Manifest, Option<&'a PluginFile>);
    let importers: Vec<Row> = registry.importers().iter().map(|p| (p.manifest(), p.file())).collect();
    let effects = registry.effects().iter().map(|p| (p.manifest(), p.file())).collect();
    let exporters = registry.exporters().iter().map(|p| (p.manifest(), None)).collect();
    let scenes = registry.scene_exporters().iter().map(|p| (p.manifest(), p.file())).collect();
    let kinds = [
        ("importers", importers),
        ("effects", effects),
        ("exporters", exporters),
        ("scene exporters", scenes),
    ];
    if as_json {
        let mut all = serde_json::Map::new();
        for (kind, rows) in kinds {
            all.insert(
                kind.replace(' ', "_"),
                rows.into_iter().map(|(m, file)| manifest_json(m, file)).collect(),
            );
        }
        return print_json(&Value::Object(all));
    }
    let mut text = Page::default();
    for (kind, rows) in kinds {
        text.line(format_args!("{kind}"));
        for (m, file) in rows {
            let extensions: Vec<String> = m.extensions.iter().map(|e| format!(".{e}")).collect();
            let from = file.map(|f| format!(" ({})", f.path.display())).unwrap_or_default();
            text.line(format_args!("  {:<12} {:<14} {}{from}", m.name, extensions.join(" "), m.about));
            text.text(&option_rows(m));
        }
    }
    print(text.as_str())
}

/// Prints every importer's claim on one file; the importer that reads it comes first.
fn claims(file: &Path, registry: &Registry, as_json: bool) -> Result<(), Failure> {
    model::must_be_file(file)?;
    let source = Source { name: file.display().to_string(), bytes: Arc::new(model::head(file)?) };
    let claims = registry.claims(&source);
    let reader = claims.first().filter(|(claim, _)| *claim > Claim::NotMine).map(|(_, i)| &i.manifest().name);
    if as_json {
        let all: Vec<Value> = claims
            .iter()
            .map(|(claim, i)| {
                let (kind, score) = match claim {
                    Claim::NotMine => ("not mine", None),
                    Claim::Extension => ("extension", None),
                    Claim::Content(score) => ("content", Some(*score)),
                };
                json!({ "importer": i.manifest().name, "claim": kind, "score": score })
            })
            .collect();
        return print_json(&json!({ "file": source.name, "read_by": reader, "claims": all }));
    }
    let mut text = Page::default();
    match reader {
        Some(name) => text.line(format_args!("{}: read by {name}", source.name)),
        None => text.line(format_args!("{}: no importer knows this kind of file", source.name)),
    }
    for (claim, importer) in &claims {
        text.line(format_args!("  {:<12} {claim}", importer.manifest().name));
    }
    print(text.as_str())
}

fn manifest_json(m: &Manifest, file: Option<&PluginFile>) -> Value {
    let options: Vec<Value> = m
        .options
        .iter()
        .map(|o| match &o.kind {
            OptionKind::Number { default, min, max } => {
                json!({ "name": o.name, "about": o.about, "kind": "number", "default": default, "min": min, "max": max })
            }
            OptionKind::Bool { default } => {
                json!({ "name": o.name, "about": o.about, "kind": "bool", "default": default })
            }
            OptionKind::Text { default, one_of } => {
                json!({ "name": o.name, "about": o.about, "kind": "text", "default": default, "one_of": one_of })
            }
        })
        .collect();
    json!({ "name": m.name, "version": m.version, "about": m.about, "extensions": m.extensions, "options": options,
        "file": file.map(|f| f.path.display().to_string()) })
}
