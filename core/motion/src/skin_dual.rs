//! Dual-quaternion skinning on the CPU, eight vertices at a time; the formulas are those of [`crate::dual_quaternion`].

use crate::simd::{F8, Kernel, Level, dispatch};
use crate::skin::{
    SkinnedVertices, blended, blended_by, cross, dot3, eight, put_eight, transformed, transformed_normals,
};
use crate::{Carrier, LANES};
use glam::{Affine3A, DQuat, Mat3A, Vec3, Vec3A};

/// A rigid motion in f32: the real and the dual part, x y z w each.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct DualQuaternion(pub [[f32; 4]; 2]);

impl DualQuaternion {
    pub const IDENTITY: DualQuaternion = DualQuaternion([[0.0, 0.0, 0.0, 1.0], [0.0; 4]]);
}

impl From<&Carrier> for DualQuaternion {
    fn from(carrier: &Carrier) -> Self {
        let narrow = |q: DQuat| q.to_array().map(|v| v as f32);
        DualQuaternion([narrow(carrier.real), narrow(carrier.dual)])
    }
}

/// Dual-quaternion skinning of positions and normals: stretches are blended first, as matrices, then rigid motions.
///
/// Quaternions are summed on the side of a vertex's heaviest influence, the first of equals. Normals go through the blended
/// stretch's cofactors and the blended rotation, then to unit length. A vertex without weight goes through the blended stretch.
pub struct SkinDual<'a> {
    /// Model from mesh, without stretch, one per skin joint.
    pub motions: &'a [DualQuaternion],
    /// Scale and shear before the motion, as many (translations are not read); empty where there is none.
    pub stretches: &'a [Affine3A],
    /// Influences a vertex, any number.
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

impl SkinDual<'_> {
    pub fn check(&self) -> Result<(), String> {
        let joints = self.motions.len();
        if !self.stretches.is_empty() && self.stretches.len() != joints {
            return Err(format!(
                "`SkinDual.stretches` holds {}, the skin has {joints} joints",
                self.stretches.len()
            ));
        }
        SkinnedVertices {
            job: "SkinDual",
            joints,
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
        dispatch(level, Vertices(self));
    }
}

/// The stretch of a carrier as [`SkinDual::stretches`] wants it.
pub fn stretch_of(carrier: &Carrier) -> Affine3A {
    Affine3A { matrix3: Mat3A::from(carrier.stretch.as_mat3()), translation: Vec3A::ZERO }
}

struct Vertices<'a, 'b>(&'b mut SkinDual<'a>);

impl Kernel for Vertices<'_, '_> {
    #[inline(always)]
    fn run<F: F8>(self) {
        match self.0.influences {
            4 => self.vertices::<F, 4>(4),
            8 => self.vertices::<F, 8>(8),
            influences => self.vertices::<F, 0>(influences),
        }
    }
}

impl Vertices<'_, '_> {
    /// N influences, or any number where N is 0.
    #[inline(always)]
    fn vertices<F: F8, const N: usize>(self, influences: usize) {
        let job = self.0;
        let positions: &[[f32; 3]] = bytemuck::cast_slice(job.positions);
        let normals: &[[f32; 3]] = bytemuck::cast_slice(job.normals);
        let out_positions: &mut [[f32; 3]] = bytemuck::cast_slice_mut(job.out_positions);
        let out_normals: &mut [[f32; 3]] = bytemuck::cast_slice_mut(job.out_normals);
        for first in (0..positions.len()).step_by(LANES) {
            let count = LANES.min(positions.len() - first);
            let range = first * influences..(first + count) * influences;
            let (joints, weights) = (&job.joint_indices[range.clone()], &job.joint_weights[range]);
            let motion = Motion::<F>::blended(job.motions, influences, joints, weights);
            let mut points = eight::<F>(&positions[first..]);
            if job.stretches.is_empty() {
                put_eight(motion.moved(points), &mut out_positions[first..]);
                if !normals.is_empty() {
                    let turned = motion.turned(eight::<F>(&normals[first..]));
                    put_eight(unit(turned), &mut out_normals[first..]);
                }
                continue;
            }
            let mut stretch = match N {
                0 => blended::<F>(job.stretches, influences, joints, weights),
                _ => blended_by::<F, N>(job.stretches, joints, weights),
            };
            stretch[3] = [F::splat(0.0); 3];
            points = transformed(&stretch, points);
            put_eight(motion.moved(points), &mut out_positions[first..]);
            if !normals.is_empty() {
                let stretched = transformed_normals(&stretch, eight::<F>(&normals[first..]));
                put_eight(unit(motion.turned(stretched)), &mut out_normals[first..]);
            }
        }
    }
}

