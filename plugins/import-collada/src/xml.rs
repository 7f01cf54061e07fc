//! The parsed file: elements by id, places of elements for messages, lists of numbers.

use choreo_importer_kit::text::{next_integer, next_number, shown};
use choreo_importer_kit::{Budget, Notes, Problem, Progress, Result, WithPlace};
use choreo_plugin::Files;
use memchr::{memchr_iter, memmem};
use roxmltree::{Document, Error, ParsingOptions};
use std::cell::OnceCell;
use std::collections::HashMap;

pub(crate) use roxmltree::NodeId;

/// An element of the document.
pub(crate) type Node<'a> = roxmltree::Node<'a, 'a>;

/// End of the warning for an instance that refers to nothing.
pub(crate) const LEFT_OUT: &str = "it is left out";
/// Node limit, which bounds the memory of a file that consists of tags.
const MAX_NODES: u32 = 4_000_000;
/// Attribute limit of an element, because the parser compares each attribute with all others.
const MAX_ATTRIBUTES: usize = 256;

/// Parses a text. An error has its line and column.
pub(crate) fn parse(text: &str) -> Result<Document<'_>> {
    let at = |line: usize, column: usize, what: String| {
        Problem::new(format!("line {line}, column {column}"), what)
            .hint("the file was cut off or is no XML; export or copy it again")
    };
    let at_byte = |byte: usize, what: String| {
        let before = &text[..byte];
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        at(1 + memchr_iter(b'\n', before.as_bytes()).count(), 1 + before[line_start..].chars().count(), what)
    };
    if let Some(byte) = crowded_element(text.as_bytes()) {
        let what = format!("the element has more than {MAX_ATTRIBUTES} attributes, which is the limit");
        return Err(at_byte(byte, what));
    }
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| match error {
        Error::DtdDetected => {
            let byte = memmem::find(text.as_bytes(), b"<!DOCTYPE").unwrap_or(0);
            at_byte(byte, "has a document type definition, which is not allowed".into())
                .hint("take the <!DOCTYPE …> out: COLLADA needs none")
        }
        Error::NodesLimitReached => {
            at(1, 1, format!("has more than {MAX_NODES} elements and texts, which is the limit"))
        }
        Error::NoRootNode => at_byte(text.len(), "there is no whole element".into()),
        Error::UnclosedRootNode | Error::UnexpectedEndOfStream => {
            at_byte(text.len(), "the file ends within an element".into())
        }
        _ => {
            let described = error.to_string();
            let what = described.rsplit_once(" at ").map_or(described.as_str(), |(what, _)| what);
            at(error.pos().row as usize, error.pos().col as usize, shown_text(what))
        }
    })
}

/// Offset of the first element with more attributes than allowed.
fn crowded_element(text: &[u8]) -> Option<usize> {
    let mut starts = memchr_iter(b'<', text).peekable();
    while let Some(start) = starts.next() {
        // An attribute takes at least five bytes: a="".
        let tag = &text[start..starts.peek().copied().unwrap_or(text.len())];
        let is_attribute = |equals: &usize| {
            let value = tag[equals + 1..].iter().find(|b| !b.is_ascii_whitespace());
            matches!(value, Some(b'"' | b'\''))
        };
        if tag.len() > MAX_ATTRIBUTES * 5
            && memchr_iter(b'=', tag).filter(is_attribute).count() > MAX_ATTRIBUTES
        {
            return Some(start);
        }
    }
    None
}

/// An error text of the parser, which quotes the file, without control characters.
fn shown_text(text: &str) -> String {
    text.chars().take(200).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

pub(crate) struct Xml<'a> {
    doc: &'a Document<'a>,
    /// Library elements and nodes are kept apart, because exporters give a camera and its node the same id.
    ids: HashMap<&'a str, Node<'a>>,
    nodes: HashMap<&'a str, Node<'a>>,
    ends_of_lines: OnceCell<Vec<usize>>,
    pub notes: &'a Notes,
    pub budget: &'a Budget,
    progress: Progress<'a>,
}

/// The parsed values, or the index and text of the first word that is no value.
type Values<'a, T> = std::result::Result<Vec<T>, (usize, &'a [u8])>;

