//! The time and memory that the viewer takes, measured on a real window without a screen: `cargo test --release -p choreo -p
//! choreo-viewer --test figures --
//! --ignored --nocapture`. Lines for the README; the device and the machine's load are part of them.

#![cfg(target_os = "linux")]

mod screen;

use screen::Screen;
use screen::viewer_process::ViewerProcess;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A script of fifteen lines.
const SHORT: &str = r##"stage(#{ size: [1280, 720], fps: 30, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", load("choreo:mannequin", #{ color: "#f2694b" }));
ada.at(-0.6, 0.0, 0.0);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.5 });
let bob = cast("bob", load("choreo:mannequin", #{ color: "#1d9a94" }));
bob.at(0.6, 0.0, 0.0);
bob.play(moves.clip("Dance_Groove"));
let floor = cast("floor", shape("plane", #{ size: [8.0, 8.0] }));
floor.at(0.0, 0.0, 0.0);
camera("wide").at(0.0, 1.4, 5.0).look_at([0.0, 0.9, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9], shadow: true });
ambient("white", 0.4);
marker("hello", 2.0);
"##;

const SCRIPT: &str = r##"stage(#{ size: [640, 360], fps: 30, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", load("choreo:mannequin", #{ color: "#f2694b" })).at(-0.6, 0.0, 0.0);
ada.play(moves.clip("Walk")).until(2.0)
    .then(moves.clip("Wave"), #{ fade: 0.5 });
let bob = cast("bob", load("choreo:mannequin", #{ color: "#1d9a94" })).at(0.6, 0.0, 0.0);
bob.play(moves.clip("Dance_Groove"));
cast("hill", load("hill.glb")).at(0.0, -0.1, 0.0);
camera("wide").at(0.0, 1.4, FAR).look_at([0.0, 0.9, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
ambient("white", 0.4);
effect("glow", #{ amount: 0.2 });
// COMMENT
"##;

const GLOW: &str = "// effect: glow\n// about: brighter\n// version: 1\n// param amount = 0.5 in 0..1: how much\n\
    fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return color * (1.0 + BY * p[amount]);\n}\n";

const EDITS: usize = 200;

fn part(sorted: &[f64], percent: usize) -> f64 {
    sorted[(sorted.len() - 1) * percent / 100]
}

fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    part(&all, 50)
}

fn load() -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().next().unwrap_or("?").to_string()
}

#[test]
#[ignore = "takes half a minute, and is a measurement"]
fn start_rest_and_memory() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("a.rhai");
    fs::write(&script, SHORT).unwrap();
    let start = || {
        let mut command = screen.command_on("auto", &[script.to_str().unwrap()], folder.path());
        command.env("XDG_CACHE_HOME", folder.path().join("cache"));
        let begin = Instant::now();
        let viewer = ViewerProcess::start(command);
        let (end, last) = viewer.shown(1);
        ((end - begin).as_secs_f64() * 1e3, viewer, last)
    };
    let (cold, viewer, _) = start();
    drop(viewer);
    const PARTS: [&str; 7] = [
        "event loop",
        "renderer",
        "scene",
        "window",
        "device of the window",
        "colors and fonts",
        "image drawn",
    ];
    let mut all = Vec::new();
    let mut parts: Vec<Vec<f64>> = vec![Vec::new(); PARTS.len() + 1];
    let mut frames = Vec::new();
    for _ in 0..15 {
        let mut command = screen.command_on("auto", &[script.to_str().unwrap()], folder.path());
        command.env("XDG_CACHE_HOME", folder.path().join("cache"));
        let begin = Instant::now();
        let viewer = ViewerProcess::start(command);
        let mut last;
        loop {
            last = viewer.next();
            let at = PARTS.iter().position(|p| last.1["event"] == *p).unwrap_or(PARTS.len());
            parts[at].push(last.1["ms"].as_f64().unwrap());
            if last.1["event"] == "shown" {
                break;
            }
        }
        all.push((last.0 - begin).as_secs_f64() * 1e3);
        frames.push(last.1["frame_ms"].as_f64().unwrap());
    }
    all.sort_by(f64::total_cmp);
    println!("| start of a script of 15 lines, 1280×720 | ms |\n|---|---|");
    println!("| first time, without a cache on the disk | {cold:.0} |");
    println!("| image on the screen, median of 15 | {:.0} |", part(&all, 50));
    println!("| worst of 15 | {:.0} |", part(&all, 100));
    for (name, times) in PARTS.iter().zip(parts) {
        if !times.is_empty() {
            println!("| … {name} at | {:.0} |", median(times));
        }
    }
    println!("| … of it the frame | {:.0} |", median(frames));
    let (_, viewer, last) = start();
    std::thread::sleep(Duration::from_secs(2));
    let before = viewer.processor_secs();
    std::thread::sleep(Duration::from_secs(10));
    println!("\nat rest {:.2} % of a core", (viewer.processor_secs() - before) * 10.0);
    println!(
        "memory {:.0} MB, of it {:.0} MB in files that are mapped (programs, drivers); on the device {:.1} MB",
        viewer.status("VmRSS") as f64 / 1e3,
        viewer.status("RssFile") as f64 / 1e3,
        last["bytes"].as_f64().unwrap() / 1e6
    );
    println!("on {}, load {}", last["device"], load());
}

/// A grid of 322 × 322 vertices with normals, 5 MB, `height` metres high.
fn hill(height: f32) -> Vec<u8> {
    const SIDE: u32 = 322;
    let at = |i: u32| (i as f32 / (SIDE - 1) as f32 - 0.5) * 8.0;
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    let mut indices: Vec<u8> = Vec::new();
    for row in 0..SIDE {
        for column in 0..SIDE {
            let (x, z) = (at(column), at(row));
            let round = 1.0 + x * x + z * z;
            let y = height / round - height;
            // Normal from the gradient of y.
            let slope = 2.0 * height / (round * round);
            let length = (1.0 + slope * slope * (x * x + z * z)).sqrt();
            let across = [slope * x / length, 1.0 / length, slope * z / length];
            normals.extend(across.into_iter().flat_map(f32::to_le_bytes));
            positions.extend([x, y, z].into_iter().flat_map(f32::to_le_bytes));
        }
    }
    for row in 0..SIDE - 1 {
        for column in 0..SIDE - 1 {
            let a = row * SIDE + column;
            let vertices = [a, a + SIDE, a + 1, a + 1, a + SIDE, a + SIDE + 1];
            indices.extend(vertices.into_iter().flat_map(u32::to_le_bytes));
        }
    }
    let (first, second, vertices) = (positions.len(), indices.len(), SIDE * SIDE);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"name":"hill"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":2}},"indices":1}}]}}],"buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{first}}},{{"buffer":0,"byteOffset":{first},"byteLength":{second}}},
        {{"buffer":0,"byteOffset":{},"byteLength":{first}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","min":[-4,{},-4],"max":[4,0,4]}},
        {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}},
        {{"bufferView":2,"componentType":5126,"count":{vertices},"type":"VEC3"}}]}}"#,
        first + second + first,
        first + second,
        -height,
        second / 4,
    );
    let mut text = json.into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + first + second + first;
    for word in [2, total as u32, text.len() as u32, 0x4E4F_534A] {
        out.extend(word.to_le_bytes());
    }
    out.extend(&text);
    out.extend(((first + second + first) as u32).to_le_bytes());
    out.extend(0x004E_4942u32.to_le_bytes());
    out.extend(positions);
    out.extend(indices);
    out.extend(normals);
    out
}

/// Latency from the moment before a file is written until the window shows the new version, minus the same for an edit that changes only
/// a comment. The two kinds of edit alternate, so that a busy machine slows both.
#[test]
#[ignore = "takes some minutes, and is a measurement"]
fn hot_reload_latency_from_save_to_image() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let shaders = at("shaders");
    fs::create_dir(&shaders).unwrap();
    for file in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders")).unwrap() {
        let file = file.unwrap();
        fs::copy(file.path(), shaders.join(file.file_name())).unwrap();
    }
    let own = fs::read_to_string(shaders.join("scene.wgsl")).unwrap();
    let script = |far: usize| SCRIPT.replace("FAR", &format!("{:.3}", 5.0 + far as f64 * 0.001));
    fs::write(at("a.rhai"), script(0)).unwrap();
    fs::write(at("glow.wgsl"), GLOW.replace("BY", "1.0")).unwrap();
    fs::write(at("hill.glb"), hill(0.5)).unwrap();
    let arguments = [at("a.rhai"), "--shaders".into(), shaders.clone()];
    let arguments: Vec<&str> = arguments.iter().map(|a| a.to_str().unwrap()).collect();
    let viewer = ViewerProcess::start(screen.command_on("auto", &arguments, folder.path()));
    let (_, first) = viewer.shown(1);
    type Edit<'a> = &'a dyn Fn(usize) -> (PathBuf, Vec<u8>);
    let edits: [(&str, f64, Edit); 4] = [
        ("a number of the script", 50.0, &|n| (at("a.rhai"), script(n).into_bytes())),
        ("an effect in WGSL", 150.0, &|n| {
            (at("glow.wgsl"), GLOW.replace("BY", &format!("{:.3}", 1.0 + n as f64 * 0.001)).into_bytes())
        }),
        ("the renderer's own scene.wgsl", 150.0, &|n| {
            (shaders.join("scene.wgsl"), format!("{own}\n// {n}\n").into_bytes())
        }),
        ("a GLB of 5 MB", 300.0, &|n| (at("hill.glb"), hill(0.5 + n as f32 * 0.001))),
    ];
    println!(
        "| edit | median ms | p95 ms | worst ms | wanted p95 | the frame alone, ms |\n|---|---|---|---|---|---|"
    );
    let mut version = 1;
    for (name, wanted, edit) in edits {
        let (mut beyond, mut frames) = (Vec::new(), Vec::new());
        for n in 1..=EDITS {
            let (path, bytes) = edit(n);
            let mut write = |path: &Path, bytes: &[u8]| {
                version += 1;
                let begin = Instant::now();
                fs::write(path, bytes).unwrap();
                let (end, shown) = viewer.shown(version);
                // A file that is written in two steps can cause two reloads.
                version = shown["version"].as_u64().unwrap();
                ((end - begin).as_secs_f64() * 1e3, shown["frame_ms"].as_f64().unwrap())
            };
            let (all, own) = write(&path, &bytes);
            let text = fs::read_to_string(at("a.rhai")).unwrap();
            let (_, frame) = write(&at("a.rhai"), format!("{text}// {n}\n").as_bytes());
            beyond.push(all - frame.min(own));
            frames.push(frame);
        }
        beyond.sort_by(f64::total_cmp);
        let [middle, high, worst] = [50, 95, 100].map(|percent| part(&beyond, percent));
        println!("| {name} | {middle:.1} | {high:.1} | {worst:.1} | {wanted:.0} | {:.1} |", median(frames));
    }
    println!("\n{EDITS} edits each, 640×360, 4 samples, on {}, load {}", first["device"], load());
}

