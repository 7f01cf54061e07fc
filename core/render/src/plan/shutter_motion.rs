//! Motion of the fastest pixel while the shutter is open, which decides how many sub-frames motion blur draws.
//!
//! The stage is evaluated at a few times while the shutter is open. Between two of them, the boxes of visible joints and meshes
//! move by some pixels, and their shadows by some texels of the shadow maps, which are about as large as pixels. The distance
//! that the fastest of the eight corners moves is an upper bound: a skinned vertex is a weighted mean of its positions under each
//! joint. Other changes, such as a moving light, take all sub-frames.

use crate::affine::to_f64;
use crate::plan::build::effects::{active_uses, effect_parameters, history_of};
use crate::plan::build::overlay::overlays;
use crate::plan::build::shadow_volumes::{FACES, in_frustum, near_depth};
use crate::plan::build::skins::bind_of;
use crate::plan::options::PlanOptions;
use crate::plan::{Plan, View};
use crate::scene_resources::{PrimitiveResource, SceneResources};
use crate::view::ray_basis;
use choreo_asset::{Aabb, MeshInstance, Topology};
use choreo_motion::Time;
use choreo_plugin::Hook;
use choreo_stage::{ActorState, LightState, Snapshot, Stage};
use glam::{Affine3A, DAffine3, DMat4, DVec2, DVec3, DVec4, Vec3, Vec4};
use std::fmt;

/// Largest motion in pixels from one sub-frame to the next. A pixel shows the mean over its own width, so that such steps leave
/// no gaps (decision 56).
pub(crate) const STEP: f64 = 1.0;
/// Fractions of the open shutter at which the stage is evaluated. They are uneven, so that periodic motion is not missed.
const SHUTTER_FRACTIONS: [f64; 5] = [0.0, 0.21, 0.47, 0.76, 1.0];
/// Largest change of a color or a light between two of these times that counts as none: the color in the middle is close to the
/// mean.
const MAX_IGNORED_CHANGE: f32 = 0.02;

/// Motion while the shutter is open, and the number of sub-frames that it takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShutterMotion {
    /// Largest number of sub-frames.
    pub most: u32,
    /// Motion of the fastest pixel in pixels, or the change other than motion that takes all sub-frames.
    pub found: Result<f64, &'static str>,
}

impl ShutterMotion {
    pub fn sub_frames(&self) -> u32 {
        let needed = self.found.map_or(f64::INFINITY, |pixels| (pixels / STEP).ceil());
        (needed.min(f64::from(self.most)) as u32).max(1)
    }
}

impl fmt::Display for ShutterMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.found {
            Ok(0.0) => write!(f, "nothing visible moves")?,
            Ok(pixels) if self.sub_frames() == self.most => {
                write!(f, "something moves by {pixels:.1} pixels or more")?
            }
            Ok(pixels) => write!(f, "nothing moves by more than {pixels:.1} pixels")?,
            Err(change) => write!(f, "{change}")?,
        }
        write!(f, " while the shutter is open")
    }
}

/// Inputs of the estimate: a stage and the plan that shows it.
pub(super) struct ShutterScene<'a> {
    pub resources: &'a SceneResources,
    pub stage: &'a Stage,
    pub options: &'a PlanOptions<'a>,
    /// The plan of the frame's own time, for its shadow maps.
    pub plan: &'a Plan,
}

