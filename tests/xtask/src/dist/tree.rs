//! The file tree of an archive or package: `bin` and `share`.

use super::licence_texts;
use crate::{book, cargo, root, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Paths of built programs.
pub(super) struct Built {
    choreo: PathBuf,
    view: PathBuf,
    manuals: PathBuf,
    guide: PathBuf,
}

impl Built {
    /// All programs are built by one call: a second call, with other features of clap, would build them again.
    pub(super) fn release() -> Result<Built, String> {
        let args = ["build", "--release", "--quiet", "-p", "choreo", "-p", "choreo-viewer"];
        let mut build = cargo(&args);
        build.args(["-p", "manuals", "-p", "guide"]);
        run(build, "cargo build --release")?;
        let target =
            std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
        Built::in_folder(&target.join("release"))
    }

    pub(super) fn in_folder(folder: &Path) -> Result<Built, String> {
        let program = |name: &str| {
            let file = folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
            if file.is_file() { Ok(file) } else { Err(format!("{}: does not exist", file.display())) }
        };
        Ok(Built {
            choreo: program("choreo")?,
            view: program("choreo-view")?,
            manuals: program("manuals")?,
            guide: program("guide")?,
        })
    }
}

/// Text files that are distributed with the programs.
const TEXTS: [&str; 4] = ["README.md", "CHANGELOG.md", "LICENSE", "THIRD-PARTY.md"];

/// Sizes of the icon in pixels.
const ICONS: [u32; 3] = [48, 128, 256];

/// Writes the file tree below a folder that does not exist yet.
pub(super) fn write(built: &Built, to: &Path) -> Result<(), String> {
    let (bin, share) = (to.join("bin"), to.join("share"));
    for program in [&built.choreo, &built.view] {
        copy(program, &bin.join(program.file_name().unwrap_or_default()))?;
    }
    std::fs::create_dir_all(&share).map_err(|e| format!("{}: {e}", share.display()))?;
    let mut manuals = Command::new(&built.manuals);
    manuals.arg(&share);
    run(manuals, "manuals")?;
    let docs = share.join("doc/choreo");
    for text in TEXTS {
        copy(&root().join(text), &docs.join(text))?;
    }
    licence_texts::write(&docs.join("licences"))?;
    guide(built, &docs.join("guide"))?;
    copy_tracked("scripts", |name| !name.starts_with("guide/"), &share.join("choreo/examples"))?;
    desktop(built, &share)
}

fn desktop(built: &Built, share: &Path) -> Result<(), String> {
    let from = root().join("core/viewer/desktop");
    copy(&from.join("choreo-view.desktop"), &share.join("applications/choreo-view.desktop"))?;
    copy(&from.join("choreo.xml"), &share.join("mime/packages/choreo.xml"))?;
    for size in ICONS {
        let icon = share.join(format!("icons/hicolor/{size}x{size}/apps/choreo.png"));
        std::fs::create_dir_all(icon.parent().unwrap_or(share)).map_err(|e| e.to_string())?;
        let mut render = Command::new(&built.choreo);
        render.env("CHOREO_PLUGINS", "").arg("render").arg(from.join("icon.rhai"));
        render.args(["--quiet", "--device", "cpu", "--at", "1", "--samples", "4", "--size"]);
        render.arg(format!("{size}x{size}")).arg("-o").arg(icon);
        run(render, "the icon")?;
    }
    Ok(())
}

/// Copies the guide, as a website, or as Markdown if mdBook can neither be found nor installed.
fn guide(built: &Built, to: &Path) -> Result<(), String> {
    match book::website(Command::new(&built.guide)) {
        Ok(website) => copy_folder(&website, to),
        Err(why) => {
            println!("{why}: the guide is packed as Markdown");
            copy_tracked("scripts/guide", |_| true, to)
        }
    }
}

/// Copies a folder recursively.
fn copy_folder(from: &Path, to: &Path) -> Result<(), String> {
    let entries = std::fs::read_dir(from).map_err(|e| format!("{}: {e}", from.display()))?;
    entries.flatten().try_for_each(|entry| {
        let to = to.join(entry.file_name());
        if entry.path().is_dir() { copy_folder(&entry.path(), &to) } else { copy(&entry.path(), &to) }
    })
}

/// Copies the files below a folder that are tracked by git, which excludes files left by a run or an editor.
fn copy_tracked(folder: &str, is_wanted: impl Fn(&str) -> bool, to: &Path) -> Result<(), String> {
    let mut list = Command::new("git");
    list.args(["ls-files", "-z", "--", "."]).current_dir(root().join(folder));
    let names = super::output(&mut list)?;
    let mut names = names.split('\0').filter(|name| !name.is_empty() && is_wanted(name)).peekable();
    if names.peek().is_none() {
        return Err(format!("git knows no files below {folder}"));
    }
    names.try_for_each(|name| copy(&root().join(folder).join(name), &to.join(name)))
}

pub(super) fn copy(from: &Path, to: &Path) -> Result<(), String> {
    let folder = to.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    std::fs::copy(from, to).map(drop).map_err(|e| format!("{}: {e}", from.display()))
}
