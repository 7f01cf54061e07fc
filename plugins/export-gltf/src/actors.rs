//! Actors as nodes: the actor, its joints below it, and its meshes.

use crate::buffer::{Buffer, F32};
use crate::document::{Accessor, Document, Index, Node, Skin};
use crate::lights::Lights;
use crate::materials::Materials;
use crate::meshes;
use crate::textures::Textures;
use choreo_exporter_kit::bake::signals::{MaterialPart, Quantity, material_now};
use choreo_exporter_kit::bake::{Baked, rig};
use choreo_exporter_kit::losses::Losses;
use choreo_plugin::asset::widen;
use choreo_plugin::asset::{Asset, MeshInstance};
use choreo_plugin::glam::{Affine3A, Quat, Vec3};
use choreo_plugin::motion::{Path, Transform};
use choreo_plugin::stage::{Actor, Property, Stage};
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The document and its parts, while they are made.
#[derive(Default)]
pub(crate) struct Parts<'a> {
    pub document: Document,
    pub buffer: Buffer<'a>,
    pub textures: Textures,
    pub materials: Materials,
    pub lights: Lights,
    /// Written meshes; `None` where a mesh has nothing to draw.
    pub meshes: BTreeMap<MeshKey, Option<Index>>,
    /// Extensions in use, besides those of materials.
    pub extensions: BTreeSet<&'static str>,
    pub losses: Losses,
    /// Animated materials, which are not shared: (actor, material of the asset), and index in the document.
    pub animated: Vec<((usize, u32), Index)>,
}

/// Key of a written mesh: asset, mesh, skin, whether it is the skinned part, and the document's materials.
pub(crate) type MeshKey = (usize, u32, Option<u32>, bool, Vec<Option<Index>>);

/// The nodes of an actor.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActorNodes {
    pub root: Index,
    /// Nodes of the first joint of each character drawn; an asset with placements has one for each placement.
    pub characters: Vec<Index>,
    /// Nodes with the mesh of each mesh instance, over all characters.
    pub meshes: Vec<Vec<Index>>,
}

impl<'a> Parts<'a> {
    pub(crate) fn push(&mut self, node: Node) -> Index {
        self.document.nodes.push(node);
        self.document.nodes.len() as Index - 1
    }

    pub(crate) fn at_root(&mut self, node: Index) {
        self.document.scenes[0].nodes.push(node);
    }

    /// Adds an actor that is visible at some time.
    pub(crate) fn actor(&mut self, stage: &'a Stage, baked: &Baked<'_>, index: usize) -> ActorNodes {
        let actor = &stage.actors[index];
        let materials = self.actor_materials(actor, baked, index);
        let still = baked.still_rig(actor, index);
        let root = self.push(Node { name: actor.name.clone(), ..node_with_transform(&still[0]) });
        self.at_root(root);
        let mut out = ActorNodes {
            root,
            characters: Vec::new(),
            meshes: vec![Vec::new(); actor.asset.instances.len()],
        };
        // glTF cannot animate the number of copies, so where it changes all copies are written.
        let varies = actor.channels.iter().any(|c| c.property == Property::Copies)
            || !stage.frame_callbacks.is_empty();
        let copies = baked.first.actors[index].copies.filter(|_| !varies);
        let moves = baked.motions[index].sets.iter().flat_map(|set| &baked.sets[*set].tracks);
        let mut moves = moves.filter(|track| track.joint > 0 || matches!(track.path, Path::Weights(_)));
        let rigid = actor.asset.instances.iter().all(|i| i.skin.is_none());
        if !actor.asset.placements.is_empty() && rigid && moves.next().is_none() {
            self.placed_meshes(actor, &still, copies, &materials, &mut out);
            return out;
        }
        let places: Vec<Affine3A> = actor.asset.first_placements(copies).collect();
        let copies = copies.filter(|_| actor.asset.placements.is_empty());
        for place in &places {
            let above = match actor.asset.placements.is_empty() {
                true => root,
                false => {
                    let at = rig::decompose(&widen(place), &Transform::IDENTITY);
                    let body =
                        self.push(Node { name: format!("{} body", actor.name), ..node_with_transform(&at) });
                    self.document.nodes[root as usize].children.push(body);
                    body
                }
            };
            let base = self.joints(&actor.asset, &still, above);
            out.characters.push(base);
            self.instances(actor, base, copies, &materials, &mut out);
        }
        if actor.file_lights && actor.asset.placements.is_empty() {
            self.file_lights(&actor.asset, out.characters[0]);
        }
        out
    }