impl<'a> Xml<'a> {
    pub(crate) fn new(
        doc: &'a Document<'a>,
        files: &'a dyn Files,
        notes: &'a Notes,
        budget: &'a Budget,
    ) -> Xml<'a> {
        let (mut ids, mut nodes) = (HashMap::new(), HashMap::new());
        for node in doc.descendants() {
            if let Some(id) = node.attribute("id") {
                // The first element with an id counts.
                let map = if name_of(node) == "node" { &mut nodes } else { &mut ids };
                map.entry(id).or_insert(node);
            }
        }
        let progress = Progress::new(files, doc.input_text().len());
        Xml { doc, ids, nodes, ends_of_lines: OnceCell::new(), notes, budget, progress }
    }

    pub(crate) fn root(&self) -> Node<'a> {
        self.doc.root_element()
    }

    /// The place of an element for messages: `library_geometries/geometry "Cube"/mesh (line 12)`.
    pub(crate) fn place(&self, node: Node<'_>) -> String {
        let mut parts: Vec<String> = node
            .ancestors()
            .filter(|n| n.parent_element().is_some())
            .take(6)
            .map(|n| match n.attribute("id").or(n.attribute("sid")) {
                Some(id) => format!("{} \"{}\"", name_of(n), shown(id.as_bytes())),
                None => name_of(n).to_string(),
            })
            .collect();
        parts.reverse();
        // Line ends are found on demand, once for all messages.
        let text = self.doc.input_text().as_bytes();
        let ends = self.ends_of_lines.get_or_init(|| memchr_iter(b'\n', text).collect());
        let line = 1 + ends.partition_point(|end| *end < node.range().start);
        format!("{} (line {line})", parts.join("/"))
    }

    pub(crate) fn problem(&self, node: Node<'_>, what: impl Into<String>) -> Problem {
        Problem::new(self.place(node), what)
    }

    pub(crate) fn warn(&self, node: Node<'_>, what: impl Into<String>) {
        self.notes.warn(self.place(node), what);
    }

    /// The element with this id; a `<node>` only where no other element has it.
    pub(crate) fn by_id(&self, id: &str) -> Option<Node<'a>> {
        self.ids.get(id).or(self.nodes.get(id)).copied()
    }

    /// The `<node>` with this id.
    pub(crate) fn node_by_id(&self, id: &str) -> Option<Node<'a>> {
        self.nodes.get(id).copied()
    }

    /// The element that a reference `#id` in an attribute names.
    pub(crate) fn resolve_reference(&self, node: Node<'_>, attribute: &str) -> Result<Node<'a>> {
        let Some(url) = node.attribute(attribute) else {
            return Err(self.problem(node, format!("has no {attribute}")));
        };
        let id = url.trim().strip_prefix('#').unwrap_or(url.trim());
        self.by_id(id).ok_or_else(|| {
            let url = shown(url.as_bytes());
            self.problem(node, format!("{attribute}=\"{url}\" refers to nothing in this file"))
        })
    }

    /// The element that an instance (`instance_camera`, `instance_light` …) refers to, if it is of the given kind. Any other
    /// reference gives a warning, which ends with `instead`, what is done about it.
    pub(crate) fn resolve_instance(
        &self,
        instance: Node<'_>,
        url: &str,
        kind: &str,
        instead: &str,
    ) -> Option<Node<'a>> {
        match self.resolve_reference(instance, url) {
            Ok(node) if name_of(node) == kind => return Some(node),
            Ok(node) => {
                self.warn(instance, format!("refers to a {}, not a {kind}; {instead}", name_of(node)));
            }
            Err(problem) => self.notes.warn(problem.place, format!("{}; {instead}", problem.what)),
        }
        None
    }

    /// The numbers of an element's text.
    pub(crate) fn numbers(&self, node: Node<'_>) -> Result<Vec<f64>> {
        let values = self.values(node, |rest| Some(next_number(rest)?.map(Some)))?;
        values.map_err(|(index, word)| self.invalid_value(node, index, word, "a finite number"))
    }

    /// The numbers as 32-bit floats, which take half of the memory.
    pub(crate) fn floats(&self, node: Node<'_>) -> Result<Vec<f32>> {
        let values = self.values(node, |rest| {
            Some(next_number(rest)?.map(|v| Some(v as f32).filter(|v| v.is_finite())))
        })?;
        values.map_err(|(index, word)| self.invalid_value(node, index, word, "a finite number"))
    }

    /// Integers from −1, which skins use.
    pub(crate) fn integers(&self, node: Node<'_>) -> Result<Vec<i32>> {
        let values = self.values(node, |rest| {
            Some(next_integer(rest)?.map(|v| i32::try_from(v).ok().filter(|v| *v >= -1)))
        })?;
        values.map_err(|(index, word)| self.invalid_value(node, index, word, "an index"))
    }

    /// Parses all values of an element's text, or returns the first word that is no value, with its index. `next` takes one value
    /// off the text; `Ok(None)` is a number outside the value's range.
    #[inline(always)]
    fn values<'n, T>(
        &self,
        node: Node<'n>,
        next: impl Fn(&mut &'n [u8]) -> Option<std::result::Result<Option<T>, &'n [u8]>>,
    ) -> Result<Values<'n, T>> {
        // Lists of numbers are nearly all of a file and are read roughly in order, so they drive the progress.
        self.progress.reach(node.range().start)?;
        // A value takes at least two bytes (a digit and a space), and typically four.
        let length: usize = texts(node).map(str::len).sum();
        let announced = node.attribute("count").and_then(|c| c.parse().ok()).unwrap_or(length / 4);
        let mut out = Vec::with_capacity(length.div_ceil(2).min(announced));
        for text in texts(node) {
            let mut rest = text.as_bytes();
            loop {
                let from = rest;
                match next(&mut rest) {
                    None => break,
                    Some(Ok(Some(value))) => out.push(value),
                    Some(Ok(None)) => {
                        return Ok(Err((out.len(), from[..from.len() - rest.len()].trim_ascii())));
                    }
                    Some(Err(word)) => return Ok(Err((out.len(), word))),
                }
            }
        }
        self.charge(node, out.len(), size_of::<T>())?;
        Ok(Ok(out))
    }

    /// Exactly `N` numbers, else an error.
    pub(crate) fn array<const N: usize>(&self, node: Node<'_>) -> Result<[f64; N]> {
        let numbers = self.numbers(node)?;
        <[f64; N]>::try_from(numbers.as_slice())
            .map_err(|_| self.problem(node, format!("has {} numbers, but needs {N}", numbers.len())))
    }

    /// Exactly one number, else an error.
    pub(crate) fn number(&self, node: Node<'_>) -> Result<f64> {
        self.array::<1>(node).map(|[v]| v)
    }

    /// The number in a child element; `None` where there is no such child.
    pub(crate) fn child_number(&self, node: Node<'_>, name: &'static str) -> Result<Option<f64>> {
        child(node, name).map(|n| self.number(n)).transpose()
    }

    pub(crate) fn charge(&self, node: Node<'_>, count: usize, size: usize) -> Result<()> {
        self.budget.charge(count as u64, size).at(|| self.place(node))
    }

    fn invalid_value(&self, node: Node<'_>, index: usize, word: &[u8], wanted: &str) -> Problem {
        self.problem(node, format!("value {index} is \"{}\", not {wanted}", shown(word)))
    }
}

