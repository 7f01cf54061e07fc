//! The answers of `choreo help TERM`: the calls for a term of the field or of another program.

use crate::api::defs;
use crate::def::Def;
use crate::suggest::distance;
use crate::synonyms::{self, answer_by_words, answer_of_topic, mathematics, normalized_term, terms};
pub use crate::synonyms::{Answer, Call, examples, words_occur_in, words_occur_in_singular_or_plural};

/// Each topic of the table of synonyms: its terms, and the answer.
pub fn topics() -> impl Iterator<Item = (&'static [&'static str], Answer)> {
    synonyms::topics(defs())
}

/// The calls for a term: those of its topic, and the entries of that name. Empty for an unknown term.
pub fn answer(term: &str) -> Answer {
    let defs = defs();
    let mut answer = answer_of_topic(term, defs);
    let wanted = term.trim_end_matches("()");
    let spelled = normalized_term(wanted);
    let named =
        defs.all.iter().filter(|(_, def)| normalized_term(def.name) == spelled || def.full_name() == wanted);
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
    let answer = answer_by_words(term, defs);
    if !answer.calls.is_empty() {
        return answer;
    }
    let entries = |matches: &dyn Fn(&Def) -> bool| -> Vec<Call> {
        let found = defs.all.iter().filter(|(_, def)| matches(def));
        found.map(|(title, def)| Call::entry(title, def)).collect()
    };
    let mut calls = entries(&|def| words_occur_in(term, &def.full_name()));
    if calls.is_empty() {
        calls = entries(&|def| words_occur_in(term, &def.about().join("\n")));
    }
    Answer { calls, ..Answer::default() }
}

/// The known terms and names whose spelling is nearest to `term`, at most `max_count`.
pub fn nearest_terms(term: &str, max_count: usize) -> Vec<&'static str> {
    let wanted = normalized_term(term);
    let defs = defs();
    let known = terms().chain(defs.iter().map(|def| def.name)).chain(defs.maths.iter().map(|f| f.0));
    let mut by_distance: Vec<(usize, &str)> =
        known.map(|known| (distance(&wanted, &normalized_term(known)), known)).collect();
    let max_distance = |known: &str| wanted.chars().count().max(known.chars().count()).div_ceil(3);
    by_distance.retain(|&(distance, known)| distance <= max_distance(known));
    by_distance.sort_unstable();
    by_distance.dedup();
    by_distance.into_iter().take(max_count).map(|(_, known)| known).collect()
}