    /// The document's materials of an actor's asset, then the one of primitives without a material.
    fn actor_materials(&mut self, actor: &'a Actor, baked: &Baked<'_>, index: usize) -> Vec<Option<Index>> {
        let asset = &*actor.asset;
        let state = &baked.first.actors[index];
        let mut out = Vec::with_capacity(asset.materials.len() + 1);
        for material in 0..asset.materials.len() as u32 {
            let mut now = material_now(asset, state, material);
            let is_of = |q: &Quantity| matches!(q, Quantity::Material { actor, material: m, .. } if (*actor, *m) == (index, material));
            let moving = baked.series.iter().filter(|(s, series)| is_of(&s.quantity) && !series.is_still());
            let mut own = false;
            for (signal, series) in moving {
                own = true;
                if let Quantity::Material { part: MaterialPart::Emissive, .. } = signal.quantity {
                    // The material has the strength of the brightest moment, and keys are fractions of it, because glTF's factor
                    // is at most 1.
                    let brightest = series.values.iter().copied().fold(1.0, f32::max);
                    now.emissive = Vec3::splat(brightest);
                }
            }
            let Parts { materials, textures, .. } = self;
            let added = materials.add(textures, asset, &now, (own, uvs_of(asset, material)));
            if own {
                self.animated.push(((index, material), added));
            }
            out.push(Some(added));
        }
        let tint = state.tint;
        let none = match tint == choreo_plugin::glam::Vec4::ONE {
            true => None,
            false => {
                let plain = choreo_plugin::asset::Material { base_color: tint, ..Default::default() };
                let Parts { materials, textures, .. } = self;
                Some(materials.add(textures, asset, &plain, (false, [false; 2])))
            }
        };
        out.push(none);
        out
    }

    /// Adds the joints of one character below a node. Returns the index of the first.
    fn joints(&mut self, asset: &Asset, still: &[Transform], above: Index) -> Index {
        let skeleton = &asset.skeleton;
        let base = self.document.nodes.len() as Index;
        for (name, local) in skeleton.names().iter().zip(&still[1..]) {
            self.push(Node { name: name.clone(), ..node_with_transform(local) });
        }
        for (joint, parent) in (base..).zip(skeleton.parents()) {
            let parent = parent.map_or(above, |parent| base + parent);
            self.document.nodes[parent as usize].children.push(joint);
        }
        base
    }

    /// Adds the meshes of one character.
    fn instances(
        &mut self,
        actor: &'a Actor,
        base: Index,
        copies: Option<u32>,
        materials: &[Option<Index>],
        out: &mut ActorNodes,
    ) {
        let asset = &actor.asset;
        let mut skins: BTreeMap<u32, Index> = BTreeMap::new();
        for (number, instance) in asset.instances.iter().enumerate() {
            if let (Some(skin), Some(mesh)) = (instance.skin, self.mesh(asset, instance, true, materials)) {
                let skin = match skins.get(&skin) {
                    Some(known) => *known,
                    None => {
                        let added = self.skin(asset, skin, base);
                        skins.insert(skin, added);
                        added
                    }
                };
                let name = format!("{} {}", actor.name, asset.meshes[instance.mesh as usize].name);
                // Viewers ignore the transform of a skinned mesh's node; its joints place it (§3.7.3.3).
                let node = Node { name, mesh: Some(mesh), skin: Some(skin), ..Node::default() };
                let node = self.push(with_morph_weights(node, instance));
                self.at_root(node);
                out.meshes[number].push(node);
            }
            let Some(mesh) = self.mesh(asset, instance, false, materials) else { continue };
            let joint = base + instance.joint;
            let most = copies.map_or(usize::MAX, |copies| copies as usize);
            let copied: Vec<Affine3A> = instance.copies.iter().copied().take(most).collect();
            if !instance.copies.is_empty() {
                let name = asset.meshes[instance.mesh as usize].name.clone();
                out.meshes[number].extend(self.copies(name, joint, mesh, &copied));
                continue;
            }
            let has_mesh = self.document.nodes[joint as usize].mesh.is_some();
            let node = match has_mesh {
                false => joint,
                true => {
                    let name = asset.meshes[instance.mesh as usize].name.clone();
                    let node = self.push(Node { name, ..Node::default() });
                    self.document.nodes[joint as usize].children.push(node);
                    node
                }
            };
            let of = std::mem::take(&mut self.document.nodes[node as usize]);
            self.document.nodes[node as usize] =
                with_morph_weights(Node { mesh: Some(mesh), ..of }, instance);
            out.meshes[number].push(node);
        }
    }

    /// The document's mesh of an instance, with either the skinned or the unskinned primitives.
    fn mesh(
        &mut self,
        asset: &'a Arc<Asset>,
        instance: &MeshInstance,
        skinned: bool,
        materials: &[Option<Index>],
    ) -> Option<Index> {
        let mesh = asset.meshes.get(instance.mesh as usize)?;
        let used = mesh.primitives.iter().map(|p| primitive_material(materials, p.material)).collect();
        let key = (Arc::as_ptr(asset) as usize, instance.mesh, instance.skin, skinned, used);
        if let Some(known) = self.meshes.get(&key) {
            return *known;
        }
        let skin = instance.skin.and_then(|skin| asset.skins.get(skin as usize));
        let made = meshes::mesh(&mut self.buffer, mesh, skin, skinned, |m| primitive_material(materials, m));
        let index = made.map(|mesh| {
            self.document.meshes.push(mesh);
            self.document.meshes.len() as Index - 1
        });
        self.meshes.insert(key, index);
        index
    }

