//! Semantic tokens: the meaning of words and strings, for syntax coloring.

use crate::context::call_around;
use crate::names::{self, NameKind};
use crate::source::{InnerWord, is_string, is_word};
use crate::values::{Declaration, DeclarationKind, Types, is_keyword};
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

const TOKEN_KINDS: [&str; 13] = [
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
const UNIT_FUNCTIONS: [&str; 3] = ["f", "cm", "mm"];

/// Largest number of tokens in a list whose strings are examined: each string is looked up by its call, which takes long in long lists.
const MAX_LIST_TOKENS: usize = 1000;

pub(crate) fn legend() -> Value {
    json!({ "tokenTypes": TOKEN_KINDS, "tokenModifiers": MODIFIERS })
}

/// Semantic tokens of a range, or of the whole document, in the encoding of the protocol.
pub(crate) fn semantic_tokens(view: &View, range: Option<&Value>) -> Value {
    let source = view.source;
    let bytes = match range {
        Some(range) => source.lines.bytes_of_range(&source.text, range),
        None => 0..source.text.len(),
    };
    let classifier = TokenClassifier::new(view);
    let mut encoder = TokenEncoder { view, previous_position: (0, 0), data: Vec::new() };
    let first = source.tokens.partition_point(|token| token.end <= bytes.start);
    let mut previous_end = first.checked_sub(1).map_or(0, |before| source.tokens[before].end);
    for index in first..source.tokens.len() {
        let token = source.tokens[index].clone();
        if previous_end >= bytes.end {
            break;
        }
        for comment in comments(&source.text, previous_end..token.start) {
            encoder.push(comment.range, TokenKind::Comment, 0);
        }
        if token.start < bytes.end {
            classifier.encode_token(index, &mut encoder);
        }
        previous_end = token.end;
    }
    for comment in comments(&source.text, previous_end.min(source.text.len())..source.text.len()) {
        if comment.range.start < bytes.end {
            encoder.push(comment.range, TokenKind::Comment, 0);
        }
    }
    json!({ "data": encoder.data })
}

/// Encodes tokens for the protocol: five numbers each, with positions relative to the previous token.
struct TokenEncoder<'v> {
    view: &'v View<'v>,
    previous_position: (usize, usize),
    data: Vec<u32>,
}

impl TokenEncoder<'_> {
    /// Adds a token; a token of several lines is split into one per line.
    fn push(&mut self, bytes: Range<usize>, kind: TokenKind, modifiers: u32) {
        let (text, lines) = (&self.view.source.text, &self.view.source.lines);
        let mut start = bytes.start;
        for part in text[bytes].split_inclusive('\n') {
            let visible = part.trim_end_matches(['\n', '\r']);
            let (line, column) = lines.line_and_column(text, start);
            let length: usize = visible.chars().map(char::len_utf16).sum();
            start += part.len();
            if length == 0 {
                continue;
            }
            let column_before = if line == self.previous_position.0 { self.previous_position.1 } else { 0 };
            let numbers = [
                line - self.previous_position.0,
                column - column_before,
                length,
                kind as usize,
                modifiers as usize,
            ];
            self.data.extend(numbers.map(|number| number as u32));
            self.previous_position = (line, column);
        }
    }
}

/// Finds the kind and the modifiers of tokens. Declarations are collected once, since there can be many.
struct TokenClassifier<'v> {
    view: &'v View<'v>,
    types: Types<'v>,
    declarations: BTreeMap<&'v str, Vec<Declaration>>,
    /// Kinds of declared names, by token.
    kinds: BTreeMap<usize, TokenKind>,
}

