//! Plugins in WebAssembly: a new importer and a new exporter are built, tested, installed and used, an importer with a texture among them;
//! manifests are remembered, and compared with those of the plugins.

mod common;

use choreo_importer_kit_testing::wasm::built;
use common::*;
use std::path::Path;

/// Runs the program with the user's data and cache folders inside `folder`.
fn run_choreo(folder: &Path, args: &[&str]) -> Run {
    let mut command = command(folder, args);
    command.env_remove("CHOREO_PLUGINS");
    command.env("XDG_DATA_HOME", folder.join("data")).env("XDG_CACHE_HOME", folder.join("cache"));
    run_result(command.output().unwrap())
}

fn run_successfully(folder: &Path, args: &[&str]) -> String {
    let run = run_choreo(folder, args);
    assert_eq!(run.code, 0, "{args:?}: {}{}", run.out, run.err);
    run.out + &run.err
}

/// Creates a new package and builds its plugin.
fn build_new_package(folder: &Path, kind: &str, crate_name: &str) {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    run_successfully(folder, &["new", kind, "my_format", "--wasm", "--sources", sources.to_str().unwrap()]);
    let crate_folder = folder.join(crate_name);
    let text = std::fs::read_to_string(crate_folder.join("README.md")).unwrap();
    let command = format!("cp target/wasm32-unknown-unknown/release/{}.wasm", crate_name.replace('-', "_"));
    assert!(text.contains(&command), "{text}");
    std::fs::copy(built(&crate_folder, crate_name), crate_folder.join(format!("my_format.{kind}.wasm")))
        .unwrap();
}

#[test]
fn new_packages_are_built_installed_and_used() {
    let dir = folder_with_triangle();
    let folder = dir.path();
    for (kind, crate_name) in [("importer", "import-my-format"), ("exporter", "export-my-format")] {
        build_new_package(folder, kind, crate_name);
        run_successfully(folder, &["plugins", "test", crate_name]);
    }
    // Both packages are called my_format; the second one gets another name.
    let description = folder.join("export-my-format/plugin.toml");
    let text = std::fs::read_to_string(&description).unwrap();
    std::fs::write(&description, text.replacen("my_format", "my_exporter", 1)).unwrap();
    run_successfully(folder, &["plugins", "install", "import-my-format"]);
    run_successfully(folder, &["plugins", "install", "export-my-format"]);
    std::fs::copy(folder.join("import-my-format/tests/sample.my_format"), folder.join("a.my_format"))
        .unwrap();
    let info = run_successfully(folder, &["info", "a.my_format", "--import", "scale=2"]);
    assert!(
        info.contains("4.000 × 3.000 × 4.000 m") && info.contains("a.my_format: my_format (points"),
        "{info}"
    );
    // A callback, which only the program can run, moves the actor.
    let script = "stage(#{ fps: 4, length: 0.5 });\nlet a = cast(\"a\", load(\"a.my_format\")).at(1.0, 0.0, 2.5);\n\
        on_frame(|time| a.at(time, 0.0, 0.0));\n";
    std::fs::write(folder.join("s.rhai"), script).unwrap();
    run_successfully(folder, &["export", "s.rhai", "-o", "own.my_format", "--export", "digits=2"]);
    run_successfully(folder, &["export", "s.rhai", "-o", "ours.csv", "--export", "digits=2"]);
    let (own, ours) = (read_file(folder, "own.my_format"), read_file(folder, "ours.csv"));
    assert_eq!(String::from_utf8_lossy(&own), String::from_utf8_lossy(&ours));
    assert!(own.len() > 60, "{}", String::from_utf8_lossy(&own));
    run_successfully(folder, &["plugins", "remove", "my_exporter"]);
    assert_ne!(run_choreo(folder, &["export", "s.rhai", "-o", "again.my_format"]).code, 0);
}

#[test]
fn a_manifest_is_cached_and_a_different_one_detected() {
    let dir = folder_with_triangle();
    let folder = dir.path();
    build_new_package(folder, "importer", "import-my-format");
    std::fs::create_dir(folder.join("plugins")).unwrap();
    std::fs::rename(
        folder.join("import-my-format/my_format.importer.wasm"),
        folder.join("plugins/my_format.importer.wasm"),
    )
    .unwrap();
    std::fs::copy(folder.join("import-my-format/tests/sample.my_format"), folder.join("a.my_format"))
        .unwrap();
    run_successfully(folder, &["info", "a.my_format"]);
    let remembered = folder.join("cache/choreo/plugin-manifests");
    let [name] = file_names(&remembered).try_into().unwrap();
    let text = std::fs::read(remembered.join(&name)).unwrap();
    let place = text.windows(5).position(|part| part == b"0.1.0").unwrap();
    let mut other = text.clone();
    other[place] = b'9';
    std::fs::write(remembered.join(&name), &other).unwrap();
    let run = run_choreo(folder, &["info", "a.my_format"]);
    assert!(run.code != 0 && run.err.contains("its manifest differs from the stored one"), "{}", run.err);
    // A cached file that is not a manifest is replaced.
    std::fs::write(remembered.join(&name), b"nothing of the kind").unwrap();
    run_successfully(folder, &["info", "a.my_format"]);
    assert_eq!(std::fs::read(remembered.join(&name)).unwrap(), text);
}