/// The blended rigid motions of eight vertices, component rows.
struct Motion<F> {
    vector: [F; 3],
    w: F,
    /// 2 / |real|²
    scale: F,
    /// The translation.
    translation: [F; 3],
}

impl<F: F8> Motion<F> {
    #[inline(always)]
    fn blended(motions: &[DualQuaternion], influences: usize, joints: &[u16], weights: &[f32]) -> Self {
        let zero = F::splat(0.0);
        let mut sums = [zero; LANES];
        if influences > 0 {
            let vertices = joints.chunks_exact(influences).zip(weights.chunks_exact(influences));
            for (sum, (joints, weights)) in sums.iter_mut().zip(vertices) {
                *sum = weighted(motions, joints, weights);
            }
        }
        let [a, b, c, d, e, f, g, h] = sums;
        let (low, high) = (F::half_rows4([a, b, c, d]), F::half_rows4([e, f, g, h]));
        let [[x, y, z, w], [dx, dy, dz, dw]] = F::joined_rows4(low, high);
        let square = x.mul(x).add(y.mul(y)).add(z.mul(z).add(w.mul(w)));
        let some = F::splat(0.0).less(square);
        let scale = F::select(some, F::splat(2.0).div(square), zero);
        // The vector part of 2 dual · conjugate(real) / |real|².
        let vector = [x, y, z];
        let dual = [dx, dy, dz];
        let across = cross(&vector, &dual);
        let mut translation = across;
        for i in 0..3 {
            translation[i] = w.mul(dual[i]).sub(dw.mul(vector[i])).add(across[i]).mul(scale);
        }
        Motion { vector, w, scale, translation }
    }

    /// R v = v + 2 r × (r × v + w v) / |real|².
    #[inline(always)]
    fn turned(&self, v: [F; 3]) -> [F; 3] {
        let mut inner = cross(&self.vector, &v);
        for i in 0..3 {
            inner[i] = inner[i].add(self.w.mul(v[i]));
        }
        let outer = cross(&self.vector, &inner);
        let mut out = v;
        for i in 0..3 {
            out[i] = v[i].add(self.scale.mul(outer[i]));
        }
        out
    }

    #[inline(always)]
    fn moved(&self, point: [F; 3]) -> [F; 3] {
        let turned = self.turned(point);
        [0, 1, 2].map(|i| turned[i].add(self.translation[i]))
    }
}

/// The weighted sum of one vertex's dual quaternions, all on the side of the heaviest.
#[inline(always)]
fn weighted<F: F8>(motions: &[DualQuaternion], joints: &[u16], weights: &[f32]) -> F {
    let mut heaviest = 0;
    for i in 1..weights.len() {
        if weights[i] > weights[heaviest] {
            heaviest = i;
        }
    }
    let pivot = F::both(&motions[usize::from(joints[heaviest])].0[0]);
    let mut sum = F::splat(0.0);
    for (joint, weight) in joints.iter().zip(weights) {
        let motion = &motions[usize::from(*joint)].0;
        let side = F::both(&motion[0]).dot_halves(pivot);
        sum = sum.add(F::load_halves(motion).mul(F::splat(*weight).flipped_by(side)));
    }
    sum
}

#[inline(always)]
fn unit<F: F8>(n: [F; 3]) -> [F; 3] {
    let square = dot3(&n, &n);
    let k = F::splat(1.0).div(square.sqrt());
    let some = F::splat(0.0).less(square);
    let mut out = n;
    for i in 0..3 {
        out[i] = F::select(some, n[i].mul(k), n[i]);
    }
    out
}
