//! Checks version and extensions: which are read, which may be ignored, and which make a file unreadable.

use crate::file::File;
use crate::problem::{Problem, Result};
use crate::repair;
use choreo_plugin::ImportScope;

const SUPPORTED_EXTENSIONS: &[&str] = &[
    "EXT_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    crate::draco::NAME,
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// The texture extension that makes a file unreadable where it is required.
const DDS_EXTENSION: &str = "MSFT_texture_dds";

/// `profile_extensions`: the extensions that the profile reads.
pub(crate) fn check(file: &File<'_>, needs: ImportScope, profile_extensions: &[&str]) -> Result<()> {
    let asset = &file.root.asset;
    let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
    let readable = match asset.min_version.is_some() {
        true => needed == "2.0",
        false => needed.split('.').next() == Some("2"),
    };
    if !readable {
        return Err(repair::unsupported_version(needed));
    }
    let is_supported =
        |name: &str| SUPPORTED_EXTENSIONS.contains(&name) || profile_extensions.contains(&name);
    let required = &file.root.extensions_required;
    if needs.textures && required.iter().any(|name| name == DDS_EXTENSION) {
        // Lists all of them, so that one conversion is enough.
        let names: Vec<&str> =
            required.iter().map(String::as_str).filter(|name| !is_supported(name)).collect();
        return Err(unsupported(&names));
    }
    for name in crate::profile::used_extensions(&file.root) {
        if is_supported(name) {
            continue;
        }
        // Most files that require it can be read without it, so it is only a warning.
        match required.contains(name) {
            true => file.warn(
                "extensionsRequired",
                format!(
                    "the file requires {name}, which is not supported; without it the model may look wrong"
                ),
            ),
            false => file.warn("extensionsUsed", format!("{name} is not supported; what it says is ignored")),
        }
    }
    Ok(())
}

fn unsupported(names: &[&str]) -> Problem {
    let listed = match names {
        [one] => format!("{one}, which is not supported"),
        [first @ .., last] => format!("{} and {last}, which are not supported", first.join(", ")),
        [] => String::new(),
    };
    let what = format!("the file needs {listed}");
    Problem::new("extensionsRequired", what).hint("convert the textures to PNG, JPEG, WebP or KTX2")
}
