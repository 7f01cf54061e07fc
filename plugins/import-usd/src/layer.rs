//! A layer as data: prims with attributes, relationships and composition arcs, before composition.

use std::collections::BTreeMap;
use std::sync::Arc;

/// A value: the numbers of a scalar, vector, matrix or array in one list, or texts (tokens, strings, asset paths). Quaternions
/// are x, y, z, w.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Numbers(Arc<[f64]>),
    Texts(Arc<[String]>),
}

impl Value {
    pub(crate) fn numbers(&self) -> &[f64] {
        match self {
            Value::Numbers(list) => list,
            Value::Texts(_) => &[],
        }
    }

    pub(crate) fn texts(&self) -> &[String] {
        match self {
            Value::Numbers(_) => &[],
            Value::Texts(list) => list,
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Attribute {
    /// Type name, `float3[]`.
    pub kind: String,
    pub value: Option<Value>,
    /// Time samples by increasing time code.
    pub samples: Vec<(f64, Value)>,
    pub interpolation: String,
    pub element_size: usize,
}

/// A reference or payload.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Reference {
    /// Asset path; empty for the same layer stack.
    pub file: String,
    /// Prim path; empty for the default prim.
    pub path: String,
    pub offset: f64,
    pub scale: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Specifier {
    #[default]
    Over,
    Def,
    Class,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Prim {
    pub name: String,
    pub specifier: Specifier,
    /// Schema type, "Mesh"; empty where the prim has none.
    pub kind: String,
    pub display_name: String,
    pub inactive: bool,
    pub references: Vec<Reference>,
    /// Paths of prims that it inherits from or specializes, strongest first.
    pub classes: Vec<String>,
    /// Selected variant of each variant set.
    pub selections: BTreeMap<String, String>,
    /// Variants by variant set and name.
    pub variants: BTreeMap<String, BTreeMap<String, Prim>>,
    pub attributes: BTreeMap<String, Arc<Attribute>>,
    /// Paths of the outputs that drive attributes, by attribute.
    pub connections: BTreeMap<String, Vec<String>>,
    pub relations: BTreeMap<String, Vec<String>>,
    pub children: Vec<Prim>,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Layer {
    pub up_axis: Option<String>,
    pub metres_per_unit: Option<f64>,
    pub time_codes_per_second: Option<f64>,
    pub start_time_code: Option<f64>,
    pub default_prim: String,
    pub comment: String,
    pub sublayers: Vec<String>,
    /// The pseudo-root, whose children are the root prims.
    pub root: Prim,
}

impl Prim {
    pub(crate) fn child(&self, name: &str) -> Option<&Prim> {
        self.children.iter().find(|child| child.name == name)
    }

    /// The prim at an absolute path, `/a/b`.
    pub(crate) fn at(&self, path: &str) -> Option<&Prim> {
        path.split('/').filter(|name| !name.is_empty()).try_fold(self, |prim, name| prim.child(name))
    }

    /// The numbers of an attribute; `None` where it has none.
    pub(crate) fn numbers(&self, name: &str) -> Option<&[f64]> {
        self.value(name).map(Value::numbers).filter(|list| !list.is_empty())
    }

    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).map(|list| list[0])
    }

    pub(crate) fn texts(&self, name: &str) -> &[String] {
        self.value(name).map(Value::texts).unwrap_or_default()
    }

    pub(crate) fn text(&self, name: &str) -> &str {
        self.texts(name).first().map_or("", String::as_str)
    }

    /// The default value, or else the first sample.
    pub(crate) fn value(&self, name: &str) -> Option<&Value> {
        let attribute = self.attributes.get(name)?;
        attribute.value.as_ref().or_else(|| attribute.samples.first().map(|(_, value)| value))
    }

    pub(crate) fn targets(&self, name: &str) -> &[String] {
        self.relations.get(name).map(Vec::as_slice).unwrap_or_default()
    }
}
