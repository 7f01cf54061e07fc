//! Meshes and their instances (glTF 2.0 §3.7).

use crate::accessor::Integers;
use crate::file::File;
use crate::nodes::Tree;
use crate::problem::{Problem, Result, WithPlace, element};
use crate::{draco, instancing, skinning, topology, variants};
use choreo_asset::{Material, Mesh, MeshInstance, MorphTarget, Primitive, Skin, Topology};
use choreo_importer_kit::text::count;
use choreo_importer_kit::{normals, tangents};
use glam::{Vec2, Vec3, Vec4};
use gltf::json;
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use std::sync::Arc;

/// Number of morph targets of each mesh, from the JSON alone.
pub(crate) fn morph_counts(file: &File<'_>) -> Vec<usize> {
    let targets = |p: &json::mesh::Primitive| p.targets.as_ref().map_or(0, Vec::len);
    file.root.meshes.iter().map(|m| m.primitives.iter().map(targets).max().unwrap_or(0)).collect()
}

pub(crate) fn read(file: &File<'_>, materials: &[Material]) -> Result<Vec<Arc<Mesh>>> {
    let counts = morph_counts(file).into_iter().enumerate();
    counts.map(|(index, morphs)| Ok(Arc::new(read_mesh(file, index, morphs, materials)?))).collect()
}

fn read_mesh(file: &File<'_>, index: usize, morph_targets: usize, materials: &[Material]) -> Result<Mesh> {
    let json = &file.root.meshes[index];
    let mut primitives = Vec::with_capacity(json.primitives.len());
    for (number, primitive) in json.primitives.iter().enumerate() {
        let place = || format!("meshes[{index}].primitives[{number}]");
        if let Some(mut read) = read_primitive(file, primitive, materials, &place)? {
            if read.morphs.len() < morph_targets {
                file.warn(
                    place(),
                    format!("has {} of the mesh's {morph_targets} morph targets", read.morphs.len()),
                );
                file.charge(morph_targets as u64, size_of::<MorphTarget>()).at(place)?;
                read.morphs.resize(morph_targets, MorphTarget::default());
            }
            primitives.push(read);
        }
    }
    Ok(Mesh {
        name: json.name.clone().unwrap_or_else(|| format!("mesh {index}")),
        primitives,
        morph_targets,
        morph_names: morph_names(json, morph_targets),
    })
}

/// Names of the morph targets: `extras.targetNames` of the mesh, as most writers put them, or of a primitive, as VRM 0.x writers
/// do; else "target N".
fn morph_names(json: &json::Mesh, count: usize) -> Vec<String> {
    let listed = |extras: &json::Extras| {
        let value: serde_json::Value = serde_json::from_str(extras.as_ref()?.get()).ok()?;
        value.get("targetNames")?.as_array().cloned()
    };
    let of_mesh = listed(&json.extras);
    let listed = of_mesh.or_else(|| json.primitives.iter().find_map(|p| listed(&p.extras)));
    (0..count)
        .map(|i| match listed.as_ref().and_then(|l| l.get(i)).and_then(|n| n.as_str()) {
            Some(name) => name.to_string(),
            None => format!("target {i}"),
        })
        .collect()
}

struct Attributes<'a, 'f> {
    file: &'a File<'f>,
    json: &'a json::mesh::Primitive,
    place: &'a dyn Fn() -> String,
}

impl Attributes<'_, '_> {
    fn find(&self, semantic: Semantic) -> Option<usize> {
        self.json.attributes.get(&Checked::Valid(semantic)).map(|i| i.value())
    }

    /// The values of an attribute, exactly `vertices` of them; empty where the primitive lacks it.
    fn read_floats<const N: usize>(
        &self,
        semantic: Semantic,
        integers: Integers,
        vertices: usize,
    ) -> Result<Vec<[f32; N]>> {
        match self.find(semantic.clone()) {
            None => Ok(Vec::new()),
            Some(accessor) => self.read_exactly(accessor, &semantic.to_string(), integers, vertices),
        }
    }

