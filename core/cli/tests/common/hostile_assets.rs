//! Generates the small files that the hostile scripts use.

use super::common::triangle;
use std::path::Path;

/// `inside` is the folder of the scripts. `outside` is a folder beside it, which scripts must not read.
pub(crate) fn make(inside: &Path, outside: &Path) {
    let write = |name: &str, bytes: &[u8]| {
        let place = inside.join(name);
        std::fs::create_dir_all(place.parent().unwrap()).unwrap();
        std::fs::write(place, bytes).unwrap();
    };
    write("tri.gltf", triangle(1.0).as_bytes());
    std::fs::write(outside.join("secret.gltf"), triangle(1.0)).unwrap();
    std::fs::write(outside.join("secret.rhai"), "fn secret() { 42 }").unwrap();
    std::fs::write(outside.join("secret.bin"), [0; 80]).unwrap();
    std::fs::write(outside.join("secret.png"), png(4, 4, true)).unwrap();

    write("modules/good.rhai", b"fn one() { 1 }\nfn f() { 1 }");
    write("modules/circle_a.rhai", b"import \"circle_b\" as b;");
    write("modules/circle_b.rhai", b"import \"circle_a\" as a;");
    write("modules/endless.rhai", b"fn f() { 1 }\nloop { }");
    // The same file under another name each time.
    write("modules/bomb.rhai", b"import \"./././bomb\" as m;\nimport \"../modules/./bomb\" as n;");
    write("modules/throws.rhai", b"let odd = #{ a: [1, 2] };\nthrow odd;");
    for i in 0..100 {
        write(&format!("chain/m{i}.rhai"), format!("import \"m{}\" as m;", i + 1).as_bytes());
    }
    write("chain/m100.rhai", b"fn end() { 1 }");
    write("modules/marked.rhai", "\u{feff}fn one() { 1 }".as_bytes());
    write("marked.gltf", format!("\u{feff}{}", triangle(1.0)).as_bytes());
    models(&write);
    plugins(&write);
    links(inside, outside);
}

/// Plugin files that only the scripts about them use. They must not affect other scripts.
fn plugins(write: &impl Fn(&str, &[u8])) {
    let effect = |name: &str, body: &str| {
        let parameters = "color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>";
        let text = format!("// effect: {name}\nfn effect({parameters}) -> vec4<f32> {{\n{body}\n}}\n");
        write(&format!("plugins/{name}.wgsl"), text.as_bytes());
    };
    effect("sum", &format!("return vec4(1.0{});", "+uv.x".repeat(20_000)));
    let else_ifs = " else if uv.x < 0.1 { return color; }".repeat(3_000);
    effect("else_ifs", &format!("if uv.x < 0.0 {{ return color; }}{else_ifs} return color;"));
    effect("types", &format!("var a: {}f32{}; return color;", "array<".repeat(9_000), ",1>".repeat(9_000)));
    effect("endless", "loop { } return color;");
    effect("wrong", "return colour;");
    write("plugins/nameless.wgsl", b"fn effect() {}");
    write("plugins/noise.wgsl", &[0xff; 5000]);
    write("plugins/open.importer.rhai", b"fn manifest() { #{ name: \"open\", extensions: \"open\" ");
    let deep = format!(
        "fn manifest() {{ let a = {}1{}; }}\nfn load(f) {{}}",
        "(".repeat(50_000),
        ")".repeat(50_000)
    );
    write("plugins/deep.importer.rhai", deep.as_bytes());
    write("plugins/slow.importer.rhai", b"fn manifest() { loop { } }\nfn load(f) {}");
}

