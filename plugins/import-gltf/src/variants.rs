//! KHR_materials_variants: the material of a primitive in the chosen variant.

use crate::file::File;
use crate::problem::{Problem, Result};
use crate::repair::as_integer;
use gltf::json;
use serde_json::Value;

pub(crate) const NAME: &str = "KHR_materials_variants";

/// The index of the variant with this name; `None` for an empty name.
pub(crate) fn find_variant(file: &File<'_>, name: &str) -> Result<Option<u64>> {
    let extensions = file.root.extensions.as_ref();
    let listed = extensions.and_then(|e| e.others.get(NAME)?.get("variants")?.as_array());
    let names: Vec<&str> = match listed {
        Some(list) => {
            list.iter().map(|v| v.get("name").and_then(Value::as_str).unwrap_or_default()).collect()
        }
        None => Vec::new(),
    };
    if name.is_empty() {
        return Ok(None);
    }
    match names.iter().position(|n| *n == name) {
        Some(index) => Ok(Some(index as u64)),
        None if names.is_empty() => {
            Err(Problem::new("extensions", format!("has no variants, so {name:?} cannot be chosen")))
        }
        None => Err(Problem::new(format!("extensions.{NAME}.variants"), format!("has no variant {name:?}"))
            .hint(format!("its variants are {}", names.join(", ")))),
    }
}

/// The primitive's material in the chosen variant, or its default material where no mapping names the variant.
pub(crate) fn material(file: &File<'_>, primitive: &json::mesh::Primitive) -> Option<usize> {
    let own = primitive.material.map(|m| m.value());
    let Some(variant) = file.variant else { return own };
    let mappings =
        primitive.extensions.as_ref().and_then(|e| e.others.get(NAME)?.get("mappings")?.as_array());
    let names_it = |m: &&Value| {
        let variants = m.get("variants").and_then(Value::as_array);
        variants.is_some_and(|list| list.iter().any(|v| as_integer(v) == Some(variant)))
    };
    let mapped = mappings.and_then(|list| list.iter().find(names_it)?.get("material").and_then(as_integer));
    mapped.and_then(|m| usize::try_from(m).ok()).or(own)
}