    fn read_exactly<const N: usize>(
        &self,
        accessor: usize,
        name: &str,
        integers: Integers,
        vertices: usize,
    ) -> Result<Vec<[f32; N]>> {
        let user = || format!("{}.{name}", (self.place)());
        let values = self.file.read_floats::<N>(accessor, integers).at(user)?;
        if values.len() != vertices {
            let what =
                format!("accessors[{accessor}] has {} elements for {vertices} positions", values.len());
            return Err(Problem::new(user(), what));
        }
        Ok(values)
    }
}

fn read_primitive(
    file: &File<'_>,
    json: &json::mesh::Primitive,
    materials: &[Material],
    place: &dyn Fn() -> String,
) -> Result<Option<Primitive>> {
    file.unpacked_primitive.replace(draco::unpack(file, json, place)?);
    let attributes = Attributes { file, json, place };
    let Some(accessor) = attributes.find(Semantic::Positions) else {
        file.warn(place(), "has no POSITION; it is left out");
        return Ok(None);
    };
    let vertices = file.count(accessor).at(|| format!("{}.POSITION", place()))? as usize;
    let positions = attributes.read_exactly::<3>(accessor, "POSITION", Integers::AsFlagged, vertices)?;
    if positions.is_empty() {
        file.warn(place(), "has no vertices; it is left out");
        return Ok(None);
    }
    let material = variants::material(file, json);
    if let Some(m) = material {
        element(materials, m, "materials", || format!("{}.material", place()))?;
    }
    let (topology, indices) = read_indices(file, json, vertices, place)?;
    let mut out = Primitive {
        topology,
        indices,
        positions: to_vectors(positions, Vec3::from),
        normals: to_vectors(
            attributes.read_floats(Semantic::Normals, Integers::AsFlagged, vertices)?,
            Vec3::from,
        ),
        uvs: [read_uvs(&attributes, 0, vertices)?, read_uvs(&attributes, 1, vertices)?],
        colors: read_colors(&attributes, vertices)?,
        morphs: read_morphs(&attributes, vertices)?,
        material: material.map(|m| m as u32),
        ..Primitive::default()
    };
    skinning::read(file, json, place, &mut out)?;
    complete_normals(file, &mut out, place)?;
    if let (Some((uv_set, used_by)), Topology::Triangles) =
        (material.and_then(|m| needs_tangents(&materials[m])), topology)
    {
        complete_tangents(&attributes, &mut out, (uv_set, used_by), vertices)?;
    }
    Ok(Some(out))
}

fn to_vectors<const N: usize, V>(from: Vec<[f32; N]>, to: impl Fn([f32; N]) -> V) -> Vec<V> {
    from.into_iter().map(to).collect()
}

fn read_uvs(attributes: &Attributes<'_, '_>, set: u32, vertices: usize) -> Result<Vec<Vec2>> {
    Ok(to_vectors(
        attributes.read_floats(Semantic::TexCoords(set), Integers::AsFlagged, vertices)?,
        Vec2::from,
    ))
}

fn read_colors(attributes: &Attributes<'_, '_>, vertices: usize) -> Result<Vec<Vec4>> {
    let Some(accessor) = attributes.find(Semantic::Colors(0)) else { return Ok(Vec::new()) };
    let clamp = |c: Vec4| c.clamp(Vec4::ZERO, Vec4::ONE);
    if attributes.file.width(accessor) == Some(3) {
        let rgb = attributes.read_exactly::<3>(accessor, "COLOR_0", Integers::Normalized, vertices)?;
        return Ok(to_vectors(rgb, |c| clamp(Vec3::from(c).extend(1.0))));
    }
    let rgba = attributes.read_exactly::<4>(accessor, "COLOR_0", Integers::Normalized, vertices)?;
    Ok(to_vectors(rgba, |c| clamp(Vec4::from(c))))
}

