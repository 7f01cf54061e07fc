//! XML as far as COLLADA needs it: elements, their attributes, and the text directly in them. No document types, so no
//! entities but the five of XML; comments and instructions are passed over.
//!
//! Most of a file is numbers: text is not looked at here beyond its end, and nothing of it is copied.

use choreo_importer_kit::text::shown;
use choreo_importer_kit::{Problem, Result};
use memchr::{memchr, memchr_iter, memmem};
use std::borrow::Cow;
use std::cell::OnceCell;
use std::ops::Range;

/// Bounds the memory of a file that is all tags.
const MAX_ELEMENTS: usize = 4_000_000;
/// They are looked through one by one.
const MAX_ATTRIBUTES: usize = 256;

#[derive(Debug)]
pub struct Document<'i> {
    text: &'i str,
    /// Elements in the order of the file, so that an element's descendants follow it.
    elements: Vec<Element<'i>>,
    attributes: Vec<(&'i str, Cow<'i, str>)>,
    ends_of_lines: OnceCell<Vec<usize>>,
}

#[derive(Debug)]
struct Element<'i> {
    /// Name without the prefix of its namespace.
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

    /// The element's byte in the file's text.
    pub fn start(self) -> usize {
        self.data().start
    }

    /// Line number from 1. Counted on demand, and once for all messages.
    pub fn line(self) -> usize {
        let bytes = self.doc.text.as_bytes();
        let ends = self.doc.ends_of_lines.get_or_init(|| memchr_iter(b'\n', bytes).collect());
        1 + ends.partition_point(|end| *end < self.data().start)
    }
}

/// Line number for the one error that ends it.
fn line_of(text: &str, at: usize) -> usize {
    1 + memchr_iter(b'\n', &text.as_bytes()[..at.min(text.len())]).count()
}

impl<'i> Document<'i> {
    /// Bytes of its text.
    pub fn length(&self) -> usize {
        self.text.len()
    }

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
        let Parser { elements, attributes, .. } = parser;
        Ok(Document { text, elements, attributes, ends_of_lines: OnceCell::new() })
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
        if let Some(at) = control(self.text.as_bytes()) {
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
        let word = raw.trim_ascii_start();
        if word.is_empty() {
            return Ok(());
        }
        let space = raw.len() - word.len();
        self.at += space;
        let text = unescape(raw)?;
        self.add_text(text)?;
        self.at -= space;
        Ok(())
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

/// The place of a byte that no XML has: control characters other than tabs and ends of lines.
fn control(text: &[u8]) -> Option<usize> {
    let odd = |b: u8| b < 0x20 && !matches!(b, b'\t' | b'\n' | b'\r');
    // Without a way out in the middle many bytes are looked at at once.
    let blocks = text.chunks(1024).map(|block| block.iter().fold(false, |any, b| any | odd(*b)));
    let block = blocks.enumerate().find(|(_, any)| *any)?.0 * 1024;
    text[block..].iter().position(|b| odd(*b)).map(|at| block + at)
}

/// The text with its references replaced: the five of XML, and characters by number.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// What `roxmltree` and this make of a text, as far as both say the same: elements with attributes, in order.
    fn agrees(text: &str) {
        let (mine, other) = (Document::parse(text).unwrap(), roxmltree::Document::parse(text).unwrap());
        let elements: Vec<_> = other.descendants().filter(roxmltree::Node::is_element).collect();
        assert_eq!(mine.elements.len(), elements.len());
        for (a, b) in mine.root().descendants().zip(&elements) {
            assert_eq!(
                (a.name(), a.line()),
                (b.tag_name().name(), other.text_pos_at(b.range().start).row as usize)
            );
            let below = |n: &roxmltree::Node<'_, '_>| n.descendants().filter(|n| n.is_element()).count();
            assert_eq!(a.descendants().count(), below(b), "{}", a.name());
            assert_eq!(a.children().count(), b.children().filter(|n| n.is_element()).count(), "{}", a.name());
            assert_eq!(a.parent().map(Node::name), b.parent_element().map(|p| p.tag_name().name()));
            let text: String = b.children().filter(|n| n.is_text()).filter_map(|n| n.text()).collect();
            let words = |t: &str| t.split_whitespace().map(str::to_string).collect::<Vec<_>>();
            assert_eq!(words(a.text()), words(&text), "{}", a.name());
            for attribute in b.attributes().filter(|a| a.namespace().is_none()) {
                assert_eq!(a.attribute(attribute.name()), Some(attribute.value()));
            }
        }
    }

    #[test]
    fn the_same_tree_as_another_reader() {
        agrees(include_str!("../tests/data/arm.dae"));
        agrees(
            "<?xml version='1.0'?>\n<!-- <a> -->\n<r a = '1>2' b=\"&lt;&#65;&#x42;&amp;amp;\">\n 1 <!-- 2 -->3\n\
             <x:y xmlns:x='u' c='ä'/><![CDATA[<4>&amp;]]>&quot;5&apos;<?p <q>?>\n<e></e><f ><g/></f\n></r>\n<!-- end -->\n",
        );
    }

    #[test]
    fn errors_say_line_and_what_is_wrong() {
        let deep = format!("<a>{}", "<b>".repeat(100_000));
        let many = format!("<a {}/>", (0..257).map(|i| format!("b{i}='' ")).collect::<String>());
        for (text, wanted) in [
            ("", "line 1: there is no element"),
            ("<a>\n<b></a>", "line 2: the element b is closed by </a>"),
            ("<a/>\n</a>", "line 2: </a> closes nothing"),
            ("<a/>\n<b/>", "line 2: the element b comes after the root element"),
            ("<a/>\nword", "line 2: \"word\" is outside of the root element"),
            ("<a>\n&laughs;</a>", "line 2: \"&laughs;\" means nothing"),
            ("<a>&#0;</a>", "line 1: \"&#0;\" means nothing"),
            ("<a>&#x110000;</a>", "line 1: \"&#x110000;\" means nothing"),
            ("<a b='1' b='2'/>", "line 1: an element has two attributes b"),
            ("<a b='1'c='2'/>", "line 1: there should be a space, > or />, not c"),
            ("<a b=1/>", "line 1: there should be a quoted value, not 1"),
            ("<a b/>", "line 1: there should be =, not /"),
            ("<a b='<'/>", "line 1: the value of b has a < in it; a quote is missing"),
            ("<a b='", "line 1: the value of b has no end"),
            ("<a\n b='1'", "line 2: the file ends within the tag <a"),
            ("<1/>", "line 1: there should be a name, not 1"),
            ("<a><", "line 1: the file ends where there should be a name"),
            ("<a>\n<!-- ", "line 2: a comment has no end"),
            ("<a><![CDATA[ ]]", "line 1: a CDATA section has no end"),
            ("<?xml ", "line 1: an instruction has no end"),
            ("<a>\n\n\u{1}</a>", "line 3: byte 0x01 cannot be in XML"),
            ("<a>\n\n", "line 3: the file ends within the element a"),
            (&deep, "line 1: the file ends within the element b"),
            (&many, "line 1: an element has more than 256 attributes, which is the limit"),
        ] {
            let problem = Document::parse(text).unwrap_err();
            assert_eq!(format!("{}: {}", problem.place, problem.what), wanted);
        }
        let elements = format!("<a>{}</a>", "<b/>".repeat(MAX_ELEMENTS));
        let problem = Document::parse(&elements).unwrap_err();
        assert_eq!(problem.what, "has more than 4000000 elements, which is the limit");
    }
}