fn models(write: &impl Fn(&str, &[u8])) {
    let good = triangle(1.0);
    let buffer = |uri: &str| {
        let from = good.find("data:application").unwrap();
        let to = from + good[from..].find('"').unwrap();
        format!("{}{uri}{}", &good[..from], &good[to..])
    };
    write("buffer_outside.gltf", buffer("../outside/secret.bin").as_bytes());
    write("buffer_device.gltf", buffer("/dev/zero").as_bytes());
    write("image_outside.gltf", textured("../outside/secret.png").as_bytes());
    write("bomb.png", &png(4096, 4096, true));
    write("png_bomb.gltf", textured("bomb.png").as_bytes());
    write("header.png", &png(0x7fff_ffff, 0x7fff_ffff, false));
    write("png_header.gltf", textured("header.png").as_bytes());
    write("cut.glb", b"glTF\x02\0\0\0\x00\x10\0\0\x00\x0f\0\0JSON{\"asset\":{\"vers");
    write("times.gltf", triangle(1e30).as_bytes());
    write("nan.gltf", triangle(f32::NAN).replace("NaN", "1").as_bytes());
    // An accessor of positions without a buffer has only zeros, as many as the file states.
    let accessor = r#""bufferView": 0, "componentType": 5126, "count": 3"#;
    assert!(good.contains(accessor));
    let bomb = good.replace(accessor, r#""componentType": 5126, "count": 4000000000"#);
    write("accessor_bomb.gltf", bomb.as_bytes());
    let deep =
        format!(r#"{{"asset":{{"version":"2.0"}},"extras":{}{}}}"#, "[".repeat(100_000), "]".repeat(100_000));
    write("deep.gltf", deep.as_bytes());
    write("circle.gltf", good.replace(r#""mesh": 0 }"#, r#""mesh": 0, "children": [0] }"#).as_bytes());
    write(
        "instances.gltf",
        nodes(&good, 100_000, |i| if i == 0 { children(1..100_000) } else { String::new() }),
    );
    write(
        "chain.gltf",
        nodes(&good, 10_000, |i| if i < 9_999 { children(i + 1..i + 2) } else { String::new() }),
    );
}

fn children(range: std::ops::Range<usize>) -> String {
    let list: Vec<String> = range.map(|i| i.to_string()).collect();
    format!(", \"children\": [{}]", list.join(","))
}

/// The triangle on many nodes.
fn nodes(good: &str, count: usize, children: impl Fn(usize) -> String) -> &'static [u8] {
    let from = good.find("\"nodes\": [{ \"name\"").unwrap();
    let to = good.find("\"meshes\"").unwrap();
    let list: Vec<String> =
        (0..count).map(|i| format!("{{ \"name\": \"n{i}\", \"mesh\": 0{} }}", children(i))).collect();
    let text = format!("{}\"nodes\": [{}],\n  {}", &good[..from], list.join(","), &good[to..]);
    // Two of these per run.
    text.into_bytes().leak()
}

/// The triangle with an image on it.
fn textured(uri: &str) -> String {
    let material = r#""materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],"#;
    let texture = format!(r#""textures": [{{ "source": 0 }}], "images": [{{ "uri": "{uri}" }}],"#);
    triangle(1.0)
        .replace("\"indices\": 3 }", "\"indices\": 3, \"material\": 0 }")
        .replace("\"accessors\":", &format!("{material} {texture}\n  \"accessors\":"))
}

/// A PNG of one color with only zeros: a hundred kilobytes that decompress to gigabytes.
fn png(width: u32, height: u32, data: bool) -> Vec<u8> {
    let mut out = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8; 4], data: &[u8]| {
        out.extend((data.len() as u32).to_be_bytes());
        let body: Vec<u8> = kind.iter().chain(data).copied().collect();
        out.extend(&body);
        out.extend(crc(&body).to_be_bytes());
    };
    let mut header = [width.to_be_bytes(), height.to_be_bytes()].concat();
    // Gray with one bit per pixel: the smallest file for these dimensions.
    header.extend([1, 0, 0, 0, 0]);
    chunk(b"IHDR", &header);
    if data {
        let rows = (width as usize).div_ceil(8) + 1;
        chunk(b"IDAT", &zeros(rows * height as usize));
    } else {
        chunk(b"IDAT", b"\x78\x9c");
    }
    chunk(b"IEND", b"");
    out
}

/// A zlib stream of stored blocks of zeros.
fn zeros(count: usize) -> Vec<u8> {
    let mut out = vec![0x78, 0x01];
    let mut left = count;
    loop {
        let length = left.min(65_535);
        left -= length;
        out.push(u8::from(left == 0));
        out.extend((length as u16).to_le_bytes());
        out.extend((!(length as u16)).to_le_bytes());
        out.resize(out.len() + length, 0);
        if left == 0 {
            break;
        }
    }
    // Adler-32 of zeros: a = 1, b = count mod 65521.
    out.extend((((count % 65_521) as u32) << 16 | 1).to_be_bytes());
    out
}

fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(!0u32, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |c, _| step(c)))
}

#[cfg(unix)]
fn links(inside: &Path, outside: &Path) {
    use std::os::unix::fs::symlink;
    symlink(outside.join("secret.rhai"), inside.join("plugins/secret.importer.rhai")).unwrap();
    symlink(outside.join("secret.rhai"), inside.join("plugins/secret.wgsl")).unwrap();
    for name in ["plugins/pipe.wgsl", "plugins/pipe.importer.rhai", "pipe_module.rhai"] {
        assert!(std::process::Command::new("mkfifo").arg(inside.join(name)).status().unwrap().success());
    }
    symlink(outside.join("secret.gltf"), inside.join("link_out.gltf")).unwrap();
    symlink(outside, inside.join("door")).unwrap();
    symlink("/dev/zero", inside.join("link_zero.gltf")).unwrap();
    symlink("link_loop.gltf", inside.join("link_loop.gltf")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(inside.join("pipe.gltf")).status();
    assert!(made.is_ok_and(|s| s.success()), "mkfifo is part of every Unix");
}

#[cfg(not(unix))]
fn links(_: &Path, _: &Path) {}
