//! Tables of parameters for `--set-from rows.csv` or `rows.json`: each row holds the parameters of one film.

use crate::args::{SceneArgs, values};
use crate::failure::Failure;
use choreo_plugin::suggest::{did_you_mean, list};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// Size limit of a table in bytes.
const MAX_TABLE_BYTES: u64 = 64 << 20;

/// First character of the names of columns that are used only in names of outputs, and are not parameters of the script.
const OUTPUT_ONLY_PREFIX: char = '_';

/// The parameters of one film.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ParameterRow {
    /// Row number from 1; the header line is not counted.
    pub number: usize,
    /// Values by name; empty cells are left out.
    values: BTreeMap<String, String>,
}

impl ParameterRow {
    /// Arguments of a scene with these parameters, which override those of `--set`.
    pub(crate) fn scene_args(&self, args: &SceneArgs) -> SceneArgs {
        let own = self.values.iter().filter(|(name, _)| !name.starts_with(OUTPUT_ONLY_PREFIX));
        let mut set = args.set.clone();
        set.retain(|text| !self.values.contains_key(values::name_of(text)));
        set.extend(own.map(|(name, value)| format!("{name}={value}")));
        // A packed scene was packed with other parameters, so it is not compared.
        SceneArgs { set, packed_stage: None, ..args.clone() }
    }

    fn json(&self) -> Value {
        json!(self.values)
    }
}

/// Formats rows as JSON in the form that [`read_table`] accepts.
pub(crate) fn to_json(rows: &[ParameterRow]) -> Value {
    rows.iter().map(ParameterRow::json).collect()
}

/// Reads a table; the extension of the file determines its format.
pub(crate) fn read_table(path: &Path) -> Result<Vec<ParameterRow>, Failure> {
    let shown = path.display();
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    let parse = match ending.as_deref().and_then(|ending| ending.to_str()) {
        Some("csv") => parse_csv,
        Some("json") => parse_json,
        _ => {
            return Err(Failure::Usage(format!(
                "--set-from {shown}: write a name that ends in .csv or .json"
            )));
        }
    };
    let bytes = choreo_files::read(path, MAX_TABLE_BYTES)
        .map_err(|e| Failure::input(format!("{shown}: cannot read: {e}")))?;
    let text =
        std::str::from_utf8(&bytes).map_err(|_| Failure::input(format!("{shown}: it is not UTF-8 text")))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let values = parse(text).map_err(|what| Failure::input(format!("{shown}: {what}")))?;
    if values.is_empty() {
        return Err(Failure::input(format!("{shown}: it has no rows")));
    }
    Ok((1..).zip(values).map(|(number, values)| ParameterRow { number, values }).collect())
}

type RowValues = BTreeMap<String, String>;

/// Reason why a text is not a table.
#[derive(Debug, thiserror::Error)]
enum TableError {
    #[error("it is not a table: {0}")]
    Csv(#[from] csv::Error),
    #[error("it is not JSON: {0}")]
    Json(#[from] serde_json::Error),
    #[error("two columns are called \"{0}\"")]
    DuplicateColumn(String),
    #[error("a column has no name; the first line names the parameters")]
    UnnamedColumn,
    #[error("it is not an array of objects, [{{\"name\": \"Zoe\"}}, …]")]
    NotAnArray,
    #[error("row {0}: it is not an object")]
    NotAnObject(usize),
    #[error("row {0}: {1} is not a text, number, true or false")]
    UnsupportedValue(usize, String),
}

fn parse_csv(text: &str) -> Result<Vec<RowValues>, TableError> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names: Vec<String> = reader.headers()?.iter().map(|name| name.trim().to_string()).collect();
    if let Some(twice) = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
        return Err(TableError::DuplicateColumn(twice.1.clone()));
    }
    if names.iter().any(String::is_empty) {
        return Err(TableError::UnnamedColumn);
    }
    let cells = |record: csv::StringRecord| {
        let cells = names.iter().cloned().zip(record.iter().map(str::to_string));
        cells.filter(|(_, value)| !value.is_empty()).collect()
    };
    reader.records().map(|record| Ok(cells(record?))).collect()
}