fn read_morphs(attributes: &Attributes<'_, '_>, vertices: usize) -> Result<Vec<MorphTarget>> {
    let mut out = Vec::new();
    for (number, target) in attributes.json.targets.iter().flatten().enumerate() {
        let read = |accessor: Option<json::Index<json::Accessor>>, name: &str| -> Result<Vec<Vec3>> {
            let Some(accessor) = accessor else { return Ok(Vec::new()) };
            let name = format!("targets[{number}].{name}");
            let offsets =
                attributes.read_exactly::<3>(accessor.value(), &name, Integers::AsFlagged, vertices)?;
            Ok(to_vectors(offsets, Vec3::from))
        };
        out.push(MorphTarget {
            positions: read(target.positions, "POSITION")?,
            normals: read(target.normals, "NORMAL")?,
            tangents: read(target.tangents, "TANGENT")?,
        });
    }
    Ok(out)
}

fn read_indices(
    file: &File<'_>,
    json: &json::mesh::Primitive,
    vertices: usize,
    place: &dyn Fn() -> String,
) -> Result<(Topology, Vec<u32>)> {
    let Checked::Valid(mode) = json.mode else {
        return Err(Problem::new(place(), "has an unknown mode").hint("glTF knows modes 0 to 6"));
    };
    if let Some(triangles) = file.unpacked_primitive.borrow_mut().indices.take() {
        return Ok((Topology::Triangles, triangles));
    }
    let charge = |n: usize| file.charge(n as u64, 12).at(place);
    let index_list = match json.indices {
        Some(accessor) => {
            let user = || format!("{}.indices", place());
            let read = file.read_integers::<1>(accessor.value()).at(user)?.into_flattened();
            if let Some(at) = read.iter().position(|i| *i as usize >= vertices) {
                return Err(Problem::new(
                    format!("{} (accessors[{}])", user(), accessor.value()),
                    format!("element {at} is vertex {}, but the number of vertices is {vertices}", read[at]),
                ));
            }
            read
        }
        None => (0..vertices as u32).collect(),
    };
    // Converted to lists, strips and fans become up to three times as long.
    charge(index_list.len())?;
    let (topology, list, rest) = topology::to_list(mode, index_list);
    if rest > 0 {
        file.warn(place(), format!("{rest} indices at the end make no whole line or triangle"));
    }
    Ok((topology, list))
}

fn complete_normals(file: &File<'_>, out: &mut Primitive, place: &dyn Fn() -> String) -> Result<()> {
    if out.normals.is_empty() {
        if out.topology == Topology::Triangles {
            charge_split(file, out, place)?;
            normals::flat(out);
        }
        return Ok(());
    }
    let mut zero = 0;
    for normal in &mut out.normals {
        *normal = match normals::unit(*normal) {
            Some(n) => n,
            None => {
                zero += 1;
                Vec3::Y
            }
        };
    }
    if zero > 0 {
        file.warn(place(), format!("{} of length 0; +Y is used", count(zero, "normal")));
    }
    Ok(())
}

/// The texture coordinate set that needs tangents, and what uses them: a normal map or anisotropy.
fn needs_tangents(material: &Material) -> Option<(usize, &'static str)> {
    let layers = material.layers.as_deref();
    let map = material.normal_texture.as_ref().or(layers.and_then(|l| l.clearcoat_normal_texture.as_ref()));
    let brushed = || {
        let l = layers.filter(|l| l.anisotropy > 0.0)?;
        Some((l.anisotropy_texture.as_ref().map_or(0, |t| usize::from(t.uv_set)), "anisotropy"))
    };
    map.map(|t| (usize::from(t.uv_set), "a normal map")).or_else(brushed)
}

