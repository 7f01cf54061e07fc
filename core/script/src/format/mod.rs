//! Formatter of scripts. It changes blanks, indentation and blank lines. Line breaks are the author's, so that chains and maps
//! keep their layout; the text of comments and strings stays the same.
//!
//! ```text
//! text ─► pieces (Rhai's tokens, comments) ─► lines (where they begin, how deep), blanks ─► comments (aligned) ─► edits
//! ```

mod blanks;
mod comments;
mod lines;
mod pieces;
mod strings;

use lines::Line;
use pieces::{Piece, Role, pieces};
use std::fmt;
use std::ops::Range;
use strings::{formatted_string, is_same_string};

/// Number of blanks of one step of indentation.
const STEP: usize = 4;
const MARK: &str = "\u{feff}";

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
    fn at(text: &str, byte: usize, what: &str) -> FormatError {
        let found: String = text[byte..].chars().take_while(|c| !c.is_whitespace()).take(12).collect();
        FormatError::about(text, byte, &found, what)
    }

    fn about(text: &str, byte: usize, found: &str, what: &str) -> FormatError {
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
    Ok(applied(text, &edits(text)?))
}

/// The edits that format a script, in order. It is checked that tokens and comments stay the same.
pub fn edits(text: &str) -> Result<Vec<Edit>, FormatError> {
    let start = if text.starts_with(MARK) { MARK.len() } else { 0 };
    let script = &text[start..];
    let pieces = pieces(script)?;
    balanced(script, &pieces)?;
    let mut edits = changes(script, &pieces);
    if !is_same(&pieces, &applied(script, &edits)) {
        let message =
            "formatting would change what the script does; please report this with the script".to_string();
        return Err(FormatError { line: 1, column: 1, message });
    }
    for edit in &mut edits {
        edit.range = edit.range.start + start..edit.range.end + start;
    }
    Ok(edits)
}

/// Applies edits, which must be in order.
fn applied(text: &str, edits: &[Edit]) -> String {
    let (mut new, mut behind) = (String::with_capacity(text.len()), 0);
    for edit in edits {
        new.push_str(&text[behind..edit.range.start]);
        new.push_str(&edit.text);
        behind = edit.range.end;
    }
    new + &text[behind..]
}

fn is_same(pieces_before: &[Piece], text: &str) -> bool {
    let same = |(old, new): (&Piece, &Piece)| {
        old.role == new.role
            && match old.role {
                Role::BlockComment => old.text.lines().map(str::trim).eq(new.text.lines().map(str::trim)),
                _ if old.text.starts_with('`') => is_same_string(old.text, new.text),
                _ => old.text == new.text,
            }
    };
    pieces(text).is_ok_and(|new| new.len() == pieces_before.len() && pieces_before.iter().zip(&new).all(same))
}

/// Checks that every bracket has its partner.
fn balanced(text: &str, pieces: &[Piece]) -> Result<(), FormatError> {
    let mut open: Vec<&Piece> = Vec::new();
    for piece in pieces {
        match piece.role {
            Role::Open => open.push(piece),
            Role::Close => {
                let expected = open.pop().map(|open| match open.text {
                    "(" => ")",
                    "[" | "?[" => "]",
                    _ => "}",
                });
                if expected != Some(piece.text) {
                    return Err(FormatError::about(text, piece.range.start, piece.text, "closes no bracket"));
                }
            }
            _ => {}
        }
    }
    match open.last() {
        Some(piece) => Err(FormatError::about(text, piece.range.start, piece.text, "is never closed")),
        None => Ok(()),
    }
}

/// The line break or blanks before a piece.
#[derive(Clone, Copy, Debug)]
enum Gap {
    Line(Line),
    Blanks(usize),
}

