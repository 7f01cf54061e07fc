//! Programs that the tests need besides cargo: a Vulkan driver, the validation layers, ffmpeg as a second decoder, assimp as a second
//! importer.

use std::path::Path;
use std::process::{Command, Stdio};

/// Debian or Ubuntu package, the program that it provides, and a file that shows that it is installed.
const NEEDED_PACKAGES: [(&str, &str, &[&str]); 17] = [
    ("libvulkan1", "Vulkan loader", &["libvulkan.so.1"]),
    (
        "mesa-vulkan-drivers",
        "Vulkan driver (lavapipe)",
        &[
            "/usr/share/vulkan/icd.d/lvp_icd.x86_64.json",
            "/usr/share/vulkan/icd.d/lvp_icd.aarch64.json",
            "/usr/share/vulkan/icd.d/lvp_icd.json",
        ],
    ),
    (
        "vulkan-validationlayers",
        "validation layers",
        &["/usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json"],
    ),
    ("libwayland-client0", "library that the driver loads", &["libwayland-client.so.0"]),
    ("ffmpeg", "second decoder of the videos we write", &["/usr/bin/ffmpeg"]),
    ("xvfb", "window system without a screen", &["/usr/bin/Xvfb"]),
    ("xdotool", "simulated input for the tests of the windows", &["/usr/bin/xdotool"]),
    ("imagemagick", "screenshots of those windows", &["/usr/bin/convert"]),
    ("sway", "Wayland compositor without a screen", &["/usr/bin/sway"]),
    ("grim", "screenshots of its output", &["/usr/bin/grim"]),
    ("libx11-xcb1", "window library", &["libX11-xcb.so.1"]),
    ("libxcursor1", "window library", &["libXcursor.so.1"]),
    ("libxi6", "window library", &["libXi.so.6"]),
    ("libxkbcommon-x11-0", "window library", &["libxkbcommon-x11.so.0"]),
    ("dbus", "message bus for the tests of the windows", &["/usr/bin/dbus-daemon"]),
    (
        "at-spi2-core",
        "registry of assistive technologies",
        &["/usr/share/dbus-1/services/org.a11y.Bus.service"],
    ),
    ("assimp-utils", "second importer that ours are compared with", &["/usr/bin/assimp"]),
];

const LIBRARY_FOLDERS: [&str; 6] = [
    "/usr/lib/x86_64-linux-gnu",
    "/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
    "/lib/aarch64-linux-gnu",
    "/usr/lib",
    "/usr/lib64",
];

fn all_exist(files: &[&str]) -> bool {
    files.iter().any(|file| {
        if file.starts_with('/') {
            Path::new(file).exists()
        } else {
            LIBRARY_FOLDERS.iter().any(|folder| Path::new(folder).join(file).exists())
        }
    })
}

pub(crate) fn works(program: &str, args: &[&str]) -> bool {
    Command::new(program)
        .args(args)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

/// Installs missing packages if apt and root (or sudo without a password) are available; otherwise prints the commands. Never fails: a test
/// that lacks something reports it and is counted as skipped.
pub(crate) fn install() {
    let missing: Vec<_> = NEEDED_PACKAGES.iter().filter(|(_, _, files)| !all_exist(files)).collect();
    if missing.is_empty() {
        return;
    }
    for (package, what, _) in &missing {
        println!("missing: {what} (package {package})");
    }
    let packages: Vec<&str> = missing.iter().map(|(package, ..)| *package).collect();
    let by_hand =
        format!("apt-get update && apt-get install -y --no-install-recommends {}", packages.join(" "));
    if !works("apt-get", &["--version"]) {
        println!("this is no Debian or Ubuntu; the packages there would be: {}", packages.join(" "));
        return;
    }
    let sudo: &[&str] = if works("sh", &["-c", "test \"$(id -u)\" = 0"]) {
        &[]
    } else if works("sudo", &["-n", "true"]) {
        &["sudo", "-n"]
    } else {
        println!("to install what is missing, as root: {by_hand}");
        return;
    };
    let apt = |args: &[&str]| {
        let line: Vec<&str> = sudo.iter().copied().chain(["apt-get"]).chain(args.iter().copied()).collect();
        Command::new(line[0])
            .args(&line[1..])
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .status()
            .is_ok_and(|s| s.success())
    };
    println!("installing: {}", packages.join(" "));
    apt(&["-qq", "update"]);
    let install = ["-qq", "install", "-y", "--no-install-recommends"];
    let args: Vec<&str> = install.into_iter().chain(packages.iter().copied()).collect();
    if !apt(&args) {
        println!("the installation failed; by hand, as root: {by_hand}");
    }
}
