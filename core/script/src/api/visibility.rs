//! Time span in which an actor is visible: `actor.from(time)`, `actor.until(time)`.

use super::keys;
use crate::call::{Call, Reply, api};
use crate::value::ActorRef;
use choreo_motion::{Interpolation, Time};
use choreo_stage::{Channel, Property};

api! {
    /// Shows the actor from this time on; before, it is hidden.
    Actor.from("time") = from;
    /// Hides the actor from this time on. A hidden actor costs nothing: it is neither posed nor drawn.
    Actor.until("time") = until;
}

fn from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |keys| {
        keys.retain(|(at, _)| *at > t);
        if t > Time::ZERO {
            keys.push((Time::ZERO, false));
        }
        keys.push((t, true));
    })
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |keys| {
        if keys.is_empty() && t > Time::ZERO {
            keys.push((Time::ZERO, true));
        }
        keys.retain(|(at, _)| *at < t);
        keys.push((t, false));
    })
}

/// Changes the keyframes of visibility.
fn change(c: &Call, change: impl FnOnce(&mut Vec<(Time, bool)>)) -> Reply {
    let this: ActorRef = c.this()?;
    {
        let mut build = c.build();
        let channels = &mut build.actor(this.id)?.actor.channels;
        let known = channels.iter().find(|channel| channel.property == Property::Visible);
        let mut all: Vec<(Time, bool)> = known.map_or_else(Vec::new, |channel| {
            channel.times.iter().copied().zip(channel.values.iter().map(|v| *v >= 0.5)).collect()
        });
        change(&mut all);
        all.sort_by_key(|(at, _)| *at);
        let channel = Channel {
            property: Property::Visible,
            interpolation: Interpolation::Step,
            times: all.iter().map(|(at, _)| *at).collect(),
            values: all.iter().map(|(_, on)| f64::from(u8::from(*on))).collect(),
        };
        keys::replace(channels, vec![channel]);
    }
    c.itself()
}
