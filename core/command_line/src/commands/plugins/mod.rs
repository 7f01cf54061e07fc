//! `choreo plugins`: lists importers, effects and exporters with their options, prints which importer reads a file, and manages packages of
//! plugins.

mod package_test;
mod packages;

use crate::App;
use crate::args::{PluginsAction, PluginsArgs};
use crate::failure::{Failure, Problem, print, print_json};
use crate::plugins::option_rows;
use crate::plugins::plugin_files;
use crate::scene::model;
use crate::terminal::page::Page;
use crate::terminal::pages;
use choreo_plugin::suggest::did_you_mean;
use choreo_plugin::{Claim, Manifest, OptionKind, OptionSpec, PluginFile, Registry, Source};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;

pub(crate) fn run(args: PluginsArgs, app: &App) -> Result<(), Failure> {
    let plugins = &app.registry;
    match &args.action {
        Some(PluginsAction::Install { path, replace }) => packages::install(path, *replace, plugins),
        Some(PluginsAction::List { json }) => packages::list_packages(*json),
        Some(PluginsAction::Remove { name }) => packages::remove(name),
        Some(PluginsAction::Test { path }) => package_test::run(path, plugins),
        None => show_plugins(&args, app),
    }
}

fn show_plugins(args: &PluginsArgs, app: &App) -> Result<(), Failure> {
    let beside: Vec<&Path> = std::iter::once(Path::new(".")).chain(args.file.as_deref()).collect();
    let listing = plugin_files::listing(&app.registry, &args.plugins, &beside)?;
    // All plugin files are compiled here, even if nothing uses them.
    let mut problems: Vec<Problem> = listing.problems().into_iter().map(Problem::Text).collect();
    let registry = listing.registry.settled();
    match (&args.file, &args.name) {
        (Some(file), _) => print_claims(file, &registry, args.json)?,
        // Faulty plugins of other names do not matter here.
        (None, Some(name))
            if plugins_by_kind(&registry)
                .iter()
                .any(|(.., rows)| rows.iter().any(|(m, _)| m.name == *name)) =>
        {
            return print_plugins(app, &registry, Some(name), args.json);
        }
        (None, Some(name)) => problems.insert(0, Problem::Text(unknown_plugin_message(name, &registry))),
        (None, None) => print_plugins(app, &registry, None, args.json)?,
    }
    // Working plugins are listed even if others have errors.
    if problems.is_empty() { Ok(()) } else { Err(Failure::Input(problems)) }
}

/// A plugin's manifest and file.
type PluginRow<'a> = (&'a Manifest, Option<&'a PluginFile>);

