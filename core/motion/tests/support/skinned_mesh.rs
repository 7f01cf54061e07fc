//! Vertices that follow joints, and how far skinning is from f64.

use super::Random;
use glam::{DAffine3, Vec3};

/// Vertices, each of which follows several of seven joints.
pub(crate) struct SkinnedMesh {
    pub influences: usize,
    pub joints: Vec<u16>,
    pub weights: Vec<f32>,
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
}

impl SkinnedMesh {
    pub(crate) fn random(random: &mut Random, vertices: usize, influences: usize) -> SkinnedMesh {
        let mut weights: Vec<f32> = (0..vertices * influences).map(|_| random.signed() + 1.01).collect();
        for vertex in weights.chunks_mut(influences.max(1)) {
            let sum: f32 = vertex.iter().sum();
            vertex.iter_mut().for_each(|w| *w /= sum);
        }
        let mut vector = || Vec3::new(random.signed(), random.signed(), random.signed() + 1.5);
        let positions = (0..vertices).map(|_| vector()).collect();
        let normals = (0..vertices).map(|_| vector().normalize()).collect();
        let joints = (0..vertices * influences).map(|_| random.below(7) as u16).collect();
        SkinnedMesh { influences, joints, weights, positions, normals }
    }

    /// The positions and normals that a job writes.
    pub(crate) fn skinned(&self, job: impl FnOnce(&mut [Vec3], &mut [Vec3])) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut positions = vec![Vec3::NAN; self.positions.len()];
        let mut normals = vec![Vec3::NAN; self.normals.len()];
        job(&mut positions, &mut normals);
        (positions, normals)
    }

    /// Worst distance from f64: `map` blends the joints of a vertex, with their weights. Its inverse transpose maps normals; a
    /// vertex without joints keeps its own.
    pub(crate) fn error(
        &self,
        positions: &[Vec3],
        normals: &[Vec3],
        map: impl Fn(&[(usize, f64)]) -> DAffine3,
    ) -> f64 {
        let mut worst = 0.0f64;
        for vertex in 0..self.positions.len() {
            let range = vertex * self.influences..(vertex + 1) * self.influences;
            let joints = self.joints[range.clone()].iter().map(|joint| usize::from(*joint));
            let weights = self.weights[range].iter().map(|weight| f64::from(*weight));
            let map = map(&joints.zip(weights).collect::<Vec<_>>());
            let position = map.transform_point3(self.positions[vertex].as_dvec3());
            worst = worst.max(position.distance(positions[vertex].as_dvec3()));
            let normal = self.normals[vertex].as_dvec3();
            let turned = match self.influences {
                0 => normal,
                _ => (map.matrix3.inverse().transpose() * normal).normalize(),
            };
            worst = worst.max(turned.distance(normals[vertex].as_dvec3()));
        }
        worst
    }
}
