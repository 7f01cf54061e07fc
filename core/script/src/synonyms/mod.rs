//! Synonyms: terms of the field and of other programs, with the calls that do the same here.
//!
//! `topics.txt` is the table. Errors about unknown names take their suggestions from it, and `choreo help TERM` prints its entry.

use crate::def::{Def, Defs};
use crate::value::HandleKind;
use std::sync::LazyLock;

/// Other names that scripts may use, with the real names: `NAME` of a function, or `FUNCTION: OPTION`.
pub(crate) const ALIASES: &[(&str, &str)] = &[
    ("expect_picture", "expect_image"),
    ("title", "text"),
    ("stage: duration", "stage: length"),
    ("stage: frame_rate", "stage: fps"),
    ("stage: resolution", "stage: size"),
];

/// Synonyms of effect parameters, options and allowed values, with the names used here. A pair applies to calls that have the
/// name.
const PARAMETER_SYNONYMS: &[(&str, &str)] = &[
    ("cone", "outer"),
    ("coneangle", "outer"),
    ("spotangle", "outer"),
    ("angle", "outer"),
    ("cube", "box"),
    ("ball", "sphere"),
    ("aperture", "f_number"),
    ("fstop", "f_number"),
    ("bokeh", "f_number"),
    ("intensity", "strength"),
    ("amount", "strength"),
    ("opacity", "strength"),
    ("focusdistance", "focus"),
];

/// A topic: one paragraph of `topics.txt`.
struct Topic {
    terms: Vec<&'static str>,
    calls: Vec<CallText>,
    example: &'static str,
    note: Option<&'static str>,
}

/// A call that answers a topic: the text of a `call:` line of `topics.txt`.
#[derive(Clone, Copy)]
struct CallText {
    text: &'static str,
}

static TOPICS: LazyLock<Vec<Topic>> = LazyLock::new(|| {
    let rows = include_str!("topics.txt").lines().filter(|line| !line.starts_with('#'));
    let rows: Vec<&str> = rows.collect();
    rows.split(|line| line.is_empty()).filter(|rows| !rows.is_empty()).map(Topic::from_rows).collect()
});

impl Topic {
    /// The topic of a paragraph.
    fn from_rows(rows: &[&'static str]) -> Topic {
        let all = |key| rows.iter().filter_map(move |row| row.split_once(": ").filter(|(k, _)| *k == key));
        Topic {
            terms: all("terms").flat_map(|(_, terms)| terms.split(", ")).collect(),
            calls: all("call").map(|(_, text)| CallText { text }).collect(),
            example: all("example").next().map_or("", |(_, text)| text),
            note: all("note").next().map(|(_, text)| text),
        }
    }
}

impl CallText {
    /// Full name of the function: `Actor.reach`, `effect`.
    fn name(self) -> &'static str {
        self.text.split(['(', ':']).next().unwrap_or(self.text)
    }

    /// The option of `FUNCTION: OPTION`.
    fn option(self) -> Option<&'static str> {
        self.text.split_once(": ").map(|(_, option)| option)
    }

    /// The value of `METHOD("value")`.
    fn value(self) -> Option<&'static str> {
        self.text.split('"').nth(1)
    }

    fn is_command(self) -> bool {
        self.text.starts_with("choreo ")
    }

    /// The entry of the reference with its heading.
    fn entry(self, defs: &Defs) -> Option<(&'static str, &'static Def)> {
        defs.all.iter().copied().find(|(_, def)| def.full_name() == self.name())
    }
}

/// A term reduced to lower-case letters and digits, so that "look at", "look_at" and "lookAt" are equal.
pub(crate) fn normalized_term(term: &str) -> String {
    let plain = |c: char| if c == 'é' { 'e' } else { c };
    term.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).map(plain).collect()
}

/// The words of a text: "Clip.in_step" has clip, in and step.
fn words(text: &str) -> impl Iterator<Item = String> {
    let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(|word| word.chars().flat_map(char::to_lowercase).collect())
}

