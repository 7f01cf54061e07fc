//! Skinning and morphing on the CPU.

use crate::LANES;
use crate::simd::{F8, Kernel, Level, dispatch};
use glam::{Affine3A, Mat4, Vec3};

/// Skin matrices: `out[i] = model_from_joint[joints[i]] * inverse_bind[i]`, model from the mesh at bind time.
pub struct SkinMatrices<'a> {
    pub model_from_joint: &'a [Affine3A],
    /// Skeleton joint of each skin joint.
    pub joints: &'a [u32],
    /// joint-from-mesh at bind time; the last row is taken as 0 0 0 1 (glTF 2.0 §3.7.3.1). Empty = identities.
    pub inverse_bind: &'a [Mat4],
    pub out: &'a mut [Affine3A],
}

impl SkinMatrices<'_> {
    pub fn check(&self) -> Result<(), String> {
        let joints = self.joints.len();
        if !self.inverse_bind.is_empty() && self.inverse_bind.len() != joints {
            return Err(format!(
                "`SkinMatrices.inverse_bind` holds {}, the skin has {joints} joints",
                self.inverse_bind.len()
            ));
        }
        if self.out.len() != joints {
            return Err(format!("`SkinMatrices.out` holds {}, the skin has {joints} joints", self.out.len()));
        }
        match self.joints.iter().position(|j| *j as usize >= self.model_from_joint.len()) {
            Some(at) => Err(format!(
                "`SkinMatrices.joints[{at}]` is {}, the skeleton has {} joints",
                self.joints[at],
                self.model_from_joint.len()
            )),
            None => Ok(()),
        }
    }

    pub fn run(&mut self) {
        for (i, (joint, out)) in self.joints.iter().zip(self.out.iter_mut()).enumerate() {
            let joint = self.model_from_joint[*joint as usize];
            *out = match self.inverse_bind.get(i) {
                Some(m) => joint * Affine3A::from_mat4(*m),
                None => joint,
            };
        }
    }
}

/// What every way of skinning asks of its vertices.
pub(crate) struct SkinnedVertices<'a> {
    /// In messages.
    pub job: &'a str,
    pub joints: usize,
    pub influences: usize,
    pub joint_indices: &'a [u16],
    pub joint_weights: &'a [f32],
    pub positions: usize,
    pub normals: usize,
    pub out_positions: usize,
    pub out_normals: usize,
}

impl SkinnedVertices<'_> {
    pub fn check(&self) -> Result<(), String> {
        let (job, vertices, joints) = (self.job, self.positions, self.joints);
        if self.normals != 0 && self.normals != vertices {
            return Err(format!("`{job}.normals` holds {}, there are {vertices} positions", self.normals));
        }
        let lengths = [
            ("joint_indices", self.joint_indices.len(), vertices * self.influences),
            ("joint_weights", self.joint_weights.len(), vertices * self.influences),
            ("out_positions", self.out_positions, vertices),
            ("out_normals", self.out_normals, self.normals),
        ];
        for (field, holds, needs) in lengths {
            if holds != needs {
                return Err(format!("`{job}.{field}` holds {holds}, must hold {needs}"));
            }
        }
        if let Some(at) = self.joint_indices.iter().position(|j| usize::from(*j) >= joints) {
            let joint = self.joint_indices[at];
            return Err(format!("`{job}.joint_indices[{at}]` is {joint}, the skin has {joints} joints"));
        }
        if let Some(at) = self.joint_weights.iter().position(|w| !w.is_finite()) {
            return Err(format!("`{job}.joint_weights[{at}]` is {}, must be finite", self.joint_weights[at]));
        }
        Ok(())
    }
}

/// Linear blend skinning of positions and normals.
///
/// Normals go through the blended matrix's cofactors (the inverse transpose but for a positive factor, finite for
/// singular matrices too, and right for mirrored ones), then to unit length; a normal that collapses is left as it was.
pub struct Skin<'a> {
    /// Model from mesh, one per skin joint (see [`SkinMatrices`]).
    pub matrices: &'a [Affine3A],
    /// Influences a vertex, any number; 4 and 8 are fast.
    pub influences: usize,
    /// `influences` a vertex.
    pub joint_indices: &'a [u16],
    /// `influences` a vertex, sum 1.
    pub joint_weights: &'a [f32],
    pub positions: &'a [Vec3],
    /// As many as positions, or none.
    pub normals: &'a [Vec3],
    pub out_positions: &'a mut [Vec3],
    pub out_normals: &'a mut [Vec3],
}