    fn skin(&mut self, asset: &'a Asset, skin: u32, base: Index) -> Index {
        let of = &asset.skins[skin as usize];
        let joints = of.joints.iter().map(|joint| base + joint).collect();
        let inverse_bind_matrices = meshes::inverse_bind(&mut self.buffer, of);
        self.document.skins.push(Skin { joints, inverse_bind_matrices });
        self.document.skins.len() as Index - 1
    }

    /// Adds copies of a mesh below a node, by EXT_mesh_gpu_instancing.
    fn copies(&mut self, name: String, above: Index, mesh: Index, copies: &[Affine3A]) -> Option<Index> {
        if copies.is_empty() {
            return None;
        }
        let parts: Vec<Transform> =
            copies.iter().map(|c| rig::decompose(&widen(c), &Transform::IDENTITY)).collect();
        let accessor = |shape| Accessor::of(F32, shape, parts.len());
        let (places, turns, sizes) = (parts.clone(), parts.clone(), parts.clone());
        let buffer = &mut self.buffer;
        let translations = buffer.array(move |i| places[i].translation.to_array(), None, accessor("VEC3"));
        let rotations = buffer.array(move |i| turns[i].rotation.to_array(), None, accessor("VEC4"));
        let scales = buffer.array(move |i| sizes[i].scale.to_array(), None, accessor("VEC3"));
        let attributes = json!({ "TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales });
        self.extensions.insert("EXT_mesh_gpu_instancing");
        let extensions = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
        let node = Node { name, mesh: Some(mesh), extensions: Some(Box::new(extensions)), ..Node::default() };
        let node = self.push(node);
        self.document.nodes[above as usize].children.push(node);
        Some(node)
    }

    /// Adds the meshes of a character that does not move, at each of its placements.
    fn placed_meshes(
        &mut self,
        actor: &'a Actor,
        still: &[Transform],
        count: Option<u32>,
        materials: &[Option<Index>],
        out: &mut ActorNodes,
    ) {
        let asset = &actor.asset;
        let mut model: Vec<Affine3A> = Vec::with_capacity(asset.skeleton.len());
        for (local, parent) in still[1..].iter().zip(asset.skeleton.parents()) {
            let own = local.to_affine();
            model.push(parent.map_or(own, |parent| model[parent as usize] * own));
        }
        for (number, instance) in asset.instances.iter().enumerate() {
            let Some(mesh) = self.mesh(asset, instance, false, materials) else { continue };
            let joint = model.get(instance.joint as usize).copied().unwrap_or(Affine3A::IDENTITY);
            let all: Vec<Affine3A> =
                asset.drawn_copies(instance, count).map(|(place, copy)| place * joint * copy).collect();
            let name = asset.meshes[instance.mesh as usize].name.clone();
            out.meshes[number].extend(self.copies(name, out.root, mesh, &all));
        }
    }

    fn file_lights(&mut self, asset: &Asset, base: Index) {
        for light in &asset.lights {
            let index = self.lights.add(&light.name, &light.light);
            let extension = json!({ "KHR_lights_punctual": { "light": index } });
            let joint = &mut self.document.nodes[(base + light.joint) as usize];
            if joint.extensions.is_none() {
                joint.extensions = Some(Box::new(extension));
            } else {
                let node = Node {
                    name: light.name.clone(),
                    extensions: Some(Box::new(extension)),
                    ..Node::default()
                };
                let node = self.push(node);
                self.document.nodes[(base + light.joint) as usize].children.push(node);
            }
        }
    }
}

/// Whether all primitives with a material have the first and the second set of texture coordinates.
fn uvs_of(asset: &Asset, material: u32) -> [bool; 2] {
    let with_it = || asset.meshes.iter().flat_map(|m| &m.primitives).filter(|p| p.material == Some(material));
    [0, 1].map(|set| with_it().all(|p| p.uvs[set].len() == p.positions.len()))
}

fn primitive_material(materials: &[Option<Index>], material: Option<u32>) -> Option<Index> {
    let none = materials.len() - 1;
    materials.get(material.map_or(none, |m| m as usize)).copied().flatten()
}

fn with_morph_weights(node: Node, instance: &MeshInstance) -> Node {
    Node { weights: instance.weights.clone(), ..node }
}

/// A node with a transform; parts at their defaults are left out.
pub(crate) fn node_with_transform(t: &Transform) -> Node {
    Node {
        translation: (t.translation != Vec3::ZERO).then(|| t.translation.to_array()),
        // Rounding can exceed 1, which the schema forbids.
        rotation: (t.rotation != Quat::IDENTITY).then(|| t.rotation.to_array().map(|v| v.clamp(-1.0, 1.0))),
        scale: (t.scale != Vec3::ONE).then(|| t.scale.to_array()),
        ..Node::default()
    }
}
