//! Parents of an actor, one after the other.

use crate::stage::actor::{Attachment, Placement};
use crate::stage::described::{FieldType, described};
use choreo_motion::Time;

/// A parent constraint over time (Blender's Child Of): the actor moves with a parent until its next one starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Parenting {
    /// `None`: the world; the actor is detached.
    pub to: Option<Attachment>,
    /// [`Time::MIN`]: it has always been so.
    pub start: Time,
    /// How long the change from the parent before takes, eased.
    pub blend: Time,
    /// The world transform at the start stays as it is; else the actor's own placement is in the space of the parent.
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
        /// `None`: it has always been so.
        from: Option<Time> = None;
        /// Time at which the parent before counts again.
        until: Option<Time> = None;
        /// How long the change takes.
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

    /// Whether it counts: a kept transform continues that of the parent before, which still counts at its very start.
    pub(crate) fn has_begun(&self, time: Time) -> bool {
        if self.keep { self.start < time } else { self.start <= time }
    }
}
