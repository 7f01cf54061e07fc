//! Formatter of scripts. It changes blanks, indentation and blank lines. Line breaks are the author's, so that chains and maps
//! keep their layout; the text of comments and strings stays the same.
//!
//! ```text
//! text ─► format tokens (Rhai's tokens, comments) ─► line starts, blanks ─► aligned comments ─► edits
//! ```

mod blanks;
mod comments;
mod format_tokens;
mod lines;
mod strings;

use format_tokens::{FormatToken, Role, format_tokens};
use lines::LineStart;
use std::fmt;
use std::ops::Range;
use strings::{formatted_string, is_same_string};

/// Number of blanks of one step of indentation.
const INDENTATION: usize = 4;
const BYTE_ORDER_MARK: &str = "\u{feff}";

/// A change of a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// Byte range that is replaced.
    pub range: Range<usize>,
    pub text: String,
}

/// Why a text cannot be formatted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormatError {
    /// Line and column in characters, from 1.
    pub line: usize,
    pub column: usize,
    pub message: String,
}

impl FormatError {
    /// An error about the word at a byte.
    fn at_word(text: &str, byte: usize, what: &str) -> FormatError {
        let found: String = text[byte..].chars().take_while(|c| !c.is_whitespace()).take(12).collect();
        FormatError::at_text(text, byte, &found, what)
    }

    /// An error about the text `found` at a byte.
    fn at_text(text: &str, byte: usize, found: &str, what: &str) -> FormatError {
        let before = &text[..byte];
        FormatError {
            line: before.matches('\n').count() + 1,
            column: before.rsplit('\n').next().unwrap_or(before).chars().count() + 1,
            message: format!("\"{found}\" {what}"),
        }
    }
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{}: not formatted: {}", self.line, self.column, self.message)
    }
}

impl std::error::Error for FormatError {}

/// The formatted script. Formatting is idempotent.
pub fn formatted(text: &str) -> Result<String, FormatError> {
    Ok(apply_edits(text, &edits(text)?))
}

/// The edits that format a script, in order. They change neither tokens nor the text of comments, which is checked.
pub fn edits(text: &str) -> Result<Vec<Edit>, FormatError> {
    let start = if text.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
    let script = &text[start..];
    let tokens = format_tokens(script)?;
    check_brackets(script, &tokens)?;
    let mut edits = unchecked_edits(script, &tokens);
    if !has_same_tokens(&tokens, &apply_edits(script, &edits)) {
        let message =
            "formatting would change what the script does; please report this with the script".to_string();
        return Err(FormatError { line: 1, column: 1, message });
    }
    for edit in &mut edits {
        edit.range = edit.range.start + start..edit.range.end + start;
    }
    Ok(edits)
}

/// The text with edits applied, which must be in order.
fn apply_edits(text: &str, edits: &[Edit]) -> String {
    let (mut new, mut copied) = (String::with_capacity(text.len()), 0);
    for edit in edits {
        new.push_str(&text[copied..edit.range.start]);
        new.push_str(&edit.text);
        copied = edit.range.end;
    }
    new + &text[copied..]
}

/// Whether a formatted text has the tokens and comments that were read before.
fn has_same_tokens(before: &[FormatToken], text: &str) -> bool {
    let is_same = |(old, new): (&FormatToken, &FormatToken)| {
        old.role == new.role
            && match old.role {
                Role::BlockComment => old.text.lines().map(str::trim).eq(new.text.lines().map(str::trim)),
                _ if old.text.starts_with('`') => is_same_string(old.text, new.text),
                _ => old.text == new.text,
            }
    };
    format_tokens(text).is_ok_and(|new| new.len() == before.len() && before.iter().zip(&new).all(is_same))
}

/// Checks that each bracket is closed, and that each closing bracket closes one.
fn check_brackets(text: &str, tokens: &[FormatToken]) -> Result<(), FormatError> {
    let mut open: Vec<&FormatToken> = Vec::new();
    for token in tokens {
        match token.role {
            Role::Open => open.push(token),
            Role::Close => {
                let expected = open.pop().map(|open| match open.text {
                    "(" => ")",
                    "[" | "?[" => "]",
                    _ => "}",
                });
                if expected != Some(token.text) {
                    return Err(FormatError::at_text(
                        text,
                        token.range.start,
                        token.text,
                        "closes no bracket",
                    ));
                }
            }
            _ => {}
        }
    }
    match open.last() {
        Some(token) => Err(FormatError::at_text(text, token.range.start, token.text, "is never closed")),
        None => Ok(()),
    }
}

