//! Curves of a retargeted clip: mapped key by key where that is possible, sampled elsewhere.

use super::frame::RetargetBuffers;
use super::sampler::Sampler;
use super::{Retarget, Translations};
use crate::clip::{Clip, Curve, Interpolation, Path};
use crate::math::rotation::normalize_or_identity;
use crate::skeleton::symmetry::nearest_axes;
use crate::time::Time;
use glam::{DAffine3, DQuat, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Result of retargeting a clip.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RetargetReport {
    /// Target joints whose curves are sampled, rather than mapped key by key.
    pub sampled: Vec<String>,
    /// Number of keys of each sampled curve.
    pub sampled_keys: usize,
    /// Smallest and largest lift of the hips that keeps the feet on the floor, metres.
    pub raised: (f64, f64),
    /// Joints that translate within the character in the source but only rotate in the target, and their largest displacement in
    /// the source, metres.
    pub held: Vec<(String, f64)>,
    /// Whether the source rests on both feet ([`Retarget::rests_standing`]).
    pub rests_standing: bool,
    /// Whether the target rests on both feet ([`Retarget::target_stands`]).
    pub target_stands: bool,
    /// Whether sampling stopped at `MAX_SAMPLED_KEYS` before the tolerance was reached.
    pub coarse: bool,
}

/// Keys that sampling may make for one clip, all curves together.
pub(crate) const MAX_SAMPLED_KEYS: usize = 1 << 22;

/// How a target joint's rotation follows from the source's curves.
enum RotationMapping<'c> {
    /// The clip does not move the joint, whose rotation is constant.
    Still(DQuat),
    /// Each key q becomes before · q · after, or before · q⁻¹ · after if `inverse`.
    Keys { curve: &'c Curve, before: DQuat, after: DQuat, inverse: bool },
    /// Several curves contribute to the rotation.
    Sampled,
}

/// The source's curves by joint.
struct CurvesByJoint<'c> {
    rotations: BTreeMap<u32, &'c Curve>,
    translations: BTreeMap<u32, &'c Curve>,
}

