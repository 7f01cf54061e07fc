//! The parts of Markdown that the guide uses: code blocks, links, and the anchors of headings.

use std::collections::BTreeSet;
use std::ops::Range;

/// A fenced block of code.
#[derive(Debug, PartialEq)]
pub struct Block {
    /// Line of the opening fence, from 1.
    pub line: usize,
    /// The words after the opening fence: `rhai,fragment`.
    pub info: String,
    pub text: String,
}

impl Block {
    /// Whether the block is a script.
    pub fn is_script(&self) -> bool {
        self.info.split(',').next() == Some("rhai")
    }

    /// Whether the script is a part of one, marked `rhai,fragment`.
    pub fn is_fragment(&self) -> bool {
        self.info.split(',').any(|word| word == "fragment")
    }
}

pub fn blocks(text: &str) -> Vec<Block> {
    let mut found: Vec<Block> = Vec::new();
    let mut is_open = false;
    for (number, line) in (1..).zip(text.lines()) {
        match (line.trim_start().strip_prefix("```"), found.last_mut()) {
            (Some(_), _) if is_open => is_open = false,
            (Some(info), _) => {
                is_open = true;
                found.push(Block { line: number, info: info.trim().to_string(), text: String::new() });
            }
            (None, Some(block)) if is_open => {
                block.text.push_str(line);
                block.text.push('\n');
            }
            _ => {}
        }
    }
    found
}

/// The text with spaces in place of code, fenced or between backticks. Every byte stays at its place.
pub fn without_code(text: &str) -> String {
    let blank = |part: &str| part.bytes().map(|b| if b == b'\n' { '\n' } else { ' ' }).collect::<String>();
    let mut plain = String::with_capacity(text.len());
    let (mut is_fenced, mut is_code) = (false, false);
    for line in text.split_inclusive('\n') {
        let is_fence = line.trim_start().starts_with("```");
        if is_fence || is_fenced {
            plain.push_str(&blank(line));
            is_fenced ^= is_fence;
            continue;
        }
        // A blank line ends a paragraph, and what was left open in it.
        is_code &= !line.trim().is_empty();
        for (number, part) in line.split('`').enumerate() {
            if number > 0 {
                plain.push(' ');
                is_code = !is_code;
            }
            plain.push_str(&if is_code { blank(part) } else { part.to_string() });
        }
    }
    plain
}

/// `[text](target)`, or an image, `![text](target)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// The span from `[` or `![` to `)`.
    pub whole: Range<usize>,
    pub text: Range<usize>,
    pub target: Range<usize>,
    pub is_image: bool,
}

/// The links of a text, by the ends of their targets: an image inside of a link comes before it.
pub fn links(text: &str) -> Vec<Link> {
    let plain = without_code(text);
    let bytes = plain.as_bytes();
    let (mut open, mut found) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < bytes.len() {
        match bytes[at] {
            b'[' => open.push(at),
            // A blank line ends a paragraph, and its brackets.
            b'\n' if bytes.get(at + 1) == Some(&b'\n') => open.clear(),
            b']' => {
                let start = open.pop();
                let end = plain[at..].find(')').map(|length| at + length);
                if let (Some(start), Some(end), Some(b'(')) = (start, end, bytes.get(at + 1)) {
                    let is_image = start > 0 && bytes[start - 1] == b'!';
                    let whole = start - usize::from(is_image)..end + 1;
                    found.push(Link { whole, text: start + 1..at, target: at + 2..end, is_image });
                    at = end;
                }
            }
            _ => {}
        }
        at += 1;
    }
    found
}

/// The anchors of the headings, as mdBook makes them.
pub fn anchors(text: &str) -> BTreeSet<String> {
    let plain = without_code(text);
    let mut found = BTreeSet::new();
    for (line, shown) in text.lines().zip(plain.lines()) {
        if shown.starts_with('#') {
            let id = anchor(line.trim_start_matches('#').trim());
            let number = (1..).find(|n| !found.contains(&format!("{id}-{n}"))).unwrap_or(1);
            let id = if found.contains(&id) { format!("{id}-{number}") } else { id };
            found.insert(id);
        }
    }
    found
}

/// The anchor of a heading: small letters, `-` for spaces, no other signs.
pub fn anchor(heading: &str) -> String {
    let letter = |c: char| match c {
        c if c.is_alphanumeric() || c == '_' || c == '-' => Some(c.to_lowercase().next().unwrap_or(c)),
        c if c.is_whitespace() => Some('-'),
        _ => None,
    };
    heading.chars().filter_map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "# The `stage`: first\n\nA [link](a.md#b), [![image](c.png)](d.md) and `[no](e.md)`.\n\n\
        ```rhai,fragment\nlet a = [1](2); // ü\n```\n# Again\n# Again\n";

    #[test]
    fn links_are_found_outside_of_code() {
        let found = links(PAGE);
        let targets: Vec<&str> = found.iter().map(|link| &PAGE[link.target.clone()]).collect();
        assert_eq!(targets, ["a.md#b", "c.png", "d.md"]);
        assert_eq!(found.iter().map(|link| link.is_image).collect::<Vec<_>>(), [false, true, false]);
        assert_eq!(&PAGE[found[1].whole.clone()], "![image](c.png)");
        assert_eq!(&PAGE[found[2].text.clone()], "![image](c.png)");
        assert_eq!(without_code(PAGE).len(), PAGE.len());
    }

    #[test]
    fn headings_and_blocks_are_found() {
        let expected = ["the-stage-first", "again", "again-1"].map(String::from);
        assert_eq!(anchors(PAGE), BTreeSet::from(expected));
        let found = blocks(PAGE);
        assert!(found.len() == 1 && found[0].is_script() && found[0].is_fragment());
        assert_eq!((found[0].line, found[0].text.as_str()), (5, "let a = [1](2); // ü\n"));
    }
}
