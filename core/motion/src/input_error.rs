//! The error of a job's `check()`.

/// An input field whose length or value is invalid; the text names the field, its content and what is allowed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum InputError {
    Length { field: &'static str, length: usize, expected: usize },
    Value { field: String, value: String, allowed: &'static str },
    Joint { field: &'static str, at: usize, index: usize, count: usize },
    Nested { field: &'static str, error: String },
}

crate::error_texts! { InputError:
    Self::Length { field, length, expected } => "`{field}` has length {length}, must have length {expected}";
    Self::Value { field, value, allowed } => "`{field}` is {value}, must be {allowed}";
    Self::Joint { field, at, index, count } => "`{field}[{at}]` is {index}, the number of joints is {count}";
    Self::Nested { field, error } => "`{field}`: {error}";
}

impl InputError {
    /// Fails at the first field whose length is not the expected one. `fields`: (field, length, expected).
    pub(crate) fn check_lengths(fields: &[(&'static str, usize, usize)]) -> Result<(), InputError> {
        match fields.iter().copied().find(|(_, length, expected)| length != expected) {
            Some((field, length, expected)) => Err(InputError::Length { field, length, expected }),
            None => Ok(()),
        }
    }

    /// Fails unless `valid`.
    pub(crate) fn check_value(
        valid: bool,
        field: &str,
        value: impl ToString,
        allowed: &'static str,
    ) -> Result<(), InputError> {
        match valid {
            true => Ok(()),
            false => Err(InputError::Value { field: field.into(), value: value.to_string(), allowed }),
        }
    }

    /// Fails at the first number of `list` that is not valid.
    pub(crate) fn check_each(
        list: &[f32],
        valid: impl Fn(&f32) -> bool,
        field: &str,
        allowed: &'static str,
    ) -> Result<(), InputError> {
        match list.iter().position(|v| !valid(v)) {
            Some(at) => Self::check_value(false, &format!("{field}[{at}]"), list[at], allowed),
            None => Ok(()),
        }
    }

    /// Fails at the first joint index of `list` that is not below `count`.
    pub(crate) fn check_joints(
        mut list: impl Iterator<Item = usize>,
        field: &'static str,
        count: usize,
    ) -> Result<(), InputError> {
        let beyond = list.by_ref().enumerate().find(|(_, index)| *index >= count);
        beyond.map_or(Ok(()), |(at, index)| Err(InputError::Joint { field, at, index, count }))
    }
}
