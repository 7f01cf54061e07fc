//! Descriptions of the script API as data, for editors: forms, results, options and allowed values. Everything is read from the
//! tables of `api`, from which the reference is generated, too.

use crate::api::defs;
use crate::compile::CONSTANTS;
use crate::def::{Def, ResultType};
use crate::synonyms::ALIASES;
use std::collections::BTreeSet;
use std::sync::LazyLock;

/// A function, method or constant.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Type of the receiver; empty for a function.
    pub receiver_type: &'static str,
    pub name: &'static str,
    /// Heading in the reference.
    pub heading: &'static str,
    /// Names of the arguments, one list for each number of arguments.
    pub forms: Vec<Vec<&'static str>>,
    /// Usages, such as `Actor.at(x, y, z)`.
    pub usages: Vec<String>,
    pub returns: Returns,
    /// The description, then a paragraph for each group of options or aspect.
    pub about: Vec<String>,
    /// Whether it can be called inside `on_frame`.
    pub in_frames: bool,
    /// Whether it can be called only inside a test section.
    pub in_tests: bool,
    pub is_constant: bool,
}

/// Type of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Returns {
    Nothing,
    /// The receiver, for chaining.
    Receiver,
    /// A handle of this type.
    Handle(&'static str),
    /// A number, text or list.
    Value(&'static str),
}

/// An option of a call, with the text of the reference about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptionEntry {
    pub name: String,
    /// Unit, range and default; empty where the reference has no more than the name.
    pub about: String,
}

/// Entries of all functions, methods and constants, in the order of the reference. Aliases follow their function.
pub fn entries() -> &'static [Entry] {
    static ENTRIES: LazyLock<Vec<Entry>> = LazyLock::new(|| {
        let mut entries: Vec<Entry> = Vec::new();
        for (heading, def) in &defs().all {
            let entry = entry_of_def(heading, def);
            let aliases = ALIASES.iter().filter(|(_, name)| *name == def.full_name());
            let aliases: Vec<Entry> =
                aliases.map(|(alias, _)| Entry { name: alias, ..entry.clone() }).collect();
            entries.push(entry);
            entries.extend(aliases);
        }
        for (name, args, about) in defs().maths {
            let forms = vec![args.split(',').map(str::trim).filter(|a| !a.is_empty()).collect()];
            let entry = mathematics_entry(name, about, Returns::Value("number"));
            entries.push(Entry { forms, usages: vec![format!("{name}({args})")], ..entry });
        }
        for (name, about) in CONSTANTS {
            let usages = vec![name.to_string()];
            let entry = mathematics_entry(name, about, Returns::Value("number"));
            entries.push(Entry { usages, is_constant: true, ..entry });
        }
        entries
    });
    &ENTRIES
}

/// An entry of the section "Mathematics", without forms and usages.
fn mathematics_entry(name: &'static str, about: &str, returns: Returns) -> Entry {
    Entry {
        receiver_type: "",
        name,
        heading: "Mathematics",
        forms: Vec::new(),
        usages: Vec::new(),
        returns,
        about: vec![about.to_string()],
        in_frames: true,
        in_tests: false,
        is_constant: false,
    }
}

fn entry_of_def(heading: &'static str, def: &'static Def) -> Entry {
    Entry {
        receiver_type: def.on.name(),
        name: def.name,
        heading,
        forms: def.forms(),
        usages: def.usages(&def.full_name()),
        returns: match def.returns {
            ResultType::Nothing => Returns::Nothing,
            ResultType::Receiver => Returns::Receiver,
            ResultType::Handle(kind) => Returns::Handle(kind.name()),
            ResultType::Value(what) => Returns::Value(what),
        },
        about: def.about(),
        in_frames: def.is_for_frames,
        in_tests: def.is_for_tests,
        is_constant: false,
    }
}

/// The entry of a method of a type, or of a function where the type is empty.
pub fn entry(receiver_type: &str, name: &str) -> Option<&'static Entry> {
    entries().iter().find(|entry| entry.receiver_type == receiver_type && entry.name == name)
}

/// The entry of a full name, such as `Cue.then` or `shape`.
fn entry_by_full_name(full: &str) -> Option<&'static Entry> {
    let (receiver_type, name) = full.split_once('.').unwrap_or(("", full));
    entry(receiver_type, name)
}

impl Entry {
    pub fn full_name(&self) -> String {
        if self.receiver_type.is_empty() {
            self.name.to_string()
        } else {
            format!("{}.{}", self.receiver_type, self.name)
        }
    }

    /// The options of the call's object map, including options of other calls to which the description refers.
    pub fn options(&self) -> Vec<OptionEntry> {
        let mut found = Vec::new();
        self.add_options(&mut found, 0);
        if found.is_empty() && self.forms.iter().flatten().any(|arg| *arg == "options") {
            found = shown_keys(&self.about[0]);
        }
        let mut known = BTreeSet::new();
        found.retain(|option: &OptionEntry| known.insert(option.name.clone()));
        found
    }

