//! The reference: a page for each type that scripts handle, made from the descriptions that also make `API.md`, and an index of the
//! words of the field.

use crate::lesson::Lesson;
use crate::page::Page;
use choreo_language_server::calls;
use choreo_script::describe::{self, Entry, OptionEntry, Returns};
use choreo_script::help;
use std::collections::BTreeMap;
use std::path::Path;

/// The folder in which these pages would lie.
const FOLDER: &str = "scripts/guide/src/reference";
/// The repository as their links see it.
const ROOT: &str = "../../../..";
/// Longest line of a lesson that is shown as an example, in bytes.
const MAX_EXAMPLE_BYTES: usize = 130;

/// Lines of scripts by the call that they show.
type Examples<'l> = BTreeMap<String, (Option<&'static str>, Option<(String, &'l Lesson)>)>;

pub fn pages(root: &Path, lessons: &[Lesson]) -> Result<Vec<Page>, String> {
    let frame = root.join("scripts/guide/frame.rhai");
    let frame = std::fs::read_to_string(&frame).map_err(|e| format!("{}: {e}", frame.display()))?;
    let examples = examples(&frame, lessons);
    let (conventions, rest) = conventions();
    let mut types: Vec<&'static str> = Vec::new();
    for entry in describe::entries() {
        if !entry.receiver_type.is_empty() && !types.contains(&entry.receiver_type) {
            types.push(entry.receiver_type);
        }
    }
    let row = |kind: &&'static str| format!("| [{kind}]({}) | {} |\n", file(kind), makers(kind).join(", "));
    let index = format!(
        "# What a script can call\n\n[Functions](functions.md) and [mathematics](mathematics.md), and the methods of each type. \
         [Words of the field](words.md) leads from a word of another program to the call that does the same.\n\n\
         | type | returned by |\n|---|---|\n{}\n{conventions}",
        types.iter().map(row).collect::<String>()
    );
    let page = |name: &str, text: String| Page {
        path: format!("reference/{name}"),
        source: format!("{FOLDER}/{name}"),
        text,
        is_own: false,
    };
    let mut pages = vec![
        page("index.md", index),
        page("words.md", words()),
        page("functions.md", type_page("", &examples)),
    ];
    pages.extend(types.iter().map(|kind| page(&file(kind), type_page(kind, &examples))));
    pages.push(page("mathematics.md", mathematics()));
    pages.push(page("language.md", format!("# The language and its limits\n\n{rest}")));
    Ok(pages)
}

/// The file of a type's page; that of the functions where it is empty.
fn file(kind: &str) -> String {
    match kind {
        "" => "functions.md".to_string(),
        kind => format!("{}.md", kind.to_lowercase()),
    }
}

fn is_mathematics(entry: &Entry) -> bool {
    entry.heading == "Mathematics"
}

/// The link to a call, such as `Cue.then`, from a page that has the reference at `folder`.
pub fn link(name: &str, folder: &str) -> String {
    let (on, method) = name.split_once('.').unwrap_or(("", name));
    match describe::entry(on, method) {
        Some(entry) if is_mathematics(entry) => format!("[`{name}`]({folder}mathematics.md)"),
        Some(_) => format!("[`{name}`]({folder}{}#{})", file(on), method.to_lowercase()),
        None => format!("`{name}`"),
    }
}

/// The names of the calls in a script, each once, sorted.
pub fn called(text: &str) -> Vec<String> {
    let mut names: Vec<String> = calls(text).iter().map(|(_, entry)| entry.full_name()).collect();
    names.sort();
    names.dedup();
    names
}

/// The sections of `API.md` before the calls and after them.
fn conventions() -> (String, String) {
    let reference = choreo_script::reference();
    let (mut before, mut after) = (String::new(), String::new());
    for section in reference.split("\n## ").skip(1) {
        match section.lines().next().unwrap_or_default() {
            "Conventions" => before += &format!("## {section}\n"),
            "Aliases" | "What a script cannot use" | "Limits" => after += &format!("## {section}\n"),
            _ => {}
        }
    }
    (before, after)
}

/// Examples of each call: that of its help topic, and a line of a lesson.
fn examples<'l>(frame: &str, lessons: &'l [Lesson]) -> Examples<'l> {
    let mut found: Examples<'l> = BTreeMap::new();
    for example in help::examples().filter(|example| !example.starts_with("choreo ")) {
        let text = format!("{frame}\n{example}");
        for (_, entry) in calls(&text).into_iter().filter(|(at, _)| *at > frame.len()) {
            found.entry(entry.full_name()).or_default().0.get_or_insert(example);
        }
    }
    // The lowest rank is shown: a lesson that is about the call, and a line that is a statement.
    let mut ranks: BTreeMap<String, usize> = BTreeMap::new();
    for lesson in lessons {
        for (at, entry) in calls(&lesson.text) {
            let start = lesson.text[..at].rfind('\n').map_or(0, |end| end + 1);
            let line = lesson.text[start..].lines().next().unwrap_or_default().trim();
            let is_statement = line.ends_with(';') && !line.starts_with(['.', '}']);
            let words = [format!(".{}", entry.name), format!("{}(", entry.name)];
            let is_about = lesson.words.contains(&words[usize::from(entry.receiver_type.is_empty())]);
            let rank = 2 * usize::from(!is_statement) + usize::from(!is_about);
            let name = entry.full_name();
            if line.len() <= MAX_EXAMPLE_BYTES
                && !line.ends_with('{')
                && rank < *ranks.get(&name).unwrap_or(&usize::MAX)
            {
                ranks.insert(name.clone(), rank);
                found.entry(name).or_default().1 = Some((line.to_string(), lesson));
            }
        }
    }
    found
}

