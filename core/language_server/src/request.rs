//! Parameters of a request about a document, for the functions that answer it.

use crate::checker::CheckResult;
use crate::settings::Settings;
use crate::view::View;
use serde_json::Value;

/// A request about a document.
pub(crate) struct Request<'r> {
    pub view: &'r View<'r>,
    pub uri: &'r str,
    pub parameters: &'r Value,
    /// Result of the last run of the script.
    pub last: Option<&'r CheckResult>,
    pub settings: &'r Settings,
}

impl Request<'_> {
    /// Byte of the requested position.
    pub(crate) fn byte(&self) -> usize {
        let source = self.view.source;
        source.lines.byte(&source.text, &self.parameters["position"])
    }
}
