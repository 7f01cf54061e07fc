//! Positions in a text: bytes in the server, lines and UTF-16 columns in the protocol, lines and character columns in diagnostics.

use serde_json::{Value, json};
use std::ops::Range;

/// Byte offset of the start of each line.
#[derive(Clone, Debug)]
pub(crate) struct Lines {
    starts: Vec<usize>,
}

impl Lines {
    pub(crate) fn new(text: &str) -> Lines {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1));
        Lines { starts: starts.collect() }
    }

    pub(crate) fn count(&self) -> usize {
        self.starts.len()
    }

    /// Line of a byte, from 0.
    pub(crate) fn line_of(&self, byte: usize) -> usize {
        self.starts.partition_point(|start| *start <= byte).saturating_sub(1)
    }

    /// Bytes of a line without its line break; an empty range after the last line.
    pub(crate) fn bytes_of_line(&self, text: &str, line: usize) -> Range<usize> {
        let start = self.starts.get(line).copied().unwrap_or(text.len());
        let end = self.starts.get(line + 1).copied().unwrap_or(text.len());
        start..start + text[start..end].trim_end_matches(['\n', '\r']).len()
    }

    /// Byte of a position of the protocol. A column after the end of the line means its end, as the protocol demands.
    pub(crate) fn byte(&self, text: &str, position: &Value) -> usize {
        let number = |name: &str| position[name].as_u64().unwrap_or(0) as usize;
        let range = self.bytes_of_line(text, number("line"));
        let (wanted, mut column) = (number("character"), 0);
        for (at, c) in text[range.clone()].char_indices() {
            if column >= wanted {
                return range.start + at;
            }
            column += c.len_utf16();
        }
        range.end
    }

    /// Line and UTF-16 column of a byte, both from 0.
    pub(crate) fn line_and_column(&self, text: &str, byte: usize) -> (usize, usize) {
        let byte = byte.min(text.len());
        let line = self.line_of(byte);
        let start = self.starts[line];
        (line, text[start..byte].chars().map(char::len_utf16).sum())
    }

    /// Position of the protocol of a byte.
    pub(crate) fn position(&self, text: &str, byte: usize) -> Value {
        let (line, character) = self.line_and_column(text, byte);
        json!({ "line": line, "character": character })
    }

    /// Bytes as a range of the protocol.
    pub(crate) fn range(&self, text: &str, bytes: &Range<usize>) -> Value {
        json!({ "start": self.position(text, bytes.start), "end": self.position(text, bytes.end) })
    }

    /// Bytes of a range of the protocol.
    pub(crate) fn bytes_of_range(&self, text: &str, range: &Value) -> Range<usize> {
        let (start, end) = (self.byte(text, &range["start"]), self.byte(text, &range["end"]));
        start.min(end)..end.max(start)
    }

    /// Byte of a position of a diagnostic: line and character column, both from 1.
    pub(crate) fn byte_of_diagnostic(&self, text: &str, line: usize, column: usize) -> usize {
        let range = self.bytes_of_line(text, line.saturating_sub(1));
        let skipped: usize =
            text[range.clone()].chars().take(column.saturating_sub(1)).map(char::len_utf8).sum();
        range.start + skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_utf16_units() {
        let text = "ä𝄞b\r\nfür\n";
        let lines = Lines::new(text);
        let at = |line: usize, character: usize| {
            lines.byte(text, &json!({ "line": line, "character": character }))
        };
        assert_eq!([at(0, 0), at(0, 1), at(0, 3), at(0, 4), at(0, 99)], [0, 2, 6, 7, 7]);
        assert_eq!([at(1, 0), at(1, 2), at(2, 0), at(7, 0)], [9, 12, 14, 14]);
        for byte in [0, 2, 6, 7, 9, 10, 12, 14] {
            assert_eq!(lines.byte(text, &lines.position(text, byte)), byte);
        }
        assert_eq!(lines.position(text, 6), json!({ "line": 0, "character": 3 }));
        assert_eq!(lines.byte_of_diagnostic(text, 1, 3), 6);
    }
}