/// Five hundred actors with ten clips each, each clip on its own line.
fn crowd() -> String {
    let mut script = String::from(
        "stage(#{ size: [320, 180], fps: 30, length: 60.0, samples: 1 });\nlet moves = load(\"choreo:mannequin\");\n",
    );
    for actor in 0..500 {
        let (x, z) = (actor % 25, actor / 25);
        script += &format!("let a{actor} = cast(\"a{actor}\", moves).at({x}.0, 0.0, -{z}.0);\n");
        for clip in 0..10 {
            let name = ["Walk", "Wave", "Run", "Dance_Groove"][(actor + clip) % 4];
            let (from, until) = (clip * 6, clip * 6 + 5);
            script += &format!("a{actor}.play(moves.clip(\"{name}\")).from({from}.0).until({until}.0);\n");
        }
    }
    script
        + "camera(\"wide\").at(12.0, 6.0, 14.0).look_at([12.0, 0.9, -5.0]);\nsun(#{ direction: [-0.6, -1.0, -0.9] });\n"
}

/// Frame times of the window while the sequencer of a large scene is scrolled and zoomed by the wheel and dragged by the middle button.
#[test]
#[ignore = "takes a minute, and is a measurement"]
fn five_thousand_bars_are_scrolled_and_zoomed() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("a.rhai");
    fs::write(&script, crowd()).unwrap();
    let viewer = ViewerProcess::start(screen.command_on("auto", &[script.to_str().unwrap()], folder.path()));
    let (_, shown) = viewer.shown(1);
    let window = screen.window();
    screen.rest(viewer.process.0.id());
    println!(
        "| wheel over the sequencer | frames | panels, median ms | 95 % below | worst | with drawing, median ms | 95 % below |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, x, key) in [
        ("over names: other rows", "60", None),
        ("with Shift: pans", "600", Some("shift")),
        ("zooms", "600", None),
    ] {
        screen.xdotool(&["mousemove", "--window", &window, x, "760"]);
        screen.rest(viewer.process.0.id());
        viewer.painted();
        key.map(|key| screen.xdotool(&["keydown", key]));
        for turn in 0..60 {
            screen.xdotool(&["click", if turn % 20 < 12 { "5" } else { "4" }]);
            std::thread::sleep(Duration::from_millis(40));
        }
        key.map(|key| screen.xdotool(&["keyup", key]));
        screen.save(&window, &format!("crowd_{name}.png"));
        let paints = viewer.painted();
        let of = |what: &str| {
            let mut all: Vec<f64> = paints.iter().map(|p| p[what].as_f64().unwrap()).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        let (panels, whole) = (of("panels_ms"), of("whole_ms"));
        println!(
            "| {name} | {} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} |",
            panels.len(),
            part(&panels, 50),
            part(&panels, 95),
            part(&panels, 100),
            part(&whole, 50),
            part(&whole, 95)
        );
    }
    println!(
        "\nmemory {:.0} MB, of it {:.0} MB in files that are mapped; on {}, load {}",
        viewer.status("VmRSS") as f64 / 1e3,
        viewer.status("RssFile") as f64 / 1e3,
        shown["device"],
        load()
    );
}

