//! `<source>` with its accessor, and the inputs that refer to sources.

use crate::xml::Node;
use crate::xml::{Xml, child, children, name_of, texts};
use choreo_importer_kit::Result;

/// Floats of a source, with the accessor's layout.
pub(crate) struct Floats {
    pub values: Vec<f32>,
    pub offset: usize,
    pub stride: usize,
    pub count: usize,
}

impl Floats {
    /// The first `N` numbers of an element; missing ones are zero.
    pub(crate) fn get<const N: usize>(&self, index: usize) -> [f32; N] {
        let start = self.offset + index * self.stride;
        std::array::from_fn(|i| {
            if i < self.stride { self.values.get(start + i).copied().unwrap_or(0.0) } else { 0.0 }
        })
    }
}

/// Offset, stride and count of the accessor. Fails where the array is too short for them.
fn layout(
    xml: &Xml<'_>,
    source: Node<'_>,
    length: usize,
    default_stride: usize,
) -> Result<(usize, usize, usize)> {
    let accessor = child(source, "technique_common").and_then(|t| child(t, "accessor"));
    let read = |name: &str, default: usize| -> Result<usize> {
        match accessor.and_then(|a| a.attribute(name)) {
            None => Ok(default),
            Some(text) => text.trim().parse().map_err(|_| {
                xml.problem(accessor.unwrap_or(source), format!("{name}=\"{text}\" is not a whole number"))
            }),
        }
    };
    // The schema's default stride is 1, but some exporters omit it where the params imply more.
    let stride = read("stride", default_stride)?.max(1);
    let offset = read("offset", 0)?;
    let room = length.saturating_sub(offset) / stride;
    let count = read("count", room)?;
    if count > room {
        let what =
            format!("announces {count} elements of {stride} values, but the array has room for {room}");
        return Err(xml.problem(accessor.unwrap_or(source), what));
    }
    Ok((offset, stride, count))
}

pub(crate) fn floats(xml: &Xml<'_>, source: Node<'_>, default_stride: usize) -> Result<Floats> {
    let Some(array) = child(source, "float_array") else {
        return Err(xml.problem(source, "has no float_array"));
    };
    let values = xml.floats(array)?;
    let (offset, stride, count) = layout(xml, source, values.len(), default_stride)?;
    Ok(Floats { values, offset, stride, count })
}

/// Numbers of a source in f64, and the stride: for times, matrices and tangents.
pub(crate) fn doubles(xml: &Xml<'_>, source: Node<'_>, default_stride: usize) -> Result<(Vec<f64>, usize)> {
    let Some(array) = child(source, "float_array") else {
        return Err(xml.problem(source, "has no float_array"));
    };
    let mut values = xml.numbers(array)?;
    let (offset, stride, count) = layout(xml, source, values.len(), default_stride)?;
    if offset > 0 {
        values.drain(..offset);
    }
    values.truncate(count * stride);
    Ok((values, stride))
}

/// The words of a Name_array or IDREF_array, and whether they are ids.
pub(crate) fn names<'a>(xml: &Xml<'_>, source: Node<'a>) -> Result<(Vec<&'a str>, bool)> {
    let array =
        child(source, "Name_array").map(|a| (a, false)).or(child(source, "IDREF_array").map(|a| (a, true)));
    let Some((array, ids)) = array else {
        return Err(xml.problem(source, "has neither Name_array nor IDREF_array"));
    };
    let names: Vec<&str> = texts(array).flat_map(str::split_ascii_whitespace).collect();
    xml.charge(array, names.len(), 16)?;
    let (offset, stride, count) = layout(xml, source, names.len(), 1)?;
    Ok((names.into_iter().skip(offset).step_by(stride).take(count).collect(), ids))
}

/// One `<input>`.
#[derive(Clone, Copy)]
pub(crate) struct Input<'a> {
    pub semantic: &'a str,
    pub source: Node<'a>,
    pub offset: usize,
    pub set: usize,
}

/// Largest input offset, far more than any vertex format needs.
const MAX_OFFSET: usize = 255;

/// The inputs of an element. `VERTEX` is replaced by the inputs of `<vertices>`, at its offset.
pub(crate) fn inputs<'a>(xml: &Xml<'a>, element: Node<'a>) -> Result<Vec<Input<'a>>> {
    let mut out = Vec::new();
    for input in children(element, "input") {
        let number = |name: &str, default: usize| match input.attribute(name) {
            None => Ok(default),
            Some(text) => text.trim().parse().ok().filter(|n| *n <= MAX_OFFSET).ok_or_else(|| {
                xml.problem(input, format!("{name}=\"{text}\" is not a number from 0 to {MAX_OFFSET}"))
            }),
        };
        // Inputs without an offset (of vertices, joints and samplers) share one stream.
        let offset = number("offset", 0)?;
        let set = number("set", 0)?;
        let semantic = input.attribute("semantic").unwrap_or_default();
        let source = xml.resolve_reference(input, "source")?;
        if semantic == "VERTEX" && name_of(source) == "vertices" {
            for inner in children(source, "input") {
                let semantic = inner.attribute("semantic").unwrap_or_default();
                out.push(Input { semantic, source: xml.resolve_reference(inner, "source")?, offset, set });
            }
        } else {
            out.push(Input { semantic, source, offset, set });
        }
    }
    Ok(out)
}
