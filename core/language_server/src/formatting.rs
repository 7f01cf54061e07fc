//! Formatting of a document, or of some of its lines.

use crate::view::View;
use choreo_script::format::edits;
use serde_json::{Value, json};

/// Edits that format the document, or only the lines in `range`. `null` if the text has errors; diagnostics show them.
pub(crate) fn formatting(view: &View, range: Option<&Value>) -> Value {
    let source = view.source;
    let Ok(edits) = edits(&source.text) else { return Value::Null };
    let lines = range.map(|range| {
        let bytes = source.lines.bytes_of_range(&source.text, range);
        // A range that ends at the start of a line does not include that line.
        let end = source.lines.line_of(bytes.end.saturating_sub(1).max(bytes.start));
        source.lines.line_of(bytes.start)..=end
    });
    // White space belongs to the token after it.
    let is_meant = |end: usize| lines.as_ref().is_none_or(|lines| lines.contains(&source.lines.line_of(end)));
    let edits = edits.iter().filter(|edit| is_meant(edit.range.end));
    edits.map(|edit| json!({ "range": source.range(&edit.range), "newText": edit.text })).collect()
}
