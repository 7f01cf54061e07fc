//! Simplifies a whole model, every primitive up to the same error.
//!
//! Edge collapse by quadric error (M. Garland, P. Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997;
//! by meshoptimizer) keeps a subset of the vertices. Colors, texture coordinates and normals count beside positions. A target
//! number of triangles per primitive would not do: of a head and the helmet around it, the one with more triangles would get the
//! smaller error.

use crate::scene_resources::appearance::{Appearance, Shape};
use crate::scene_resources::hausdorff::{Surface, hausdorff_distance};
use choreo_asset::{
    Aabb, AlphaMode, Asset, Image, Material, Mesh, MorphTarget, PlacementSelection, Primitive, TextureRef,
    Topology, posed_meshes_by,
};
use choreo_motion::Skinning;
use glam::{DAffine3, Vec2, Vec3, Vec4};
use meshopt::{SimplifyOptions, SimplifyVertex, VertexDataAdapter};
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};
use std::sync::Arc;

/// Errors of the levels as shares of the model's size.
const LEVEL_ERRORS: [f32; 7] =
    [1.0 / 512.0, 1.0 / 360.0, 1.0 / 256.0, 1.0 / 180.0, 1.0 / 128.0, 1.0 / 90.0, 1.0 / 64.0];
/// Displacement of a vertex, as a share of the model's size, that counts as much as a completely different color or normal.
const COLOR_WEIGHT: f32 = 0.05;
const NORMAL_WEIGHT: f32 = 0.01;
/// Factor on the Hausdorff distance for the error between its sampled points.
const ERROR_MARGIN: f32 = 1.1;

/// A model at rest.
pub(super) struct Model {
    pub parts: Vec<ModelPrimitive>,
    /// Diagonal of the model's bounds in metres.
    pub size: f32,
}

/// A simplified version of a model.
pub(super) struct Level {
    /// Pixel size from which the level shows no visible difference, in metres of the model.
    pub error: f32,
    /// Place of each part, and its simplified primitive; `None` where no triangle is left.
    pub primitives: Vec<((usize, usize), Option<Primitive>)>,
}

/// One primitive of a model. A mesh used by several nodes gives a part for each.
pub(super) struct ModelPrimitive {
    /// Index of the mesh instance in the asset, and of the primitive in its mesh.
    pub place: (usize, usize),
    mesh: Arc<Mesh>,
    /// Positions at rest in model space.
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub surface_color: SurfaceColor,
    /// Metres of the model per metre of the mesh.
    stretch: f32,
}

/// The material inputs that give a surface its color.
pub(super) struct SurfaceColor {
    /// Square roots of linear RGB, roughly perceptual; alpha.
    factor: Vec4,
    texture: Option<(Arc<Image>, TextureRef)>,
    /// Fragments with a smaller alpha are not drawn.
    pub cutoff: f32,
}

impl SurfaceColor {
    fn new(asset: &Asset, material: &Material) -> SurfaceColor {
        let texture = material.base_color_texture.as_ref().and_then(|texture| {
            let image = asset.images.get(texture.image as usize)?;
            let whole = image.rgba.len() == 4 * image.width as usize * image.height as usize;
            (whole && !image.rgba.is_empty()).then(|| (image.clone(), texture.clone()))
        });
        let color = (material.base_color.truncate() + material.emissive).max(Vec3::ZERO).min(Vec3::ONE);
        let factor = Vec3::new(color.x.sqrt(), color.y.sqrt(), color.z.sqrt());
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque => 0.0,
            AlphaMode::Mask(cutoff) => cutoff,
            AlphaMode::Blend => 0.25,
        };
        SurfaceColor { factor: factor.extend(material.base_color.w), texture, cutoff }
    }

    /// The color at texture coordinates, by the nearest texel.
    pub(super) fn at(&self, uv: Vec2) -> Vec4 {
        let Some((image, texture)) = &self.texture else { return self.factor };
        let uv = texture.uv_transform.transform_point2(uv);
        let texel = |u: f32, n: u32| {
            let along = ((u - u.floor()) * n as f32) as u32;
            along.min(n - 1) as usize
        };
        let at = 4 * (texel(uv.y, image.height) * image.width as usize + texel(uv.x, image.width));
        let byte = |i: usize| f32::from(image.rgba[at + i]) / 255.0;
        self.factor * Vec4::new(byte(0), byte(1), byte(2), byte(3))
    }

    pub(super) fn uv_set(&self) -> usize {
        self.texture.as_ref().map_or(0, |(_, texture)| usize::from(texture.uv_set.min(1)))
    }
}

impl ModelPrimitive {
    pub(super) fn primitive(&self) -> &Primitive {
        &self.mesh.primitives[self.place.1]
    }

    /// Texture coordinates of the color texture; empty without one.
    pub(super) fn uvs(&self) -> &[Vec2] {
        &self.primitive().uvs[self.surface_color.uv_set()]
    }