impl Retarget<'_> {
    /// Retargets a clip to the target's skeleton.
    pub fn clip(&self, clip: &Clip) -> (Clip, RetargetReport) {
        let curves_of = |path: Path| {
            let curves = clip.curves().iter().filter(move |c| c.path == path);
            curves.map(|c| (c.joint, c)).collect::<BTreeMap<u32, &Curve>>()
        };
        let curves = CurvesByJoint {
            rotations: curves_of(Path::Rotation),
            translations: curves_of(Path::Translation),
        };
        let mut report = RetargetReport {
            rests_standing: self.rests_standing(),
            target_stands: self.target_stands(),
            ..RetargetReport::default()
        };
        let mut out: Vec<Curve> = Vec::new();
        let mut times: BTreeSet<Time> = BTreeSet::new();
        let mut rotating: Vec<u32> = Vec::new();
        // Joints are visited from the leaves to the root, so that it is known whether any joint below a constant joint moves.
        let mut moves_below = vec![false; self.to.len()];
        for joint in (0..self.to.len() as u32).rev() {
            let Some(rotation) = self.rotation_mapping(joint, &curves) else {
                self.mark_parent_as_moving(joint, &mut moves_below);
                continue;
            };
            let below = moves_below[joint as usize];
            moves_below[joint as usize] |= !matches!(rotation, RotationMapping::Still(_));
            match rotation {
                RotationMapping::Still(turn) => {
                    let rest = normalize_or_identity(self.to.rest()[joint as usize].rotation.as_dquat());
                    // Half the chord is the sine of a quarter of the angle.
                    let chord = (turn - rest).length().min((turn + rest).length());
                    if below && chord > 1e-4 {
                        let values: Arc<[f32]> = turn.to_array().map(|v| v as f32).into();
                        let (path, interpolation) = (Path::Rotation, Interpolation::Linear);
                        out.push(Curve { joint, path, interpolation, times: [Time::ZERO].into(), values });
                    }
                }
                RotationMapping::Keys { curve, before, after, inverse } => {
                    let values = curve.values.chunks_exact(4).flat_map(|q| {
                        let q = DQuat::from_xyzw(q[0].into(), q[1].into(), q[2].into(), q[3].into());
                        let q = before * if inverse { q.conjugate() } else { q } * after;
                        q.to_array().map(|v| v as f32)
                    });
                    out.push(Curve { joint, values: values.collect(), ..curve.clone() });
                }
                RotationMapping::Sampled => {
                    rotating.push(joint);
                    self.add_rotation_times(joint, &curves, &mut times);
                }
            }
            self.mark_parent_as_moving(joint, &mut moves_below);
        }
        let mut translating: Vec<u32> = Vec::new();
        for joint in (0..self.to.len() as u32).filter(|j| self.translates(*j)) {
            if let Some(curve) = self.translation_keys(joint, &curves) {
                out.push(curve);
            } else if self.add_translation_times(joint, &curves, &mut times) {
                translating.push(joint);
            }
        }
        self.add_other_curves(clip, &mut out, &mut report);
        if !rotating.is_empty() || !translating.is_empty() {
            rotating.sort_unstable();
            self.add_sampled_curves(clip, times, &rotating, &translating, &mut out, &mut report);
        }
        out.sort_by_key(|curve| (curve.joint, curve.path));
        (clip.with_curves(self.to.len(), out), report)
    }

    fn mark_parent_as_moving(&self, joint: u32, moves_below: &mut [bool]) {
        if let Some(parent) = self.to.parents()[joint as usize] {
            moves_below[parent as usize] |= moves_below[joint as usize];
        }
    }

    /// The nearest ancestor that follows a source joint, and the rest rotation from it to the joint's parent.
    fn mapped_ancestor(&self, joint: u32) -> (Option<u32>, DQuat) {
        let mut between = DQuat::IDENTITY;
        let mut above = self.to.parents()[joint as usize];
        while let Some(parent) = above {
            if self.map.source(parent).is_some() {
                break;
            }
            between = normalize_or_identity(self.to.rest()[parent as usize].rotation.as_dquat() * between);
            above = self.to.parents()[parent as usize];
        }
        (above, between)
    }

    /// Path between source joints: up from the leader's, then down to the joint's own, without their common ancestor.
    fn joint_path(&self, leader: Option<u32>, source: u32) -> (Vec<u32>, Vec<u32>) {
        let up = |from: Option<u32>| std::iter::successors(from, |j| self.from.parents()[*j as usize]);
        let start = leader.and_then(|l| self.map.source(l));
        let above: BTreeSet<u32> = up(start).collect();
        let mut down: Vec<u32> = up(Some(source)).take_while(|j| !above.contains(j)).collect();
        down.reverse();
        let meet = up(Some(source)).find(|j| above.contains(j));
        let ups = up(start).take_while(|j| Some(*j) != meet).collect();
        (ups, down)
    }

    fn rotation_mapping<'c>(&self, joint: u32, curves: &CurvesByJoint<'c>) -> Option<RotationMapping<'c>> {
        let (source, follow) = (self.map.source(joint)?, self.follow[joint as usize]?);
        let (leader, between) = self.mapped_ancestor(joint);
        let (ups, downs) = self.joint_path(leader, source);
        // The inverse of the parent's G; the leader's own G begins with the yaw, too.
        let base = match leader.and_then(|l| self.follow[l as usize]) {
            Some(d) => between.conjugate() * d.conjugate(),
            None => between.conjugate() * self.yaw,
        };
        let steps: Vec<(u32, bool)> =
            ups.iter().map(|j| (*j, true)).chain(downs.iter().map(|j| (*j, false))).collect();
        let moved: Vec<usize> =
            (0..steps.len()).filter(|i| curves.rotations.contains_key(&steps[*i].0)).collect();
        let product = |range: &[(u32, bool)]| {
            range.iter().fold(DQuat::IDENTITY, |product, (joint, inverse)| {
                let rest = normalize_or_identity(self.from.rest()[*joint as usize].rotation.as_dquat());
                product * if *inverse { rest.conjugate() } else { rest }
            })
        };
        Some(match moved.as_slice() {
            [] => RotationMapping::Still(normalize_or_identity(base * product(&steps) * follow)),
            [i] => RotationMapping::Keys {
                curve: curves.rotations.get(&steps[*i].0)?,
                before: normalize_or_identity(base * product(&steps[..*i])),
                after: normalize_or_identity(product(&steps[i + 1..]) * follow),
                inverse: steps[*i].1,
            },
            _ => RotationMapping::Sampled,
        })
    }

    fn add_rotation_times(&self, joint: u32, curves: &CurvesByJoint, times: &mut BTreeSet<Time>) {
        let Some(source) = self.map.source(joint) else { return };
        let (ups, downs) = self.joint_path(self.mapped_ancestor(joint).0, source);
        for joint in ups.iter().chain(&downs) {
            add_times(curves.rotations.get(joint), times);
        }
    }

    /// Translation curve of a joint, mapped key by key. `None` unless the curve of its source joint is all that moves it.
    fn translation_keys(&self, joint: u32, curves: &CurvesByJoint) -> Option<Curve> {
        let source = self.map.source(joint)?;
        let curve = curves.translations.get(&source)?;
        let above =
            std::iter::successors(self.from.parents()[source as usize], |j| self.from.parents()[*j as usize]);
        let still = |j: u32| !curves.rotations.contains_key(&j) && !curves.translations.contains_key(&j);
        let lifted = self.options.floor && Some(joint) == self.hips && self.both_have_feet();
        if lifted || !above.clone().all(still) {
            return None;
        }
        let model = |skeleton: &crate::skeleton::Skeleton, joint: u32| {
            let up = std::iter::successors(skeleton.parents()[joint as usize], |j| {
                skeleton.parents()[*j as usize]
            });
            up.fold(DAffine3::IDENTITY, |below, j| {
                let t = &skeleton.rest()[j as usize];
                let (s, r, t) = (
                    t.scale.as_dvec3(),
                    normalize_or_identity(t.rotation.as_dquat()),
                    t.translation.as_dvec3(),
                );
                DAffine3::from_scale_rotation_translation(s, r, t) * below
            })
        };
        // Joints above the target's must not follow moving joints.
        let mut parents = self.to.parents()[joint as usize];
        while let Some(parent) = parents {
            if self.map.source(parent).is_some_and(|s| !still(s)) {
                return None;
            }
            parents = self.to.parents()[parent as usize];
        }
        let (from, to) = (model(self.from, source), model(self.to, joint).inverse());
        if !to.is_finite() {
            return None;
        }
        let cubic = curve.interpolation == Interpolation::CubicSpline;
        let values = curve.values.chunks_exact(3).enumerate().flat_map(|(part, v)| {
            let v = DVec3::new(v[0].into(), v[1].into(), v[2].into());
            let v = match cubic && part % 3 != 1 {
                true => to.transform_vector3(self.yaw * from.transform_vector3(v) * self.scale),
                false => to.transform_point3(self.target_position(joint, from.transform_point3(v))),
            };
            v.to_array().map(|v| v as f32)
        });
        Some(Curve { joint, values: values.collect(), ..(*curve).clone() })
    }

    /// Adds the key times of all curves that move a joint. Returns false if the clip does not move it.
    fn add_translation_times(&self, joint: u32, curves: &CurvesByJoint, times: &mut BTreeSet<Time>) -> bool {
        let Some(source) = self.map.source(joint) else { return false };
        let up = |from: u32| std::iter::successors(Some(from), |j| self.from.parents()[*j as usize]);
        let lifted = self.options.floor && Some(joint) == self.hips && self.both_have_feet();
        let feet: Vec<u32> =
            if lifted { self.source.contacts.iter().map(|c| c.0).collect() } else { Vec::new() };
        let moves = up(source).any(|j| curves.translations.contains_key(&j))
            || up(source).skip(1).any(|j| curves.rotations.contains_key(&j))
            || feet.iter().any(|foot| {
                up(*foot).skip(1).take_while(|j| *j != source).any(|j| curves.rotations.contains_key(&j))
            });
        if moves {
            for j in up(source).chain(feet.iter().flat_map(|foot| up(*foot))) {
                add_times(curves.rotations.get(&j), times);
                add_times(curves.translations.get(&j), times);
            }
        }
        moves
    }

    /// Adds curves of scales, morph weights and, if requested, translations within the character.
    fn add_other_curves(&self, clip: &Clip, out: &mut Vec<Curve>, report: &mut RetargetReport) {
        let followers: BTreeMap<u32, u32> =
            self.map.pairs().map(|(joint, source, _)| (source, joint)).collect();
        for curve in clip.curves() {
            let Some(joint) = followers.get(&curve.joint).copied() else { continue };
            let rest = &self.from.rest()[curve.joint as usize];
            match curve.path {
                Path::Weights(_) => out.push(Curve { joint, ..curve.clone() }),
                Path::Scale => {
                    let (own, theirs) = (self.to.rest()[joint as usize].scale, rest.scale);
                    if let Some(d) =
                        self.follow[joint as usize].filter(|_| !stays_at(curve, theirs.to_array(), 1e-4))
                    {
                        let axes = nearest_axes(d);
                        let values = curve.values.chunks_exact(3).flat_map(|s| {
                            [0, 1, 2].map(|i| {
                                let ratio = own[i] / theirs[axes[i]];
                                s[axes[i]] * if ratio.is_finite() { ratio } else { 1.0 }
                            })
                        });
                        out.push(Curve { joint, values: values.collect(), ..curve.clone() });
                    }
                }
                Path::Translation if !self.translates(joint) => {
                    let moved = match self.options.translations {
                        Translations::All => self.offset_keys(joint, curve),
                        _ => None,
                    };
                    match moved {
                        Some(curve) => out.push(curve),
                        None => self.report_dropped_translation(curve, report),
                    }
                }
                _ => {}
            }
        }
    }

    /// Keys of the source joint's offset from its rest, in the target's axes and size; `None` unless both parents follow each other.
    fn offset_keys(&self, joint: u32, curve: &Curve) -> Option<Curve> {
        let (parent, above) =
            (self.to.parents()[joint as usize]?, self.from.parents()[curve.joint as usize]?);
        let turn =
            self.follow[parent as usize].filter(|_| self.map.source(parent) == Some(above))?.conjugate();
        let units = self.source.rest.scales[above as usize] / self.target.rest.scales[parent as usize];
        let size = self.scale * Some(units).filter(|u| u.is_finite())?;
        let (own, theirs) = (self.to.rest()[joint as usize], self.from.rest()[curve.joint as usize]);
        let cubic = curve.interpolation == Interpolation::CubicSpline;
        let values = curve.values.chunks_exact(3).enumerate().flat_map(|(part, v)| {
            let v = DVec3::new(v[0].into(), v[1].into(), v[2].into());
            let v = match cubic && part % 3 != 1 {
                true => turn * v * size,
                false => own.translation.as_dvec3() + turn * (v - theirs.translation.as_dvec3()) * size,
            };
            v.to_array().map(|v| v as f32)
        });
        Some(Curve { joint, values: values.collect(), ..curve.clone() })
    }

    fn report_dropped_translation(&self, curve: &Curve, report: &mut RetargetReport) {
        let parent = self.from.parents()[curve.joint as usize];
        let unit = parent.map_or(1.0, |p| self.source.rest.scales[p as usize]);
        let rest = self.from.rest()[curve.joint as usize].translation;
        let from = usize::from(curve.interpolation == Interpolation::CubicSpline) * 3;
        let keys = curve.values.chunks_exact(curve.stride());
        let moved = keys
            .map(|key| f64::from((glam::Vec3::from_slice(&key[from..]) - rest).length()))
            .fold(0.0, f64::max);
        if moved * unit > 0.01 * self.source.leg.max(0.1) {
            report.held.push((self.from.names()[curve.joint as usize].clone(), moved * unit));
        }
    }

    /// Adds sampled curves that share their key times: the given times, and as many between as the tolerance requires.
    fn add_sampled_curves(
        &self,
        clip: &Clip,
        times: BTreeSet<Time>,
        rotating: &[u32],
        translating: &[u32],
        out: &mut Vec<Curve>,
        report: &mut RetargetReport,
    ) {
        let frame = RetargetBuffers::new(self, clip);
        let mut sampler =
            Sampler { retarget: self, clip, rotating, translating, frame, raised: None, keys: Vec::new() };
        let coarse = !sampler.run(times);
        let Sampler { keys, raised, .. } = sampler;
        report.coarse = coarse;
        report.raised = raised.unwrap_or_default();
        report.sampled_keys = keys.len();
        let times: Arc<[Time]> = keys.iter().map(|k| k.time).collect();
        let name = |joint: &u32| self.to.names()[*joint as usize].clone();
        report.sampled = rotating.iter().chain(translating).map(name).collect();
        report.sampled.sort();
        report.sampled.dedup();
        let interpolation = Interpolation::Linear;
        for (i, joint) in rotating.iter().enumerate() {
            let mut before = DQuat::IDENTITY;
            let values = keys.iter().flat_map(|key| {
                // The quaternion gets the sign that is nearer to the key before.
                let turn =
                    if key.rotations[i].dot(before) < 0.0 { -key.rotations[i] } else { key.rotations[i] };
                before = turn;
                turn.to_array().map(|v| v as f32)
            });
            let values = values.collect();
            out.push(Curve {
                joint: *joint,
                path: Path::Rotation,
                interpolation,
                times: times.clone(),
                values,
            });
        }
        for (i, joint) in translating.iter().enumerate() {
            let values = keys.iter().flat_map(|key| key.positions[i].to_array().map(|v| v as f32)).collect();
            out.push(Curve {
                joint: *joint,
                path: Path::Translation,
                interpolation,
                times: times.clone(),
                values,
            });
        }
    }
}

/// Adds a curve's key times; for STEP also the last tick before each key.
fn add_times(curve: Option<&&Curve>, times: &mut BTreeSet<Time>) {
    let Some(curve) = curve else { return };
    times.extend(curve.times.iter().copied());
    if curve.interpolation == Interpolation::Step {
        times.extend(curve.times.iter().skip(1).map(|t| Time(t.0 - 1)));
    }
}

/// Whether a curve stays at a value, within the tolerance.
fn stays_at(curve: &Curve, value: [f32; 3], tolerance: f32) -> bool {
    let cubic = curve.interpolation == Interpolation::CubicSpline;
    curve.values.chunks_exact(3).enumerate().all(|(part, v)| {
        let goal = if cubic && part % 3 != 1 { [0.0; 3] } else { value };
        v.iter().zip(goal).all(|(v, g)| (v - g).abs() <= tolerance)
    })
}
