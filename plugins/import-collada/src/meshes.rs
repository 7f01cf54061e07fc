//! Instanced geometries and controllers become meshes, skins and mesh instances.

use crate::controller::{self, Morph, MorphTargets, SkinData};
use crate::geometry::{self, Geometry};
use crate::materials::Materials;
use crate::nodes::Tree;
use crate::xml::{LEFT_OUT, Xml, children, name_of, text_of};
use crate::xml::{Node, NodeId};
use choreo_asset::{Asset, Mesh, MeshInstance, Topology};
use choreo_importer_kit::text::count;
use choreo_importer_kit::{Result, smooth};
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;
use std::sync::Arc;

/// The geometry and controllers of an instance.
#[derive(Clone, Copy)]
struct InstancedShape<'a> {
    geometry: Node<'a>,
    skin: Option<Node<'a>>,
    /// The morph controller, with its id.
    morph: Option<(Node<'a>, NodeId)>,
}

impl<'a> InstancedShape<'a> {
    fn plain(geometry: Node<'a>) -> Self {
        InstancedShape { geometry, skin: None, morph: None }
    }
}

pub(crate) struct Builder<'x, 'a, 'f> {
    pub xml: &'x Xml<'a>,
    pub tree: &'x Tree<'a>,
    pub materials: Materials<'f>,
    pub smooth_rad: f64,
    pub morphs: Vec<MorphTargets>,
    geometries: HashMap<NodeId, Rc<Geometry>>,
    /// Remaining instances of each geometry: the last one takes its lists instead of copying them.
    uses: HashMap<NodeId, usize>,
    /// Mesh and skin by a key of what they are made from.
    mesh_of_key: BTreeMap<String, (u32, Option<u32>)>,
    without_normals: usize,
}

impl<'x, 'a, 'f> Builder<'x, 'a, 'f> {
    pub(crate) fn new(
        xml: &'x Xml<'a>,
        tree: &'x Tree<'a>,
        materials: Materials<'f>,
        smooth_rad: f64,
    ) -> Self {
        Builder {
            xml,
            tree,
            materials,
            smooth_rad,
            morphs: Vec::new(),
            geometries: HashMap::new(),
            uses: HashMap::new(),
            mesh_of_key: BTreeMap::new(),
            without_normals: 0,
        }
    }

    pub(crate) fn build(&mut self, asset: &mut Asset) -> Result<()> {
        let mut placed = Vec::new();
        for (joint, node) in (0u32..).zip(self.tree.joints.iter().map(|j| j.node)) {
            for element in node.children() {
                // A missing target is only a warning, because skeletons are often kept without their mesh.
                let target = |kind| self.xml.resolve_instance(element, "url", kind, LEFT_OUT);
                let shape = match name_of(element) {
                    "instance_geometry" => target("geometry").map(InstancedShape::plain),
                    "instance_controller" => match target("controller") {
                        Some(controller) => self.shape_of(controller)?,
                        None => None,
                    },
                    _ => None,
                };
                if let Some(shape) = shape {
                    *self.uses.entry(shape.geometry.id()).or_default() += 1;
                    placed.push((joint, element, shape));
                }
            }
        }
        for (joint, element, shape) in placed {
            self.place(asset, joint, element, shape)?;
        }
        if self.without_normals > 0 {
            let what = format!(
                "{} without normals; edges of up to {:.0}° are smooth (option smooth)",
                count(self.without_normals, "part"),
                self.smooth_rad.to_degrees()
            );
            self.xml.notes.warn("library_geometries", what);
        }
        Ok(())
    }