/// The line break or blanks before a token or comment.
#[derive(Clone, Copy, Debug)]
enum Gap {
    Line(LineStart),
    Blanks(usize),
}

/// The edits that format a script, not yet checked.
fn unchecked_edits(text: &str, tokens: &[FormatToken]) -> Vec<Edit> {
    let mut gaps: Vec<Gap> = Vec::with_capacity(tokens.len());
    for (index, line) in lines::line_starts(tokens).into_iter().enumerate() {
        gaps.push(match (line, index.checked_sub(1)) {
            (Some(line), _) => Gap::Line(line),
            (None, Some(before)) => {
                let has_blank = tokens[before].range.end < tokens[index].range.start;
                Gap::Blanks(usize::from(blanks::needs_blank(&tokens[before], &tokens[index], has_blank)))
            }
            (None, None) => Gap::Blanks(0),
        });
    }
    comments::align_trailing_comments(text, tokens, &mut gaps);
    let line_break = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let mut edits = Edits { text, edits: Vec::new() };
    let mut last_end = 0;
    for (token, gap) in tokens.iter().zip(&gaps) {
        edits.replace(last_end..token.range.start, gap_text(*gap, last_end == 0, line_break));
        if let (Role::BlockComment, Gap::Line(line)) = (token.role, gap) {
            let moved = comments::moved_comment(text, token, line.depth * INDENTATION, line_break);
            edits.replace(token.range.clone(), moved);
        }
        if token.text.starts_with('`') {
            edits.replace(token.range.clone(), formatted_string(token.text));
        }
        last_end = token.range.end;
    }
    let end = if tokens.is_empty() { "" } else { line_break };
    edits.replace(last_end..text.len(), end.to_string());
    edits.edits
}

fn gap_text(gap: Gap, is_first: bool, line_break: &str) -> String {
    match gap {
        Gap::Blanks(count) => " ".repeat(count),
        Gap::Line(_) if is_first => String::new(),
        Gap::Line(line) => {
            let breaks = line_break.repeat(1 + usize::from(line.has_blank_line));
            format!("{breaks}{}", " ".repeat(line.depth * INDENTATION))
        }
    }
}

/// List of edits of a text, without those that change nothing.
struct Edits<'a> {
    text: &'a str,
    edits: Vec<Edit>,
}

