//! Plain words: documentation, help, messages, lessons and comments must use the terms of the field (`words.txt`), and doc comments must be
//! sentences or noun phrases. `cargo xtask words` prints violations, and a test fails if there are any.

mod source;

use source::{Kind, Text, texts_of_rust};
use std::path::Path;
use std::process::Command;

/// Words that must not begin a doc comment, because a fragment or a riddle would follow.
const OPENINGS: &[&str] = &[
    "Of", "In", "Into", "By", "For", "From", "With", "Without", "At", "On", "Onto", "To", "Over", "Under",
    "Among", "Between", "Through", "Beside", "Where", "What", "Those", "Who",
];

/// A rule from a line of `words.txt`.
struct Rule {
    word: String,
    replacement: String,
    allowed: Vec<String>,
}

impl Rule {
    fn all() -> Vec<Rule> {
        let rows = include_str!("words.txt").lines().filter(|row| !row.is_empty() && !row.starts_with('#'));
        rows.map(|row| {
            let mut parts = row.split(" = ").map(str::trim);
            let mut next = || parts.next().unwrap_or_default().to_string();
            let (word, replacement, allowed) = (next(), next(), next());
            let allowed = allowed.split(", ").filter(|p| !p.is_empty()).map(str::to_string).collect();
            Rule { word, replacement, allowed }
        })
        .collect()
    }

    /// Byte offset of the first match in a lower-case text.
    fn find(&self, text: &str) -> Option<usize> {
        let (word, any_ending) = match self.word.strip_suffix('*') {
            Some(stem) => (stem, true),
            None => (self.word.as_str(), false),
        };
        let is_letter = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
        let whole = |at: usize| {
            let (before, after) = (&text[..at], &text[at + word.len()..]);
            !before.ends_with(is_letter) && (any_ending || !after.starts_with(is_letter))
        };
        let allowed = |at: usize| {
            self.allowed.iter().any(|phrase| {
                phrase.match_indices(word).any(|(inside, _)| {
                    at.checked_sub(inside)
                        .and_then(|from| text.get(from..))
                        .is_some_and(|t| t.starts_with(phrase.as_str()))
                })
            })
        };
        text.match_indices(word).map(|(at, _)| at).find(|at| whole(*at) && !allowed(*at))
    }
}

/// Violations in one text, as `file:line: message`.
fn problems(path: &str, text: &Text, rules: &[Rule]) -> Vec<String> {
    let lower = without_code(&text.words).to_lowercase();
    let banned = rules.iter().filter_map(|rule| {
        let line = text.line + lower[..rule.find(&lower)?].matches('\n').count();
        Some(format!("{path}:{line}: \"{}\": write {}", rule.word.trim_end_matches('*'), rule.replacement))
    });
    let mut words = text.words.split_whitespace();
    let (first, second) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    // "At least one" and "At most N" are subjects, and allowed.
    let is_quantity = first == "At" && ["least", "most"].contains(&second);
    let fragment = text.kind == Kind::Doc && OPENINGS.contains(&first) && !is_quantity;
    let fragment = fragment.then(|| {
        format!(
            "{path}:{}: a doc comment begins with \"{first}\": begin with what the thing is or does",
            text.line
        )
    });
    banned.chain(fragment).collect()
}

/// Replaces code between backticks, link targets, and names with `_` or `::` by spaces.
fn without_code(text: &str) -> String {
    let text: String = text.split_inclusive([' ', '\n']).map(blank_names).collect();
    let mut plain = String::with_capacity(text.len());
    let (mut code, mut target) = (false, false);
    for (at, c) in text.char_indices() {
        match c {
            '`' => code = !code,
            '(' if text[..at].ends_with(']') => target = true,
            ')' => target = false,
            _ => {}
        }
        // A blank line ends a paragraph, and closes open code in it.
        code &= !text[..at].ends_with("\n\n");
        plain.push(if (code || target) && c != '\n' { ' ' } else { c });
    }
    plain
}

/// Replaces a name of code or of a file by spaces, including its backticks.
fn blank_names(word: &str) -> String {
    let file = word
        .trim_end()
        .split_once('.')
        .is_some_and(|(name, end)| !name.is_empty() && end.starts_with(char::is_alphabetic));
    let is_name = file || word.contains('_') || word.contains("::") || word.contains("](");
    match is_name {
        true => word.chars().map(|c| if matches!(c, '\n' | '`') { c } else { ' ' }).collect(),
        false => word.to_string(),
    }
}

