//! Mirroring: exchanges left and right of a character's joints, morph targets and expressions.

use choreo_asset::{Asset, MeshInstance};
use choreo_motion::skeleton::sides::side_of;
use choreo_motion::{BlendOnto, Clip, Curve, Mirror, MirrorError, MirrorMap, Path, Pose};

/// Sources of a mirrored character: the joint, morph target or expression from which each one takes its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Mirroring {
    /// Source of each joint.
    pub joints: MirrorMap,
    /// Source of each morph weight, by mesh instance and morph target. `smileLeft` takes the weight of `smileRight`, of the same mesh or of
    /// the one on the other side; a target without a side keeps its own weight.
    pub morphs: Vec<Vec<(u32, u32)>>,
    /// Source of each expression's weight, as an index into `Asset::expressions`.
    pub expressions: Vec<u32>,
}

impl Mirroring {
    /// The mirroring of an asset, whose joints are paired by name or position. Fails if no two joints are named as left and right.
    pub fn of(asset: &Asset) -> Result<Mirroring, MirrorError> {
        let joints = MirrorMap::new(&asset.skeleton)?;
        let names = |instance: usize| -> &[String] {
            let mesh = asset.instances.get(instance).and_then(|i| asset.meshes.get(i.mesh as usize));
            mesh.map_or(&[], |mesh| &mesh.morph_names)
        };
        let of_instance = |(own, instance): (usize, &MeshInstance)| {
            let count = asset.meshes.get(instance.mesh as usize).map_or(0, |mesh| mesh.morph_targets);
            let partner = mirrored_instance(asset, &joints, own);
            let target = |target: usize| {
                let name = names(own).get(target).map_or("", String::as_str);
                let wanted = mirrored_name_index(name, names(partner));
                let same = || names(partner).iter().position(|n| n == name).filter(|_| partner != own);
                match wanted.or_else(same) {
                    Some(found) => (partner as u32, found as u32),
                    None => (own as u32, target as u32),
                }
            };
            (0..count).map(target).collect()
        };
        let expression_weights: Vec<String> = asset.expressions.iter().map(|e| e.name.clone()).collect();
        let expressions = expression_weights
            .iter()
            .enumerate()
            .map(|(own, name)| mirrored_name_index(name, &expression_weights).unwrap_or(own) as u32)
            .collect();
        let morphs = asset.instances.iter().enumerate().map(of_instance).collect();
        Ok(Mirroring { joints, morphs, expressions })
    }

    /// A clip of the asset with left and right exchanged, key by key.
    pub fn clip(&self, asset: &Asset, clip: &Clip) -> Clip {
        let mirrored = clip.mirrored(&self.joints);
        if mirrored.curves().iter().all(|c| !matches!(c.path, Path::Weights(_))) {
            return mirrored;
        }
        let curves = mirrored.curves().iter().map(|curve| self.mirrored_weight_curve(asset, curve)).collect();
        mirrored.rekeyed(curves)
    }

    /// A mirrored curve of weights, with its targets in their new order.
    fn mirrored_weight_curve(&self, asset: &Asset, curve: &Curve) -> Curve {
        let Path::Weights(width) = curve.path else { return curve.clone() };
        let own = asset.instances.iter().position(|i| i.joint == curve.joint);
        let Some(sources) = own.and_then(|own| self.morphs.get(own)) else { return curve.clone() };
        let width = width as usize;
        if sources.len() != width || sources.iter().any(|(_, target)| *target as usize >= width) {
            return curve.clone();
        }
        let ordered = |part: &[f32]| sources.iter().map(|(_, t)| part[*t as usize]).collect::<Vec<f32>>();
        let values: Vec<f32> = curve.values.chunks_exact(width.max(1)).flat_map(ordered).collect();
        Curve { values: values.into(), ..curve.clone() }
    }
}

/// Reusable buffers; their previous contents do not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct MirrorScratch {
    pose: Pose,
    weights: Vec<Vec<f32>>,
    expressions: Vec<f32>,
}

impl Mirroring {
    /// Blends a pose, its morph weights and expressions towards their mirror image by `share`, 0..=1.
    pub(crate) fn apply(
        &self,
        share: f32,
        scratch: &mut MirrorScratch,
        pose: &mut Pose,
        morph_weights: &mut [Vec<f32>],
        expressions: &mut [f32],
    ) {
        if pose.len() != self.joints.joint_count() {
            return;
        }
        Mirror { map: &self.joints, from: pose, out: &mut scratch.pose }.run();
        if share >= 1.0 {
            pose.copy_from(&scratch.pose);
        } else {
            BlendOnto { pose, to: &scratch.pose, weight: share, mask: None }.run();
        }
        scratch.weights.resize_with(morph_weights.len(), Vec::new);
        for (before, weights) in scratch.weights.iter_mut().zip(morph_weights.iter()) {
            before.clear();
            before.extend_from_slice(weights);
        }
        for (sources, weights) in self.morphs.iter().zip(morph_weights) {
            for ((instance, target), weight) in sources.iter().zip(weights) {
                let other = scratch.weights.get(*instance as usize).and_then(|w| w.get(*target as usize));
                *weight += (other.copied().unwrap_or(*weight) - *weight) * share;
            }
        }
        scratch.expressions.clear();
        scratch.expressions.extend_from_slice(expressions);
        for (source, weight) in self.expressions.iter().zip(expressions) {
            let other = scratch.expressions.get(*source as usize).copied().unwrap_or(*weight);
            *weight += (other - *weight) * share;
        }
    }
}

/// The mesh instance on the other side: it has the same rank among the instances of the partner joint as `own` has among those of its
/// joint.
fn mirrored_instance(asset: &Asset, joints: &MirrorMap, own: usize) -> usize {
    let Some(instance) = asset.instances.get(own) else { return own };
    let Some(partner) = joints.partner(instance.joint).filter(|p| *p != instance.joint) else { return own };
    let instances_on =
        |joint: u32| (0..asset.instances.len()).filter(move |i| asset.instances[*i].joint == joint);
    let place = instances_on(instance.joint).position(|i| i == own).unwrap_or(0);
    instances_on(partner).nth(place).unwrap_or(own)
}

/// Index of the same name with the other side; `None` if the name has no side or no counterpart.
fn mirrored_name_index(name: &str, names: &[String]) -> Option<usize> {
    let (side, bare) = side_of(name)?;
    names.iter().position(|n| side_of(n).is_some_and(|(s, b)| s == side.other() && b == bare))
}
