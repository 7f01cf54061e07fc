//! Calls in a script and their entries in the reference, for documentation.

use crate::source::{Source, is_word};
use crate::values::{Budget, Modules, Types};
use choreo_script::describe::{self, Entry};
use std::path::PathBuf;
use std::sync::Arc;

/// Import resolver for a script that is read alone: finds no module.
pub(crate) struct NoModules;

impl Modules for NoModules {
    fn module(&self, _: &str) -> Option<Arc<Source>> {
        None
    }

    fn path(&self, _: &str) -> Option<PathBuf> {
        None
    }
}

/// API calls in a text, in order: the byte where the name begins, and the entry. Methods of values whose type is known only at run time are
/// left out.
pub fn calls(text: &str) -> Vec<(usize, &'static Entry)> {
    let source = Source::new(text);
    let entry_at = |index: usize| {
        if !is_word(source.get(index)) || source.get(index + 1) != "(" {
            return None;
        }
        let receiver_type = match source.token_before(index, 1) {
            "." | "?." => {
                let budget = Budget::default();
                let value = Types::new(&source, &NoModules, &budget).value_ending_at(index - 1);
                Some(value.kind).filter(|kind| !kind.is_empty())?
            }
            "fn" | "::" => return None,
            _ => String::new(),
        };
        Some((source.tokens[index].start, describe::entry(&receiver_type, source.get(index))?))
    };
    (0..source.tokens.len()).filter_map(entry_at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn method_calls_are_found_with_the_type_of_their_receiver() {
        let text = "let hero = load(\"choreo:mannequin\");\n\
                    let anna = cast(\"anna\", hero); // anna.turn(1)\n\
                    anna.play(hero.clip(\"Walk\")).until(2.0);\n\
                    camera(\"wide\").at(0, 1, 2);\n\
                    fn put(x) { x.at(1, 2, 3) } put(anna);\n\
                    fn uncalled(y) { y.at(1, 2, 3) }";
        let found = calls(text);
        let names: Vec<String> = found.iter().map(|(_, entry)| entry.full_name()).collect();
        let expected =
            ["load", "cast", "Actor.play", "Asset.clip", "Cue.until", "camera", "Camera.at", "Actor.at"]
                .map(String::from);
        assert_eq!(names, expected);
        assert!(found.iter().all(|(at, entry)| text[*at..].starts_with(entry.name)));
    }
}