/// Links to the calls that return a type, its own methods left out.
fn makers(kind: &'static str) -> Vec<String> {
    let makes = |entry: &&Entry| entry.returns == Returns::Handle(kind) && entry.receiver_type != kind;
    describe::entries().iter().filter(makes).map(|entry| link(&entry.full_name(), "")).collect()
}

/// The page of a type; that of the functions where `kind` is empty.
fn type_page(kind: &'static str, examples: &Examples) -> String {
    let of_page = |entry: &&Entry| entry.receiver_type == kind && !is_mathematics(entry);
    let entries: Vec<&Entry> = describe::entries().iter().filter(of_page).collect();
    let mut text = format!("# {}\n\n", if kind.is_empty() { "Functions" } else { kind });
    let makers = makers(kind);
    if !makers.is_empty() {
        text += &format!("Returned by {}.\n\n", makers.join(", "));
    }
    text += "| call | in short |\n|---|---|\n";
    for entry in &entries {
        let short = entry
            .about
            .first()
            .map_or("", |about| about.split_once(". ").map_or(&**about, |(first, _)| first));
        text += &format!("| [`{0}`](#{0}) | {1} |\n", entry.name, cell(short.trim_end_matches('.')));
    }
    for entry in entries {
        text += &entry_text(entry, examples);
    }
    text
}

/// Text for a cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

fn entry_text(entry: &Entry, examples: &Examples) -> String {
    let gives = match entry.returns {
        Returns::Nothing | Returns::Receiver => String::new(),
        // An Image and a Plan have no methods, and so no page.
        Returns::Handle(kind) if !describe::entries().iter().any(|e| e.receiver_type == kind) => {
            format!(" → {kind}")
        }
        Returns::Handle(kind) => format!(" → [{kind}]({})", file(kind)),
        Returns::Value(what) => format!(" → {what}"),
    };
    let example = examples.get(&entry.full_name());
    let mut text = format!("\n## {}\n\n", entry.name);
    if let Some((_, Some((_, lesson)))) = example {
        let image = format!("{ROOT}/tests/pictures/lessons/{:0>2}.png", lesson.number);
        text += &format!(
            "<div class=\"shown\">\n\n[![Lesson {0}: {1}]({image})](../{2})\n\n</div>\n\n",
            lesson.number,
            lesson.title,
            lesson.page()
        );
    }
    let usages: Vec<String> = entry.usages.iter().map(|usage| format!("`{usage}`{gives}")).collect();
    text += &usages.join("<br>");
    text += "\n\n";
    let options = entry.options();
    let lists = |paragraph: &String| {
        let named =
            |o: &OptionEntry| !o.about.is_empty() && paragraph.contains(&format!("{} ({}", o.name, o.about));
        options.iter().any(named)
    };
    let (listing, plain): (Vec<&String>, Vec<&String>) = entry.about.iter().skip(1).partition(|p| lists(p));
    let first = entry.about.first().map_or("", String::as_str);
    text += &format!("{}\n\n", linked(first));
    plain.iter().for_each(|paragraph| text += &format!("- {}\n", linked(paragraph)));
    if entry.in_frames {
        text += "- It can be called inside `on_frame`, too.\n";
    }
    if entry.in_tests {
        text += "- It can be called only inside a test.\n";
    }
    if !options.is_empty() {
        text += "\n| option | meaning |\n|---|---|\n";
        for option in &options {
            text += &format!("| `{}` | {} |\n", option.name, cell(&linked(&option.about)));
        }
        if !listing.is_empty() {
            text += "\n<details><summary>The options in sentences</summary>\n\n";
            listing.iter().for_each(|paragraph| text += &format!("- {}\n", linked(paragraph)));
            text += "\n</details>\n";
        }
    }
    if let Some((line, seen)) = example {
        text += &example_text(*line, seen.as_ref());
    }
    text
}