    /// The triangles simplified up to an error of `error` metres of the model.
    fn simplified(&self, error: f32, size: f32) -> Vec<u32> {
        let p = self.primitive();
        let bytes: &[u8] = bytemuck::cast_slice(&self.positions);
        let Ok(vertices) = VertexDataAdapter::new(bytes, size_of::<Vec3>(), 0) else {
            return p.indices.clone();
        };
        // meshoptimizer weighs attributes against positions relative to the part's own extent.
        let bounds = Aabb::of(self.positions.iter().copied());
        let share = size / (bounds.max - bounds.min).max_element().max(1e-9);
        let [color, normal] = [COLOR_WEIGHT * share, NORMAL_WEIGHT * share];
        let weights = [color, color, color, color, color, normal, normal, normal];
        let attributes: Vec<f32> = (0..self.positions.len()).flat_map(|v| self.attributes(v)).collect();
        let locks = vec![SimplifyVertex::None; self.positions.len()];
        let options = SimplifyOptions::ErrorAbsolute | SimplifyOptions::Permissive;
        meshopt::simplify_with_attributes_and_locks(
            &p.indices,
            &vertices,
            &attributes,
            &weights,
            size_of::<[f32; 8]>(),
            &locks,
            0,
            error,
            options,
            None,
        )
    }

    /// Color, texture coordinates and normal of a vertex as simplification compares them.
    fn attributes(&self, v: usize) -> [f32; 8] {
        let uv = self.uvs().get(v).copied().unwrap_or_default();
        let vertex_color = self.primitive().colors.get(v).map_or(Vec4::ONE, |c| *c);
        let color = self.surface_color.at(uv) * vertex_color;
        let normal = self.normals.get(v).copied().unwrap_or_default();
        let uv = if self.surface_color.texture.is_some() { uv } else { Vec2::ZERO };
        [color.x, color.y, color.z, uv.x, uv.y, normal.x, normal.y, normal.z]
    }
}

impl Model {
    /// The model at rest; `None` if no part of it can be simplified.
    pub(super) fn new(asset: &Asset, valid: impl Fn(usize, usize) -> bool) -> Option<Model> {
        let weights: Vec<Vec<f32>> = asset.instances.iter().map(|i| i.weights.clone()).collect();
        let posed = posed_meshes_by(
            (Skinning::Linear, PlacementSelection::Once),
            asset,
            asset.rest_model_from_joint(),
            &weights,
            DAffine3::IDENTITY,
        );
        let (mut parts, mut before) = (Vec::new(), None);
        for instance in posed {
            // Only the first of several copies is kept.
            if before.replace(instance.instance) == Some(instance.instance) {
                continue;
            }
            let mesh = &asset.meshes[asset.instances[instance.instance].mesh as usize];
            for (index, posed) in instance.primitives.into_iter().enumerate() {
                let primitive = &mesh.primitives[index];
                let triangles = primitive.topology == Topology::Triangles && !primitive.indices.is_empty();
                if !triangles || !valid(instance.instance, index) {
                    continue;
                }
                let default = Material::default();
                let material = primitive.material.and_then(|m| asset.materials.get(m as usize));
                let positions: Vec<Vec3> = posed.positions.iter().map(|p| p.as_vec3()).collect();
                parts.push(ModelPrimitive {
                    place: (instance.instance, index),
                    mesh: mesh.clone(),
                    stretch: size_ratio(&primitive.positions, &positions),
                    positions,
                    normals: posed.normals.iter().map(|n| n.as_vec3()).collect(),
                    surface_color: SurfaceColor::new(asset, material.unwrap_or(&default)),
                });
            }
        }
        let finite = |part: &ModelPrimitive| part.positions.iter().all(|p| p.is_finite());
        let all = Aabb::of(parts.iter().flat_map(|part| part.positions.iter().copied()));
        let size = (all.max - all.min).length();
        (!parts.is_empty() && parts.iter().all(finite) && size > 0.0).then_some(Model { parts, size })
    }

    /// Levels of detail, the finest first.
    pub(super) fn levels(&self) -> Vec<Level> {
        let appearance = Appearance::new(self);
        let hidden = appearance.hidden();
        let mut before: usize = self.parts.iter().map(|part| part.primitive().indices.len()).sum();
        let mut levels: Vec<Level> = Vec::new();
        for share in LEVEL_ERRORS {
            let simplified = |part: &ModelPrimitive| part.simplified(share * self.size, self.size);
            let indices: Vec<Vec<u32>> = self.parts.par_iter().map(simplified).collect();
            let left: usize = indices.iter().map(Vec::len).sum();
            if left == 0 || 4 * left > 3 * before {
                continue;
            }
            let distance = ERROR_MARGIN * self.hausdorff_distance_to(&indices);
            // Twice the distance: the outer surface may have moved inwards by it, and the inner one outwards.
            let inwards = 2.0 * distance;
            let shapes = self.shapes(indices, &hidden, inwards);
            let Some(pixel) = appearance.smallest_pixel(self, &shapes) else { continue };
            let error = pixel.max(distance);
            // A finer level with no smaller error than a coarser one is not worth its memory.
            levels.retain(|finer| finer.error < error);
            before = left;
            levels.push(Level { error, primitives: self.primitives(shapes, &hidden, inwards) });
        }
        levels
    }

