//! Completion: methods by the type before the dot, options, allowed values, and names from files.

use crate::context::{CallSite, call_around, present_keys};
use crate::facts;
use crate::files::{self, Contents};
use crate::names::{self, NameKind};
use crate::snippets;
use crate::source::{Source, is_string, is_word};
use crate::values::{DeclarationKind, KEYWORDS, ScriptValue};
use crate::view::View;
use choreo_asset::Asset;
use choreo_plugin::{OptionKind, OptionSpec, color};
use choreo_script::describe::{self, Entry, Returns};
use choreo_script::quoted;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::ops::Range;

/// Kinds of items, as the protocol numbers them.
#[derive(Clone, Copy)]
enum ItemKind {
    Method = 2,
    Function = 3,
    Variable = 6,
    Module = 9,
    Property = 10,
    Value = 12,
    Keyword = 14,
    Snippet = 15,
    Color = 16,
    File = 17,
    Constant = 21,
}

/// Completion items collected for one request.
pub(crate) struct Items<'v> {
    view: &'v View<'v>,
    /// Text of the client, to which positions in the reply refer. In code inside an interpolated string, `view` has a different text.
    client_source: &'v Source,
    /// Range of bytes that an item replaces.
    range: Range<usize>,
    items: Vec<Value>,
    /// Whether a file is still being read, so that the client must ask again.
    incomplete: bool,
}

/// An item, before it is encoded for the protocol.
struct Item<'t> {
    label: &'t str,
    kind: ItemKind,
    detail: String,
    about: String,
    /// Text that is inserted; contains placeholders if the item is a snippet.
    text: String,
    is_snippet: bool,
    /// Sort order: items with smaller numbers come first.
    order: u8,
}

impl<'t> Item<'t> {
    fn new(label: &'t str, kind: ItemKind) -> Item<'t> {
        let text = label.to_string();
        Item { label, kind, detail: String::new(), about: String::new(), text, is_snippet: false, order: 5 }
    }
}

/// Largest number of items in a list.
const MAX_ITEMS: usize = 1500;

pub(crate) fn complete(view: &View, byte: usize) -> Value {
    match view.source.with_code_of_string(byte) {
        Some(source) => complete_in(&view.with_source(&source), view.source, byte),
        None => complete_in(view, view.source, byte),
    }
}

fn complete_in(view: &View, client_source: &Source, byte: usize) -> Value {
    let source = view.source;
    let mut items = Items { view, client_source, range: byte..byte, items: Vec::new(), incomplete: false };
    let token = source.token_at(byte).filter(|token| source.tokens[*token].start < byte);
    let string = token
        .filter(|token| is_string(source.get(*token)) && byte <= source.string_content_range(*token).end);
    let string = string.filter(|token| byte >= source.string_content_range(*token).start);
    if let Some(string) = string {
        items.add_items_in_string(string, byte);
    } else if !source.in_comment(byte) {
        let word = token.filter(|token| is_word(source.get(*token)) && source.tokens[*token].end >= byte);
        items.range = word.map_or(byte, |word| source.tokens[word].start)..byte;
        let before = word.unwrap_or_else(|| source.count_tokens_before(byte));
        match source.token_before(before, 1) {
            "." | "?." => items.add_methods(before - 1),
            "::" => items.add_module_members(before - 1),
            _ if source.get(before).starts_with(|c: char| c.is_ascii_digit())
                && word.is_none()
                && token.is_some() => {}
            _ => items.add_expression_items(before, byte),
        }
    }
    let incomplete = items.incomplete || items.items.len() >= MAX_ITEMS;
    json!({ "isIncomplete": incomplete, "items": items.items })
}

impl Items<'_> {
    fn push(&mut self, item: Item) {
        if self.items.len() >= MAX_ITEMS {
            return;
        }
        let snippet = item.is_snippet && self.view.snippets;
        let text =
            if item.is_snippet && !snippet { snippets::without_placeholders(&item.text) } else { item.text };
        let mut value = json!({
            "label": item.label,
            "kind": item.kind as u8,
            "sortText": format!("{}{:04}", item.order, self.items.len()),
            "filterText": item.label,
            "insertTextFormat": if snippet { 2 } else { 1 },
            "textEdit": { "range": self.client_source.range(&self.range), "newText": text },
        });
        if !item.detail.is_empty() {
            value["detail"] = item.detail.into();
        }
        if !item.about.is_empty() {
            value["documentation"] = json!({ "kind": "markdown", "value": item.about });
        }
        self.items.push(value);
    }

