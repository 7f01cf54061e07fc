//! A model: skeleton, meshes and materials of an asset, written once. All actors of the asset refer to it.

use crate::joints::{self, Joints};
use crate::layer::{FLOAT3, INT, MATRIX4D, POINT3F, Prim, QUATF, QUATH, Specifier, Value};
use crate::materials::{self, MaterialContext, Network};
use crate::meshes::{self, Binding};
use crate::names::Names;
use crate::textures::Textures;
use choreo_exporter_kit::bake::rig;
use choreo_plugin::asset::{Asset, Material, MeshInstance, Primitive, Topology, widen};
use choreo_plugin::glam::{Affine3A, DMat4};
use choreo_plugin::motion::Transform;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A model that has been written to the layer.
pub(crate) struct Model<'a> {
    pub asset: &'a Asset,
    /// Path of the prim in the layer.
    pub path: String,
    /// Joint paths; `None` where the model has no skeleton.
    pub joints: Option<Vec<String>>,
    /// Tokens of the morph targets of each instance.
    pub shapes: Vec<Vec<String>>,
    /// Materials of the asset, then the default material of primitives without one; `None` where no primitive uses it.
    pub materials: Vec<Option<ModelMaterial>>,
}

pub(crate) struct ModelMaterial {
    pub name: String,
    pub network: Network,
}

/// Textures and losses, collected while models are made.
#[derive(Default)]
pub(crate) struct Common {
    pub textures: Textures,
    pub losses: BTreeSet<&'static str>,
}

struct ModelBuilder<'a, 'c> {
    asset: &'a Asset,
    path: String,
    joints: Option<Joints>,
    /// Rest pose: model space from each joint.
    at_rest: Vec<DMat4>,
    materials: Vec<Option<ModelMaterial>>,
    names: Names,
    /// Path of each mesh without a skeleton, by mesh and primitive, so that further instances refer to it.
    mesh_paths: BTreeMap<(u32, usize), String>,
    shape_names: Names,
    common: &'c mut Common,
}

/// Makes the model of an asset. `has_rig`: it needs a skeleton, because an actor moves its joints, or it has skins or morph
/// targets.
pub(crate) fn model<'a>(
    asset: &'a Arc<Asset>,
    name: &str,
    (parent, has_rig): (&str, bool),
    common: &mut Common,
) -> (Model<'a>, Prim<'a>) {
    let path = format!("{parent}/{name}");
    let mut builder = ModelBuilder {
        asset,
        joints: has_rig.then(|| Joints::of(asset)),
        at_rest: joints::in_model(asset, asset.skeleton.rest()),
        materials: Vec::new(),
        names: Names::default(),
        mesh_paths: BTreeMap::new(),
        shape_names: Names::default(),
        path: path.clone(),
        common,
    };
    let mut prim = Prim::new(if has_rig { "SkelRoot" } else { "Xform" }, name);
    let materials = builder.add_materials();
    builder.names.add_unique("materials");
    if let Some(joints) = &builder.joints {
        builder.names.add_unique("skeleton");
        builder.names.add_unique("animation");
        prim.children.push(skeleton(joints));
        let bounds = asset.rest_bounds();
        let corners = [bounds.min, bounds.max];
        prim.set(FLOAT3, "extent", Value::array(2, move |i| f64::from(corners[i / 3][i % 3])));
    }
    prim.children.extend((!materials.children.is_empty()).then_some(materials));
    let mut shapes = Vec::new();
    for instance in &asset.instances {
        shapes.push(builder.add_instance(instance, &mut prim.children));
    }
    let joints = builder.joints.map(|joints| joints.paths);
    (Model { asset, path, joints, shapes, materials: builder.materials }, prim)
}

fn skeleton<'a>(joints: &Joints) -> Prim<'a> {
    let mut out = Prim::new("Skeleton", "skeleton");
    out.api.push("SkelBindingAPI");
    out.set_uniform_tokens("joints", joints.paths.clone());
    if let Some(names) = &joints.names {
        out.set_uniform_tokens("jointNames", names.clone());
    }
    out.set(MATRIX4D, "bindTransforms", meshes::matrices(joints.bind.clone())).uniform = true;
    out.set(MATRIX4D, "restTransforms", meshes::matrices(joints.rest.clone())).uniform = true;
    out
}