/// Whether a text has all words of a term, in any order. Only whole words count.
pub fn words_occur_in(term: &str, text: &str) -> bool {
    let all: Vec<String> = words(text).collect();
    let mut wanted = words(term).peekable();
    wanted.peek().is_some() && wanted.all(|word| all.contains(&word))
}

/// Whether a text has all words of a term, as [`words_occur_in`], each in the singular or the plural.
pub fn words_occur_in_singular_or_plural(term: &str, text: &str) -> bool {
    let all: Vec<String> = words(text).map(singular).collect();
    let mut wanted = words(term).map(singular).peekable();
    wanted.peek().is_some() && wanted.all(|word| all.contains(&word))
}

/// A word without a plural ending. Singular and plural give the same stem, which is not always a word.
fn singular(word: String) -> String {
    let stem = ["sses", "xes", "ches", "shes"].iter().find(|ending| word.ends_with(*ending));
    match stem {
        Some(_) => word[..word.len() - 2].to_string(),
        None if word.len() > 3 && word.ends_with('s') && !word.ends_with("ss") => {
            word[..word.len() - 1].into()
        }
        None => word,
    }
}

/// The topic that has a term.
fn topic(term: &str) -> Option<&'static Topic> {
    let wanted = normalized_term(term);
    TOPICS.iter().find(|topic| topic.terms.iter().any(|known| normalized_term(known) == wanted))
}

/// The function or option to use in place of an unknown name.
pub(crate) struct Suggestion {
    /// The name for the message: `reach` if the unknown name was a method of an actor, else `Actor.reach`.
    pub name: String,
    /// The description with its page, or empty.
    pub hint: String,
}

/// The function or method to use in place of the unknown `name`, called on a value of this kind.
pub(crate) fn suggest_function(defs: &Defs, name: &str, on: HandleKind) -> Option<Suggestion> {
    let topic = topic(name)?;
    let callable = |target: &CallText| target.entry(defs).filter(|_| target.option().is_none());
    let on_same_type =
        topic.calls.iter().find(|target| callable(target).is_some_and(|(_, def)| def.on == on));
    let target = on_same_type.or(topic.calls.first())?;
    let is_short = on_same_type.is_some() && target.value().is_none();
    let name = if is_short { target.entry(defs)?.1.name } else { target.text };
    Some(Suggestion { name: name.to_string(), hint: topic.hint(*target, defs) })
}

/// The option to use in place of the unknown option `name` of a function, else the call that does the same. `known`: the options
/// of the function.
pub(crate) fn suggest_option(defs: &Defs, name: &str, function: &str, known: &[&str]) -> Option<Suggestion> {
    if let Some(name) = suggest_parameter(name, known) {
        return Some(Suggestion { name: name.to_string(), hint: String::new() });
    }
    let topic = topic(name)?;
    let is_of_function = |target: &&CallText| target.entry(defs).is_some_and(|(_, def)| def.name == function);
    let options = || topic.calls.iter().filter(|target| target.option().is_some_and(|o| known.contains(&o)));
    if let Some(target) = options().find(is_of_function) {
        let option = target.option().unwrap_or_default();
        return Some(Suggestion { name: option.to_string(), hint: topic.hint(*target, defs) });
    }
    // The suggested option belongs to another call. If this call has an option of that name, its own description is used.
    if let Some((target, option)) = options().find_map(|target| Some((target, target.option()?))) {
        let own = option_hint(defs, function, option);
        let hint = own.unwrap_or_else(|| topic.hint(*target, defs));
        return Some(Suggestion { name: option.to_string(), hint });
    }
    // No other call sets parameters of effects, so none is suggested for `effect`.
    let target = *topic.calls.first().filter(|_| function != "effect")?;
    let name = match target.option() {
        Some(_) => Call::of(target, defs).usage,
        None => target.text.to_string(),
    };
    Some(Suggestion { name, hint: topic.hint(target, defs) })
}

/// Description of an option of a call in the reference, with its page. `None` if the call does not describe it.
fn option_hint(defs: &Defs, function: &str, option: &str) -> Option<String> {
    let own = defs.all.iter().filter(|(_, def)| def.name == function);
    let mut found = own.filter_map(|(title, def)| Some((title, def, in_parentheses(&def.about(), option)?)));
    let (title, def, about) = found.next()?;
    let usage = format!("{}(#{{ {option} }})", def.full_name());
    Some(format!("{usage}: {}. See {}", first_sentence(&about), page(title)))
}

