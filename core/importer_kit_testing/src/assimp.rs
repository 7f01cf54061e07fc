//! Counts of assimp's command line (Debian: assimp-utils), as a second opinion.

use std::path::Path;
use std::process::Command;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Info {
    pub nodes: usize,
    pub meshes: usize,
    pub animations: usize,
    pub materials: usize,
    pub vertices: usize,
    pub faces: usize,
    pub bones: usize,
    pub cameras: usize,
    pub lights: usize,
    pub min: [f32; 3],
    pub max: [f32; 3],
}

/// Counts of a file. `None` if assimp is not installed; an error's text if it cannot read the file.
pub fn info(path: &Path) -> Option<Result<Info, String>> {
    let output = Command::new("assimp").arg("info").arg(path).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let value = |key: &str| text.lines().find(|l| l.starts_with(key)).map(|l| l[key.len()..].trim());
    let count = |key: &str| value(key).and_then(|v| v.split_whitespace().next()?.parse().ok()).unwrap_or(0);
    let point = |key: &str| -> [f32; 3] {
        let inside = value(key).unwrap_or_default().trim_matches(['(', ')']).to_string();
        let mut numbers = inside.split_whitespace().filter_map(|n| n.parse().ok());
        std::array::from_fn(|_| numbers.next().unwrap_or(f32::NAN))
    };
    if value("Vertices:").is_none() {
        return Some(Err(text));
    }
    Some(Ok(Info {
        nodes: count("Nodes:"),
        meshes: count("Meshes:"),
        animations: count("Animations:"),
        materials: count("Materials:"),
        vertices: count("Vertices:"),
        faces: count("Faces:"),
        bones: count("Bones:"),
        cameras: count("Cameras:"),
        lights: count("Lights:"),
        min: point("Minimum point"),
        max: point("Maximum point"),
    }))
}
