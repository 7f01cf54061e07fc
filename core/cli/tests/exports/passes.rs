//! Passes as images of floats: the OpenEXR library reads the files, and `tests/passes/check.py` compares them with closed forms, with the
//! 8-bit images of `render`, and between the two renderers.

use crate::common;
use crate::common::*;
use std::path::Path;
use std::process::{Command, Stdio};

const CHECK: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/passes/check.py");

fn folder_with_scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/passes/scene.rhai");
    std::fs::copy(scene, folder.path().join("scene.rhai")).unwrap();
    folder
}

/// Renders the second frame of the scene. Returns false if there is no Vulkan driver.
fn render_second_frame(folder: &Path, device: &str, output: &str, options: &[&str]) -> bool {
    let at = (1.0f64 / 24.0).to_string();
    let mut args = vec!["render", "scene.rhai", "--at", &at, "--device", device, "-o", output, "-q"];
    args.extend(options);
    let run = choreo(folder, &args);
    if run.code == 4 && device == "vulkan" {
        return false;
    }
    assert_eq!(run.code, 0, "{args:?}: {}", run.err);
    true
}

/// Renders all images of a device that check.py compares. Returns false if there is no Vulkan driver.
fn render_all_images(folder: &Path, device: &str) -> bool {
    let image = |name: &str, options: &[&str]| {
        render_second_frame(folder, device, &format!("{device}{name}"), options)
    };
    let none = ["--set", "view=none", "--samples", "1"];
    let dim = ["--set", "background=#00000000", "--set", "light=2"];
    let neutral = ["--set", "view=neutral", "--samples", "1"];
    image(".exr", &["--passes", "depth, normal,motion", "--export", "pixels=float"])
        && image("_none.exr", &none)
        && image("_none.png", &none)
        && image("_none16.png", &[&none[..], &["--export", "depth=16"]].concat())
        && image("_straight.png", &dim)
        && image("_straight16.png", &[&dim[..], &["--export", "depth=16"]].concat())
        && image("_neutral.exr", &neutral)
        && image("_neutral.png", &neutral)
        && image("_none4.exr", &["--export", "compression=zips"])
        && image("_ids.exr", &[&dim[..], &["--passes", "color,id,albedo"]].concat())
        && image("_ids16.exr", &["--passes", "id", "--export", "id_samples=16"])
        && image("_alpha.exr", &["--set", "background=#ffffff00", "--export", "compression=none"])
}

#[test]
fn openexr_pixels_equal_closed_forms() {
    let Some(python) = python_with("OpenEXR", "OpenEXR==3.4.4") else { return };
    let folder = folder_with_scene();
    let devices = ["cpu", "vulkan"].map(|device| render_all_images(folder.path(), device).then_some(device));
    if devices[1].is_none() {
        println!("SKIP 1: no Vulkan driver");
    }
    let mut check = Command::new(python);
    check.current_dir(folder.path()).arg(CHECK).args(devices.into_iter().flatten()).stdin(Stdio::null());
    let run = run_result(check.output().unwrap());
    println!("{}", run.out);
    assert_eq!(run.code, 0, "{}{}", run.out, run.err);
}

/// OpenImageIO finds the same channels as the OpenEXR library, with the same values.
#[test]
fn openimageio_and_openexr_read_the_same_pixels() {
    let (Some(openexr), Some(openimageio)) =
        (python_with("OpenEXR", "OpenEXR==3.4.4"), python_with("OpenImageIO", "OpenImageIO==3.2.2.0"))
    else {
        return;
    };
    let folder = folder_with_scene();
    let d = folder.path();
    let all = "color,depth,normal,motion,albedo,id";
    for (output, options) in [
        ("half.exr", ["--export", "compression=zip"]),
        ("float.exr", ["--export", "pixels=float"]),
        ("rows.exr", ["--export", "compression=zips"]),
        ("plain.exr", ["--export", "compression=none"]),
    ] {
        assert!(render_second_frame(d, "cpu", output, &[&["--passes", all][..], &options].concat()));
    }
    let files = ["half.exr", "float.exr", "rows.exr", "plain.exr"];
    let run = |python: &Path, code: &str| {
        let mut command = Command::new(python);
        let run = run_result(command.current_dir(d).args(["-c", code]).args(files).output().unwrap());
        assert_eq!(run.code, 0, "{}{}", run.out, run.err);
        run.out
    };
    run(
        &openexr,
        "import sys, numpy, OpenEXR\nfor name in sys.argv[1:]:\n    \
         part = OpenEXR.File(name, separate_channels=True).parts[0]\n    \
         numpy.savez(name + '.npz', **{k: c.pixels.astype('f4') for k, c in part.channels.items()})\n",
    );
    let out = run(
        &openimageio,
        "import sys, numpy, OpenImageIO as oiio\nfor name in sys.argv[1:]:\n    image = oiio.ImageBuf(name)\n    \
         assert not image.has_error, image.geterror()\n    spec = image.spec()\n    \
         pixels = image.get_pixels(oiio.FLOAT)\n    known = numpy.load(name + '.npz')\n    \
         assert sorted(spec.channelnames) == sorted(known.files), (spec.channelnames, known.files)\n    \
         for i, channel in enumerate(spec.channelnames):\n        \
         assert numpy.array_equal(pixels[..., i].view('u4'), known[channel].view('u4')), (name, channel)\n        \
         assert not numpy.array_equal(pixels[1:, :, i], known[channel][:-1]) or pixels[..., i].std() == 0, 'a row off is found'\n    \
         manifests = [a.value for a in spec.extra_attribs if a.name.endswith('/manifest')]\n    \
         assert len(manifests) == 2 and 'box' in ''.join(manifests), manifests\n    \
         print(name, len(spec.channelnames), 'channels')\n",
    );
    println!("{out}");
    assert_eq!(out.lines().count(), 4, "{out}");
}

