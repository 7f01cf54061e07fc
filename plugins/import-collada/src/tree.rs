//! XML as far as COLLADA needs it: elements, their attributes, and the text directly in them. No document types, so no
//! entities but the five of XML; comments and instructions are passed over.
//!
//! Most of a file is numbers: text is not looked at here beyond its end, and nothing of it is copied.

use choreo_import::text::shown;
use choreo_import::{Problem, Result};
use memchr::{memchr, memmem};
use std::borrow::Cow;
use std::ops::Range;

/// Bounds the memory of a file that is all tags.
const MAX_ELEMENTS: usize = 4_000_000;
/// They are looked through one by one.
const MAX_ATTRIBUTES: usize = 256;

#[derive(Debug)]
pub struct Document<'i> {
    text: &'i str,
    /// In the order of the file, so that an element's descendants follow it.
    elements: Vec<Element<'i>>,
    attributes: Vec<(&'i str, Cow<'i, str>)>,
}

#[derive(Debug)]
struct Element<'i> {
    /// Without the prefix of its namespace.
    name: &'i str,
    text: Cow<'i, str>,
    /// The root's is itself.
    parent: u32,
    /// The index after its last descendant.
    end: u32,
    attributes: Range<u32>,
    /// Byte of its `<`.
    start: usize,
}

/// One element of a document.
#[derive(Clone, Copy)]
pub struct Node<'a, 'i> {
    doc: &'a Document<'i>,
    index: u32,
}

/// An element's number in the order of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(u32);

impl NodeId {
    pub fn get(self) -> u32 {
        self.0
    }
}

impl PartialEq for Node<'_, '_> {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.doc, other.doc) && self.index == other.index
    }
}

impl<'a, 'i> Node<'a, 'i> {
    fn data(self) -> &'a Element<'i> {
        &self.doc.elements[self.index as usize]
    }

    pub fn id(self) -> NodeId {
        NodeId(self.index)
    }

    pub fn name(self) -> &'a str {
        self.data().name
    }

    /// All text directly in the element.
    pub fn text(self) -> &'a str {
        &self.data().text
    }

    pub fn attribute(self, name: &str) -> Option<&'a str> {
        let Range { start, end } = self.data().attributes.clone();
        let own = &self.doc.attributes[start as usize..end as usize];
        own.iter().find(|(key, _)| *key == name).map(|(_, value)| &**value)
    }

    pub fn parent(self) -> Option<Node<'a, 'i>> {
        (self.index > 0).then(|| Node { index: self.data().parent, ..self })
    }

    /// This element, the one around it, and so on.
    pub fn ancestors(self) -> impl Iterator<Item = Node<'a, 'i>> {
        std::iter::successors(Some(self), |n| n.parent())
    }

    pub fn children(self) -> impl Iterator<Item = Node<'a, 'i>> {
        let end = self.data().end;
        let mut next = self.index + 1;
        std::iter::from_fn(move || {
            let child = (next < end).then_some(Node { index: next, ..self })?;
            next = child.data().end;
            Some(child)
        })
    }

    /// This element and all below it, in the order of the file.
    pub fn descendants(self) -> impl Iterator<Item = Node<'a, 'i>> {
        (self.index..self.data().end).map(move |index| Node { index, ..self })
    }

    /// Counted on demand: only messages have one.
    pub fn line(self) -> usize {
        line_of(self.doc.text, self.data().start)
    }
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|b| **b == b'\n').count()
}

impl<'i> Document<'i> {
    pub fn root<'a>(&'a self) -> Node<'a, 'i> {
        Node { doc: self, index: 0 }
    }

    pub fn parse(text: &'i str) -> Result<Document<'i>> {
        let mut parser =
            Parser { text, at: 0, elements: Vec::new(), attributes: Vec::new(), open: Vec::new() };
        parser.document().map_err(|what| {
            let document_type = what.contains("document type");
            let hint = match document_type {
                true => "take the <!DOCTYPE …> out: COLLADA needs none",
                false => "the file was cut off or is no XML; export or copy it again",
            };
            Problem::new(format!("line {}", line_of(text, parser.at)), what).hint(hint)
        })?;
        Ok(Document { text, elements: parser.elements, attributes: parser.attributes })
    }
}

struct Parser<'i> {
    text: &'i str,
    at: usize,
    elements: Vec<Element<'i>>,
    attributes: Vec<(&'i str, Cow<'i, str>)>,
    /// Elements around the place, outermost first, with their names as written.
    open: Vec<(u32, &'i str)>,
}

type Parsed<T> = std::result::Result<T, String>;

