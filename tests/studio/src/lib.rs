//! Example of a program by another author: choreo with its own file format and effect, in the command line and in the viewer.

use choreo::App;
use choreo_plugin::asset::Asset;
use choreo_plugin::{
    AssetBuilder, Effect, EffectPlugin, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest,
    MeshData, Shutter, ShutterEffect, Source,
};
use choreo_wgsl_effect::WgslEffect;
use std::sync::LazyLock;

/// The plugins of choreo, and those of the studio.
pub fn app() -> App {
    let mut app = choreo::app();
    app.name = "studio";
    app.version = env!("CARGO_PKG_VERSION");
    app.registry.add_importer(Triangles);
    app.registry.add_effect(WgslEffect::from_text("negative.wgsl", NEGATIVE).expect("an effect"));
    app.registry.add_effect(Effect::shutter(Fragile));
    app.defaults = "[render]\nsize = \"48x36\"\n".into();
    app
}

static TRIANGLES: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("triangles", "1", "nine numbers a triangle, as text").extensions(["tri"]).number(
        "scale",
        "metres per file unit",
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
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let error =
            |what: String| ImportError { file: source.name.clone(), place: String::new(), what, hint: None };
        let scale = options.number("scale").unwrap_or(1.0) as f32;
        let text = String::from_utf8_lossy(&source.bytes);
        let number =
            |word: &str| word.parse::<f32>().map_err(|_| error(format!("\"{word}\" is not a number")));
        let numbers = text.split_whitespace().map(number).collect::<Result<Vec<f32>, ImportError>>()?;
        let mut builder = AssetBuilder::default();
        if needs.geometry {
            let positions = numbers.iter().map(|v| v * scale).collect();
            builder.mesh(MeshData { positions, ..MeshData::default() }).map_err(|e| error(e.to_string()))?;
        }
        builder.finish(&source.name).map_err(|e| error(e.to_string()))
    }
}

static FRAGILE: LazyLock<Manifest> = LazyLock::new(|| Manifest::new("fragile", "3", "panics"));

/// A faulty effect: the program reports it and goes on.
struct Fragile;

impl EffectPlugin for Fragile {
    fn manifest(&self) -> &Manifest {
        &FRAGILE
    }
}

impl ShutterEffect for Fragile {
    fn shutter(&self, _: &[f32]) -> Option<Shutter> {
        panic!("there is no film in the camera")
    }
}

/// One text for both renderers.
const NEGATIVE: &str = "// effect: negative
// about: turns bright and dark around
// param amount = 1 in 0..1: 0 = untouched
fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32> {
    let turned = vec4<f32>(1.0 - color.rgb, color.a);
    return color * (1.0 - p.amount) + turned * p.amount;
}
";
