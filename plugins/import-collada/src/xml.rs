//! The parsed file: elements by id, places of elements, lists of numbers.

use choreo_import::text::{number, shown};
use choreo_import::{Budget, Notes, Problem, Result};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashMap;

/// Bounds the memory of a file that is all tags.
const MAX_ELEMENTS: u32 = 4_000_000;

pub struct Xml<'a, 'i> {
    doc: &'a Document<'i>,
    /// Elements of a library and nodes apart: exporters give a camera and its node the same id.
    ids: HashMap<&'a str, Node<'a, 'i>>,
    nodes: HashMap<&'a str, Node<'a, 'i>>,
    pub notes: &'a Notes,
    pub budget: &'a Budget,
}

pub fn parse(text: &str) -> Result<Document<'_>> {
    let options = ParsingOptions { nodes_limit: MAX_ELEMENTS, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|e| {
        let what = match &e {
            roxmltree::Error::DtdDetected => {
                "has a document type definition, which is not allowed".to_string()
            }
            roxmltree::Error::NodesLimitReached => {
                format!("has more than {MAX_ELEMENTS} elements, which is the limit")
            }
            other => {
                // Its message ends with its own "at line:column".
                let text = other.to_string();
                text.rsplit_once(" at ").map_or(text.clone(), |(what, _)| what.to_string())
            }
        };
        let hint = match e {
            roxmltree::Error::DtdDetected => "take the <!DOCTYPE …> out: COLLADA needs none",
            _ => "the file was cut off or is no XML; export or copy it again",
        };
        let line = match e {
            // It knows no place of its own.
            roxmltree::Error::DtdDetected => {
                1 + text.find("<!DOCTYPE").map_or(0, |at| text[..at].bytes().filter(|b| *b == b'\n').count())
                    as u32
            }
            _ => e.pos().row.max(1),
        };
        Problem::new(format!("line {line}"), what).hint(hint)
    })
}

impl<'a, 'i> Xml<'a, 'i> {
    pub fn new(doc: &'a Document<'i>, notes: &'a Notes, budget: &'a Budget) -> Xml<'a, 'i> {
        let (mut ids, mut nodes) = (HashMap::new(), HashMap::new());
        for node in doc.descendants().filter(Node::is_element) {
            if let Some(id) = node.attribute("id") {
                // The first counts.
                let map = if name_of(node) == "node" { &mut nodes } else { &mut ids };
                map.entry(id).or_insert(node);
            }
        }
        Xml { doc, ids, nodes, notes, budget }
    }

    pub fn root(&self) -> Node<'a, 'i> {
        self.doc.root_element()
    }

    /// `library_geometries/geometry "Cube"/mesh (line 12)`. The line is counted on demand: only messages have one.
    pub fn place(&self, node: Node<'a, 'i>) -> String {
        let mut parts: Vec<String> = node
            .ancestors()
            .filter(|n| n.is_element() && *n != self.root())
            .take(6)
            .map(|n| match n.attribute("id").or(n.attribute("sid")) {
                Some(id) => format!("{} \"{}\"", n.tag_name().name(), shown(id.as_bytes())),
                None => n.tag_name().name().to_string(),
            })
            .collect();
        parts.reverse();
        let line = self.doc.text_pos_at(node.range().start).row;
        format!("{} (line {line})", parts.join("/"))
    }

    pub fn problem(&self, node: Node<'a, 'i>, what: impl Into<String>) -> Problem {
        Problem::new(self.place(node), what)
    }

    pub fn warn(&self, node: Node<'a, 'i>, what: impl Into<String>) {
        self.notes.warn(self.place(node), what);
    }

    /// The element with this id; a node only where nothing else has it.
    pub fn by_id(&self, id: &str) -> Option<Node<'a, 'i>> {
        self.ids.get(id).or(self.nodes.get(id)).copied()
    }

    /// The `<node>` with this id.
    pub fn node_by_id(&self, id: &str) -> Option<Node<'a, 'i>> {
        self.nodes.get(id).copied()
    }