/// An effect that only takes time: a loop of TIMES iterations per pixel.
const HEAVY: &str = "// effect: heavy\n// about: takes its time\n// version: 1\n// param amount = 0.5 in 0..1: how much\n\
    fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    var sum = 0.0;\n    \
    for (var i = 0; i < TIMES; i = i + 1) {\n        sum = sum + fract(sum * 1.7 + uv.x * f32(i));\n    }\n    \
    return color * (1.0 + 0.0001 * p[amount] * fract(sum));\n}\n";

/// Moving characters, so that each frame differs.
const DANCERS: &str = r##"stage(#{ size: [640, 360], fps: 30, length: 8.0 });
let moves = load("choreo:mannequin");
for n in 0..4 { cast(`d${n}`, moves).at(n - 1.5, 0.0, 0.0).play(moves.clip("Dance_Groove")); }
camera("wide").at(0.0, 1.5, 5.0).look_at([0.0, 0.9, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
effect("heavy");
"##;

/// Times of the viewer's clock and of the frames, as the viewer reports them.
struct Seen {
    /// Time at which an image was on the screen, milliseconds of the viewer's clock.
    at: f64,
    frame: f64,
    when: Instant,
}

/// Upper limit of one measurement's duration.
const LIMIT: Duration = Duration::from_secs(120);

/// A viewer with slow frames, and the time at which the measurement ends.
struct Slow<'s> {
    screen: &'s Screen,
    viewer: &'s ViewerProcess,
    window: String,
    end: Instant,
}

impl Slow<'_> {
    fn image(&self, patience: Duration) -> Option<Seen> {
        let (when, shown) = self.viewer.shown_before(self.end.min(Instant::now() + patience))?;
        let number = |name: &str| shown[name].as_f64().unwrap_or(f64::NAN);
        Some(Seen { at: number("ms"), frame: number("frame_ms"), when })
    }

    fn to(&self, x: usize, y: usize) {
        let place = [x.to_string(), y.to_string()];
        self.screen.xdotool(&["mousemove", "--window", &self.window, &place[0], &place[1]]);
    }

    /// Waits until no more images arrive.
    fn quiet(&self, frame: Duration) {
        while self.image(frame * 2).is_some() {}
    }

    /// Latencies of single mouse moves with the button down until their image is on the screen, in multiples of the frame time.
    fn moves(&self, y: usize, frame: Duration) -> Vec<f64> {
        self.to(300, y);
        self.quiet(frame);
        self.screen.xdotool(&["mousedown", "1"]);
        self.quiet(frame);
        let mut ratios = Vec::new();
        for step in 1..=8 {
            self.viewer.meanwhile();
            let begin = Instant::now();
            self.to(300 + step * 40, y);
            let Some(seen) = self.image(frame * 10) else { break };
            ratios.push((seen.when - begin).as_secs_f64() * 1e3 / seen.frame);
            self.quiet(frame);
        }
        self.screen.xdotool(&["mouseup", "1"]);
        ratios.sort_by(f64::total_cmp);
        ratios
    }

    /// Moves the mouse to and fro at one height 125 times per second for `secs`. Returns the images shown meanwhile.
    fn glide(&self, y: usize, secs: f64) -> Vec<Seen> {
        let steps = (secs / 0.008) as usize;
        let moves: Vec<String> = (0..steps)
            .flat_map(|n| {
                let x = (300 + (n % 600)).to_string();
                ["mousemove", "--window", &self.window, &x, &y.to_string(), "sleep", "0.008"]
                    .map(str::to_string)
            })
            .collect();
        self.screen.xdotool(&moves.iter().map(String::as_str).collect::<Vec<_>>());
        std::iter::from_fn(|| self.image(Duration::from_millis(100))).collect()
    }
}

