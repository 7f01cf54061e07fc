//! CPU reference of vertex.wgsl: mesh space → morphs → skin or instance matrix → camera-relative space → clip space.

use super::displace::{self, Displacement};
use super::shade::ShadeMaterial;
use crate::affine::Affine3x4;
use crate::lanes::{F4, unit};
use crate::plan::{ActiveMorph, Features, Instance, Plan};
use crate::scene_resources::PrimitiveResource;
use crate::scene_resources::material::TOON_SLOT;
use choreo_asset::Primitive;
use choreo_plugin::VertexSample;
use glam::{Mat4, Vec2, Vec3, Vec3Swizzles, Vec4, Vec4Swizzles};
use rayon::prelude::*;
use std::ops::Range;

#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub clip: Vec4,
    pub relative: Vec3,
    /// Unit; zero where not needed.
    pub normal: Vec3,
    /// xyz unit, w the sign of the bitangent; zero where not needed.
    pub tangent: Vec4,
    /// Scale from mesh to world space; zero where not needed.
    pub scale: f32,
    /// Colors of the vertex's joints, weighted; zero where not needed.
    pub joints: Vec3,
}

pub(crate) struct VertexStage<'a> {
    pub primitive: &'a Primitive,
    /// The range from the first to the last vertex that moves, one range per morph target.
    pub morphed_ranges: &'a [Range<u32>],
    pub features: Features,
    pub instance: &'a Instance,
    /// Joint matrices of the whole plan.
    pub joint_matrices: &'a [Affine3x4],
    pub morphs: &'a [ActiveMorph],
    pub clip_from_relative: &'a Mat4,
    /// Size of the image in pixels.
    pub size: [u32; 2],
    /// Inverted hull, if the pass draws one.
    pub hull: Option<OutlineHull<'a>>,
    /// Effects that displace the vertices.
    pub displacements: Vec<Displacement>,
    /// World position of the camera.
    pub camera: Vec3,
}

/// Inputs of the offset of an inverted-hull outline.
pub(super) struct OutlineHull<'a> {
    pub material: &'a ShadeMaterial,
    /// Normals that replace the primitive's ([`crate::scene_resources::vertex_layout::welded_normals`]).
    pub normals: Vec<Vec3>,
}

impl<'a> VertexStage<'a> {
    /// Vertex stage of an instance of the plan, without outline hull and displacement effects, at the size of the image.
    pub(super) fn new(
        entry: &'a PrimitiveResource,
        features: Features,
        plan: &'a Plan,
        instance: &'a Instance,
        clip_from_relative: &'a Mat4,
    ) -> Self {
        VertexStage {
            primitive: entry.primitive(),
            morphed_ranges: if features.has(Features::MORPH) { entry.morphed_ranges() } else { &[] },
            features,
            instance,
            joint_matrices: &plan.joint_matrices,
            morphs: &plan.morphs,
            clip_from_relative,
            size: plan.size,
            hull: None,
            displacements: Vec::new(),
            camera: plan.view.position.as_vec3(),
        }
    }
}

