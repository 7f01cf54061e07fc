//! `cargo xtask dist`: packs the programs and their files into an archive for this platform, and into a Debian package if cargo-deb runs.
//! With `--check` both are unpacked or installed in an empty environment, and run.

mod check;
mod licence_texts;
mod tree;

use crate::setup::works;
use crate::{cargo, root, run};
use std::path::{Path, PathBuf};
use std::process::Command;
use tree::Built;

/// Output folder.
fn folder() -> PathBuf {
    root().join("target/dist")
}

pub(crate) fn dist(args: &[&str]) -> Result<(), String> {
    let (checks, programs) = match args {
        [] => (false, None),
        ["--check"] => (true, None),
        ["--programs", folder] => (false, Some(*folder)),
        ["--check", "--programs", folder] | ["--programs", folder, "--check"] => (true, Some(*folder)),
        _ => return Err("dist takes --check, and --programs DIR for programs that are built already".into()),
    };
    let built = match programs {
        Some(folder) => Built::in_folder(&root().join(folder))?,
        None => Built::release()?,
    };
    let platform = platform()?;
    let out = folder();
    // Results of an earlier call must not be mistaken for new ones.
    match std::fs::remove_dir_all(&out) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(format!("{}: {e}", out.display())),
        _ => {}
    }
    // The folder's name is repeated in core/cli/Cargo.toml, which lists the files for cargo-deb.
    let staged = out.join("tree");
    tree::write(&built, &staged)?;
    let package = debian(&out)?;
    let name = format!("choreo-{}-{platform}", env!("CARGO_PKG_VERSION"));
    std::fs::rename(&staged, out.join(&name)).map_err(|e| format!("{name}: {e}"))?;
    let archive = archive(&out, &name)?;
    if checks {
        check::archive(&archive, &name)?;
        package.as_deref().map(check::debian).transpose()?;
    }
    for file in package.iter().chain([&archive]) {
        let bytes = std::fs::metadata(file).map_err(|e| format!("{}: {e}", file.display()))?.len();
        println!("{}: {:.1} MB", file.display(), bytes as f64 / 1e6);
    }
    Ok(())
}

/// Target triple of the host, such as "x86_64-unknown-linux-gnu".
fn platform() -> Result<String, String> {
    let output = output(Command::new("rustc").arg("-vV"))?;
    let host = output.lines().find_map(|line| line.strip_prefix("host: ")).map(str::to_string);
    host.ok_or_else(|| "rustc -vV names no host".into())
}

/// Runs a program and returns its standard output; fails if the program fails.
fn output(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().display().to_string();
    let output = command.output().map_err(|e| format!("{name} did not start: {e}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(format!("{name} failed: {}", String::from_utf8_lossy(&output.stderr).trim())),
    }
}

/// Packs a folder: as .tar.gz, or as .zip on Windows, whose `tar` chooses the format by the extension.
fn archive(out: &Path, name: &str) -> Result<PathBuf, String> {
    let ending = if cfg!(windows) { "zip" } else { "tar.gz" };
    let file = out.join(format!("{name}.{ending}"));
    let mut tar = Command::new("tar");
    tar.arg("-acf").arg(&file).arg("-C").arg(out).arg(name);
    run(tar, "tar")?;
    Ok(file)
}

/// Builds the Debian package of the staged files with cargo-deb, which is installed below `target` if it is missing; `None` on systems
/// without dpkg.
fn debian(out: &Path) -> Result<Option<PathBuf>, String> {
    if !works("dpkg-deb", &["--version"]) {
        println!("no dpkg-deb here: no Debian package");
        return Ok(None);
    }
    let tools = root().join("target/tools");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(tools.join("bin")).chain(std::env::split_paths(&path)));
    let path = path.map_err(|e| format!("PATH: {e}"))?;
    let here = std::env::split_paths(&path).any(|folder| folder.join("cargo-deb").is_file());
    if !here {
        let mut install = cargo(&["install", "--quiet", "--locked", "cargo-deb", "--root"]);
        install.arg(&tools);
        run(install, "cargo install cargo-deb")?;
    }
    let mut deb = cargo(&["deb", "--quiet", "--no-build", "--no-strip", "--package", "choreo", "--output"]);
    deb.arg(out).env("PATH", path);
    run(deb, "cargo deb")?;
    let files = std::fs::read_dir(out).map_err(|e| format!("{}: {e}", out.display()))?;
    let mut files = files.filter_map(|entry| Some(entry.ok()?.path()));
    let package = files.find(|file| file.extension().is_some_and(|ending| ending == "deb"));
    package.map(Some).ok_or_else(|| "cargo deb wrote no package".into())
}

#[cfg(test)]
mod tests {
    use crate::root;

    /// CI runs what a person runs.
    #[test]
    fn commands_of_the_workflow_exist() {
        let read = |path: &str| std::fs::read_to_string(root().join(path)).unwrap();
        let (workflow, known) = (read(".ci/release.yml"), read("tests/xtask/src/main.rs"));
        let commands: Vec<&str> = workflow
            .lines()
            .filter_map(|line| line.trim().strip_prefix("- run: cargo xtask ")?.split(' ').next())
            .collect();
        assert_eq!(commands, ["package", "dist"]);
        for command in commands {
            assert!(known.contains(&format!("[\"{command}\"")), "{command}");
        }
        for system in ["ubuntu", "windows", "macos"] {
            assert!(workflow.contains(system), "{system}");
        }
    }

    /// The desktop entry names the program, the icon and the types of the other files.
    #[test]
    fn desktop_files_agree_with_each_other() {
        let read =
            |name: &str| std::fs::read_to_string(root().join("core/viewer/desktop").join(name)).unwrap();
        let (entry, types) = (read("choreo-view.desktop"), read("choreo.xml"));
        let value = |key: &str| entry.lines().find_map(|line| line.strip_prefix(key)).unwrap().to_string();
        assert_eq!((value("Exec=").as_str(), value("Icon=").as_str()), ("choreo-view %f", "choreo"));
        assert!(value("MimeType=").ends_with(';') && value("MimeType=").contains("text/x-rhai;"));
        assert!(types.contains("<mime-type type=\"text/x-rhai\">") && types.contains("*.rhai"));
    }
}