/// Colors of the four squares: upper left, upper right, lower left, lower right.
const SQUARE_COLORS: [[u8; 3]; 4] = [[224, 32, 32], [32, 192, 64], [32, 96, 224], [240, 224, 64]];

/// PNG file with four squares of different colors.
fn png_of_four_squares() -> Vec<u8> {
    let corner = |x: u32, y: u32| usize::from(x >= 16) + 2 * usize::from(y >= 16);
    let pixels = image::RgbaImage::from_fn(32, 32, |x, y| {
        let [red, green, blue] = SQUARE_COLORS[corner(x, y)];
        image::Rgba([red, green, blue, 255])
    });
    let mut file = std::io::Cursor::new(Vec::new());
    pixels.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

#[test]
fn an_importer_provides_a_texture_and_its_file() {
    let dir = folder_with_triangle();
    let folder = dir.path();
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    run_successfully(
        folder,
        &["new", "importer", "painted", "--wasm", "--sources", sources.to_str().unwrap()],
    );
    let crate_folder = folder.join("import-painted");
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).unwrap();
    write("import-painted/src/lib.rs", include_bytes!("wasm/painted.rs"));
    let manifest = String::from_utf8(read_file(&crate_folder, "Cargo.toml")).unwrap();
    let manifest = manifest.replacen("[dependencies]", "[dependencies]\npng = \"0.18\"", 1);
    write("import-painted/Cargo.toml", manifest.as_bytes());
    let picture = png_of_four_squares();
    for name in ["import-painted/tests/sample", "a"] {
        let png = format!("{name}.png");
        let last = Path::new(&png).file_name().unwrap().to_str().unwrap();
        write(&format!("{name}.painted"), last.as_bytes());
        write(&png, &picture);
    }
    std::fs::copy(built(&crate_folder, "import-painted"), crate_folder.join("painted.importer.wasm"))
        .unwrap();
    run_successfully(folder, &["plugins", "test", "import-painted"]);
    run_successfully(folder, &["plugins", "install", "import-painted"]);
    let script = "stage(#{ size: [96, 96], length: 0.1, background: \"black\" });\ncast(\"a\", load(\"a.painted\"));\n\
        camera(\"c\").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]).ortho(3.0);\n";
    write("s.rhai", script.as_bytes());
    for device in ["cpu", "vulkan"] {
        let drawn = run_choreo(folder, &["render", "s.rhai", "-o", "s.png", "--at", "0", "--device", device]);
        if drawn.code == 4 && device == "vulkan" {
            println!("SKIP 1: no Vulkan device");
            continue;
        }
        assert_eq!(drawn.code, 0, "{device}: {}", drawn.err);
        let drawn = image::open(folder.join("s.png")).unwrap().to_rgb8();
        // The square covers 64 pixels in the middle; a quarter of it is 16 pixels away from it.
        for (corner, [x, y]) in SQUARE_COLORS.into_iter().zip([[32, 32], [64, 32], [32, 64], [64, 64]]) {
            let drawn = drawn.get_pixel(x, y).0;
            let off = drawn.iter().zip(corner).map(|(a, b)| a.abs_diff(b)).max();
            assert!(off <= Some(1), "{device} {x},{y}: {drawn:?} instead of {corner:?}");
        }
        assert_eq!([drawn.get_pixel(10, 48).0, drawn.get_pixel(48, 86).0], [[0; 3]; 2], "{device}");
    }
    // An export asks for the file of the image and keeps its bytes.
    run_successfully(folder, &["export", "s.rhai", "-o", "s.glb"]);
    let exported = read_file(folder, "s.glb");
    assert!(exported.windows(picture.len()).any(|part| part == picture), "the PNG file as it was");
    if let Some(kept) = std::env::var_os("CHOREO_KEEP_IMAGES") {
        std::fs::copy(folder.join("s.png"), Path::new(&kept).join("painted_by_wasm.png")).unwrap();
    }
}
