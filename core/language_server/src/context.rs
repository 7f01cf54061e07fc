//! Context of the cursor: the call, argument and option that it is in.

use crate::source::{Source, is_string, is_word};
use crate::values::{ScriptValue, Types, is_keyword};
use choreo_script::describe::{self, Entry};
use choreo_script::is_opening_bracket;

/// A call around the cursor.
#[derive(Clone, Debug)]
pub(crate) struct CallSite {
    /// Token of the function name.
    pub name: usize,
    /// Token of the opening parenthesis.
    pub open: usize,
    /// Index of the argument that contains the cursor, from 0.
    pub argument: usize,
    /// Object maps between the call and the cursor, outermost first: opening bracket, and key of the entry that contains the cursor.
    pub maps: Vec<(usize, Option<String>)>,
    /// Whether the cursor is in a list inside the call or the innermost map.
    pub in_list: bool,
    /// Whether the cursor is at the key of an entry of the innermost map.
    pub at_key: bool,
    /// Receiver of a method.
    pub receiver: Option<ScriptValue>,
}

impl CallSite {
    /// API entry of the call, if it is known. If the type of the receiver is unknown, the method of any type.
    pub(crate) fn entry(&self, source: &Source) -> Option<&'static Entry> {
        let name = source.get(self.name);
        match &self.receiver {
            None => describe::entry("", name),
            Some(value) if value.kind.is_empty() => {
                describe::entries().iter().find(|entry| !entry.receiver_type.is_empty() && entry.name == name)
            }
            Some(value) => describe::entry(&value.kind, name),
        }
    }

    /// Name of the argument. If the call has several forms, the form with the same number of arguments counts, else the longest.
    pub(crate) fn argument_name(&self, source: &Source) -> Option<&'static str> {
        let entry = self.entry(source)?;
        let count = source.arguments(self.open).len();
        let given = source.arguments(self.open).into_iter().nth(self.argument);
        let is_text = given.is_some_and(|given| given.len() == 1 && is_string(source.get(given.start)));
        let takes = |form: &&&Vec<&str>| {
            let argument = form.get(self.argument);
            argument.is_some_and(|argument| {
                !is_text || !matches!(*argument, "keys" | "options" | "x" | "y" | "width")
            })
        };
        let forms = || entry.forms.iter().filter(|form| takes(&form));
        let form = forms().find(|form| form.len() == count).or_else(|| forms().next())?;
        form.get(self.argument).copied()
    }

    /// Text of the first argument, as in `.key("morph", "smile", …)`.
    pub(crate) fn first_argument_text(&self, source: &Source) -> Option<String> {
        let first = source.arguments(self.open).into_iter().next()?;
        source.string_value(first.start)
    }
}

/// The call around a byte; `None` outside of calls and in the blocks of closures.
pub(crate) fn call_around(types: Types, byte: usize) -> Option<CallSite> {
    let source = types.source;
    let mut maps: Vec<(usize, Option<String>)> = Vec::new();
    let (mut in_list, mut at_key, mut commas) = (false, false, 0);
    let mut key: Option<String> = None;
    let mut index = source.count_tokens_before(byte);
    // A string or word that touches the cursor is the one being typed.
    if index > 0
        && source.tokens[index - 1].end >= byte
        && (is_word(source.get(index - 1)) || is_string(source.get(index - 1)))
    {
        index -= 1;
    }
    while index > 0 {
        index -= 1;
        match source.get(index) {
            ")" | "]" | "}" => index = source.matching_bracket(index)?,
            ";" | "let" | "fn" | "const" | "import" | "{" => return None,
            "," => commas += 1,
            ":" if commas == 0 && key.is_none() => {
                key = index
                    .checked_sub(1)
                    .map(|name| source.string_value(name).unwrap_or_else(|| source.get(name).to_string()));
            }
            "[" => {
                in_list |= maps.is_empty();
                (commas, key) = (0, None);
            }
            "#{" => {
                at_key |= maps.is_empty() && key.is_none() && !in_list;
                maps.insert(0, (index, key.take()));
                commas = 0;
            }
            "(" => {
                let name = index.checked_sub(1).filter(|name| {
                    is_word(source.get(*name)) && !is_keyword_before_parenthesis(source, *name)
                });
                let Some(name) = name else {
                    (commas, key) = (0, None);
                    continue;
                };
                let receiver = matches!(source.token_before(name, 1), "." | "?.")
                    .then(|| types.value_ending_at(name - 1));
                return Some(CallSite {
                    name,
                    open: index,
                    argument: commas,
                    maps,
                    in_list,
                    at_key,
                    receiver,
                });
            }
            _ => {}
        }
    }
    None
}

