//! `cargo xtask contact [FILTER]`: describes every sample file of every format with `choreo info`, renders it turning while its first clip
//! plays, and checks that something is visible. The images are combined into sheets, `target/contact/*.png`, with four images of each file
//! from left to right, in the order printed.

use crate::{assets, cargo, root, run};
use std::collections::BTreeMap;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const EXTENSIONS: [&str; 9] = ["bvh", "dae", "fbx", "glb", "gltf", "obj", "stl", "vrm", "vrma"];
/// Number of images of a file, and number of files in a row of a sheet.
const SHOTS: usize = 4;
const FILES_IN_A_ROW: usize = 3;
const SIZE: (usize, usize) = (160, 120);

/// Files that are not visible: name, part of the message or "the images are blank", and the reason why that is right. It is an error if
/// such a file is visible after all.
const EXCEPTIONS: [(&str, &str, &str); 2] = [
    ("dae/lights.dae", "the images are blank", "four lights and no mesh"),
    ("fbx/ufbx/maya_anim_light_7500_binary.fbx", "the images are blank", "one light and no mesh"),
];

pub(crate) struct Shot {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<u8>,
}

pub(crate) fn contact(args: &[&str]) -> Result<(), String> {
    let filter = args.first().copied().unwrap_or_default();
    let assets = assets().ok_or("the shared assets are needed; CHOREO_ASSETS names their folder")?;
    run(cargo(&["build", "--quiet", "--workspace", "--bin", "choreo"]), "cargo build")?;
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let choreo = target.join("debug").join(format!("choreo{}", std::env::consts::EXE_SUFFIX));
    let work = target.join("contact");
    let _ = std::fs::remove_dir_all(&work);
    std::fs::create_dir_all(&work).map_err(|e| format!("{}: {e}", work.display()))?;
    let mut sheets: BTreeMap<String, Vec<Vec<Shot>>> = BTreeMap::new();
    let (mut wrong, mut shown) = (Vec::new(), 0);
    for file in files(&assets).into_iter().filter(|f| f.contains(filter)) {
        let expected = EXCEPTIONS.iter().find(|e| e.0 == file);
        match (show(&choreo, &assets, &work, &file), expected) {
            (Ok(shots), None) => {
                let sheet = file.split('/').next().unwrap_or_default().to_string();
                let row = sheets.entry(sheet.clone()).or_default();
                println!("{sheet} {:>3}  {file}", row.len() + 1);
                row.push(shots);
                shown += 1;
            }
            (Ok(_), Some(_)) => wrong.push(format!("{file} is visible, but still listed as an exception")),
            (Err(what), Some((_, words, why))) if what.contains(words) => {
                println!("not shown: {file}: {why}")
            }
            (Err(what), _) => wrong.push(format!("{file}: {what}")),
        }
    }
    for (name, shots) in &sheets {
        write(&work.join(format!("{name}.png")), shots)?;
    }
    println!("{shown} files shown, {} sheets in {}", sheets.len(), work.display());
    if wrong.is_empty() && shown > 0 {
        Ok(())
    } else {
        Err(format!("{} wrong:\n{}", wrong.len(), wrong.join("\n")))
    }
}

/// Paths of sample files relative to the folder, with slashes, sorted.
fn files(folder: &Path) -> Vec<String> {
    let mut out = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(inner) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(inner) else { continue };
        for path in entries.flatten().map(|e| e.path()) {
            let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
            if path.is_dir() {
                folders.push(path);
            } else if EXTENSIONS.contains(&extension.as_str())
                && let Ok(name) = path.strip_prefix(folder)
            {
                out.push(name.to_string_lossy().replace('\\', "/"));
            }
        }
    }
    out.sort();
    out
}

