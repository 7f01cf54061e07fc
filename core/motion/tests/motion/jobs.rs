//! Blend, crossfade, local-to-model, skinning and morphing are compared with closed forms, with f64 and between SIMD levels.

use crate::support::skinned_mesh::SkinnedMesh;
use crate::support::*;
use choreo_motion::{
    Blend, BlendOnto, Clip, Crossfade, InputError, Interpolation, Level, LinearSkinning, LocalToModel, Morph,
    Path, Pose, RotationBlend, Sample, Skeleton, SkinMatrices, Time, Transform,
};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Mat4, Quat, Vec3};
use proptest::prelude::*;
use std::sync::Arc;

fn random_pose(random: &mut Random, joints: usize) -> Pose {
    let mut pose = Pose::identity(joints);
    for joint in 0..joints {
        let mut vector = || Vec3::new(random.signed(), random.signed(), random.signed());
        let (translation, scale) = (vector(), vector());
        let rotation = Quat::from_array(random.rotation());
        pose.set(joint, Transform { translation, rotation, scale });
    }
    pose
}

fn blend(from: &Pose, to: &Pose, weight: f32, mask: Option<&[f32]>) -> Pose {
    let mut out = Pose::default();
    let mut job = Blend { from, to, weight, mask, out: &mut out };
    job.check().unwrap();
    job.run();
    out
}

fn model_matrices(skeleton: &Skeleton, pose: &Pose, level: Level) -> Vec<Affine3A> {
    let mut out = vec![Affine3A::IDENTITY; skeleton.len()];
    let mut job = LocalToModel { skeleton, pose, model_from_joint: &mut out };
    job.check().unwrap();
    job.run_on(level);
    out
}

fn bits(matrices: &[Affine3A]) -> Vec<u32> {
    matrices.iter().flat_map(|m| m.to_cols_array()).map(f32::to_bits).collect()
}

