//! Reads layers as text, `.usda`.

use crate::layer::{Layer, Prim, Reference, Specifier, Value};
use choreo_importer_kit::text::{number, shown};
use choreo_importer_kit::{Budget, Problem, Result};
use std::sync::Arc;

/// Nesting of prims, values and dictionaries, at most.
const MAX_DEPTH: usize = 96;

pub(crate) fn read(bytes: &[u8], budget: &Budget) -> Result<Layer> {
    // A number takes at least two bytes of text, and eight bytes in memory.
    budget.charge(bytes.len() as u64, 5)?;
    let at = if bytes.starts_with(b"\xEF\xBB\xBF") { 3 } else { 0 };
    let mut parser = Parser { bytes, at, depth: 0 };
    if !parser.rest().starts_with(b"#usda") {
        return Err(Problem::new("line 1", "does not begin with #usda"));
    }
    let mut layer = Layer::default();
    parser.skip_line();
    parser.skip_space();
    if parser.take(b'(') {
        parser.read_layer_metadata(&mut layer)?;
    }
    let mut root = Prim::default();
    loop {
        parser.skip_space();
        if parser.at == bytes.len() {
            break;
        }
        parser.read_statement(&mut root)?;
    }
    layer.root = root;
    Ok(layer)
}

struct Parser<'a> {
    bytes: &'a [u8],
    at: usize,
    depth: usize,
}

/// A parsed value: the parts it consists of.
#[derive(Default)]
struct Parsed {
    numbers: Vec<f64>,
    texts: Vec<String>,
    references: Vec<Reference>,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    fn peek(&self) -> u8 {
        self.bytes.get(self.at).copied().unwrap_or(0)
    }

    fn error(&self, what: impl std::fmt::Display) -> Problem {
        let line = 1 + self.bytes[..self.at].iter().filter(|b| **b == b'\n').count();
        Problem::new(format!("line {line}"), what.to_string())
    }

    fn unexpected(&self, wanted: &str) -> Problem {
        match self.rest() {
            [] => self.error(format!("the file ends where {wanted} is expected")),
            rest => {
                let end = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
                self.error(format!("expected {wanted}, found \"{}\"", shown(&rest[..end.min(40)])))
            }
        }
    }

    fn skip_line(&mut self) {
        let rest = self.rest();
        self.at += rest.iter().position(|b| *b == b'\n').map_or(rest.len(), |end| end + 1);
    }

    /// Skips white space, separators and comments.
    fn skip_space(&mut self) {
        loop {
            match self.peek() {
                b' ' | b'\t' | b'\r' | b'\n' | b';' | b',' => self.at += 1,
                b'#' => self.skip_line(),
                0xEF if self.rest().starts_with(b"\xEF\xBB\xBF") => self.at += 3,
                _ => return,
            }
        }
    }

    fn take(&mut self, byte: u8) -> bool {
        self.skip_space();
        let is_next = self.at < self.bytes.len() && self.peek() == byte;
        self.at += usize::from(is_next);
        is_next
    }

    fn expect(&mut self, byte: u8) -> Result<()> {
        match self.take(byte) {
            true => Ok(()),
            false => Err(self.unexpected(&format!("\"{}\"", byte as char))),
        }
    }

