//! Dual-quaternion skinning against the same formulas in f64, which the unit tests hold to closed forms.

use crate::support::Random;
use choreo_motion::{DualQuaternion, DualQuaternionSkinning, Level, StretchedDualQuaternion, stretch_matrix};
use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3, Vec3};

struct Case {
    carriers: Vec<StretchedDualQuaternion>,
    stretched: bool,
    influences: usize,
    joints: Vec<u16>,
    weights: Vec<f32>,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl Case {
    fn random(
        random: &mut Random,
        vertices: usize,
        influences: usize,
        stretched: bool,
        mirrored: bool,
    ) -> Case {
        let carriers = (0..7)
            .map(|_| {
                let rotation = DQuat::from_array(random.rotation().map(f64::from)).normalize();
                let mut scale = DVec3::ONE;
                if stretched {
                    scale = DVec3::from_array([0; 3].map(|_| 1.0 + 0.3 * f64::from(random.signed())));
                }
                let mirror = DVec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
                let place = DVec3::from_array([0; 3].map(|_| f64::from(random.signed())));
                let map = DAffine3::from_scale(mirror)
                    * DAffine3::from_scale_rotation_translation(scale, rotation, place);
                StretchedDualQuaternion::of(map)
            })
            .collect();
        let mut weights: Vec<f32> = (0..vertices * influences).map(|_| random.signed() + 1.01).collect();
        for vertex in weights.chunks_mut(influences.max(1)) {
            let sum: f32 = vertex.iter().sum();
            vertex.iter_mut().for_each(|w| *w /= sum);
        }
        let mut vector = || Vec3::new(random.signed(), random.signed(), random.signed() + 1.5);
        let positions = (0..vertices).map(|_| vector()).collect();
        let normals = (0..vertices).map(|_| vector().normalize()).collect();
        let joints = (0..vertices * influences).map(|_| random.below(7) as u16).collect();
        Case { carriers, stretched: stretched || mirrored, influences, joints, weights, positions, normals }
    }

    fn run(&self, level: Level) -> (Vec<Vec3>, Vec<Vec3>) {
        let motions: Vec<DualQuaternion> = self.carriers.iter().map(DualQuaternion::from).collect();
        let stretches: Vec<Affine3A> = self.carriers.iter().map(stretch_matrix).collect();
        let mut out_positions = vec![Vec3::NAN; self.positions.len()];
        let mut out_normals = vec![Vec3::NAN; self.normals.len()];
        let mut job = DualQuaternionSkinning {
            motions: &motions,
            stretches: if self.stretched { &stretches } else { &[] },
            influences: self.influences,
            joint_indices: &self.joints,
            joint_weights: &self.weights,
            positions: &self.positions,
            normals: &self.normals,
            out_positions: &mut out_positions,
            out_normals: &mut out_normals,
        };
        job.check().unwrap();
        job.run_on(level);
        (out_positions, out_normals)
    }

    /// Worst distance from f64.
    fn error(&self, positions: &[Vec3], normals: &[Vec3]) -> f64 {
        let mut worst = 0.0f64;
        for vertex in 0..self.positions.len() {
            let range = vertex * self.influences..(vertex + 1) * self.influences;
            let influences = self.joints[range.clone()].iter().zip(&self.weights[range]);
            let influences = influences.map(|(j, w)| (&self.carriers[usize::from(*j)], f64::from(*w)));
            let map = StretchedDualQuaternion::blend(influences);
            let position = map.transform_point3(self.positions[vertex].as_dvec3());
            worst = worst.max(position.distance(positions[vertex].as_dvec3()));
            let inverse: DMat3 = map.matrix3.inverse().transpose();
            let normal = (inverse * self.normals[vertex].as_dvec3()).normalize();
            worst = worst.max(normal.distance(normals[vertex].as_dvec3()));
        }
        worst
    }
}

#[test]
fn dual_quaternions_follow_f64_with_the_same_bits_at_any_level() {
    let mut random = Random(31);
    for influences in [1, 2, 3, 4, 8] {
        for (stretched, mirrored) in [(false, false), (true, false), (false, true), (true, true)] {
            for vertices in [1, 7, 8, 16, 41] {
                let case = Case::random(&mut random, vertices, influences, stretched, mirrored);
                let (positions, normals) = case.run(Level::best());
                let error = case.error(&positions, &normals);
                assert!(error < 2e-5, "{influences} influences, {stretched} {mirrored}: {error}");
                let bits =
                    |v: &[Vec3]| v.iter().flat_map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>();
                for level in [Level::Portable, Level::Avx2, Level::Avx512] {
                    let other = case.run(level);
                    assert_eq!(bits(&other.0), bits(&positions), "{level:?}");
                    assert_eq!(bits(&other.1), bits(&normals), "{level:?}");
                }
            }
        }
    }
}

#[test]
fn the_comparison_sees_a_planted_fault() {
    let case = Case::random(&mut Random(2), 20, 4, true, false);
    let (mut positions, normals) = case.run(Level::best());
    positions[13].x += 1e-3;
    assert!(case.error(&positions, &normals) > 9e-4);
}

/// Lists of influences in another order, and those that weigh nothing, change nothing but rounding.
#[test]
fn the_order_of_influences_does_not_matter() {
    let mut case = Case::random(&mut Random(8), 64, 4, false, false);
    case.weights.chunks_mut(4).for_each(|w| {
        w[2] += w[3];
        w[3] = 0.0;
    });
    let (positions, _) = case.run(Level::best());
    case.joints.chunks_mut(4).for_each(|j| j.reverse());
    case.weights.chunks_mut(4).for_each(|w| w.reverse());
    let (reversed, _) = case.run(Level::best());
    for (a, b) in positions.iter().zip(&reversed) {
        assert!(a.distance(*b) < 1e-5, "{a} {b}");
    }
}

#[test]
fn vertices_without_weight_stay_and_bad_input_is_named() {
    let mut case = Case::random(&mut Random(3), 9, 4, false, false);
    case.weights.fill(0.0);
    let (positions, normals) = case.run(Level::best());
    assert_eq!(positions, case.positions);
    assert!(normals.iter().all(|n| n.is_finite()));
    let mut out = [Vec3::ZERO];
    let job = DualQuaternionSkinning {
        motions: &[DualQuaternion::IDENTITY],
        stretches: &[],
        influences: 1,
        joint_indices: &[1],
        joint_weights: &[1.0],
        positions: &[Vec3::ONE],
        normals: &[],
        out_positions: &mut out,
        out_normals: &mut [],
    };
    assert_eq!(job.check().unwrap_err().to_string(), "`joint_indices[0]` is 1, there are 1 joints");
}
