//! From a file's write to the new frame, 200 times each for a script, an effect in WGSL, the renderer's own shaders and a GLB of
//! 5 MB: `cargo run --release -p choreo-live --example save_to_frame`.
//!
//! Each edit changes what is seen. The clock runs from before the write until the painter gives the frame of the new version;
//! what drawing this frame takes when nothing has changed is taken off.

use choreo_live::{Asked, Live, Painted, Painter, Recipe, Version};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::gpu::{GpuOptions, SteadyRenderer};
use choreo_render::{CpuRenderer, Renderer};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

const EDITS: usize = 200;
const PATIENCE: Duration = Duration::from_secs(60);

const SCRIPT: &str = r##"stage(#{ size: [640, 360], fps: 30, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" })).at(-0.6, 0.0, 0.0);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.5 });
let bob = cast("bob", load("choreo:mannequin", #{ color: "teal" })).at(0.6, 0.0, 0.0);
bob.play(moves.clip("Dance_Groove"));
cast("hill", load("hill.glb")).at(0.0, -0.1, 0.0);
camera("wide").at(0.0, 1.4, FAR).look_at([0.0, 0.9, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
ambient("white", 0.4);
effect("glow", #{ amount: 0.2 });
"##;

const GLOW: &str = "// effect: glow\n// about: brighter\n// version: 1\n// param amount = 0.5 in 0..1: how much\n\
    fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return color * (1.0 + BY * p[amount]);\n}\n";

/// A field of 370 × 370 vertices with normals, 5 MB, `height` metres high.
fn hill(height: f32) -> Vec<u8> {
    const SIDE: u32 = 370;
    let at = |i: u32| (i as f32 / (SIDE - 1) as f32 - 0.5) * 8.0;
    let mut positions = Vec::new();
    let mut indices: Vec<u8> = Vec::new();
    for row in 0..SIDE {
        for column in 0..SIDE {
            let (x, z) = (at(column), at(row));
            let y = height / (1.0 + x * x + z * z) - height;
            positions.extend([x, y, z].into_iter().flat_map(f32::to_le_bytes));
        }
    }
    for row in 0..SIDE - 1 {
        for column in 0..SIDE - 1 {
            let a = row * SIDE + column;
            let corners = [a, a + SIDE, a + 1, a + 1, a + SIDE, a + SIDE + 1];
            indices.extend(corners.into_iter().flat_map(u32::to_le_bytes));
        }
    }
    let (first, second, vertices) = (positions.len(), indices.len(), SIDE * SIDE);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"name":"hill"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],"buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{first}}},{{"buffer":0,"byteOffset":{first},"byteLength":{second}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","min":[-4,{},-4],"max":[4,0,4]}},
        {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}]}}"#,
        first + second,
        -height,
        second / 4,
    );
    let mut text = json.into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + first + second;
    for word in [2, total as u32, text.len() as u32, 0x4E4F_534A] {
        out.extend(word.to_le_bytes());
    }
    out.extend(&text);
    out.extend(((first + second) as u32).to_le_bytes());
    out.extend(0x004E_4942u32.to_le_bytes());
    out.extend(positions);
    out.extend(indices);
    out
}

struct Bench {
    versions: Receiver<Version>,
    painted: Receiver<Painted>,
    painter: Painter,
    _live: Live,
    ticket: u64,
    device: String,
}

impl Bench {
    fn new(folder: &Path, shaders: PathBuf) -> Result<Bench, Box<dyn Error>> {
        let mut registry = Registry::default();
        registry.add_importer(import_mannequin::Mannequin);
        registry.add_importer(import_gltf::GltfImporter);
        let (to, versions) = channel::<Version>();
        let recipe = Recipe { shaders: Some(shaders.clone()), ..Recipe::new(folder.join("a.rhai")) };
        let live = Live::start(recipe, &registry, move |v| drop(to.send(v)))?;
        let (to, painted) = channel::<Painted>();
        let start = move || -> Result<(Box<dyn Renderer>, Option<String>), String> {
            let options = GpuOptions { shader_dir: Some(shaders), ..GpuOptions::default() };
            Ok(match SteadyRenderer::new(options) {
                Ok(renderer) => (Box::new(renderer), None),
                Err(_) => (Box::new(CpuRenderer::new(&[])), None),
            })
        };
        let painter = Painter::start(Box::new(start), move |p| drop(to.send(p)))?;
        Ok(Bench { versions, painted, painter, _live: live, ticket: 0, device: String::new() })
    }