fn parse_json(text: &str) -> Result<Vec<RowValues>, TableError> {
    let value: Value = serde_json::from_str(text)?;
    let rows = value.as_array().ok_or(TableError::NotAnArray)?;
    let cell = |row: usize, name: &str, value: &Value| match value {
        Value::String(text) => Ok(text.clone()),
        Value::Number(number) => Ok(number.to_string()),
        Value::Bool(on) => Ok(on.to_string()),
        _ => Err(TableError::UnsupportedValue(row, name.to_string())),
    };
    let row = |(number, row): (usize, &Value)| {
        let fields = row.as_object().ok_or(TableError::NotAnObject(number))?;
        let given = fields.iter().filter(|(_, value)| !value.is_null());
        given.map(|(name, value)| Ok((name.clone(), cell(number, name, value)?))).collect()
    };
    (1..).zip(rows).map(row).collect()
}

/// Fails if rows of a batch have failed. The message has the numbers of these rows, and a hint if a cause is likely.
pub(crate) fn check_no_row_failed<'f>(
    rows: usize,
    failures: impl Iterator<Item = (usize, &'f Failure)>,
) -> Result<(), Failure> {
    let failures: Vec<(usize, &Failure)> = failures.collect();
    let numbers: Vec<String> = failures.iter().map(|(number, _)| number.to_string()).collect();
    let unknown = |(_, failure): &(usize, &Failure)| {
        failure.message_lines().iter().any(|line| line.starts_with("--set: this script has no parameter"))
    };
    let hint = match failures.iter().any(unknown) {
        true => format!(
            "\n    hint: a column that only -o needs must have a name that begins with {OUTPUT_ONLY_PREFIX}"
        ),
        false => String::new(),
    };
    let list = list(numbers.iter().map(String::as_str), 30);
    match failures.len() {
        0 => Ok(()),
        count => Err(Failure::Rows(format!("{count} of {rows} rows failed: {list}{hint}"))),
    }
}

/// Output path of each row: the pattern, with `{name}` replaced by the row's value. Outputs stay in the folder that the pattern names, and no
/// two are the same file.
pub(crate) fn output_paths(rows: &[ParameterRow], pattern: &str) -> Result<Vec<String>, Failure> {
    let mut outputs: Vec<String> = Vec::with_capacity(rows.len());
    // Some file systems do not distinguish upper and lower case.
    let mut seen = BTreeMap::new();
    for row in rows {
        let parts = pattern
            .split('/')
            .map(|part| fill_placeholders(part, row, pattern))
            .collect::<Result<Vec<_>, _>>()?;
        let output = parts.join("/");
        if let Some(before) = seen.insert(output.to_lowercase(), row.number) {
            return Err(Failure::input(format!(
                "-o {pattern}: rows {before} and {} would both be written to {output}\n    hint: {{row}} is the number of the row",
                row.number
            )));
        }
        outputs.push(output);
    }
    Ok(outputs)
}

/// Replaces the placeholders in one component of the pattern's path.
fn fill_placeholders(part: &str, row: &ParameterRow, pattern: &str) -> Result<String, Failure> {
    let (mut filled, mut rest) = (String::new(), part);
    while let Some((before, name, after)) = split_at_placeholder(rest) {
        filled += before;
        filled += &match (row.values.get(name), name) {
            (Some(value), _) if is_valid_in_file_name(value) => value.clone(),
            (Some(value), _) => {
                return Err(Failure::input(format!(
                    "row {}: {name} = {value:?} cannot be a part of the name -o {pattern}: it may not have / \\ % or control \
                     characters in it, nor blanks at its ends",
                    row.number
                )));
            }
            (None, "row") => row.number.to_string(),
            (None, _) => return Err(missing_value_failure(name, row, pattern)),
        };
        rest = after;
    }
    if filled.is_empty() && rest.is_empty() {
        return Ok(filled);
    }
    filled += rest;
    match filled.as_str() {
        "." | ".." if part != filled => Err(Failure::input(format!(
            "row {}: -o {pattern} would be written to another folder",
            row.number
        ))),
        _ => Ok(filled),
    }
}

/// Splits a text at its first `{name}`: the text before it, the name, and the text after it.
fn split_at_placeholder(text: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = text.split_once('{')?;
    let (name, after) = rest.split_once('}')?;
    Some((before, name, after))
}

