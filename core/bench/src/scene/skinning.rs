//! Linear or dual-quaternion skinning: how much they differ on this scene's characters, and what each costs.

use super::vertices::model_from_mesh;
use super::{MeasuredScene, SceneChoices};
use crate::picture::Moment;
use crate::plots::{Choice, Row};
use crate::timing::{Case, Clock, interleaved};
use crate::truth::Spread;
use choreo_asset::Primitive;
use choreo_motion::{
    DualQuaternion, DualQuaternionSkinning, LinearSkinning, Skinning, StretchedDualQuaternion, stretch_matrix,
};
use glam::{Affine3A, DAffine3, Mat3A, Vec3A};

const NAMES: [&str; 2] = ["linear", "dual quaternions"];

/// One skinned primitive as one actor holds it.
struct Posed<'a> {
    primitive: &'a Primitive,
    place: String,
    matrices: Vec<Affine3A>,
    motions: Vec<DualQuaternion>,
    /// Empty where nothing is scaled.
    stretches: Vec<Affine3A>,
}

pub fn choices(scene: &MeasuredScene, moment: &Moment) -> SceneChoices {
    let posed = posed(scene, moment);
    let vertices: usize = posed.iter().map(|p| p.primitive.positions.len()).sum();
    if vertices == 0 {
        return SceneChoices::None("no mesh on stage has a skin".into());
    }
    let mut choice =
        Choice::new("skinning", "Do vertices follow their joints linearly, or by dual quaternions?");
    choice.error_unit = "mm";
    choice.reference =
        "linear blending, as glTF has it: how far vertices are from there, on this frame".into();
    choice.per = format!("vertex of {vertices}, on the CPU");
    let mut apart = Spread::default();
    let mut place = String::new();
    for p in &posed {
        let [linear, dual] = [Skinning::Linear, Skinning::DualQuaternion].map(|how| p.skinned(how));
        for (v, (a, b)) in linear.iter().zip(&dual).enumerate() {
            if apart.add((a.as_dvec3() - b.as_dvec3()).length() * 1e3) {
                place = format!("{}, vertex {v}", p.place);
            }
        }
    }
    let timed = |how: Skinning| {
        let posed = &posed;
        Case::new(vertices, move || posed.iter().for_each(|p| _ = std::hint::black_box(p.skinned(how))))
    };
    let mut cases = [timed(Skinning::Linear), timed(Skinning::DualQuaternion)];
    let nanos = interleaved(Clock::Thread, scene.budget_secs, &mut cases);
    choice.rows.push(Row::new(NAMES[0]).error(0.0, 0.0).nanos(nanos[0]));
    choice.rows.push(Row::new(NAMES[1]).error(apart.worst, apart.mean()).nanos(nanos[1]).at(place));
    let dual = scene.stage.actors.iter().any(|a| a.skinning == Skinning::DualQuaternion);
    match dual {
        true => choice.choose(NAMES[1], "what the script asks for, for some actor at least"),
        false => choice.choose(
            NAMES[0],
            "as glTF has it; .skinning(\"dual_quaternion\") keeps the girth of twisted limbs",
        ),
    }
    SceneChoices::Choices(vec![choice])
}

fn posed<'a>(scene: &'a MeasuredScene, moment: &Moment) -> Vec<Posed<'a>> {
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
                out.push(Posed {
                    primitive,
                    place: format!("{}, mesh \"{}\"", actor.name, mesh.name),
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

impl Posed<'_> {
    /// Positions in the model.
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
