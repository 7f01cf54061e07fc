//! Writes the book's sources as mdBook reads them: pages, images and settings.

use crate::book::Book;
use crate::program;
use std::path::Path;

/// Width in pixels of an image, and of a frame of a contact sheet.
const IMAGE: u32 = 640;
const CELL: u32 = 240;

/// Writes the book into a folder, and draws its images.
pub fn write(book: &Book, root: &Path, out: &Path, binary: &Path) -> Result<(), String> {
    let src = out.join("src");
    let _ = std::fs::remove_dir_all(&src);
    let guide = root.join("scripts/guide");
    for name in ["book.toml", "guide.css"] {
        write_file(&out.join(name), &std::fs::read(guide.join(name)).map_err(|e| format!("{name}: {e}"))?)?;
    }
    write_file(&src.join("SUMMARY.md"), book.summary.as_bytes())?;
    for page in &book.pages {
        // mdBook colors no Rhai; its strings, comments and keywords are those of Rust.
        let text = page
            .text
            .replace("```rhai,fragment\n", "```rhai\n")
            .replace("```rhai\n", "```rust,noplayground\n");
        write_file(&src.join(&page.path), text.as_bytes())?;
    }
    for (place, file) in &book.copies {
        write_file(&src.join(place), &std::fs::read(file).map_err(|e| format!("{}: {e}", file.display()))?)?;
    }
    for (number, (place, drawing)) in (1..).zip(&book.drawings) {
        println!("{number} of {} images: {place}", book.drawings.len());
        let to = src.join(place);
        write_file(&to, &[])?;
        let width = if drawing.time.is_some() { IMAGE } else { CELL };
        program::draw(binary, drawing, &to, width, "4")?;
    }
    Ok(())
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let fail = |e: std::io::Error| format!("{}: {e}", path.display());
    std::fs::create_dir_all(path.parent().unwrap_or(path)).map_err(fail)?;
    std::fs::write(path, bytes).map_err(fail)
}