    /// Hausdorff distance between the model and its simplified parts.
    fn hausdorff_distance_to(&self, shapes: &[Vec<u32>]) -> f32 {
        let mut positions: Vec<Vec3> = Vec::new();
        let (mut fine, mut coarse) = (Vec::new(), Vec::new());
        for (part, shape) in self.parts.iter().zip(shapes) {
            let first = positions.len() as u32;
            fine.extend(part.primitive().indices.iter().map(|i| first + i));
            coarse.extend(shape.iter().map(|i| first + i));
            positions.extend(&part.positions);
        }
        let surface = |indices| Surface { positions: &positions, indices };
        hausdorff_distance(surface(&fine), surface(&coarse))
    }

    /// The parts with these triangles. Hidden vertices are moved inwards, so that they stay behind the outer surface.
    fn shapes(&self, indices: Vec<Vec<u32>>, hidden: &[Vec<bool>], inwards: f32) -> Vec<Shape> {
        let shape = |((part, indices), hidden): ((&ModelPrimitive, Vec<u32>), &Vec<bool>)| {
            let positions = moved_against_normals(&part.positions, &part.normals, hidden, inwards);
            Shape { indices, positions }
        };
        self.parts.iter().zip(indices).zip(hidden).map(shape).collect()
    }

    /// The shapes as primitives in mesh space.
    fn primitives(
        &self,
        shapes: Vec<Shape>,
        hidden: &[Vec<bool>],
        inwards: f32,
    ) -> Vec<((usize, usize), Option<Primitive>)> {
        let primitive = |((part, shape), hidden): ((&ModelPrimitive, Shape), &Vec<bool>)| {
            let fine = part.primitive();
            let positions =
                moved_against_normals(&fine.positions, &fine.normals, hidden, inwards / part.stretch);
            let some = !shape.indices.is_empty();
            (part.place, some.then(|| with_triangles(fine, &positions, shape.indices)))
        };
        self.parts.iter().zip(shapes).zip(hidden).map(primitive).collect()
    }
}

/// Positions with the marked ones moved against their normals.
fn moved_against_normals(positions: &[Vec3], normals: &[Vec3], marked: &[bool], by: f32) -> Vec<Vec3> {
    let moved = |(v, position): (usize, &Vec3)| match marked[v] {
        true => *position - normals.get(v).copied().unwrap_or_default() * by,
        false => *position,
    };
    positions.iter().enumerate().map(moved).collect()
}

/// Ratio of the size of points after a transform to that before.
fn size_ratio(before: &[Vec3], after: &[Vec3]) -> f32 {
    let size = |points: &[Vec3]| {
        let bounds = Aabb::of(points.iter().copied());
        (bounds.max - bounds.min).length()
    };
    let ratio = size(after) / size(before);
    if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 }
}

/// The primitive reduced to these triangles and their vertices, in order of first use. `positions` replaces its own.
fn with_triangles(p: &Primitive, positions: &[Vec3], mut indices: Vec<u32>) -> Primitive {
    let mut places = vec![u32::MAX; p.positions.len()];
    let mut used: Vec<usize> = Vec::new();
    for index in &mut indices {
        let place = &mut places[*index as usize];
        if *place == u32::MAX {
            *place = used.len() as u32;
            used.push(*index as usize);
        }
        *index = *place;
    }
    fn of<T: Copy>(used: &[usize], all: &[T]) -> Vec<T> {
        if all.is_empty() { Vec::new() } else { used.iter().map(|v| all[*v]).collect() }
    }
    let influences = |v: &usize| v * p.influences..(v + 1) * p.influences;
    Primitive {
        topology: p.topology,
        indices,
        positions: of(&used, positions),
        normals: of(&used, &p.normals),
        tangents: of(&used, &p.tangents),
        uvs: [of(&used, &p.uvs[0]), of(&used, &p.uvs[1])],
        colors: of(&used, &p.colors),
        influences: p.influences,
        joint_indices: used.iter().flat_map(|v| p.joint_indices[influences(v)].iter().copied()).collect(),
        joint_weights: used.iter().flat_map(|v| p.joint_weights[influences(v)].iter().copied()).collect(),
        morphs: (p.morphs.iter())
            .map(|m| MorphTarget {
                positions: of(&used, &m.positions),
                normals: of(&used, &m.normals),
                tangents: of(&used, &m.tangents),
            })
            .collect(),
        material: p.material,
    }
}
