//! Lines of source below messages, with a caret.

/// Whether a character steers the terminal: a control character, or one of Unicode's bidirectional algorithm (UAX #9), which changes the
/// order in which text is displayed.
///
/// ```
/// use choreo_plugin::excerpt::steers_terminal;
/// assert!(steers_terminal('\u{202e}') && steers_terminal('\x1b') && !steers_terminal('é'));
/// ```
pub fn steers_terminal(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The part of a line to show, and how many characters of it come before the column, which counts characters from 1. Indentation is
/// dropped, tabs become blanks, and of a very long line only the surroundings of the column are kept.
///
/// ```
/// assert_eq!(choreo_plugin::excerpt::excerpt("\tlet x = y;", 10), ("let x = y;".into(), 8));
/// ```
pub fn excerpt(line: &str, column: usize) -> (String, usize) {
    const WIDTH: usize = 160;
    let shown = |c: char| match c {
        c if c.is_control() => ' ',
        c if steers_terminal(c) => '\u{fffd}',
        c => c,
    };
    let chars: Vec<char> = line.chars().map(shown).collect();
    let indent = chars.iter().take_while(|c| **c == ' ').count();
    let at = column.saturating_sub(1).min(chars.len());
    let mut start = indent.min(at);
    if at - start > WIDTH - 40 {
        start = at - (WIDTH - 40);
    }
    let end = chars.len().min(start + WIDTH);
    let shown: String = chars[start..end].iter().collect();
    (shown.trim_end().to_string(), at - start)
}

/// The text below a message: the line, and on the next one a caret below the column. Empty for a blank line.
///
/// ```
/// assert_eq!(choreo_plugin::excerpt::below("    return colr;", 12), "\n    return colr;\n           ^");
/// assert_eq!(choreo_plugin::excerpt::below("  ", 1), "");
/// ```
pub fn below(line: &str, column: usize) -> String {
    let (shown, before) = excerpt(line, column);
    match shown.trim().is_empty() {
        true => String::new(),
        false => format!("\n    {shown}\n    {}^", " ".repeat(before)),
    }
}