impl Edits<'_> {
    fn replace(&mut self, range: Range<usize>, text: String) {
        if self.text[range.clone()] != text {
            self.edits.push(Edit { range, text });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tokens::tokens;
    use std::path::{Path, PathBuf};

    /// Asserts the formatted text, and that formatting it again changes nothing.
    fn check_formatted(text: &str, expected: &str) {
        let new = formatted(text).unwrap_or_else(|e| panic!("{e}: {text}"));
        assert_eq!(new, expected, "{text}");
        assert_eq!(formatted(&new).unwrap(), new, "not idempotent");
    }

    #[test]
    fn blanks_are_added_and_removed_by_style() {
        let cases = [
            ("let  a=1+2*-b ;", "let a = 1 + 2 * -b;"),
            ("a - -1; a- -b; - -c;", "a - -1; a - -b; - -c;"),
            ("f( 1,x [0] ,#{a:1 ,\"b\" : [ ]} ) ;", "f(1, x[0], #{ a: 1, \"b\": [] });"),
            ("if(a&&! b){c()}else{d( )}", "if (a && !b) { c() } else { d() }"),
            ("for i in 0 .. 8 {x . loop ( ) . until(2)}", "for i in 0..8 { x.loop().until(2) }"),
            ("on_frame( | t,u |line.set( t|u ) );g(||1);", "on_frame(|t, u| line.set(t | u)); g(|| 1);"),
            ("import\"a\"as b;b :: c( );let d=#{ };", "import \"a\" as b; b::c(); let d = #{};"),
            ("switch x{1=>a,_=>{b}}", "switch x { 1 => a, _ => { b } }"),
            ("f!( a );x!=y;!z;a?.b?[0]??c;p!in q", "f!(a); x != y; !z; a?.b?[0] ?? c; p !in q"),
            ("print(`a ${ b+1 } c`);f(/* x */1,/*y*/ 2);", "print(`a ${b + 1} c`); f(/* x */1, /*y*/ 2);"),
            ("f(`a  b${g( `c  ${ d+1 }` )}${}`)", "f(`a  b${g(`c  ${d + 1}`)}${}`)"),
            ("f(`${ a\n+b }`);", "f(`${ a\n+b }`);"),
            ("return-1;return;x+=1;let f=|x|-x;", "return -1; return; x += 1; let f = |x| -x;"),
        ];
        for (text, expected) in cases {
            check_formatted(text, &format!("{expected}\n"));
        }
    }

    #[test]
    fn lines_are_indented_by_brackets_and_continued_statements() {
        let text = "\n\nfn f(a,\n b) {\n\n\n  if a\n && b {\n c();   // d\n  \n  \n /* e\n    f */\n }\n else {\n g() }\n  // h\n\n}\n\
            hero.play(x)\n.until(2)\n  // i\n  .then(y, #{\n fade: 1,\n speed:\n 2 }).from(\n1);\nlet k =\n[\n1,2];\n\
            do {\n a\n} while b;\ntest(\"l\", || {\nm(n\n+ o,\np);\nfor q in r { s() }\nt();\n});\n\n\n\n// u";
        let expected = "fn f(a,\n    b) {\n    if a\n        && b {\n        c(); // d\n\n        /* e\n           f */\n    }\n    \
            else {\n        g()\n    }\n    // h\n}\nhero.play(x)\n    .until(2)\n    // i\n    .then(y, #{\n        fade: 1,\n        \
            speed:\n            2\n    }).from(\n        1\n    );\nlet k =\n    [\n        1, 2\n    ];\n\
            do {\n    a\n} while b;\ntest(\"l\", || {\n    m(n\n        + o,\n        p);\n    for q in r { s() }\n    t();\n});\n\n// u\n";
        check_formatted(text, expected);
    }

    #[test]
    fn trailing_comments_in_one_column_stay_aligned() {
        check_formatted(
            "let a=1;      // x\nlet bcd = 2;  // y\nlet e;   // z\n\nf();              // v",
            "let a = 1;    // x\nlet bcd = 2;  // y\nlet e; // z\n\nf(); // v\n",
        );
    }

    #[test]
    fn empty_texts_and_line_breaks_are_kept_and_invalid_texts_refused() {
        check_formatted("", "");
        check_formatted(" \n\n", "");
        check_formatted("\u{feff}a ;\r\n\r\n\r\n  b( `x\r\n  y` )", "\u{feff}a;\r\n\r\nb(`x\r\n  y`)\r\n");
        let refused = [
            ("f(1", "1:2: not formatted: \"(\" is never closed"),
            ("a;\n f[1)", "2:5: not formatted: \")\" closes no bracket"),
            ("a /* b", "1:3: not formatted: \"/*\" begins a comment that is never closed"),
            ("/* é */ \"x\n", "1:9: not formatted: \"\"x\" is not valid in a script"),
            ("a \\ b", "1:3: not formatted: \"\\\" is not valid in a script"),
        ];
        for (text, expected) in refused {
            assert_eq!(formatted(text).unwrap_err().to_string(), expected);
        }
    }

    fn find_scripts(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                find_scripts(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rhai") {
                found.push(path);
            }
        }
    }

    /// Every lesson, test and plugin of the project is formatted. A copy without indentation keeps its tokens when it is
    /// formatted, and formatting is idempotent.
    #[test]
    fn scripts_of_the_project_are_formatted() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut paths = Vec::new();
        ["scripts", "tests/suite", "tests/bench", "plugins"]
            .iter()
            .for_each(|folder| find_scripts(&root.join(folder), &mut paths));
        assert!(paths.len() > 100, "{}", paths.len());
        let mut refused = 0;
        for path in paths {
            let text = std::fs::read_to_string(&path).unwrap();
            let new = match formatted(&text) {
                Ok(new) => new,
                Err(error) => {
                    assert!(path.to_string_lossy().contains("errors"), "{}: {error}", path.display());
                    refused += 1;
                    continue;
                }
            };
            let token_texts = |text: &str| -> Vec<String> {
                tokens(text).into_iter().map(|t| text[t.range].to_string()).collect()
            };
            let ragged: String = text.lines().map(|line| format!("  {}\n", line.trim())).collect();
            if let Ok(again) = formatted(&ragged) {
                assert_eq!(token_texts(&again), token_texts(&ragged), "{}", path.display());
                assert_eq!(formatted(&again).unwrap(), again, "{}", path.display());
            }
            assert!(new == text, "{} is not formatted: choreo format {0}", path.display());
        }
        assert!(refused < 10, "{refused}");
    }
}
