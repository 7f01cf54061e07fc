//! Geometry that effects draw beside the meshes of the stage: triangles, lines and points with a width in pixels, and lattices. Both
//! renderers draw it after the rest of the scene. Lines, points and lattices are antialiased, whatever the number of samples.

use choreo_asset::{Asset, DAabb};
use choreo_stage::{ActorState, EffectTarget, Snapshot, Stage};
use glam::{DAffine3, DVec3, Vec4};

/// Input of an effect that draws an overlay: the stage, and its state at a time.
///
/// ```
/// use choreo_plugin::glam::{DVec3, Vec4};
/// use choreo_plugin::motion::{Time, Transform};
/// use choreo_plugin::stage::Stage;
/// use choreo_plugin::{AssetBuilder, EffectScene, Triangle};
/// use std::sync::Arc;
///
/// let mut builder = AssetBuilder::default();
/// let root = builder.joint("root", None, Transform::IDENTITY)?;
/// builder.joint("tip", Some(root), Transform { translation: DVec3::Y.as_vec3(), ..Transform::IDENTITY })?;
/// let mut stage = Stage::default();
/// stage.cast("stick", Arc::new(builder.finish("stick")?));
/// let snapshot = stage.at(Time::ZERO)?;
/// let before = [snapshot.clone()];
/// let scene = EffectScene { stage: &stage, snapshot: &snapshot, before: &before, on: &[] };
/// let stick = scene.instances().next().unwrap();
/// assert_eq!((stick.bones(), stick.joint(1)), (vec![(0, None), (1, Some(0))], Some(DVec3::Y)));
/// assert_eq!(scene.earlier(&stick, 1).and_then(|then| then.joint(1)), Some(DVec3::Y));
/// // A triangle with a vertex at the upper bone.
/// let flag = Triangle { vertices: [DVec3::ZERO, DVec3::Y, DVec3::X], color: Vec4::ONE };
/// assert_eq!(flag.vertices[1], stick.joint(1).unwrap());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct EffectScene<'a> {
    /// The stage.
    pub stage: &'a Stage,
    /// The stage at the time of the frame.
    pub snapshot: &'a Snapshot,
    /// The states one frame ago, two frames ago and so on, as many as [`crate::Effect::history`] requests; before the first frame
    /// the first is repeated. Empty if a frame is drawn alone.
    pub before: &'a [Snapshot],
    /// Actors and materials to which the effect is limited; empty: everything.
    pub on: &'a [EffectTarget],
}

impl<'a> EffectScene<'a> {
    /// The visible actors with the effect, in the order of the stage; a model with several placements counts once for each.
    pub fn instances(&self) -> impl Iterator<Item = ActorInstance<'a>> + use<'a> {
        let (on, stage) = (self.on, self.stage);
        let actors = stage.actors.iter().zip(&self.snapshot.actors).enumerate();
        let seen = actors.filter(move |(index, (_, state))| {
            state.visible && EffectTarget::targets_include(on, *index, None)
        });
        seen.flat_map(|(index, (actor, state))| {
            actor.asset.first_placements(state.copies).map(move |place| {
                let place = DAffine3::from_cols(
                    place.matrix3.x_axis.as_dvec3(),
                    place.matrix3.y_axis.as_dvec3(),
                    place.matrix3.z_axis.as_dvec3(),
                    place.translation.as_dvec3(),
                );
                ActorInstance::new(index, &actor.asset, place, state)
            })
        })
    }

    /// The actor `frames` frames ago (1 or more), or at the earliest frame that is known. `None` if no earlier frame is known, or the actor
    /// was hidden then.
    pub fn earlier(&self, body: &ActorInstance<'a>, frames: usize) -> Option<ActorInstance<'a>> {
        let before = self.before.get(frames.checked_sub(1)?).or(self.before.last())?;
        let state = before.actors.get(body.actor).filter(|state| state.visible)?;
        Some(ActorInstance::new(body.actor, body.asset, body.place, state))
    }
}

/// A visible actor, or one of several placements of its model.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct ActorInstance<'a> {
    /// Index into `Stage::actors`.
    pub actor: usize,
    /// The asset of the actor.
    pub asset: &'a Asset,
    /// Pose and transform of the actor at the time.
    pub state: &'a ActorState,
    /// Placement of the model within the actor (model from model); the identity for a model without placements.
    pub place: DAffine3,
    /// Transform of the model into the world.
    pub world_from_model: DAffine3,
}