impl ShutterScene<'_> {
    /// Estimates the motion. `time_of` gives the time at a fraction of the open shutter. Ends early once `most` sub-frames are
    /// needed.
    pub(super) fn motion<E>(
        &self,
        most: u32,
        time_of: impl Fn(f64) -> Time,
        mut at: impl FnMut(Time) -> Result<Snapshot, E>,
    ) -> Result<ShutterMotion, E> {
        let mut before = at(time_of(SHUTTER_FRACTIONS[0]))?;
        let mut pixels = 0.0;
        for share in &SHUTTER_FRACTIONS[1..] {
            let after = at(time_of(*share))?;
            match self.between(&before, &after) {
                Ok(more) => pixels += more,
                Err(change) => return Ok(ShutterMotion { most, found: Err(change) }),
            }
            if pixels > f64::from(most) * STEP {
                break;
            }
            before = after;
        }
        Ok(ShutterMotion { most, found: Ok(pixels) })
    }

    /// Pixels that the fastest pixel moves between two snapshots, or a change other than motion.
    fn between(&self, a: &Snapshot, b: &Snapshot) -> Result<f64, &'static str> {
        self.other_changes(a, b).map_or(Ok(()), Err)?;
        let eyes =
            [a, b].map(|s| MotionView::new(&View::new(&s.camera, self.options.size), self.options.size));
        let mut fastest = 0.0f64;
        if a.sky.as_ref().is_some_and(|sky| sky.background) {
            fastest = sky_motion(a, &eyes, self.options.size);
        }
        let lights = self.shadow_eyes();
        for (actor, states) in a.actors.iter().zip(&b.actors).enumerate().take(self.stage.actors.len()) {
            let carried;
            // The placement of an actor that is culled at one of the times is known; its pose is taken from the other time.
            let states = match (states.0, states.1) {
                (a, b) if a.culled && !b.culled => {
                    carried = ActorState { world_from_model: a.world_from_model, ..b.clone() };
                    [&carried, b]
                }
                (a, b) if b.culled && !a.culled => {
                    carried = ActorState { world_from_model: b.world_from_model, ..a.clone() };
                    [a, &carried]
                }
                (a, b) => [a, b],
            };
            if states.iter().all(|s| s.visible && !s.culled) {
                let lights = lights.iter().filter(|(actors, _)| actors.contains(&(actor as u32)));
                let lights: Vec<&MotionView> = lights.map(|(_, eye)| eye).collect();
                fastest = fastest.max(self.actor_motion(actor, states, &eyes, &lights));
            }
        }
        Ok(fastest)
    }

    /// The views of shadow maps, and the actors drawn into each.
    fn shadow_eyes(&self) -> Vec<(Vec<u32>, MotionView)> {
        let views = self.plan.shadow_maps.iter().flat_map(|maps| &maps.views);
        let eye = |view: &crate::plan::ShadowView| {
            let instances =
                view.draws.iter().flat_map(|d| d.first_instance..d.first_instance + d.instance_count);
            let actors = instances.map(|i| self.plan.instance_actors[i as usize]).collect();
            let eye = MotionView {
                clip_from_relative: view.clip_from_relative.as_dmat4(),
                position: self.plan.view.position,
                half: DVec2::from(view.size.map(f64::from)) * 0.5,
                nearest: 1e-6,
                metre: 0.0,
            };
            (actors, eye)
        };
        views.map(eye).collect()
    }

    fn actor_motion(
        &self,
        actor: usize,
        states: [&ActorState; 2],
        eyes: &[MotionView; 2],
        lights: &[&MotionView],
    ) -> f64 {
        let asset = &self.stage.actors[actor].asset;
        let entry = self.resources.entry(actor);
        let mut fastest = 0.0f64;
        for (i, (instance, primitives)) in asset.instances.iter().zip(&entry.primitives).enumerate() {
            for primitive in primitives {
                let resource = &self.resources.primitives[primitive.primitive as usize];
                let morph = morph_motion(resource, i, states);
                let mut add = |bounds: Aabb, world_from_mesh: [DAffine3; 2], rigid: bool| {
                    let part = MovingBox { bounds, world_from_mesh, shape: rigid.then_some(resource), morph };
                    fastest = fastest.max(part.motion(eyes));
                    lights.iter().for_each(|light| fastest = fastest.max(part.motion_of_shadow(light)));
                };
                if resource.info.valid {
                    moving_boxes(asset, instance, resource, states, &mut add);
                }
            }
        }
        fastest
    }

    /// A change other than motion that needs all sub-frames, if there is one.
    fn other_changes(&self, a: &Snapshot, b: &Snapshot) -> Option<&'static str> {
        let (stage, options) = (self.stage, self.options);
        if a.lights.len() != b.lights.len()
            || a.lights.iter().zip(&b.lights).any(|(a, b)| light_changes(a, b))
        {
            return Some("a light changes");
        }
        let sky = |s: &Snapshot| s.sky.as_ref().map(|sky| (sky.turn, sky.strength, sky.background));
        if sky(a) != sky(b) || a.background != b.background {
            return Some("the background changes");
        }
        if differs(a.ambient_up, b.ambient_up) || differs(a.ambient_down, b.ambient_down) {
            return Some("a light changes");
        }
        let behind = |s: &Snapshot| -> Vec<choreo_stage::Layer2dState> {
            let is_behind =
                |l: &&choreo_stage::Layer2dState| stage.layers_2d.get(l.layer_2d).is_some_and(|l| l.under);
            s.layers_2d.iter().filter(is_behind).cloned().collect()
        };
        if behind(a) != behind(b) {
            return Some("a 2D layer behind the scene changes");
        }
        let in_scene = |s: &Snapshot| -> Vec<(usize, Vec<f32>)> {
            let drawn = active_uses(stage, s, options.effects)
                .filter(|(effect, ..)| effect.hook().is_in_scene() || effect.hook() == Hook::Overlay);
            drawn
                .map(|(effect, _, state)| (state.effect, effect_parameters(effect, &state.parameters)))
                .collect()
        };
        if in_scene(a) != in_scene(b) {
            return Some("an effect changes");
        }
        if active_uses(stage, a, options.effects).any(|(effect, ..)| effect.hook() == Hook::Overlay) {
            let drawn =
                |s: &Snapshot| overlays(stage, s, &View::new(&s.camera, options.size), options).overlay;
            if history_of(stage, a, options.effects, Hook::Overlay) > 0 || drawn(a) != drawn(b) {
                return Some("what an effect draws over the scene changes");
            }
        }
        let actors = a.actors.iter().zip(&b.actors).enumerate();
        let streams = self.resources.textures.iter().any(|t| t.streamed.is_some());
        let shows_another = |actor: usize| {
            let entries = || self.resources.entry(actor).primitives.iter().flatten();
            streams
                && entries().any(|e| {
                    self.resources.with_sequence_image_at(e, a.time)
                        != self.resources.with_sequence_image_at(e, b.time)
                })
        };
        actors.take(stage.actors.len()).find_map(|(actor, (a, b))| match actor_changes(a, b) {
            None if a.visible && shows_another(actor) => Some("an image sequence advances"),
            change => change,
        })
    }
}