    fn add_options(&self, found: &mut Vec<OptionEntry>, depth: usize) {
        let takes = self.forms.iter().flatten().any(|arg| *arg == "options" || *arg == "places");
        if !takes || depth > 3 {
            return;
        }
        for (number, paragraph) in self.about.iter().enumerate() {
            let Some(list) = option_list(paragraph, number == 0) else { continue };
            let start = found.len();
            found.extend(listed_options(list));
            let excluded = list.split_once(" except ").map_or("", |(_, rest)| rest);
            let own = found.split_off(start);
            for name in referenced_calls(list) {
                let Some(entry) =
                    entry_by_full_name(name).filter(|entry| entry.full_name() != self.full_name())
                else {
                    continue;
                };
                let mut referenced = Vec::new();
                entry.add_options(&mut referenced, depth + 1);
                let all = list.contains("all options of") || list.starts_with("Options as in");
                let is_listed =
                    |o: &OptionEntry| own.iter().any(|known| known.name == o.name && known.about.is_empty());
                referenced.retain(|o| {
                    if all { !excluded.split([' ', '.', ',']).any(|w| w == o.name) } else { is_listed(o) }
                });
                found.extend(referenced);
            }
            found.extend(own);
        }
    }

    /// The quoted texts that the reference lists for an argument or option.
    pub fn values(&self, argument: &str) -> Vec<String> {
        if let Some(option) = self.options().iter().find(|option| option.name == argument) {
            return quoted_words(&option.about);
        }
        self.argument_values(argument, 0)
    }

    /// Quoted texts in the paragraph about an argument, else those of the call to which the paragraph refers by "as in". `depth`:
    /// number of references followed so far.
    fn argument_values(&self, argument: &str, depth: usize) -> Vec<String> {
        let stem: String = argument.chars().take(argument.len().saturating_sub(1).max(3)).collect();
        let is_about_argument = |p: &&String| {
            let heading = p.split_once(": ").map_or("", |(heading, _)| heading).to_lowercase();
            let word = heading.split([',', ' ']).next().unwrap_or_default();
            word.starts_with(&stem) && (word == heading || heading[word.len()..].starts_with(','))
        };
        let mark = format!("`{argument}`");
        let text = match self.about.iter().find(is_about_argument) {
            Some(paragraph) => paragraph.as_str(),
            None => match self.about.iter().find_map(|p| p.find(&mark).map(|at| &p[at..])) {
                Some(part) => part,
                None if argument == "options" => "",
                None => self.about.first().map_or("", String::as_str),
            },
        };
        let own = quoted_words(text);
        let refers = text.split("as in ").nth(1).map(|rest| name_at_start(rest.trim_start_matches('`')));
        match refers.and_then(entry_by_full_name).filter(|_| own.is_empty() && depth < 3) {
            Some(entry) => entry.argument_values(argument, depth + 1),
            None => own,
        }
    }
}

/// The part of a paragraph that lists options. `is_first`: the paragraph describes the call, so a heading in it starts no list.
fn option_list(paragraph: &str, is_first: bool) -> Option<&str> {
    if let Some(at) = paragraph.find("Options") {
        let rest = &paragraph[at..];
        if rest.starts_with("Options as in") {
            return Some(rest);
        }
        return rest.split_once(": ").map(|(_, list)| list);
    }
    if paragraph.starts_with('`') {
        return Some(paragraph);
    }
    let (heading, list) = paragraph.split_once(": ").filter(|_| !is_first)?;
    // The options of a call in a callback are a subset of the options described before.
    let is_heading = heading.len() < 100
        && heading != "In a callback"
        && heading.starts_with(char::is_uppercase)
        && !heading.contains(['(', '.', '`', '"']);
    is_heading.then_some(list)
}

/// The options in a list such as `name (about), name and name (about)`. After the first sentence, only words with parentheses
/// count as options.
fn listed_options(list: &str) -> Vec<OptionEntry> {
    let mut found = Vec::new();
    let mut is_list = !list.starts_with('`');
    for item in split_list(list) {
        let item = item.trim();
        let item = ["and ", "or ", "with ", "either ", "one of "]
            .iter()
            .fold(item, |i, word| i.strip_prefix(word).unwrap_or(i));
        // In "refracted by ior (…)", the name is the word before the parenthesis.
        let item = [" by ", " over "].iter().fold(item, |i, word| {
            let before = i.find('(').unwrap_or(0);
            i[..before].rfind(word).map_or(i, |at| &i[at + word.len()..])
        });
        if let Some((code, rest)) = item.strip_prefix('`').and_then(|code| code.split_once('`')) {
            let (name, value) = code.split_once(": ").unwrap_or((code, ""));
            if is_name(name) && (!value.is_empty() || rest.trim_start().starts_with('(') || rest.is_empty()) {
                let about = format!("{value}{rest}").trim().to_string();
                found.push(OptionEntry { name: name.to_string(), about });
            }
            continue;
        }
        let name = item.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).next().unwrap_or("");
        let rest = item[name.len()..].trim_end_matches('.');
        let rest = rest.strip_prefix(" times").unwrap_or(rest);
        let about = rest.trim().strip_prefix('(').map(|about| about.trim_end().trim_end_matches(')'));
        if is_name(name) && (about.is_some() || is_list && (rest.is_empty() || rest.starts_with(" as in "))) {
            found.push(OptionEntry { name: name.to_string(), about: about.unwrap_or("").to_string() });
        }
        let end = item.as_ptr() as usize - list.as_ptr() as usize + item.len();
        is_list &= !list[end..].starts_with(". ");
    }
    found
}