fn complete_tangents(
    attributes: &Attributes<'_, '_>,
    out: &mut Primitive,
    (uv_set, used_by): (usize, &str),
    vertices: usize,
) -> Result<()> {
    // Flat normals split vertices: tangents of the file no longer fit (and §3.7.2.1 says to ignore them).
    let of_file = match out.positions.len() == vertices && attributes.find(Semantic::Normals).is_some() {
        true => attributes.read_floats::<4>(Semantic::Tangents, Integers::AsFlagged, vertices)?,
        false => Vec::new(),
    };
    if !of_file.is_empty() {
        out.tangents = to_vectors(of_file, |t| {
            let t = Vec4::from(t);
            let direction = normals::unit(t.truncate()).unwrap_or(Vec3::X);
            direction.extend(if t.w < 0.0 { -1.0 } else { 1.0 })
        });
        return Ok(());
    }
    if out.uvs[uv_set].is_empty() {
        let what = format!("has {used_by} but no TEXCOORD_{uv_set}, so it has no effect");
        attributes.file.warn((attributes.place)(), what);
        return Ok(());
    }
    charge_split(attributes.file, out, attributes.place)?;
    tangents::add(out, uv_set);
    Ok(())
}

/// Charges the budget for splitting vertices, which makes at most one vertex for each index.
fn charge_split(file: &File<'_>, out: &Primitive, place: &dyn Fn() -> String) -> Result<()> {
    let lists = |l: usize| if l == 0 { 0 } else { 12 };
    let morphs: usize = out
        .morphs
        .iter()
        .map(|m| lists(m.positions.len()) + lists(m.normals.len()) + lists(m.tangents.len()))
        .sum();
    file.charge(out.indices.len() as u64, 72 + out.influences * 6 + morphs).at(place)
}

/// The mesh instances on shown nodes.
pub(crate) fn instances(
    file: &File<'_>,
    tree: &Tree,
    meshes: &[Arc<Mesh>],
    skins: &[Skin],
) -> Result<Vec<MeshInstance>> {
    // The highest joint index in each mesh, computed once because many nodes can share a mesh.
    let highest: Vec<Option<u16>> = meshes
        .iter()
        .map(|m| m.primitives.iter().flat_map(|p| p.joint_indices.iter().copied()).max())
        .collect();
    let mut out = Vec::new();
    for (joint, node) in tree.node_of_joint[..tree.scene_joint_count].iter().enumerate() {
        let json = &file.root.nodes[*node];
        let Some(index) = json.mesh.map(|m| m.value()) else { continue };
        let place = || format!("nodes[{node}]");
        let mesh = element(meshes, index, "meshes", || format!("nodes[{node}].mesh"))?;
        let skin = json.skin.map(|s| s.value());
        if let Some(s) = skin {
            let skin = element(skins, s, "skins", || format!("nodes[{node}].skin"))?;
            if let Some(highest) = highest[index].filter(|h| usize::from(*h) >= skin.joints.len()) {
                return Err(Problem::new(
                    place(),
                    format!(
                        "meshes[{index}] uses joint {highest}, but skins[{s}] has {} joints",
                        skin.joints.len()
                    ),
                ));
            }
            if mesh.primitives.iter().any(|p| p.influences == 0) {
                file.warn(
                    place(),
                    format!("has skins[{s}], but meshes[{index}] has vertices without joints"),
                );
            }
        }
        let given = json.weights.as_ref().or(file.root.meshes[index].weights.as_ref());
        let mut weights = given.cloned().unwrap_or_default();
        if given.is_some() && weights.len() != mesh.morph_targets {
            file.warn(
                place(),
                format!("has {} weights for {} morph targets", weights.len(), mesh.morph_targets),
            );
        }
        if weights.iter().any(|w| !w.is_finite()) {
            return Err(Problem::new(place(), "has morph weights that are not finite"));
        }
        file.charge(mesh.morph_targets as u64, 4).at(place)?;
        weights.resize(mesh.morph_targets, 0.0);
        let mut copies = instancing::read_copies(file, *node)?;
        if skin.is_some() && !copies.is_empty() {
            let what = format!("has a skin and {}; a skinned mesh is shown once", instancing::NAME);
            file.warn(place(), what);
            copies = [].into();
        }
        out.push(MeshInstance {
            joint: joint as u32,
            mesh: index as u32,
            skin: skin.map(|s| s as u32),
            weights,
            copies,
        });
    }
    Ok(out)
}
