//! Actors: an asset on stage, with its clips, constraints and placement.

use crate::stage::channel::Channel;
use crate::stage::clips::Layer;
use crate::stage::constraint::Constraint;
use crate::stage::described::{FieldType, described, fields};
use crate::stage::fade::fades_at;
use crate::stage::parenting::Parenting;
use crate::stage::path::PathFollowing;
use crate::stage::springs::ActorSprings;
use crate::stage::surfaces::SurfaceRule;
use choreo_asset::Asset;
use choreo_asset::hash::Writer;
use choreo_motion::ik::Limit;
use choreo_motion::{Skinning, Time};
use glam::{DQuat, DVec3, Vec4};
use std::sync::Arc;

described! {
    /// An asset on stage, by default at the origin and in its rest pose, with the spring bones of its file. The index in `Stage::actors` is
    /// its id; parents may come later than children.
    #[derive(Clone, Debug)]
    pub struct Actor(
        /// Name in scripts.
        name: String => str,
        /// Imported asset (model, skeleton, clips) that the actor shows.
        asset: Arc<Asset>,
    ) {
        /// Placement in the parent's space, else in the world, without keys.
        transform: Placement = Placement::default();
        /// Parents over time, sorted by start; before the first one the actor is in world space.
        parents: Vec<Parenting> = Vec::new(), hash |w: &mut Writer, parents: &[Parenting]| {
            // An actor without parents is written as when there was at most one parent.
            for parent in parents {
                (true, parent).hash(w);
            }
            false.hash(w);
        };
        /// Index of the actor that this one faces: it is turned about its parent's +Y so that its front points there, after its own
        /// rotation.
        face: Option<usize> = None;
        /// Layers of clips: the base layer, then those over it.
        layers: Vec<Layer> = Vec::new();
        /// Keyed properties.
        channels: Vec<Channel> = Vec::new();
        /// Joints that are turned to targets.
        look_at: Vec<LookAt> = Vec::new();
        /// Constraints over its clips; see `crate::stage::constraint` for their order.
        constraints: Vec<Constraint> = Vec::new();
        /// Limits of joints, by joint; they apply after clips and constraints.
        limits: Vec<(u32, Limit)> = Vec::new();
        /// Spring bones: hair, skirts and tails.
        springs: Option<Arc<ActorSprings>> = ActorSprings::of(&asset);
        /// Path that the actor follows from its placement. Root motion of its clips then only sets the pace.
        path_following: Option<Arc<PathFollowing>> = None;
        /// Whether the actor is visible. It is drawn only if all its parents are visible, too.
        visible: bool = true;
        /// Factor of every base color, linear RGBA.
        tint: Vec4 = Vec4::ONE;
        /// Line width that replaces that of its materials ([`choreo_asset::LineStyle`]).
        line_width: Option<f32> = None;
        /// Number of copies of its meshes that exist, counted from the first; `None`: all.
        copies: Option<u32> = None;
        /// Weights of expressions set in the script, which replace the clips' weights: (index into `Asset::expressions`, weight).
        expressions: Vec<(u32, f32)> = Vec::new();
        /// Morph weights set in the script, which replace the clips' weights: (mesh instance, target, weight).
        morphs: Vec<(u32, u32, f32)> = Vec::new();
        /// Whether the file's own lights shine when this actor is on stage.
        file_lights: bool = true;
        /// Skinning method for vertices with several joints.
        skinning: Skinning = Skinning::default();
        /// Rules for cutouts and transparency of its surfaces; of several rules for one option the last applies.
        surfaces: Vec<SurfaceRule> = Vec::new();
        /// Whether the actor casts and receives shadows.
        shadow: ActorShadow = ActorShadow::default();
    }
    fields {
        position: transform.translation, FieldType::Point, keys "position" Translation;
        rotation: transform.rotation, FieldType::Rotation, keys "rotation" Rotation;
        scale: transform.scale, FieldType::Scale, keys "scale" Scale;
        visible: visible, FieldType::Flag, keys "visible" Visible;
        tint: tint, FieldType::Color, keys "tint" Tint;
        /// of its lines and points
        width: line_width, FieldType::Number(0.0, 16384.0, ""), keys "width" LineWidth, lacks no_pen_reason;
        /// of its copies
        count: copies, FieldType::Number(0.0, 4294967295.0, ""), keys "count" Copies, lacks no_copies_reason;
    }
}