    /// Adds the methods of the value before a dot, and the keys of an object map.
    fn add_methods(&mut self, dot: usize) {
        let types = self.view.types();
        let on = types.value_ending_at(dot);
        for key in types.keys(&on) {
            let detail = describe_value(&types.field(&on, &key));
            self.push(Item { detail, ..Item::new(&key, ItemKind::Property) });
        }
        let known = !on.kind.is_empty();
        let mut seen = BTreeSet::new();
        for entry in describe::entries().iter().filter(|entry| !entry.receiver_type.is_empty()) {
            let fits = if known { entry.receiver_type == on.kind } else { seen.insert(entry.name) };
            if fits {
                self.add_call(entry, 5);
            }
        }
    }

    /// Adds a function or method with placeholders, or its name alone if the parenthesis is already there.
    fn add_call(&mut self, entry: &Entry, order: u8) {
        let is_text = |argument: &str| is_text_argument(entry, argument);
        let has_parenthesis = self.view.source.text[self.range.end..].starts_with('(');
        let plain = has_parenthesis || entry.is_constant;
        let text = if plain { entry.name.to_string() } else { snippets::call_snippet(entry, &is_text) };
        let kind = match (entry.is_constant, entry.receiver_type.is_empty()) {
            (true, _) => ItemKind::Constant,
            (_, true) => ItemKind::Function,
            _ => ItemKind::Method,
        };
        let detail = entry.usages.join(" or ");
        let about = facts::describe_entry(entry);
        self.push(Item { detail, about, text, is_snippet: !plain, order, ..Item::new(entry.name, kind) });
    }

    /// Adds the functions and variables of a module.
    fn add_module_members(&mut self, separator: usize) {
        let types = self.view.types();
        let name = self.view.source.token_before(separator, 1);
        let Some(declaration) = types.declaration(name, separator) else { return };
        let path = types.declared_value(&declaration).name;
        let Some(module) = path.and_then(|path| types.modules.module(&path)) else { return };
        let types = crate::values::Types::new(&module, types.modules, &self.view.budget);
        for token in 0..module.tokens.len() {
            let Some(declared) =
                types.declaration_at(token).filter(|_| module.enclosing_bracket(token).is_none())
            else {
                continue;
            };
            let exported = module.token_before(token, 2) == "export";
            match declared.kind {
                DeclarationKind::Function => {
                    let end = module.matching_bracket(token + 1).unwrap_or(token);
                    let detail = &module.text[module.tokens[token].start..module.tokens[end].end];
                    self.push(Item {
                        detail: detail.to_string(),
                        ..Item::new(module.get(token), ItemKind::Function)
                    });
                }
                DeclarationKind::Variable if exported => {
                    self.push(Item::new(module.get(token), ItemKind::Variable))
                }
                _ => {}
            }
        }
    }

    /// Adds items for an expression, a statement or the key of an option.
    fn add_expression_items(&mut self, at: usize, byte: usize) {
        let source = self.view.source;
        let site = call_around(self.view.types(), byte);
        if let Some(site) = site.as_ref().filter(|site| site.at_key) {
            self.add_options(site, byte);
            return;
        }
        let argument =
            site.as_ref().filter(|site| site.maps.is_empty()).and_then(|site| site.argument_name(source));
        let key = site.as_ref().and_then(|site| site.maps.last()?.1.clone());
        let wanted = accepted_handle_types(argument.or(key.as_deref()).unwrap_or_default());
        if let Some(site) = &site {
            self.add_allowed_values(site);
        }
        if wanted.contains(&"Clip") {
            self.add_clips_of_assets(at);
        }
        self.add_variables(at, wanted);
        let starts = matches!(source.token_before(at, 1), "" | ";" | "{" | "}");
        for entry in describe::entries().iter().filter(|entry| entry.receiver_type.is_empty()) {
            let fits = matches!(entry.returns, Returns::Handle(kind) if wanted.contains(&kind));
            self.add_call(entry, if fits { 2 } else { 6 });
        }
        for (label, about, text) in snippets::STATEMENT_TEMPLATES.iter().filter(|_| starts) {
            let (about, text) = (about.to_string(), text.to_string());
            self.push(Item {
                detail: about,
                text,
                is_snippet: true,
                order: 4,
                ..Item::new(label, ItemKind::Snippet)
            });
        }
        for word in KEYWORDS {
            self.push(Item { order: 8, ..Item::new(word, ItemKind::Keyword) });
        }
    }