/// Whether a parenthesis follows a keyword, as in `if (`, so that it is not a call. After a dot, keywords are method names.
fn is_keyword_before_parenthesis(source: &Source, name: usize) -> bool {
    is_keyword(source.get(name)) && !matches!(source.token_before(name, 1), "." | "?.")
}

/// Keys that an object map already has, except for the one at the cursor.
pub(crate) fn present_keys(source: &Source, open: usize, byte: usize) -> Vec<String> {
    let end = source.matching_bracket(open).unwrap_or(source.tokens.len());
    let mut keys = Vec::new();
    let mut index = open + 1;
    while index < end {
        let token = &source.tokens[index];
        if source.get(index + 1) == ":" && !(token.start..=token.end).contains(&byte) {
            keys.push(source.string_value(index).unwrap_or_else(|| source.get(index).to_string()));
        }
        if source.get(index) == ";" {
            break;
        }
        index = if is_opening_bracket(source.get(index)) {
            source.matching_bracket(index).unwrap_or(end)
        } else {
            index
        } + 1;
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calls::NoModules;
    use crate::values::Budget;

    /// Name of the call, argument, keys of the maps, whether at a key, for a cursor written as `¦`.
    fn site_at_cursor(text: &str) -> Option<(String, usize, Vec<Option<String>>, bool)> {
        let byte = text.find('¦').unwrap();
        let source = Source::new(&text.replacen('¦', "", 1));
        let site = call_around(Types::new(&source, &NoModules, &Budget::default()), byte)?;
        let keys = site.maps.iter().map(|(_, key)| key.clone()).collect();
        Some((source.get(site.name).to_string(), site.argument, keys, site.at_key))
    }

    fn expected_site(
        name: &str,
        argument: usize,
        keys: &[Option<&str>],
        at_key: bool,
    ) -> Option<(String, usize, Vec<Option<String>>, bool)> {
        Some((name.to_string(), argument, keys.iter().map(|k| k.map(str::to_string)).collect(), at_key))
    }

    #[test]
    fn the_call_argument_and_option_at_the_cursor_are_found() {
        assert_eq!(site_at_cursor("load(\"kn¦"), expected_site("load", 0, &[], false));
        assert_eq!(site_at_cursor("cast(\"a\", ¦)"), expected_site("cast", 1, &[], false));
        assert_eq!(site_at_cursor("h.play(c, #{ ¦ })"), expected_site("play", 1, &[None], true));
        assert_eq!(site_at_cursor("h.play(c, #{ fade: 0.3, re¦ })"), expected_site("play", 1, &[None], true));
        assert_eq!(
            site_at_cursor("h.play(c, #{ repeat: \"l¦\" })"),
            expected_site("play", 1, &[Some("repeat")], false)
        );
        assert_eq!(
            site_at_cursor("stage(#{ background: #{ to¦ } })"),
            expected_site("stage", 0, &[Some("background"), None], true)
        );
        assert_eq!(site_at_cursor("h.key(\"rotation\", [[0, ¦]])"), expected_site("key", 1, &[], false));
        assert_eq!(site_at_cursor("f(1, (2 + ¦))"), expected_site("f", 1, &[], false));
    }

    #[test]
    fn statements_and_blocks_are_not_call_arguments() {
        assert_eq!(site_at_cursor("load(\"a\"); ¦"), None);
        assert_eq!(site_at_cursor("on_frame(|t| { ¦ })"), None);
        assert_eq!(site_at_cursor("cast(\"a\", \nlet x = ¦"), None);
        assert_eq!(site_at_cursor("a.at(1, 2).¦"), None);
    }
}