/// Texts of a file that people read.
fn texts(path: &str, content: &str) -> Vec<Text> {
    let end = path.rsplit('.').next().unwrap_or_default();
    match end {
        "rs" => texts_of_rust(content),
        "md" => source::texts_of_markdown(content),
        "rhai" | "wgsl" => source::texts_of_comments(content),
        _ => Vec::new(),
    }
}

/// Whether the texts of a file are checked: tests and this list itself are not.
fn is_checked(path: &str) -> bool {
    let in_tests = path.starts_with("tests/") && !path.ends_with(".md")
        || path.contains("/tests/")
        || path.contains("/tests.rs");
    let scripts = path.starts_with("scripts/") || path.starts_with("shaders/");
    let code = (path.starts_with("core/") || path.starts_with("plugins/")) && !in_tests;
    code || scripts || path.ends_with(".md")
}

/// Paths of the files that are checked.
fn listed(root: &Path) -> Result<Vec<String>, String> {
    let listed = Command::new("git").args(["ls-files"]).current_dir(root).output();
    let listed = listed.map_err(|e| format!("git ls-files: {e}"))?;
    let listed = String::from_utf8_lossy(&listed.stdout);
    Ok(listed.lines().filter(|path| is_checked(path)).map(str::to_string).collect())
}

/// Violations in all files of the repository.
pub(crate) fn all_problems(root: &Path) -> Result<Vec<String>, String> {
    let rules = Rule::all();
    let mut found = Vec::new();
    for path in listed(root)? {
        // The file may be deleted, but still be listed by git.
        let Ok(content) = std::fs::read_to_string(root.join(&path)) else { continue };
        found.extend(texts(&path, &content).iter().flat_map(|text| problems(&path, text, &rules)));
    }
    Ok(found)
}