    /// Adds the options that an object map may have and does not have yet.
    fn add_options(&mut self, site: &CallSite, byte: usize) {
        let Some(entry) = site.entry(self.view.source) else { return };
        let (Some((open, _)), depth) = (site.maps.last(), site.maps.len()) else { return };
        let present = present_keys(self.view.source, *open, byte);
        if depth > 1 {
            // Nested maps such as `background: #{ top, bottom }` are described in the text of the option.
            let outer = site.maps[depth - 2].1.clone().unwrap_or_default();
            let about =
                entry.options().into_iter().find(|o| o.name == outer).map(|o| o.about).unwrap_or_default();
            for name in nested_map_keys(&about).into_iter().filter(|name| !present.contains(name)) {
                let text = format!("{name}: ");
                self.push(Item { about: about.clone(), text, ..Item::new(&name, ItemKind::Property) });
            }
            return;
        }
        for option in entry.options().into_iter().filter(|option| !present.contains(&option.name)) {
            let values = entry.values(&option.name);
            let text = match (values.is_empty(), option.about.starts_with("true or false")) {
                (false, _) if !option.about.contains("a color") => {
                    format!("{}: \"${{1:{}}}\"", option.name, values[0])
                }
                (_, true) => format!("{}: ${{1:true}}", option.name),
                _ => format!("{}: ", option.name),
            };
            let about = facts::describe_option(entry, &option);
            let detail = option.about.clone();
            self.push(Item {
                about,
                detail,
                text,
                is_snippet: true,
                ..Item::new(&option.name, ItemKind::Property)
            });
        }
        for option in self.view.plugin_options(site) {
            if present.contains(&option.name) {
                continue;
            }
            let detail = facts::describe_plugin_option(&option);
            let text = format!("{}: {}", option.name, default_placeholder(&option));
            self.push(Item { detail, text, is_snippet: true, ..Item::new(&option.name, ItemKind::Property) });
        }
    }

    /// Adds the documented values of an option or argument, in quotes, and `true` and `false`.
    fn add_allowed_values(&mut self, site: &CallSite) {
        let Some(entry) = site.entry(self.view.source) else { return };
        let key = site.maps.last().and_then(|(_, key)| key.clone());
        let argument = key.as_deref().or_else(|| site.argument_name(self.view.source)).unwrap_or_default();
        let takes_names =
            names::accepted_names(self.view.source, site).is_some_and(|names| names != NameKind::Colors);
        for value in entry.values(argument).into_iter().filter(|_| !takes_names && !site.in_list) {
            let label = format!("\"{value}\"");
            self.push(Item { order: 1, ..Item::new(&label, ItemKind::Value) });
        }
        let plugin =
            self.view.plugin_options(site).into_iter().find(|option| Some(&option.name) == key.as_ref());
        let flag = plugin.is_some_and(|option| matches!(option.kind, OptionKind::Bool { .. }));
        let about =
            entry.options().into_iter().find(|o| o.name == argument).map(|o| o.about).unwrap_or_default();
        if flag || about.contains("true") || about.contains("false") {
            for word in ["true", "false"] {
                self.push(Item { order: 1, ..Item::new(word, ItemKind::Value) });
            }
        }
    }

    /// Adds variables, functions and modules of the script; those of a wanted type come first.
    fn add_variables(&mut self, at: usize, wanted: &[&str]) {
        let (types, source) = (self.view.types(), self.view.source);
        let mut seen = BTreeSet::new();
        for token in (0..source.tokens.len()).rev() {
            let Some(declaration) = types.declaration_at(token) else { continue };
            let name = source.get(token);
            if types.declaration(name, at).as_ref() != Some(&declaration) || !seen.insert(name) {
                continue;
            }
            let value = types.declared_value(&declaration);
            let kind = match declaration.kind {
                DeclarationKind::Function => ItemKind::Function,
                DeclarationKind::Module => ItemKind::Module,
                _ => ItemKind::Variable,
            };
            let order = if wanted.contains(&value.kind.as_str()) { 0 } else { 3 };
            self.push(Item { detail: describe_value(&value), order, ..Item::new(name, kind) });
        }
    }

