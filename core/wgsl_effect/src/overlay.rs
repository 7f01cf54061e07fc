//! Lines and triangles that an effect draws. The function is called for each of them, on the CPU, for both renderers.

use crate::compile::Output;
use crate::environment::Surroundings;
use crate::header::{Header, JointLine};
use crate::machine::Machine;
use crate::program::{MAX_STEPS, Program};
use choreo_asset::{Asset, DAabb};
use choreo_plugin::effect::endless;
use choreo_plugin::suggest::did_you_mean;
use choreo_plugin::{ActorInstance, EffectScene, EffectTexture, Lattice, Overlay, Stroke, Triangle};
use glam::{DVec3, Vec4};

/// Largest number of steps of all lines or triangles of an effect in a frame, some tenths of a second; the remaining ones are not drawn.
pub(crate) const MAX_FRAME_STEPS: u32 = 20_000_000;

/// The inputs of an overlay in a frame.
pub(crate) struct OverlayInputs<'a> {
    pub program: &'a Program,
    pub header: &'a Header,
    pub textures: &'a [EffectTexture],
    pub output: Output,
    /// The text reads the bounding boxes of actors.
    pub reads_boxes: bool,
    pub parameters: &'a [f32],
}

/// The geometry made so far.
#[derive(Default)]
struct OverlayGeometry {
    out: Overlay,
    steps: u32,
    /// How many elements were requested, and how many of them cannot be drawn.
    requested: u64,
    not_finite: u32,
    too_long: u32,
    /// The limit of elements or steps is reached.
    full: bool,
}

impl OverlayInputs<'_> {
    pub(crate) fn run(&self, scene: &EffectScene) -> Overlay {
        let time = scene.snapshot.time.as_secs() as f32;
        let mut made = OverlayGeometry::default();
        if self.header.of_scene {
            let mut bounds = DAabb::EMPTY;
            for own in scene.instances().filter(|_| self.reads_boxes).map(|body| body.bounds()) {
                bounds.add(own.min);
                bounds.add(own.max);
            }
            if bounds.is_empty() {
                bounds.add(DVec3::ZERO);
            }
            let value = body_of(time, DVec3::ZERO, bounds, [0, 0]);
            let bones = Bones::default();
            self.add_around_actor(
                value,
                &Surroundings { scene, actor: None, bones: &bones, textures: self.textures },
                &mut made,
            );
        } else {
            let mut known: Option<(&Asset, Bones)> = None;
            for (number, body) in scene.instances().enumerate() {
                // Actors with the same asset often follow each other.
                let bones = match known.take() {
                    Some((asset, bones)) if std::ptr::eq(asset, body.asset) => bones,
                    _ => Bones::of(&body, &self.header.joints, &mut made.out.left_out),
                };
                let place = body.world_from_model.translation;
                let bounds = if self.reads_boxes { body.bounds() } else { DAabb { min: place, max: place } };
                let value = body_of(time, place, bounds, [bones.count, number as u32]);
                let around =
                    Surroundings { scene, actor: Some(&body), bones: &bones, textures: self.textures };
                self.add_around_actor(value, &around, &mut made);
                known = Some((body.asset, bones));
            }
        }
        self.finish_overlay(made)
    }

    /// Adds all elements around one actor.
    fn add_around_actor(&self, body: [u32; 12], around: &Surroundings, made: &mut OverlayGeometry) {
        let count = self.header.count.of(self.parameters).clamp(0.0, Overlay::MOST as f32) as u32;
        made.requested += u64::from(count);
        let program = self.program;
        let mut machine = Machine::<1>::new(program, self.parameters);
        machine.set(program, 1, 0, &body);
        for index in 0..count {
            let drawn = made.out.strokes.len() + made.out.triangles.len() + made.out.lattices.len();
            made.full = made.full || made.steps >= MAX_FRAME_STEPS || drawn >= Overlay::MOST;
            if made.full {
                return;
            }
            machine.set(program, 0, 0, &[index]);
            match machine.run(program, 1, around) {
                Ok(()) if machine.steps <= MAX_STEPS && machine.endless == [0] => {
                    made.steps += machine.steps;
                    self.add(&machine, made);
                }
                _ => {
                    made.steps += MAX_STEPS;
                    made.too_long += 1;
                    self.add_faulty(endless(machine.endless[0]), made);
                }
            }
        }
    }

    /// Adds the result of the function, if it is visible.
    fn add(&self, machine: &Machine<1>, made: &mut OverlayGeometry) {
        let f = |i: u32| machine.float(self.program, 0, i);
        let place = |i: u32| DVec3::new(f(i).into(), f(i + 1).into(), f(i + 2).into());
        let color = |i: u32| Vec4::new(f(i), f(i + 1), f(i + 2), f(i + 3).clamp(0.0, 1.0));
        if !(0..self.program.entry().result.count).all(|i| f(i).is_finite()) {
            made.not_finite += 1;
            return self.add_faulty(f32::NAN, made);
        }
        match self.output {
            Output::Triangles => {
                let one = Triangle { vertices: [place(0), place(3), place(6)], color: color(9) };
                made.out.triangles.extend((one.color.w > 0.0).then_some(one));
            }
            Output::Lattices => made.out.lattices.push(Lattice {
                origin: place(0),
                along: [place(3), place(6)],
                cell: f(9).into(),
                every: machine.bits(self.program, 0, 10),
                widths: [f(11), f(12)],
                color: color(13),
                fade: f(17).into(),
            }),
            _ => {
                let one = Stroke { from: place(0), to: place(3), width: f(6), color: color(7) };
                made.out.strokes.extend((one.width > 0.0 && one.color.w > 0.0).then_some(one));
            }
        }
    }

    /// Adds an element whose color marks a fault, which the renderers report.
    fn add_faulty(&self, fault: f32, made: &mut OverlayGeometry) {
        let (color, zero) = (Vec4::splat(fault), DVec3::ZERO);
        match self.output {
            Output::Triangles => made.out.triangles.push(Triangle { vertices: [zero; 3], color }),
            Output::Lattices => made.out.lattices.push(Lattice {
                origin: zero,
                along: [DVec3::X, DVec3::Z],
                cell: 1.0,
                every: 1,
                widths: [0.0; 2],
                color,
                fade: 1.0,
            }),
            _ => made.out.strokes.push(Stroke { from: zero, to: zero, width: 0.0, color }),
        }
    }

    fn finish_overlay(&self, made: OverlayGeometry) -> Overlay {
        let OverlayGeometry { mut out, steps, requested, not_finite, too_long, full } = made;
        let what = match self.output {
            Output::Triangles => "triangles",
            Output::Lattices => "lattices",
            _ => "lines",
        };
        let mut say = |count: u32, why: String| {
            if count > 0 {
                out.left_out.push(format!("{count} of {requested} {what} {why}"));
            }
        };
        say(not_finite, "have numbers that are not finite".into());
        say(too_long, format!("take more than {MAX_STEPS} steps each"));
        if full {
            let made = out.strokes.len() + out.triangles.len() + out.lattices.len();
            let drawn = made - (not_finite + too_long) as usize;
            let most = Overlay::MOST;
            out.left_out.push(format!(
                "{drawn} of {requested} {what} are drawn, made in {steps} steps; a frame has at most {most} in {MAX_FRAME_STEPS} steps"
            ));
        }
        out.over = self.header.over.of(self.parameters) > 0.5;
        out
    }
}

