//! Image strips of README.md and scripts/README.md: frames of a script side by side. Also strips of any script, to inspect a motion frame
//! by frame.

use crate::contact::{finish, read};
use crate::{lessons, release_binary, root, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Script, base name of the images, and times in seconds.
const STRIPS: [(&str, &str, [&str; 5]); 2] = [
    ("scripts/01_first_dance.rhai", "first_dance", ["1.6", "3.2", "4.9", "7.6", "9.4"]),
    ("scripts/11_root_motion.rhai", "in_step", ["2.0", "2.15", "2.3", "2.45", "2.6"]),
];

pub(crate) fn strip() -> Result<(), String> {
    let choreo = release_binary()?;
    let folder = root().join("tests/pictures");
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for (script, name, times) in STRIPS {
        for (i, time) in times.iter().enumerate() {
            let out = folder.join(format!("{name}_{}.png", i + 1));
            let mut command = Command::new(&choreo);
            command.args(["render", script, "--quiet", "--size", "384x216", "--samples", "4"]);
            command.args(["--device", "cpu", "--at", time, "-o"]).arg(&out).current_dir(root());
            run(command, "choreo render")?;
        }
        println!("wrote {} images of {script} to tests/pictures", times.len());
    }
    Ok(())
}

/// Number of frames in the strip of any script, spread evenly over its length.
const FRAMES_IN_STRIP: usize = 20;

/// Runs `cargo xtask strip SCRIPT`: twenty frames from the first to the last, row by row, in `target/strips/NAME.png`.
pub(crate) fn of(script: &str) -> Result<(), String> {
    let choreo = release_binary()?;
    let path = Path::new(script);
    let stem = |p: &Path| p.file_stem().map(|name| name.to_string_lossy().into_owned());
    // A lesson in its own folder has the name of the folder.
    let name = match (stem(path), path.parent().and_then(stem)) {
        (Some(name), Some(folder)) if name == "lesson" => folder,
        (Some(name), _) => name,
        _ => return Err(format!("{script}: not the name of a script")),
    };
    let strips = root().join("target/strips");
    let frames = strips.join(&name);
    let _ = std::fs::remove_dir_all(&frames);
    std::fs::create_dir_all(&frames).map_err(|e| format!("{}: {e}", frames.display()))?;
    let (width, height) = lessons::SIZE;
    let mut render = Command::new(&choreo);
    render.arg("render").arg(path).args(["--quiet", "--device", "cpu", "--samples", "4"]);
    render.args(["--size", &format!("{width}x{height}"), "-o"]).arg(frames.join("%04d.png"));
    finish(render, script)?;
    let mut pictures: Vec<PathBuf> = std::fs::read_dir(&frames)
        .map_err(|e| format!("{}: {e}", frames.display()))?
        .flatten()
        .map(|entry| entry.path())
        .filter(|p| p.extension().is_some_and(|e| e == "png"))
        .collect();
    pictures.sort();
    let shown = pictures.len().min(FRAMES_IN_STRIP);
    let mut shots = Vec::new();
    for index in 0..shown {
        let at = index * (pictures.len() - 1) / (shown - 1).max(1);
        println!("{:>3}  {}", index + 1, pictures[at].file_name().unwrap_or_default().to_string_lossy());
        shots.push(read(&pictures[at])?);
    }
    let sheet = strips.join(format!("{name}.png"));
    lessons::write(&sheet, &shots)?;
    println!("{} of {} frames: {}", shown, pictures.len(), sheet.display());
    Ok(())
}
