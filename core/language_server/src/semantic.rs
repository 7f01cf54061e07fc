//! Semantic tokens: the meaning of words and strings, for syntax coloring.

use crate::context::call_around;
use crate::names::{self, Names};
use crate::source::{InnerWord, is_string, is_word};
use crate::values::{Declaration, Declared, Types, is_keyword};
use crate::view::View;
use choreo_script::{comments, describe};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::Range;

/// Standard types of the protocol, in the order of the legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TokenKind {
    /// Files and modules.
    Namespace,
    /// Actors.
    Class,
    /// Clips.
    Event,
    /// Allowed values, and names in files: joints, materials, parameters of effects.
    EnumMember,
    /// Options.
    Property,
    Method,
    Function,
    Variable,
    Parameter,
    Keyword,
    String,
    /// Numbers, and functions that convert units: `cm(2)`.
    Number,
    Comment,
}

const KINDS: [&str; 13] = [
    "namespace",
    "class",
    "event",
    "enumMember",
    "property",
    "method",
    "function",
    "variable",
    "parameter",
    "keyword",
    "string",
    "number",
    "comment",
];
const MODIFIERS: [&str; 2] = ["declaration", "defaultLibrary"];
const DECLARATION: u32 = 1;
const DEFAULT_LIBRARY: u32 = 2;

/// Functions that convert units to seconds or metres.
const UNITS: [&str; 3] = ["f", "cm", "mm"];

/// Largest number of tokens in a list whose strings are examined: each string is looked up by its call, which takes long in long lists.
const LONGEST_LIST: usize = 1000;

pub fn legend() -> Value {
    json!({ "tokenTypes": KINDS, "tokenModifiers": MODIFIERS })
}

/// Semantic tokens of a range, or of the whole document, in the encoding of the protocol.
pub fn tokens(view: &View, range: Option<&Value>) -> Value {
    let source = view.source;
    let bytes = match range {
        Some(range) => source.lines.bytes(&source.text, range),
        None => 0..source.text.len(),
    };
    let meaning = Meaning::new(view);
    let mut encoded = Encoded { view, last: (0, 0), data: Vec::new() };
    let first = source.tokens.partition_point(|token| token.end <= bytes.start);
    let mut behind = first.checked_sub(1).map_or(0, |before| source.tokens[before].end);
    for index in first..source.tokens.len() {
        let token = source.tokens[index].clone();
        if behind >= bytes.end {
            break;
        }
        for comment in comments(&source.text, behind..token.start) {
            encoded.push(comment.range, TokenKind::Comment, 0);
        }
        if token.start < bytes.end {
            meaning.push(index, &mut encoded);
        }
        behind = token.end;
    }
    for comment in comments(&source.text, behind.min(source.text.len())..source.text.len()) {
        if comment.range.start < bytes.end {
            encoded.push(comment.range, TokenKind::Comment, 0);
        }
    }
    json!({ "data": encoded.data })
}

/// Encoded tokens: five numbers each, relative to the previous token.
struct Encoded<'v> {
    view: &'v View<'v>,
    last: (usize, usize),
    data: Vec<u32>,
}

impl Encoded<'_> {
    /// Adds a token; a token of several lines is split into one per line.
    fn push(&mut self, bytes: Range<usize>, kind: TokenKind, modifiers: u32) {
        let (text, lines) = (&self.view.source.text, &self.view.source.lines);
        let mut start = bytes.start;
        for part in text[bytes].split_inclusive('\n') {
            let visible = part.trim_end_matches(['\n', '\r']);
            let (line, column) = lines.place(text, start);
            let length: usize = visible.chars().map(char::len_utf16).sum();
            start += part.len();
            if length == 0 {
                continue;
            }
            let column_before = if line == self.last.0 { self.last.1 } else { 0 };
            let numbers =
                [line - self.last.0, column - column_before, length, kind as usize, modifiers as usize];
            self.data.extend(numbers.map(|number| number as u32));
            self.last = (line, column);
        }
    }
}

/// Meaning of tokens. Declarations are collected once, since there can be many.
struct Meaning<'v> {
    view: &'v View<'v>,
    types: Types<'v>,
    declarations: BTreeMap<&'v str, Vec<Declaration>>,
    /// Kinds of declared names, by token.
    kinds: BTreeMap<usize, TokenKind>,
}