impl<'i> Parser<'i> {
    fn document(&mut self) -> Parsed<()> {
        if let Some(at) = self.text.bytes().position(|b| b < 0x20 && !matches!(b, b'\t' | b'\n' | b'\r')) {
            self.at = at;
            return Err(format!("byte 0x{:02x} cannot be in XML", self.text.as_bytes()[at]));
        }
        loop {
            let rest = &self.text[self.at..];
            let length = memchr(b'<', rest.as_bytes()).unwrap_or(rest.len());
            self.character_data(&rest[..length])?;
            self.at += length;
            let rest = &rest[length..];
            match rest.as_bytes() {
                [] => break,
                [b'<', b'!', b'-', b'-', ..] => self.skip(4, "-->", "a comment")?,
                [b'<', b'?', ..] => self.skip(2, "?>", "an instruction")?,
                [b'<', b'!', b'[', ..] if rest.starts_with("<![CDATA[") => {
                    let inside = self.at + 9;
                    self.skip(9, "]]>", "a CDATA section")?;
                    let all: &'i str = self.text;
                    self.add_text(Cow::Borrowed(&all[inside..self.at - 3]))?;
                }
                [b'<', b'!', ..] if rest.starts_with("<!DOCTYPE") => {
                    return Err("has a document type definition, which is not allowed".into());
                }
                [b'<', b'/', ..] => self.close()?,
                _ => self.element()?,
            }
        }
        match self.open.last() {
            Some((_, name)) => Err(format!("the file ends within the element {}", shown(name.as_bytes()))),
            None if self.elements.is_empty() => Err("there is no element".into()),
            None => Ok(()),
        }
    }

    fn skip(&mut self, opening: usize, end: &str, what: &str) -> Parsed<()> {
        let from = self.at + opening;
        let length = memmem::find(&self.text.as_bytes()[from..], end.as_bytes());
        let length = length.ok_or_else(|| format!("{what} has no end"))?;
        self.at = from + length + end.len();
        Ok(())
    }

    fn character_data(&mut self, raw: &'i str) -> Parsed<()> {
        if raw.trim_ascii_start().is_empty() {
            return Ok(());
        }
        let text = unescape(raw)?;
        self.add_text(text)
    }

    fn add_text(&mut self, text: Cow<'i, str>) -> Parsed<()> {
        let Some((index, _)) = self.open.last() else {
            return Err(format!("\"{}\" is outside of the root element", shown(text.trim().as_bytes())));
        };
        let all = &mut self.elements[*index as usize].text;
        if all.is_empty() {
            *all = text
        } else {
            all.to_mut().push_str(&text)
        }
        Ok(())
    }

    fn close(&mut self) -> Parsed<()> {
        let start = self.at;
        self.at += 2;
        let name = self.name()?;
        self.space();
        let Some((index, open)) = self.open.pop() else {
            self.at = start;
            return Err(format!("</{}> closes nothing", shown(name.as_bytes())));
        };
        if open != name {
            self.at = start;
            let (open, name) = (shown(open.as_bytes()), shown(name.as_bytes()));
            return Err(format!("the element {open} is closed by </{name}>"));
        }
        self.elements[index as usize].end = self.elements.len() as u32;
        self.take(b'>')
    }

    fn element(&mut self) -> Parsed<()> {
        let start = self.at;
        self.at += 1;
        let written = self.name()?;
        if self.open.is_empty() && !self.elements.is_empty() {
            self.at = start;
            return Err(format!("the element {} comes after the root element", shown(written.as_bytes())));
        }
        if self.elements.len() == MAX_ELEMENTS {
            return Err(format!("has more than {MAX_ELEMENTS} elements, which is the limit"));
        }
        let index = self.elements.len() as u32;
        let first = self.attributes.len();
        let empty = loop {
            let spaced = self.space();
            match self.text.as_bytes().get(self.at..) {
                Some([b'>', ..]) => {
                    self.at += 1;
                    break false;
                }
                Some([b'/', b'>', ..]) => {
                    self.at += 2;
                    break true;
                }
                Some([_, ..]) if spaced => self.attribute(first)?,
                Some([_, ..]) => return Err(self.unexpected("a space, > or />")),
                _ => return Err(format!("the file ends within the tag <{}", shown(written.as_bytes()))),
            }
        };
        self.elements.push(Element {
            name: written.rsplit_once(':').map_or(written, |(_, local)| local),
            text: Cow::Borrowed(""),
            parent: self.open.last().map_or(index, |(parent, _)| *parent),
            end: index + 1,
            attributes: first as u32..self.attributes.len() as u32,
            start,
        });
        if !empty {
            self.open.push((index, written));
        }
        Ok(())
    }