impl<'v> TokenClassifier<'v> {
    fn new(view: &'v View<'v>) -> TokenClassifier<'v> {
        let types = view.types();
        let mut declarations: BTreeMap<&str, Vec<Declaration>> = BTreeMap::new();
        let mut kinds = BTreeMap::new();
        for token in 0..view.source.tokens.len() {
            let Some(declaration) = types.declaration_at(token) else { continue };
            let kind = match declaration.kind {
                DeclarationKind::Function => TokenKind::Function,
                DeclarationKind::Module => TokenKind::Namespace,
                DeclarationKind::Parameter(_) | DeclarationKind::ClosureParameter(_) => TokenKind::Parameter,
                DeclarationKind::Variable | DeclarationKind::Loop => TokenKind::Variable,
            };
            let value = if kind == TokenKind::Function {
                String::new()
            } else {
                types.declared_value(&declaration).kind
            };
            let kind = match value.as_str() {
                "Actor" => TokenKind::Class,
                "Clip" => TokenKind::Event,
                _ => kind,
            };
            kinds.insert(token, kind);
            declarations.entry(view.source.get(token)).or_default().push(declaration);
        }
        TokenClassifier { view, types, declarations, kinds }
    }

    /// Adds a token with its meaning; for an interpolated string, its text and the words and numbers of its code.
    fn encode_token(&self, token: usize, encoder: &mut TokenEncoder) {
        let (source, range) = (self.view.source, self.view.source.tokens[token].clone());
        let inner = source.inner_code(token);
        let Some((kind, modifiers)) = self.classify_token(token) else { return };
        let mut previous_end = range.start;
        for code in inner {
            encoder.push(previous_end..code.range.start, kind, modifiers);
            for (at, own) in code.tokens.iter().enumerate() {
                let word = InnerWord::new(source, code, at);
                let meaning = match word.text {
                    text if is_word(text) => Some(self.classify_inner_word(&word)),
                    text if is_string(text) => Some((TokenKind::String, 0)),
                    text => classify_number(text),
                };
                if let Some((kind, modifiers)) = meaning {
                    encoder.push(own.clone(), kind, modifiers);
                }
            }
            previous_end = code.range.end;
        }
        encoder.push(previous_end..range.end, kind, modifiers);
    }

    fn classify_token(&self, token: usize) -> Option<(TokenKind, u32)> {
        let text = self.view.source.get(token);
        if is_string(text) {
            return Some((self.kind_of_string(token), 0));
        }
        if is_word(text) {
            return Some(self.classify_word(token));
        }
        classify_number(text)
    }

    fn classify_word(&self, token: usize) -> (TokenKind, u32) {
        let source = self.view.source;
        let (word, before, next) = (source.get(token), source.token_before(token, 1), source.get(token + 1));
        let from_neighbors = classify_by_neighbors(word, before, next);
        let declared = || self.kinds.get(&token).map(|kind| (*kind, DECLARATION));
        from_neighbors.or_else(declared).unwrap_or_else(|| self.classify_name(word, next, token))
    }

    fn classify_inner_word(&self, word: &InnerWord) -> (TokenKind, u32) {
        let from_neighbors = classify_by_neighbors(word.text, word.before[0], word.next);
        from_neighbors.unwrap_or_else(|| self.classify_name(word.text, word.next, word.string))
    }

    /// Kind of a name that is declared before a token, or belongs to the API.
    fn classify_name(&self, word: &str, next: &str, token: usize) -> (TokenKind, u32) {
        let declared = self.declarations.get(word).map_or(&[][..], Vec::as_slice);
        let before = declared.partition_point(|declaration| declaration.token < token);
        let seen = self.types.first_visible(declared[..before].iter().rev().cloned(), token);
        // Functions are visible everywhere in a script.
        let seen = seen.or_else(|| declared.iter().find(|d| d.kind == DeclarationKind::Function).cloned());
        if let Some(kind) = seen.and_then(|declaration| self.kinds.get(&declaration.token)) {
            return (*kind, 0);
        }
        match describe::entry("", word) {
            Some(_) if UNIT_FUNCTIONS.contains(&word) && next == "(" => (TokenKind::Number, DEFAULT_LIBRARY),
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
        if source.token_before(token, 1) == "import" {
            return TokenKind::Namespace;
        }
        if source.enclosing_bracket(token).is_none_or(|open| token - open > MAX_LIST_TOKENS) {
            return TokenKind::String;
        }
        let Some(site) = call_around(self.types, source.tokens[token].start + 1) else {
            return TokenKind::String;
        };
        let names_actor = source.get(site.name) == "cast" && site.receiver.is_none() && site.argument == 0;
        match names::accepted_names(source, &site) {
            _ if names_actor => TokenKind::Class,
            Some(
                NameKind::Models
                | NameKind::Images
                | NameKind::Panoramas
                | NameKind::Scripts
                | NameKind::Fonts,
            ) => TokenKind::Namespace,
            Some(NameKind::Clips) => TokenKind::Event,
            Some(NameKind::Actors) => TokenKind::Class,
            Some(NameKind::Colors | NameKind::Cameras | NameKind::Markers | NameKind::ClipMarkers) => {
                TokenKind::String
            }
            Some(_) => TokenKind::EnumMember,
            None if self.is_allowed_value(token) => TokenKind::EnumMember,
            None => TokenKind::String,
        }
    }

    /// Whether the string is one of the allowed values of the argument or option around it.
    fn is_allowed_value(&self, token: usize) -> bool {
        let source = self.view.source;
        let Some(site) = call_around(self.types, source.tokens[token].start + 1) else { return false };
        let Some((text, entry)) = source.string_value(token).zip(site.entry(source)) else { return false };
        let key = site.maps.last().and_then(|(_, key)| key.clone());
        let argument = key.as_deref().or_else(|| site.argument_name(source)).unwrap_or_default();
        entry.values(argument).contains(&text)
    }
}

/// Kind of a word, if the tokens before and after it determine the kind.
fn classify_by_neighbors(word: &str, before: &str, next: &str) -> Option<(TokenKind, u32)> {
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

fn classify_number(text: &str) -> Option<(TokenKind, u32)> {
    let is_number = text.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
    is_number.then_some((TokenKind::Number, 0))
}
