//! Extraction of the texts in a source file that people read.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A doc comment, `///` or `//!`.
    Doc,
    Comment,
    /// String literal that contains a space: a message or help text.
    Message,
    /// A paragraph of Markdown.
    Prose,
}

/// A text, with the line on which it begins.
#[derive(Debug)]
pub(super) struct Text {
    pub kind: Kind,
    pub line: usize,
    pub words: String,
}

/// Doc comments, comments and messages of Rust code, except in test modules.
pub(super) fn texts_of_rust(source: &str) -> Vec<Text> {
    let end = source.find("#[cfg(test)]\nmod ").unwrap_or(source.len());
    let source = &source[..end];
    let mut texts: Vec<Text> = Vec::new();
    let mut rest = source;
    while let Some(at) = rest.find(['/', '"', '\'', 'r']) {
        let from = source.len() - rest.len() + at;
        let text = &source[from..];
        let (kind, length) = token(source, from);
        if let Some(kind) = kind {
            let line = source[..from].matches('\n').count() + 1;
            add(&mut texts, kind, line, &text[..length]);
        }
        rest = &text[length..];
    }
    texts
}

/// Kind and length of the comment or literal that begins at a byte; other characters are skipped.
fn token(source: &str, from: usize) -> (Option<Kind>, usize) {
    let text = &source[from..];
    let line = || text.find('\n').unwrap_or(text.len());
    let named = source[..from].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let hashes = text.strip_prefix('r').map_or(0, |t| t.len() - t.trim_start_matches('#').len());
    if text.starts_with("///") || text.starts_with("//!") {
        (Some(Kind::Doc), line())
    } else if text.starts_with("//") {
        (Some(Kind::Comment), line())
    } else if text.starts_with("/*") {
        (Some(Kind::Comment), text.find("*/").map_or(text.len(), |end| end + 2))
    } else if text.starts_with('r')
        && text[1 + hashes..].starts_with('"')
        && (!named || source[..from].ends_with('b'))
    {
        let open = hashes + 2;
        let close = format!("\"{}", "#".repeat(hashes));
        (Some(Kind::Message), text[open..].find(&close).map_or(text.len(), |end| open + end + close.len()))
    } else if text.starts_with('"') {
        (Some(Kind::Message), quoted(text))
    } else if let Some(inner) = text.strip_prefix('\'') {
        // A character literal; a lifetime has no closing quote nearby.
        if inner.starts_with('\\') {
            return (None, text[3..].find('\'').map_or(1, |end| end + 4));
        }
        let length = inner.chars().next().map_or(0, char::len_utf8);
        (None, if inner[length..].starts_with('\'') { length + 2 } else { 1 })
    } else {
        (None, 1)
    }
}

/// Length of a string literal, including its quotes.
fn quoted(text: &str) -> usize {
    let mut escaped = false;
    let end = text[1..].find(|c| {
        let ends = c == '"' && !escaped;
        escaped = c == '\\' && !escaped;
        ends
    });
    end.map_or(text.len(), |end| end + 2)
}

/// Adds a text; consecutive lines of a comment form one text.
fn add(texts: &mut Vec<Text>, kind: Kind, line: usize, token: &str) {
    let words = match kind {
        Kind::Doc => &token[3..],
        Kind::Comment => &token[2..],
        _ => token,
    };
    // A literal without a space is a name or key.
    if kind == Kind::Message && !words.contains(' ') {
        return;
    }
    match texts.last_mut() {
        Some(last)
            if kind != Kind::Message
                && last.kind == kind
                && last.line + last.words.matches('\n').count() + 1 == line =>
        {
            last.words.push('\n');
            last.words.push_str(words);
        }
        _ => texts.push(Text { kind, line, words: words.to_string() }),
    }
}

/// Paragraphs of Markdown, without code blocks.
pub(super) fn texts_of_markdown(source: &str) -> Vec<Text> {
    let mut texts: Vec<Text> = Vec::new();
    let (mut code, mut begins) = (false, true);
    for (index, line) in source.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            code = !code;
        } else if !code && !begins && !line.trim().is_empty() && !texts.is_empty() {
            let last = texts.len() - 1;
            texts[last].words.push('\n');
            texts[last].words.push_str(line);
        } else if !code && !line.trim().is_empty() {
            texts.push(Text { kind: Kind::Prose, line: index + 1, words: line.to_string() });
        }
        begins = code || line.trim().is_empty() || line.trim_start().starts_with("```");
    }
    texts
}

/// Comments of a script or shader, `//` to the end of the line.
pub(super) fn texts_of_comments(source: &str) -> Vec<Text> {
    let mut texts = Vec::new();
    for (index, line) in source.lines().enumerate() {
        if let Some((_, comment)) = line.split_once("//") {
            add(&mut texts, Kind::Comment, index + 1, &format!("//{comment}"));
        }
    }
    texts
}
