//! Hover: description of the call, option, variable, file or clip under the cursor.

use crate::completion::describe_value;
use crate::context::call_around;
use crate::facts;
use crate::files::Contents;
use crate::names::{self, NameKind};
use crate::source::{is_string, is_word};
use crate::values::ScriptValue;
use crate::view::View;
use choreo_plugin::color;
use choreo_script::describe;
use serde_json::{Value, json};

pub(crate) fn hover(view: &View, byte: usize) -> Value {
    let source = view.source;
    let Some(token) = source.token_at(byte) else { return Value::Null };
    let text = match source.get(token) {
        word if is_string(word) => describe_string(view, token),
        word if is_word(word) => describe_word(view, token),
        _ => None,
    };
    let Some(text) = text else { return Value::Null };
    json!({ "contents": { "kind": "markdown", "value": text }, "range": source.range(&source.tokens[token]) })
}

fn describe_word(view: &View, token: usize) -> Option<String> {
    let (source, types) = (view.source, view.types());
    let word = source.get(token);
    if matches!(source.token_before(token, 1), "." | "?.") {
        let on = types.value_ending_at(token - 1);
        if types.keys(&on).iter().any(|key| key == word) {
            return Some(describe_variable(view, word, &types.field(&on, word)));
        }
        let of_kind = describe::entry(&on.kind, word);
        let entry = match on.kind.is_empty() {
            true => {
                describe::entries().iter().find(|entry| !entry.receiver_type.is_empty() && entry.name == word)
            }
            false => of_kind,
        };
        return entry.map(facts::describe_entry);
    }
    let start = source.tokens[token].start;
    if source.get(token + 1) == ":"
        && let Some(site) = call_around(types, start).filter(|site| site.maps.len() == 1)
    {
        let entry = site.entry(source)?;
        if let Some(option) = entry.options().into_iter().find(|option| option.name == word) {
            return Some(facts::describe_option(entry, &option));
        }
        let option = view.plugin_options(&site).into_iter().find(|option| option.name == word)?;
        return Some(format!("**{word}** — {}", facts::describe_plugin_option(&option)));
    }
    if let Some(declaration) = types.declaration_at(token).or_else(|| types.declaration(word, token)) {
        return Some(describe_variable(view, word, &types.declared_value(&declaration)));
    }
    describe::entry("", word).map(facts::describe_entry)
}

/// Description of a variable: its type, and facts about its file or clip.
fn describe_variable(view: &View, name: &str, value: &ScriptValue) -> String {
    let mut text = format!("**{name}**");
    if !value.kind.is_empty() {
        text.push_str(&format!(": {}", describe_value(value)));
    }
    let asset = value.file.as_deref().and_then(|file| view.contents(file));
    let details = match (asset, value.kind.as_str(), &value.name) {
        (Some(Contents::Loaded(asset)), "Clip", Some(clip)) => asset
            .clips
            .iter()
            .find(|known| known.name == *clip)
            .map(|clip| facts::describe_clip(&asset, clip, view.fps)),
        (Some(Contents::Loaded(asset)), "Joint", Some(joint)) => facts::describe_joint(&asset, joint),
        (Some(Contents::Loaded(asset)), "Asset" | "Actor", _) => Some(facts::describe_file(&asset, view.fps)),
        (Some(Contents::Unreadable(why)), ..) => Some(why),
        (Some(Contents::Reading), ..) => Some("the file is being read".to_string()),
        _ => None,
    };
    if let Some(details) = details {
        text.push_str(&format!("\n\n{details}"));
    }
    text
}

fn describe_string(view: &View, token: usize) -> Option<String> {
    let source = view.source;
    let written = source.string_value(token)?;
    if source.token_before(token, 1) == "import" {
        let module = view.types().modules.module(&written)?;
        let functions = (1..module.tokens.len()).filter(|i| module.get(i - 1) == "fn");
        let signature = |i: usize| {
            let end = module.matching_bracket(i + 1).unwrap_or(i);
            format!("- `{}`", &module.text[module.tokens[i].start..module.tokens[end].end])
        };
        return Some(format!(
            "**{written}** — module\n{}",
            functions.map(signature).collect::<Vec<_>>().join("\n")
        ));
    }
    let site = call_around(view.types(), source.tokens[token].start + 1)?;
    let kind = names::accepted_names(source, &site);
    if let Some(names) = kind {
        let file = names::receiver_file(site.receiver.as_ref()).or_else(|| view.file_of_arguments(&site));
        let asset = |file: Option<String>| file.and_then(|file| view.contents(&file));
        match names {
            NameKind::Models => match view.contents(&written)? {
                Contents::Loaded(asset) => return Some(facts::describe_file(&asset, view.fps)),
                Contents::Reading => return Some("the file is being read".to_string()),
                Contents::Unreadable(why) => return Some(why),
            },
            NameKind::Clips => {
                if let Some(Contents::Loaded(asset)) = asset(file) {
                    let clip = asset.clips.iter().find(|clip| clip.name == written)?;
                    return Some(facts::describe_clip(&asset, clip, view.fps));
                }
            }
            NameKind::Joints | NameKind::JointPatterns => {
                if let Some(Contents::Loaded(asset)) = asset(file) {
                    return describe_joints(&asset, &written);
                }
            }
            NameKind::Effects => {
                let effect = view.project.registry.effects().iter().find(|e| e.manifest().name == written)?;
                let manifest = effect.manifest();
                let options = manifest
                    .options
                    .iter()
                    .map(|o| format!("\n- **{}** — {}", o.name, facts::describe_plugin_option(o)));
                return Some(format!("**{written}** — {}{}", manifest.about, options.collect::<String>()));
            }
            NameKind::EffectParameters => {
                let option = view.plugin_options(&site).into_iter().find(|option| option.name == written)?;
                return Some(format!("**{written}** — {}", facts::describe_plugin_option(&option)));
            }
            _ => {}
        }
    }
    let rgba = color::bytes(&written).filter(|_| kind == Some(NameKind::Colors))?;
    Some(format!(
        "`#{:02x}{:02x}{:02x}`, sRGB {}, {}, {}",
        rgba[0], rgba[1], rgba[2], rgba[0], rgba[1], rgba[2]
    ))
}

/// Description of a joint, of a joint with those below it (`Spine..`), or of the joints that match a pattern.
fn describe_joints(asset: &choreo_asset::Asset, written: &str) -> Option<String> {
    if let Some(pattern) = written.strip_prefix('*').and_then(|p| p.strip_suffix('*')) {
        let names = asset.skeleton.names().iter().filter(|name| name.contains(pattern));
        let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
        return Some(format!("{}: {}", facts::count_with_noun(names.len(), "joint"), names.join(", ")));
    }
    let text = facts::describe_joint(asset, written.trim_end_matches(".."))?;
    Some(if written.ends_with("..") { format!("{text}; all of these joints are included") } else { text })
}
