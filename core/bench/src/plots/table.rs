//! Tables: for the terminal, for Markdown, as JSON.

use serde_json::{Map, Value, json};

/// Name for people, and key in JSON.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    pub title: String,
    pub key: &'static str,
    /// Numbers line up on the right.
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

    /// Text for people, and the exact number.
    pub fn number(text: impl Into<String>, value: f64) -> Cell {
        Cell { text: text.into(), value: json!(value) }
    }

    pub fn count(count: usize) -> Cell {
        Cell { text: count.to_string(), value: json!(count) }
    }
}

/// Rows of as many cells as there are columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    pub title: String,
    pub columns: Vec<Column>,
    pub rows: Vec<Vec<Cell>>,
    /// Notes, a line each.
    pub notes: Vec<String>,
}

impl Table {
    /// Columns as (title, key); a `>` before the title lines numbers up on the right.
    pub fn new(title: impl Into<String>, columns: &[(&str, &'static str)]) -> Table {
        let column = |(title, key): &(&str, &'static str)| Column {
            title: title.trim_start_matches('>').to_string(),
            key,
            right: title.starts_with('>'),
        };
        Table { title: title.into(), columns: columns.iter().map(column).collect(), ..Table::default() }
    }

    /// Leaves out columns in which no row has anything.
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

    /// Columns lined up by blanks; the last one may be long.
    pub fn text(&self) -> String {
        let widths = self.widths(|cell| cell.text.chars().count());
        let mut out = String::new();
        if !self.title.is_empty() {
            out += &format!("{}\n", self.title);
        }
        let line = |cells: Vec<&str>| {
            let mut line = String::from(" ");
            for ((cell, column), width) in cells.iter().zip(&self.columns).zip(&widths) {
                let fill = " ".repeat(width.saturating_sub(cell.chars().count()));
                line += &if column.right { format!(" {fill}{cell} ") } else { format!(" {cell}{fill} ") };
            }
            line.trim_end().to_string() + "\n"
        };
        out += &line(self.columns.iter().map(|c| c.title.as_str()).collect());
        for row in &self.rows {
            // A name from a file cannot begin a row of its own.
            let cells: Vec<String> = row.iter().map(|c| c.text.replace('\n', "\u{fffd}")).collect();
            out += &line(cells.iter().map(String::as_str).collect());
        }
        for note in &self.notes {
            out += &format!("  {note}\n");
        }
        out
    }

    fn widths(&self, width: impl Fn(&Cell) -> usize) -> Vec<usize> {
        let of_column = |(i, column): (usize, &Column)| {
            let cells = self.rows.iter().filter_map(|r| r.get(i)).map(&width);
            cells.chain([column.title.chars().count()]).max().unwrap_or(0)
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

    /// An object a row, by the columns' keys.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_rows_for_people_and_machines() {
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