/// Runs `cargo xtask words`.
pub(crate) fn words() -> Result<(), String> {
    let found = all_problems(&crate::root())?;
    found.iter().for_each(|problem| println!("{problem}"));
    match found.len() {
        0 => Ok(()),
        count => Err(format!("{count} texts use words that words.txt replaces")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &str, content: &str) -> Vec<String> {
        let rules = Rule::all();
        texts(path, content).iter().flat_map(|text| problems(path, text, &rules)).collect()
    }

    #[test]
    fn the_repository_uses_the_terms_of_the_field() {
        let problems = all_problems(&crate::root()).unwrap();
        assert!(problems.is_empty(), "{} problems:\n{}", problems.len(), problems.join("\n"));
    }

    /// Paths in a text that begin with a folder of the project and do not exist. Paths with NAME in capitals are patterns, and ignored.
    fn missing_paths(text: &str) -> Vec<&str> {
        let is_path = |word: &&str| {
            let known =
                ["core/", "plugins/", "shaders/", "scripts/", "tests/"].iter().any(|f| word.starts_with(f));
            known && !word.contains(['*', '{', ' ']) && !word.contains("NAME")
        };
        text.split('`')
            .skip(1)
            .step_by(2)
            .filter(is_path)
            .filter(|path| !crate::root().join(path).exists())
            .collect()
    }

    #[test]
    fn the_paths_of_the_architecture_exist() {
        let text = std::fs::read_to_string(crate::root().join("ARCHITECTURE.md")).unwrap();
        assert_eq!(missing_paths(&text), Vec::<&str>::new());
        assert_eq!(missing_paths("`core/gone.rs` and `core/cli`"), ["core/gone.rs"]);
    }

    /// Names of the form "`NAME` in `FILE`" or "`NAME` of `FILE`" whose file does not contain them. A file may be stated by the end of its path.
    fn missing_names<'t>(text: &'t str, files: &[String]) -> Vec<(&'t str, &'t str)> {
        let contains_word = |path: &String, name: &str| {
            let content = std::fs::read_to_string(crate::root().join(path)).unwrap();
            content.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == name)
        };
        // Code is at odd places, the text between two pieces of code at even ones.
        let pieces: Vec<&str> = text.split('`').collect();
        let triples = pieces.windows(3).skip(1).step_by(2);
        let pairs = triples.filter(|t| [" in ", " of "].contains(&t[1])).map(|t| (t[0], t[2]));
        let is_missing = |(name, path): &(&str, &str)| {
            let is_named = |file: &&String| *file == path || file.ends_with(&format!("/{path}"));
            let mut named = files.iter().filter(is_named).peekable();
            let last = name.rsplit("::").next().unwrap_or_default();
            let is_name = last.chars().all(|c| c.is_alphanumeric() || c == '_');
            is_name && named.peek().is_some() && !named.any(|file| contains_word(file, last))
        };
        pairs.filter(is_missing).collect()
    }

    #[test]
    fn names_that_the_architecture_places_in_a_file_are_in_that_file() {
        let text = std::fs::read_to_string(crate::root().join("ARCHITECTURE.md")).unwrap();
        let files = listed(&crate::root()).unwrap();
        assert_eq!(missing_names(&text, &files), []);
        let planted = "`Folder` in `files/src/lib.rs`, `gone` of `files/src/lib.rs`, `x` in `none.rs`";
        assert_eq!(missing_names(planted, &files), [("gone", "files/src/lib.rs")]);
    }

    /// Files of `core` and `shaders` that a text names and that do not exist. Paths with NAME in capitals are patterns, and ignored.
    fn missing_files(text: &str) -> Vec<&str> {
        let is_part = |c: char| c.is_alphanumeric() || "_-./".contains(c);
        let is_file = |word: &&str| {
            let end = Path::new(word).extension().and_then(|end| end.to_str()).unwrap_or_default();
            (word.starts_with("core/") || word.starts_with("shaders/"))
                && ["rs", "wgsl", "md", "txt", "toml"].contains(&end)
                && !word.contains("NAME")
        };
        let words = text.split(|c| !is_part(c)).map(|word| word.trim_end_matches('.'));
        words.filter(is_file).filter(|path| !crate::root().join(path).exists()).collect()
    }

    #[test]
    fn the_files_that_texts_name_exist() {
        let mut missing = Vec::new();
        for path in listed(&crate::root()).unwrap() {
            let Ok(content) = std::fs::read_to_string(crate::root().join(&path)) else { continue };
            for text in texts(&path, &content) {
                missing.extend(missing_files(&text.words).iter().map(|file| format!("{path}: {file}")));
            }
        }
        assert!(missing.is_empty(), "{}", missing.join("\n"));
        assert_eq!(missing_files("See core/gone.rs, and `core/cli/README.md`."), ["core/gone.rs"]);
    }

    #[test]
    fn planted_words_are_found_with_place_and_replacement() {
        let source =
            "/// Renders the twin.\npub fn f() {\n    // The shelf.\n    error(\"no bodies here\");\n}\n";
        let expected = [
            "a.rs:1: \"twin\": write CPU reference",
            "a.rs:3: \"shelf\": write visibility",
            "a.rs:4: \"bodies\": write characters, meshes or models",
        ];
        assert_eq!(found("a.rs", source), expected);
        assert_eq!(
            found("README.md", "Text.\nSo many\nlines."),
            ["README.md:2: \"so many\": write N, or the number itself"]
        );
        assert_eq!(found("a.rhai", "let a = 1; // posed once\n").len(), 1);
    }

    #[test]
    fn code_names_tests_and_allowed_phrases_are_left_alone() {
        let source =
            "/// The corners of the image; `twin`; cpu_twin; Twin::new.\nfn f() { g(\"twin\", 'x'); }\n";
        assert_eq!(found("a.rs", source), Vec::<String>::new());
        assert_eq!(
            found("a.rs", "#[cfg(test)]\nmod tests {\n    /// A twin.\n    fn f() {}\n}\n"),
            Vec::<String>::new()
        );
        assert_eq!(found("a.rs", "/// The corners of a triangle.\nfn f() {}\n").len(), 2);
    }

    #[test]
    fn a_doc_comment_that_begins_as_a_fragment_or_riddle_is_found() {
        let message = "a.rs:2: a doc comment begins with \"Of\": begin with what the thing is or does";
        assert_eq!(found("a.rs", "\n/// Of a mesh.\n/// In a scene.\nstruct S;\n"), [message]);
        assert_eq!(found("a.rs", "/// What is drawn.\nstruct S;\n").len(), 1);
        assert_eq!(
            found("a.rs", "/// Vertices of a mesh.\n///\n/// In a scene.\nstruct S;\n"),
            Vec::<String>::new()
        );
    }
}
