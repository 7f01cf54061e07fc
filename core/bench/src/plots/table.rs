//! Tables for the terminal, for Markdown and as JSON.

use serde_json::{Map, Value, json};
use unicode_width::{UnicodeWidthChar, UnicodeWidthStr};

/// Column of a table: title for people, and key in JSON.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    pub title: String,
    pub key: &'static str,
    /// Numbers are aligned to the right.
    pub right: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    pub text: String,
    pub value: Value,
}

impl Cell {
    pub fn text(text: impl Into<String>) -> Cell {
        let text = text.into();
        Cell { value: Value::from(text.clone()), text }
    }

    pub fn empty() -> Cell {
        Cell { text: String::new(), value: Value::Null }
    }

    /// Cell of a number: text for people, and the exact number for JSON.
    pub fn number(text: impl Into<String>, value: f64) -> Cell {
        Cell { text: text.into(), value: json!(value) }
    }

    pub fn count(count: usize) -> Cell {
        Cell { text: count.to_string(), value: json!(count) }
    }
}

/// A table, whose rows have as many cells as there are columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    pub title: String,
    pub columns: Vec<Column>,
    pub rows: Vec<Vec<Cell>>,
    /// Notes, a line each.
    pub notes: Vec<String>,
}

impl Table {
    /// Makes a table without rows. Columns are (title, key); a `>` before the title aligns numbers to the right.
    pub fn new(title: impl Into<String>, columns: &[(&str, &'static str)]) -> Table {
        let column = |(title, key): &(&str, &'static str)| Column {
            title: title.trim_start_matches('>').to_string(),
            key,
            right: title.starts_with('>'),
        };
        Table { title: title.into(), columns: columns.iter().map(column).collect(), ..Table::default() }
    }

    /// Leaves out columns that are empty in all rows.
    pub fn without_empty_columns(mut self) -> Table {
        let used = |i: usize| self.rows.iter().any(|r| r.get(i).is_some_and(|c| !c.text.is_empty()));
        let keep: Vec<bool> = (0..self.columns.len()).map(used).collect();
        let mut index = 0;
        self.columns.retain(|_| {
            index += 1;
            keep[index - 1]
        });
        for row in &mut self.rows {
            let mut index = 0;
            row.retain(|_| {
                index += 1;
                keep.get(index - 1).copied().unwrap_or(false)
            });
        }
        self
    }

    /// The table as text, with columns aligned by blanks; the last column may be long.
    pub fn text(&self) -> String {
        self.text_within(usize::MAX)
    }

    /// The text of [`Table::text`] in lines of at most `width` characters where words allow it; longer cells continue on lines of their
    /// own.
    pub fn text_within(&self, width: usize) -> String {
        let widths = self.fitted_widths(width);
        let mut out = String::new();
        if !self.title.is_empty() {
            out += &format!("{}\n", self.title);
        }
        let line = |cells: &[&str]| {
            let mut line = String::from(" ");
            for ((cell, column), width) in cells.iter().zip(&self.columns).zip(&widths) {
                let fill = " ".repeat(width.saturating_sub(cell.width()));
                line += &if column.right { format!(" {fill}{cell} ") } else { format!(" {cell}{fill} ") };
            }
            line.trim_end().to_string() + "\n"
        };
        out += &line(&self.columns.iter().map(|c| c.title.as_str()).collect::<Vec<_>>());
        for row in &self.rows {
            // A name from a file cannot begin a row of its own.
            let cells = row.iter().map(|c| c.text.replace('\n', "\u{fffd}"));
            let cells: Vec<Vec<String>> =
                cells.zip(&widths).map(|(cell, width)| wrap_text(&cell, *width)).collect();
            for index in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
                let part = |cell: &Vec<String>| cell.get(index).map_or("", String::as_str).to_string();
                let parts: Vec<String> = cells.iter().map(part).collect();
                out += &line(&parts.iter().map(String::as_str).collect::<Vec<_>>());
            }
        }
        for note in &self.notes {
            out += &format!("  {note}\n");
        }
        out
    }

    /// Widths of the columns: the widest are narrowed until a line fits.
    fn fitted_widths(&self, width: usize) -> Vec<usize> {
        /// Columns of text are not narrowed below this width.
        const MIN_TEXT_WIDTH: usize = 16;
        let mut widths = self.widths(|cell| cell.text.width());
        let mut over = (widths.iter().map(|width| width + 2).sum::<usize>()).saturating_sub(width);
        while over > 0 {
            let texts = widths
                .iter_mut()
                .zip(&self.columns)
                .filter(|(width, c)| !c.right && **width > MIN_TEXT_WIDTH);
            let Some((widest, _)) = texts.max_by_key(|(width, _)| **width) else { break };
            *widest -= 1;
            over -= 1;
        }
        widths
    }

    fn widths(&self, width: impl Fn(&Cell) -> usize) -> Vec<usize> {
        let of_column = |(i, column): (usize, &Column)| {
            let cells = self.rows.iter().filter_map(|r| r.get(i)).map(&width);
            cells.chain([column.title.width()]).max().unwrap_or(0)
        };
        self.columns.iter().enumerate().map(of_column).collect()
    }

    pub fn markdown(&self) -> String {
        let escape = |text: &str| text.replace('|', "\\|").replace('\n', " ");
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut out = line(self.columns.iter().map(|c| escape(&c.title)).collect());
        out += &line(self.columns.iter().map(|c| if c.right { "---:" } else { "---" }.to_string()).collect());
        for row in &self.rows {
            out += &line(row.iter().map(|c| escape(&c.text)).collect());
        }
        for note in &self.notes {
            out += &format!("\n{note}\n");
        }
        out
    }

    /// The table as JSON: one object per row, with the keys of the columns.
    pub fn json(&self) -> Value {
        let row = |row: &Vec<Cell>| {
            let cells = self.columns.iter().zip(row);
            Value::Object(
                cells.map(|(c, cell)| (c.key.to_string(), cell.value.clone())).collect::<Map<_, _>>(),
            )
        };
        self.rows.iter().map(row).collect()
    }
}

/// Breaks a text into lines of at most this width, between words, or inside a word that is longer. All lines but the first are indented.
fn wrap_text(text: &str, width: usize) -> Vec<String> {
    const INSET: &str = "  ";
    if text.width() <= width {
        return vec![text.to_string()];
    }
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.last().map_or(0, |line| line.width());
        if last > INSET.len() && last + 1 + word.width() > width {
            lines.push(INSET.to_string());
        }
        for (index, letter) in word.char_indices() {
            let letter_width = letter.width().unwrap_or(0);
            if lines.last().is_some_and(|line| line.width() + letter_width > width.max(INSET.len() + 2)) {
                lines.push(INSET.to_string());
            }
            let Some(line) = lines.last_mut() else { break };
            if index == 0 && !line.trim().is_empty() {
                line.push(' ');
            }
            line.push(letter);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapped_lines_fit_the_width_and_keep_all_words() {
        let mut table = Table::new("", &[("what", "what"), (">size", "bytes"), ("asked for by", "by")]);
        let long = "triangles lit skin morph normal_map: 3 draws, 12 copies";
        table.rows.push(vec![
            Cell::text(long),
            Cell::number("1.2 kB", 1200.0),
            Cell::text("Zoë (line 3), 田中 (line 4)"),
        ]);
        table.rows.push(vec![Cell::text("short"), Cell::empty(), Cell::text("x".repeat(50))]);
        assert_eq!(table.text().lines().count(), 3);
        let words =
            |text: &str| text.split_whitespace().collect::<String>().chars().filter(|c| *c != ' ').count();
        for width in [60, 72, 80, 100] {
            let text = table.text_within(width);
            assert!(text.lines().all(|line| line.width() <= width), "{text}");
            assert_eq!(words(&text), words(&table.text()), "{text}");
        }
        let expected = "  what                      size  asked for by
  triangles lit skin      1.2 kB  Zoë (line 3), 田中
    morph normal_map: 3             (line 4)
    draws, 12 copies
";
        assert!(table.text_within(56).starts_with(expected), "{}", table.text_within(56));
    }

    #[test]
    fn text_markdown_and_json_have_the_same_rows() {
        let mut table = Table::new("two", &[("name", "name"), (">size", "bytes"), ("why", "why")]);
        table.rows.push(vec![Cell::text("größe"), Cell::number("1.2 kB", 1200.0), Cell::empty()]);
        table.rows.push(vec![Cell::text("b|c"), Cell::count(7), Cell::empty()]);
        let table = table.without_empty_columns();
        assert_eq!(table.text(), "two\n  name     size\n  größe  1.2 kB\n  b|c         7\n");
        assert_eq!(table.markdown(), "| name | size |\n| --- | ---: |\n| größe | 1.2 kB |\n| b\\|c | 7 |\n");
        assert_eq!(
            table.json(),
            json!([{ "name": "größe", "bytes": 1200.0 }, { "name": "b|c", "bytes": 7 }])
        );
    }
}
