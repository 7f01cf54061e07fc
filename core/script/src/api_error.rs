//! An error in a call of a script, and its place.

use crate::diagnostic::Diagnostic;
use crate::folders::LoadError;

/// A place in a script file.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    pub file: String,
    pub line: usize,
    pub column: usize,
}

/// An error in a call, without its place. The interpreter throws it as a value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ApiError {
    pub message: String,
    pub hint: Option<String>,
    /// The string literal that the caret points at, if one argument is at fault.
    pub focus: Option<String>,
    /// The error follows from one that is already reported, so it is not shown.
    pub silent: bool,
    /// The error ends the script at once, because the next statements would only repeat it.
    pub fatal: bool,
    /// Rule of a warning that the comment `// allow: RULE` silences; empty if no comment can.
    pub rule: &'static str,
}

impl ApiError {
    pub(crate) fn new(message: impl Into<String>) -> ApiError {
        ApiError { message: message.into(), hint: None, focus: None, silent: false, fatal: false, rule: "" }
    }
    /// An error that follows from one that is already reported, so it is not shown.
    pub(crate) fn silent() -> ApiError {
        ApiError { silent: true, ..ApiError::new("") }
    }
    pub(crate) fn hint(mut self, hint: impl Into<String>) -> ApiError {
        self.hint = Some(hint.into());
        self
    }
    /// Sets the rule of the warning. The hint states the comment that silences it.
    pub(crate) fn rule(mut self, rule: &'static str) -> ApiError {
        let how = format!("if it is intended, write // allow: {rule} in the line above");
        self.hint = Some(self.hint.map_or(how.clone(), |hint| format!("{hint}; {how}")));
        self.rule = rule;
        self
    }
    pub(crate) fn focus(mut self, literal: impl Into<String>) -> ApiError {
        self.focus = Some(literal.into());
        self
    }
}

impl From<String> for ApiError {
    fn from(message: String) -> ApiError {
        ApiError::new(message)
    }
}

impl From<LoadError> for ApiError {
    fn from(e: LoadError) -> ApiError {
        ApiError { hint: e.hint, ..ApiError::new(e.message) }
    }
}

/// The diagnostic of an error, without a place.
impl From<ApiError> for Diagnostic {
    fn from(e: ApiError) -> Diagnostic {
        Diagnostic { hint: e.hint, ..Diagnostic::error(e.message) }
    }
}
