//! The expected values of comparisons: functions of time, rotations, lists of events.

use super::expect::subject;
use crate::build::{FrameCallbackDraft, ScriptContext};
use crate::call::{ApiError, Call, euler, numbers};
use crate::frame_callback::{ScriptCallback, with_copied_captures};
use crate::test_data::{EventPattern, Formula, RotationGoal};
use choreo_motion::Time;
use glam::{DQuat, DVec3};
use rhai::{Dynamic, FnPtr};
use std::sync::{Arc, PoisonError};

/// The tolerance argument, in the unit of the compared value.
pub(crate) fn tolerance(c: &Call, default: f64) -> Result<f64, ApiError> {
    if c.len() < 2 { Ok(default) } else { c.number_in(1, 0.0, 1e12) }
}

/// The function of time in an argument; `None` if the argument is no function. `widths`: allowed counts of the numbers that the
/// function returns.
pub(crate) fn formula(c: &Call, i: usize, widths: &'static [usize]) -> Result<Option<Formula>, ApiError> {
    let Some(callback) = c.value(i).try_cast::<FnPtr>() else { return Ok(None) };
    let callback = with_copied_captures(&callback)?;
    let Some(engine) = c.context.engine.lock().unwrap_or_else(PoisonError::into_inner).upgrade() else {
        return Err(ApiError::new("near: the script has ended"));
    };
    #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
    let native_context = {
        let mut native_context = c.native_context.store_data();
        native_context.global.num_operations = Default::default();
        native_context
    };
    let draft = FrameCallbackDraft { callback, native_context, at: c.place.clone() };
    let context: Arc<ScriptContext> = c.context.clone();
    let callback = ScriptCallback::new(engine, context, draft, "", 1);
    Ok(Some(Formula(Arc::new(move |time| {
        let given = callback.value_at(time)?;
        let single = crate::call::number(&given, "").ok().map(|n| vec![n]);
        let list = single.or_else(|| numbers(&given)).filter(|list| widths.contains(&list.len()));
        list.ok_or_else(|| {
            let widths: Vec<&str> =
                widths.iter().map(|w| if *w == 1 { "a number" } else { "[x, y, z]" }).collect();
            callback.diagnose(&ApiError::new(format!(
                "near: the function must give {}, got {} at {} s",
                widths.join(" or "),
                crate::call::describe(&given),
                time.as_secs()
            )))
        })
    }))))
}

pub(crate) fn rotation_goal(c: &Call) -> Result<RotationGoal, ApiError> {
    let given = c.value(0);
    if let Some(subject) = subject(&given) {
        return Ok(RotationGoal::Subject(subject));
    }
    if given.is_int() || given.is_float() {
        return Ok(RotationGoal::Rotation(euler(DVec3::new(0.0, c.number(0)?, 0.0))));
    }
    match numbers(&given).as_deref() {
        Some([x, y, z]) => Ok(RotationGoal::Rotation(euler(DVec3::new(*x, *y, *z)))),
        Some([x, y, z, w]) => {
            let q = DQuat::from_xyzw(*x, *y, *z, *w);
            // A quaternion that is far from unit length is a typing error.
            if (q.length() - 1.0).abs() > 1e-3 {
                return Err(ApiError::new(format!(
                    "near: this quaternion has length {:.4}, must be 1",
                    q.length()
                )));
            }
            Ok(RotationGoal::Rotation(q.normalize()))
        }
        _ => Err(c.wrong(
            0,
            "degrees about y, [x, y, z] in degrees, a quaternion [x, y, z, w], an Actor, Joint, Camera or Light",
        )),
    }
}

/// The expected events, `[[0.0, "anna: Walk starts"], "anna: Walk ends"]` or one text, and their tolerance.
pub(crate) fn events(c: &Call) -> Result<(Vec<EventPattern>, Time), ApiError> {
    let allowed = "an array of [time, text] or of texts";
    let given = c.value(0);
    let pattern = |v: &Dynamic| -> Result<EventPattern, ApiError> {
        if v.is_string() {
            return Ok(EventPattern { at: None, text: crate::call::text(v, "")? });
        }
        let pair = v.read_lock::<rhai::Array>().filter(|pair| pair.len() == 2 && pair[1].is_string());
        let pair = pair.ok_or_else(|| {
            crate::call::wrong(v, &format!("{}: an event", c.def.name), "[time, text] or a text")
        })?;
        let at = crate::call::time(&pair[0], &format!("{}: time of an event", c.def.name))?;
        Ok(EventPattern { at: Some(at), text: crate::call::text(&pair[1], "")? })
    };
    let patterns = if given.is_string() {
        vec![pattern(&given)?]
    } else {
        let Some(array) = given.read_lock::<rhai::Array>() else { return Err(c.wrong(0, allowed)) };
        array.iter().map(pattern).collect::<Result<Vec<_>, _>>()?
    };
    Ok((patterns, Time::from_secs(tolerance(c, 1e-6)?)))
}