    /// What the attribute `#id` of an element refers to.
    pub fn follow(&self, node: Node<'a, 'i>, attribute: &str) -> Result<Node<'a, 'i>> {
        let Some(url) = node.attribute(attribute) else {
            return Err(self.problem(node, format!("has no {attribute}")));
        };
        let id = url.trim().strip_prefix('#').unwrap_or(url.trim());
        self.by_id(id).ok_or_else(|| {
            self.problem(
                node,
                format!("{attribute}=\"{}\" refers to nothing in this file", shown(url.as_bytes())),
            )
        })
    }

    /// The numbers of an element's text.
    pub fn numbers(&self, node: Node<'a, 'i>) -> Result<Vec<f64>> {
        let mut out = Vec::new();
        self.each_word(node, |index, word| {
            out.push(number(word).ok_or_else(|| self.bad(node, index, word, "a finite number"))?);
            Ok(())
        })?;
        self.charge(node, out.len(), 8)?;
        Ok(out)
    }

    /// The same as 32-bit floats: positions of big meshes take half.
    pub fn floats(&self, node: Node<'a, 'i>) -> Result<Vec<f32>> {
        let mut out = Vec::new();
        self.each_word(node, |index, word| {
            let value = number(word).map(|v| v as f32).filter(|v| v.is_finite());
            out.push(value.ok_or_else(|| self.bad(node, index, word, "a finite number"))?);
            Ok(())
        })?;
        self.charge(node, out.len(), 4)?;
        Ok(out)
    }

    /// Whole numbers from −1 (which skins use) on.
    pub fn integers(&self, node: Node<'a, 'i>) -> Result<Vec<i32>> {
        let mut out = Vec::new();
        self.each_word(node, |index, word| {
            let value =
                choreo_import::text::integer(word).and_then(|v| i32::try_from(v).ok()).filter(|v| *v >= -1);
            out.push(value.ok_or_else(|| self.bad(node, index, word, "an index"))?);
            Ok(())
        })?;
        self.charge(node, out.len(), 4)?;
        Ok(out)
    }

    /// Exactly `N` numbers.
    pub fn array<const N: usize>(&self, node: Node<'a, 'i>) -> Result<[f64; N]> {
        let numbers = self.numbers(node)?;
        <[f64; N]>::try_from(numbers.as_slice())
            .map_err(|_| self.problem(node, format!("has {} numbers, but needs {N}", numbers.len())))
    }

    /// One number.
    pub fn number(&self, node: Node<'a, 'i>) -> Result<f64> {
        self.array::<1>(node).map(|[v]| v)
    }

    pub fn charge(&self, node: Node<'a, 'i>, count: usize, size: usize) -> Result<()> {
        self.budget.charge(count as u64, size).map_err(|what| self.problem(node, what))
    }

    fn bad(&self, node: Node<'a, 'i>, index: usize, word: &[u8], wanted: &str) -> Problem {
        self.problem(node, format!("value {index} is \"{}\", not {wanted}", shown(word)))
    }

    fn each_word(
        &self,
        node: Node<'a, 'i>,
        mut take: impl FnMut(usize, &'a [u8]) -> Result<()>,
    ) -> Result<()> {
        let mut index = 0;
        for text in node.children().filter(|n| n.is_text()) {
            let bytes = text.text().unwrap_or_default().as_bytes();
            for word in bytes.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()) {
                take(index, word)?;
                index += 1;
            }
        }
        Ok(())
    }
}

/// Child elements with a name.
pub fn children<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |n| n.is_element() && n.tag_name().name() == name)
}

pub fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

/// The first element of this name at any depth below.
pub fn descendant<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    node.descendants().skip(1).find(|n| n.is_element() && n.tag_name().name() == name)
}

pub fn name_of<'a>(node: Node<'a, '_>) -> &'a str {
    node.tag_name().name()
}

/// The element's text without white space around.
pub fn text_of<'a>(node: Node<'a, '_>) -> &'a str {
    node.text().unwrap_or_default().trim()
}
