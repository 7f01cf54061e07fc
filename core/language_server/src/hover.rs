//! Hover: description of the call, option, variable, file or clip under the cursor.

use crate::completion::in_words;
use crate::context::call_around;
use crate::facts;
use crate::files::Contents;
use crate::names::{self, Names};
use crate::source::{is_string, is_word};
use crate::values::Value as Known;
use crate::view::View;
use choreo_plugin::color;
use choreo_script::describe;
use serde_json::{Value, json};

pub fn hover(view: &View, byte: usize) -> Value {
    let source = view.source;
    let Some(token) = source.token_at(byte) else { return Value::Null };
    let text = match source.get(token) {
        word if is_string(word) => of_string(view, token),
        word if is_word(word) => of_word(view, token),
        _ => None,
    };
    let Some(text) = text else { return Value::Null };
    json!({ "contents": { "kind": "markdown", "value": text }, "range": source.range(&source.tokens[token]) })
}

fn of_word(view: &View, token: usize) -> Option<String> {
    let (source, types) = (view.source, view.types());
    let word = source.get(token);
    if matches!(source.before(token, 1), "." | "?.") {
        let on = types.ending_at(token - 1);
        if types.keys(&on).iter().any(|key| key == word) {
            return Some(of_value(view, word, &types.field(&on, word)));
        }
        let of_kind = describe::entry(&on.kind, word);
        let entry = match on.kind.is_empty() {
            true => describe::entries().iter().find(|entry| !entry.on.is_empty() && entry.name == word),
            false => of_kind,
        };
        return entry.map(facts::entry);
    }
    let start = source.tokens[token].start;
    if source.get(token + 1) == ":"
        && let Some(site) = call_around(types, start).filter(|site| site.maps.len() == 1)
    {
        let entry = site.entry(source)?;
        if let Some(option) = entry.options().into_iter().find(|option| option.name == word) {
            return Some(facts::option(entry, &option));
        }
        let option = view.plugin_options(&site).into_iter().find(|option| option.name == word)?;
        return Some(format!("**{word}** — {}", facts::plugin_option(&option)));
    }
    if let Some(declaration) = types.declares(token).or_else(|| types.declaration(word, token)) {
        return Some(of_value(view, word, &types.declared(&declaration)));
    }
    describe::entry("", word).map(facts::entry)
}

/// Description of a variable: its type, and facts about its file or clip.
fn of_value(view: &View, name: &str, value: &Known) -> String {
    let mut text = format!("**{name}**");
    if !value.kind.is_empty() {
        text.push_str(&format!(": {}", in_words(value)));
    }
    let asset = value.file.as_deref().and_then(|file| view.contents(file));
    let details = match (asset, value.kind.as_str(), &value.name) {
        (Some(Contents::Known(asset)), "Clip", Some(clip)) => asset
            .clips
            .iter()
            .find(|known| known.name == *clip)
            .map(|clip| facts::clip(&asset, clip, view.fps)),
        (Some(Contents::Known(asset)), "Joint", Some(joint)) => facts::joint(&asset, joint),
        (Some(Contents::Known(asset)), "Asset" | "Actor", _) => Some(facts::file(&asset, view.fps)),
        (Some(Contents::Unreadable(why)), ..) => Some(why),
        (Some(Contents::Reading), ..) => Some("the file is being read".to_string()),
        _ => None,
    };
    if let Some(details) = details {
        text.push_str(&format!("\n\n{details}"));
    }
    text
}

fn of_string(view: &View, token: usize) -> Option<String> {
    let source = view.source;
    let written = source.string(token)?;
    if source.before(token, 1) == "import" {
        let module = view.types().modules.module(&written)?;
        let functions = (1..module.tokens.len()).filter(|i| module.get(i - 1) == "fn");
        let signature = |i: usize| {
            let end = module.partner(i + 1).unwrap_or(i);
            format!("- `{}`", &module.text[module.tokens[i].start..module.tokens[end].end])
        };
        return Some(format!(
            "**{written}** — module\n{}",
            functions.map(signature).collect::<Vec<_>>().join("\n")
        ));
    }
    let site = call_around(view.types(), source.tokens[token].start + 1)?;
    let kind = names::names(source, &site);
    if let Some(names) = kind {
        let file = names::file_of(site.on.as_ref()).or_else(|| view.file_of_arguments(&site));
        let asset = |file: Option<String>| file.and_then(|file| view.contents(&file));
        match names {
            Names::Models => match view.contents(&written)? {
                Contents::Known(asset) => return Some(facts::file(&asset, view.fps)),
                Contents::Reading => return Some("the file is being read".to_string()),
                Contents::Unreadable(why) => return Some(why),
            },
            Names::Clips => {
                if let Some(Contents::Known(asset)) = asset(file) {
                    let clip = asset.clips.iter().find(|clip| clip.name == written)?;
                    return Some(facts::clip(&asset, clip, view.fps));
                }
            }
            Names::Joints | Names::JointPatterns => {
                if let Some(Contents::Known(asset)) = asset(file) {
                    return joints(&asset, &written);
                }
            }
            Names::Effects => {
                let effect = view.project.registry.effects().iter().find(|e| e.manifest().name == written)?;
                let manifest = effect.manifest();
                let options = manifest
                    .options
                    .iter()
                    .map(|o| format!("\n- **{}** — {}", o.name, facts::plugin_option(o)));
                return Some(format!("**{written}** — {}{}", manifest.about, options.collect::<String>()));
            }
            Names::EffectParameters => {
                let option = view.plugin_options(&site).into_iter().find(|option| option.name == written)?;
                return Some(format!("**{written}** — {}", facts::plugin_option(&option)));
            }
            _ => {}
        }
    }
    let rgba = color::bytes(&written).filter(|_| kind == Some(Names::Colors))?;
    Some(format!(
        "`#{:02x}{:02x}{:02x}`, sRGB {}, {}, {}",
        rgba[0], rgba[1], rgba[2], rgba[0], rgba[1], rgba[2]
    ))
}

/// Description of a joint, of a joint with those below it (`Spine..`), or of the joints that match a pattern.
fn joints(asset: &choreo_asset::Asset, written: &str) -> Option<String> {
    if let Some(pattern) = written.strip_prefix('*').and_then(|p| p.strip_suffix('*')) {
        let names = asset.skeleton.names().iter().filter(|name| name.contains(pattern));
        let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
        return Some(format!("{}: {}", facts::count(names.len(), "joint"), names.join(", ")));
    }
    let text = facts::joint(asset, written.trim_end_matches(".."))?;
    Some(if written.ends_with("..") { format!("{text}; all of these joints are included") } else { text })
}
