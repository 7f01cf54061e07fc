//! Parts of a scene that USD has no place for.

use choreo_plugin::motion::PropertyTarget;
use choreo_plugin::stage::{Stage, ViewTransform};
use std::collections::BTreeSet;

/// Adds what the stage has.
pub fn of_stage(stage: &Stage, out: &mut BTreeSet<&'static str>) {
    let settings = &stage.settings;
    let lights = |target: PropertyTarget| {
        use PropertyTarget::{LightColor, LightIntensity, LightRange, SpotInner, SpotOuter};
        matches!(target, LightColor(_) | LightIntensity(_) | LightRange(_) | SpotInner(_) | SpotOuter(_))
    };
    let clips = || stage.actors.iter().flat_map(|a| &a.layers).flat_map(|l| &l.cues).map(|cue| &cue.clip);
    let varies = |property| stage.actors.iter().flat_map(|a| &a.channels).any(|c| c.property == property);
    for (is_there, what) in [
        (!stage.effects.is_empty(), "effects"),
        (!stage.layers_2d.is_empty(), "2D layers"),
        (stage.sky.is_some(), "the sky"),
        (settings.exposure != 0.0, "exposure"),
        (settings.view_transform != ViewTransform::default(), "the view transform"),
        (stage.actors.iter().any(|a| !a.surfaces.is_empty()), "rules of surfaces"),
        (stage.actors.iter().any(|a| !a.shadow.cast || !a.shadow.receive), "actors without shadows"),
        (stage.actors.iter().any(|a| a.line_width.is_some()), "line widths"),
        (varies(choreo_plugin::stage::Property::Copies), "a number of copies that changes"),
        (clips().any(|clip| clip.properties().any(|(target, _)| lights(target))), "moving lights of files"),
    ] {
        if is_there {
            out.insert(what);
        }
    }
}

/// The note about all of it; a background is always there.
pub fn note(losses: &BTreeSet<&'static str>) -> String {
    let all: Vec<&str> = losses.iter().copied().chain(["the background"]).collect();
    format!("USD has no place for these, which are left out: {}", all.join(", "))
}