    fn attribute(&mut self, first: usize) -> Parsed<()> {
        let start = self.at;
        let name = self.name()?;
        self.space();
        self.take(b'=')?;
        self.space();
        let quote = match self.text.as_bytes().get(self.at) {
            Some(quote @ (b'"' | b'\'')) => *quote,
            _ => return Err(self.unexpected("a quoted value")),
        };
        let rest: &'i str = &self.text[self.at + 1..];
        let Some(length) = memchr(quote, rest.as_bytes()) else {
            return Err(format!("the value of {} has no end", shown(name.as_bytes())));
        };
        let raw = &rest[..length];
        if memchr(b'<', raw.as_bytes()).is_some() {
            return Err(format!("the value of {} has a < in it; a quote is missing", shown(name.as_bytes())));
        }
        self.at += length + 2;
        let own = &self.attributes[first..];
        if own.len() == MAX_ATTRIBUTES {
            return Err(format!("an element has more than {MAX_ATTRIBUTES} attributes, which is the limit"));
        }
        if own.iter().any(|(key, _)| *key == name) {
            self.at = start;
            return Err(format!("an element has two attributes {}", shown(name.as_bytes())));
        }
        self.attributes.push((name, unescape(raw)?));
        Ok(())
    }

    fn name(&mut self) -> Parsed<&'i str> {
        let rest: &'i str = &self.text[self.at..];
        let inside = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b':' | b'-' | b'.') || b >= 0x80;
        let length = rest.bytes().position(|b| !inside(b)).unwrap_or(rest.len());
        match rest.as_bytes().first() {
            Some(b) if length > 0 && !b.is_ascii_digit() && !matches!(b, b'-' | b'.') => {
                self.at += length;
                Ok(&rest[..length])
            }
            _ => Err(self.unexpected("a name")),
        }
    }

    fn space(&mut self) -> bool {
        let rest = &self.text.as_bytes()[self.at..];
        let length =
            rest.iter().position(|b| !matches!(b, b' ' | b'\t' | b'\n' | b'\r')).unwrap_or(rest.len());
        self.at += length;
        length > 0
    }

    fn take(&mut self, wanted: u8) -> Parsed<()> {
        match self.text.as_bytes().get(self.at) {
            Some(b) if *b == wanted => {
                self.at += 1;
                Ok(())
            }
            _ => Err(self.unexpected(&char::from(wanted).to_string())),
        }
    }

    fn unexpected(&self, wanted: &str) -> String {
        match self.text[self.at.min(self.text.len())..].chars().next() {
            Some(c) => format!("there should be {wanted}, not {}", shown(c.to_string().as_bytes())),
            None => format!("the file ends where there should be {wanted}"),
        }
    }
}

/// With its references replaced: the five of XML, and characters by number.
fn unescape(raw: &str) -> Parsed<Cow<'_, str>> {
    let Some(first) = memchr(b'&', raw.as_bytes()) else { return Ok(Cow::Borrowed(raw)) };
    let mut out = String::with_capacity(raw.len());
    let (plain, mut rest) = raw.split_at(first);
    out.push_str(plain);
    while let Some(reference) = rest.strip_prefix('&') {
        // The longest that means anything is &#1114111;
        let length = reference.bytes().take(12).position(|b| b == b';');
        let name = length.map_or("", |n| &reference[..n]);
        let number = |text: &str, radix: u32| u32::from_str_radix(text, radix).ok().and_then(char::from_u32);
        let sign = match (name, name.strip_prefix("#x"), name.strip_prefix('#')) {
            ("lt", ..) => Some('<'),
            ("gt", ..) => Some('>'),
            ("amp", ..) => Some('&'),
            ("quot", ..) => Some('"'),
            ("apos", ..) => Some('\''),
            (_, Some(hex), _) => number(hex, 16),
            (_, _, Some(decimal)) => number(decimal, 10),
            _ => None,
        };
        let Some(sign) = sign.filter(|c| *c >= ' ' || matches!(c, '\t' | '\n' | '\r')) else {
            return Err(format!(
                "\"&{}\" means nothing",
                shown(reference.chars().take(12).collect::<String>().as_bytes())
            ));
        };
        out.push(sign);
        let after = &reference[name.len() + 1..];
        let next = memchr(b'&', after.as_bytes()).unwrap_or(after.len());
        out.push_str(&after[..next]);
        rest = &after[next..];
    }
    Ok(Cow::Owned(out))
}