impl<'a> ActorInstance<'a> {
    fn new(actor: usize, asset: &'a Asset, place: DAffine3, state: &'a ActorState) -> ActorInstance<'a> {
        ActorInstance { actor, asset, state, place, world_from_model: state.world_from_model * place }
    }

    /// World position of a joint; `None` where there is none, or no finite position.
    pub fn joint(&self, joint: u32) -> Option<DVec3> {
        let at = self.state.model_from_joint.get(joint as usize)?.translation.as_dvec3();
        Some(self.world_from_model.transform_point3(at)).filter(|at| at.is_finite())
    }

    /// Joints of the actor's skins, or all joints if it has no skin, each with its nearest ancestor among them; parents first.
    pub fn bones(&self) -> Vec<(u32, Option<u32>)> {
        let skeleton = &self.asset.skeleton;
        let mut shown = vec![self.asset.skins.is_empty(); skeleton.len()];
        for joint in self.asset.skins.iter().flat_map(|skin| &skin.joints) {
            if let Some(shown) = shown.get_mut(*joint as usize) {
                *shown = true;
            }
        }
        let above = |mut joint: usize| {
            // Parents come first, so this ends.
            while let Some(parent) = skeleton.parents()[joint] {
                if shown[parent as usize] {
                    return Some(parent);
                }
                joint = parent as usize;
            }
            None
        };
        (0..skeleton.len()).filter(|j| shown[*j]).map(|joint| (joint as u32, above(joint))).collect()
    }

    /// Bounding box of the posed actor in the world, metres. Without a mesh it encloses the joints, without joints only the actor's
    /// position.
    pub fn bounds(&self) -> DAabb {
        let mut all = DAabb::EMPTY;
        for (reach, weights) in self.asset.instance_bounds().iter().zip(&self.state.morph_weights) {
            all.add_box(&self.world_from_model, &reach.posed(&self.state.model_from_joint, weights));
        }
        if all.is_empty() {
            let joints = 0..self.state.model_from_joint.len() as u32;
            joints.filter_map(|joint| self.joint(joint)).for_each(|at| all.add(at));
        }
        if all.is_empty() {
            all.add(self.world_from_model.translation);
        }
        all
    }
}

/// Geometry of an overlay, drawn in this order: lattices, triangles, strokes.
///
/// ```
/// use choreo_plugin::glam::{DVec3, Vec4};
/// use choreo_plugin::{Overlay, Stroke};
/// let axis = Stroke { from: DVec3::ZERO, to: DVec3::Y, width: 2.0, color: Vec4::ONE };
/// let overlay = Overlay { strokes: vec![axis], over: true, ..Overlay::default() };
/// # assert!(overlay.labels.is_empty());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlay {
    /// Lines and points.
    pub strokes: Vec<Stroke>,
    /// Triangles, drawn back to front by their middles.
    pub triangles: Vec<Triangle>,
    /// Planes of lines.
    pub lattices: Vec<Lattice>,
    /// Words.
    pub labels: Vec<Label>,
    /// Whether the overlay is drawn over everything, rather than hidden by nearer surfaces.
    pub over: bool,
    /// The parts that could not be made, and why; `choreo explain` prints them.
    pub left_out: Vec<String>,
}

impl Overlay {
    /// Largest number of strokes, and of triangles, of one effect in a frame.
    pub const MOST: usize = 100_000;
}

/// A two-sided, unlit triangle that casts no shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// World, metres.
    pub vertices: [DVec3; 3],
    /// Linear, straight alpha.
    pub color: Vec4,
}

/// A line with round ends, or a disc if both ends are equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// World, metres.
    pub from: DVec3,
    /// The other end; world, metres.
    pub to: DVec3,
    /// Width in pixels of the image, 1 to 64.
    pub width: f32,
    /// Linear, straight alpha.
    pub color: Vec4,
}

/// Text right of a point, drawn over everything.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// World, metres.
    pub at: DVec3,
    /// The words.
    pub text: String,
    /// Font size in pixels.
    pub size: f32,
    /// Distance from the point to the beginning of the text, pixels.
    pub beside: f32,
    /// Linear, straight alpha.
    pub color: Vec4,
}

/// An infinite plane of perpendicular lines, visible within a disc around the point below the viewer.
///
/// ```
/// use choreo_plugin::Lattice;
/// use choreo_plugin::glam::{DVec3, Vec4};
/// // A floor of squares of one metre, each tenth line a thick one.
/// let (origin, along) = (DVec3::ZERO, [DVec3::X, DVec3::Z]);
/// let floor = Lattice { origin, along, cell: 1.0, every: 10, widths: [1.0, 2.0], color: Vec4::ONE, fade: 50.0 };
/// # assert_eq!(floor.every, 10);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Point at which two lines meet; world space, metres.
    pub origin: DVec3,
    /// Unit directions of the lines, perpendicular to each other.
    pub along: [DVec3; 2],
    /// Metres from line to line.
    pub cell: f64,
    /// Every Nth line is thick, and remains visible where thin lines are too dense for the pixels.
    pub every: u32,
    /// Widths of thin and of thick lines, pixels.
    pub widths: [f32; 2],
    /// Linear, straight alpha.
    pub color: Vec4,
    /// Radius in metres at which the lattice has faded out.
    pub fade: f64,
}