fn example_text(line: Option<&str>, seen: Option<&(String, &Lesson)>) -> String {
    let mut text = String::new();
    if let Some(line) = line {
        text += &format!("\n```rhai,fragment\n{line}\n```\n");
    }
    if let Some((line, lesson)) = seen {
        let number = &lesson.number;
        text += &format!("\nIn [lesson {number}, {}](../{}):\n\n", lesson.title, lesson.page());
        text += &format!("```rust,noplayground\n{line}\n```\n");
    }
    text
}

/// A description with links where it names methods, such as Cue.then.
fn linked(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for (number, part) in text.split('`').enumerate() {
        if number > 0 {
            out.push('`');
        }
        if number % 2 == 1 {
            out.push_str(part);
            continue;
        }
        for word in part.split_inclusive([' ', ',', ';', ')', '(', ':']) {
            let name = word.trim_end_matches([' ', ',', ';', ')', '(', ':', '.']);
            match describe::entries()
                .iter()
                .any(|entry| !entry.receiver_type.is_empty() && entry.full_name() == name)
            {
                true => out.push_str(&(link(name, "") + &word[name.len()..])),
                false => out.push_str(word),
            }
        }
    }
    out
}

fn mathematics() -> String {
    let mut text = "# Mathematics\n\nFunctions of numbers take ints and floats. All functions give the same bits on every \
                    machine and can be called inside `on_frame`.\n\n| call | result |\n|---|---|\n"
        .to_string();
    for entry in describe::entries().iter().filter(|entry| is_mathematics(entry)) {
        text += &format!("| `{}` | {} |\n", cell(&entry.usages.join("`, `")), cell(&entry.about.join(" ")));
    }
    text
}

/// The index of the words of the field and of other programs.
fn words() -> String {
    let mut rows: BTreeMap<String, (&str, String)> = BTreeMap::new();
    for (terms, answer) in help::topics() {
        let calls: Vec<String> = answer.calls.iter().map(|call| call_link(&call.usage, &call.page)).collect();
        let note = answer.note.map_or_else(String::new, |note| format!("<br>{}", cell(note)));
        for term in terms {
            rows.entry(term.to_lowercase()).or_insert((term, format!("{}{note}", calls.join(", "))));
        }
    }
    let mut text = "# Words of the field\n\nWords of Blender, Unity, three.js and other programs, and the calls that do the same \
                    here. `choreo help TERM` prints the same in a terminal, with an example.\n"
        .to_string();
    let mut letter = None;
    for (key, (term, calls)) in rows {
        let first = key.chars().next().map(|c| if c.is_alphabetic() { c.to_ascii_uppercase() } else { '#' });
        if letter != first {
            letter = first;
            let heading = match first {
                Some('#') | None => "Numbers".to_string(),
                Some(c) => c.to_string(),
            };
            text += &format!("\n## {heading}\n\n| word | here |\n|---|---|\n");
        }
        text += &format!("| {} | {calls} |\n", cell(term));
    }
    text
}

/// The link to a call as `help` writes it: `Actor.reach(joint, target)`, `effect("bloom")`, `choreo render --fps`.
fn call_link(usage: &str, page: &str) -> String {
    let name = usage.split(['(', ' ']).next().unwrap_or_default();
    if name == "choreo" {
        return format!("[`{usage}`]({ROOT}/{})", page.split(',').next().unwrap_or_default());
    }
    let value = usage.split('"').nth(1);
    if let (Some(effect), "effect") = (value, name) {
        return format!("[`{usage}`]({ROOT}/plugins/effects/{effect}/README.md)");
    }
    let shown = if value.is_some() || usage.contains("#{") { usage } else { name };
    link(name, "").replacen(&format!("[`{name}`]"), &format!("[`{shown}`]"), 1)
}
