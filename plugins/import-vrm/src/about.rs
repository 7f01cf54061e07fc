//! Metadata of a file: title, authors, license.

use crate::json::At;
use choreo_asset::{Asset, Origin};
use import_gltf::profile::Document;

/// Longest text in characters; texts are shown on one line.
const MAX_TEXT_CHARS: usize = 300;

/// Reads the metadata of VRM 1.0 ("meta.md").
pub(crate) fn read(document: &Document<'_>, vrm: &At<'_>, asset: &mut Asset) {
    let mut about = About::new();
    if let Some(meta) = vrm.get("meta") {
        about.text(&meta, "title", "name");
        about.text(&meta, "version", "version");
        let authors: Vec<&str> = texts(&meta, "authors");
        about.add("authors", &authors.join(", "));
        about.text(&meta, "copyright", "copyrightInformation");
        about.text(&meta, "contact", "contactInformation");
        about.add("references", &texts(&meta, "references").join(", "));
        about.text(&meta, "licence", "licenseUrl");
        about.text(&meta, "other licence", "otherLicenseUrl");
        let keys = ["avatarPermission", "commercialUsage", "creditNotation", "modification"];
        let mut permissions: Vec<String> =
            keys.iter().filter_map(|k| Some(format!("{k} {}", meta.text(k)?))).collect();
        if let Ok(Some(allowed)) = meta.flag("allowRedistribution") {
            permissions.push(format!("redistribution {}", if allowed { "allowed" } else { "not allowed" }));
        }
        about.add("permissions", &permissions.join(", "));
    }
    let flags =
        |v: &At<'_>| v.list("meshAnnotations").map(|l| l.filter(|a| a.text("type") != Some("auto")).count());
    about.first_person(vrm.get("firstPerson").and_then(|f| flags(&f).ok()));
    asset.origin = origin(document, "VRM 1.0", about);
}

/// Reads the metadata of VRM 0.x ("VRM extension: Model information").
pub(crate) fn read_v0(document: &Document<'_>, vrm: &At<'_>, asset: &mut Asset) {
    let mut about = About::new();
    if let Some(meta) = vrm.get("meta") {
        about.text(&meta, "title", "title");
        about.text(&meta, "version", "version");
        about.text(&meta, "authors", "author");
        about.text(&meta, "contact", "contactInformation");
        about.text(&meta, "references", "reference");
        about.text(&meta, "licence", "licenseName");
        about.text(&meta, "other licence", "otherLicenseUrl");
        let keys = [("allowedUserName", "avatar"), ("commercialUssageName", "commercial use")];
        let permissions: Vec<String> =
            keys.iter().filter_map(|(key, label)| Some(format!("{label} {}", meta.text(key)?))).collect();
        about.add("permissions", &permissions.join(", "));
    }
    let flags = |v: &At<'_>| {
        v.list("meshAnnotations").map(|l| l.filter(|a| a.text("firstPersonFlag") != Some("Auto")).count())
    };
    about.first_person(vrm.get("firstPerson").and_then(|f| flags(&f).ok()));
    asset.origin = origin(document, "VRM 0.x", about);
}

/// Sets the origin of a VRM animation, which has no metadata but the program that wrote it.
pub(crate) fn read_animation(document: &Document<'_>, asset: &mut Asset) {
    asset.origin = origin(document, "VRM Animation 1.0", About::new());
}

fn origin(document: &Document<'_>, format: &str, about: About) -> Origin {
    Origin {
        unit_is_assumed: false,
        format: format.into(),
        importer: String::new(),
        writer: one_line(document.generator().unwrap_or_default()),
        metres_per_unit: Some(1.0),
        up: "+Y".into(),
        about: about.0,
    }
}

struct About(Vec<(String, String)>);

impl About {
    fn new() -> About {
        About(Vec::new())
    }

    fn add(&mut self, label: &str, text: &str) {
        let text = one_line(text);
        if !text.is_empty() {
            self.0.push((label.into(), text));
        }
    }

    fn text(&mut self, meta: &At<'_>, label: &str, key: &str) {
        self.add(label, meta.text(key).unwrap_or_default());
    }

    /// Notes how many meshes have a first-person setting, which is not used here.
    fn first_person(&mut self, meshes: Option<usize>) {
        if let Some(n @ 1..) = meshes {
            let meshes = if n == 1 { "1 mesh has".into() } else { format!("{n} meshes have") };
            self.add("first person", &format!("{meshes} a first-person setting, which is not used"));
        }
    }
}

fn texts<'a>(meta: &At<'a>, key: &str) -> Vec<&'a str> {
    let listed = meta.get(key).and_then(|at| at.as_texts());
    listed.unwrap_or_default()
}

/// The text on one line, without control characters, which could disturb a terminal.
fn one_line(text: &str) -> String {
    let words = text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|w| !w.is_empty());
    let line = words.collect::<Vec<_>>().join(" ");
    if line.chars().count() <= MAX_TEXT_CHARS {
        return line;
    }
    line.chars().take(MAX_TEXT_CHARS).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_become_one_line() {
        assert_eq!(one_line(" a\n\tb\u{1b}[31m c "), "a b [31m c");
        assert_eq!(one_line(&"x".repeat(1000)).chars().count(), MAX_TEXT_CHARS + 1);
    }
}