impl Skin<'_> {
    pub fn check(&self) -> Result<(), String> {
        SkinnedVertices {
            job: "Skin",
            joints: self.matrices.len(),
            influences: self.influences,
            joint_indices: self.joint_indices,
            joint_weights: self.joint_weights,
            positions: self.positions.len(),
            normals: self.normals.len(),
            out_positions: self.out_positions.len(),
            out_normals: self.out_normals.len(),
        }
        .check()
    }

    /// Panics where a joint index is out of range, which `check` finds.
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// The same bits at any level; for tests and benchmarks.
    pub fn run_on(&mut self, level: Level) {
        dispatch(level, SkinVertices(self));
    }
}

struct SkinVertices<'a, 'b>(&'b mut Skin<'a>);

impl Kernel for SkinVertices<'_, '_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        // Known counts are unrolled.
        match self.0.influences {
            4 => self.vertices::<F, 4>(),
            8 => self.vertices::<F, 8>(),
            _ => self.vertices::<F, 0>(),
        }
    }
}

impl SkinVertices<'_, '_> {
    /// N influences, or any number where N is 0.
    #[inline(always)]
    fn vertices<F: F8, const N: usize>(self) {
        let job = self.0;
        let influences = job.influences;
        let positions: &[[f32; 3]] = bytemuck::cast_slice(job.positions);
        let normals: &[[f32; 3]] = bytemuck::cast_slice(job.normals);
        let out_positions: &mut [[f32; 3]] = bytemuck::cast_slice_mut(job.out_positions);
        let out_normals: &mut [[f32; 3]] = bytemuck::cast_slice_mut(job.out_normals);
        for first in (0..positions.len()).step_by(LANES) {
            let count = LANES.min(positions.len() - first);
            let range = first * influences..(first + count) * influences;
            let (joints, weights) = (&job.joint_indices[range.clone()], &job.joint_weights[range]);
            let matrices = match N {
                0 => blended::<F>(job.matrices, influences, joints, weights),
                _ => blended_by::<F, N>(job.matrices, joints, weights),
            };
            let points = eight::<F>(&positions[first..]);
            put_eight(transformed(&matrices, points), &mut out_positions[first..]);
            if !normals.is_empty() {
                let normals = eight::<F>(&normals[first..]);
                put_eight(transformed_normals(&matrices, normals), &mut out_normals[first..]);
            }
        }
    }
}

/// Component rows of four matrix columns of eight vertices.
pub(crate) type Rows<F> = [[F; 3]; 4];

/// Weighted sums of matrices, for up to eight vertices of any number of influences.
#[inline(always)]
pub(crate) fn blended<F: F8>(
    matrices: &[Affine3A],
    influences: usize,
    joints: &[u16],
    weights: &[f32],
) -> Rows<F> {
    let zero = F::splat(0.0);
    let (mut c01, mut c23) = ([zero; LANES], [zero; LANES]);
    if influences > 0 {
        let vertices = joints.chunks_exact(influences).zip(weights.chunks_exact(influences));
        for (vertex, (joints, weights)) in vertices.enumerate().take(LANES) {
            [c01[vertex], c23[vertex]] = weighted(matrices, joints, weights);
        }
    }
    let ([c0, c1], [c2, c3]) = (component_rows(c01), component_rows(c23));
    [c0, c1, c2, c3]
}

#[inline(always)]
fn component_rows<F: F8>([a, b, c, d, e, f, g, h]: [F; LANES]) -> [[F; 3]; 2] {
    F::joined_rows(F::half_rows([a, b, c, d]), F::half_rows([e, f, g, h]))
}

/// The same for a known number of influences. Four vertices at a time, so that their matrices stay in registers.
#[inline(always)]
pub(crate) fn blended_by<F: F8, const N: usize>(
    matrices: &[Affine3A],
    joints: &[u16],
    weights: &[f32],
) -> Rows<F> {
    let (joints, _) = joints.as_chunks::<N>();
    let (weights, _) = weights.as_chunks::<N>();
    let (Some(joints), Some(weights)) = (joints.first_chunk::<LANES>(), weights.first_chunk::<LANES>())
    else {
        return blended(matrices, N, joints.as_flattened(), weights.as_flattened());
    };
    let zero = F::splat(0.0);
    let mut halves = [[[zero; 3]; 2]; 2];
    for (half, out) in halves.iter_mut().enumerate() {
        let (mut c01, mut c23) = ([zero; 4], [zero; 4]);
        for i in 0..4 {
            let vertex = half * 4 + i;
            [c01[i], c23[i]] = weighted(matrices, &joints[vertex], &weights[vertex]);
        }
        *out = [F::half_rows(c01), F::half_rows(c23)];
    }
    let [[low01, low23], [high01, high23]] = halves;
    let ([c0, c1], [c2, c3]) = (F::joined_rows(low01, high01), F::joined_rows(low23, high23));
    [c0, c1, c2, c3]
}