/// All plugins by kind: name of the kind, prefix of the folders with their pages, plugins.
fn plugins_by_kind(registry: &Registry) -> [(&'static str, &'static str, Vec<PluginRow<'_>>); 4] {
    let importers = registry.importers().iter().map(|p| (p.manifest(), p.file())).collect();
    let effects = registry.effects().iter().map(|p| (p.manifest(), p.file())).collect();
    let exporters = registry.exporters().iter().map(|p| (p.manifest(), None)).collect();
    let scenes = registry.scene_exporters().iter().map(|p| (p.manifest(), p.file())).collect();
    [
        ("importers", "plugins/import-", importers),
        ("effects", "plugins/effects/", effects),
        ("exporters", "plugins/export-", exporters),
        ("scene exporters", "plugins/export-", scenes),
    ]
}

/// Message about a name that no plugin has.
fn unknown_plugin_message(name: &str, registry: &Registry) -> String {
    let rows = plugins_by_kind(registry);
    let names = rows.iter().flat_map(|(.., rows)| rows.iter().map(|(m, _)| m.name.as_str()));
    let near = did_you_mean(name, names);
    format!(
        "there is no plugin \"{name}\"{near}\n    hint: choreo plugins lists all, choreo plugins list the installed packages"
    )
}

/// Prints all plugins, or those of one name with their pages.
fn print_plugins(app: &App, registry: &Registry, only: Option<&str>, as_json: bool) -> Result<(), Failure> {
    let mut kinds = plugins_by_kind(registry);
    for (.., rows) in &mut kinds {
        rows.retain(|(m, _)| only.is_none_or(|name| m.name == name));
    }
    if as_json {
        let mut all = serde_json::Map::new();
        for (kind, _, rows) in kinds {
            all.insert(
                kind.replace(' ', "_"),
                rows.into_iter().map(|(m, file)| manifest_json(m, file)).collect(),
            );
        }
        return print_json(&Value::Object(all));
    }
    let mut text = Page::default();
    for (kind, folder, rows) in kinds.iter().filter(|(.., rows)| only.is_none() || !rows.is_empty()) {
        text.line(format_args!("{kind}"));
        for (m, file) in rows {
            let extensions: Vec<String> = m.extensions.iter().map(|e| format!(".{e}")).collect();
            let from = file.map(|f| format!(" ({})", f.path.display())).unwrap_or_default();
            text.line(format_args!("  {:<12} {:<14} {}{from}", m.name, extensions.join(" "), m.about));
            text.text(&option_rows(m));
            let page = format!("{folder}{}/README.md", m.name);
            if only.is_some() && file.is_none() && pages::page_text(app, &page).is_some() {
                text.line(format_args!("      {page} (choreo help --page {page})"));
            }
        }
    }
    print(text.as_str())
}

/// Prints every importer's claim on one file; the importer that reads it comes first.
fn print_claims(file: &Path, registry: &Registry, as_json: bool) -> Result<(), Failure> {
    model::check_is_file(file)?;
    let source = Source { name: file.display().to_string(), bytes: Arc::new(model::read_first_bytes(file)?) };
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
        let failed: Vec<String> = registry.failed_claims(&source).iter().map(ToString::to_string).collect();
        return print_json(
            &json!({ "file": source.name, "read_by": reader, "claims": all, "failed": failed }),
        );
    }
    let mut text = Page::default();
    match reader {
        Some(name) => text.line(format_args!("{}: read by {name}", source.name)),
        None => text.line(format_args!("{}: no importer knows this kind of file", source.name)),
    }
    for (claim, importer) in &claims {
        text.line(format_args!("  {:<12} {claim}", importer.manifest().name));
    }
    for panic in registry.failed_claims(&source) {
        text.line(format_args!("  {panic}"));
    }
    print(text.as_str())
}

/// Name, description, unit, type, default and allowed values of an option.
fn option_json(option: &OptionSpec) -> Value {
    let of_kind = match &option.kind {
        OptionKind::Number { default, min, max } => {
            json!({ "kind": "number", "default": default, "min": min, "max": max })
        }
        OptionKind::Integer { default, min, max } => {
            json!({ "kind": "integer", "default": default, "min": min, "max": max })
        }
        OptionKind::Bool { default } => json!({ "kind": "bool", "default": default }),
        OptionKind::Text { default, one_of } => {
            json!({ "kind": "text", "default": default, "one_of": one_of })
        }
        OptionKind::Color { default } => {
            let srgb = choreo_plugin::color::hex(*default).map(|(hex, _)| hex);
            json!({ "kind": "color", "default": default, "default_srgb": srgb })
        }
        OptionKind::Vector { default, min, max } => {
            json!({ "kind": "vector", "default": default, "min": min, "max": max })
        }
        OptionKind::Curve { default, min, max } => {
            json!({ "kind": "curve", "default": default, "min": min, "max": max })
        }
        OptionKind::Texture { default, srgb } => {
            json!({ "kind": "texture", "default": default, "srgb": srgb })
        }
        _ => json!({ "kind": option.allowed() }),
    };
    let mut all = json!({ "name": option.name, "about": option.about });
    if let (Some(all), Value::Object(of_kind)) = (all.as_object_mut(), of_kind) {
        all.extend(of_kind);
        all.extend((!option.unit.is_empty()).then(|| ("unit".to_string(), option.unit.clone().into())));
    }
    all
}

fn manifest_json(m: &Manifest, file: Option<&PluginFile>) -> Value {
    let options: Vec<Value> = m.options.iter().map(option_json).collect();
    json!({ "name": m.name, "version": m.version, "about": m.about, "extensions": m.extensions, "options": options,
        "file": file.map(|f| f.path.display().to_string()) })
}
