//! Versions and extensions: what is read, what can be left out, what makes a file unreadable.

use crate::file::File;
use crate::problem::{Problem, Result};
use choreo_plugin::Needs;

const READ: &[&str] = &[
    "EXT_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_animation_pointer",
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
    "KHR_texture_transform",
];

/// Where one of these is required, the file's data cannot be read without it.
struct Essential {
    name: &'static str,
    part: Part,
    hint: &'static str,
}

#[derive(PartialEq, Eq)]
enum Part {
    Geometry,
    Textures,
}

const ESSENTIAL: &[Essential] = &[
    Essential {
        name: "KHR_draco_mesh_compression",
        part: Part::Geometry,
        hint: "export without Draco compression, or decompress with `gltf-transform copy in.glb out.glb`",
    },
    Essential {
        name: "KHR_texture_basisu",
        part: Part::Textures,
        hint: "convert the textures to PNG, JPEG or WebP",
    },
    Essential {
        name: "MSFT_texture_dds",
        part: Part::Textures,
        hint: "convert the textures to PNG, JPEG or WebP",
    },
];

/// `own`: extensions that the profile reads.
pub fn check(file: &File<'_>, needs: Needs, own: &[&str]) -> Result<()> {
    let asset = &file.root.asset;
    let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
    let readable = match asset.min_version.is_some() {
        true => needed == "2.0",
        false => needed.split('.').next() == Some("2"),
    };
    if !readable {
        return Err(Problem::new("asset.version", format!("glTF {needed} is not supported, only 2.0"))
            .hint("convert the file to glTF 2.0"));
    }
    for name in &file.root.extensions_required {
        if let Some(e) = ESSENTIAL.iter().find(|e| e.name == name)
            && match e.part {
                Part::Geometry => needs.geometry,
                Part::Textures => needs.textures,
            }
        {
            let what = format!("the file needs {name}, which is not supported");
            return Err(Problem::new("extensionsRequired", what).hint(e.hint));
        }
    }
    for name in crate::profile::used(&file.root) {
        if !READ.contains(&name.as_str()) && !own.contains(&name.as_str()) {
            file.warn("extensionsUsed", format!("{name} is not supported; what it says is ignored"));
        }
    }
    Ok(())
}