/// The weighted sum of one vertex's matrices, as column pairs.
#[inline(always)]
fn weighted<F: F8>(matrices: &[Affine3A], joints: &[u16], weights: &[f32]) -> [F; 2] {
    let mut sum = [F::splat(0.0); 2];
    for (i, (joint, weight)) in joints.iter().zip(weights).enumerate() {
        let [x, y] = F::of_matrix(&matrices[usize::from(*joint)]);
        let weight = F::splat(*weight);
        let (x, y) = (x.mul(weight), y.mul(weight));
        sum = if i == 0 { [x, y] } else { [sum[0].add(x), sum[1].add(y)] };
    }
    sum
}

/// The first eight points, fewer at the end of the list.
#[inline(always)]
pub(crate) fn eight<F: F8>(points: &[[f32; 3]]) -> [F; 3] {
    match points.first_chunk::<LANES>() {
        Some(points) => F::load_points(points),
        None => {
            let mut padded = [[0.0; 3]; LANES];
            padded[..points.len()].copy_from_slice(points);
            F::load_points(&padded)
        }
    }
}

#[inline(always)]
pub(crate) fn put_eight<F: F8>(rows: [F; 3], points: &mut [[f32; 3]]) {
    match points.first_chunk_mut::<LANES>() {
        Some(points) => F::store_points(rows, points),
        None => {
            let mut padded = [[0.0; 3]; LANES];
            F::store_points(rows, &mut padded);
            let count = points.len();
            points.copy_from_slice(&padded[..count]);
        }
    }
}

#[inline(always)]
pub(crate) fn transformed<F: F8>([c0, c1, c2, c3]: &Rows<F>, [x, y, z]: [F; 3]) -> [F; 3] {
    let mut out = [x; 3];
    for i in 0..3 {
        out[i] = c0[i].mul(x).add(c1[i].mul(y)).add(c2[i].mul(z)).add(c3[i]);
    }
    out
}

/// Through the cofactors, at unit length; unchanged where they collapse.
#[inline(always)]
pub(crate) fn transformed_normals<F: F8>([c0, c1, c2, _]: &Rows<F>, normals: [F; 3]) -> [F; 3] {
    let [x, y, z] = normals;
    let (a, b, c) = (cross(c1, c2), cross(c2, c0), cross(c0, c1));
    // The inverse transpose is cofactors / determinant: a mirroring matrix turns the cofactors round.
    let determinant = dot3(c0, &a);
    let mut n = normals;
    for i in 0..3 {
        n[i] = a[i].mul(x).add(b[i].mul(y)).add(c[i].mul(z)).flipped_by(determinant);
    }
    let square = dot3(&n, &n);
    let k = F::splat(1.0).div(square.sqrt());
    let (some, finite) = (F::splat(0.0).less(square), square.less(F::splat(f32::MAX)));
    for i in 0..3 {
        n[i] = F::select(finite, F::select(some, n[i].mul(k), normals[i]), normals[i]);
    }
    n
}

#[inline(always)]
pub(crate) fn cross<F: F8>(a: &[F; 3], b: &[F; 3]) -> [F; 3] {
    [
        a[1].mul(b[2]).sub(a[2].mul(b[1])),
        a[2].mul(b[0]).sub(a[0].mul(b[2])),
        a[0].mul(b[1]).sub(a[1].mul(b[0])),
    ]
}

#[inline(always)]
pub(crate) fn dot3<F: F8>(a: &[F; 3], b: &[F; 3]) -> F {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// Adds weighted morph targets: `values[i] += Σ weight * target[i]`; an empty target changes nothing.
pub struct Morph<'a> {
    /// Offsets at weight 1: one list per target, as long as `values` or empty.
    pub targets: &'a [&'a [Vec3]],
    /// One per target; missing ones count as zero.
    pub weights: &'a [f32],
    /// In: positions (or normals, tangents) of the mesh. Out: morphed; normals are not renormalised.
    pub values: &'a mut [Vec3],
}

impl Morph<'_> {
    pub fn check(&self) -> Result<(), String> {
        for (i, target) in self.targets.iter().enumerate() {
            if !target.is_empty() && target.len() != self.values.len() {
                return Err(format!(
                    "`Morph.targets[{i}]` holds {}, there are {} values",
                    target.len(),
                    self.values.len()
                ));
            }
        }
        match self.weights.iter().position(|w| !w.is_finite()) {
            Some(i) => Err(format!("`Morph.weights[{i}]` is {}, must be finite", self.weights[i])),
            None => Ok(()),
        }
    }

    pub fn run(&mut self) {
        for (target, weight) in self.targets.iter().zip(self.weights) {
            if *weight != 0.0 {
                for (value, offset) in self.values.iter_mut().zip(*target) {
                    *value += *offset * *weight;
                }
            }
        }
    }
}