/// The script that a user would write first.
fn script(file: &str) -> String {
    format!(
        r#"let model = load("{file}");
let actor = cast("model", model);
let secs = 2.0;
if !model.clips().is_empty() {{
    let clip = model.clip(0);
    if clip.duration() > 0.1 {{ secs = clip.duration(); }}
    actor.play(clip);
}}
stage(#{{ size: [{}, {}], fps: {SHOTS} / secs, length: secs, background: "steelblue" }});
actor.key("rotation", [[0.0, 0.0], [secs, 300.0]]);
camera("look").frame(#{{ azimuth: 30.0, elevation: 15.0 }});
"#,
        SIZE.0, SIZE.1
    )
}

fn show(choreo: &Path, assets: &Path, work: &Path, file: &str) -> Result<Vec<Shot>, String> {
    let mut info = Command::new(choreo);
    info.arg("info").arg(assets.join(file)).arg("--search").arg(assets);
    finish(info, "choreo info")?;
    let name = file.replace(['/', '.', ' '], "_");
    let path = work.join(format!("{name}.rhai"));
    std::fs::write(&path, script(file)).map_err(|e| e.to_string())?;
    let mut render = Command::new(choreo);
    render.arg("render").arg(&path).arg("-o").arg(work.join(format!("{name}_%02d.png")));
    render.args(["--quiet", "--device", "cpu", "--search"]).arg(assets);
    finish(render, "choreo render")?;
    let shots =
        (0..SHOTS).map(|k| read(&work.join(format!("{name}_{k:02}.png")))).collect::<Result<Vec<_>, _>>()?;
    let blank = |shot: &Shot| shot.rgb.chunks_exact(3).all(|p| p == &shot.rgb[..3]);
    if shots.iter().all(blank) { Err("the images are blank".into()) } else { Ok(shots) }
}

pub(crate) fn finish(mut command: Command, what: &str) -> Result<(), String> {
    let output = command.stdin(Stdio::null()).output().map_err(|e| format!("{what} did not start: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    let text = String::from_utf8_lossy(&output.stderr).trim().to_string();
    Err(format!("{what}: {text}"))
}

pub(crate) fn read(path: &Path) -> Result<Shot, String> {
    let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = std::fs::File::open(path).map_err(|e| fail(&e))?;
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(|e| fail(&e))?;
    let mut bytes = vec![0; reader.output_buffer_size().ok_or_else(|| fail(&"too large"))?];
    let info = reader.next_frame(&mut bytes).map_err(|e| fail(&e))?;
    let channels = info.color_type.samples();
    if channels < 3 {
        return Err(fail(&"is not in color"));
    }
    let pixels = bytes[..info.buffer_size()].chunks_exact(channels);
    let rgb = pixels.flat_map(|p| p[..3].to_vec()).collect();
    Ok(Shot { width: info.width as usize, height: info.height as usize, rgb })
}

fn write(path: &Path, files: &[Vec<Shot>]) -> Result<(), String> {
    let columns = SHOTS * FILES_IN_A_ROW.min(files.len());
    let (width, height) = (SIZE.0 * columns, SIZE.1 * files.len().div_ceil(FILES_IN_A_ROW));
    let mut rgb = vec![255; width * height * 3];
    for (index, shots) in files.iter().enumerate() {
        for (k, shot) in shots.iter().enumerate() {
            let left = (index % FILES_IN_A_ROW * SHOTS + k) * SIZE.0;
            let top = index / FILES_IN_A_ROW * SIZE.1;
            // The last columns stay free, to separate the files.
            let kept = shot.width.min(SIZE.0) - usize::from(k + 1 == SHOTS) * 2;
            for y in 0..shot.height.min(SIZE.1) {
                let to = ((top + y) * width + left) * 3;
                rgb[to..to + kept * 3].copy_from_slice(&shot.rgb[y * shot.width * 3..][..kept * 3]);
            }
        }
    }
    let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = std::fs::File::create(path).map_err(|e| fail(&e))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(|e| fail(&e))?;
    writer.write_image_data(&rgb).map_err(|e| fail(&e))
}