    /// The next version's frame; gives what drawing it again takes.
    fn next(&mut self) -> Result<(Duration, Duration), Box<dyn Error>> {
        let version = self.versions.recv_timeout(PATIENCE)?;
        if version.shaders {
            self.painter.shaders_changed();
        }
        let scene = version.scene.ok_or_else(|| format!("{:?}", version.problems))?;
        self.paint(&scene)?;
        let done = Instant::now();
        self.paint(&scene)?;
        Ok((done.elapsed(), version.took))
    }

    fn paint(&mut self, scene: &Arc<choreo_live::Scene>) -> Result<(), Box<dyn Error>> {
        self.ticket += 1;
        self.painter.ask(Asked::new(scene.clone(), Time::from_secs(1.0), 4, self.ticket));
        let painted = self.painted.recv_timeout(PATIENCE)?;
        if !painted.notes.is_empty() {
            return Err(painted.notes.join("; ").into());
        }
        self.device = painted.result?.device.name;
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let shaders = at("shaders");
    std::fs::create_dir(&shaders)?;
    for file in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders"))? {
        let file = file?;
        std::fs::copy(file.path(), shaders.join(file.file_name()))?;
    }
    let own = std::fs::read_to_string(shaders.join("scene.wgsl"))?;
    std::fs::write(at("a.rhai"), SCRIPT.replace("FAR", "5.0"))?;
    std::fs::write(at("glow.wgsl"), GLOW.replace("BY", "1.0"))?;
    std::fs::write(at("hill.glb"), hill(0.5))?;
    let mut bench = Bench::new(folder.path(), shaders.clone())?;
    bench.next()?;
    println!(
        "| edit | median ms | p95 ms | worst ms | of that the scene, median ms | a frame, ms |\n|---|---|---|---|---|---|"
    );
    let script = |n: usize| {
        (at("a.rhai"), SCRIPT.replace("FAR", &format!("{:.3}", 5.0 + n as f64 * 0.001)).into_bytes())
    };
    let effect = |n: usize| {
        (at("glow.wgsl"), GLOW.replace("BY", &format!("{:.3}", 1.0 + n as f64 * 0.001)).into_bytes())
    };
    let model = |n: usize| (at("hill.glb"), hill(0.5 + n as f32 * 0.001));
    let shader = |n: usize| (shaders.join("scene.wgsl"), format!("{own}\n// {n}\n").into_bytes());
    type Edit<'a> = &'a dyn Fn(usize) -> (PathBuf, Vec<u8>);
    let edits: [(&str, Edit); 4] = [
        ("a number of the script", &script),
        ("an effect in WGSL", &effect),
        ("a GLB of 5 MB", &model),
        ("the renderer's own scene.wgsl", &shader),
    ];
    for (name, edit) in edits {
        let (mut beyond, mut builds, mut frames) = (Vec::new(), Vec::new(), Vec::new());
        for n in 1..=EDITS {
            let (path, bytes) = edit(n);
            let start = Instant::now();
            std::fs::write(path, bytes)?;
            let (frame, build) = bench.next()?;
            beyond.push((start.elapsed() - frame).saturating_sub(frame));
            builds.push(build);
            frames.push(frame);
        }
        let millis = |times: &mut Vec<Duration>, part: usize| {
            times.sort();
            times[(times.len() - 1) * part / 100].as_secs_f64() * 1e3
        };
        let beyond: Vec<f64> = [50, 95, 100].map(|part| millis(&mut beyond, part)).to_vec();
        let (build, frame) = (millis(&mut builds, 50), millis(&mut frames, 50));
        println!(
            "| {name} | {:.1} | {:.1} | {:.1} | {build:.1} | {frame:.1} |",
            beyond[0], beyond[1], beyond[2]
        );
    }
    println!("\n{EDITS} edits each, 640×360, 4 samples, on {}", bench.device);
    Ok(())
}