    /// Adds `moves.clip("Walk")` for each clip of each asset that the script has loaded.
    fn add_clips_of_assets(&mut self, at: usize) {
        let (types, source) = (self.view.types(), self.view.source);
        let mut seen = BTreeSet::new();
        for token in 0..at.min(source.tokens.len()) {
            let Some(declaration) = types.declaration_at(token) else { continue };
            let name = source.get(token);
            if types.declaration(name, at).as_ref() != Some(&declaration) || !seen.insert(name) {
                continue;
            }
            let value = types.declared_value(&declaration);
            let Some(file) = value.file.filter(|_| value.kind == "Asset") else { continue };
            let Some(asset) = self.loaded_asset(&file) else { continue };
            for clip in &asset.clips {
                let text = format!("{name}.clip({})", quoted(&clip.name));
                let detail = facts::clip_length(clip, self.view.fps);
                self.push(Item { detail, order: 1, ..Item::new(&text, ItemKind::Value) });
            }
        }
    }

    /// Adds items for a position inside a string.
    fn add_items_in_string(&mut self, string: usize, byte: usize) {
        let source = self.view.source;
        let inside = source.string_content_range(string);
        let closed = inside.end < source.tokens[string].end;
        self.range = inside.start..if closed { inside.end } else { byte };
        if source.token_before(string, 1) == "import" {
            let names = self.view.files_named(&["rhai".into()]);
            for name in names.iter().filter_map(|name| name.strip_suffix(".rhai")) {
                self.push(Item::new(name, ItemKind::Module));
            }
            return;
        }
        let Some(site) = call_around(self.view.types(), byte) else { return };
        let Some(entry) = site.entry(source) else { return };
        let key = site.maps.last().and_then(|(_, key)| key.clone());
        let argument = key.as_deref().or_else(|| site.argument_name(source)).unwrap_or_default();
        let names = names::accepted_names(source, &site);
        names.iter().for_each(|names| self.add_names(*names, &site));
        // If files and plugins provide the names, the texts in the description are only examples.
        let shows_documented_values =
            names.is_none_or(|names| matches!(names, NameKind::Panoramas | NameKind::Colors));
        let listed = self.view.plugin_options(&site).into_iter().find(|option| option.name == argument);
        match listed.map(|option| option.kind) {
            Some(OptionKind::Text { one_of, .. }) => {
                one_of.iter().for_each(|v| self.push(Item::new(v, ItemKind::Value)))
            }
            _ if !shows_documented_values => {}
            Some(_) => {}
            None => entry
                .values(argument)
                .iter()
                .for_each(|v| self.push(Item { order: 6, ..Item::new(v, ItemKind::Value) })),
        }
    }

    /// Adds the names of a kind that are allowed at the cursor.
    fn add_names(&mut self, names: NameKind, site: &CallSite) {
        let file = |view: &View| {
            names::receiver_file(site.receiver.as_ref()).or_else(|| view.file_of_arguments(site))
        };
        match names {
            NameKind::Models => self.add_files(&self.view.model_extensions(), true),
            NameKind::Images => {
                self.add_files(&["png", "jpg", "jpeg", "webp", "bmp", "tga"].map(String::from), false)
            }
            NameKind::Panoramas => self.add_files(&["hdr".into()], false),
            NameKind::Scripts => self.add_files(&["rhai".into()], false),
            NameKind::Fonts => self.add_files(&["ttf".into(), "otf".into()], false),
            NameKind::Effects => {
                let effects = self.view.project.registry.effects();
                let effects: Vec<_> = effects.iter().map(|e| e.manifest().clone()).collect();
                for effect in effects {
                    self.push(Item {
                        detail: effect.about.clone(),
                        ..Item::new(&effect.name, ItemKind::Value)
                    });
                }
            }
            NameKind::EffectParameters => {
                for option in self.view.plugin_options(site) {
                    let detail = facts::describe_plugin_option(&option);
                    self.push(Item { detail, ..Item::new(&option.name, ItemKind::Property) });
                }
            }
            NameKind::Importers => {
                for importer in self.view.project.registry.importers() {
                    let manifest = importer.manifest();
                    self.push(Item {
                        detail: manifest.about.clone(),
                        ..Item::new(&manifest.name, ItemKind::Value)
                    });
                }
            }
            NameKind::Markers => self.add_values(names::declared_names(self.view.source, "marker", 2, false)),
            NameKind::ClipMarkers => {
                self.add_values(names::declared_names(self.view.source, "marker", 2, true))
            }
            NameKind::Actors => self.add_values(self.names_declared_in_scene(site, "cast", 2)),
            NameKind::Cameras => self.add_values(self.names_declared_in_scene(site, "camera", 1)),
            NameKind::Colors => {
                for (name, rgb) in color::NAMES {
                    self.push(Item {
                        about: format!("#{rgb:06x}"),
                        order: 7,
                        ..Item::new(name, ItemKind::Color)
                    });
                }
            }
            _ => {
                let clip_file = site.receiver.as_ref().and_then(|on| on.clip.clone()).map(|(file, _)| file);
                let files = [file(self.view), clip_file.filter(|_| names == NameKind::Clips)];
                for file in files.into_iter().flatten() {
                    if let Some(asset) = self.loaded_asset(&file) {
                        self.add_names_of_asset(names, &asset);
                    }
                }
            }
        }
    }