/// Measures the latency from a mouse move to its image, the images during continuous movement, and the redraws of the window while a frame
/// takes one second, which an effect is made slow enough for. Every wait has a time limit; late results are left out and reported.
#[test]
#[ignore = "takes two minutes, and is a measurement"]
fn drags_and_scrubs_stay_smooth_while_frames_render_slowly() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let heavy =
        |times: usize| fs::write(at("heavy.wgsl"), HEAVY.replace("TIMES", &times.to_string())).unwrap();
    heavy(20);
    fs::write(at("a.rhai"), DANCERS).unwrap();
    let script = at("a.rhai");
    let viewer = ViewerProcess::start(screen.command_on("auto", &[script.to_str().unwrap()], folder.path()));
    let end = Instant::now() + LIMIT;
    let Some((_, first)) = viewer.shown_before(end) else {
        return println!("no image within {} s: the machine is too busy to measure", LIMIT.as_secs());
    };
    let window = screen.window();
    let slow = Slow { screen: &screen, viewer: &viewer, window, end };
    // More iterations until a frame takes one second.
    let (mut times, mut frame) = (20, first["frame_ms"].as_f64().unwrap());
    while frame < 1000.0 && times < 100_000 {
        times = ((times as f64 * (1300.0 / frame.max(1.0)).min(8.0)) as usize).max(times + 1);
        heavy(times);
        let Some(seen) = slow.image(LIMIT) else { break };
        frame = seen.frame;
    }
    let one = Duration::from_secs_f64(frame / 1e3);
    println!("a frame takes {frame:.0} ms on {}, load {}\n", first["device"], load());
    println!("| the mouse | images | to the screen, in frame times, median | worst |\n|---|---|---|---|");
    let ruler = 636;
    for (name, y) in [("scrubs on the ruler", ruler), ("turns the camera", 300)] {
        let ratios = slow.moves(y, one);
        match ratios.is_empty() {
            true => println!("| {name} | 0: none came in time | | |"),
            false => println!(
                "| {name} | {} | {:.2} | {:.2} |",
                ratios.len(),
                part(&ratios, 50),
                part(&ratios, 100)
            ),
        }
    }
    // While the mouse keeps moving, frames follow each other.
    slow.to(300, ruler);
    slow.screen.xdotool(&["mousedown", "1"]);
    slow.viewer.meanwhile();
    let images = slow.glide(ruler, 8.0 * one.as_secs_f64().min(2.0));
    slow.screen.xdotool(&["mouseup", "1"]);
    let gaps: Vec<f64> = images.windows(2).map(|pair| (pair[1].at - pair[0].at) / pair[1].frame).collect();
    match gaps.is_empty() {
        true => println!("\nno two images came while it scrubbed"),
        false => println!("\nwhile it scrubs without a rest: an image every {:.2} frame times", median(gaps)),
    }
    slow.quiet(one);
    // A frame is requested, and the mouse moves over the bars while it is drawn.
    slow.screen.save(&slow.window, "slow_frames.png");
    viewer.painted();
    slow.to(1100, ruler);
    screen.xdotool(&["click", "1"]);
    let mut images = Vec::new();
    while images.is_empty() && Instant::now() < end {
        images = slow.glide(760, 0.5);
    }
    let Some(seen) = images.first() else { return println!("the frame did not come in time") };
    let number = |paint: &serde_json::Value, name: &str| paint[name].as_f64().unwrap_or(f64::NAN);
    let drawn = seen.at - seen.frame..seen.at;
    let paints: Vec<_> = viewer.painted().into_iter().filter(|p| drawn.contains(&number(p, "ms"))).collect();
    let all = |name: &str| paints.iter().map(|paint| number(paint, name)).collect::<Vec<_>>();
    let (panels, whole) = (all("panels_ms"), all("whole_ms"));
    println!(
        "the window is drawn {:.0} times a second while a frame takes {:.0} ms: {:.1} ms each, {:.1} ms of it panels; load {}",
        paints.len() as f64 / (seen.frame / 1e3),
        seen.frame,
        if whole.is_empty() { f64::NAN } else { median(whole) },
        if panels.is_empty() { f64::NAN } else { median(panels) },
        load()
    );
}