fn actor_changes(a: &ActorState, b: &ActorState) -> Option<&'static str> {
    if a.visible != b.visible || a.copies != b.copies {
        return Some("an actor appears or disappears");
    }
    if !a.visible {
        return None;
    }
    let color = |a: Vec4, b: Vec4| (a - b).abs().max_element() > MAX_IGNORED_CHANGE;
    let base_colors = a.base_colors.iter().zip(&b.base_colors).any(|(a, b)| color(*a, *b));
    let recolored = color(a.tint, b.tint) || base_colors || a.base_colors.len() != b.base_colors.len();
    (recolored || a.materials != b.materials || a.line_width != b.line_width).then_some("a material changes")
}

fn differs(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().max_element() > MAX_IGNORED_CHANGE * a.max(b).max_element()
}

/// Whether a light changes by more than a barely visible change of color.
fn light_changes(a: &LightState, b: &LightState) -> bool {
    let color = |l: &LightState| l.light.color * l.light.intensity;
    let mut colored = *b;
    (colored.light.color, colored.light.intensity) = (a.light.color, a.light.intensity);
    *a != colored || differs(color(a), color(b))
}

/// A view: the camera's, or that of a light's shadow map.
struct MotionView {
    clip_from_relative: DMat4,
    position: DVec3,
    /// Half a side of the image in pixels.
    half: DVec2,
    /// Least clip w that counts; smaller ones are clamped to it.
    nearest: f64,
    /// Pixels per metre where clip w is 1.
    metre: f64,
}

