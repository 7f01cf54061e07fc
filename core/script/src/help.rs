//! The answers of `choreo help TERM`: the calls for a term of the field or of another program.

use crate::api::defs;
use crate::def::Def;
use crate::suggest::distance;
use crate::synonyms::{self, letters, mathematics, of_topic, of_words, terms};
pub use crate::synonyms::{Answer, Call, examples, is_about, is_in};

/// Each topic of the table of synonyms: its terms, and the answer.
pub fn topics() -> impl Iterator<Item = (&'static [&'static str], Answer)> {
    synonyms::topics(defs())
}

/// The calls for a term: those of its topic, and the entries of that name. Empty for an unknown term.
pub fn answer(term: &str) -> Answer {
    let defs = defs();
    let mut answer = of_topic(term, defs);
    let wanted = term.trim_end_matches("()");
    let spelled = letters(wanted);
    let named = defs.all.iter().filter(|(_, def)| letters(def.name) == spelled || def.full_name() == wanted);
    let calls = named.map(|(title, def)| Call::whole_entry(title, def)).chain(mathematics(wanted, defs));
    for call in calls {
        match answer.calls.iter_mut().find(|known| known.usage == call.usage) {
            Some(known) => *known = call,
            None => answer.calls.push(call),
        }
    }
    answer
}

/// Searches for all words of a term in any order: a topic by its terms, else entries by their names, else entries by their
/// descriptions.
pub fn search(term: &str) -> Answer {
    let defs = defs();
    let answer = of_words(term, defs);
    if !answer.calls.is_empty() {
        return answer;
    }
    let entries = |is_it: &dyn Fn(&Def) -> bool| -> Vec<Call> {
        let found = defs.all.iter().filter(|(_, def)| is_it(def));
        found.map(|(title, def)| Call::entry(title, def)).collect()
    };
    let mut calls = entries(&|def| is_in(term, &def.full_name()));
    if calls.is_empty() {
        calls = entries(&|def| is_in(term, &def.about().join("\n")));
    }
    Answer { calls, ..Answer::default() }
}

/// The known terms and names that are spelled most like `term`, at most `most` of them.
pub fn nearest(term: &str, most: usize) -> Vec<&'static str> {
    let wanted = letters(term);
    let defs = defs();
    let known = terms().chain(defs.iter().map(|def| def.name)).chain(defs.maths.iter().map(|f| f.0));
    let mut near: Vec<(usize, &str)> =
        known.map(|known| (distance(&wanted, &letters(known)), known)).collect();
    near.retain(|(far, known)| *far <= wanted.chars().count().max(known.chars().count()).div_ceil(3));
    near.sort_unstable();
    near.dedup();
    near.into_iter().take(most).map(|(_, known)| known).collect()
}