/// Worst difference of any matrix element from f64.
fn model_error(skeleton: &Skeleton, pose: &Pose, got: &[Affine3A]) -> f64 {
    let locals: Vec<(DVec3, DQuat, DVec3)> = pose
        .iter()
        .map(|t| (t.translation.as_dvec3(), t.rotation.as_dquat().normalize(), t.scale.as_dvec3()))
        .collect();
    let wanted = model64(skeleton, &locals);
    let pairs = got.iter().zip(&wanted);
    let errors = pairs.flat_map(|(g, w)| {
        g.to_cols_array().into_iter().zip(w.to_cols_array()).map(|(g, w)| (f64::from(g) - w).abs())
    });
    errors.fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn blending_equals_f64(seed: u64, joints in 1usize..40, weight in 0.0f32..=1.0) {
        let mut random = Random(seed);
        let (a, b) = (random_pose(&mut random, joints), random_pose(&mut random, joints));
        let mask: Vec<f32> = (0..joints).map(|_| (random.signed() + 1.0) / 2.0).collect();
        let out = blend(&a, &b, weight, Some(&mask));
        for (joint, masked) in mask.iter().enumerate() {
            let w = f64::from(weight * masked);
            let (a, b, out) = (a.get(joint), b.get(joint), out.get(joint));
            let near = |got: Vec3, a: Vec3, b: Vec3| got.as_dvec3().distance(a.as_dvec3().lerp(b.as_dvec3(), w)) < 1e-6;
            prop_assert!(near(out.translation, a.translation, b.translation));
            prop_assert!(near(out.scale, a.scale, b.scale));
            let (p, q) = (a.rotation.as_dquat(), b.rotation.as_dquat());
            let q = if p.dot(q) < 0.0 { -q } else { q };
// The tolerance is the error of corrected nlerp against slerp.
            let wanted = slerp(p.to_array(), q.to_array(), w);
            prop_assert!(degrees_between(quat64(out.rotation), wanted) < 0.046);
        }
    }

    #[test]
    fn local_to_model_equals_f64(seed: u64, joints in 0usize..60) {
        let mut random = Random(seed);
        let skeleton = skeleton(joints, Some(&mut random));
        let pose = random_pose(&mut random, joints);
        let out = model_matrices(&skeleton, &pose, Level::best());
        prop_assert!(model_error(&skeleton, &pose, &out) < 2e-5);
        prop_assert_eq!(bits(&out), bits(&model_matrices(&skeleton, &pose, Level::Portable)));
        if joints > 1 {
            let mut broken = out.clone();
            broken[joints - 1].translation.y += 1e-4;
            prop_assert!(model_error(&skeleton, &pose, &broken) > 5e-5, "a planted fault is not seen");
        }
    }

    #[test]
    fn crossfade_equals_sampling_blending_and_local_to_model(seed: u64, joints in 1usize..40, weight in 0.0f32..=1.0, scaled: bool) {
        let mut random = Random(seed);
        let skeleton = skeleton(joints, Some(&mut random));
        let clips = [0, 1].map(|_| random_clip(&mut random, joints, scaled));
        let times = [0, 1].map(|_| Time(random.below(30_000_000) as i64));
        let rest = Pose::rest(&skeleton);
        let poses = [0, 1].map(|i| {
            let mut pose = rest.clone();
            Sample { clip: &clips[i], time: times[i], pose: &mut pose }.run();
            pose
        });
        let parts = model_matrices(&skeleton, &blend(&poses[0], &poses[1], weight, None), Level::best());
        let fused = |level, weight| {
            let mut out = vec![Affine3A::IDENTITY; joints];
            let mut scratch = [Pose::identity(joints), random_pose(&mut Random(1), joints)];
            let mut job = Crossfade {
                skeleton: &skeleton, rest: &rest, from: &clips[0], from_time: times[0], to: &clips[1],
                to_time: times[1], weight, scratch: &mut scratch, model_from_joint: &mut out,
            };
            job.check().unwrap();
            job.run_on(level);
            out
        };
        let got = fused(Level::Avx2, weight);
        for (got, wanted) in got.iter().zip(&parts) {
            prop_assert!(got.abs_diff_eq(*wanted, 1e-5), "{got} {wanted}");
        }
        prop_assert_eq!(bits(&got), bits(&fused(Level::Portable, weight)));
        for end in [0, 1] {
            let alone = model_matrices(&skeleton, &poses[end], Level::best());
            prop_assert_eq!(bits(&fused(Level::best(), end as f32)), bits(&alone));
        }
    }

    #[test]
    fn skinning_equals_f64(seed: u64, vertices in 0usize..40, influences in 0usize..9) {
        let case = SkinningCase::random(&mut Random(seed), vertices, influences, false);
        let (positions, normals) = case.run(Level::best());
        prop_assert!(case.error(&positions, &normals) < 3e-5, "{}", case.error(&positions, &normals));
        let best = (positions, normals);
        for level in [Level::Portable, Level::Avx2, Level::Avx512] {
            prop_assert_eq!(&case.run(level), &best, "{:?}", level);
        }
    }
}

/// A random clip whose joints have some of rotation, translation and, if `scaled`, scale.
fn random_clip(random: &mut Random, joints: usize, scaled: bool) -> Clip {
    let times: Arc<[Time]> = (0..2).map(|i| Time(i * 23_520_000)).collect();
    let mut curves = Vec::new();
    for joint in 0..joints as u32 {
        for path in [Path::Rotation, Path::Translation, Path::Scale] {
            if random.below(4) > 0 && (scaled || path != Path::Scale) {
                curves.push(random_curve(random, joint, path, Interpolation::Linear, times.clone()));
            }
        }
    }
    Clip::new("some".into(), joints, curves).unwrap()
}

struct SkinningCase {
    matrices: Vec<Affine3A>,
    mesh: SkinnedMesh,
}

impl SkinningCase {
    fn random(random: &mut Random, vertices: usize, influences: usize, mirrored: bool) -> SkinningCase {
        let matrices = (0..7)
            .map(|_| {
                let scale = Vec3::new(if mirrored { -1.0 } else { 1.0 }, 1.5, 0.7);
                // Similar rotations, as of joints of a bend: opposite rotations would cancel each other.
                let turn =
                    Quat::from_array([0.3, 0.2, 0.1, 1.0].map(|c| c + 0.2 * random.signed())).normalize();
                Affine3A::from_scale_rotation_translation(scale, turn, Vec3::splat(random.signed()))
            })
            .collect();
        SkinningCase { matrices, mesh: SkinnedMesh::random(random, vertices, influences) }
    }

