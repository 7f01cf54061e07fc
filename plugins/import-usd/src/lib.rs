//! USD into an [`Asset`]. Contents and limits: README.md.

mod archive;
mod binary;
mod clips;
mod compose;
mod layer;
mod materials;
mod meshes;
mod nodes;
mod objects;
mod text;
mod transforms;

use choreo_asset::{Asset, MeshInstance, Origin, Skin};
use choreo_importer_kit::polygon::Triangulator;
use choreo_importer_kit::text::{shown, stem};
use choreo_importer_kit::{Budget, Notes, Result, tangents};
use choreo_plugin::{Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, Source};
use clips::Clips;
use compose::{Composer, Packages};
use glam::{Affine3A, DMat4, DVec3};
use layer::{Layer, Prim};
use materials::{MaterialInfo, Materials};
use meshes::{FaceSubset, MeshContext};
use nodes::{Node, Tree};
use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

/// Limit of all bytes decoded from a file and the files it refers to.
const MAX_DECODED_BYTES: u64 = 2 << 30;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "usd",
        env!("CARGO_PKG_VERSION"),
        "USD, as text, crate file and package: scenes with skeletons",
    )
    .extensions(["usd", "usda", "usdc", "usdz"])
});

#[derive(Clone, Copy, Debug, Default)]
pub struct UsdImporter;

impl Importer for UsdImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn claim(&self, source: &Source) -> Claim {
        let named = MANIFEST.has_extension(&source.extension());
        let bytes = source.bytes.as_slice();
        match () {
            () if binary::is_crate(bytes) || bytes.starts_with(b"#usda") => Claim::Content(100),
            () if named && archive::is_archive(bytes) => Claim::Content(70),
            () if named => Claim::Extension,
            () => Claim::NotMine,
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        _: &ImportOptions,
    ) -> std::result::Result<Asset, ImportError> {
        import(source, files, needs).map_err(|mut p| {
            if p.place.is_empty() {
                p.place = "stage".into();
            }
            p.in_file(&source.name)
        })
    }
}

fn import(source: &Source, files: &dyn Files, needs: ImportScope) -> Result<Asset> {
    let (notes, budget) = (Notes::default(), Budget::new(MAX_DECODED_BYTES));
    let packages = Packages::new(files);
    // File names are relative to the folder of the source.
    let name = source.name.rsplit(['/', '\\']).next().unwrap_or_default();
    let layer = Composer::new(&packages, &budget, &notes).compose_scene(name, source.bytes.clone())?;
    let mut tree = Tree::of(&layer)?;
    let skeleton = tree.skeleton()?;
    let metres = layer.metres_per_unit.unwrap_or(0.01);
    let mut asset =
        Asset { name: source.name.clone(), origin: origin(source, &layer, metres), ..Asset::default() };
    let start_time_code = layer.start_time_code.unwrap_or(0.0);
    let time_codes_per_second =
        layer.time_codes_per_second.filter(|rate| rate.is_finite() && *rate > 0.0).unwrap_or(24.0);
    let (curves, properties) = (Vec::new(), Vec::new());
    let mut clips =
        Clips { budget: &budget, notes: &notes, start_time_code, time_codes_per_second, curves, properties };
    objects::add_cameras_and_lights(&tree, metres, &mut clips, &mut asset)?;
    let materials = Materials::new(&layer.root, (&packages, &budget, &notes), needs.textures);
    let mut scene = MeshReader {
        tree: &tree,
        clips,
        materials,
        triangulator: Triangulator::default(),
        skins: BTreeMap::new(),
        needs,
    };
    for node in tree.nodes.iter().filter(|node| node.prim.kind == "Mesh") {
        scene.add_mesh(node, (node.joint, &[]), &mut asset)?;
    }
    for node in tree.nodes.iter().filter(|node| node.prim.kind == "PointInstancer") {
        scene.add_instancer(node, &mut asset)?;
    }
    let MeshReader { mut clips, materials, .. } = scene;
    if needs.clips {
        clips.add_prim_curves(&tree)?;
        for (path, rig) in &tree.rigs {
            if let Some((animation, at)) = animation_of(&tree, path) {
                clips.add_skeleton_curves(rig, animation, &at)?;
            }
        }
        asset.clips.extend(clips.finish(stem(&source.name), skeleton.len())?.map(Arc::new));
    }
    asset.skeleton = Arc::new(skeleton);
    asset.materials = materials.list;
    (asset.images, ()) = materials.textures.decode_beside(&notes, needs, files, || ())?;
    for mesh in asset.meshes.iter_mut().filter_map(Arc::get_mut) {
        for primitive in &mut mesh.primitives {
            tangents::add_for_normal_map(primitive, &asset.materials, &notes);
        }
    }
    asset.warnings = notes.into_warnings();
    Ok(asset)
}

