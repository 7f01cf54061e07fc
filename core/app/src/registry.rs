//! The plugins that this program is built with, and `choreo plugins`.

use crate::args::PluginsArgs;
use crate::failure::{Failure, print, print_json};
use choreo_plugin::{Manifest, OptionKind, Registry};
use serde_json::{Value, json};
use std::fmt::Write;

pub fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add_importer(import_gltf::GltfImporter);
    registry.add_importer(import_mannequin::Mannequin);
    registry.add_effect(effect_vignette::Vignette);
    registry.add_exporter(export_png::PngExporter);
    registry.add_exporter(export_mp4::Mp4Exporter);
    registry.add_exporter(export_gif::GifExporter);
    registry.add_exporter(export_y4m::Y4mExporter);
    registry
}

pub fn run(args: PluginsArgs) -> Result<(), Failure> {
    let registry = registry();
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
            for o in m.options {
                let _ = writeln!(text, "      {:<14} {} ({})", o.name, o.about, range(&o.kind));
            }
        }
    }
    print(&text)
}

fn range(kind: &OptionKind) -> String {
    match kind {
        OptionKind::Number { default, min, max } => format!("{min} to {max}, default {default}"),
        OptionKind::Bool { default } => format!("true or false, default {default}"),
        OptionKind::Text { default, one_of: [] } => format!("text, default \"{default}\""),
        OptionKind::Text { default, one_of } => format!("{}, default {default}", one_of.join(" | ")),
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
