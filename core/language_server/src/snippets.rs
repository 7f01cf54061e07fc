//! Snippets: calls with placeholders, and templates of statements.

use choreo_script::describe::Entry;

/// Templates for the start of a statement: label, description, text.
pub(crate) const STATEMENT_TEMPLATES: &[(&str, &str, &str)] = &[
    (
        "character",
        "A model on stage that plays a clip",
        "let ${1:hero}_file = load(\"${2:hero.glb}\");\nlet ${1:hero} = cast(\"${1:hero}\", ${1:hero}_file).at(${3:0}, 0, ${4:0});\n${1:hero}.play(${1:hero}_file.clip(\"${5:Walk}\"))$0;",
    ),
    (
        "shot",
        "A camera with a cut to it",
        "camera(\"${1:wide}\").at(${2:0}, ${3:1.6}, ${4:5}).look_at(${5:[0, 1, 0]}).cut(${6:0})$0;",
    ),
    ("test", "A test section", "test(\"${1:name}\", || {\n    $0\n});"),
    ("fn", "A function", "fn ${1:name}(${2:actor}) {\n    $0\n}"),
    ("for", "A loop", "for ${1:item} in ${2:items} {\n    $0\n}"),
    ("if", "A condition", "if ${1:condition} {\n    $0\n}"),
    ("import", "A module", "import \"${1:steps}\" as ${2:steps};"),
    ("let", "A variable", "let ${1:name} = $0;"),
];

/// A call with placeholders for required arguments: `cast("${1:name}", ${2:asset})`. `is_text`: whether an argument of a name is a string.
pub(crate) fn call_snippet(entry: &Entry, is_text: &dyn Fn(&str) -> bool) -> String {
    let Some(form) = entry.forms.first() else { return entry.name.to_string() };
    let arguments = form.iter().enumerate().map(|(index, argument)| {
        let number = index + 1;
        match *argument {
            "options" => format!("#{{ ${number} }}"),
            "callback" => format!("|${{{number}:t}}| {{\n    $0\n}}"),
            "section" | "build" => "|| {\n    $0\n}".to_string(),
            name if is_text(name) => format!("\"${{{number}:{name}}}\""),
            name => format!("${{{number}:{name}}}"),
        }
    });
    format!("{}({})", entry.name, arguments.collect::<Vec<_>>().join(", "))
}

/// Text of a snippet without placeholders, for clients that do not support snippets.
pub(crate) fn without_placeholders(snippet: &str) -> String {
    let mut text = String::new();
    let mut rest = snippet;
    while let Some(at) = rest.find('$') {
        text.push_str(&rest[..at]);
        rest = &rest[at + 1..];
        if let Some(inside) = rest.strip_prefix('{') {
            let end = inside.find('}').unwrap_or(inside.len());
            text.push_str(inside[..end].split_once(':').map_or("", |(_, name)| name));
            rest = inside.get(end + 1..).unwrap_or("");
        } else {
            rest = rest.trim_start_matches(|c: char| c.is_ascii_digit());
        }
    }
    text + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_script::describe;

    #[test]
    fn calls_have_placeholders_for_required_arguments() {
        let of = |on: &str, name: &str| {
            call_snippet(describe::entry(on, name).unwrap(), &|argument| argument == "name")
        };
        assert_eq!(of("", "cast"), "cast(\"${1:name}\", ${2:asset})");
        assert_eq!(of("Actor", "play"), "play(${1:clip})");
        assert_eq!(of("Cue", "loop"), "loop()");
        assert_eq!(without_placeholders(&of("", "cast")), "cast(\"name\", asset)");
        assert_eq!(without_placeholders("a${1:b}$0;"), "ab;");
    }
}
