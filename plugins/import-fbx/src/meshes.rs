//! Meshes with their nodes and materials. Each combination of mesh and materials is built once.

use crate::file::{File, place_of};
use crate::geometry::Geometry;
use crate::materials::MaterialDraft;
use crate::nodes::{self, Tree};
use crate::{morphs, skinning, vertices};
use choreo_asset::{Asset, Mesh, MeshInstance};
use choreo_importer_kit::text::count;
use choreo_importer_kit::{Problem, Result};
use std::collections::BTreeMap;
use std::sync::Arc;
use ufbx::{Node, SubdivisionDisplayMode};

/// A mesh on a shown node.
pub(crate) struct VisibleMesh<'a> {
    pub joint: u32,
    /// The node of the file. A helper below it may hold the mesh instead: `holder`.
    pub node: &'a Node,
    pub holder: &'a Node,
    pub mesh: &'a ufbx::Mesh,
}

/// Shown meshes in the order of their joints. Warns about objects that are not shown, with the reason.
pub(crate) fn visible_meshes<'a>(file: &File<'a>, tree: &Tree) -> Vec<VisibleMesh<'a>> {
    let mut out = Vec::new();
    for (joint, id) in &tree.holders {
        let Some(holder) = file.scene.nodes.as_ref().get(*id) else { continue };
        let holder: &Node = holder;
        let node = nodes::owner(holder);
        let mut meshes = 0;
        for attribute in holder.all_attribs.as_ref() {
            let place = || place_of(&node.element);
            if let Some(mesh) = ufbx::as_mesh(attribute) {
                if !tree.visible[*joint as usize] {
                    file.notes.warn(
                        place(),
                        "its mesh is hidden in the file and left out; the option hidden shows it",
                    );
                    break;
                }
                meshes += 1;
                out.push(VisibleMesh { joint: *joint, node, holder, mesh });
                continue;
            }
            let kind = match attribute.type_ {
                ufbx::ElementType::NurbsSurface
                | ufbx::ElementType::NurbsCurve
                | ufbx::ElementType::NurbsTrimSurface => "NURBS",
                ufbx::ElementType::LineCurve => "a line",
                ufbx::ElementType::ProceduralGeometry => "procedural geometry",
                ufbx::ElementType::StereoCamera => "a stereo camera",
                _ => continue,
            };
            file.notes.warn(place(), format!("is {kind}, which is not read"));
        }
        if meshes > 1 {
            let what = format!("has {meshes} meshes; blend weights of clips reach the first only");
            file.notes.warn(place_of(&node.element), what);
        }
    }
    out
}

pub(crate) fn read(
    file: &File<'_>,
    tree: &Tree,
    visible_meshes: &[VisibleMesh<'_>],
    materials: &[MaterialDraft],
    asset: &mut Asset,
) -> Result<()> {
    // Key: the mesh, and the materials that its node assigns.
    let mut known: BTreeMap<(u32, Vec<u32>), Option<u32>> = BTreeMap::new();
    for visible_mesh in visible_meshes {
        let slots = material_slots(visible_mesh);
        file.charge(slots.len() + 8, 8, || place_of(&visible_mesh.node.element))?;
        let key = (visible_mesh.mesh.element.typed_id, slots);
        let mesh = match known.get(&key) {
            Some(mesh) => *mesh,
            None => {
                let built = build_mesh(file, visible_mesh, &key.1, materials)?;
                let index = built.map(|mesh| {
                    asset.meshes.push(Arc::new(mesh));
                    asset.meshes.len() as u32 - 1
                });
                known.insert(key, index);
                index
            }
        };
        let Some(mesh) = mesh else { continue };
        let skin = skinning::skin(file, tree, visible_mesh)?.map(|skin| {
            asset.skins.push(skin);
            asset.skins.len() as u32 - 1
        });
        let weights = morphs::rest_weights(visible_mesh.mesh);
        asset.instances.push(MeshInstance {
            joint: visible_mesh.joint,
            mesh,
            skin,
            weights,
            ..Default::default()
        });
    }
    Ok(())
}

/// Materials of a mesh instance, by `typed_id`. They come from the file's node, because ufbx gives helpers the materials of the
/// mesh's first node.
fn material_slots(visible_mesh: &VisibleMesh<'_>) -> Vec<u32> {
    let list = |node: &Node| -> Vec<u32> { node.materials.into_iter().map(|m| m.element.typed_id).collect() };
    let mut out = list(visible_mesh.holder);
    let above =
        visible_mesh.holder.parent.as_ref().filter(|_| visible_mesh.holder.is_geometry_transform_helper);
    for (slot, own) in out.iter_mut().zip(above.map_or(Vec::new(), |p| list(p))) {
        *slot = own;
    }
    out
}

/// Builds a mesh; `None` where no face has an area.
fn build_mesh(
    file: &File<'_>,
    visible_mesh: &VisibleMesh<'_>,
    slots: &[u32],
    materials: &[MaterialDraft],
) -> Result<Option<Mesh>> {
    let mesh = visible_mesh.mesh;
    let place = || match mesh.element.name.as_ref() {
        "" => format!("mesh of {}", place_of(&visible_mesh.node.element)),
        _ => place_of(&mesh.element),
    };
    warn_unread(file, mesh, &place());
    let weights = skinning::weights(file, mesh, &place)?;
    let geometry = Geometry::of(visible_mesh.holder);
    let mut targets = morphs::targets(file, mesh, &place)?;
    if let Some(geometry) = &geometry {
        targets.iter_mut().for_each(|t| t.apply_geometry(geometry));
    }
    let point_attributes = vertices::PointAttributes {
        weights: weights.as_ref(),
        targets: &targets,
        geometry: geometry.as_ref(),
    };
    let primitives = vertices::build_primitives(file, mesh, slots, materials, point_attributes, &place)?;
    if primitives.is_empty() {
        file.notes.warn(place(), "has no face with three or more vertices and is left out");
        return Ok(None);
    }
    if primitives.iter().flat_map(|p| &p.positions).any(|p| !p.is_finite()) {
        return Err(Problem::new(place(), "a vertex position is not finite"));
    }
    let name = match mesh.element.name.as_ref() {
        "" => visible_mesh.node.element.name.to_string(),
        name => name.to_string(),
    };
    Ok(Some(Mesh { name, primitives, morph_targets: targets.len(), morph_names: morphs::names(mesh) }))
}

/// Warns about parts of a mesh that are not read.
fn warn_unread(file: &File<'_>, mesh: &ufbx::Mesh, place: &str) {
    let few = mesh.num_point_faces + mesh.num_line_faces;
    if few > 0 {
        file.notes.warn(place, format!("{} with one or two vertices left out", count(few, "face")));
    }
    if !mesh.cache_deformers.as_ref().is_empty() {
        file.notes.warn(place, "a point cache moves it, which is not read; it is shown at rest");
    }
    if mesh.color_sets.len() > 1 {
        file.notes
            .warn(place, format!("has {} sets of vertex colors; the first is used", mesh.color_sets.len()));
    }
    let smooth = matches!(
        mesh.subdivision_display_mode,
        SubdivisionDisplayMode::HullAndSmooth | SubdivisionDisplayMode::Smooth
    );
    if smooth && mesh.subdivision_render_levels > 0 {
        file.notes.warn(place, "is a subdivision surface; its cage is shown");
    }
}