    /// Names declared with a function, such as `camera("wide")`: in the script of the `Scene` if the receiver is one, else in this script.
    fn names_declared_in_scene(&self, site: &CallSite, function: &str, arguments: usize) -> Vec<String> {
        let scene = site.receiver.as_ref().filter(|on| on.kind == "Scene").and_then(|on| on.name.as_ref());
        let script = scene.and_then(|file| self.view.modules.module(file));
        names::declared_names(script.as_deref().unwrap_or(self.view.source), function, arguments, false)
    }

    fn add_values(&mut self, names: Vec<String>) {
        names.iter().for_each(|name| self.push(Item::new(name, ItemKind::Value)));
    }

    fn add_files(&mut self, extensions: &[String], with_built_in: bool) {
        for name in self.view.files_named(extensions) {
            // A script may load a file that it exported itself, but rarely needs to.
            let own = with_built_in && self.view.is_exported(&name);
            let (detail, order) = if own { ("written by choreo export", 9) } else { ("", 5) };
            self.push(Item { detail: detail.into(), order, ..Item::new(&name, ItemKind::File) });
        }
        if with_built_in {
            for name in files::built_in_names(self.view.project) {
                self.push(Item { detail: "built in".into(), ..Item::new(&name, ItemKind::File) });
            }
        }
    }

    fn loaded_asset(&mut self, file: &str) -> Option<std::sync::Arc<Asset>> {
        match self.view.contents(file)? {
            Contents::Loaded(asset) => Some(asset),
            Contents::Reading => {
                self.incomplete = true;
                None
            }
            Contents::Unreadable(_) => None,
        }
    }

    /// Adds the names of a kind that an asset contains.
    fn add_names_of_asset(&mut self, names: NameKind, asset: &Asset) {
        match names {
            NameKind::Clips => {
                for clip in &asset.clips {
                    let detail = facts::clip_length(clip, self.view.fps);
                    self.push(Item { detail, ..Item::new(&clip.name, ItemKind::Value) });
                }
            }
            NameKind::Joints | NameKind::JointPatterns => {
                self.add_joints(asset, names == NameKind::JointPatterns)
            }
            NameKind::Morphs => self.add_values(facts::morph_names(asset)),
            NameKind::Expressions => {
                self.add_values(asset.expressions.iter().map(|e| e.name.clone()).collect())
            }
            NameKind::Materials => self.add_values(asset.materials.iter().map(|m| m.name.clone()).collect()),
            NameKind::FileCameras => self.add_values(asset.cameras.iter().map(|c| c.name.clone()).collect()),
            NameKind::Parts => {
                let nodes = asset.instances.iter().map(|i| asset.skeleton.names()[i.joint as usize].clone());
                let mut parts: Vec<String> =
                    asset.meshes.iter().map(|m| m.name.clone()).chain(nodes).collect();
                parts.sort();
                parts.dedup();
                self.add_values(parts);
            }
            _ => {}
        }
    }

