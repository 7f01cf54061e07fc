//! Mistakes in shaders point at the user's file and line. Without a GPU.

use choreo_render::RenderError;
use choreo_render::shader::*;

#[test]
fn shader_errors_name_the_line_of_the_author() {
    let message = |effect: &str| {
        let files = ShaderSources::default()
            .post("blur", effect, [0, 0], ParameterRows { first: 0, length: 8, reads_frame: false }, false)
            .unwrap();
        match parse(&files, &["EFFECTS"]).unwrap_err() {
            RenderError::Shader { file, text } => format!("{file}: {text}"),
            e => panic!("{e}"),
        }
    };
    // The template's wrapper has no error; the third line of the effect has.
    let m = message(
        "// blur\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return colour;\n}\n",
    );
    assert!(m.starts_with("effect \"blur\":3:12: no definition in scope for identifier: `colour`"), "{m}");
    assert!(m.contains("\n      return colour;\n             ^"), "{m}");
    // Valid syntax, wrong type.
    let m = message(
        "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return uv;\n}",
    );
    assert!(m.starts_with("effect \"blur\":"), "{m}");
    // No function of that name: the template's call is what fails.
    let m = message("fn efect() {}");
    assert!(m.contains("effect"), "{m}");
}

#[test]
fn modules_of_a_folder_replace_built_in_ones_and_errors_name_their_file() {
    let folder = std::env::temp_dir().join(format!("choreo-shaders-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("background.wgsl"), "fn x() -> f32 {\n  retrun 1.0;\n}\n").unwrap();
    let sources = ShaderSources::read(Some(folder.clone())).unwrap();
    let files = sources.files(&BACKGROUND).unwrap();
    let error = parse(&files, &[]).unwrap_err().to_string();
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(error.contains("background.wgsl:2:"), "{error}");
    // The other module still is the program's own.
    assert_eq!(files[0].name, "shaders/frame.wgsl");
}