impl MotionView {
    fn new(view: &View, size: [u32; 2]) -> MotionView {
        let near = if view.eye.w == 0.0 { 1e-9 } else { near_depth(view) };
        MotionView {
            clip_from_relative: view.clip_from_relative.as_dmat4(),
            position: view.position,
            half: DVec2::from(size.map(f64::from)) * 0.5,
            nearest: near,
            metre: f64::from(view.clip_from_view.y_axis.y.abs()) * 0.5 * f64::from(size[1]),
        }
    }

    fn clip_from(&self, world: &DAffine3) -> DMat4 {
        let relative = DAffine3 { translation: world.translation - self.position, ..*world };
        self.clip_from_relative * DMat4::from(relative)
    }

    fn pixel(&self, clip: DVec4) -> DVec2 {
        clip.truncate().truncate() / clip.w.max(self.nearest) * self.half
    }
}

/// A box that moves with a joint or a mesh.
struct MovingBox<'a> {
    bounds: Aabb,
    world_from_mesh: [DAffine3; 2],
    /// The mesh, if it is rigid.
    shape: Option<&'a PrimitiveResource>,
    /// Largest distance that morph targets move a vertex, in metres of the mesh.
    morph: f64,
}

/// Clip coordinates of a point at two times.
type ClipPositions = (DVec4, DVec4);

impl MovingBox<'_> {
    fn motion(&self, eyes: &[MotionView; 2]) -> f64 {
        let [a, b] = [0, 1].map(|k| eyes[k].clip_from(&self.world_from_mesh[k]));
        if a == b && self.morph == 0.0 {
            return 0.0;
        }
        let ends = |p: Vec3| -> ClipPositions {
            let p = p.as_dvec3().extend(1.0);
            (a * p, b * p)
        };
        let corners = self.bounds.corners().map(ends);
        let way = |(a, b): ClipPositions| eyes[0].pixel(a).distance(eyes[1].pixel(b));
        let farthest = |points: &[ClipPositions]| points.iter().map(|p| way(*p)).fold(0.0, f64::max);
        let near = eyes[0].nearest;
        let within = |p: DVec4| p.w >= near && p.x.abs() <= p.w && p.y.abs() <= p.w && p.z <= p.w;
        let nearest = corners.iter().map(|(a, b)| a.w.min(b.w)).fold(f64::INFINITY, f64::min).max(near);
        let stretch = self.world_from_mesh[1].matrix3;
        let stretch = [stretch.x_axis, stretch.y_axis, stretch.z_axis].map(DVec3::length);
        let morph = self.morph * stretch.into_iter().fold(0.0, f64::max) * eyes[0].metre / nearest;
        if corners.iter().all(|(a, _)| within(*a)) {
            return farthest(&corners) + morph;
        }
        let mut fastest = 0.0f64;
        let mut add = |polygon: Vec<ClipPositions>| fastest = fastest.max(farthest(&in_frustum(polygon)));
        match self.shape.map(PrimitiveResource::primitive) {
            // The camera may stand inside the box, as on a ground or in a room; then the triangles are used.
            Some(shape)
                if shape.topology == Topology::Triangles && corners.iter().any(|(a, _)| a.w < near) =>
            {
                let ends = |i: &u32| ends(shape.positions[*i as usize]);
                shape.indices.chunks_exact(3).for_each(|t| add(t.iter().map(ends).collect()));
            }
            _ => FACES.iter().for_each(|face| add(face.iter().map(|i| corners[*i]).collect())),
        }
        if fastest == 0.0 { 0.0 } else { fastest + morph }
    }

    /// Texels that the box's shadow moves in a shadow map.
    fn motion_of_shadow(&self, light: &MotionView) -> f64 {
        if self.world_from_mesh[0] == self.world_from_mesh[1] {
            return 0.0;
        }
        let [a, b] = self.world_from_mesh.map(|world| light.clip_from(&world));
        let corners = self.bounds.corners().map(|p| {
            let p = p.as_dvec3().extend(1.0);
            (a * p, b * p)
        });
        let beside = |side: fn(DVec4) -> f64| corners.iter().all(|(a, b)| side(*a) > a.w && side(*b) > b.w);
        if beside(|p| p.x) || beside(|p| -p.x) || beside(|p| p.y) || beside(|p| -p.y) {
            return 0.0;
        }
        let before = corners.iter().filter(|(a, b)| a.w > 0.0 && b.w > 0.0);
        before.map(|(a, b)| light.pixel(*a).distance(light.pixel(*b))).fold(0.0, f64::max)
    }
}