impl VertexStage<'_> {
    /// Vertices after morphing, skinning and displacement, before the projection and without an outline hull. `normals`: replace the
    /// primitive's normals.
    pub(super) fn skinned_vertices(&self, normals: Option<&[Vec3]>) -> Vec<Vertex> {
        let count = self.primitive.positions.len();
        let normals = normals.unwrap_or(&self.primitive.normals);
        (0..count).into_par_iter().with_min_len(2048).map(|i| self.skinned_vertex(i, normals)).collect()
    }

    /// Projects skinned vertices to clip space, and offsets the vertices of an outline hull.
    pub(super) fn project(&self, mut vertices: Vec<Vertex>) -> Vec<Vertex> {
        vertices.par_iter_mut().with_min_len(2048).enumerate().for_each(|(i, out)| {
            out.clip = *self.clip_from_relative * out.relative.extend(1.0);
            if let Some(hull) = &self.hull {
                self.offset_hull_vertex(hull, i, out);
            }
            if self.features.has(Features::WIREFRAME) {
                out.clip.z += self.wireframe_depth_bias(out.clip.z);
            }
        });
        vertices
    }

    fn skinned_vertex(&self, i: usize, normals: &[Vec3]) -> Vertex {
        let p = self.primitive;
        let lit = self.features.has_normals();
        let tangents = self.features.has_tangents() && !p.tangents.is_empty();
        let mut position = p.positions[i];
        let mut normal = if lit { normals[i] } else { Vec3::ZERO };
        let mut tangent = if tangents { p.tangents[i] } else { Vec4::ZERO };
        if self.features.has(Features::MORPH) {
            let first = self.instance.first_morph as usize;
            for active in &self.morphs[first..first + self.instance.morph_count as usize] {
                if !self.morphed_ranges[active.target as usize].contains(&(i as u32)) {
                    continue;
                }
                let target = &p.morphs[active.target as usize];
                let offset = |list: &[Vec3]| list.get(i).copied().unwrap_or(Vec3::ZERO) * active.weight;
                position += offset(&target.positions);
                if lit {
                    normal += offset(&target.normals);
                }
                if tangents {
                    tangent += offset(&target.tangents).extend(0.0);
                }
            }
        }

        let relative_from_mesh = self.vertex_transform(i);
        let relative = relative_from_mesh.transform_point(position);
        let mut out = Vertex {
            clip: Vec4::ZERO,
            relative,
            normal: Vec3::ZERO,
            tangent: Vec4::ZERO,
            scale: 0.0,
            joints: self.joint_colors(i),
        };
        if self.features.has(Features::VOLUME) || self.features.has(Features::REFRACTION) {
            // Root mean square of the scales along the three axes.
            let [x, y, z] = relative_from_mesh.0.map(|r| r.truncate());
            out.scale = ((x.dot(x) + y.dot(y) + z.dot(z)) / 3.0).sqrt();
        }
        if lit {
            // Normals are transformed by the cofactor matrix: the inverse transpose times the determinant, whose sign is removed
            // again. This is correct under non-uniform scale and mirroring, and finite if the matrix is flat.
            let [x, y, z] = relative_from_mesh.0.map(|r| r.truncate());
            let cofactor = [y.cross(z), z.cross(x), x.cross(y)];
            let handedness = if x.dot(cofactor[0]) < 0.0 { -1.0 } else { 1.0 };
            let transformed =
                Vec3::new(cofactor[0].dot(normal), cofactor[1].dot(normal), cofactor[2].dot(normal));
            out.normal = unit(transformed * handedness);
            if tangents {
                let along = unit(relative_from_mesh.transform_vector(tangent.truncate()));
                out.tangent = along.extend(p.tangents[i].w * handedness);
            }
        }
        if !self.displacements.is_empty() {
            self.displace(i, position, &relative_from_mesh, &mut out);
        }
        out
    }

    /// Displaces a vertex by the displacement effects, and computes its new normal.
    fn displace(&self, i: usize, model: Vec3, rows: &Affine3x4, out: &mut Vertex) {
        let uvs = self.features.has(Features::UV0).then(|| self.primitive.uvs[0].get(i).copied()).flatten();
        let sample = VertexSample {
            world: out.relative + self.camera,
            normal: out.normal,
            uv: uvs.unwrap_or_default(),
            model,
        };
        let displacement = displace::total_displacement(&self.displacements, &sample, rows);
        if self.features.has_normals() {
            out.normal = displace::displaced_normal(&self.displacements, &sample, rows, displacement);
        }
        out.relative += displacement;
    }

    fn joint_colors(&self, i: usize) -> Vec3 {
        let stride = self.primitive.influences;
        if !self.features.has(Features::EFFECT_JOINTS) || stride == 0 {
            return Vec3::ZERO;
        }
        let used = if self.features.has(Features::SKIN_8) { stride } else { stride.min(4) };
        let range = i * stride..i * stride + used;
        let joints = self.primitive.joint_indices[range.clone()].iter();
        joints
            .zip(&self.primitive.joint_weights[range])
            .fold(Vec3::ZERO, |sum, (j, w)| sum + joint_color(*j) * *w)
    }

    /// Moves a vertex of an outline hull along its normal, by metres in world space or by a share of the image's height.
    fn offset_hull_vertex(&self, hull: &OutlineHull, i: usize, out: &mut Vertex) {
        let factors = &hull.material.factors;
        let Some(outline) = factors.material.toon.as_ref().and_then(|t| t.outline.as_ref()) else { return };
        let mut width = outline.width;
        if let (true, Some(r), Some(texture)) = (
            self.features.has(Features::OUTLINE_WIDTH_TEXTURE),
            &factors.textures[TOON_SLOT],
            &hull.material.textures[TOON_SLOT],
        ) {
            let uv = self.primitive.uvs[usize::from(r.uv_set)].get(i).copied().unwrap_or_default();
            let at = r.uv_transform.transform_point2(uv);
            width *= texture.sample(&r.sampler, [F4::splat(at.x), F4::splat(at.y)])[1].0[0];
        }
        if !outline.on_screen {
            out.relative += out.normal * width;
            out.clip = *self.clip_from_relative * out.relative.extend(1.0);
            return;
        }
        let size = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        // Direction of the normal on screen, in pixels: d(xy/w) is proportional to this.
        let direction = *self.clip_from_relative * out.normal.extend(0.0);
        let pixels = (direction.xy() * out.clip.w - out.clip.xy() * direction.w) * size;
        let step = unit(pixels.extend(0.0)).xy() * (2.0 * width * size.y) / size * out.clip.w;
        out.clip += Vec4::new(step.x, step.y, 0.0, 0.0);
    }

    /// Depth bias of wireframes, in clip space. An edge lies in its surface and is drawn one pixel wide. A bias towards the camera
    /// by the size of two pixels keeps it visible on slopes of up to two. In clip space, the bias is proportional to `z` in
    /// perspective views, and constant in orthographic views.
    fn wireframe_depth_bias(&self, z: f32) -> f32 {
        let rows = self.clip_from_relative.transpose();
        let pixel = 2.0 / (self.size[1] as f32 * rows.y_axis.xyz().length());
        2.0 * pixel * (z.abs() * rows.w_axis.xyz().length() + rows.z_axis.xyz().length())
    }

    /// Transform of a vertex from mesh space to camera-relative space: the instance's, or the blend of its joints' transforms.
    fn vertex_transform(&self, i: usize) -> Affine3x4 {
        if !self.features.has(Features::SKIN) {
            return self.instance.relative_from_mesh;
        }
        let first = self.instance.first_joint as usize;
        let stride = self.primitive.influences;
        if stride == 0 {
            return self.joint_matrices[first];
        }
        let used = if self.features.has(Features::SKIN_8) { stride } else { stride.min(4) };
        let range = i * stride..i * stride + used;
        let joints = &self.primitive.joint_indices[range.clone()];
        let weights = &self.primitive.joint_weights[range];
        if self.features.has(Features::DUAL_QUATERNIONS) {
            return self.blend_dual_quaternions(first, joints, weights);
        }
        let mut sum = Affine3x4::default();
        for (joint, weight) in joints.iter().zip(weights) {
            // Unused influences may name any joint.
            if *weight != 0.0 {
                add_weighted(&mut sum, &self.joint_matrices[first + usize::from(*joint)], *weight);
            }
        }
        match self.features.has(Features::SKIN_INSTANCED) {
            true => sum.followed_by(&self.instance.relative_from_mesh),
            false => sum,
        }
    }

    /// Dual-quaternion skinning. Stretches are blended as matrices; rigid motions are blended as dual quaternions, each with the sign
    /// that is nearer to the one with the largest weight (`choreo_motion::skinning::dual_quaternion`).
    fn blend_dual_quaternions(&self, first: usize, joints: &[u16], weights: &[f32]) -> Affine3x4 {
        let mut heaviest = 0;
        for k in 1..weights.len() {
            if weights[k] > weights[heaviest] {
                heaviest = k;
            }
        }
        let at = |joint: u16| first + 2 * usize::from(joint);
        let heaviest_rotation = self.joint_matrices[at(joints[heaviest])].0[0];
        let (mut real, mut dual, mut stretch) = (Vec4::ZERO, Vec4::ZERO, Affine3x4::default());
        for (joint, weight) in joints.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            let [q, d, _] = self.joint_matrices[at(*joint)].0;
            let signed = if q.dot(heaviest_rotation) < 0.0 { -*weight } else { *weight };
            real += q * signed;
            dual += d * signed;
            add_weighted(&mut stretch, &self.joint_matrices[at(*joint) + 1], *weight);
        }
        rigid_transform(real, dual).compose_linear(&stretch).followed_by(&self.instance.relative_from_mesh)
    }
}

