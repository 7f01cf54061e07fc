//! A character made by code: a ball-jointed figure with a few clips, so that a first scene needs no file.

mod cast;
mod clips;
mod field;
mod figure;
mod keys;
mod mesh;
mod pose;
mod rig;
mod skin;

use choreo_asset::{Asset, Material, MeshInstance};
use choreo_plugin::{
    Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source, color,
};
use glam::{DVec3, Vec3, Vec4};
use std::sync::{Arc, LazyLock};

/// Name that selects the figure in place of a file: `load("choreo:mannequin")`.
pub const SOURCE_NAME: &str = "choreo:mannequin";

/// The default colors, chosen to look well together under a warm key light.
const BODY: &str = "#e9e2d3";
const ACCENT: &str = "#2c3036";
const EYES: &str = "#8fe8ff";

const HEIGHT: (f64, f64, f64) = (1.75, 0.3, 10.0);

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "mannequin",
        env!("CARGO_PKG_VERSION"),
        "the built-in character and its clips: load(\"choreo:mannequin\")",
    )
    .color("color", "a color for the body", linear(BODY))
    .color("accent", "a color for the joints", linear(ACCENT))
    .color("eyes", "a color for the light in the visor", linear(EYES))
    .number("height", "height in metres; walking speed grows with it", HEIGHT.0, HEIGHT.1..=HEIGHT.2)
});

pub struct Mannequin;

impl Importer for Mannequin {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn claim(&self, source: &Source) -> Claim {
        if source.name == SOURCE_NAME { Claim::Content(100) } else { Claim::NotMine }
    }

    fn import(
        &self,
        source: &Source,
        _files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let refuse = |place: &str, what: String, hint: Option<String>| ImportError {
            file: source.name.clone(),
            place: place.into(),
            what,
            hint,
        };
        let color = |option: &str, default: &str| {
            let given = options.numbers(option).and_then(|n| <[f64; 3]>::try_from(n).ok());
            DVec3::from_array(given.unwrap_or_else(|| linear(default))).as_vec3()
        };
        let height = options.number("height").unwrap_or(HEIGHT.0);
        if !(HEIGHT.1..=HEIGHT.2).contains(&height) {
            let what = format!("height is {height}, must be {} to {} metres", HEIGHT.1, HEIGHT.2);
            return Err(refuse("option \"height\"", what, None));
        }
        let scale = height as f32 / rig::REST_HEIGHT;
        let joints = rig::joints();
        let internal = |what: String| refuse("", what, None);
        let skeleton = rig::skeleton(&joints, scale).map_err(|e| internal(e.to_string()))?;
        let mut asset = Asset { name: source.name.clone(), skeleton: Arc::new(skeleton), ..Asset::default() };
        let looks = [color("color", BODY), color("accent", ACCENT), color("eyes", EYES)];
        if needs.geometry {
            asset.meshes.push(Arc::new(mesh::build(scale)));
            asset.skins.push(mesh::skin(&joints, scale));
            asset.instances.push(MeshInstance { joint: 0, mesh: 0, skin: Some(0), ..Default::default() });
            asset.materials = materials(looks).into();
        }
        if needs.clips {
            for movement in clips::movements() {
                let clip = clips::clip(&movement, &joints, scale).map_err(|e| internal(e.to_string()))?;
                asset.clips.push(Arc::new(clip));
            }
        }
        Ok(asset)
    }
}

/// Linear red, green and blue of a color name or a hexadecimal color.
fn linear(color: &str) -> [f64; 3] {
    color::parse(color).map_or([1.0; 3], |color| color.truncate().to_array().map(f64::from))
}

/// Materials, in the order of the material numbers in `figure`.
fn materials([body, accent, eyes]: [Vec3; 3]) -> [Material; 4] {
    let plastic = |name: &str, color: Vec3, roughness: f32| Material {
        name: name.into(),
        base_color: color.extend(1.0),
        metallic: 0.0,
        roughness,
        ..Material::default()
    };
    [
        plastic("body", body, 0.42),
        plastic("joints", accent, 0.55),
        plastic("visor", Vec3::splat(0.006), 0.12),
        Material {
            emissive: eyes * 1.6,
            base_color: Vec4::new(0.0, 0.0, 0.0, 1.0),
            ..plastic("eyes", eyes, 0.5)
        },
    ]
}
