//! The content of a file by assimp's command line (Debian: assimp-utils), by its export to JSON: the second importer.

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// One clip.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// The length in seconds, from 0.
    pub secs: f64,
    pub channels: usize,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    pub nodes: usize,
    /// Places of vertices, each once.
    pub points: usize,
    /// Faces of n vertices are n − 2.
    pub triangles: usize,
    /// Names of bones, each once.
    pub bones: usize,
    pub animations: Vec<Animation>,
    pub cameras: usize,
    pub lights: usize,
    /// Extent of all meshes at their nodes, unskinned, in the file's units and axes.
    pub extent: [[f64; 3]; 2],
}

/// `None` where assimp is not installed. The error is the end of its output.
pub fn scene(path: &Path, work: &Path) -> Option<Result<Scene, String>> {
    let out = work.join(format!("{}.json", path.file_name()?.to_string_lossy()));
    let _ = std::fs::remove_file(&out);
    let run = Command::new("assimp").arg("export").arg(path).arg(&out).arg("-fassjson").output().ok()?;
    let Ok(bytes) = std::fs::read(&out) else {
        let text = String::from_utf8_lossy(&run.stdout).trim().to_string();
        return Some(Err(text.lines().last().unwrap_or("no output").to_string()));
    };
    let _ = std::fs::remove_file(&out);
    Some(serde_json::from_slice(&bytes).map(|v: Value| of_json(&v)).map_err(|e| e.to_string()))
}

fn list<'v>(value: &'v Value, key: &str) -> &'v [Value] {
    value[key].as_array().map_or(&[], Vec::as_slice)
}

fn of_json(scene: &Value) -> Scene {
    let mut out = Scene {
        cameras: list(scene, "cameras").len(),
        lights: list(scene, "lights").len(),
        ..Scene::default()
    };
    let mut bones: Vec<&str> = Vec::new();
    let mut points = BTreeSet::new();
    for mesh in list(scene, "meshes") {
        let values = list(mesh, "vertices").iter().filter_map(Value::as_f64);
        let values: Vec<u32> = values.map(|v| (v as f32 + 0.0).to_bits()).collect();
        points.extend(values.chunks_exact(3).map(<[u32]>::to_vec));
        let vertices = list(mesh, "faces").iter().map(|f| f.as_array().map_or(0, Vec::len));
        out.triangles += vertices.map(|n| n.saturating_sub(2)).sum::<usize>();
        bones.extend(list(mesh, "bones").iter().filter_map(|b| b["name"].as_str()));
    }
    out.points = points.len();
    bones.sort_unstable();
    bones.dedup();
    out.bones = bones.len();
    for animation in list(scene, "animations") {
        let rate = animation["tickspersecond"].as_f64().filter(|r| *r > 0.0).unwrap_or(25.0);
        let secs = animation["duration"].as_f64().unwrap_or(f64::NAN) / rate;
        out.animations.push(Animation { secs, channels: list(animation, "channels").len() });
    }
    out.extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    walk(scene, &scene["rootnode"], &IDENTITY, &mut out);
    out
}

type Matrix = [f64; 16];
const IDENTITY: Matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// Rows.
fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| (0..4).map(|k| a[i / 4 * 4 + k] * b[k * 4 + i % 4]).sum())
}

fn walk(scene: &Value, node: &Value, parent: &Matrix, out: &mut Scene) {
    out.nodes += 1;
    let numbers: Vec<f64> = list(node, "transformation").iter().filter_map(Value::as_f64).collect();
    let own: Matrix = numbers.try_into().unwrap_or(IDENTITY);
    let world = product(parent, &own);
    for mesh in list(node, "meshes").iter().filter_map(Value::as_u64) {
        let values: Vec<f64> =
            list(&scene["meshes"][mesh as usize], "vertices").iter().filter_map(Value::as_f64).collect();
        for p in values.chunks_exact(3) {
            for axis in 0..3 {
                let row = &world[axis * 4..axis * 4 + 4];
                let at = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
                out.extent[0][axis] = out.extent[0][axis].min(at);
                out.extent[1][axis] = out.extent[1][axis].max(at);
            }
        }
    }
    list(node, "children").iter().for_each(|child| walk(scene, child, &world, out));
}