    fn run(&self, level: Level) -> (Vec<Vec3>, Vec<Vec3>) {
        let mesh = &self.mesh;
        mesh.skinned(|out_positions, out_normals| {
            let mut job = LinearSkinning {
                matrices: &self.matrices,
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

    /// Worst distance from f64: Σ w M p, and the inverse transpose of Σ w M for normals.
    fn error(&self, positions: &[Vec3], normals: &[Vec3]) -> f64 {
        self.mesh.error(positions, normals, |joints| {
            let matrices = joints.iter().map(|(j, w)| Mat4::from(self.matrices[*j]).as_dmat4() * *w);
            DAffine3::from_mat4(matrices.sum())
        })
    }
}

#[test]
fn the_skinning_comparison_detects_a_planted_error() {
    let case = SkinningCase::random(&mut Random(2), 20, 4, false);
    let (mut positions, normals) = case.run(Level::best());
    positions[13].x += 1e-3;
    assert!(case.error(&positions, &normals) > 9e-4);
}

#[test]
fn skinning_with_mirrored_joints_keeps_normals_outward() {
    let case = SkinningCase::random(&mut Random(4), 20, 4, true);
    let (positions, normals) = case.run(Level::best());
    assert!(case.error(&positions, &normals) < 3e-5);
}

#[test]
fn skinning_with_scale_zero_keeps_the_normal() {
    let mut case = SkinningCase::random(&mut Random(4), 9, 4, false);
    case.matrices.fill(Affine3A::from_scale(Vec3::ZERO));
    let (positions, normals) = case.run(Level::best());
    assert!(positions.iter().all(|p| *p == Vec3::ZERO));
    assert_eq!(normals, case.mesh.normals);
}

#[test]
fn blend_weights_zero_and_one_return_the_inputs_bit_for_bit() {
    let mut random = Random(8);
    let (a, b) = (random_pose(&mut random, 13), random_pose(&mut random, 13));
    assert_eq!(blend(&a, &b, 0.0, None), a);
    assert_eq!(blend(&a, &b, 1.0, None), b);
    let mask: Vec<f32> = (0..13).map(|j| (j % 2) as f32).collect();
    let out = blend(&a, &b, 1.0, Some(&mask));
    (0..13).for_each(|j| assert_eq!(out.get(j), if j % 2 == 1 { b.get(j) } else { a.get(j) }));
}

#[test]
fn a_pose_blended_with_itself_is_the_pose() {
    let pose = random_pose(&mut Random(9), 20);
    for step in 0..=10 {
        let out = blend(&pose, &pose, step as f32 / 10.0, None);
        for joint in 0..20 {
            let (got, wanted) = (out.get(joint), pose.get(joint));
            assert_eq!((got.translation, got.scale), (wanted.translation, wanted.scale));
            assert!(got.rotation.abs_diff_eq(wanted.rotation, 1.2e-7), "{got:?} {wanted:?}");
        }
    }
}

#[test]
fn antipodal_and_opposite_rotations_stay_finite() {
    let q = Quat::from_xyzw(0.5, -0.5, 0.5, 0.5);
    for other in [-q, q * Quat::from_xyzw(1.0, 0.0, 0.0, 0.0), q * Quat::from_xyzw(-1.0, 0.0, 0.0, 1e-7)] {
        let (mut a, mut b) = (Pose::identity(1), Pose::identity(1));
        a.set(0, Transform { rotation: q, ..Transform::IDENTITY });
        b.set(0, Transform { rotation: other, ..Transform::IDENTITY });
        for step in 0..=32 {
            let rotation = blend(&a, &b, step as f32 / 32.0, None).get(0).rotation;
            assert!((rotation.length() - 1.0).abs() < 1e-6, "{rotation}");
            if other == -q {
                assert!(degrees_between(quat64(rotation), quat64(q)) < 1e-4);
            }
        }
    }
}

/// The figures in the documentation of the blend module: each method within its limit, and not far within it.
#[test]
fn errors_of_rotation_blends_against_slerp_are_within_the_documented_limits() {
    let limits = [
        (RotationBlend::Nlerp, [(20.0f64, 0.011), (45.0, 0.12), (90.0, 0.96), (135.0, 3.4), (180.0, 8.3)]),
        (
            RotationBlend::CorrectedNlerp,
            [(20.0, 0.0018), (45.0, 0.0017), (90.0, 0.005), (135.0, 0.009), (180.0, 0.045)],
        ),
    ];
    for (method, (degrees, limit)) in
        limits.iter().flat_map(|(method, l)| l.iter().map(move |limit| (*method, *limit)))
    {
        let worst = farthest_from_slerp(method, degrees);
        println!("rotations {degrees}° apart: {method:?} is at most {worst:.5}° from slerp");
        assert!(worst < limit && worst > 0.7 * limit, "{method:?} {degrees}: {worst}");
    }
    for degrees in [1.0, 20.0, 90.0, 179.0] {
        let worst = farthest_from_slerp(RotationBlend::Slerp, degrees);
        assert!(worst < 5e-5, "{degrees}: {worst}");
    }
}

/// Largest angle from slerp, degrees, over the weights 0, 0.01 … 1.
fn farthest_from_slerp(method: RotationBlend, degrees: f64) -> f64 {
    let half = (degrees / 2.0).to_radians();
    let b = [half.sin(), 0.0, 0.0, half.cos()];
    let mut to = Pose::identity(1);
    to.set(0, Transform { rotation: Quat::from_array(b.map(|c| c as f32)), ..Transform::IDENTITY });
    let at = |step: u32| {
        let weight = step as f32 / 100.0;
        let mut pose = Pose::identity(1);
        BlendOnto { pose: &mut pose, to: &to, weight, mask: None }.run_as(method);
        degrees_between(quat64(pose.get(0).rotation), slerp([0.0, 0.0, 0.0, 1.0], b, f64::from(weight)))
    };
    (0..=100).map(at).fold(0.0, f64::max)
}

#[test]
fn local_to_model_of_a_chain_of_a_thousand_joints_is_finite_and_accurate() {
    let skeleton = skeleton(1000, None);
    let pose = Pose::rest(&skeleton);
    let out = model_matrices(&skeleton, &pose, Level::best());
    assert!(out.iter().all(|m| m.is_finite()));
    assert!(model_error(&skeleton, &pose, &out) < 1e-2, "of 4 km: {}", model_error(&skeleton, &pose, &out));
    assert_eq!(bits(&out), bits(&model_matrices(&skeleton, &pose, Level::Portable)));
}

#[test]
fn local_to_model_handles_zero_and_mirrored_scales() {
    let skeleton = skeleton(3, None);
    for scale in [Vec3::ZERO, Vec3::new(-1.0, 1.0, 1.0), Vec3::splat(1e-8), Vec3::new(1e8, 1.0, -1e-8)] {
        let mut pose = Pose::rest(&skeleton);
        pose.set(1, Transform { scale, ..pose.get(1) });
        let out = model_matrices(&skeleton, &pose, Level::best());
        assert!(out.iter().all(|m| m.is_finite()));
        assert!(model_error(&skeleton, &pose, &out) < 1e-6 * f64::from(scale.abs().max_element().max(1.0)));
    }
}

#[test]
fn an_empty_skeleton_has_no_matrices_and_no_blend() {
    let skeleton = skeleton(0, None);
    assert!(model_matrices(&skeleton, &Pose::rest(&skeleton), Level::best()).is_empty());
    assert!(blend(&Pose::default(), &Pose::default(), 0.5, None).is_empty());
}

#[test]
fn skin_matrices_are_joint_times_inverse_bind() {
    let joints = [Affine3A::from_translation(Vec3::X), Affine3A::from_rotation_z(1.0)];
    let bind = Mat4::from_rotation_translation(Quat::from_rotation_y(0.5), Vec3::new(0.0, 2.0, 0.0));
    let mut out = [Affine3A::IDENTITY; 2];
    let mut job = SkinMatrices {
        model_from_joint: &joints,
        joints: &[1, 0],
        inverse_bind: &[bind, Mat4::IDENTITY],
        out: &mut out,
    };
    job.check().unwrap();
    job.run();
    assert!(Mat4::from(out[0]).abs_diff_eq(Mat4::from(joints[1]) * bind, 1e-6));
    assert_eq!(out[1], joints[0]);
    // No inverse bind matrices are identities (glTF 2.0 §3.7.3.1).
    SkinMatrices { model_from_joint: &joints, joints: &[1, 0], inverse_bind: &[], out: &mut out }.run();
    assert_eq!(out, [joints[1], joints[0]]);
}

#[test]
fn morphing_adds_weighted_offsets() {
    let mut values = [Vec3::ONE, Vec3::ZERO];
    let targets: [&[Vec3]; 3] = [&[Vec3::X, Vec3::Y], &[], &[Vec3::Z, Vec3::Z]];
    let mut job = Morph { targets: &targets, weights: &[0.5, 3.0, -1.0], values: &mut values };
    job.check().unwrap();
    job.run();
    assert_eq!(values, [Vec3::new(1.5, 1.0, 0.0), Vec3::new(0.0, 0.5, -1.0)]);
}

#[test]
fn checks_name_the_invalid_field() {
    let (a, b) = (Pose::identity(2), Pose::identity(3));
    let mut out = Pose::default();
    let mut onto = Pose::identity(2);
    let error_text = |r: Result<(), InputError>| r.unwrap_err().to_string();
    let mut check =
        |to, weight, mask| error_text(Blend { from: &a, to, weight, mask, out: &mut out }.check());
    assert_eq!(check(&a, f32::NAN, None), "`Blend.weight` is NaN, must be 0..=1");
    assert_eq!(check(&a, -0.5, None), "`Blend.weight` is -0.5, must be 0..=1");
    assert_eq!(check(&b, 0.5, None), "`Blend.to` has length 3, must have length 2");
    assert_eq!(check(&a, 0.5, Some(&[0.5, f32::NAN])), "`Blend.mask[1]` is NaN, must be 0..=1");
    assert_eq!(check(&a, 0.5, Some(&[0.5])), "`Blend.mask` has length 1, must have length 2");
    let job = BlendOnto { pose: &mut onto, to: &a, weight: 2.0, mask: None };
    assert_eq!(error_text(job.check()), "`BlendOnto.weight` is 2, must be 0..=1");
    let skeleton = skeleton(2, None);
    let mut matrices = [Affine3A::IDENTITY; 2];
    let job = LocalToModel { skeleton: &skeleton, pose: &b, model_from_joint: &mut matrices };
    assert_eq!(error_text(job.check()), "`LocalToModel.pose` has length 3, must have length 2");
    let job = LocalToModel { skeleton: &skeleton, pose: &a, model_from_joint: &mut matrices[..1] };
    assert_eq!(error_text(job.check()), "`LocalToModel.model_from_joint` has length 1, must have length 2");
    let job =
        SkinMatrices { model_from_joint: &[], joints: &[4], inverse_bind: &[], out: &mut matrices[..1] };
    assert_eq!(error_text(job.check()), "`SkinMatrices.joints[0]` is 4, the number of joints is 0");
    let mut values = [Vec3::ZERO];
    let job = Morph { targets: &[&[]], weights: &[f32::INFINITY], values: &mut values };
    assert_eq!(error_text(job.check()), "`Morph.weights[0]` is inf, must be finite");
    let mut case = SkinningCase::random(&mut Random(1), 2, 4, false);
    case.mesh.joints[5] = 99;
    let (mut p, mut n) = (case.mesh.positions.clone(), case.mesh.normals.clone());
    let job = LinearSkinning {
        matrices: &case.matrices,
        influences: 4,
        joint_indices: &case.mesh.joints,
        joint_weights: &case.mesh.weights,
        positions: &case.mesh.positions,
        normals: &case.mesh.normals,
        out_positions: &mut p,
        out_normals: &mut n,
    };
    assert_eq!(error_text(job.check()), "`joint_indices[5]` is 99, the number of joints is 7");
}