    /// Adds the joints by their short names, then by their names in the file.
    fn add_joints(&mut self, asset: &Asset, patterns: bool) {
        let skeleton = &asset.skeleton;
        let parents = skeleton.parents();
        let short = facts::short_joints(skeleton);
        for (index, own) in skeleton.names().iter().enumerate() {
            let parent =
                parents[index].map(|parent| format!("child of {}", skeleton.names()[parent as usize]));
            let place = parent.unwrap_or_else(|| "root".to_string());
            let has_children = parents.contains(&Some(index as u32));
            for name in short[index].iter().chain([own]) {
                let is_short = name != own;
                let detail = if is_short { format!("{own}, {place}") } else { place.clone() };
                let order = if is_short { 4 } else { 5 };
                self.push(Item { detail, order, ..Item::new(name, ItemKind::Value) });
                if patterns && has_children {
                    let all = format!("{name}..");
                    let detail = format!("{name} and all below it");
                    self.push(Item { detail, order, ..Item::new(&all, ItemKind::Value) });
                }
            }
        }
        const BODY_PARTS: [&str; 12] = [
            "Arm", "Leg", "Hand", "Foot", "Spine", "Finger", "Thumb", "Head", "Hair", "Tail", "Skirt", "Eye",
        ];
        for part in BODY_PARTS.iter().filter(|_| patterns) {
            let written = skeleton.names().iter().find_map(|name| {
                let at = name.to_lowercase().find(&part.to_lowercase())?;
                name.get(at..at + part.len())
            });
            let Some(written) = written else { continue };
            let matching = skeleton.names().iter().filter(|name| name.contains(written)).count();
            if matching > 1 {
                let detail = format!("{matching} joints");
                self.push(Item { detail, order: 6, ..Item::new(&format!("*{written}*"), ItemKind::Value) });
            }
        }
    }
}

fn default_placeholder(option: &OptionSpec) -> String {
    match &option.kind {
        OptionKind::Text { default, .. } => format!("\"${{1:{default}}}\""),
        _ => format!("${{1:{}}}", option.default()),
    }
}

/// Whether an argument is a string.
fn is_text_argument(entry: &Entry, argument: &str) -> bool {
    const TEXT_ARGUMENTS: [&str; 7] =
        ["name", "file", "words", "joint", "name_or_index", "property", "parameter"];
    TEXT_ARGUMENTS.contains(&argument)
        || matches!(argument, "kind" | "how" | "slot" | "what") && !entry.values(argument).is_empty()
}

/// Handle types that an argument or option of this name accepts.
fn accepted_handle_types(argument: &str) -> &'static [&'static str] {
    match argument {
        "clip" | "idle" => &["Clip"],
        "asset" => &["Asset"],
        "actor" | "who" => &["Actor"],
        "camera" => &["Camera"],
        "actor_or_joint" | "actor_or_point" | "target" | "look_at" | "pole" | "ground" => &["Actor", "Joint"],
        "image" | "normal_map" | "opacity_map" | "height_map" => &["Image"],
        "stage" => &["Stage"],
        _ => &[],
    }
}

/// Keys shown in a description, such as `#{ top, bottom }` or `#{ … } with size (…), softness (…)`.
fn nested_map_keys(about: &str) -> Vec<String> {
    let shown = about.split("#{").nth(1).and_then(|rest| rest.split('}').next()).unwrap_or_default();
    let word = |part: &str| part.trim().split([':', ' ']).next().unwrap_or_default().to_string();
    let is_name =
        |name: &String| !name.is_empty() && name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let mut keys: Vec<String> = shown.split(',').map(word).filter(is_name).collect();
    if let Some((_, list)) = about.split_once("} with ").filter(|_| keys.is_empty()) {
        let before_parenthesis =
            |part: &str| part.rsplit([' ', ',']).find(|w| !w.is_empty()).map(str::to_string);
        keys = list.split(" (").filter_map(before_parenthesis).filter(is_name).collect();
        keys.dedup();
    }
    keys
}

/// Description of a value, such as "Actor of knight.glb".
pub(crate) fn describe_value(value: &ScriptValue) -> String {
    let mut words = value.kind.clone();
    if let Some(name) = value.name.as_ref().filter(|_| value.is_handle() && value.kind != "Asset") {
        words.push_str(&format!(" \"{name}\""));
    }
    if let Some(file) = &value.file {
        words.push_str(&format!(" of {file}"));
    }
    if let Some((_, clip)) = &value.clip {
        words.push_str(&format!(", plays {clip}"));
    }
    if let Some(element) = value.element.as_ref().filter(|element| !element.kind.is_empty()) {
        words.push_str(&format!(" of {}", describe_value(element)));
    }
    words
}
