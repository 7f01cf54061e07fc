//! The parsed file: elements by id, places of elements, lists of numbers.

use crate::tree::{Document, Node};
use choreo_importer_kit::text::{next_integer, next_number, shown};
use choreo_importer_kit::{Budget, Notes, Problem, Progress, Result};
use choreo_plugin::Files;
use std::collections::HashMap;

/// The end of the warning for an instance that refers to nothing.
pub const LEFT_OUT: &str = "it is left out";

pub struct Xml<'a, 'i> {
    doc: &'a Document<'i>,
    /// Elements of a library and nodes apart: exporters give a camera and its node the same id.
    ids: HashMap<&'a str, Node<'a, 'i>>,
    nodes: HashMap<&'a str, Node<'a, 'i>>,
    pub notes: &'a Notes,
    pub budget: &'a Budget,
    progress: Progress<'a>,
}

/// Values of a text, or the number and word of the one that is none.
type Values<'a, T> = std::result::Result<Vec<T>, (usize, &'a [u8])>;

impl<'a, 'i> Xml<'a, 'i> {
    pub fn new(
        doc: &'a Document<'i>,
        files: &'a dyn Files,
        notes: &'a Notes,
        budget: &'a Budget,
    ) -> Xml<'a, 'i> {
        let (mut ids, mut nodes) = (HashMap::new(), HashMap::new());
        for node in doc.root().descendants() {
            if let Some(id) = node.attribute("id") {
                // The first counts.
                let map = if name_of(node) == "node" { &mut nodes } else { &mut ids };
                map.entry(id).or_insert(node);
            }
        }
        let progress = Progress::new(files, doc.length());
        Xml { doc, ids, nodes, notes, budget, progress }
    }

    pub fn root(&self) -> Node<'a, 'i> {
        self.doc.root()
    }

    /// `library_geometries/geometry "Cube"/mesh (line 12)`. The line is counted on demand: only messages have one.
    pub fn place(&self, node: Node<'a, 'i>) -> String {
        let mut parts: Vec<String> = node
            .ancestors()
            .filter(|n| *n != self.root())
            .take(6)
            .map(|n| match n.attribute("id").or(n.attribute("sid")) {
                Some(id) => format!("{} \"{}\"", n.name(), shown(id.as_bytes())),
                None => n.name().to_string(),
            })
            .collect();
        parts.reverse();
        format!("{} (line {})", parts.join("/"), node.line())
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

    /// What an instance (`instance_camera`, `instance_light` …) refers to, an element of this kind. A reference to nothing, or to
    /// something else, is a warning that ends with what is done instead.
    pub fn instanced(
        &self,
        instance: Node<'a, 'i>,
        url: &str,
        kind: &str,
        instead: &str,
    ) -> Option<Node<'a, 'i>> {
        match self.follow(instance, url) {
            Ok(node) if name_of(node) == kind => return Some(node),
            Ok(node) => {
                self.warn(instance, format!("refers to a {}, not a {kind}; {instead}", name_of(node)));
            }
            Err(problem) => self.notes.warn(problem.place, format!("{}; {instead}", problem.what)),
        }
        None
    }

    /// The numbers of an element's text.
    pub fn numbers(&self, node: Node<'a, 'i>) -> Result<Vec<f64>> {
        let values = self.values(node, |rest| Some(next_number(rest)?.map(Some)))?;
        values.map_err(|(index, word)| self.bad(node, index, word, "a finite number"))
    }

    /// The same as 32-bit floats: positions of big meshes take half.
    pub fn floats(&self, node: Node<'a, 'i>) -> Result<Vec<f32>> {
        let values = self.values(node, |rest| {
            Some(next_number(rest)?.map(|v| Some(v as f32).filter(|v| v.is_finite())))
        })?;
        values.map_err(|(index, word)| self.bad(node, index, word, "a finite number"))
    }

    /// Whole numbers from −1 (which skins use) on.
    pub fn integers(&self, node: Node<'a, 'i>) -> Result<Vec<i32>> {
        let values = self.values(node, |rest| {
            Some(next_integer(rest)?.map(|v| i32::try_from(v).ok().filter(|v| *v >= -1)))
        })?;
        values.map_err(|(index, word)| self.bad(node, index, word, "an index"))
    }

    /// Every value of an element's text, or the one that is none, with its number. `next` takes one off: `None` inside is a
    /// number that is no such value.
    #[inline(always)]
    fn values<T>(
        &self,
        node: Node<'a, 'i>,
        next: impl Fn(&mut &'a [u8]) -> Option<std::result::Result<Option<T>, &'a [u8]>>,
    ) -> Result<Values<'a, T>> {
        // Nearly all of a file are lists like this, read about in its order.
        self.progress.reach(node.start())?;
        let mut rest = node.text().as_bytes();
        // A value has at least a digit and a space, and mostly three digits.
        let announced = node.attribute("count").and_then(|c| c.parse().ok()).unwrap_or(rest.len() / 4);
        let mut out = Vec::with_capacity(rest.len().div_ceil(2).min(announced));
        loop {
            let from = rest;
            match next(&mut rest) {
                None => break,
                Some(Ok(Some(value))) => out.push(value),
                Some(Ok(None)) => return Ok(Err((out.len(), from[..from.len() - rest.len()].trim_ascii()))),
                Some(Err(word)) => return Ok(Err((out.len(), word))),
            }
        }
        self.charge(node, out.len(), size_of::<T>())?;
        Ok(Ok(out))
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
}

/// Child elements with a name.
pub fn children<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |n| n.name() == name)
}

pub fn child<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

/// The first element of this name at any depth below.
pub fn descendant<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> Option<Node<'a, 'i>> {
    node.descendants().skip(1).find(|n| n.name() == name)
}

pub fn name_of<'a>(node: Node<'a, '_>) -> &'a str {
    node.name()
}

/// The element's text without white space around.
pub fn text_of<'a>(node: Node<'a, '_>) -> &'a str {
    node.text().trim()
}