#[test]
fn resuming_a_sequence_renders_only_the_missing_images() {
    let folder = folder_with_scene();
    let d = folder.path();
    let render = |more: &[&str]| {
        let mut args =
            vec!["render", "scene.rhai", "-o", "f/%02d.exr", "--frames", "0..4", "--size", "32x18"];
        args.extend(["--device", "cpu", "--passes", "color,motion"]);
        args.extend(more);
        choreo(d, &args)
    };
    assert_eq!(render(&[]).code, 0);
    let names = ["f/00.exr", "f/01.exr", "f/02.exr", "f/03.exr"];
    let first_bytes = names.map(|name| read_file(d, name));
    // Frames with equal pixels have different timestamps.
    assert_ne!(first_bytes[2], first_bytes[3]);
    assert_eq!(render(&[]).code, 0);
    assert!(names.map(|name| read_file(d, name)) == first_bytes, "the same frames have the same bytes");
    std::fs::remove_file(d.join(names[0])).unwrap();
    std::fs::write(d.join(names[2]), &first_bytes[2][..first_bytes[2].len() - 1]).unwrap();
    let run = render(&["--resume"]);
    assert!(run.code == 0 && run.err.contains("2 of them finished before"), "{}", run.err);
    assert!(names.map(|name| read_file(d, name)) == first_bytes, "resumed frames have the same bytes");
    let run = render(&["--resume", "--samples", "1"]);
    assert!(run.code == 3 && run.err.contains("was made with other settings"), "{}", run.err);
    let run = choreo(d, &["info", names[1]]);
    assert!(
        run.out.contains("OpenEXR image, 32×18") && run.out.contains("source       scene.rhai"),
        "{}",
        run.out
    );
    // No temporary folder was left beside the files.
    assert_eq!(common::file_names(&d.join("f")).len(), 4);
}

#[test]
fn invalid_passes_are_refused_before_the_first_frame() {
    let folder = folder_with_scene();
    let d = folder.path();
    let refused = |output: &str, options: &[&str], why: &str| {
        let mut args = vec!["render", "scene.rhai", "--at", "0", "-o", output];
        args.extend(options);
        let run = choreo(d, &args);
        assert!(run.code == 2 && run.err.contains(why), "{args:?}: {}", run.err);
        assert!(!d.join(output).exists());
    };
    refused(
        "x.exr",
        &["--passes", "color,z"],
        "passes: \"z\" is no pass; the passes are color, depth, normal, motion, albedo, id",
    );
    refused("x.png", &["--passes", "depth"], "--export passes=depth: ");
    let sheet = choreo(d, &["render", "scene.rhai", "--sheet", "-o", "x.exr"]);
    assert!(sheet.code == 2 && sheet.err.contains("--sheet writes images of 8 bits"), "{}", sheet.err);
    // Effects on display colors and titles are not part of the light values.
    let text =
        "stage(#{ length: 1.0, size: [32, 18] }); title(\"a\"); effect(\"vignette\"); effect(\"bloom\");";
    std::fs::write(d.join("titled.rhai"), text).unwrap();
    let run = choreo(d, &["render", "titled.rhai", "--at", "0", "-o", "x.exr", "--device", "cpu"]);
    let note = "the output is light before the view transform, without the effect vignette, 2D layers";
    assert!(run.code == 0 && run.err.contains(note), "{}", run.err);
}

#[test]
fn pillow_shows_the_frames_of_an_animation() {
    let Some(python) = python_with("PIL", "Pillow==12.0.0") else { return };
    let folder = folder_with_scene();
    let d = folder.path();
    let render = |output: &str, more: &[&str]| {
        let mut args =
            vec!["render", "scene.rhai", "-o", output, "--device", "cpu", "-q", "--frames", "0..4"];
        args.extend(["--set", "background=#00000000"]);
        args.extend(more);
        let run = choreo(d, &args);
        assert_eq!(run.code, 0, "{args:?}: {}", run.err);
    };
    render("f/%d.png", &[]);
    render("a.webp", &[]);
    render("a.apng", &[]);
    // Pillow reads WebP with libwebp and APNG itself.
    let check = "from PIL import Image, ImageSequence\n\
        images = [Image.open(f'f/{i}.png').convert('RGBA').tobytes() for i in range(4)]\n\
        # Where alpha is 0 a decoder may change the color.\n\
        shown = lambda pixels: [pixels[i:i + 4] for i in range(0, len(pixels), 4) if pixels[i + 3]]\n\
        images = [shown(i) for i in images]\n\
        for name in ('a.webp', 'a.apng'):\n    \
            film = Image.open(name)\n    \
            frames = [shown(frame.convert('RGBA').tobytes()) for frame in ImageSequence.Iterator(film)]\n    \
            assert film.n_frames == 4 and film.info['loop'] == 0, (name, film.n_frames, film.info)\n    \
            assert frames == images, name\n    \
            assert frames[::-1] != images, 'another order is found'\n";
    std::fs::write(d.join("check.py"), check).unwrap();
    let run = run_result(Command::new(python).current_dir(d).arg("check.py").output().unwrap());
    assert_eq!(run.code, 0, "{}", run.err);
    let about = choreo(d, &["info", "a.webp"]);
    assert!(
        about.out.contains("WebP video, 160×90") && about.out.contains("source       scene.rhai"),
        "{}",
        about.out
    );
}
