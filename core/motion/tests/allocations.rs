//! Jobs allocate nothing after a clip has been sampled for the first time: counted by the allocator itself.

#[path = "support/counting.rs"]
mod counting;

use choreo_motion::*;
use counting::allocations;
use glam::{Affine3A, Quat, Vec3};

#[test]
fn jobs_allocate_nothing_after_the_first_frame() {
    const JOINTS: usize = 20;
    let parents = (0..JOINTS as u32).map(|j| j.checked_sub(1)).collect();
    let arm = Transform { translation: Vec3::Y * 0.1, ..Transform::IDENTITY };
    let skeleton =
        Skeleton::new((0..JOINTS).map(|j| format!("{j}")).collect(), parents, vec![arm; JOINTS]).unwrap();
    let times: std::sync::Arc<[Time]> = (0..60).map(|f| FrameRate { num: 30, den: 1 }.time_of(f)).collect();
    let curve = |joint: u32| Curve {
        joint,
        path: Path::Rotation,
        interpolation: Interpolation::Linear,
        times: times.clone(),
        values: (0..60).flat_map(|f| Quat::from_rotation_x(libm::sinf(f as f32 * 0.1)).to_array()).collect(),
    };
    let clip = Clip::new("clip".into(), JOINTS, (0..JOINTS as u32).map(curve).collect()).unwrap();
    let (small, _) = clip.compressed(&skeleton, 1e-4).unwrap();
    assert!(small.is_compressed());
    let rest = Pose::rest(&skeleton);
    let (mut pose, mut blended, mut scratch) = (rest.clone(), rest.clone(), [rest.clone(), rest.clone()]);
    let mut matrices = vec![Affine3A::IDENTITY; JOINTS];
    let positions = vec![Vec3::ONE; 100];
    let (indices, weights) = (vec![3u16; 400], vec![0.25; 400]);
    let (mut out, mut normals) = (positions.clone(), positions.clone());
    let motions = vec![DualQuaternion::IDENTITY; JOINTS];
    let mut frame = |time: Time| {
        for clip in [&clip, &small] {
            Sample { clip, time, pose: &mut pose }.run();
            Blend { from: &rest, to: &pose, weight: 0.3, mask: None, out: &mut blended }.run();
            Crossfade {
                skeleton: &skeleton,
                rest: &rest,
                from: clip,
                from_time: time,
                to: &small,
                to_time: Time(time.0 / 2),
                weight: 0.4,
                scratch: &mut scratch,
                model_from_joint: &mut matrices,
            }
            .run();
            LocalToModel { skeleton: &skeleton, pose: &blended, model_from_joint: &mut matrices }.run();
        }
        LinearSkinning {
            matrices: &matrices,
            influences: 4,
            joint_indices: &indices,
            joint_weights: &weights,
            positions: &positions,
            normals: &positions,
            out_positions: &mut out,
            out_normals: &mut normals,
        }
        .run();
        DualQuaternionSkinning {
            motions: &motions,
            stretches: &[],
            influences: 4,
            joint_indices: &indices,
            joint_weights: &weights,
            positions: &positions,
            normals: &positions,
            out_positions: &mut out,
            out_normals: &mut normals,
        }
        .run();
    };
    frame(Time::ZERO);
    let later = allocations(|| (1..50).for_each(|f| frame(Time(f * 23_520_011))));
    assert_eq!(later, 0);
}