impl<'v> Meaning<'v> {
    fn new(view: &'v View<'v>) -> Meaning<'v> {
        let types = view.types();
        let mut declarations: BTreeMap<&str, Vec<Declaration>> = BTreeMap::new();
        let mut kinds = BTreeMap::new();
        for token in 0..view.source.tokens.len() {
            let Some(declaration) = types.declares(token) else { continue };
            let kind = match declaration.kind {
                Declared::Function => TokenKind::Function,
                Declared::Module => TokenKind::Namespace,
                Declared::Parameter(_) | Declared::ClosureParameter(_) => TokenKind::Parameter,
                Declared::Variable | Declared::Loop => TokenKind::Variable,
            };
            let value =
                if kind == TokenKind::Function { String::new() } else { types.declared(&declaration).kind };
            let kind = match value.as_str() {
                "Actor" => TokenKind::Class,
                "Clip" => TokenKind::Event,
                _ => kind,
            };
            kinds.insert(token, kind);
            declarations.entry(view.source.get(token)).or_default().push(declaration);
        }
        Meaning { view, types, declarations, kinds }
    }

    /// Adds a token with its meaning; for an interpolated string, its text and the words and numbers of its code.
    fn push(&self, token: usize, encoded: &mut Encoded) {
        let (source, range) = (self.view.source, self.view.source.tokens[token].clone());
        let inner = source.inner_code(token);
        let Some((kind, modifiers)) = self.of(token) else { return };
        let mut behind = range.start;
        for code in inner {
            encoded.push(behind..code.range.start, kind, modifiers);
            for (at, own) in code.tokens.iter().enumerate() {
                let word = InnerWord::new(source, code, at);
                let meaning = match word.text {
                    text if is_word(text) => Some(self.of_inner_word(&word)),
                    text if is_string(text) => Some((TokenKind::String, 0)),
                    text => of_number(text),
                };
                if let Some((kind, modifiers)) = meaning {
                    encoded.push(own.clone(), kind, modifiers);
                }
            }
            behind = code.range.end;
        }
        encoded.push(behind..range.end, kind, modifiers);
    }

    fn of(&self, token: usize) -> Option<(TokenKind, u32)> {
        let text = self.view.source.get(token);
        if is_string(text) {
            return Some((self.kind_of_string(token), 0));
        }
        if is_word(text) {
            return Some(self.of_word(token));
        }
        of_number(text)
    }

    fn of_word(&self, token: usize) -> (TokenKind, u32) {
        let source = self.view.source;
        let (word, before, next) = (source.get(token), source.before(token, 1), source.get(token + 1));
        let in_place = of_place(word, before, next);
        let declared = || self.kinds.get(&token).map(|kind| (*kind, DECLARATION));
        in_place.or_else(declared).unwrap_or_else(|| self.of_name(word, next, token))
    }

    fn of_inner_word(&self, word: &InnerWord) -> (TokenKind, u32) {
        let in_place = of_place(word.text, word.before[0], word.next);
        in_place.unwrap_or_else(|| self.of_name(word.text, word.next, word.string))
    }

    /// Meaning of a name that is declared before a token, or belongs to the API.
    fn of_name(&self, word: &str, next: &str, token: usize) -> (TokenKind, u32) {
        let declared = self.declarations.get(word).map_or(&[][..], Vec::as_slice);
        let before = declared.partition_point(|declaration| declaration.token < token);
        let seen = self.types.first_visible(declared[..before].iter().rev().cloned(), token);
        // Functions are visible everywhere in a script.
        let seen = seen.or_else(|| declared.iter().find(|d| d.kind == Declared::Function).cloned());
        if let Some(kind) = seen.and_then(|declaration| self.kinds.get(&declaration.token)) {
            return (*kind, 0);
        }
        match describe::entry("", word) {
            Some(_) if UNITS.contains(&word) && next == "(" => (TokenKind::Number, DEFAULT_LIBRARY),
            Some(entry) if entry.is_constant => (TokenKind::Variable, DEFAULT_LIBRARY),
            Some(_) if next == "(" => (TokenKind::Function, DEFAULT_LIBRARY),
            _ if next == "(" => (TokenKind::Function, 0),
            _ => (TokenKind::Variable, 0),
        }
    }

    fn kind_of_string(&self, token: usize) -> TokenKind {
        let source = self.view.source;
        if source.get(token + 1) == ":" {
            return TokenKind::Property;
        }
        if source.before(token, 1) == "import" {
            return TokenKind::Namespace;
        }
        if source.parent(token).is_none_or(|open| token - open > LONGEST_LIST) {
            return TokenKind::String;
        }
        let Some(site) = call_around(self.types, source.tokens[token].start + 1) else {
            return TokenKind::String;
        };
        let names_actor = source.get(site.name) == "cast" && site.on.is_none() && site.argument == 0;
        match names::names(source, &site) {
            _ if names_actor => TokenKind::Class,
            Some(Names::Models | Names::Images | Names::Panoramas | Names::Scripts | Names::Fonts) => {
                TokenKind::Namespace
            }
            Some(Names::Clips) => TokenKind::Event,
            Some(Names::Actors) => TokenKind::Class,
            Some(Names::Colors | Names::Cameras | Names::Markers | Names::ClipMarkers) => TokenKind::String,
            Some(_) => TokenKind::EnumMember,
            None if self.is_allowed_value(token) => TokenKind::EnumMember,
            None => TokenKind::String,
        }
    }

    /// Whether the string is one of the allowed values of the argument or option around it.
    fn is_allowed_value(&self, token: usize) -> bool {
        let source = self.view.source;
        let Some(site) = call_around(self.types, source.tokens[token].start + 1) else { return false };
        let Some((text, entry)) = source.string(token).zip(site.entry(source)) else { return false };
        let key = site.maps.last().and_then(|(_, key)| key.clone());
        let argument = key.as_deref().or_else(|| site.argument_name(source)).unwrap_or_default();
        entry.values(argument).contains(&text)
    }
}

/// Meaning of a word, determined by its neighbors alone.
fn of_place(word: &str, before: &str, next: &str) -> Option<(TokenKind, u32)> {
    Some(match (before, next) {
        ("." | "?.", "(") => (TokenKind::Method, DEFAULT_LIBRARY),
        ("." | "?.", _) => (TokenKind::Property, 0),
        (_, ":") => (TokenKind::Property, 0),
        (_, "::") => (TokenKind::Namespace, 0),
        ("::", "(") => (TokenKind::Function, 0),
        ("::", _) => (TokenKind::Variable, 0),
        _ if is_keyword(word) => (TokenKind::Keyword, 0),
        _ => return None,
    })
}

fn of_number(text: &str) -> Option<(TokenKind, u32)> {
    let is_number = text.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
    is_number.then_some((TokenKind::Number, 0))
}