/// The texture coordinate sets, and whether vertex colors, that all primitives with a material have.
pub(crate) fn material_context(asset: &Asset, material: Option<u32>) -> MaterialContext<'_> {
    let with_it = || asset.meshes.iter().flat_map(|m| &m.primitives).filter(|p| p.material == material);
    let is_whole = |count: usize, p: &Primitive| count == p.positions.len();
    MaterialContext {
        asset,
        uvs: [0, 1].map(|set| with_it().all(|p| is_whole(p.uvs[set].len(), p))),
        has_vertex_colors: with_it().all(|p| is_whole(p.colors.len(), p) && !p.colors.is_empty()),
    }
}

impl<'a> ModelBuilder<'a, '_> {
    fn add_materials(&mut self) -> Prim<'a> {
        let mut materials = Prim::new("Scope", "materials");
        let mut names = Names::default();
        let count = self.asset.materials.len() as u32;
        for index in (0..count).map(Some).chain([None]) {
            let mut all = self.asset.meshes.iter().flat_map(|m| &m.primitives);
            if !all.any(|p| p.material == index) {
                self.materials.push(None);
                continue;
            }
            let default = Material::default();
            let material = index.map_or(&default, |index| &self.asset.materials[index as usize]);
            let material_context = material_context(self.asset, index);
            let Common { textures, losses } = &mut *self.common;
            let network = materials::network(material, material_context, textures, losses);
            let name = names.add_unique(if material.name.is_empty() { "material" } else { &material.name });
            let path = format!("{}/materials/{name}", self.path);
            materials.children.push(network.prim(&name, &path, &material.name));
            self.materials.push(Some(ModelMaterial { name, network }));
        }
        materials
    }

    /// Adds the prims of a mesh instance. Returns the names of its blend shapes.
    fn add_instance(&mut self, instance: &'a MeshInstance, out: &mut Vec<Prim<'a>>) -> Vec<String> {
        let Some(mesh) = self.asset.meshes.get(instance.mesh as usize) else { return Vec::new() };
        let target_names = meshes::target_names(mesh);
        let is_shaped = self.joints.is_some() && mesh.morph_targets > 0;
        let shapes: Vec<String> = match is_shaped {
            true => target_names.iter().map(|name| self.shape_names.add_unique(name)).collect(),
            false => Vec::new(),
        };
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let name = if mesh.name.is_empty() { "mesh" } else { &mesh.name };
            let name = self.names.add_unique(name);
            let material = self.material_of(primitive);
            let Some(mut prim) = meshes::prim(&name, primitive, material.1) else { continue };
            prim.display_name = (mesh.name != name && !mesh.name.is_empty()).then(|| mesh.name.clone());
            if let Some(path) = material.0 {
                prim.api.push("MaterialBindingAPI");
                prim.add_relationship("material:binding", vec![path]);
            }
            let moves = primitive.topology == Topology::Triangles;
            if self.joints.is_some() && !moves {
                self.common.losses.insert("the motion of lines and points");
            }
            match self.joints.is_some() && moves {
                true => {
                    self.add_skinned_mesh((instance, primitive), prim, &shapes, out);
                }
                false => self.add_static_mesh((instance, number), prim, out),
            }
        }
        shapes
    }

    fn material_of(&self, primitive: &Primitive) -> (Option<String>, bool) {
        let index = primitive.material.map_or(self.asset.materials.len(), |m| m as usize);
        let double_sided = self.asset.materials.get(index).is_some_and(|m| m.double_sided);
        let known = self.materials.get(index).and_then(Option::as_ref);
        (known.map(|known| format!("{}/materials/{}", self.path, known.name)), double_sided)
    }

    fn add_skinned_mesh(
        &mut self,
        (instance, primitive): (&'a MeshInstance, &'a Primitive),
        mut prim: Prim<'a>,
        shapes: &[String],
        out: &mut Vec<Prim<'a>>,
    ) {
        let Some(joints) = &self.joints else { return };
        let skeleton = format!("{}/skeleton", self.path);
        let own = format!("{}/{}", self.path, prim.name);
        let skin =
            instance.skin.filter(|_| primitive.influences > 0).map(|skin| &joints.skins[skin as usize]);
        let at_joint = joints.bind[instance.joint as usize];
        let rigid = |geometry| Binding::Rigid { joint: instance.joint, geometry };
        let copies: Vec<DMat4> = instance.copies.iter().map(|copy| DMat4::from(widen(copy))).collect();
        let binding = match skin {
            Some(skin) => Binding::Skin { joints: &skin.joints, geometry: skin.geometry },
            None => rigid(at_joint * copies.first().copied().unwrap_or(DMat4::IDENTITY)),
        };
        meshes::bind_to_skeleton(&mut prim, primitive, binding, &skeleton);
        if !shapes.is_empty() {
            let mut targets = Vec::new();
            for (index, token) in shapes.iter().enumerate() {
                prim.children.push(meshes::blend_shape(token, primitive, primitive.morphs.get(index)));
                targets.push(format!("{own}/{token}"));
            }
            prim.set_uniform_tokens("skel:blendShapes", shapes.to_vec());
            prim.add_relationship("skel:blendShapeTargets", targets);
        }
        let name = prim.name.clone();
        out.push(prim);
        for copy in copies.iter().skip(1).filter(|_| skin.is_none()) {
            let mut again = Prim::new("Mesh", self.names.add_unique(&name));
            again.reference = Some(own.clone());
            let geometry = meshes::matrix(&(at_joint * *copy));
            again.set(MATRIX4D, "primvars:skel:geomBindTransform", geometry);
            out.push(again);
        }
    }

    /// Adds a mesh that does not move within its model.
    fn add_static_mesh(
        &mut self,
        (instance, number): (&'a MeshInstance, usize),
        mut prim: Prim<'a>,
        out: &mut Vec<Prim<'a>>,
    ) {
        let at = self.at_rest.get(instance.joint as usize).copied().unwrap_or(DMat4::IDENTITY);
        let name = prim.name.clone();
        let key = (instance.mesh, number);
        let path = match self.mesh_paths.get(&key) {
            Some(known) => {
                let kind = prim.kind;
                prim = Prim { reference: Some(known.clone()), ..Prim::new(kind, name.clone()) };
                known.clone()
            }
            None => {
                let inside = if instance.copies.is_empty() { "" } else { "/prototype" };
                let path = format!("{}/{name}{inside}", self.path);
                self.mesh_paths.insert(key, path.clone());
                path
            }
        };
        if instance.copies.is_empty() {
            place(&mut prim, &at);
            out.push(prim);
            return;
        }
        let mut instancer = instancer(&name, &instance.copies, format!("{}/{name}/prototype", self.path));
        prim.name = "prototype".into();
        if prim.reference.is_some() {
            prim.reference = Some(path);
        }
        place(&mut instancer, &at);
        instancer.children.push(prim);
        out.push(instancer);
    }
}