/// Joint of a bone, and the number of its parent bone.
pub(crate) type Bone = (u32, Option<u32>);

/// The bones of an actor, by number.
#[derive(Default)]
pub(crate) struct Bones {
    /// The bones, then further joints that the header names.
    pub all: Vec<Bone>,
    pub count: u32,
    /// Number of each joint that the header names; `u32::MAX` if the actor has no such joint.
    pub named: Vec<u32>,
}

impl Bones {
    /// Finds the bones of an actor; a missing joint is reported once for each asset.
    fn of(body: &ActorInstance, joints: &[JointLine], left_out: &mut Vec<String>) -> Bones {
        let shown = body.bones();
        let skeleton = &body.asset.skeleton;
        let mut number: Vec<Option<u32>> = vec![None; skeleton.len()];
        for (i, (joint, _)) in shown.iter().enumerate() {
            number[*joint as usize] = Some(i as u32);
        }
        let of = |above: Option<u32>| above.and_then(|above| number[above as usize]);
        let mut bones = Bones {
            all: shown.iter().map(|(joint, above)| (*joint, of(*above))).collect(),
            count: shown.len() as u32,
            named: Vec::new(),
        };
        for line in joints {
            let Some(joint) = line.of.iter().find_map(|name| skeleton.names().iter().position(|n| n == name))
            else {
                let near = did_you_mean(&line.of[0], skeleton.names().iter().map(String::as_str));
                let (file, names) = (&body.asset.name, line.of.join(", "));
                let why = format!("\"{file}\" has no joint {names} for the effect's \"{}\"{near}", line.name);
                left_out.extend((!left_out.contains(&why)).then_some(why));
                bones.named.push(u32::MAX);
                continue;
            };
            let found = number[joint].unwrap_or_else(|| {
                let above =
                    std::iter::successors(skeleton.parents()[joint], |j| skeleton.parents()[*j as usize]);
                let above = above.filter_map(|j| number[j as usize]).next();
                bones.all.push((joint as u32, above));
                bones.all.len() as u32 - 1
            });
            bones.named.push(found);
        }
        bones
    }
}

/// Bits of the struct `Body` of the shaders.
fn body_of(time: f32, place: DVec3, bounds: DAabb, counts: [u32; 2]) -> [u32; 12] {
    let [p, low, high] = [place, bounds.min, bounds.max].map(|v| v.as_vec3().to_array().map(f32::to_bits));
    let mut bits = [0; 12];
    bits[0] = time.to_bits();
    bits[1..10].copy_from_slice([p, low, high].as_flattened());
    bits[10..].copy_from_slice(&counts);
    bits
}

/// The bits of an actor for a trial, whose box lies between two points.
pub(crate) fn trial_body(time: f32, [low, high]: [DVec3; 2], counts: [u32; 2]) -> [u32; 12] {
    body_of(time, low, DAabb { min: low, max: high }, counts)
}
