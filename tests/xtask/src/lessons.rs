//! `cargo xtask lessons`: renders one image of every numbered script, `tests/pictures/lessons/NN.png`, for `scripts/README.md`.

use crate::contact::{Shot, finish, read};
use crate::{cargo, root, run, target};
use std::io::BufWriter;
use std::path::PathBuf;
use std::process::Command;

pub(crate) const SIZE: (usize, usize) = (240, 135);
const COLUMNS: usize = 5;
/// Time of the image in seconds, unless `TIME_OF_LESSON` has another.
const DEFAULT_TIME: &str = "2.0";
/// Lessons that look best at another time.
const TIME_OF_LESSON: [(&str, &str); 5] =
    [("01", "3.2"), ("05", "2.6"), ("08", "1.0"), ("19", "1.0"), ("26", "2.6")];

pub(crate) fn lessons() -> Result<(), String> {
    run(cargo(&["build", "--quiet", "--workspace", "--bin", "choreo"]), "cargo build")?;
    let choreo = target().join("debug").join(format!("choreo{}", std::env::consts::EXE_SUFFIX));
    let work = target().join("lessons");
    std::fs::create_dir_all(&work).map_err(|e| format!("{}: {e}", work.display()))?;
    let mut scripts: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(root().join("scripts")).map_err(|e| format!("scripts: {e}"))?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if !name.starts_with(|c: char| c.is_ascii_digit()) {
            continue;
        }
        // A lesson may be a folder with more files than its script.
        let inner = entry.path().join("lesson.rhai");
        scripts.push(if entry.path().is_dir() { inner } else { entry.path() });
    }
    scripts.sort();
    let folder = root().join("tests/pictures/lessons");
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for script in &scripts {
        let shown = script.strip_prefix(root().join("scripts")).unwrap_or(script).display().to_string();
        let number = shown.get(..2).unwrap_or(&shown);
        let time = TIME_OF_LESSON
            .iter()
            .find(|(lesson, _)| *lesson == number)
            .map_or(DEFAULT_TIME, |(_, time)| time);
        let out = work.join("lesson.png");
        let mut render = Command::new(&choreo);
        render.arg("render").arg(script).args(["--quiet", "--device", "cpu", "--samples", "4", "--at", time]);
        // Rendered at twice the size and then halved, so that lines of a few pixels stay thin.
        render.args(["--size", &format!("{}x{}", 2 * SIZE.0, 2 * SIZE.1), "-o"]).arg(&out);
        finish(render, &shown)?;
        write(&folder.join(format!("{number}.png")), &[halved(&read(&out)?)])?;
        println!("{shown}");
    }
    Ok(())
}

/// Halves the size; each pixel is the mean of four.
fn halved(shot: &Shot) -> Shot {
    let (width, height) = (shot.width / 2, shot.height / 2);
    let mut rgb = Vec::with_capacity(width * height * 3);
    for y in 0..height {
        for i in 0..width * 3 {
            let (x, channel) = (i / 3, i % 3);
            let at = |dx, dy| u16::from(shot.rgb[((2 * y + dy) * shot.width + 2 * x + dx) * 3 + channel]);
            rgb.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8);
        }
    }
    Shot { width, height, rgb }
}

/// Composes the images from left to right, row by row, in the order of their numbers.
pub(crate) fn write(path: &std::path::Path, shots: &[Shot]) -> Result<(), String> {
    let (width, height) = (SIZE.0 * COLUMNS.min(shots.len()), SIZE.1 * shots.len().div_ceil(COLUMNS));
    let mut rgb = vec![255; width * height * 3];
    for (index, shot) in shots.iter().enumerate() {
        let (left, top) = (index % COLUMNS * SIZE.0, index / COLUMNS * SIZE.1);
        for y in 0..shot.height.min(SIZE.1) {
            let (to, from) = (((top + y) * width + left) * 3, y * shot.width * 3);
            let bytes = shot.width.min(SIZE.0) * 3;
            rgb[to..to + bytes].copy_from_slice(&shot.rgb[from..from + bytes]);
        }
    }
    let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = std::fs::File::create(path).map_err(|e| fail(&e))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header().map_err(|e| fail(&e))?;
    writer.write_image_data(&rgb).map_err(|e| fail(&e))
}
