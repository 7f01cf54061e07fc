//! Checks that packed programs work without anything else: the archive in an empty folder, the Debian package in a root folder with only
//! the libraries of the packages that it depends on.

use super::{folder, output, works};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// The first lesson, which needs no file.
const SCRIPT: &str = "share/choreo/examples/01_first_dance.rhai";

const SIZE: (u32, u32) = (160, 90);

/// Files below the prefix that users expect.
const EXPECTED: [&str; 13] = [
    "share/man/man1/choreo.1",
    "share/man/man1/choreo-render.1",
    "share/man/man1/choreo-view.1",
    "share/bash-completion/completions/choreo",
    "share/fish/vendor_completions.d/choreo.fish",
    "share/zsh/vendor-completions/_choreo",
    "share/applications/choreo-view.desktop",
    "share/icons/hicolor/256x256/apps/choreo.png",
    "share/doc/choreo/LICENSE",
    "share/doc/choreo/guide/index.html",
    "share/doc/choreo/THIRD-PARTY.md",
    "share/doc/choreo/licences/README.txt",
    "share/choreo/examples/models/flag.gltf",
];

/// Unpacks the archive and runs its programs.
pub(super) fn archive(file: &Path, name: &str) -> Result<(), String> {
    let root = folder().join("check");
    std::fs::create_dir_all(&root).map_err(|e| format!("{}: {e}", root.display()))?;
    output(Command::new("tar").arg("-xf").arg(file).arg("-C").arg(&root))?;
    let prefix = root.join(name);
    check_expected_files(&prefix)?;
    let program = |program: &str| {
        let mut command = Command::new(prefix.join("bin").join(program));
        command.current_dir(&prefix).env("CHOREO_PLUGINS", "");
        command
    };
    check_programs(&program, "frame.png", SCRIPT)?;
    check_frame(&prefix.join("frame.png"))?;
    remove(&root)
}

/// Installs the package with dpkg, and runs its programs under chroot.
pub(super) fn debian(file: &Path) -> Result<(), String> {
    let root = folder().join("check");
    for empty in ["var/lib/dpkg/info", "var/lib/dpkg/updates", "tmp"] {
        std::fs::create_dir_all(root.join(empty)).map_err(|e| format!("{}: {e}", root.display()))?;
    }
    std::fs::write(root.join("var/lib/dpkg/status"), "").map_err(|e| e.to_string())?;
    libraries(file, &root)?;
    // The libraries are there without their packages, so dependencies are not enforced. The host's rules that exclude files from packages
    // are overridden.
    let mut install = Command::new("dpkg");
    install.arg(format!("--root={}", root.display())).args(["--force-depends", "--force-not-root"]);
    output(install.args(["--path-include=/usr/share/*", "--install"]).arg(file))?;
    check_expected_files(&root.join("usr"))?;
    let program = |program: &str| {
        // A user who is not root needs a user namespace to change the root folder.
        let mut command = match works("sh", &["-c", "test \"$(id -u)\" = 0"]) {
            true => Command::new("chroot"),
            false => {
                let mut unshare = Command::new("unshare");
                unshare.args(["--map-root-user", "chroot"]);
                unshare
            }
        };
        command.arg(&root).arg(Path::new("/usr/bin").join(program));
        command.env_clear().env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin");
        command
    };
    check_programs(&program, "/tmp/frame.png", &format!("/usr/{SCRIPT}"))?;
    check_frame(&root.join("tmp/frame.png"))?;
    remove(&root)
}

fn remove(folder: &Path) -> Result<(), String> {
    std::fs::remove_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))
}

/// Copies the libraries of the packages that the package depends on, from this system.
fn libraries(package: &Path, root: &Path) -> Result<(), String> {
    // /lib and /lib64 are links, as in Debian.
    for (link, to) in [("lib", "usr/lib"), ("lib64", "usr/lib64")] {
        std::fs::create_dir_all(root.join(to)).map_err(|e| format!("{to}: {e}"))?;
        #[cfg(unix)]
        std::os::unix::fs::symlink(to, root.join(link)).map_err(|e| format!("{link}: {e}"))?;
        #[cfg(not(unix))]
        let _ = link;
    }
    let depends = output(Command::new("dpkg-deb").arg("--field").arg(package).arg("Depends"))?;
    let mut open = names(&depends);
    let mut done = BTreeSet::new();
    while let Some(name) = open.pop() {
        if !done.insert(name.clone()) {
            continue;
        }
        let format = "--showformat=${Depends}";
        open.extend(names(&output(Command::new("dpkg-query").args(["--show", format, &name]))?));
        let files = output(Command::new("dpkg").args(["--listfiles", &name]))?;
        let is_library = |file: &&str| file.contains(".so") && Path::new(file).is_file();
        for file in files.lines().filter(is_library) {
            // The file that a link points to is copied under the name of the link.
            let to = root.join(file.trim_start_matches('/'));
            super::tree::copy(Path::new(file), &to)?;
        }
    }
    Ok(())
}

/// Names of packages in a list of dependencies; of alternatives, the first one.
fn names(depends: &str) -> Vec<String> {
    let names = depends.split(',').filter_map(|one| one.split_whitespace().next());
    names.map(str::to_string).collect()
}

fn check_expected_files(prefix: &Path) -> Result<(), String> {
    let is_there = |file: &&str| {
        let packed = format!("{file}.gz");
        prefix.join(file).is_file() || prefix.join(packed).is_file()
    };
    let missing: Vec<&str> = EXPECTED.into_iter().filter(|file| !is_there(file)).collect();
    if missing.is_empty() { Ok(()) } else { Err(format!("not in the package: {}", missing.join(", "))) }
}

/// Checks that both programs print their version, and that one renders a frame of the first lesson.
fn check_programs(program: &dyn Fn(&str) -> Command, frame: &str, script: &str) -> Result<(), String> {
    for name in ["choreo", "choreo-view"] {
        let version = output(program(name).arg("--version"))?;
        if version.trim() != format!("{name} {}", env!("CARGO_PKG_VERSION")) {
            return Err(format!("{name} --version says {version:?}"));
        }
    }
    let size = format!("{}x{}", SIZE.0, SIZE.1);
    let render = ["render", script, "--at", "3", "--size", &size, "--device", "cpu", "-o", frame];
    output(program("choreo").args(render)).map(drop)
}

/// Checks that an image has the right size and more than one color.
fn check_frame(file: &Path) -> Result<(), String> {
    let fault = |what: &dyn std::fmt::Display| format!("{}: {what}", file.display());
    let open = std::fs::File::open(file).map_err(|e| fault(&e))?;
    let mut reader = png::Decoder::new(std::io::BufReader::new(open)).read_info().map_err(|e| fault(&e))?;
    let mut pixels = vec![0; reader.output_buffer_size().unwrap_or_default()];
    let info = reader.next_frame(&mut pixels).map_err(|e| fault(&e))?;
    let distinct: BTreeSet<&[u8]> = pixels.chunks(3).collect();
    match (info.width, info.height) == SIZE && distinct.len() > 100 {
        true => Ok(()),
        false => Err(fault(&format!("{}x{} pixels, {} colors", info.width, info.height, distinct.len()))),
    }
}
