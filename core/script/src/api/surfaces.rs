//! Options for alpha masks and transparency: `actor.surfaces(#{ … })`, and the same options of the stage.

use super::effect::named_materials;
use crate::call::{ApiError, Call, Options, Reply, api};
use crate::value::ActorRef;
use choreo_stage::{Cutouts, SurfaceRule, Transparency};

api! {
    /// Overrides for this actor how `stage(…)` draws its surfaces. Of several calls the last one wins.
    /// - Options: cutouts ("smooth" or "hard"), transparency ("sorted", "independent" or "auto"; a frame is drawn
    ///   order-independent if any surface asks for it or needs it, and a surface that is "sorted" never does),
    ///   material (a name or an array of names: only these materials).
    Actor.surfaces("options") = surfaces;
}

fn surfaces(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let o = c.options(0, &["cutouts", "transparency", "material"])?;
    let rule = SurfaceRule { material: None, cutouts: cutouts(&o)?, transparency: transparency(&o)? };
    if rule == SurfaceRule::default() {
        return Err(ApiError::new("surfaces: neither cutouts nor transparency is given"));
    }
    let materials = named_materials(&o, "surfaces", &this.asset)?;
    let mut stage_draft = c.stage_draft();
    let all = &mut stage_draft.actor(this.id)?.actor.surfaces;
    match materials {
        None => all.push(rule),
        Some(materials) => {
            all.extend(materials.into_iter().map(|m| SurfaceRule { material: Some(m), ..rule }));
        }
    }
    c.receiver()
}

/// The option `cutouts`.
pub(crate) fn cutouts(o: &Options) -> Result<Option<Cutouts>, ApiError> {
    Ok(o.one_of("cutouts", &["smooth", "hard"])?.map(|how| match how {
        "hard" => Cutouts::Hard,
        _ => Cutouts::Smooth,
    }))
}

/// The option `transparency`.
pub(crate) fn transparency(o: &Options) -> Result<Option<Transparency>, ApiError> {
    Ok(o.one_of("transparency", &["auto", "sorted", "independent"])?.map(|how| match how {
        "sorted" => Transparency::Sorted,
        "independent" => Transparency::Independent,
        _ => Transparency::Auto,
    }))
}