/// Color of a joint. Successive hues differ by the golden ratio, so that the colors of neighbors are distinct.
fn joint_color(joint: u16) -> Vec3 {
    let x = f32::from(joint) * 0.618_034;
    let hue = (x - x.floor()) * 6.0;
    let color = Vec3::new((hue - 3.0).abs() - 1.0, 2.0 - (hue - 2.0).abs(), 2.0 - (hue - 4.0).abs());
    color.clamp(Vec3::splat(0.05), Vec3::ONE)
}

fn add_weighted(sum: &mut Affine3x4, rows: &Affine3x4, weight: f32) {
    for (s, r) in sum.0.iter_mut().zip(&rows.0) {
        *s += *r * weight;
    }
}

/// Rigid transform (rotation and translation) of a dual quaternion, which need not be normalized.
fn rigid_transform(q: Vec4, d: Vec4) -> Affine3x4 {
    let k = 2.0 / q.dot(q).max(1e-30);
    let (v, e) = (q.truncate(), d.truncate());
    let t = (e * q.w - v * d.w + v.cross(e)) * k;
    let (x, y, z, w) = (v.x * k, v.y * k, v.z * k, q.w);
    Affine3x4([
        Vec4::new(1.0 - (v.y * y + v.z * z), v.x * y - w * z, v.x * z + w * y, t.x),
        Vec4::new(v.x * y + w * z, 1.0 - (v.x * x + v.z * z), v.y * z - w * x, t.y),
        Vec4::new(v.x * z - w * y, v.y * z + w * x, 1.0 - (v.x * x + v.y * y), t.z),
    ])
}