fn changes(text: &str, pieces: &[Piece]) -> Vec<Edit> {
    let mut gaps: Vec<Gap> = Vec::with_capacity(pieces.len());
    for (index, line) in lines::lines(pieces).into_iter().enumerate() {
        gaps.push(match (line, index.checked_sub(1)) {
            (Some(line), _) => Gap::Line(line),
            (None, Some(before)) => {
                let there = pieces[before].range.end < pieces[index].range.start;
                Gap::Blanks(usize::from(blanks::blank(&pieces[before], &pieces[index], there)))
            }
            (None, None) => Gap::Blanks(0),
        });
    }
    comments::align(text, pieces, &mut gaps);
    let line_break = if text.contains("\r\n") { "\r\n" } else { "\n" };
    let mut edits = Edits { text, edits: Vec::new() };
    let mut behind = 0;
    for (piece, gap) in pieces.iter().zip(&gaps) {
        edits.replace(behind..piece.range.start, gap_text(*gap, behind == 0, line_break));
        if let (Role::BlockComment, Gap::Line(line)) = (piece.role, gap) {
            let moved = comments::align_comment(text, piece, line.depth * STEP, line_break);
            edits.replace(piece.range.clone(), moved);
        }
        if piece.text.starts_with('`') {
            edits.replace(piece.range.clone(), formatted_string(piece.text));
        }
        behind = piece.range.end;
    }
    let end = if pieces.is_empty() { "" } else { line_break };
    edits.replace(behind..text.len(), end.to_string());
    edits.edits
}

fn gap_text(gap: Gap, is_first: bool, line_break: &str) -> String {
    match gap {
        Gap::Blanks(count) => " ".repeat(count),
        Gap::Line(_) if is_first => String::new(),
        Gap::Line(line) => {
            let breaks = line_break.repeat(1 + usize::from(line.apart));
            format!("{breaks}{}", " ".repeat(line.depth * STEP))
        }
    }
}

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

    fn check(text: &str, expected: &str) {
        let new = formatted(text).unwrap_or_else(|e| panic!("{e}: {text}"));
        assert_eq!(new, expected, "{text}");
        assert_eq!(formatted(&new).unwrap(), new, "not idempotent");
    }

    #[test]
    fn blanks_stand_where_they_belong() {
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
            check(text, &format!("{expected}\n"));
        }
    }

    #[test]
    fn lines_are_indented_by_what_they_continue() {
        let text = "\n\nfn f(a,\n b) {\n\n\n  if a\n && b {\n c();   // d\n  \n  \n /* e\n    f */\n }\n else {\n g() }\n  // h\n\n}\n\
            hero.play(x)\n.until(2)\n  // i\n  .then(y, #{\n fade: 1,\n speed:\n 2 }).from(\n1);\nlet k =\n[\n1,2];\n\
            do {\n a\n} while b;\ntest(\"l\", || {\nm(n\n+ o,\np);\nfor q in r { s() }\nt();\n});\n\n\n\n// u";
        let expected = "fn f(a,\n    b) {\n    if a\n        && b {\n        c(); // d\n\n        /* e\n           f */\n    }\n    \
            else {\n        g()\n    }\n    // h\n}\nhero.play(x)\n    .until(2)\n    // i\n    .then(y, #{\n        fade: 1,\n        \
            speed:\n            2\n    }).from(\n        1\n    );\nlet k =\n    [\n        1, 2\n    ];\n\
            do {\n    a\n} while b;\ntest(\"l\", || {\n    m(n\n        + o,\n        p);\n    for q in r { s() }\n    t();\n});\n\n// u\n";
        check(text, expected);
    }

    #[test]
    fn comments_in_one_column_stay_in_one() {
        check(
            "let a=1;      // x\nlet bcd = 2;  // y\nlet e;   // z\n\nf();              // v",
            "let a = 1;    // x\nlet bcd = 2;  // y\nlet e; // z\n\nf(); // v\n",
        );
    }

    #[test]
    fn texts_of_all_kinds_are_kept_or_refused() {
        check("", "");
        check(" \n\n", "");
        check("\u{feff}a ;\r\n\r\n\r\n  b( `x\r\n  y` )", "\u{feff}a;\r\n\r\nb(`x\r\n  y`)\r\n");
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

    fn scripts(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                scripts(&path, found);
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
            .for_each(|folder| scripts(&root.join(folder), &mut paths));
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
            let texts = |text: &str| -> Vec<String> {
                tokens(text).into_iter().map(|t| text[t.range].to_string()).collect()
            };
            let ragged: String = text.lines().map(|line| format!("  {}\n", line.trim())).collect();
            if let Ok(again) = formatted(&ragged) {
                assert_eq!(texts(&again), texts(&ragged), "{}", path.display());
                assert_eq!(formatted(&again).unwrap(), again, "{}", path.display());
            }
            assert!(new == text, "{} is not formatted: choreo format {0}", path.display());
        }
        assert!(refused < 10, "{refused}");
    }
}
