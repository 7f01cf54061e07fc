//! Pages of the documentation, which are compiled into the program so that it can be installed alone. `choreo help` searches their headings
//! and tables, and `choreo help --page NAME` prints one.

use crate::App;
use choreo_script::help::{Call, words_occur_in_singular_or_plural};

/// A page: path in the sources, and text.
pub(crate) type PageText = (&'static str, &'static str);

/// Pages about the parts that every program on choreo has.
const COMMON_PAGES: [PageText; 5] = [
    (REFERENCE_PAGE, choreo_script::API),
    ("core/language_server/README.md", choreo_language_server::README),
    ("core/test_runner/README.md", choreo_test_runner::README),
    ("core/rhai_importer/README.md", choreo_rhai_importer::README),
    ("core/wgsl_effect/README.md", choreo_wgsl_effect::README),
];

/// Heading of the table of rules.
const RULES_HEADING: &str = "Rules of choreo check, and // allow:";

/// The script reference, which `choreo help` searches entry by entry elsewhere.
const REFERENCE_PAGE: &str = "core/script/API.md";

/// All pages; those of the program come last.
fn all_pages(app: &App) -> impl Iterator<Item = PageText> + Clone {
    COMMON_PAGES.into_iter().chain(app.pages.iter().copied())
}

/// Paths of all pages.
pub(crate) fn page_paths(app: &App) -> impl Iterator<Item = &'static str> {
    all_pages(app).map(|(path, _)| path)
}

/// Text of the page with this path. The end of a path is enough if no other page's path ends so: `API.md`, `film_grain/README.md`.
pub(crate) fn page_text(app: &App, name: &str) -> Option<&'static str> {
    let name = name.trim_start_matches("./");
    let exact = all_pages(app).find(|(path, _)| *path == name);
    let mut ending = all_pages(app).filter(|(path, _)| path.ends_with(&format!("/{name}")));
    let only = ending.next().filter(|_| ending.next().is_none());
    exact.or(only).map(|(_, text)| text)
}

/// Headings that contain all words of a term, and table rows about functions and rules of that name.
pub(crate) fn search_pages(app: &App, term: &str) -> Vec<Call> {
    let searched = |(path, _): &PageText| *path != REFERENCE_PAGE && path.ends_with(".md");
    all_pages(app).filter(searched).flat_map(|page| search_page(page, term)).collect()
}

/// A page with the text of the scripts that it includes (`{{#include ../../scenes/crowd.rhai}}`), if they are pages too.
pub(crate) fn with_scripts(app: &App, text: &str) -> String {
    let line = |line: &str| {
        let path = line.strip_prefix("{{#include ").and_then(|rest| rest.strip_suffix("}}"));
        let included = path.and_then(|path| page_text(app, path.trim_start_matches("../")));
        included.map_or(line, str::trim_end).to_string() + "\n"
    };
    text.lines().map(line).collect()
}

fn search_page((path, text): PageText, term: &str) -> Vec<Call> {
    let (mut heading, mut found, mut is_code) = ("", Vec::new(), false);
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        is_code ^= line.starts_with("```");
        if is_code {
            continue;
        }
        let call = |usage: &str, about: Option<&str>, heading: &str| Call {
            usage: usage.to_string(),
            about: about.map(strip_markdown),
            details: Vec::new(),
            page: format!("{path}, \"{heading}\""),
        };
        if let Some(title) = line.strip_prefix('#') {
            heading = title.trim_start_matches('#').trim();
            let first = lines.clone().find(|line| !line.is_empty());
            if words_occur_in_singular_or_plural(term, heading) {
                let about = first.filter(|line| !line.starts_with(['#', '|', '`', '!', '[']));
                let mut call = call(heading, about, heading);
                if heading == RULES_HEADING {
                    let rows = lines.clone().take_while(|line| !line.starts_with('#'));
                    call.details = rows.filter(|line| line.starts_with("| `")).map(rule_row_text).collect();
                }
                found.push(call);
            }
        } else if let Some((usage, rest)) = line.strip_prefix("| `").and_then(|row| row.split_once('`'))
            && usage.split('(').next() == Some(term.trim_end_matches("()"))
            && (usage.contains('(') || heading == RULES_HEADING)
        {
            found.push(call(usage, rest.trim_start_matches([' ', '|']).split(" |").next(), heading));
        }
    }
    found
}

/// A row of the table of rules as text: "gap: nothing plays".
fn rule_row_text(row: &str) -> String {
    strip_markdown(row.trim_matches(['|', ' '])).replacen(" |", ":", 1)
}

/// A line of Markdown without its markup.
fn strip_markdown(line: &str) -> String {
    line.trim().replace(['`', '*'], "")
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::Registry;

    fn app() -> App {
        let pages = vec![("plugins/a/README.md", "# a\n\nOne.\n"), ("plugins/b/README.md", "# b\n")];
        App { pages, ..App::new("choreo", "1", Registry::default()) }
    }

    #[test]
    fn pages_are_found_by_path_or_its_end() {
        let app = app();
        let text = |name: &str| page_text(&app, name);
        assert!(text("core/script/API.md").is_some_and(|page| page.contains("## Conventions")));
        assert_eq!(text("API.md"), text("./core/script/API.md"));
        assert_eq!(text("b/README.md"), Some("# b\n"));
        assert_eq!((text("README.md"), text("none.md")), (None, None));
    }

    #[test]
    fn included_scripts_are_inserted_into_pages() {
        let pages = vec![("g/scenes/a.rhai", "let x = 1;\n")];
        let app = App { pages, ..App::new("choreo", "1", Registry::default()) };
        let page = with_scripts(&app, "# a\n{{#include ../../scenes/a.rhai}}\n{{#include b.rhai}}\n");
        assert_eq!(page, "# a\nlet x = 1;\n{{#include b.rhai}}\n");
    }

    #[test]
    fn headings_and_functions_are_found() {
        let app = app();
        let rules = format!("# c\n\n## {RULES_HEADING}\n\n| `gap` | nothing plays |\n");
        let app = App { pages: vec![("core/cli/README.md", rules.leak())], ..app };
        let found = |term: &str| {
            search_pages(&app, term).into_iter().map(|call| (call.usage, call.page)).collect::<Vec<_>>()
        };
        let inputs = "core/wgsl_effect/README.md, \"Inputs of effects on images\"".to_string();
        let depth = "depth_at(at: vec2<i32>) -> f32".to_string();
        assert_eq!(found("depth_at"), [(depth, inputs.clone())]);
        assert_eq!(found("effects inputs"), [("Inputs of effects on images".to_string(), inputs)]);
        assert_eq!(found("gap"), [("gap".to_string(), format!("core/cli/README.md, \"{RULES_HEADING}\""))]);
        assert_eq!(
            found("allow"),
            [(RULES_HEADING.to_string(), format!("core/cli/README.md, \"{RULES_HEADING}\""))]
        );
        assert_eq!(search_pages(&app, "allow")[0].details, ["gap: nothing plays"]);
        let passes = "Passes with textures of their own".to_string();
        let page = format!("core/wgsl_effect/README.md, \"{passes}\"");
        assert!(found("pass").contains(&(passes, page)), "{:?}", found("pass"));
        assert_eq!(found("quaggaflux"), []);
    }
}