/// Whether a value may be part of a file name.
fn is_valid_in_file_name(value: &str) -> bool {
    let bad = |c: char| c.is_control() || ['/', '\\', '%'].contains(&c) || cfg!(windows) && c == ':';
    value.trim() == value && !value.is_empty() && value != "." && value != ".." && !value.contains(bad)
}

fn missing_value_failure(name: &str, row: &ParameterRow, pattern: &str) -> Failure {
    let known: Vec<&str> = row.values.keys().map(String::as_str).chain(["row"]).collect();
    let meant = did_you_mean(name, known.iter().copied());
    let known = list(known, 30);
    Failure::input(format!(
        "-o {pattern}: row {} has no value for {{{name}}}{meant}\n    hint: it has {known}",
        row.number
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(texts: &[&[(&str, &str)]]) -> Vec<ParameterRow> {
        let values =
            |pairs: &[(&str, &str)]| pairs.iter().map(|(n, v)| (n.to_string(), v.to_string())).collect();
        (1..).zip(texts).map(|(number, pairs)| ParameterRow { number, values: values(pairs) }).collect()
    }

    #[test]
    fn csv_and_json_give_the_same_rows() {
        let csv = parse_csv("name, color\nZoe,\"a \"\"b\"\",\nc\"\nBen,\n\n").unwrap();
        let json = parse_json(r#"[{"name": "Zoe", "color": "a \"b\",\nc"}, {"name": "Ben", "color": null}]"#)
            .unwrap();
        assert_eq!(csv, json);
        assert_eq!(csv[0]["color"], "a \"b\",\nc");
        assert_eq!(csv[1].len(), 1);
        assert_eq!(parse_json("[{\"a\": 1.5, \"b\": true}]").unwrap()[0]["a"], "1.5");
        for (text, what) in
            [("a,a\n1,2", "two columns are called \"a\""), ("a,\n1,2", "a column has no name")]
        {
            assert!(parse_csv(text).unwrap_err().to_string().contains(what), "{text}");
        }
        assert!(parse_csv("a,b\n1,2,3").unwrap_err().to_string().contains("line: 2"));
        for (text, what) in [
            ("{}", "not an array"),
            ("[1]", "row 1: it is not an object"),
            ("[{\"a\": []}]", "row 1: a is not a text"),
        ] {
            assert!(parse_json(text).unwrap_err().to_string().contains(what), "{text}");
        }
    }

    #[test]
    fn output_paths_stay_in_their_folder() {
        let two = rows(&[&[("name", "Zoe"), ("city", "Rom")], &[("name", "Ben"), ("city", "Rom")]]);
        assert_eq!(
            output_paths(&two, "out/{city}/{row}-{name}.mp4").unwrap(),
            ["out/Rom/1-Zoe.mp4", "out/Rom/2-Ben.mp4"]
        );
        assert_eq!(output_paths(&two, "../{name}.mp4").unwrap(), ["../Zoe.mp4", "../Ben.mp4"]);
        let failure_message = |rows: &[ParameterRow], pattern: &str| match output_paths(rows, pattern) {
            Err(failure) => failure.message_lines().join("\n"),
            Ok(outputs) => panic!("{outputs:?}"),
        };
        assert!(
            failure_message(&two, "out/{city}.mp4")
                .contains("rows 1 and 2 would both be written to out/Rom.mp4")
        );
        assert!(
            failure_message(&two, "{nme}.mp4")
                .contains("row 1 has no value for {nme}; did you mean \"name\"?")
        );
        for bad in ["../x", "/etc/x", "..", ".", "a/b", "a\\b", " a", "a ", "a\n", "", "%04d", "\0"] {
            let text = failure_message(&rows(&[&[("name", bad)]]), "out/{name}/film.mp4");
            assert!(text.contains("cannot be a part of the name"), "{bad:?}: {text}");
        }
        let dots = rows(&[&[("a", "x"), ("b", "y")]]);
        assert_eq!(output_paths(&dots, ".{a}.{b}").unwrap(), [".x.y"]);
        let text = failure_message(&rows(&[&[("a", "Zoe")], &[("a", "ZOE")]]), "{a}.mp4");
        assert!(text.contains("would both be"), "{text}");
    }
}
