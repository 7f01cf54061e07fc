//! A window without usable Vulkan: no driver, no Vulkan loader library, or only a driver that draws on the CPU.

use crate::screen::{Running, Screen, Screenshot, assert_no_errors, until};
use std::fs;
use std::path::Path;
use std::process::Command;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 3.0, background: #{ top: "#204060", bottom: "#204060" } });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(load("choreo:mannequin").clip("Dance_Groove"));
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
"##;

const BACKGROUND: [u8; 3] = [0x20, 0x40, 0x60];
/// Left edge of the inspector in a window of 1280 × 860.
const INSPECTOR: usize = 921;

/// The part of Vulkan that a machine lacks.
#[derive(Clone, Copy, Debug)]
enum Missing {
    Driver,
    Library,
    /// The only driver is Mesa's, which draws on the CPU and is slower than the CPU renderer.
    Gpu,
}

const SOFTWARE_DRIVERS: [&str; 3] = [
    "/usr/share/vulkan/icd.d/lvp_icd.x86_64.json",
    "/usr/share/vulkan/icd.d/lvp_icd.aarch64.json",
    "/usr/share/vulkan/icd.d/lvp_icd.json",
];

fn without(what: Missing, command: &mut Command, folder: &Path) {
    match what {
        Missing::Driver => ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|name| {
            command.env(name, folder.join("nowhere.json"));
        }),
        Missing::Gpu => ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|name| {
            command.env(name, SOFTWARE_DRIVERS.iter().find(|file| Path::new(file).exists()).unwrap());
        }),
        // An empty file with the library's name is found first.
        Missing::Library => ["libvulkan.so.1", "libvulkan.so"].map(|name| {
            fs::create_dir_all(folder.join("hidden")).unwrap();
            fs::write(folder.join("hidden").join(name), "").unwrap();
            command.env("LD_LIBRARY_PATH", folder.join("hidden"));
        }),
    };
}

fn started(screen: &Screen, folder: &Path, missing: Option<Missing>) -> (Running, String, Screenshot) {
    let script = folder.join("a.rhai");
    fs::write(&script, SCRIPT).unwrap();
    let device = if missing.is_some() { "auto" } else { "vulkan" };
    let mut command = screen.command_on(device, &[script.to_str().unwrap()], folder);
    missing.into_iter().for_each(|what| without(what, &mut command, folder));
    let said = fs::File::create(folder.join("said.txt")).unwrap();
    command.current_dir(folder).stdout(said.try_clone().unwrap()).stderr(said);
    let viewer = Running(command.spawn().unwrap());
    let window = screen.window();
    let first = until("the first image", || {
        let shot = screen.shot(&window);
        (shot.count(BACKGROUND) > 20_000).then_some(shot)
    });
    (viewer, window, first)
}

fn ended(screen: &Screen, mut viewer: Running, window: &str, folder: &Path) {
    screen.key(window, "ctrl+q");
    let status = until("the end", || viewer.0.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    assert_no_errors(folder);
}

#[test]
fn without_vulkan_the_window_shows_the_frame_and_takes_keys() {
    let Some(screen) = Screen::new() else { return };
    for missing in [Missing::Driver, Missing::Library, Missing::Gpu] {
        let folder = tempfile::tempdir().unwrap();
        let (viewer, window, first) = started(&screen, folder.path(), Some(missing));
        // The pixels on the screen are those of the CPU renderer.
        assert_same_as_render(&first, folder.path());
        screen.save(&window, &format!("without_{missing:?}.png"));
        screen.xdotool(&["mousemove", "--window", &window, "600", "300"]);
        screen.key(&window, "End");
        until("another frame", || (image(&screen.shot(&window)) != image(&first)).then_some(()));
        screen.key(&window, "Home");
        until("the first frame again", || (image(&screen.shot(&window)) == image(&first)).then_some(()));
        for (width, height) in [(500, 400), (1390, 990)] {
            screen.xdotool(&["windowsize", &window, &width.to_string(), &height.to_string()]);
            until("the window in its new size", || {
                let shot = screen.shot(&window);
                (shot.width == width && shot.height == height).then_some(())
            });
        }
        until("the image", || (screen.shot(&window).count(BACKGROUND) > 20_000).then_some(()));
        ended(&screen, viewer, &window, folder.path());
    }
}

/// Pixels of the image in the window.
fn image(shot: &Screenshot) -> Vec<[u8; 3]> {
    // The inspector next to it contains the background color, too.
    let mut viewport = shot.clone();
    let is_beside = |pixel: usize| pixel % shot.width >= INSPECTOR;
    let beside = viewport.rgb.chunks_exact_mut(3).enumerate().filter(|(pixel, _)| is_beside(*pixel));
    beside.for_each(|(_, rgb)| rgb.fill(0));
    let [left, top, right, bottom] = viewport.bounds(BACKGROUND);
    (top..bottom).flat_map(|y| (left..right).map(move |x| shot.pixel(x, y))).collect()
}

fn assert_same_as_render(shot: &Screenshot, folder: &Path) {
    let picture = folder.join("a.png");
    let args = ["choreo", "render", "--at", "0", "--device", "cpu", "--quiet", "-o"].map(Into::into);
    let args = args.into_iter().chain([picture.clone().into(), folder.join("a.rhai").into()]);
    let code = choreo::run(args, &choreo::app());
    assert_eq!(format!("{code:?}"), format!("{:?}", std::process::ExitCode::SUCCESS));
    let output = Command::new("convert").arg(&picture).args(["-depth", "8", "ppm:-"]).output().unwrap();
    let rendered = Screenshot::read(&output.stdout).unwrap();
    let rendered: Vec<[u8; 3]> = rendered.rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    assert!(image(shot) == rendered, "the image on the screen is not the one that render draws");
}

/// Panels drawn on the CPU are compared with those drawn by Vulkan: glyphs are blended with other weights, and the timings in the bar
/// differ, but edges, areas and glyphs must lie at the same places.
#[test]
fn panels_drawn_on_the_cpu_match_those_of_vulkan() {
    let Some(screen) = Screen::new() else { return };
    let mut shots = Vec::new();
    for missing in [None, Some(Missing::Driver)] {
        let folder = tempfile::tempdir().unwrap();
        let (viewer, window, _) = started(&screen, folder.path(), missing);
        screen.xdotool(&["mousemove", "--window", &window, "1270", "850"]);
        screen.rest(viewer.0.id());
        shots.push(screen.shot(&window));
        screen.save(&window, &format!("panels_without_{missing:?}.png"));
        ended(&screen, viewer, &window, folder.path());
    }
    let [vulkan, cpu] = &shots[..] else { unreachable!() };
    assert_eq!([vulkan.width, vulkan.height], [cpu.width, cpu.height]);
    let worst = |(a, b): (&[u8], &[u8])| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    let differences: Vec<u8> = vulkan.rgb.chunks_exact(3).zip(cpu.rgb.chunks_exact(3)).map(worst).collect();
    let share =
        |least: u8| differences.iter().filter(|d| **d >= least).count() as f64 / differences.len() as f64;
    println!(
        "of all pixels differ by 8 or more {:.3} %, by 64 or more {:.3} %",
        100.0 * share(8),
        100.0 * share(64)
    );
    assert!(share(64) < 0.003, "{}", share(64));
}