    /// Resolves a controller chain: at most a skin over a morph over a geometry.
    fn shape_of(&self, controller: Node<'a>) -> Result<Option<InstancedShape<'a>>> {
        let (mut skin, mut morph) = (None, None);
        let mut at = controller;
        for _ in 0..3 {
            let inner = at.children().find(|n| matches!(name_of(*n), "skin" | "morph"));
            let Some(inner) = inner else {
                self.xml.warn(at, "is neither skin nor morph; it is left out");
                return Ok(None);
            };
            match name_of(inner) {
                "skin" => skin = Some(inner),
                _ => morph = Some((inner, at.id())),
            }
            let source = match self.xml.resolve_reference(inner, "source") {
                Ok(source) => source,
                Err(problem) => {
                    self.xml.notes.warn(problem.place, format!("{}; the mesh is left out", problem.what));
                    return Ok(None);
                }
            };
            if name_of(source) == "geometry" {
                return Ok(Some(InstancedShape { geometry: source, skin, morph }));
            }
            at = source;
        }
        Err(self.xml.problem(controller, "refers to controllers more than three deep, or to itself"))
    }

    fn geometry(&mut self, node: Node<'a>) -> Result<Rc<Geometry>> {
        if let Some(known) = self.geometries.get(&node.id()) {
            return Ok(known.clone());
        }
        let read = Rc::new(geometry::read(self.xml, node, self.tree.convention.metres, self.materials.srgb)?);
        self.geometries.insert(node.id(), read.clone());
        Ok(read)
    }

    fn place(
        &mut self,
        asset: &mut Asset,
        joint: u32,
        instance: Node<'a>,
        InstancedShape { geometry, skin, morph }: InstancedShape<'a>,
    ) -> Result<()> {
        let source = self.geometry(geometry)?;
        let last = self.uses.get_mut(&geometry.id()).is_some_and(|uses| {
            *uses -= 1;
            *uses == 0
        });
        if source.parts.is_empty() {
            return Ok(());
        }
        let mut materials = Vec::with_capacity(source.parts.len());
        for part in &source.parts {
            materials.push(self.materials.bind(self.xml, instance, &part.symbol, &part.uv_sets)?);
        }
        let skeletons: Vec<&str> = children(instance, "skeleton").map(text_of).collect();
        let morphed = morph.map(|(node, _)| self.morph(node, &source)).transpose()?;
        let key = format!(
            "{:?} {:?} {:?} {materials:?} {skeletons:?}",
            geometry.id(),
            skin.map(|s| s.id()),
            morph.map(|m| m.1)
        );
        let (mesh, skin) = match self.mesh_of_key.get(&key) {
            Some(known) => *known,
            None => {
                let skinned = skin.map(|s| {
                    let roots =
                        skeletons.iter().filter_map(|s| self.xml.node_by_id(s.trim_start_matches('#')));
                    let roots =
                        roots.flat_map(|n| self.tree.of_element.get(&n.id()).cloned().unwrap_or_default());
                    let roots: Vec<u32> = roots.collect();
                    controller::skin(self.xml, self.tree, s, &roots, joint)
                });
                let skinned = skinned.transpose()?;
                if let (Some(data), Some(node)) = (&skinned, skin)
                    && data.weights.len() != source.positions.len()
                {
                    let what = format!(
                        "has weights for {} positions, the geometry has {}; the first joint moves the rest",
                        data.weights.len(),
                        source.positions.len()
                    );
                    self.xml.warn(node, what);
                }
                if last {
                    self.geometries.remove(&geometry.id());
                }
                let mesh = self.mesh(source, geometry, &materials, skinned.as_ref(), morphed.as_ref())?;
                let skin = skinned.map(|data| {
                    asset.skins.push(data.skin);
                    asset.skins.len() as u32 - 1
                });
                asset.meshes.push(Arc::new(mesh));
                let made = (asset.meshes.len() as u32 - 1, skin);
                self.mesh_of_key.insert(key, made);
                made
            }
        };
        let weights = morphed.map_or(Vec::new(), |m| m.weights);
        if let Some((_, controller)) = morph {
            self.morphs.push(MorphTargets { controller, joint, weights: weights.clone() });
        }
        asset.instances.push(MeshInstance { joint, mesh, skin, weights, ..Default::default() });
        Ok(())
    }

    fn morph(&mut self, node: Node<'a>, base: &Geometry) -> Result<Morph> {
        let xml = self.xml;
        controller::morph(xml, node, base, |target| {
            let read = self.geometry(target)?;
            Ok(read.positions.clone())
        })
    }

    fn mesh(
        &mut self,
        source: Rc<Geometry>,
        geometry: Node<'a>,
        materials: &[u32],
        skin: Option<&SkinData>,
        morph: Option<&Morph>,
    ) -> Result<Mesh> {
        let mut out = Mesh {
            name: source.name.clone(),
            morph_targets: morph.map_or(0, |m| m.offsets.len()),
            morph_names: morph.map_or(Vec::new(), |m| m.names.clone()),
            ..Mesh::default()
        };
        let parts = match Rc::try_unwrap(source) {
            Ok(source) => source.parts,
            Err(shared) => shared.parts.clone(),
        };
        for (part, material) in parts.into_iter().zip(materials) {
            self.xml.charge(geometry, part.primitive.indices.len(), 96 + out.morph_targets * 12)?;
            let mut primitive = part.primitive;
            primitive.material = Some(*material);
            if let Some(skin) = skin {
                let influences = skin.weights.influences;
                primitive.influences = influences;
                primitive.joint_indices.reserve_exact(part.origin.len() * influences);
                primitive.joint_weights.reserve_exact(part.origin.len() * influences);
                for origin in &part.origin {
                    skin.weights.of(*origin, &mut primitive.joint_indices, &mut primitive.joint_weights);
                }
            }
            if let Some(morph) = morph {
                primitive.morphs = morph.targets(&part.origin);
            }
            if primitive.normals.is_empty() && primitive.topology == Topology::Triangles {
                self.without_normals += 1;
                smooth::normals(&mut primitive, self.smooth_rad, None);
            }
            out.primitives.push(primitive);
        }
        Ok(out)
    }
}
