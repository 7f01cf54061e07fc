//! Actors: an asset on stage, with its clips, constraints and placement.

use crate::stage::channel::Channel;
use crate::stage::clips::Layer;
use crate::stage::constraint::Goal;
use crate::stage::fade::{eased, fraction};
use crate::stage::path::Walk;
use crate::stage::springs::ActorSprings;
use crate::stage::surfaces::SurfaceRule;
use choreo_asset::Asset;
use choreo_motion::ik::Limit;
use choreo_motion::{Ease, Skinning, Time};
use glam::{DQuat, DVec3, Vec4};
use std::sync::Arc;

/// An asset on stage. The index in `Stage::actors` is its id; parents may come later than children.
#[derive(Clone, Debug)]
pub struct Actor {
    pub name: String,
    pub asset: Arc<Asset>,
    pub transform: Placement,
    pub parent: Option<Attachment>,
    /// Turned about its parent's +Y so that +Z points to where this actor stands; its own rotation comes first.
    pub face: Option<usize>,
    pub layers: Vec<Layer>,
    pub channels: Vec<Channel>,
    pub look_at: Vec<LookAt>,
    /// What the body does beside its clips; see [`crate::stage::constraint`] for the order.
    pub goals: Vec<Goal>,
    /// How far joints may turn, whatever clips and goals do.
    pub limits: Vec<(u32, Limit)>,
    /// Hair, skirts and tails.
    pub springs: Option<Arc<ActorSprings>>,
    /// Goes along a path, from where it is placed. Its clips' root motion then only sets the pace.
    pub walk: Option<Arc<Walk>>,
    /// An actor is seen where it and all that it is attached to are visible.
    pub visible: bool,
    /// Multiplies every base colour, linear.
    pub tint: Vec4,
    /// In place of the widths of its pens ([`choreo_asset::Pen`]).
    pub pen_width: Option<f32>,
    /// So many of the copies of its meshes are there, the first ones; `None`: all.
    pub copies: Option<u32>,
    /// Morph weights by name or index set in the script: (mesh instance, target, weight), over the clips'.
    pub morphs: Vec<(u32, u32, f32)>,
    /// Weights of expressions set in the script: (index into `Asset::expressions`, weight), over the clips'.
    pub expressions: Vec<(u32, f32)>,
    /// Whether the file's own lights shine when this actor is on stage.
    pub file_lights: bool,
    /// How vertices follow several joints.
    pub skinning: Skinning,
    /// How its surfaces are cut out and mixed; of those that say the same thing the last counts.
    pub surfaces: Vec<SurfaceRule>,
}

/// Where something stands in its parent: f64, so that 10 000 km from the origin looks as the origin does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

impl Default for Placement {
    fn default() -> Self {
        Placement { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    pub actor: usize,
    /// Joint of the parent's skeleton; `None` = the parent's own transform.
    pub joint: Option<u32>,
}

/// A joint turned towards a target: the direction that is the model's +Z in rest pose (glTF characters face +Z) is turned,
/// on the shortest way from the clip's pose, to point at it. See [`crate::constraints::look_at::LOOK_AT_LIMIT_RAD`].
#[derive(Clone, Debug, PartialEq)]
pub struct LookAt {
    pub joint: u32,
    pub target: Target,
    pub start: Time,
    pub end: Option<Time>,
    /// In after `start` and out before `end`, eased.
    pub fade: Time,
    pub weight: f32,
}

/// A place in the world, fixed or moving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    Point(DVec3),
    /// The middle of the actor's rest bounds, moved with the actor.
    Actor(usize),
    Joint {
        actor: usize,
        joint: u32,
    },
}

impl LookAt {
    /// Weight with fades, 0..=1; 0 outside `start..end`.
    pub(crate) fn share(&self, time: Time) -> f32 {
        if time < self.start || self.end.is_some_and(|end| time >= end) {
            return 0.0;
        }
        let fade_in = eased(Ease::Smooth, fraction(time - self.start, self.fade));
        let fade_out = self.end.map_or(1.0, |end| eased(Ease::Smooth, fraction(end - time, self.fade)));
        (self.weight * fade_in * fade_out).clamp(0.0, 1.0)
    }
}
