//! Dual-quaternion skinning is compared with the same formulas in f64, which unit tests compare with closed forms.

use crate::support::Random;
use crate::support::skinned_mesh::SkinnedMesh;
use choreo_motion::{DualQuaternion, DualQuaternionSkinning, Level, StretchedDualQuaternion, stretch_matrix};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Vec3};

struct DualSkinningCase {
    maps: Vec<StretchedDualQuaternion>,
    stretched: bool,
    mesh: SkinnedMesh,
}

impl DualSkinningCase {
    fn random(
        random: &mut Random,
        vertices: usize,
        influences: usize,
        stretched: bool,
        mirrored: bool,
    ) -> DualSkinningCase {
        let maps = (0..7)
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
        let mesh = SkinnedMesh::random(random, vertices, influences);
        DualSkinningCase { maps, stretched: stretched || mirrored, mesh }
    }

    fn run(&self, level: Level) -> (Vec<Vec3>, Vec<Vec3>) {
        let motions: Vec<DualQuaternion> = self.maps.iter().map(DualQuaternion::from).collect();
        let stretches: Vec<Affine3A> = self.maps.iter().map(stretch_matrix).collect();
        let mesh = &self.mesh;
        mesh.skinned(|out_positions, out_normals| {
            let mut job = DualQuaternionSkinning {
                motions: &motions,
                stretches: if self.stretched { &stretches } else { &[] },
                influences: mesh.influences,
                joint_indices: &mesh.joints,
                joint_weights: &mesh.weights,
                positions: &mesh.positions,
                normals: &mesh.normals,
                out_positions,
                out_normals,
            };
            job.check().unwrap();
            job.run_on(level);
        })
    }

    /// Worst distance from f64.
    fn error(&self, positions: &[Vec3], normals: &[Vec3]) -> f64 {
        self.mesh.error(positions, normals, |joints| {
            let influences = joints.iter().map(|(joint, weight)| (&self.maps[*joint], *weight));
            StretchedDualQuaternion::blend(influences)
        })
    }
}

#[test]
fn dual_quaternion_skinning_matches_f64_with_the_same_bits_at_any_level() {
    let mut random = Random(31);
    for influences in [1, 2, 3, 4, 8] {
        for (stretched, mirrored) in [(false, false), (true, false), (false, true), (true, true)] {
            for vertices in [1, 7, 8, 16, 41] {
                let case = DualSkinningCase::random(&mut random, vertices, influences, stretched, mirrored);
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
fn the_comparison_with_f64_detects_a_planted_error() {
    let case = DualSkinningCase::random(&mut Random(2), 20, 4, true, false);
    let (mut positions, normals) = case.run(Level::best());
    positions[13].x += 1e-3;
    assert!(case.error(&positions, &normals) > 9e-4);
}

/// The order of influences, and influences of weight 0, change the result by rounding only.
#[test]
fn dual_quaternion_skinning_ignores_the_order_of_influences() {
    let mut case = DualSkinningCase::random(&mut Random(8), 64, 4, false, false);
    case.mesh.weights.chunks_mut(4).for_each(|w| {
        w[2] += w[3];
        w[3] = 0.0;
    });
    let (positions, _) = case.run(Level::best());
    case.mesh.joints.chunks_mut(4).for_each(|j| j.reverse());
    case.mesh.weights.chunks_mut(4).for_each(|w| w.reverse());
    let (reversed, _) = case.run(Level::best());
    for (a, b) in positions.iter().zip(&reversed) {
        assert!(a.distance(*b) < 1e-5, "{a} {b}");
    }
}

#[test]
fn vertices_without_weight_stay_and_checks_name_the_invalid_field() {
    let mut case = DualSkinningCase::random(&mut Random(3), 9, 4, false, false);
    case.mesh.weights.fill(0.0);
    let (positions, normals) = case.run(Level::best());
    assert_eq!(positions, case.mesh.positions);
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
    assert_eq!(job.check().unwrap_err().to_string(), "`joint_indices[0]` is 1, the number of joints is 1");
}
