//! What went wrong and where, before the file's name is known to it.

use choreo_plugin::ImportError;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
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

    /// Says for which element the failing one was read: "meshes[0].primitives[1].NORMAL (accessors[7])".
    pub fn used_by(mut self, user: String) -> Problem {
        self.place = if self.place.is_empty() { user } else { format!("{user} ({})", self.place) };
        self
    }

    pub fn in_file(self, file: &str) -> ImportError {
        ImportError { file: file.to_string(), place: self.place, what: self.what, hint: self.hint }
    }
}

/// Looks up an index of the file, or says which list is too short.
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
