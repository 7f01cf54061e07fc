//! Parents of an actor over time.

use crate::stage::actor::{Attachment, Placement};
use crate::stage::described::{FieldType, described};
use choreo_motion::Time;

/// A parent constraint over time (Blender's Child Of): the actor moves with a parent until its next one starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Parenting {
    /// The parent; `None`: the world, the actor is detached.
    pub to: Option<Attachment>,
    /// Stage time at which the parent takes effect; [`Time::MIN`]: it always has.
    pub start: Time,
    /// Duration of the change from the parent before, eased.
    pub blend: Time,
    /// Whether the world transform at the start is kept; else the actor's own placement is in the space of the parent.
    pub keep: bool,
    /// Effect of the parent's scale.
    pub scale: ParentScale,
    /// Position and rotation in the parent, instead of the actor's own; without `keep`.
    pub placement: Option<Placement>,
}

described! {
    /// The time and the way in which an actor takes another parent, as a script states them.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ParentChange {
        /// Stage time of the change; `None`: it has always been in effect.
        from: Option<Time> = None;
        /// Stage time at which the parent before takes effect again.
        until: Option<Time> = None;
        /// Duration of the change.
        blend: Option<Time> = None;
        /// See [`Parenting::keep`].
        keep: Option<bool> = None;
    }
    fields {
        from: from, FieldType::Time;
        until: until, FieldType::Time;
        /// how long the change takes
        blend: blend, FieldType::Duration;
        /// the actor stays where it is in the world
        keep: keep, FieldType::Flag;
    }
}

/// Effect of a parent's scale on its children.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ParentScale {
    /// The children keep their size, and are placed in metres.
    #[default]
    Keep,
    /// The children are scaled with the parent, and placed in its units.
    Inherit,
}

impl Parenting {
    /// A parent from the beginning on.
    pub fn always(to: Attachment) -> Parenting {
        Parenting {
            to: Some(to),
            start: Time::MIN,
            blend: Time::ZERO,
            keep: false,
            scale: ParentScale::Keep,
            placement: None,
        }
    }

    /// A parent from a time on; the world transform is kept.
    pub fn from(to: Option<Attachment>, start: Time) -> Parenting {
        Parenting { to, start, blend: Time::ZERO, keep: true, scale: ParentScale::Keep, placement: None }
    }

    /// Whether the parent is in effect at a time. With `keep` it is not yet in effect at the very start, where the parent before still
    /// gives the transform that is kept.
    pub(crate) fn has_begun(&self, time: Time) -> bool {
        if self.keep { self.start < time } else { self.start <= time }
    }
}
