//! Batches: a film for each row of a table, with the same bytes as a separate render. Rows that fail are reported, and the others
//! continue. File names from rows cannot leave the output folder.

use crate::common::*;
use std::path::Path;

const SCRIPT: &str = r##"let seconds = param("seconds", 0.5);
stage(#{ size: [64, 36], fps: 10, length: seconds });
let color = param("color", "#c04020");
let name = param("name", "nobody");
cast("t", load(param("model", "tri.gltf")));
cast("b", shape("box", #{ size: [1.0, 1.0, 1.0], color: color })).key("position", [[0.0, [0, 0, 0]], [0.5, [1, 0, 0]]]);
text(name, #{ size: 0.2 });
camera("c").at(0.0, 1.0, 6.0).look_at([0.0, 0.0, 0.0]);
"##;

const TABLE: &str = "name,color,seconds,model,_file
Zoe,#20c040,,,first
Ben,#2040c0,0.3,other.gltf,second
\"Cleo, the third\",nonsense,,,third
Ada,,,missing.gltf,fourth
Zoe,#c0c020,,,fifth
";

fn scene() -> tempfile::TempDir {
    let dir = folder_with_triangle();
    std::fs::write(dir.path().join("s.rhai"), SCRIPT).unwrap();
    std::fs::write(dir.path().join("other.gltf"), triangle(2.0)).unwrap();
    std::fs::write(dir.path().join("rows.csv"), TABLE).unwrap();
    dir
}

fn render_batch(folder: &Path, more: &[&str]) -> Run {
    let args = ["render", "s.rhai", "--set-from", "rows.csv", "--device", "cpu", "--samples", "1", "--quiet"];
    choreo(folder, &[&args[..], more].concat())
}

#[test]
fn each_row_gives_the_bytes_of_a_single_render() {
    let dir = scene();
    let d = dir.path();
    for output in ["one/first.mp4", "one/second.mp4", "one/fifth.mp4"] {
        std::fs::create_dir_all(d.join("one")).unwrap();
        let set: &[&str] = match output {
            "one/first.mp4" => &["color=#20c040", "name=Zoe"],
            "one/second.mp4" => &["color=#2040c0", "model=other.gltf", "name=Ben", "seconds=0.3"],
            _ => &["color=#c0c020", "name=Zoe"],
        };
        let mut args = vec!["render", "s.rhai", "-o", output, "--device", "cpu", "--samples", "1", "--quiet"];
        args.extend(set.iter().flat_map(|set| ["--set", set]));
        assert_eq!(choreo(d, &args).code, 0);
    }
    let run = render_batch(d, &["-o", "out/{_file}.mp4", "--json"]);
    assert!(run.code == 1 && run.err.contains("the folder out does not exist"), "{}", run.err);
    std::fs::create_dir(d.join("out")).unwrap();
    let run = render_batch(d, &["-o", "out/{_file}.mp4", "--json"]);
    assert_eq!(run.code, 1);
    let lines: Vec<&str> = run.err.lines().collect();
    assert!(lines.iter().any(|line| line.starts_with("row 3: ") && line.contains("nonsense")), "{}", run.err);
    assert!(
        lines.iter().any(|line| line.starts_with("row 4: ") && line.contains("missing.gltf")),
        "{}",
        run.err
    );
    assert_eq!(lines.last(), Some(&"2 of 5 rows failed: 3, 4"));
    assert_eq!(file_names(&d.join("out")), ["fifth.mp4", "first.mp4", "second.mp4"]);
    for name in file_names(&d.join("out")) {
        assert!(read_file(d, &format!("out/{name}")) == read_file(d, &format!("one/{name}")), "{name}");
    }
    assert!(read_file(d, "out/first.mp4") != read_file(d, "out/fifth.mp4"));
    let summary: serde_json::Value = serde_json::from_str(&run.out).unwrap();
    assert_eq!(summary["ok"], false);
    let of = |key: &str| {
        summary["rows"].as_array().unwrap().iter().map(|row| row[key].clone()).collect::<Vec<_>>()
    };
    assert_eq!(of("ok"), [true, true, false, false, true]);
    assert_eq!(of("frames")[..2], [5, 3]);
    assert!(of("errors")[2][0]["line"].as_u64().is_some(), "{summary}");
    // The same rows as JSON, a single row, and images in folders that the rows name.
    let json = r##"[{"name": "Zoe", "color": "#20c040"}, {"name": "Ben", "color": "#2040c0", "seconds": 0.3, "model": "other.gltf"}]"##;
    std::fs::write(d.join("rows.json"), json).unwrap();
    let args =
        ["render", "s.rhai", "--set-from", "rows.json", "--device", "cpu", "--samples", "1", "--quiet"];
    assert_eq!(choreo(d, &[&args[..], &["--row", "2", "-o", "{name}.mp4"]].concat()).code, 0);
    assert!(read_file(d, "Ben.mp4") == read_file(d, "one/second.mp4") && !d.join("Zoe.mp4").exists());
    assert_eq!(choreo(d, &[&args[..], &["-o", "{row}/{name}/%02d.png"]].concat()).code, 0);
    assert_eq!(file_names(&d.join("2/Ben")), ["00.png", "01.png", "02.png"]);
    assert_eq!(choreo(d, &[&args[..], &["-o", "{name}/still.png", "--at", "0.1"]].concat()).code, 0);
    assert!(d.join("Zoe/still.png").is_file());
}

/// If the values of a row lead to another folder, or if two rows write the same file, nothing is rendered.
#[test]
fn output_names_from_rows_cannot_leave_their_folder() {
    let dir = scene();
    let d = dir.path();
    std::fs::create_dir_all(d.join("deep/out")).unwrap();
    let before = file_names(d);
    for bad in ["../evil", "/tmp/evil", "..", "a/b", "\"a\\b\"", "%02d"] {
        std::fs::write(d.join("rows.csv"), format!("name\nfine\n{bad}\n")).unwrap();
        for pattern in ["deep/out/{name}.mp4", "deep/out/{name}/film.mp4"] {
            let run = render_batch(d, &["-o", pattern]);
            assert!(run.code == 1 && run.err.contains("row 2: name = "), "{bad}: {}", run.err);
            let job = [
                "farm",
                "s.rhai",
                "--set-from",
                "rows.csv",
                "--for",
                "slurm",
                "--to",
                "job",
                "-o",
                "{name}.mp4",
            ];
            let run = choreo(d, &job);
            assert!(run.code == 1 && run.err.contains("row 2: name = "), "{bad}: {}", run.err);
        }
        assert_eq!(file_names(d), before, "{bad}");
        assert!(file_names(&d.join("deep/out")).is_empty(), "{bad}");
    }
    std::fs::write(d.join("rows.csv"), "name\nZoe\nzoe\n").unwrap();
    let run = render_batch(d, &["-o", "deep/out/{name}.mp4"]);
    assert!(
        run.code == 1 && run.err.contains("rows 1 and 2 would both be written to deep/out/zoe.mp4"),
        "{}",
        run.err
    );
    // An existing symbolic link is not followed.
    #[cfg(unix)]
    {
        std::fs::write(d.join("precious"), "as it was").unwrap();
        std::os::unix::fs::symlink("../../precious", d.join("deep/out/Zoe.gif")).unwrap();
        let run = render_batch(d, &["-o", "deep/out/{name}{row}.gif", "--row", "1"]);
        assert_eq!(run.code, 0, "{}", run.err);
        let run = render_batch(d, &["-o", "deep/out/{name}.gif", "--row", "1"]);
        assert_eq!(run.code, 1, "{}", run.err);
        assert_eq!(read_file(d, "precious"), b"as it was");
    }
}

#[test]
fn invalid_tables_are_refused() {
    let dir = scene();
    let d = dir.path();
    let error_for = |table: (&str, &str), more: &[&str]| {
        std::fs::write(d.join(table.0), table.1).unwrap();
        let args = ["render", "s.rhai", "--device", "cpu", "--set-from", table.0, "-o", "{name}.mp4"];
        let run = choreo(d, &[&args[..], more].concat());
        assert!(run.code == 1 || run.code == 2, "{}", run.err);
        run.err
    };
    assert!(error_for(("a.csv", "name\n"), &[]).contains("a.csv: it has no rows"));
    assert!(error_for(("a.csv", "name,name\n1,2\n"), &[]).contains("two columns are called \"name\""));
    assert!(error_for(("a.csv", "name,color\n1\n"), &[]).contains("it is not a table"));
    assert!(error_for(("a.json", "{}"), &[]).contains("it is not an array of objects"));
    assert!(error_for(("a.txt", ""), &[]).contains("write a name that ends in .csv or .json"));
    let unknown = error_for(("a.csv", "name,colour\nZoe,#202020\n"), &[]);
    assert!(unknown.contains("no parameter \"colour\"; did you mean \"color\"?"), "{unknown}");
    assert!(
        unknown.ends_with("    hint: a column that only -o needs must have a name that begins with _\n"),
        "{unknown}"
    );
    assert!(error_for(("a.csv", "name\nZoe\n"), &["--row", "2"]).contains("--row 2: a.csv has rows 1 to 1"));
    assert!(
        error_for(("a.csv", "name\nZoe\n"), &["--segment", "parts"]).contains("choose its row with --row")
    );
}

/// A triangle with its own texture, which takes 21 MB with its mipmaps.
#[cfg(target_os = "linux")]
fn write_textured_model(folder: &Path, number: u8) {
    let image = image::RgbImage::from_pixel(2048, 2048, image::Rgb([number, 90, 200 - number]));
    image.save(folder.join(format!("{number}.png"))).unwrap();
    let positions: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0];
    let uvs: [f32; 6] = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    let mut bytes: Vec<u8> = positions.iter().chain(&uvs).flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    let accessor = |view: u8, kind: &str| serde_json::json!({ "bufferView": view, "componentType": 5126, "count": 3, "type": kind });
    let mut positions = accessor(0, "VEC3");
    (positions["min"], positions["max"]) = (serde_json::json!([-1, 0, 0]), serde_json::json!([1, 1, 0]));
    let mut indices = accessor(2, "SCALAR");
    indices["componentType"] = 5123.into();
    let view = |offset: u8, length: u8| serde_json::json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let model = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [
            { "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }
        ] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0 }], "images": [{ "uri": format!("{number}.png") }],
        "accessors": [positions, accessor(1, "VEC2"), indices],
        "bufferViews": [view(0, 36), view(36, 24), view(60, 6)],
        "buffers": [{
            "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{}", base64(&bytes)),
        }],
    });
    std::fs::write(folder.join(format!("{number}.gltf")), model.to_string()).unwrap();
}

/// Twenty rows with different models, of which only ten fit into the memory limit.
#[cfg(target_os = "linux")]
#[test]
fn models_of_earlier_rows_are_released() {
    let dir = scene();
    let d = dir.path();
    (0..20).for_each(|number| write_textured_model(d, number));
    let rows = (0..20).map(|number| format!("{number},{number}.gltf\n"));
    std::fs::write(d.join("rows.csv"), "_file,model\n".to_string() + &rows.collect::<String>()).unwrap();
    let run = render_batch(d, &["-o", "out{_file}.png", "--at", "0", "--limit", "memory=300000000"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert!((0..20).all(|number| d.join(format!("out{number}.png")).is_file()));
}
