//! The gallery: a page for each lesson, with frames of its scene and its script.

use crate::lesson::Lesson;
use crate::page::{Drawing, Page};
use crate::reference;

/// The page of a lesson, and its image with the place in the book.
pub fn page(lesson: &Lesson) -> (Page, String, Drawing) {
    let mut text = format!("# Lesson {}: {}\n\n", lesson.number, lesson.title);
    text += &format!("![Frames of the scene from the first to the last]({}.png)\n\n", lesson.name());
    text += &format!("`choreo render {} -o {}.mp4` renders it.\n\n", lesson.file, lesson.name());
    let calls = reference::called(&lesson.text);
    let links = calls.iter().map(|name| reference::link(name, "../reference/")).collect::<Vec<_>>();
    text += &format!("Calls: {}.\n\n", links.join(", "));
    text += &format!("```rhai\n{}\n```\n", lesson.text.trim_end());
    for (name, code) in &lesson.plugins {
        let language = if name.ends_with(".rhai") { "rust,noplayground" } else { "wgsl" };
        text += &format!("\n## {name}\n\n```{language}\n{}\n```\n", code.trim_end());
    }
    // Links of the page are relative to its own place.
    let source = format!("scripts/guide/src/gallery/{}.md", lesson.name());
    let page = Page { path: lesson.page(), source, text, is_own: false };
    let drawing = Drawing { script: lesson.path.clone(), time: None };
    (page, format!("gallery/{}.png", lesson.name()), drawing)
}