/// The first sentence of a description, without its full stop.
fn first_sentence(about: &str) -> &str {
    about.split_once(". ").map_or(about, |(first, _)| first).trim_end_matches('.')
}

/// The parameter of an effect that replaces the unknown `name`: `f_number` for `aperture`.
fn suggest_parameter<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let spelled = normalized_term(name);
    let (_, parameter) =
        PARAMETER_SYNONYMS.iter().find(|(word, name)| *word == spelled && known.contains(name))?;
    known.iter().copied().find(|known| known == parameter)
}

/// The known value that replaces the unknown text `given`: `bloom` for `glow`, `position` for `location`.
pub(crate) fn suggest_value<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let known: Vec<&str> = known.into_iter().collect();
    let is_value = |known: &&str| {
        topic(given).is_some_and(|topic| topic.calls.iter().any(|target| target.value() == Some(known)))
    };
    // The terms of a topic are synonyms. If several known values are terms of the topic, as kinds of shapes are, the choice is
    // ambiguous, and none is suggested.
    let terms = topic(given).map_or(&[][..], |topic| &topic.terms);
    let in_topic: Vec<&str> = known.iter().copied().filter(|known| terms.contains(known)).collect();
    let only = in_topic.first().copied().filter(|_| in_topic.len() == 1);
    suggest_parameter(given, &known).or_else(|| known.iter().copied().find(is_value)).or(only)
}

impl Topic {
    fn answer(&self, defs: &Defs) -> Answer {
        let calls = self.calls.iter().map(|target| Call::of(*target, defs)).collect();
        Answer { calls, example: Some(self.example), note: self.note }
    }

    /// Hint that describes a call of the topic, with its page.
    fn hint(&self, target: CallText, defs: &Defs) -> String {
        let Call { usage, about, page, .. } = Call::of(target, defs);
        let about = about.unwrap_or_default();
        let sentence = first_sentence(&about);
        let note = self.note.map(|note| format!(" {note}")).unwrap_or_default();
        format!("{usage}: {sentence}.{note} See {page}")
    }
}

/// The answer that `choreo help TERM` prints.
#[derive(Debug, Default)]
pub struct Answer {
    pub calls: Vec<Call>,
    pub example: Option<&'static str>,
    pub note: Option<&'static str>,
}

/// One call that answers a term.
#[derive(Debug, PartialEq)]
pub struct Call {
    /// The usage: `Actor.reach(joint, target, options?)`, or a command such as `choreo render --fps`.
    pub usage: String,
    /// The description; `None` for a command, whose `--help` describes it.
    pub about: Option<String>,
    /// The other paragraphs of the description, with the options; empty unless the term is the name of the call.
    pub details: Vec<String>,
    /// The page with the description: a file, with the heading if the file has several headings.
    pub page: String,
}

impl Call {
    fn of(target: CallText, defs: &Defs) -> Call {
        match target.entry(defs) {
            Some((title, def)) => {
                let described = target.option().and_then(|option| describe_option(def, option));
                let usage = match (target.option(), target.value()) {
                    (Some(option), _) => format!("{}(#{{ {option} }})", def.full_name()),
                    (None, Some(_)) => target.text.to_string(),
                    (None, None) => def.full_usage(),
                };
                let about = Some(described.unwrap_or_else(|| first_paragraph(def)));
                Call { usage, about, details: Vec::new(), page: page(title) }
            }
            None if target.is_command() => {
                let page = match target.text.split(' ').nth(1) {
                    Some("view") => "core/viewer/README.md",
                    Some("test") => "core/test_runner/README.md",
                    Some("new" | "plugins") => "plugins/README.md",
                    _ => "core/cli/README.md",
                };
                Call {
                    usage: target.text.to_string(),
                    about: None,
                    details: Vec::new(),
                    page: page.to_string(),
                }
            }
            None => mathematics(target.name(), defs).unwrap_or_else(|| Call {
                usage: target.text.to_string(),
                about: None,
                details: Vec::new(),
                page: page("Conventions"),
            }),
        }
    }

