//! The choice between linear and dual-quaternion skinning: their difference on this scene's characters, and their costs.

use super::vertices::model_from_mesh;
use super::{MeasuredScene, SceneChoices};
use crate::moment::Moment;
use crate::plots::{Choice, Row, quantity};
use crate::reference::ErrorStats;
use crate::skins::{self, PolarParts};
use crate::timing::{Case, Clock, interleaved};
use choreo_asset::Primitive;
use choreo_motion::{
    DualQuaternion, DualQuaternionSkinning, LinearSkinning, Skinning, StretchedDualQuaternion, stretch_matrix,
};
use glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec3A};

const NAMES: [&str; 2] = ["linear", "dual quaternions"];

/// One skinned primitive in the pose of one actor.
struct PosedPrimitive<'a> {
    primitive: &'a Primitive,
    place: String,
    maps: Vec<DAffine3>,
    matrices: Vec<Affine3A>,
    motions: Vec<DualQuaternion>,
    /// Stretch of each joint; empty if no joint is scaled.
    stretches: Vec<Affine3A>,
}

pub fn choices(scene: &MeasuredScene, moment: &Moment) -> SceneChoices {
    let posed = posed(scene, moment);
    let vertices: usize = posed.iter().map(|p| p.primitive.positions.len()).sum();
    if vertices == 0 {
        return SceneChoices::None("no mesh on stage has a skin".into());
    }
    let mut choice = Choice::new("skinning", "Are meshes skinned by linear blending or by dual quaternions?");
    choice.error_unit = "mm";
    choice.reference = "the mean stretch and then the mean rigid motion of a vertex's joints, a separate \
        implementation in f64 that keeps the volume of limbs; on this frame"
        .into();
    choice.per = format!("vertex of {vertices}, on the CPU");
    let (mut errors, mut rounding) = ([ErrorStats::default(); 2], [ErrorStats::default(); 2]);
    let mut places = [String::new(), String::new()];
    for p in &posed {
        let [mean, linear, dual] = p.exact();
        for (method, how) in [Skinning::Linear, Skinning::DualQuaternion].into_iter().enumerate() {
            let formula = if method == 0 { &linear } else { &dual };
            for (v, skinned) in p.skinned(how).iter().enumerate() {
                let off = |exact: &[DVec3]| (skinned.as_dvec3() - exact[v]).length() * 1e3;
                rounding[method].add(off(formula));
                if errors[method].add(off(&mean)) {
                    places[method] = format!("{}, vertex {v}", p.place);
                }
            }
        }
    }
    let timed = |how: Skinning| {
        let posed = &posed;
        Case::new(vertices, move || posed.iter().for_each(|p| _ = std::hint::black_box(p.skinned(how))))
    };
    let mut cases = [timed(Skinning::Linear), timed(Skinning::DualQuaternion)];
    let nanos = interleaved(Clock::Thread, scene.budget_secs, &mut cases);
    for (method, (error, place)) in errors.iter().zip(places).enumerate() {
        let note = format!("{} mm off the same formula in f64", quantity(rounding[method].worst));
        let row = Row::new(NAMES[method]).error(error.worst, error.mean()).nanos(nanos[method]).at(place);
        choice.rows.push(row.note(note));
    }
    let dual = scene.stage.actors.iter().any(|a| a.skinning == Skinning::DualQuaternion);
    match dual {
        true => choice.choose(NAMES[1], "requested by the script for at least one actor"),
        false => choice.choose(
            NAMES[0],
            "as glTF has it; .skinning(\"dual_quaternion\") keeps the volume of twisted limbs",
        ),
    }
    SceneChoices::Choices(vec![choice])
}

fn posed<'a>(scene: &'a MeasuredScene, moment: &Moment) -> Vec<PosedPrimitive<'a>> {
    let mut out = Vec::new();
    for (actor, state) in scene.stage.actors.iter().zip(&moment.snapshot.actors) {
        let asset = &actor.asset;
        if state.model_from_joint.is_empty() {
            continue;
        }
        for instance in &asset.instances {
            let skin = instance.skin.and_then(|s| asset.skins.get(s as usize));
            let (Some(skin), Some(mesh)) = (skin, asset.meshes.get(instance.mesh as usize)) else { continue };
            let maps = model_from_mesh(skin, &state.model_from_joint);
            let carriers: Vec<StretchedDualQuaternion> =
                maps.iter().map(|m| StretchedDualQuaternion::of(*m)).collect();
            let scaled = carriers.iter().any(|c| !c.stretch.abs_diff_eq(glam::DMat3::IDENTITY, 1e-6));
            for primitive in mesh
                .primitives
                .iter()
                .filter(|p| p.influences > 0 && p.joint_indices.iter().all(|j| usize::from(*j) < maps.len()))
            {
                out.push(PosedPrimitive {
                    primitive,
                    place: format!("{}, mesh \"{}\"", actor.name, mesh.name),
                    maps: maps.clone(),
                    matrices: maps.iter().map(narrow).collect(),
                    motions: carriers.iter().map(DualQuaternion::from).collect(),
                    stretches: if scaled {
                        carriers.iter().map(stretch_matrix).collect()
                    } else {
                        Vec::new()
                    },
                });
            }
        }
    }
    out
}

fn narrow(map: &DAffine3) -> Affine3A {
    let translation = Vec3A::from(map.translation.as_vec3());
    Affine3A { matrix3: Mat3A::from(map.matrix3.as_mat3()), translation }
}

impl PosedPrimitive<'_> {
    /// Exact positions in model space: by the mean motion, by linear blend skinning, and by dual quaternions.
    fn exact(&self) -> [Vec<DVec3>; 3] {
        let p = self.primitive;
        let parts: Vec<PolarParts> = self.maps.iter().map(PolarParts::of).collect();
        let mut out = [Vec::new(), Vec::new(), Vec::new()];
        let all = p.joint_indices.chunks(p.influences).zip(p.joint_weights.chunks(p.influences));
        for (position, (joints, weights)) in p.positions.iter().zip(all) {
            let influence = |(joint, weight): (&u16, &f32)| (usize::from(*joint), f64::from(*weight));
            let influences: Vec<(usize, f64)> = joints.iter().zip(weights).map(influence).collect();
            let point = position.as_dvec3();
            out[0].push(skins::mean_motion(&parts, &influences, point));
            out[1].push(skins::linear(&self.maps, &influences, point));
            out[2].push(skins::dual(&parts, &influences, point));
        }
        out
    }

    /// Positions in model space, as the program skins them.
    fn skinned(&self, how: Skinning) -> Vec<glam::Vec3> {
        let p = self.primitive;
        let (mut positions, mut normals) = (p.positions.clone(), p.normals.clone());
        match how {
            Skinning::Linear => LinearSkinning {
                matrices: &self.matrices,
                influences: p.influences,
                joint_indices: &p.joint_indices,
                joint_weights: &p.joint_weights,
                positions: &p.positions,
                normals: &p.normals,
                out_positions: &mut positions,
                out_normals: &mut normals,
            }
            .run(),
            Skinning::DualQuaternion => DualQuaternionSkinning {
                motions: &self.motions,
                stretches: &self.stretches,
                influences: p.influences,
                joint_indices: &p.joint_indices,
                joint_weights: &p.joint_weights,
                positions: &p.positions,
                normals: &p.normals,
                out_positions: &mut positions,
                out_normals: &mut normals,
            }
            .run(),
        }
        positions
    }
}
