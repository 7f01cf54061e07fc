//! Pages of the documentation, compiled in, because they do not lie beside an installed program: `choreo help` searches their headings and
//! tables, `choreo help --page NAME` prints one.

use choreo_script::help::{Call, is_in};

macro_rules! pages {
    ($($path:literal)*) => {
        &[$(($path, include_str!(concat!("../../../../", $path)))),*]
    };
}

/// Path in the sources, and text.
const PAGES: &[(&str, &str)] = pages!(
    "core/script/API.md"
    "core/cli/README.md"
    "core/viewer/README.md"
    "core/test_runner/README.md"
    "core/rhai_importer/README.md"
    "core/wgsl_effect/README.md"
    "plugins/README.md"
    "plugins/effects/ambient_occlusion/README.md"
    "plugins/effects/bloom/README.md"
    "plugins/effects/depth_of_field/README.md"
    "plugins/effects/edge_lines/README.md"
    "plugins/effects/film_grain/README.md"
    "plugins/effects/fog/README.md"
    "plugins/effects/fxaa/README.md"
    "plugins/effects/god_rays/README.md"
    "plugins/effects/grid/README.md"
    "plugins/effects/heat_haze/README.md"
    "plugins/effects/motion_blur/README.md"
    "plugins/effects/outline/README.md"
    "plugins/effects/shadow_catcher/README.md"
    "plugins/effects/skeleton/README.md"
    "plugins/effects/tonemap/README.md"
    "plugins/effects/toon/README.md"
    "plugins/effects/views/README.md"
    "plugins/effects/vignette/README.md"
    "plugins/effects/wireframe/README.md"
    "plugins/effects/xray/README.md"
    "plugins/export-csv/README.md"
    "plugins/export-gif/README.md"
    "plugins/export-gltf/README.md"
    "plugins/export-mp4/README.md"
    "plugins/export-png/README.md"
    "plugins/export-y4m/README.md"
    "plugins/import-bvh/README.md"
    "plugins/import-collada/README.md"
    "plugins/import-fbx/README.md"
    "plugins/import-gltf/README.md"
    "plugins/import-mannequin/README.md"
    "plugins/import-obj/README.md"
    "plugins/import-stl/README.md"
    "plugins/import-vrm/README.md"
);

/// The reference of scripts, which is searched entry by entry elsewhere.
const REFERENCE: &str = "core/script/API.md";

/// Paths of all pages.
pub fn names() -> impl Iterator<Item = &'static str> {
    PAGES.iter().map(|(path, _)| *path)
}

/// The page of a path, or of the end of a path that no other page has: `API.md`, `film_grain/README.md`.
pub fn text(name: &str) -> Option<&'static str> {
    let name = name.trim_start_matches("./");
    let exact = PAGES.iter().find(|(path, _)| *path == name);
    let mut ending = PAGES.iter().filter(|(path, _)| path.ends_with(&format!("/{name}")));
    let only = ending.next().filter(|_| ending.next().is_none());
    exact.or(only).map(|(_, text)| *text)
}

/// The headings with all words of a term, and the rows of tables about functions of that name.
pub fn find(term: &str) -> Vec<Call> {
    PAGES.iter().filter(|(path, _)| *path != REFERENCE).flat_map(|page| in_page(page, term)).collect()
}

fn in_page((path, text): &(&str, &str), term: &str) -> Vec<Call> {
    let (mut heading, mut found, mut is_code) = ("", Vec::new(), false);
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        is_code ^= line.starts_with("```");
        if is_code {
            continue;
        }
        let call = |usage: &str, about: Option<&str>, heading: &str| Call {
            usage: usage.to_string(),
            about: about.map(plain),
            details: Vec::new(),
            page: format!("{path}, \"{heading}\""),
        };
        if let Some(title) = line.strip_prefix('#') {
            heading = title.trim_start_matches('#').trim();
            let first = lines.clone().find(|line| !line.is_empty());
            if is_in(term, heading) {
                found.push(call(
                    heading,
                    first.filter(|line| !line.starts_with(['#', '|', '`', '!', '['])),
                    heading,
                ));
            }
        } else if let Some((usage, rest)) = line.strip_prefix("| `").and_then(|row| row.split_once('`'))
            && usage.split('(').next() == Some(term.trim_end_matches("()"))
            && usage.contains('(')
        {
            found.push(call(usage, rest.trim_start_matches([' ', '|']).split(" |").next(), heading));
        }
    }
    found
}

/// A line of Markdown without its marks.
fn plain(line: &str) -> String {
    line.trim().replace(['`', '*'], "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_found_by_path_or_its_end() {
        assert!(text("core/script/API.md").is_some_and(|page| page.contains("## Conventions")));
        assert_eq!(text("API.md"), text("./core/script/API.md"));
        assert!(text("film_grain/README.md").is_some_and(|page| page.contains("grain")));
        assert_eq!((text("README.md"), text("none.md")), (None, None));
    }

    #[test]
    fn headings_and_functions_are_found() {
        let found =
            |term: &str| find(term).into_iter().map(|call| (call.usage, call.page)).collect::<Vec<_>>();
        let inputs = "core/wgsl_effect/README.md, \"Inputs of effects on images\"".to_string();
        let depth = "depth_at(at: vec2<i32>) -> f32".to_string();
        assert_eq!(found("depth_at"), [(depth, inputs.clone())]);
        assert_eq!(found("effects inputs"), [("Inputs of effects on images".to_string(), inputs)]);
        assert_eq!(found("quaggaflux"), []);
    }
}