/// The keys of the map that a description shows: `#{ up, down }`.
fn shown_keys(about: &str) -> Vec<OptionEntry> {
    let shown = about.split("#{").nth(1).and_then(|rest| rest.split('}').next()).unwrap_or_default();
    let name = |part: &str| part.trim().split([':', ' ']).next().unwrap_or_default().to_string();
    let names = shown.split(',').map(name).filter(|name| is_name(name));
    names.map(|name| OptionEntry { name, about: String::new() }).collect()
}

fn is_name(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_lowercase())
        && text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

/// Splits a list at commas, semicolons, ends of sentences and words that join options, but not inside parentheses, quotes or
/// code.
fn split_list(list: &str) -> Vec<&str> {
    const BREAKS: [&str; 7] = [", ", "; ", ". ", " and ", " or ", " with ", ": "];
    let (mut parts, mut start, mut depth, mut quoted) = (Vec::new(), 0, 0i32, false);
    for (at, c) in list.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 && !quoted && at >= start {
            let found = BREAKS.iter().find(|b| list[at..].starts_with(**b));
            let in_code = list[start..at].matches('`').count() % 2 == 1;
            if let Some(found) = found.filter(|_| !in_code) {
                parts.push(&list[start..at]);
                start = at + found.len();
            }
        }
    }
    parts.push(&list[start.min(list.len())..]);
    parts
}

/// Names of the calls to which a list refers by "as in" or "all options of", as in "as in `text`".
fn referenced_calls(list: &str) -> Vec<&str> {
    let marks = ["as in ", "all options of "];
    let after =
        marks.iter().flat_map(|mark| list.match_indices(mark).map(|(at, mark)| &list[at + mark.len()..]));
    after.map(|rest| name_at_start(rest.trim_start_matches('`'))).collect()
}

/// The name, such as `Cue.then`, with which a text begins.
fn name_at_start(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')).unwrap_or(text.len());
    text[..end].trim_end_matches('.')
}

/// The quoted words of a description.
fn quoted_words(text: &str) -> Vec<String> {
    let words = text.split('"').skip(1).step_by(2);
    let plain = |c: char| c.is_ascii_alphanumeric() || "_+-:".contains(c);
    let mut found: Vec<String> = Vec::new();
    for word in words.filter(|word| !word.is_empty() && word.chars().all(plain)) {
        if !found.iter().any(|known| known == word) {
            found.push(word.to_string());
        }
    }
    found
}

/// The comment that silences a rule of `check`.
pub fn allow_comment(rule: &str) -> String {
    format!("// allow: {rule}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn option_names(full: &str) -> Vec<String> {
        entry_by_full_name(full).unwrap().options().into_iter().map(|o| o.name).collect()
    }

    #[test]
    fn options_are_read_from_descriptions_of_all_forms() {
        assert_eq!(option_names("load"), ["facing", "importer", "compress", "only"]);
        assert_eq!(option_names("Joint.limit"), ["swing", "twist", "hinge", "axis"]);
        assert_eq!(option_names("Actor.in_place"), option_names("Actor.root_motion"));
        assert_eq!(option_names("panel"), ["at", "offset", "opacity", "anchor", "size", "color"]);
        for option in ["fade", "repeat", "in_step", "inertial", "trim"] {
            assert!(option_names("Actor.play").iter().any(|name| name == option), "{option}");
        }
        assert!(
            option_names("mesh").iter().any(|n| n == "roughness")
                && !option_names("lines").iter().any(|n| n == "roughness")
        );
        assert!(!option_names("mesh").iter().any(|n| n == "size"), "{:?}", option_names("mesh"));
    }

    #[test]
    fn allowed_texts_are_read_from_descriptions() {
        let values = |full: &str, argument: &str| entry_by_full_name(full).unwrap().values(argument);
        assert_eq!(values("load", "facing"), ["+z", "-z", "+x", "-x"]);
        assert_eq!(values("Joint.key", "property"), ["rotation", "position", "scale"]);
        assert_eq!(values("Joint.key", "how"), values("Actor.key", "how"));
        assert_eq!(values("Actor.key", "how")[..3], ["linear", "step", "smooth"]);
        assert_eq!(values("shape", "kind")[..3], ["plane", "quad", "box"]);
        assert_eq!(values("Actor.skinning", "how"), ["linear", "dual_quaternion"]);
        assert_eq!(values("Asset.texture", "slot")[..2], ["color", "normal"]);
    }
}
