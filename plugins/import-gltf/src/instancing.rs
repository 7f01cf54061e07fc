//! EXT_mesh_gpu_instancing: copies of a node's mesh.

use crate::accessor::Integers;
use crate::file::File;
use crate::problem::{Problem, Result, WithPlace};
use crate::repair::as_integer;
use glam::{Affine3A, Quat, Vec3};
use serde_json::Value;
use std::sync::Arc;

pub(crate) const NAME: &str = "EXT_mesh_gpu_instancing";

/// The joint-from-mesh transform of every copy; empty where the node lacks the extension.
pub(crate) fn read_copies(file: &File<'_>, node: usize) -> Result<Arc<[Affine3A]>> {
    let extension = file.root.nodes[node].extensions.as_ref().and_then(|e| e.others.get(NAME));
    let Some(extension) = extension else { return Ok([].into()) };
    let place = || format!("nodes[{node}].extensions.{NAME}");
    let listed = extension.get("attributes").and_then(Value::as_object);
    let accessor = |name: &str| -> Result<Option<usize>> {
        let Some(value) = listed.and_then(|l| l.get(name)) else { return Ok(None) };
        let index = as_integer(value).and_then(|n| usize::try_from(n).ok());
        index
            .map(Some)
            .ok_or_else(|| Problem::new(format!("{}.{name}", place()), "is not the number of an accessor"))
    };
    let [translation, rotation, scale] =
        [accessor("TRANSLATION")?, accessor("ROTATION")?, accessor("SCALE")?];
    for name in listed.iter().flat_map(|l| l.keys()) {
        if !["TRANSLATION", "ROTATION", "SCALE"].contains(&name.as_str()) {
            file.warn(place(), format!("{name} is not an attribute that can be shown; it is left out"));
        }
    }
    let mut count = None;
    for (name, accessor) in [("TRANSLATION", translation), ("ROTATION", rotation), ("SCALE", scale)] {
        let Some(accessor) = accessor else { continue };
        let own = file.count(accessor).at(|| format!("{}.{name}", place()))?;
        if count.is_some_and(|c| c != own) {
            let what =
                format!("{name} has {own} elements, but the attribute before it has {}", count.unwrap_or(0));
            return Err(Problem::new(place(), what));
        }
        count = Some(own);
    }
    let Some(count) = count else {
        file.warn(place(), "has no TRANSLATION, ROTATION or SCALE; the mesh is shown once");
        return Ok([].into());
    };
    if count == 0 {
        file.warn(place(), "has no instances; the mesh is shown once");
        return Ok([].into());
    }
    file.charge(count, size_of::<Affine3A>()).at(place)?;
    let vectors = |accessor: Option<usize>, name: &str| match accessor {
        None => Ok(Vec::new()),
        Some(accessor) => {
            file.read_floats::<3>(accessor, Integers::AsFlagged).at(|| format!("{}.{name}", place()))
        }
    };
    let translations = vectors(translation, "TRANSLATION")?;
    let scales = vectors(scale, "SCALE")?;
    let rotations = match rotation {
        None => Vec::new(),
        Some(accessor) => {
            file.read_floats::<4>(accessor, Integers::Normalized).at(|| format!("{}.ROTATION", place()))?
        }
    };
    let mut zero = 0;
    let out = (0..count as usize)
        .map(|i| {
            let rotation = rotations.get(i).map_or(Quat::IDENTITY, |r| {
                let r = Quat::from_array(*r);
                let length = r.length();
                // The length overflows to infinity for very large floats.
                if length > 1e-6 && length.is_finite() {
                    r * (1.0 / length)
                } else {
                    zero += 1;
                    Quat::IDENTITY
                }
            });
            Affine3A::from_scale_rotation_translation(
                scales.get(i).map_or(Vec3::ONE, |s| Vec3::from(*s)),
                rotation,
                translations.get(i).map_or(Vec3::ZERO, |t| Vec3::from(*t)),
            )
        })
        .collect::<Vec<_>>();
    if zero > 0 {
        file.warn(place(), format!("{zero} rotations have length 0; those instances are not rotated"));
    }
    Ok(out.into())
}