described! {
    /// Whether an actor casts and receives shadows.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct ActorShadow {
        /// Whether the actor casts shadows.
        cast: bool = true;
        /// Whether shadows fall on the actor, its own shadow among them.
        receive: bool = true;
    }
    fields {
        /// whether it casts shadows
        cast: cast, FieldType::Flag;
        /// whether shadows fall on it, its own among them
        receive: receive, FieldType::Flag;
    }
}

fn no_pen_reason(of: &Actor) -> Option<&'static str> {
    let has = of.asset.materials.iter().any(|m| m.line_style.is_some());
    (!has).then_some("has neither lines nor points with a width")
}

fn no_copies_reason(of: &Actor) -> Option<&'static str> {
    (!of.asset.has_copies()).then_some("has no copies")
}

described! {
    /// Position, rotation and scale in the space of a parent. f64 keeps images 10 000 km from the origin as precise as at the origin.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Placement {
        /// Position, metres.
        translation: DVec3 = DVec3::ZERO;
        /// Rotation of length 1.
        rotation: DQuat = DQuat::IDENTITY;
        /// Factor along each axis.
        scale: DVec3 = DVec3::ONE;
    }
    fields {
        position: translation, FieldType::Point, keys "position" Translation;
        rotation: rotation, FieldType::Rotation, keys "rotation" Rotation;
        scale: scale, FieldType::Scale, keys "scale" Scale;
    }
}

/// A parent: another actor, or one of its joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Index into `Stage::actors`.
    pub actor: usize,
    /// Joint of the parent's skeleton; `None` = the parent's own transform.
    pub joint: Option<u32>,
}

/// A joint turned towards a target: the direction that is the model's front in rest pose ([`Asset::front`]) is turned,
/// on the shortest way from the clip's pose, to point at it. Up to 80° it is turned
/// fully, and beyond that less and less (`LOOK_AT_LIMIT_RAD`).
#[derive(Clone, Debug, PartialEq)]
pub struct LookAt {
    /// Joint of the actor's skeleton that is turned.
    pub joint: u32,
    /// Target at which the joint points.
    pub target: Target,
    /// Stage time at which the look-at starts.
    pub start: Time,
    /// Stage time at which the look-at ends; `None`: never.
    pub end: Option<Time>,
    /// Fade-in after `start` and fade-out before `end`, eased.
    pub fade: Time,
    /// Share of the turn, 0..=1.
    pub weight: f32,
}

fields! { LookAt {
    from: start, FieldType::Time;
    until: end, FieldType::Time;
    fade: fade, FieldType::Duration;
    weight: weight, FieldType::Number(0.0, 1.0, "");
} }

/// A place in the world, fixed or moving; actors by their index in `Stage::actors`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A fixed place, metres.
    Point(DVec3),
    /// The middle of the actor's rest bounds, moved with the actor.
    Actor(usize),
    /// The origin of a joint, as it is posed.
    Joint {
        /// Index into `Stage::actors`.
        actor: usize,
        /// Joint of that actor's skeleton.
        joint: u32,
    },
}

impl Actor {
    /// The parent at a time, without the edits of callbacks; `None`: the actor is in world space.
    pub fn parent_at(&self, time: Time) -> Option<&Parenting> {
        self.parents.iter().rev().find(|parent| parent.has_begun(time))
    }
}

impl LookAt {
    /// Weight with fades, 0..=1; 0 outside `start..end`.
    pub(crate) fn weight_at(&self, time: Time) -> f32 {
        let Some([fade_in, fade_out]) = fades_at(time, self.start, self.end, self.fade) else { return 0.0 };
        (self.weight * fade_in * fade_out).clamp(0.0, 1.0)
    }
}