fn origin(source: &Source, layer: &Layer, metres: f64) -> Origin {
    let format = match () {
        () if archive::is_archive(&source.bytes) => "USD package",
        () if binary::is_crate(&source.bytes) => "USD crate file",
        () => "USD text",
    };
    Origin {
        format: format.into(),
        writer: shown(layer.comment.trim().as_bytes()),
        metres_per_unit: Some(metres),
        up: if layer.up_axis.as_deref() == Some("Z") { "+Z" } else { "+Y" }.into(),
        ..Origin::default()
    }
}

/// The SkelAnimation of the skeleton at a path, and the path of the animation.
fn animation_of<'a>(tree: &'a Tree<'a>, skeleton: &str) -> Option<(&'a Prim, String)> {
    let node = tree.node(skeleton)?;
    let source = tree.inherited(node, |prim| prim.targets("skel:animationSource").first().cloned())?;
    let animation = tree.root.at(&source).filter(|prim| prim.kind == "SkelAnimation")?;
    Some((animation, source))
}

/// State while the meshes of the scene are read.
struct MeshReader<'a, 'b> {
    tree: &'a Tree<'a>,
    clips: Clips<'b>,
    materials: Materials<'b>,
    triangulator: Triangulator,
    /// Skin by skeleton, joints of the mesh and geometry bind transform.
    skins: BTreeMap<(String, Vec<String>, Vec<u64>), u32>,
    needs: ImportScope,
}

