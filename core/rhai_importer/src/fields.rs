//! Object maps of a script, `#{ positions: …, normals: … }`, as the values that the asset is built from.

use crate::budget::{NativeError, native_error};
use crate::numbers;
use choreo_asset::Topology;
use choreo_plugin::suggest::{did_you_mean, list};
use choreo_plugin::{MeshData, MeshPart, MorphData};
use choreo_sandbox::type_word;
use glam::Vec4;
use rhai::{Dynamic, Map};

/// An object map whose keys are checked. Every error names the function and the field.
pub(crate) struct Fields<'a> {
    what: &'a str,
    map: &'a Map,
}

/// Error message about an object map: it names the function and the field.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct FieldError(String);

pub(crate) type Result<T> = std::result::Result<T, FieldError>;

impl From<String> for FieldError {
    fn from(text: String) -> FieldError {
        FieldError(text)
    }
}

impl From<&str> for FieldError {
    fn from(text: &str) -> FieldError {
        FieldError(text.into())
    }
}

impl From<FieldError> for NativeError {
    fn from(error: FieldError) -> NativeError {
        native_error(error.0)
    }
}

/// A value as messages show it: a number or flag itself, any other value by its type.
fn value_or_type_name(value: &Dynamic) -> String {
    match value.is_int() || value.is_float() || value.is_bool() {
        true => value.to_string(),
        false => type_word(value.type_name()).to_string(),
    }
}

impl<'a> Fields<'a> {
    /// Refuses names that are not in `known`.
    pub(crate) fn new(what: &'a str, map: &'a Map, known: &[&str]) -> Result<Fields<'a>> {
        match map.keys().find(|k| !known.contains(&k.as_str())) {
            None => Ok(Fields { what, map }),
            Some(key) => {
                let near = did_you_mean(key, known.iter().copied());
                let known = list(known.iter().copied(), 30);
                Err(format!("{what}: unknown field \"{key}\"{near}; known fields: {known}").into())
            }
        }
    }

    fn wrong_type<T>(&self, name: &str, expected: &str, got: &Dynamic) -> Result<T> {
        Err(format!("{}: {name} must be {expected}, got {}", self.what, value_or_type_name(got)).into())
    }

    /// Value of a field; `None` if it is missing or `()`.
    pub(crate) fn value(&self, name: &str) -> Option<&'a Dynamic> {
        self.map.get(name).filter(|v| !v.is_unit())
    }

    /// Text of a field. Error: another type.
    pub(crate) fn text(&self, name: &str) -> Result<Option<String>> {
        let Some(value) = self.value(name) else { return Ok(None) };
        match value.clone().into_string() {
            Ok(text) => Ok(Some(text)),
            Err(_) => self.wrong_type(name, "a text", value),
        }
    }

    /// Number of a field, int or float. Error: another type.
    pub(crate) fn number(&self, name: &str) -> Result<Option<f64>> {
        let Some(value) = self.value(name) else { return Ok(None) };
        match value.as_float().or_else(|_| value.as_int().map(|i| i as f64)) {
            Ok(number) => Ok(Some(number)),
            Err(_) => self.wrong_type(name, "a number", value),
        }
    }

    /// Flag of a field. Error: another type.
    pub(crate) fn flag(&self, name: &str) -> Result<Option<bool>> {
        let Some(value) = self.value(name) else { return Ok(None) };
        value.as_bool().map(Some).or_else(|_| self.wrong_type(name, "true or false", value))
    }

    /// Index of a joint, material or image, as `joint(…)`, `material(…)` or `image(…)` returned it.
    pub(crate) fn index(&self, name: &str) -> Result<Option<u32>> {
        let Some(value) = self.value(name) else { return Ok(None) };
        match value.as_int().ok().and_then(|i| u32::try_from(i).ok()) {
            Some(index) => Ok(Some(index)),
            None => self.wrong_type(name, "a number that joint(…), material(…) or image(…) returned", value),
        }
    }

    /// [`Fields::index`] for which a negative number means "none", as many formats write it.
    pub(crate) fn optional_index(&self, name: &str) -> Result<Option<u32>> {
        match self.value(name).and_then(|value| value.as_int().ok()) {
            Some(negative) if negative < 0 => Ok(None),
            _ => self.index(name),
        }
    }

    /// Flat list of the numbers of a `Numbers`, an array of numbers, or an array of arrays of numbers; empty without the field.
    pub(crate) fn numbers(&self, name: &str) -> Result<Vec<f64>> {
        let Some(value) = self.value(name) else { return Ok(Vec::new()) };
        if let Some(numbers) = numbers::read_numbers(value) {
            return Ok(numbers);
        }
        let rows = value.read_lock::<rhai::Array>();
        let flat: Option<Vec<f64>> = rows.and_then(|rows| {
            let rows: Option<Vec<Vec<f64>>> = rows.iter().map(numbers::read_numbers).collect();
            rows.map(|r| r.concat())
        });
        flat.ok_or(()).or_else(|()| self.wrong_type(name, "numbers, or an array of numbers", value))
    }

    /// [`Fields::numbers`] as f32.
    pub(crate) fn floats(&self, name: &str) -> Result<Vec<f32>> {
        Ok(self.numbers(name)?.into_iter().map(|v| v as f32).collect())
    }

    /// Linear RGBA color from 3 or 4 linear numbers, a CSS name or a hexadecimal color.
    pub(crate) fn color(&self, name: &str) -> Result<Option<Vec4>> {
        let Some(value) = self.value(name) else { return Ok(None) };
        if let Ok(text) = value.clone().into_string() {
            let color = choreo_plugin::color::parse(&text);
            return color.map(Some).map_err(|e| format!("{}: {name}: {}", self.what, e.message).into());
        }
        match self.floats(name)?.as_slice() {
            [r, g, b] => Ok(Some(Vec4::new(*r, *g, *b, 1.0))),
            [r, g, b, a] => Ok(Some(Vec4::new(*r, *g, *b, *a))),
            other => Err(format!("{}: {name} must be 3 or 4 numbers, got {}", self.what, other.len()).into()),
        }
    }

    /// Flat list of whole numbers from 0, such as vertex indices; empty without the field. Error: a number is not one.
    pub(crate) fn indices(&self, name: &str) -> Result<Vec<u32>> {
        let numbers = self.numbers(name)?;
        let whole = |(at, v): (usize, &f64)| match f64::from(*v as u32) == *v {
            true => Ok(*v as u32),
            false => Err(format!("{}: {name}[{at}] is {v}, must be a whole number from 0", self.what).into()),
        };
        numbers.iter().enumerate().map(whole).collect()
    }

    /// Converts an array of object maps by `read`. The maps may have the keys `known`. Empty without the field.
    pub(crate) fn maps<T>(
        &self,
        name: &str,
        known: &[&str],
        read: impl Fn(&Fields<'_>) -> Result<T>,
    ) -> Result<Vec<T>> {
        let Some(value) = self.value(name) else { return Ok(Vec::new()) };
        let Some(array) = value.read_lock::<rhai::Array>() else {
            return self.wrong_type(name, "an array of object maps", value);
        };
        let element = |(at, value): (usize, &Dynamic)| {
            let what = format!("{}: {name}[{at}]", self.what);
            let map = value.read_lock::<Map>();
            let map = map
                .ok_or_else(|| format!("{what} must be an object map, got {}", value_or_type_name(value)))?;
            read(&Fields::new(&what, &map, known)?)
        };
        array.iter().enumerate().map(element).collect()
    }

    /// Exactly `N` numbers.
    pub(crate) fn vector<const N: usize>(&self, name: &str) -> Result<Option<[f32; N]>> {
        let Some(value) = self.value(name) else { return Ok(None) };
        let numbers = self.floats(name)?;
        numbers
            .try_into()
            .map(Some)
            .or_else(|_| self.wrong_type(name, &format!("an array of {N} numbers"), value))
    }
}