/// Child elements with a name.
pub(crate) fn children<'a>(node: Node<'a>, name: &'static str) -> impl Iterator<Item = Node<'a>> {
    node.children().filter(move |n| name_of(*n) == name)
}

pub(crate) fn child<'a>(node: Node<'a>, name: &'static str) -> Option<Node<'a>> {
    children(node, name).next()
}

/// The first element of this name at any depth below.
pub(crate) fn descendant<'a>(node: Node<'a>, name: &'static str) -> Option<Node<'a>> {
    node.descendants().skip(1).find(|n| name_of(*n) == name)
}

/// The name of an element without the prefix of its namespace; empty for texts and comments.
pub(crate) fn name_of(node: Node<'_>) -> &str {
    node.tag_name().name()
}

/// The `name` of an element, else its `id`.
pub(crate) fn label_of(node: Node<'_>) -> Option<&str> {
    node.attribute("name").or(node.attribute("id"))
}

/// Text nodes directly in the element; comments split texts.
pub(crate) fn texts(node: Node<'_>) -> impl Iterator<Item = &str> {
    node.children().filter(|n| n.is_text()).filter_map(|n| n.text())
}

/// The first text of an element, trimmed.
pub(crate) fn text_of(node: Node<'_>) -> &str {
    texts(node).next().unwrap_or_default().trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_line_and_column() {
        let deep = format!("<a>{}", "<b>".repeat(100_000));
        let many = format!("<a>\n<c {}/>", (0..257).map(|i| format!("b{i} = '>' ")).collect::<String>());
        for (text, wanted) in [
            ("", "line 1, column 1: there is no whole element"),
            ("<a>\n<b></a>", "line 2, column 4: expected 'b' tag, not 'a'"),
            ("<a>\n&laughs;</a>", "line 2, column 1: unknown entity reference 'laughs'"),
            ("<a>\n<!DOCTYPE x></a>", "line 2, column 1"),
            (
                "<?xml version='1.0'?>\n<!DOCTYPE x><a/>",
                "line 2, column 1: has a document type definition, which is not allowed",
            ),
            ("<a b='1' b='2'/>", "line 1, column 10: attribute 'b'"),
            ("<a b='<'/>", "line 1, column 7"),
            ("<a\n b='1'", "line 2, column 7: there is no whole element"),
            ("<a>\n\n\u{1}</a>", "line 3, column 1"),
            ("<a>\n\n", "line 3, column 1: the file ends within an element"),
            (&deep, "line 1, column 300004: the file ends within an element"),
            (&many, "line 2, column 1: the element has more than 256 attributes, which is the limit"),
        ] {
            let problem = parse(text).unwrap_err();
            let text = format!("{}: {}", problem.place, problem.what);
            assert!(text.starts_with(wanted), "{text} instead of {wanted}");
        }
        let elements = format!("<a>{}</a>", "<b/>".repeat(MAX_NODES as usize));
        assert_eq!(
            parse(&elements).unwrap_err().what,
            "has more than 4000000 elements and texts, which is the limit"
        );
    }

    #[test]
    fn text_around_xml_comments_is_joined() {
        let doc = parse("<a> 1 <!-- 2 -->3<![CDATA[ 4]]> <b>5</b>&#54;</a>").unwrap();
        let all: String = texts(doc.root_element()).collect();
        assert_eq!(all.split_whitespace().collect::<Vec<_>>(), ["1", "3", "4", "6"]);
    }
}
