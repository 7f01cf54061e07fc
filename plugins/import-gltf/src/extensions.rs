//! Versions and extensions: what is read, what can be left out, what makes a file unreadable.

use crate::file::File;
use crate::problem::{Problem, Result};
use crate::repair;
use choreo_plugin::ImportScope;
use gltf::json::mesh::Primitive;

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

/// An extension without which, if it is required, the file's data cannot be read.
struct Essential {
    name: &'static str,
    part: Content,
    hint: &'static str,
}

#[derive(PartialEq, Eq)]
enum Content {
    Geometry,
    Textures,
}

impl Essential {
    fn is_needed(&self, needs: ImportScope) -> bool {
        match self.part {
            Content::Geometry => needs.geometry,
            Content::Textures => needs.textures,
        }
    }
}

const DRACO: &str = "KHR_draco_mesh_compression";

const ESSENTIAL: &[Essential] = &[
    Essential {
        name: DRACO,
        part: Content::Geometry,
        hint: "export without Draco compression, or decompress with `gltf-transform copy in.glb out.glb`",
    },
    Essential {
        name: "KHR_texture_basisu",
        part: Content::Textures,
        hint: "convert the textures to PNG, JPEG or WebP",
    },
    Essential {
        name: "MSFT_texture_dds",
        part: Content::Textures,
        hint: "convert the textures to PNG, JPEG or WebP",
    },
];

/// `own`: extensions that the profile reads.
pub fn check(file: &File<'_>, needs: ImportScope, own: &[&str]) -> Result<()> {
    let asset = &file.root.asset;
    let needed = asset.min_version.as_ref().unwrap_or(&asset.version);
    let readable = match asset.min_version.is_some() {
        true => needed == "2.0",
        false => needed.split('.').next() == Some("2"),
    };
    if !readable {
        return Err(repair::unsupported_version(needed));
    }
    let known = |name: &str| READ.contains(&name) || own.contains(&name);
    let without: Vec<&Essential> = ESSENTIAL
        .iter()
        .filter(|e| file.root.extensions_required.iter().any(|name| name == e.name) && e.is_needed(needs))
        .collect();
    if !without.is_empty() {
        // All of them, so that one conversion is enough.
        let left_out = |name: &&str| ESSENTIAL.iter().any(|e| e.name == *name && !e.is_needed(needs));
        let names = file.root.extensions_required.iter().map(String::as_str);
        let names: Vec<&str> = names.filter(|name| !known(name) && !left_out(name)).collect();
        return Err(unsupported("extensionsRequired", &names, &without));
    }
    for name in crate::profile::used(&file.root) {
        if known(name) {
            continue;
        }
        // Most of such files can be read without it, so that it is no error.
        match file.root.extensions_required.contains(name) {
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

/// `names` are not supported; `without`: those of them whose data the file cannot be read without.
fn unsupported(place: impl Into<String>, names: &[&str], without: &[&Essential]) -> Problem {
    let listed = match names {
        [one] => format!("{one}, which is not supported"),
        [first @ .., last] => format!("{} and {last}, which are not supported", first.join(", ")),
        [] => String::new(),
    };
    let mut hints: Vec<&str> = without.iter().map(|e| e.hint).collect();
    hints.dedup();
    Problem::new(place, format!("the file needs {listed}")).hint(hints.join("; "))
}

/// Refuses a primitive whose vertices are only there as Draco has packed them: where the extension is not required the file
/// should have them unpacked as well, but some writers leave their accessors empty.
pub fn refuse_empty_fallback(
    file: &File<'_>,
    primitive: &Primitive,
    place: &dyn Fn() -> String,
) -> Result<()> {
    if !primitive.extensions.as_ref().is_some_and(|e| e.others.contains_key(DRACO)) {
        return Ok(());
    }
    let is_empty = |accessor: usize| {
        let accessor = file.root.accessors.get(accessor);
        accessor.is_some_and(|a| a.buffer_view.is_none() && a.sparse.is_none())
    };
    let accessors = primitive.attributes.values().chain(&primitive.indices);
    let essential = ESSENTIAL.iter().filter(|e| e.name == DRACO);
    match accessors.map(|a| a.value()).any(is_empty) {
        true => Err(unsupported(place(), &[DRACO], &essential.collect::<Vec<_>>())),
        false => Ok(()),
    }
}
