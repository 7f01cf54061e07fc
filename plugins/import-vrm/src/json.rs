//! JSON values with their places, for error messages.

use choreo_importer_kit::{Problem, Result};
use glam::Vec3;
use serde_json::Value;

/// A value and its place: `extensions.VRMC_vrm.humanoid.humanBones.hips`.
#[derive(Clone, Debug)]
pub(crate) struct At<'a> {
    value: &'a Value,
    place: String,
}

impl<'a> At<'a> {
    pub(crate) fn new(value: &'a Value, place: String) -> At<'a> {
        At { value, place }
    }

    pub(crate) fn raw(&self) -> &'a Value {
        self.value
    }

    pub(crate) fn place(&self) -> String {
        self.place.clone()
    }

    pub(crate) fn place_of(&self, key: &str) -> String {
        format!("{}.{key}", self.place)
    }

    fn wrong(&self, key: &str, what: &str) -> Problem {
        Problem::new(self.place_of(key), what)
    }

    /// A member of an object. `null` counts as absent, because writers use it so.
    fn value(&self, key: &str) -> Option<&'a Value> {
        self.value.get(key).filter(|v| !v.is_null())
    }

    pub(crate) fn get(&self, key: &str) -> Option<At<'a>> {
        Some(At { value: self.value(key)?, place: self.place_of(key) })
    }

    /// A member, or `null` where it is absent, which has no members itself.
    pub(crate) fn part(&self, key: &str) -> At<'a> {
        self.get(key).unwrap_or(At { value: &Value::Null, place: self.place_of(key) })
    }

    /// Elements of an array; none where the array is absent.
    pub(crate) fn list(&self, key: &str) -> Result<impl Iterator<Item = At<'a>> + use<'a>> {
        let elements = match self.value(key) {
            None => &[],
            Some(v) => v.as_array().map(Vec::as_slice).ok_or_else(|| self.wrong(key, "must be an array"))?,
        };
        let place = self.place_of(key);
        Ok(elements.iter().enumerate().map(move |(i, value)| At { value, place: format!("{place}[{i}]") }))
    }

    /// Members of an object, by name; none where the object is absent.
    pub(crate) fn members(&self, key: &str) -> Result<impl Iterator<Item = (&'a str, At<'a>)> + use<'a>> {
        let object = match self.value(key) {
            None => None,
            Some(v) => Some(v.as_object().ok_or_else(|| self.wrong(key, "must be an object"))?),
        };
        let place = self.place_of(key);
        let members = object.into_iter().flatten();
        Ok(members.map(move |(name, value)| (name.as_str(), At { value, place: format!("{place}.{name}") })))
    }

    pub(crate) fn number(&self, key: &str) -> Result<Option<f32>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        match value.as_f64().map(|v| v as f32).filter(|v| v.is_finite()) {
            Some(v) => Ok(Some(v)),
            None => Err(self.wrong(key, "must be a finite number")),
        }
    }

    pub(crate) fn number_or(&self, key: &str, default: f32) -> Result<f32> {
        Ok(self.number(key)?.unwrap_or(default))
    }

    pub(crate) fn flag(&self, key: &str) -> Result<Option<bool>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        value.as_bool().map(Some).ok_or_else(|| self.wrong(key, "must be true or false"))
    }

    pub(crate) fn text(&self, key: &str) -> Option<&'a str> {
        self.value(key)?.as_str()
    }

    /// The strings of this array, at most 1000; `None` where the value is no array.
    pub(crate) fn as_texts(&self) -> Option<Vec<&'a str>> {
        self.value.as_array().map(|list| list.iter().take(1000).filter_map(Value::as_str).collect())
    }

    /// The first `N` numbers of an array, as VRM 0.x stores colors and tilings.
    pub(crate) fn first<const N: usize>(&self, key: &str) -> Result<Option<[f32; N]>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let mut out = [0.0f32; N];
        for (i, slot) in out.iter_mut().enumerate() {
            let number = value.get(i).and_then(Value::as_f64).map(|v| v as f32).filter(|v| v.is_finite());
            *slot = number.ok_or_else(|| self.wrong(key, &format!("must be {N} finite numbers or more")))?;
        }
        Ok(Some(out))
    }

    /// An index into a list of the file; `None` for −1, as VRM 0.x writes it. VRM 0.x writers also store indices as floats.
    pub(crate) fn index(&self, key: &str) -> Result<Option<usize>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        self.as_index(value, || self.place_of(key))
    }

    /// The value itself as an index; `None` for −1.
    pub(crate) fn own_index(&self) -> Result<Option<usize>> {
        self.as_index(self.value, || self.place())
    }

    fn as_index(&self, value: &Value, place: impl Fn() -> String) -> Result<Option<usize>> {
        let number = value.as_f64().filter(|v| v.fract() == 0.0 && (-1.0..4_294_967_295.0).contains(v));
        match number {
            Some(-1.0) => Ok(None),
            Some(v) => Ok(Some(v as usize)),
            None => Err(Problem::new(place(), "must be an index, a whole number from 0")),
        }
    }

    pub(crate) fn needed_index(&self, key: &str) -> Result<usize> {
        self.index(key)?.ok_or_else(|| self.wrong(key, "is missing"))
    }

    /// A vector `[x, y, z]`, or `{ "x": …, "y": …, "z": … }` as in VRM 0.x, where missing components are 0.
    pub(crate) fn vec3(&self, key: &str) -> Result<Option<Vec3>> {
        let Some(value) = self.value(key) else { return Ok(None) };
        let component = |i: usize| match value {
            Value::Array(list) if list.len() == 3 => list[i].as_f64(),
            Value::Object(object) => match object.get(["x", "y", "z"][i]) {
                None => Some(0.0),
                Some(v) => v.as_f64(),
            },
            _ => None,
        };
        let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(component) else {
            return Err(self.wrong(key, "must be three numbers"));
        };
        let v = Vec3::new(x as f32, y as f32, z as f32);
        if v.is_finite() { Ok(Some(v)) } else { Err(self.wrong(key, "must be finite")) }
    }

    pub(crate) fn vec3_or(&self, key: &str, default: Vec3) -> Result<Vec3> {
        Ok(self.vec3(key)?.unwrap_or(default))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_are_checked_and_errors_name_the_place() {
        let value = json!({ "n": 1.5, "i": 3, "f": 3.0, "none": -1, "v": [1, 2, 3], "o": { "x": 1, "z": 2 },
            "l": [{ "a": 1 }, { "a": true }], "nothing": null, "text": "x" });
        let at = At::new(&value, "root".into());
        assert_eq!((at.number("n").unwrap(), at.number("nothing").unwrap()), (Some(1.5), None));
        assert_eq!(
            (at.index("i").unwrap(), at.index("f").unwrap(), at.index("none").unwrap()),
            (Some(3), Some(3), None)
        );
        assert_eq!(at.vec3("v").unwrap(), Some(Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(at.vec3("o").unwrap(), Some(Vec3::new(1.0, 0.0, 2.0)));
        let second = at.list("l").unwrap().nth(1).unwrap();
        let text = |p: Problem| format!("{}: {}", p.place, p.what);
        assert_eq!(text(second.number("a").unwrap_err()), "root.l[1].a: must be a finite number");
        assert_eq!(text(at.index("n").unwrap_err()), "root.n: must be an index, a whole number from 0");
        assert_eq!(text(at.vec3("text").unwrap_err()), "root.text: must be three numbers");
        assert_eq!(text(at.list("n").map(|_| ()).unwrap_err()), "root.n: must be an array");
        assert_eq!(text(at.needed_index("none").unwrap_err()), "root.none: is missing");
        assert!(
            at.list("missing").unwrap().next().is_none() && at.members("missing").unwrap().next().is_none()
        );
    }
}
