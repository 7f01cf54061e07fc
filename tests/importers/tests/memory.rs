//! Peak memory of the import of one polygon with very many vertices, in each format. Each import runs in a separate process.

use choreo_importer_kit_testing::{Companions, import, source};
use choreo_plugin::ImportScope;
use std::path::Path;
use std::process::Command;

const VERTICES: usize = 600_000;
/// Largest increase of memory by the import, KiB.
const MAX_INCREASE_KIB: usize = 40_000;
/// Environment variable with the format, set in the process that only imports.
const FORMAT_VARIABLE: &str = "CHOREO_PEAK_OF";

/// One polygon that goes round the same three points: a file of 1.2 MB.
fn polygon(format: &str) -> String {
    let list = |first: usize, between: &str| {
        let numbers: Vec<String> = (0..VERTICES).map(|i| (first + i % 3).to_string()).collect();
        numbers.join(between)
    };
    match format {
        "obj" => format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n", list(1, " ")),
        "dae" => format!(
            "<COLLADA version=\"1.4.1\"><library_geometries><geometry id=\"g\"><mesh><source id=\"s\"><float_array id=\"a\" count=\"9\">0 0 0 1 0 0 0 1 0</float_array>\
             <technique_common><accessor source=\"#a\" count=\"3\" stride=\"3\"/></technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices>\
             <polylist count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><vcount>{VERTICES}</vcount><p>{}</p></polylist></mesh></geometry></library_geometries>\
             <library_visual_scenes><visual_scene id=\"x\"><node id=\"n\"><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>\
             <scene><instance_visual_scene url=\"#x\"/></scene></COLLADA>",
            list(0, " ")
        ),
        // The last one of a polygon is written as its complement.
        "fbx" => format!(
            "; FBX 7.4.0 project file\nFBXHeaderExtension: {{\nFBXVersion: 7400\n}}\nObjects: {{\nModel: 1, \"Model::n\", \"Mesh\" {{\n}}\n\
             Geometry: 2, \"Geometry::g\", \"Mesh\" {{\nVertices: *9 {{\na: 0,0,0,1,0,0,0,1,0\n}}\nPolygonVertexIndex: *{} {{\na: {},-1\n}}\n}}\n}}\n\
             Connections: {{\nC: \"OO\",1,0\nC: \"OO\",2,1\n}}\n",
            VERTICES + 1,
            list(0, ",")
        ),
        other => panic!("{other}"),
    }
}

/// Memory of this process in KiB from /proc/self/status: `VmRSS` is the current, `VmHWM` the peak value.
fn status(key: &str) -> Option<usize> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    text.lines().find(|l| l.starts_with(key))?.split_whitespace().nth(1)?.parse().ok()
}

fn import_alone(format: &str) {
    let name = format!("a.{format}");
    let source = source(&name, polygon(format));
    let before = status("VmRSS:");
    let importer = importers::importer(Path::new(&name)).unwrap();
    let asset =
        import(importer, &source, &Companions::none(), ImportScope::ALL).unwrap_or_else(|e| panic!("{e}"));
    let triangles = asset.meshes[0].primitives[0].indices.len() / 3;
    assert!(triangles >= VERTICES - 2, "{triangles}");
    if let (Some(before), Some(highest)) = (before, status("VmHWM:")) {
        println!("\npeak {}", highest.saturating_sub(before));
    }
}

#[test]
fn a_polygon_of_600_000_vertices() {
    if let Ok(format) = std::env::var(FORMAT_VARIABLE) {
        return import_alone(&format);
    }
    for format in ["obj", "dae", "fbx"] {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "a_polygon_of_600_000_vertices", "--nocapture"])
            .env(FORMAT_VARIABLE, format);
        let output = command.output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{text}");
        let peak = text.lines().find_map(|l| l.strip_prefix("peak ")).map(|n| n.parse::<usize>().unwrap());
        match peak {
            Some(peak) => {
                println!("{format}: {peak} KiB");
                assert!(
                    peak < MAX_INCREASE_KIB,
                    "{format}: {peak} KiB, at most {MAX_INCREASE_KIB} are allowed"
                );
            }
            None => println!("SKIP 1: no /proc/self/status"),
        }
    }
}
