//! The error type of importers: what went wrong and where, before the file's name is added.

use choreo_plugin::ImportError;

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {what}")]
pub struct Problem {
    /// The element of the file. Empty if only the caller knows the element; the caller then adds it by [`WithPlace::at`].
    pub place: String,
    pub what: String,
    pub hint: Option<String>,
}

pub type Result<T> = std::result::Result<T, Problem>;

impl Problem {
    pub fn new(place: impl Into<String>, what: impl Into<String>) -> Problem {
        Problem { place: place.into(), what: what.into(), hint: None }
    }

    pub fn hint(mut self, hint: impl Into<String>) -> Problem {
        self.hint = Some(hint.into());
        self
    }

    /// Adds the element that refers to the failing one: `meshes[0].primitives[1].NORMAL (accessors[7])`.
    pub fn used_by(mut self, user: String) -> Problem {
        self.place = if self.place.is_empty() { user } else { format!("{user} ({})", self.place) };
        self
    }

    pub fn in_file(self, file: &str) -> ImportError {
        ImportError { file: file.to_string(), place: self.place, what: self.what, hint: self.hint }
    }
}

impl From<String> for Problem {
    fn from(what: String) -> Problem {
        Problem::new("", what)
    }
}

impl From<&str> for Problem {
    fn from(what: &str) -> Problem {
        Problem::new("", what)
    }
}

/// Adds the place to an error.
pub trait WithPlace<T> {
    fn at(self, place: impl FnOnce() -> String) -> Result<T>;
}

impl<T, E: Into<Problem>> WithPlace<T> for std::result::Result<T, E> {
    fn at(self, place: impl FnOnce() -> String) -> Result<T> {
        self.map_err(|error| error.into().used_by(place()))
    }
}

/// Element of a list in the file, by its index. The error names the list and its last element.
pub fn element<'a, T>(
    list: &'a [T],
    index: usize,
    list_name: &str,
    user: impl Fn() -> String,
) -> Result<&'a T> {
    list.get(index).ok_or_else(|| {
        let what = match list.len() {
            0 => format!("refers to {list_name}[{index}], but the file has no {list_name}"),
            n => format!("refers to {list_name}[{index}], but the last is {list_name}[{}]", n - 1),
        };
        Problem::new(user(), what)
    })
}