    pub(crate) fn entry(title: &str, def: &Def) -> Call {
        Call {
            usage: def.full_usage(),
            about: Some(first_paragraph(def)),
            details: Vec::new(),
            page: page(title),
        }
    }

    /// The entry with its full description.
    pub(crate) fn whole_entry(title: &str, def: &Def) -> Call {
        Call { details: def.about().split_off(1), ..Call::entry(title, def) }
    }
}

/// The entry of a mathematical function.
pub(crate) fn mathematics(name: &str, defs: &Defs) -> Option<Call> {
    let (name, args, about) = defs.maths.iter().find(|(known, ..)| *known == name)?;
    let usage = format!("{name}({args})");
    Some(Call { usage, about: Some((*about).to_string()), details: Vec::new(), page: page("Mathematics") })
}

/// The page of a heading in the reference.
fn page(title: &str) -> String {
    format!("core/script/API.md, \"{title}\"")
}

/// The first paragraph of a description, which states what the function does.
fn first_paragraph(def: &Def) -> String {
    def.about().swap_remove(0)
}

/// The text about an option in the reference: its name with the parentheses after it, or the paragraph that names it.
fn describe_option(def: &Def, option: &str) -> Option<String> {
    let about = def.about();
    in_parentheses(&about, option).or_else(|| about.into_iter().find(|item| item.contains(option)))
}

/// The name of an option with the parentheses that follow it in a description.
fn in_parentheses(about: &[String], option: &str) -> Option<String> {
    let with_range = format!("{option} (");
    let whole = |item: &str, at: &usize| !item[..*at].ends_with(char::is_alphanumeric);
    let (item, at) = about.iter().find_map(|item| {
        let mut places = item.match_indices(&with_range).map(|(at, _)| at);
        Some((item, places.find(|at| whole(item, at))?))
    })?;
    let text = &item[at..];
    let mut depth = 0;
    let end = text.find(|c| {
        depth += i32::from(c == '(') - i32::from(c == ')');
        c == ')' && depth == 0
    })?;
    Some(format!("Option {}.", &text[..=end]))
}

/// The answer for a term. A call whose value is the term comes first: `effect("fog")` for fog.
pub(crate) fn answer_of_topic(term: &str, defs: &Defs) -> Answer {
    let spelled = normalized_term(term);
    let mut answer = topic(term).map_or_else(Answer::default, |topic| topic.answer(defs));
    answer.calls.sort_by_key(|call| {
        call.usage.split('"').nth(1).is_none_or(|value| normalized_term(value) != spelled)
    });
    answer
}

/// The answer of the topic whose terms contain all words of `term`, in any order. Among several topics, one with a single term
/// that contains all words is preferred, then the one with the fewest terms.
pub(crate) fn answer_by_words(term: &str, defs: &Defs) -> Answer {
    let has_single_term = |topic: &Topic| topic.terms.iter().any(|known| words_occur_in(term, known));
    let found = TOPICS.iter().filter(|topic| words_occur_in(term, &topic.terms.join(" ")));
    let found = found.min_by_key(|topic| (!has_single_term(topic), topic.terms.len()));
    found.map_or_else(Answer::default, |topic| topic.answer(defs))
}

/// Each topic of the table: its terms, and the answer.
pub(crate) fn topics(defs: &Defs) -> impl Iterator<Item = (&'static [&'static str], Answer)> {
    TOPICS.iter().map(|topic| (topic.terms.as_slice(), topic.answer(defs)))
}

/// The topics' terms.
pub(crate) fn terms() -> impl Iterator<Item = &'static str> {
    TOPICS.iter().flat_map(|topic| topic.terms.iter().copied())
}

/// The example of each topic: a line of a script, or a command.
pub fn examples() -> impl Iterator<Item = &'static str> {
    TOPICS.iter().map(|topic| topic.example)
}

#[cfg(test)]
mod tests;
