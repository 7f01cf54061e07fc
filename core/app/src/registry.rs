//! The plugins that this program is built with, and `choreo plugins`.

use crate::args::PluginsArgs;
use crate::failure::{Failure, print, print_json};
use crate::model;
use choreo_plugin::{Claim, Manifest, OptionKind, OptionSpec, OptionValue, Registry, Source};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

pub fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add_importer(import_gltf::GltfImporter);
    registry.add_importer(import_mannequin::Mannequin);
    registry.add_importer(import_fbx::FbxImporter);
    registry.add_importer(import_bvh::BvhImporter);
    registry.add_importer(import_collada::ColladaImporter);
    registry.add_importer(import_obj::ObjImporter);
    registry.add_importer(import_stl::StlImporter);
    registry.add_effect(effect_vignette::Vignette);
    registry.add_exporter(export_png::PngExporter);
    registry.add_exporter(export_mp4::Mp4Exporter);
    registry.add_exporter(export_gif::GifExporter);
    registry.add_exporter(export_y4m::Y4mExporter);
    registry
}

pub fn run(args: PluginsArgs) -> Result<(), Failure> {
    let registry = registry();
    if let Some(file) = &args.file {
        return claims(file, &registry, args.json);
    }
    let importers = registry.importers().iter().map(|p| p.manifest()).collect::<Vec<_>>();
    let effects = registry.effects().iter().map(|p| p.manifest()).collect();
    let exporters = registry.exporters().iter().map(|p| p.manifest()).collect();
    let kinds = [("importers", importers), ("effects", effects), ("exporters", exporters)];
    if args.json {
        let mut all = serde_json::Map::new();
        for (kind, manifests) in kinds {
            all.insert(kind.into(), manifests.into_iter().map(manifest_json).collect());
        }
        return print_json(&Value::Object(all));
    }
    let mut text = String::new();
    for (kind, manifests) in kinds {
        let _ = writeln!(text, "{kind}");
        for m in manifests {
            let extensions: Vec<String> = m.extensions.iter().map(|e| format!(".{e}")).collect();
            let _ = writeln!(text, "  {:<12} {:<14} {}", m.name, extensions.join(" "), m.about);
            for o in &m.options {
                let _ = writeln!(text, "      {:<14} {} ({})", o.name, o.about, range(o));
            }
        }
    }
    print(&text)
}

/// What every importer says of one file, the one that reads it first.
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
    let mut text = match reader {
        Some(name) => format!("{}: read by {name}\n", source.name),
        None => format!("{}: no importer knows this kind of file\n", source.name),
    };
    for (claim, importer) in &claims {
        let _ = writeln!(text, "  {:<12} {claim}", importer.manifest().name);
    }
    print(&text)
}

fn range(option: &OptionSpec) -> String {
    let default = option.default();
    match (&option.kind, &default) {
        (OptionKind::Number { min, max, .. }, _) => format!("{min} to {max}, default {default}"),
        (OptionKind::Text { one_of, .. }, OptionValue::Text(default)) if !one_of.is_empty() => {
            format!("{}, default {default}", one_of.join(" | "))
        }
        _ => format!("{}, default {default}", option.allowed()),
    }
}

fn manifest_json(m: &Manifest) -> Value {
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
    json!({ "name": m.name, "version": m.version, "about": m.about, "extensions": m.extensions, "options": options })
}
