//! Positions, rotations, speeds and accelerations of the tested objects.

use super::{select_measure, subject_word};
use crate::api::actor::attachment;
use crate::call::{ApiError, Call, Reply};
use crate::test_data::{Measure, Quantity, RotationQuantity, Subject, VectorQuantity};
use choreo_stage::Attachment;

const SUBJECT_KINDS: &str = "an Actor, Joint, Camera or Light";

pub(super) fn position(c: &mut Call) -> Reply {
    let subject = c.subject(SUBJECT_KINDS)?;
    select_measure(c, Measure::Vector(VectorQuantity::Position(subject, None)))
}

pub(super) fn rotation(c: &mut Call) -> Reply {
    let measure = match c.expect()?.measure {
        Measure::Vector(VectorQuantity::Position(subject, relative)) => {
            Measure::Rotation(RotationQuantity::Of(subject, relative))
        }
        other => return Err(c.not_for(SUBJECT_KINDS, &other)),
    };
    select_measure(c, measure)
}

pub(super) fn direction(c: &mut Call) -> Reply {
    let subject = c.subject(SUBJECT_KINDS)?;
    select_measure(c, Measure::Vector(VectorQuantity::Direction(subject)))
}

pub(super) fn scale(c: &mut Call) -> Reply {
    let subject = match c.subject("an Actor or Joint")? {
        subject @ (Subject::Actor(_) | Subject::Joint { .. }) => subject,
        other => {
            return Err(ApiError::new(format!("scale: {} has no scale", subject_word(other))));
        }
    };
    select_measure(c, Measure::Vector(VectorQuantity::Scale(subject)))
}

pub(super) fn size(c: &mut Call) -> Reply {
    let actor = c.actor_subject()?;
    select_measure(c, Measure::Vector(VectorQuantity::Size(actor)))
}

pub(super) fn relative_to(c: &mut Call) -> Reply {
    let to: Attachment = attachment(c, 0)?;
    let measure = match c.expect()?.measure {
        Measure::Vector(VectorQuantity::Position(subject, _)) => {
            Measure::Vector(VectorQuantity::Position(subject, Some(to)))
        }
        Measure::Rotation(RotationQuantity::Of(subject, _)) => {
            Measure::Rotation(RotationQuantity::Of(subject, Some(to)))
        }
        other => return Err(c.not_for("a position or a rotation", &other)),
    };
    select_measure(c, measure)
}

pub(super) fn in_picture(c: &mut Call) -> Reply {
    let camera = c.optional_camera(0)?;
    let subject = c.subject(SUBJECT_KINDS)?;
    select_measure(c, Measure::Vector(VectorQuantity::InImage(subject, camera)))
}

pub(super) fn component(c: &mut Call, axis: usize) -> Reply {
    let vector = c.vector()?;
    select_measure(c, Measure::Number(Quantity::Component(vector, axis)))
}

pub(super) fn length(c: &mut Call) -> Reply {
    let vector = c.vector()?;
    select_measure(c, Measure::Number(Quantity::Length(vector)))
}

pub(super) fn distance(c: &mut Call) -> Reply {
    let (subject, target) = (c.subject(SUBJECT_KINDS)?, c.target(0)?);
    select_measure(c, Measure::Number(Quantity::Distance(subject, target)))
}

pub(super) fn angle_to(c: &mut Call) -> Reply {
    let (subject, target) = (c.subject(SUBJECT_KINDS)?, c.target(0)?);
    select_measure(c, Measure::Number(Quantity::AngleTo(subject, target)))
}

pub(super) fn speed(c: &mut Call) -> Reply {
    let vector = c.vector()?;
    select_measure(c, Measure::Number(Quantity::Speed(vector)))
}

pub(super) fn acceleration(c: &mut Call) -> Reply {
    let vector = c.vector()?;
    select_measure(c, Measure::Number(Quantity::Acceleration(vector)))
}

pub(super) fn jerk(c: &mut Call) -> Reply {
    let vector = c.vector()?;
    select_measure(c, Measure::Number(Quantity::Jerk(vector)))
}

pub(super) fn turn_speed(c: &mut Call) -> Reply {
    let rotation = match c.expect()?.measure {
        Measure::Rotation(rotation) => rotation,
        Measure::Vector(VectorQuantity::Position(subject, relative)) => {
            RotationQuantity::Of(subject, relative)
        }
        other => return Err(c.not_for(SUBJECT_KINDS, &other)),
    };
    select_measure(c, Measure::Number(Quantity::TurnSpeed(rotation)))
}