/// Places a prim by a matrix. A prim at the origin gets no transform, unless it refers to another prim, which may have one.
pub(crate) fn place<'a>(prim: &mut Prim<'a>, at: &DMat4) {
    if *at != DMat4::IDENTITY || prim.reference.is_some() {
        prim.set(MATRIX4D, "xformOp:transform", meshes::matrix(at));
        prim.set_uniform_tokens("xformOpOrder", vec!["xformOp:transform".into()]);
    }
}

/// A point instancer with the copies of a prototype, which the caller adds below it.
pub(crate) fn instancer<'a>(name: &str, copies: &[Affine3A], prototype: String) -> Prim<'a> {
    let parts: std::rc::Rc<[Transform]> =
        copies.iter().map(|copy| rig::decompose(&widen(copy), &Transform::IDENTITY)).collect();
    let mut out = Prim::new("PointInstancer", name);
    let count = parts.len();
    let list = |number: fn(&Transform, usize) -> f32, width: usize| {
        let parts = parts.clone();
        Value::array(count, move |i| f64::from(number(&parts[i / width], i % width)))
    };
    out.set(POINT3F, "positions", list(|t, i| t.translation[i], 3));
    // Half-precision quaternions, for programs that do not read `orientationsf`.
    let rotation: fn(&Transform, usize) -> f32 = |t, i| t.rotation.to_array()[i];
    out.set(QUATH, "orientations", list(rotation, 4));
    out.set(QUATF, "orientationsf", list(rotation, 4));
    out.set(FLOAT3, "scales", list(|t, i| t.scale[i], 3));
    out.set(INT, "protoIndices", Value::array(count, |_| 0.0));
    out.add_relationship("prototypes", vec![prototype]);
    out
}

/// The class prim that holds all models. Programs do not draw it by itself.
pub(crate) fn library<'a>(name: &str, models: Vec<Prim<'a>>) -> Prim<'a> {
    Prim { specifier: Specifier::Class, children: models, ..Prim::new("Scope", name) }
}
