//! Lines and triangles of an effect's own: its function is asked for each, on the CPU, for both renderers.

use crate::around::Beside;
use crate::head::{Head, JointLine};
use crate::program::{MOST_STEPS, Program};
use crate::shape::Value;
use choreo_asset::{Asset, DAabb};
use choreo_plugin::suggest::did_you_mean;
use choreo_plugin::{Body, EffectTexture, Overlay, Scene, Stroke, Triangle};
use glam::{DVec3, Vec4};

/// Steps of all of an effect's lines or triangles in a frame, some tenths of a second; what comes after is not drawn.
pub const MOST_FRAME_STEPS: u32 = 20_000_000;

/// All that an effect draws in a frame.
pub struct Drawing<'a> {
    pub program: &'a Program,
    pub head: &'a Head,
    pub textures: &'a [EffectTexture],
    /// Rather than lines.
    pub triangles: bool,
    /// The text reads the boxes around actors.
    pub boxes: bool,
    pub parameters: &'a [f32; 8],
}

/// What was made so far.
#[derive(Default)]
struct Made {
    out: Overlay,
    steps: u32,
    /// How many were asked for; of those, which cannot be drawn.
    asked: u64,
    not_finite: u32,
    too_long: u32,
    /// There is no room or time for more.
    full: bool,
}

impl Drawing<'_> {
    pub fn run(&self, scene: &Scene) -> Overlay {
        let time = scene.snapshot.time.as_secs() as f32;
        let mut made = Made::default();
        if self.head.of_scene {
            let mut bounds = DAabb::EMPTY;
            for own in scene.bodies().filter(|_| self.boxes).map(|body| body.bounds()) {
                bounds.add(own.min);
                bounds.add(own.max);
            }
            if bounds.is_empty() {
                bounds.add(DVec3::ZERO);
            }
            let value = body_of(time, DVec3::ZERO, bounds, [0, 0]);
            let bones = Bones::default();
            self.one(value, &Beside { scene, body: None, bones: &bones, textures: self.textures }, &mut made);
        } else {
            let mut known: Option<(&Asset, Bones)> = None;
            for (number, body) in scene.bodies().enumerate() {
                // Many actors of one file follow each other.
                let bones = match known.take() {
                    Some((asset, bones)) if std::ptr::eq(asset, body.asset) => bones,
                    _ => Bones::of(&body, &self.head.joints, &mut made.out.left_out),
                };
                let place = body.world_from_model.translation;
                let bounds = if self.boxes { body.bounds() } else { DAabb { min: place, max: place } };
                let value = body_of(time, place, bounds, [bones.count, number as u32]);
                let around = Beside { scene, body: Some(&body), bones: &bones, textures: self.textures };
                self.one(value, &around, &mut made);
                known = Some((body.asset, bones));
            }
        }
        self.finished(made)
    }

    /// All around one body.
    fn one(&self, body: Value, around: &Beside, made: &mut Made) {
        let count = self.head.count.of(self.parameters).clamp(0.0, Overlay::MOST as f32) as u32;
        made.asked += u64::from(count);
        for index in 0..count {
            let drawn = made.out.strokes.len() + made.out.triangles.len();
            made.full = made.full || made.steps >= MOST_FRAME_STEPS || drawn >= Overlay::MOST;
            if made.full {
                return;
            }
            let arguments = vec![Value::uint(index), body, Value::floats(self.parameters)];
            match self.program.run(arguments, around) {
                Ok(done) => {
                    made.steps += done.steps;
                    self.add(&done.value, made);
                }
                Err(_) => {
                    made.steps += MOST_STEPS;
                    made.too_long += 1;
                }
            }
        }
    }

    /// What the function gave, where there is anything to see.
    fn add(&self, value: &Value, made: &mut Made) {
        let f = |i: usize| value.f(i);
        let place = |i: usize| DVec3::new(f(i).into(), f(i + 1).into(), f(i + 2).into());
        let color = |i: usize| Vec4::new(f(i), f(i + 1), f(i + 2), f(i + 3).clamp(0.0, 1.0));
        let size = if self.triangles { 13 } else { 11 };
        if !(0..size).all(|i| f(i).is_finite()) {
            made.not_finite += 1;
        } else if self.triangles {
            let one = Triangle { corners: [place(0), place(3), place(6)], color: color(9) };
            made.out.triangles.extend((one.color.w > 0.0).then_some(one));
        } else {
            let one = Stroke { from: place(0), to: place(3), width: f(6), color: color(7) };
            made.out.strokes.extend((one.width > 0.0 && one.color.w > 0.0).then_some(one));
        }
    }

    fn finished(&self, made: Made) -> Overlay {
        let Made { mut out, steps, asked, not_finite, too_long, full } = made;
        let what = if self.triangles { "triangles" } else { "lines" };
        let mut say = |count: u32, why: String| {
            if count > 0 {
                out.left_out.push(format!("{count} of {asked} {what} {why}"));
            }
        };
        say(not_finite, "have numbers that are not finite".into());
        say(too_long, format!("take more than {MOST_STEPS} steps each"));
        if full {
            let (drawn, most) = (out.strokes.len() + out.triangles.len(), Overlay::MOST);
            out.left_out.push(format!(
                "{drawn} of {asked} {what} are drawn, made in {steps} steps; a frame has at most {most} in {MOST_FRAME_STEPS} steps"
            ));
        }
        out.over = self.head.over.of(self.parameters) > 0.5;
        out
    }
}

/// Its joint, and the number of the bone above it.
pub type Bone = (u32, Option<u32>);

/// The bones of a body, by number.
#[derive(Default)]
pub struct Bones {
    /// After the bones joints that are none and that the head names.
    pub all: Vec<Bone>,
    pub count: u32,
    /// The number of each joint that the head names; beyond the end where the body has none.
    pub named: Vec<u32>,
}

impl Bones {
    /// What is not there is reported once for each file.
    fn of(body: &Body, joints: &[JointLine], left_out: &mut Vec<String>) -> Bones {
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
                let why = format!("\"{file}\" has no joint {names}, as {} asks for{near}", line.name);
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

fn body_of(time: f32, place: DVec3, bounds: DAabb, counts: [u32; 2]) -> Value {
    let mut at = [0.0; 20];
    for (i, v) in [place, bounds.min, bounds.max].into_iter().enumerate() {
        at[3 * i..3 * i + 3].copy_from_slice(&v.as_vec3().to_array());
    }
    let mut value = Value::floats(&[time]);
    value.0[1..10].copy_from_slice(&Value::floats(&at).0[..9]);
    value.0[10..12].copy_from_slice(&counts);
    value
}

/// A body for a trial: around two places.
pub fn body_value(time: f32, [low, high]: [[f32; 20]; 2], counts: [u32; 2]) -> Value {
    let place = |at: [f32; 20]| DVec3::new(at[0].into(), at[1].into(), at[2].into());
    body_of(time, place(low), DAabb { min: place(low), max: place(high) }, counts)
}