/// Calls `add` with each box of a primitive that moves as one, its transforms at two times, and whether the mesh is rigid.
fn moving_boxes(
    asset: &choreo_asset::Asset,
    instance: &MeshInstance,
    resource: &PrimitiveResource,
    states: [&ActorState; 2],
    add: &mut dyn FnMut(Aabb, [DAffine3; 2], bool),
) {
    let info = &resource.info;
    let posed = |joint: u32| {
        states.map(|s| to_f64(s.model_from_joint.get(joint as usize).copied().unwrap_or(Affine3A::IDENTITY)))
    };
    let world_from_model = states.map(|s| s.world_from_model);
    let skin = instance.skin.and_then(|skin| asset.skins.get(skin as usize));
    let skin = skin.filter(|skin| info.influences > 0 && info.joint_count() <= skin.joints.len());
    for (place, copy) in asset.drawn_copies(instance, states[0].copies) {
        let world_from_place = world_from_model.map(|world| world * to_f64(place));
        match skin {
            Some(skin) => {
                for (joint, bounds) in &info.joint_bounds {
                    let pose = posed(skin.joints[usize::from(*joint)]);
                    let bind = bind_of(skin, usize::from(*joint));
                    add(*bounds, [0, 1].map(|k| world_from_place[k] * pose[k] * bind), false);
                }
            }
            None => {
                let pose = posed(instance.joint);
                add(info.bounds, [0, 1].map(|k| world_from_place[k] * pose[k] * to_f64(copy)), true);
            }
        }
    }
}

/// Largest distance that a change of morph weights moves a vertex, in metres of the mesh.
fn morph_motion(resource: &PrimitiveResource, instance: usize, states: [&ActorState; 2]) -> f64 {
    let [a, b] = states.map(|s| s.morph_weights.get(instance).map_or(&[][..], Vec::as_slice));
    let reach = |b: &Aabb| f64::from(b.min.abs().max(b.max.abs()).length());
    let targets = resource.info.morph_bounds.iter().zip(a.iter().zip(b));
    targets.map(|(bounds, (a, b))| f64::from((a - b).abs()) * reach(bounds)).sum()
}

/// Pixels that the sky moves as the camera turns.
fn sky_motion(a: &Snapshot, eyes: &[MotionView; 2], size: [u32; 2]) -> f64 {
    let [right, down, ahead] = ray_basis(&View::new(&a.camera, size)).map(|v| v.as_dvec3());
    let places = [[0.0, 0.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
    let way = |[x, y]: [f64; 2]| {
        let direction = (right * x + down * y + ahead).extend(0.0);
        let [a, b] = eyes.each_ref().map(|eye| eye.pixel(eye.clip_from_relative * direction));
        a.distance(b)
    };
    places.into_iter().map(way).fold(0.0, f64::max)
}
