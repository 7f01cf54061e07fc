//! choreo with a format and a look of one's own, from a program that depends on the library crates:
//! `cargo run -p choreo --example my_plugin -- plugins`. Everything else is the command line as it is.

use choreo_asset::Asset;
use choreo_plugin::{
    AssetBuilder, Effect, Files, ImportError, ImportOptions, Importer, Manifest, MeshData, Needs, Registry,
    Source,
};
use glam::{Vec2, Vec4};
use std::process::ExitCode;
use std::sync::LazyLock;

fn main() -> ExitCode {
    let mut plugins: Registry = choreo::registry();
    plugins.add_importer(Triangles);
    plugins.add_effect(Negative);
    choreo::run(std::env::args_os(), &plugins)
}

static TRIANGLES: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("triangles", "1", "nine numbers a triangle, as text").extensions(["tri"]).number(
        "scale",
        "metres a unit of the file",
        1.0,
        1e-6..=1e6,
    )
});

/// Reads `.tri`: x y z of three vertices, repeated.
struct Triangles;

impl Importer for Triangles {
    fn manifest(&self) -> &Manifest {
        &TRIANGLES
    }

    fn import(
        &self,
        source: &Source,
        _files: &dyn Files,
        needs: Needs,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let error =
            |what: String| ImportError { file: source.name.clone(), place: String::new(), what, hint: None };
        let scale = options.number("scale").unwrap_or(1.0) as f32;
        let text = String::from_utf8_lossy(&source.bytes);
        let number = |word: &str| word.parse::<f32>().map_err(|_| error(format!("\"{word}\" is no number")));
        let numbers = text.split_whitespace().map(number).collect::<Result<Vec<f32>, ImportError>>()?;
        let mut builder = AssetBuilder::default();
        if needs.geometry {
            let positions = numbers.iter().map(|v| v * scale).collect();
            builder.mesh(MeshData { positions, ..MeshData::default() }).map_err(|e| error(e.to_string()))?;
        }
        builder.finish(&source.name).map_err(|e| error(e.to_string()))
    }
}

static NEGATIVE: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("negative", "1", "turns bright and dark around").number(
        "amount",
        "0 = untouched",
        1.0,
        0.0..=1.0,
    )
});

struct Negative;

impl Effect for Negative {
    fn manifest(&self) -> &Manifest {
        &NEGATIVE
    }

    fn wgsl(&self) -> &str {
        "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    let turned = vec4<f32>(1.0 - color.rgb, color.a);
    return color * (1.0 - p[0]) + turned * p[0];
}
"
    }

    /// The same function, for the renderer on the CPU.
    fn cpu(&self, color: Vec4, _uv: Vec2, p: &[f32; 8]) -> Vec4 {
        let turned = (1.0 - color.truncate()).extend(color.w);
        color * (1.0 - p[0]) + turned * p[0]
    }
}