    /// A name with namespaces; empty where none follows.
    fn read_word(&mut self) -> &'a str {
        self.skip_space();
        let is_of_word = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b':' | b'.') || *b >= 0x80;
        let rest = self.rest();
        let end = rest.iter().position(|b| !is_of_word(b)).unwrap_or(rest.len());
        self.at += end;
        std::str::from_utf8(&rest[..end]).unwrap_or_default()
    }

    fn with_depth<R>(&mut self, read: impl FnOnce(&mut Self) -> Result<R>) -> Result<R> {
        if self.depth == MAX_DEPTH {
            return Err(self.error(format!("more than {MAX_DEPTH} nested parts")));
        }
        self.depth += 1;
        let out = read(self);
        self.depth -= 1;
        out
    }

    fn read_string(&mut self) -> Result<String> {
        self.skip_space();
        let quote = self.peek();
        if !matches!(quote, b'"' | b'\'') {
            return Err(self.unexpected("a string"));
        }
        let triple = [quote; 3];
        let end: &[u8] = if self.rest().starts_with(&triple) { &triple } else { &triple[..1] };
        self.at += end.len();
        let mut out = Vec::new();
        loop {
            let rest = self.rest();
            if rest.is_empty() {
                return Err(self.error("a string does not end"));
            }
            if rest.starts_with(end) {
                self.at += end.len();
                return Ok(String::from_utf8_lossy(&out).into_owned());
            }
            if rest[0] == b'\\' && rest.len() > 1 {
                out.push(match rest[1] {
                    b'n' => b'\n',
                    b't' => b'\t',
                    b'r' => b'\r',
                    other => other,
                });
                self.at += 2;
            } else {
                out.push(rest[0]);
                self.at += 1;
            }
        }
    }

    /// Text up to a mark, which is consumed.
    fn read_text_until(&mut self, end: &[u8]) -> Result<String> {
        let rest = self.rest();
        let Some(found) = rest.windows(end.len()).position(|w| w == end) else {
            return Err(self.error(format!("the closing \"{}\" is missing", shown(end))));
        };
        self.at += found + end.len();
        Ok(String::from_utf8_lossy(&rest[..found]).into_owned())
    }

    fn read_value(&mut self, out: &mut Parsed) -> Result<()> {
        self.skip_space();
        match self.peek() {
            open @ (b'(' | b'[') => {
                let close = if open == b'(' { b')' } else { b']' };
                self.at += 1;
                self.with_depth(|parser| {
                    while !parser.take(close) {
                        parser.read_value(out)?;
                    }
                    Ok(())
                })
            }
            b'{' => self.skip_dictionary(),
            b'"' | b'\'' => {
                out.texts.push(self.read_string()?);
                Ok(())
            }
            b'@' => {
                let mark: &[u8] = if self.rest().starts_with(b"@@@") { b"@@@" } else { b"@" };
                self.at += mark.len();
                let file = self.read_text_until(mark)?;
                out.texts.push(file.clone());
                let path = if self.peek() == b'<' { self.read_path()? } else { String::new() };
                self.read_reference(file, path, out)
            }
            b'<' => {
                let path = self.read_path()?;
                self.read_reference(String::new(), path, out)
            }
            b'0'..=b'9' | b'-' | b'+' | b'.' => {
                let rest = self.rest();
                let is_of_number = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'+' | b'.');
                let end = rest.iter().position(|b| !is_of_number(b)).unwrap_or(rest.len());
                let value = match &rest[..end] {
                    b"-inf" => Some(f64::NEG_INFINITY),
                    word => number(word),
                };
                out.numbers.push(value.ok_or_else(|| self.unexpected("a number"))?);
                self.at += end;
                Ok(())
            }
            _ => {
                match self.read_word() {
                    "" => return Err(self.unexpected("a value")),
                    "true" => out.numbers.push(1.0),
                    "false" => out.numbers.push(0.0),
                    "inf" => out.numbers.push(f64::INFINITY),
                    "nan" => out.numbers.push(f64::NAN),
                    "None" => {}
                    word => out.texts.push(word.to_string()),
                }
                Ok(())
            }
        }
    }

    fn read_path(&mut self) -> Result<String> {
        self.at += 1;
        self.read_text_until(b">")
    }

    /// Reads the rest of a reference: its time offset and scale.
    fn read_reference(&mut self, file: String, path: String, out: &mut Parsed) -> Result<()> {
        let mut reference = Reference { file, path, offset: 0.0, scale: 1.0 };
        if self.rest().iter().find(|b| !matches!(b, b' ' | b'\t')) == Some(&b'(') {
            self.expect(b'(')?;
            while !self.take(b')') {
                let key = self.read_word();
                self.expect(b'=')?;
                let mut parsed = Parsed::default();
                self.with_depth(|parser| parser.read_value(&mut parsed))?;
                match (key, parsed.numbers.first()) {
                    ("offset", Some(offset)) => reference.offset = *offset,
                    ("scale", Some(scale)) => reference.scale = *scale,
                    _ => {}
                }
            }
        }
        out.references.push(reference);
        Ok(())
    }

    fn skip_dictionary(&mut self) -> Result<()> {
        self.expect(b'{')?;
        self.with_depth(|parser| {
            while !parser.take(b'}') {
                match parser.peek() {
                    b'{' => parser.skip_dictionary()?,
                    b'=' | b':' => parser.at += 1,
                    _ => parser.read_value(&mut Parsed::default())?,
                }
            }
            Ok(())
        })
    }

    fn read_layer_metadata(&mut self, layer: &mut Layer) -> Result<()> {
        self.read_metadata(|key, parsed| {
            let text = parsed.texts.first().cloned();
            let number = parsed.numbers.first().copied();
            match key {
                "" => layer.comment = text.unwrap_or_default(),
                "defaultPrim" => layer.default_prim = text.unwrap_or_default(),
                "upAxis" => layer.up_axis = text,
                "metersPerUnit" => layer.metres_per_unit = number,
                "timeCodesPerSecond" => layer.time_codes_per_second = number,
                "framesPerSecond" => layer.time_codes_per_second = layer.time_codes_per_second.or(number),
                "startTimeCode" => layer.start_time_code = number,
                "subLayers" => layer.sublayers = parsed.texts,
                _ => {}
            }
        })
    }

    /// Reads metadata entries up to the closing parenthesis. A bare string has an empty key.
    fn read_metadata(&mut self, mut receive: impl FnMut(&str, Parsed)) -> Result<()> {
        while !self.take(b')') {
            if matches!(self.peek(), b'"' | b'\'') {
                let texts = vec![self.read_string()?];
                receive("", Parsed { texts, ..Parsed::default() });
                continue;
            }
            let mut key = self.read_word();
            let is_deleted = matches!(key, "delete" | "reorder");
            if is_deleted || matches!(key, "prepend" | "append" | "add") {
                key = self.read_word();
            }
            if key.is_empty() {
                return Err(self.unexpected("metadata"));
            }
            self.expect(b'=')?;
            let mut parsed = Parsed::default();
            if key == "variants" {
                parsed.texts = self.read_selections()?;
            } else {
                self.with_depth(|parser| parser.read_value(&mut parsed))?;
            }
            if !is_deleted {
                receive(key, parsed);
            }
        }
        Ok(())
    }

    /// Names of variant sets and of the selected variants, alternating.
    fn read_selections(&mut self) -> Result<Vec<String>> {
        self.expect(b'{')?;
        let mut out = Vec::new();
        while !self.take(b'}') {
            if !matches!(self.read_word(), "string" | "") {
                return Err(self.unexpected("a variant set"));
            }
            self.skip_space();
            let is_quoted = matches!(self.peek(), b'"' | b'\'');
            let name = if is_quoted { self.read_string()? } else { self.read_word().to_string() };
            self.expect(b'=')?;
            out.extend([name, self.read_string()?]);
        }
        Ok(out)
    }

    /// Reads a prim, a variant set or a property.
    fn read_statement(&mut self, parent: &mut Prim) -> Result<()> {
        let start = self.at;
        match self.read_word() {
            "def" => self.read_prim(Specifier::Def, parent),
            "over" => self.read_prim(Specifier::Over, parent),
            "class" => self.read_prim(Specifier::Class, parent),
            "variantSet" => self.read_variant_set(parent),
            "reorder" => {
                self.read_word();
                self.expect(b'=')?;
                self.read_value(&mut Parsed::default())
            }
            "" => Err(self.unexpected("a prim or a property")),
            _ => {
                self.at = start;
                self.read_property(parent)
            }
        }
    }

    fn read_prim(&mut self, specifier: Specifier, parent: &mut Prim) -> Result<()> {
        let kind = self.read_word().to_string();
        let mut prim = Prim { name: self.read_string()?, kind, specifier, ..Prim::default() };
        if self.take(b'(') {
            self.read_prim_metadata(&mut prim)?;
        }
        self.read_contents(&mut prim)?;
        parent.children.push(prim);
        Ok(())
    }

    fn read_contents(&mut self, prim: &mut Prim) -> Result<()> {
        self.expect(b'{')?;
        self.with_depth(|parser| {
            while !parser.take(b'}') {
                parser.read_statement(prim)?;
            }
            Ok(())
        })
    }

    fn read_prim_metadata(&mut self, prim: &mut Prim) -> Result<()> {
        self.read_metadata(|key, parsed| match key {
            "references" | "payload" => prim.references.extend(parsed.references),
            "inherits" | "specializes" => {
                prim.classes.extend(parsed.references.into_iter().map(|class| class.path));
            }
            "active" => prim.inactive = parsed.numbers.first() == Some(&0.0),
            "displayName" => prim.display_name = parsed.texts.into_iter().next().unwrap_or_default(),
            "variants" => {
                let pairs = parsed.texts.chunks_exact(2);
                prim.selections.extend(pairs.map(|pair| (pair[0].clone(), pair[1].clone())));
            }
            _ => {}
        })
    }

    fn read_variant_set(&mut self, prim: &mut Prim) -> Result<()> {
        let set = self.read_string()?;
        self.expect(b'=')?;
        self.expect(b'{')?;
        self.with_depth(|parser| {
            while !parser.take(b'}') {
                let name = parser.read_string()?;
                let mut variant = Prim::default();
                if parser.take(b'(') {
                    parser.read_prim_metadata(&mut variant)?;
                }
                parser.read_contents(&mut variant)?;
                prim.variants.entry(set.clone()).or_default().insert(name, variant);
            }
            Ok(())
        })
    }

    fn read_property(&mut self, prim: &mut Prim) -> Result<()> {
        let mut word = self.read_word();
        let is_deleted = matches!(word, "delete");
        while matches!(
            word,
            "custom" | "uniform" | "varying" | "config" | "prepend" | "append" | "add" | "delete"
        ) {
            word = self.read_word();
        }
        let is_array = self.take(b'[');
        if is_array {
            self.expect(b']')?;
        }
        let kind = if is_array { format!("{word}[]") } else { word.to_string() };
        let full_name = self.read_word();
        if full_name.is_empty() {
            return Err(self.unexpected("the name of a property"));
        }
        let (name, suffix) = match full_name.rsplit_once('.') {
            Some((name, suffix)) => (name, suffix),
            None => (full_name, ""),
        };
        let mut parsed = Parsed::default();
        if kind == "rel" {
            if self.take(b'=') {
                self.read_value(&mut parsed)?;
            }
            if !is_deleted {
                let targets = parsed.references.into_iter().map(|target| target.path);
                prim.relations.entry(name.to_string()).or_default().extend(targets);
            }
            return self.skip_metadata();
        }
        let attribute = Arc::make_mut(prim.attributes.entry(name.to_string()).or_default());
        attribute.kind.clone_from(&kind);
        match suffix {
            "timeSamples" => {
                self.expect(b'=')?;
                attribute.samples = self.read_samples(&kind)?;
            }
            "connect" => {
                self.expect(b'=')?;
                self.read_value(&mut parsed)?;
                let sources = parsed.references.into_iter().map(|source| source.path).collect();
                prim.connections.insert(name.to_string(), sources);
            }
            "" => {
                if self.take(b'=') {
                    self.read_value(&mut parsed)?;
                    attribute.value = value_of(parsed, &kind);
                }
                if self.has_metadata() {
                    self.expect(b'(')?;
                    self.read_metadata(|key, parsed| match key {
                        "interpolation" => {
                            attribute.interpolation = parsed.texts.into_iter().next().unwrap_or_default();
                        }
                        "elementSize" => {
                            attribute.element_size = parsed.numbers.first().map_or(0, |n| *n as usize);
                        }
                        _ => {}
                    })?;
                }
            }
            // Other statements, such as splines, are skipped.
            _ => {
                if self.take(b'=') {
                    self.read_value(&mut parsed)?;
                }
                self.skip_metadata()?;
            }
        }
        Ok(())
    }

    /// Whether metadata in parentheses follows on the same line.
    fn has_metadata(&self) -> bool {
        self.rest().iter().find(|b| !matches!(b, b' ' | b'\t')) == Some(&b'(')
    }

    fn skip_metadata(&mut self) -> Result<()> {
        if self.has_metadata() {
            self.expect(b'(')?;
            self.read_metadata(|_, _| {})?;
        }
        Ok(())
    }

    fn read_samples(&mut self, kind: &str) -> Result<Vec<(f64, Value)>> {
        self.expect(b'{')?;
        let mut out = Vec::new();
        while !self.take(b'}') {
            let mut time = Parsed::default();
            self.read_value(&mut time)?;
            let Some(time) = time.numbers.first().copied().filter(|time| time.is_finite()) else {
                return Err(self.unexpected("a time"));
            };
            self.expect(b':')?;
            let mut parsed = Parsed::default();
            self.read_value(&mut parsed)?;
            out.extend(value_of(parsed, kind).map(|value| (time, value)));
        }
        out.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(out)
    }
}

/// The value of an attribute; `None` where it is blocked.
fn value_of(parsed: Parsed, kind: &str) -> Option<Value> {
    let Parsed { mut numbers, texts, .. } = parsed;
    let base = kind.trim_end_matches("[]");
    if base.starts_with("float") || base.ends_with('f') {
        // Rounded to f32, as crate files store them.
        numbers.iter_mut().for_each(|number| *number = f64::from(*number as f32));
    }
    if kind.starts_with("quat") {
        // Quaternions have the real part first in text, and last here.
        numbers.chunks_exact_mut(4).for_each(|quaternion| quaternion.rotate_left(1));
    }
    let is_text = ["token", "string", "asset"].iter().any(|name| kind.starts_with(name));
    match (is_text, numbers.is_empty(), texts.is_empty()) {
        (true, _, false) => Some(Value::Texts(texts.into())),
        (false, false, _) => Some(Value::Numbers(numbers.into())),
        (is_text, _, _) if kind.ends_with("[]") => {
            Some(if is_text { Value::Texts([].into()) } else { Value::Numbers([].into()) })
        }
        _ => None,
    }
}
