//! Search for files that another file names by a path of its author's machine.
//!
//! Files are opened only through [`Files`], which keeps to the folders that the user gave, and no folder is listed. Each place is tried
//! beside the file first, then in every search path.

use crate::text::shown;
use choreo_plugin::Files;
use std::sync::Arc;

/// Folders that exporters put images in, beside the model.
const IMAGE_FOLDERS: [&str; 3] = ["textures", "images", "maps"];
/// Largest number of folders at the end of a path that are tried with the name.
const MAX_PATH_FOLDERS: usize = 3;

/// The last part of a path of any system.
pub fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// Whether a path is absolute, on any system.
pub fn is_absolute(path: &str) -> bool {
    path.starts_with(['/', '\\']) || path.as_bytes().get(1) == Some(&b':')
}

/// Places to try for the paths that a file gives for one companion, best first: as written where that is relative to the file;
/// the name alone; the name in the usual folders; the name with the last folders of the path, as written and in lower case.
pub fn places(written: &[&str]) -> Vec<String> {
    let paths: Vec<String> =
        written.iter().map(|p| p.replace('\\', "/")).filter(|p| !file_name(p).is_empty()).collect();
    let mut out: Vec<String> = Vec::new();
    let mut add = |place: String| {
        if !out.contains(&place) {
            out.push(place);
        }
    };
    paths.iter().filter(|p| !is_absolute(p)).for_each(|p| add(p.trim_start_matches("./").to_string()));
    paths.iter().for_each(|p| add(file_name(p).to_string()));
    if let Some(first) = paths.first() {
        IMAGE_FOLDERS.iter().for_each(|folder| add(format!("{folder}/{}", file_name(first))));
    }
    for path in &paths {
        let parts: Vec<&str> = path.split('/').collect();
        for folders in 1..=MAX_PATH_FOLDERS.min(parts.len() - 1) {
            let tail = &parts[parts.len() - 1 - folders..];
            if tail.iter().any(|p| matches!(*p, "" | "." | "..") || p.ends_with(':')) {
                break;
            }
            let (name, above) = (tail[folders], tail[..folders].join("/"));
            add(format!("{above}/{name}"));
            add(format!("{}/{name}", above.to_lowercase()));
        }
    }
    out
}

/// Reads the first of these places that has a file. The error says why the first place could not be read.
pub fn read_first(files: &dyn Files, places: &[String]) -> Result<Arc<Vec<u8>>, String> {
    let mut first = None;
    for place in places {
        match files.read(place) {
            Ok(bytes) => return Ok(bytes),
            Err(why) => _ = first.get_or_insert(why),
        }
    }
    Err(first.unwrap_or_else(|| "it names no file".to_string()))
}

/// Message about an image or library at none of its [`places`]: its name, where it was searched for, and what to do. `why` is the
/// error of [`read_first`]; any reason other than a missing file is reported unchanged.
pub fn missing(written: &str, why: &str) -> String {
    let why_lower = why.to_lowercase();
    let absent =
        ["no such file", "not found", "leads out of", "lies outside", "absolute path", "there are no files"];
    if !absent.iter().any(|known| why_lower.contains(known)) {
        return why.to_string();
    }
    let name = shown(file_name(&written.replace('\\', "/")).as_bytes());
    let outside = if written.contains("..") { ", and folders above it are not read" } else { "" };
    format!(
        "\"{name}\" is not beside the file or in its {}{outside}; give its folder with --search",
        IMAGE_FOLDERS.map(|f| format!("{f}/")).join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absolute_paths_are_only_tried_by_their_last_parts() {
        assert_eq!(
            places(&[r"D:\work\Models\OBJ\wall.jpg"]),
            [
                "wall.jpg",
                "textures/wall.jpg",
                "images/wall.jpg",
                "maps/wall.jpg",
                "OBJ/wall.jpg",
                "obj/wall.jpg",
                "Models/OBJ/wall.jpg",
                "models/obj/wall.jpg",
                "work/Models/OBJ/wall.jpg",
                "work/models/obj/wall.jpg",
            ]
        );
        assert_eq!(places(&["/etc/passwd"])[0], "passwd");
        assert!(places(&["/etc/passwd", r"C:\x", r"\\server\x"]).iter().all(|p| !is_absolute(p)));
    }

    #[test]
    fn missing_files_have_a_short_message() {
        assert_eq!(
            missing(r"D:\gone\lost.png", "cannot read \"lost.png\": no such file in \"models\""),
            "\"lost.png\" is not beside the file or in its textures/, images/, maps/; give its folder with --search"
        );
        let large = "cannot read \"a.png\": it is too large";
        assert_eq!(missing("a.png", large), large);
    }

    #[test]
    fn relative_paths_are_tried_as_written_first() {
        assert_eq!(places(&[r".\art\skin.png"])[..2], ["art/skin.png", "skin.png"]);
        let up = places(&["../../secret/key"]);
        assert_eq!(up[..2], ["../../secret/key", "key"]);
        // Names that lead upwards are refused by `Files`, and no further ones are added.
        assert_eq!(up.iter().filter(|p| p.contains("..")).count(), 1);
        assert!(places(&["", "/", "a/"]).is_empty());
    }
}
