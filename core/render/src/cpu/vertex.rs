//! Twin of vertex.wgsl: mesh space → morphs → skin or instance matrix → camera-relative space → clip space.

use crate::plan::{ActiveMorph, Features, Instance, Rows};
use choreo_stage::Primitive;
use glam::{Mat4, Vec3, Vec4};
use rayon::prelude::*;

#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    pub clip: Vec4,
    pub relative: Vec3,
    /// Unit; zero where not needed.
    pub normal: Vec3,
    /// xyz unit, w the sign of the bitangent; zero where not needed.
    pub tangent: Vec4,
    /// How much longer the mesh's metres are here; zero where not needed.
    pub scale: f32,
}

pub struct VertexStage<'a> {
    pub primitive: &'a Primitive,
    pub features: Features,
    pub instance: &'a Instance,
    /// All of the plan's.
    pub joint_matrices: &'a [Rows],
    pub morphs: &'a [ActiveMorph],
    pub clip_from_relative: &'a Mat4,
}

impl VertexStage<'_> {
    pub fn run(&self) -> Vec<Vertex> {
        let count = self.primitive.positions.len();
        (0..count).into_par_iter().with_min_len(2048).map(|i| self.vertex(i)).collect()
    }

    fn vertex(&self, i: usize) -> Vertex {
        let p = self.primitive;
        let lit = self.features.is_lit();
        let tangents = self.features.has_tangents() && !p.tangents.is_empty();
        let mut position = p.positions[i];
        let mut normal = if lit { p.normals[i] } else { Vec3::ZERO };
        let mut tangent = if tangents { p.tangents[i] } else { Vec4::ZERO };
        if self.features.has(Features::MORPH) {
            let first = self.instance.first_morph as usize;
            for active in &self.morphs[first..first + self.instance.morph_count as usize] {
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

        let rows = self.rows(i);
        let relative = rows.transform_point(position);
        let mut out = Vertex {
            clip: *self.clip_from_relative * relative.extend(1.0),
            relative,
            normal: Vec3::ZERO,
            tangent: Vec4::ZERO,
            scale: 0.0,
        };
        if self.features.has(Features::VOLUME) {
            // The root mean square of the three axes.
            let [x, y, z] = rows.0.map(|r| r.truncate());
            out.scale = ((x.dot(x) + y.dot(y) + z.dot(z)) / 3.0).sqrt();
        }
        if lit {
            // Normals by the cofactor matrix: the inverse transpose times the determinant, whose sign is taken out
            // again (right under non-uniform scale and mirroring, and finite where the matrix is flat).
            let [x, y, z] = rows.0.map(|r| r.truncate());
            let cofactor = [y.cross(z), z.cross(x), x.cross(y)];
            let handedness = if x.dot(cofactor[0]) < 0.0 { -1.0 } else { 1.0 };
            let turned = Vec3::new(cofactor[0].dot(normal), cofactor[1].dot(normal), cofactor[2].dot(normal));
            out.normal = unit(turned * handedness);
            if tangents {
                let along = unit(rows.transform_vector(tangent.truncate()));
                out.tangent = along.extend(p.tangents[i].w * handedness);
            }
        }
        out
    }

    /// The vertex's matrix: the instance's, or its joints' weighted by influence.
    fn rows(&self, i: usize) -> Rows {
        if !self.features.has(Features::SKIN) {
            return self.instance.relative_from_mesh;
        }
        let first = self.instance.first_joint as usize;
        let stride = self.primitive.influences;
        if stride == 0 {
            return self.joint_matrices[first];
        }
        let used = if self.features.has(Features::SKIN_8) { stride } else { stride.min(4) };
        let mut sum = Rows::default();
        for k in i * stride..i * stride + used {
            let weight = self.primitive.joint_weights[k];
            // Unused influences may name any joint.
            if weight != 0.0 {
                let joint = &self.joint_matrices[first + self.primitive.joint_indices[k] as usize];
                for (s, j) in sum.0.iter_mut().zip(&joint.0) {
                    *s += *j * weight;
                }
            }
        }
        sum
    }
}

fn unit(v: Vec3) -> Vec3 {
    v * (1.0 / v.dot(v).max(1e-20).sqrt())
}