/// The options of `mesh(#{ … })`, `lines(#{ … })` and `points(#{ … })`.
pub(crate) const MESH_FIELDS: &[&str] = &[
    "name",
    "joint",
    "positions",
    "indices",
    "normals",
    "uvs",
    "colors",
    "joints",
    "weights",
    "inverse_bind",
    "material",
    "parts",
    "morphs",
];

/// The arrays of a `mesh(#{ … })`, `lines(#{ … })` or `points(#{ … })` call.
pub(crate) fn mesh_data(f: &Fields<'_>, topology: Topology) -> Result<MeshData> {
    Ok(MeshData {
        topology,
        name: f.text("name")?.unwrap_or_default(),
        joint: f.optional_index("joint")?,
        positions: f.floats("positions")?,
        indices: f.indices("indices")?,
        normals: f.floats("normals")?,
        uvs: f.floats("uvs")?,
        colors: f.floats("colors")?,
        joints: f.indices("joints")?,
        weights: f.floats("weights")?,
        inverse_bind: f.floats("inverse_bind")?,
        material: f.optional_index("material")?,
        parts: f.maps("parts", &["indices", "material"], |f| {
            Ok(MeshPart { indices: f.indices("indices")?, material: f.optional_index("material")? })
        })?,
        morphs: f.maps("morphs", &["name", "positions", "normals"], |f| {
            let name = f.text("name")?.unwrap_or_default();
            Ok(MorphData { name, positions: f.floats("positions")?, normals: f.floats("normals")? })
        })?,
    })
}