impl<'b> MeshReader<'_, 'b> {
    /// Adds the mesh of a prim at a joint.
    fn add_mesh(
        &mut self,
        node: &Node<'_>,
        (joint, copies): (u32, &[Affine3A]),
        asset: &mut Asset,
    ) -> Result<()> {
        let prim = node.prim;
        let parts = self.read_material_subsets(node);
        let material_info = parts.1;
        let tree = self.tree;
        let skeleton = tree
            .inherited(node, |prim| prim.targets("skel:skeleton").first().cloned())
            .filter(|path| tree.rigs.get(path).is_some_and(|rig| !rig.joints.is_empty()));
        let is_skinned = skeleton.is_some() && prim.attributes.contains_key("primvars:skel:jointIndices");
        let shapes: Vec<(String, &Prim)> = prim
            .texts("skel:blendShapes")
            .iter()
            .zip(prim.targets("skel:blendShapeTargets"))
            .filter_map(|(name, path)| Some((name.clone(), tree.root.at(path)?)))
            .collect();
        let names: Vec<String> = shapes.iter().map(|(name, _)| name.clone()).collect();
        let mut weights = vec![0.0; names.len()];
        if let Some((animation, _)) = skeleton.as_ref().and_then(|path| animation_of(tree, path))
            && !names.is_empty()
            && copies.is_empty()
        {
            weights = self.clips.add_weight_curve(joint, &names, animation)?;
        }
        if !self.needs.geometry {
            return Ok(());
        }
        let (notes, budget) = (self.clips.notes, self.clips.budget);
        let uvs = match parts.0.iter().any(|part| part.material.is_some()) {
            true => material_info.uvs,
            false => ["st".into(), String::new()],
        };
        let reads_colors = material_info.reads_vertex_colors || material_info.index.is_none();
        let context = MeshContext { path: &node.path, budget, notes, uvs, reads_colors, shapes, is_skinned };
        let Some(mut mesh) = meshes::read_mesh(prim, &parts.0, &context, &mut self.triangulator)? else {
            return Ok(());
        };
        if !prim.display_name.is_empty() {
            mesh.name.clone_from(&prim.display_name);
        }
        let skin = match (&skeleton, is_skinned) {
            (Some(path), true) => Some(self.add_skin(prim, path, asset)),
            _ => None,
        };
        if skin.is_some() {
            limit_joints(
                &mut mesh,
                skin.and_then(|s| asset.skins.get(s as usize)).map_or(0, |s| s.joints.len()),
            );
        }
        let index = asset.meshes.len() as u32;
        asset.meshes.push(Arc::new(mesh));
        asset.instances.push(MeshInstance { joint, mesh: index, skin, weights, copies: copies.into() });
        Ok(())
    }

    /// The material subsets of a mesh, and what the first material reads from the mesh.
    fn read_material_subsets(&mut self, node: &Node<'_>) -> (Vec<FaceSubset>, MaterialInfo) {
        let bound = |prim: &Prim| prim.targets("material:binding").first().cloned();
        let whole = self.tree.inherited(node, bound);
        let mut first = whole.map(|path| self.materials.at(&path)).unwrap_or_default();
        let mut out = Vec::new();
        for subset in node.prim.children.iter().filter(|child| child.kind == "GeomSubset") {
            let (Some(path), Some(faces)) = (bound(subset), subset.numbers("indices")) else { continue };
            let known = self.materials.at(&path);
            let faces = Some(faces.iter().map(|face| *face as u32).collect());
            out.push(FaceSubset { faces, material: known.index });
            if first.index.is_none() {
                first = known;
            }
        }
        let material = if out.is_empty() { first.index } else { None };
        out.push(FaceSubset { faces: None, material });
        (out, first)
    }

    fn add_skin(&mut self, prim: &Prim, path: &str, asset: &mut Asset) -> u32 {
        let rig = &self.tree.rigs[path];
        let (own, geometry) = (prim.texts("skel:joints"), meshes::geometry_bind_transform(prim));
        let bits = geometry.to_cols_array().map(f64::to_bits).to_vec();
        let key = (path.to_string(), own.to_vec(), bits);
        if let Some(known) = self.skins.get(&key) {
            return *known;
        }
        let all = || (0..rig.joints.len()).collect::<Vec<usize>>();
        let place = |token: &String| rig.index_of_path.get(token.as_str()).copied().unwrap_or(0);
        let used: Vec<usize> = if own.is_empty() { all() } else { own.iter().map(place).collect() };
        let inverse = |joint: &usize| {
            let bound =
                rig.bind_transforms.get(*joint).copied().unwrap_or(DMat4::IDENTITY).inverse() * geometry;
            if bound.as_mat4().is_finite() { bound.as_mat4() } else { glam::Mat4::IDENTITY }
        };
        let skin = Skin {
            joints: used.iter().filter_map(|joint| rig.joints.get(*joint)).copied().collect(),
            inverse_bind: used.iter().map(inverse).collect(),
        };
        asset.skins.push(skin);
        self.skins.insert(key, asset.skins.len() as u32 - 1);
        asset.skins.len() as u32 - 1
    }

    /// Adds the meshes of an instancer's prototypes, each once with its copies.
    fn add_instancer(&mut self, node: &Node<'_>, asset: &mut Asset) -> Result<()> {
        let prim = node.prim;
        let list = |name: &str| prim.numbers(name).unwrap_or_default();
        let (places, indices, scales) = (list("positions"), list("protoIndices"), list("scales"));
        let precise = list("orientationsf");
        let rotations = if precise.is_empty() { list("orientations") } else { precise };
        self.clips.budget.charge(indices.len() as u64, 64)?;
        for (number, path) in prim.targets("prototypes").iter().enumerate() {
            let Some(prototype) = self.tree.root.at(path) else { continue };
            let mut copies: Vec<DMat4> = Vec::new();
            for index in (0..indices.len()).filter(|index| indices[*index] == number as f64) {
                let three = |list: &[f64], default: DVec3| {
                    list.get(3 * index..3 * index + 3).map_or(default, DVec3::from_slice)
                };
                let rotation = rotations.get(4 * index..4 * index + 4).map(transforms::quaternion);
                copies.push(DMat4::from_scale_rotation_translation(
                    three(scales, DVec3::ONE),
                    rotation.unwrap_or_default(),
                    three(places, DVec3::ZERO),
                ));
            }
            self.add_prototype((node, prototype, path), &copies, DMat4::IDENTITY, asset)?;
        }
        Ok(())
    }

    fn add_prototype(
        &mut self,
        (node, prim, path): (&Node<'_>, &Prim, &str),
        copies: &[DMat4],
        parent_transform: DMat4,
        asset: &mut Asset,
    ) -> Result<()> {
        let own = parent_transform * transforms::local_matrix(prim, self.clips.start_time_code);
        if prim.kind == "Mesh" {
            let placed: Vec<Affine3A> =
                copies.iter().map(|copy| Affine3A::from_mat4((*copy * own).as_mat4())).collect();
            if placed.iter().all(|copy| copy.is_finite()) && !placed.is_empty() {
                let joint = node.joint;
                let of = Node { prim, path: path.to_string(), joint, ancestors: Vec::new() };
                self.add_mesh(&of, (joint, &placed), asset)?;
            }
        }
        for child in &prim.children {
            let path = format!("{path}/{}", child.name);
            self.add_prototype((node, child, &path), copies, own, asset)?;
        }
        Ok(())
    }
}

/// Redirects influences beyond a skin's last joint to its first joint.
fn limit_joints(mesh: &mut choreo_asset::Mesh, joint_count: usize) {
    let all = mesh.primitives.iter_mut().flat_map(|p| &mut p.joint_indices);
    all.filter(|joint| usize::from(**joint) >= joint_count).for_each(|joint| *joint = 0);
}
