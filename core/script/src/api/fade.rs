//! Fades of the whole image from a color and to a color: `fade_in` and `fade_out`.

use crate::build::{FadeDraft, check_limit};
use crate::call::{Call, Reply, api};
use crate::value::Layer2dRef;
use choreo_motion::{Interpolation, Time};
use choreo_stage::{Channel, Layer2d, Layer2dContent, Property};
use glam::{DVec2, Vec4};
use rhai::Dynamic;

api! {
    /// Fades the image in from a color. 2D layers that come later in the script stay above it. Options: from (time,
    /// default 0), color (default black).
    fade_in("seconds, options?") -> Layer2d = fade_in;
    /// Fades the image out to a color, which stays until a fade_in. 2D layers that come later in the script stay above
    /// it. Options: until (time at which only the color is left, default the last frame of the stage), color (default
    /// black).
    fade_out("seconds, options?") -> Layer2d = fade_out;
}

fn fade_in(c: &mut Call) -> Reply {
    let seconds = c.duration(0)?;
    let o = c.options(1, &["from", "color"])?;
    let from = o.get("from").map(|v| c.stage_time(&v, "fade_in: from")).transpose()?;
    let from = from.unwrap_or(c.stage_draft().sequence_start);
    let color = o.color("color")?.unwrap_or(Vec4::W);
    let mut stage_draft = c.stage_draft();
    // Fades to a color that ended before this time end here.
    let drafts = stage_draft.fades.clone();
    for fade_out in drafts.iter().filter(|fade| fade.fades_out && fade.at <= from) {
        let layer = stage_draft.layer_2d(fade_out.layer)?;
        layer.end = Some(layer.end.map_or(from, |end| end.min(from)));
    }
    drop(stage_draft);
    add_fade_panel(
        c,
        color,
        (from, 1.0),
        (from + seconds, 0.0),
        FadeDraft { layer: 0, fades_out: false, at: from },
    )
}

fn fade_out(c: &mut Call) -> Reply {
    let seconds = c.duration(0)?;
    let o = c.options(1, &["until", "color"])?;
    let until = o.get("until").map(|v| c.stage_time(&v, "fade_out: until")).transpose()?;
    let last_frame = {
        let settings = &c.stage_draft().settings;
        settings.length - settings.fps.time_of(1)
    };
    let until = until.unwrap_or(last_frame);
    let color = o.color("color")?.unwrap_or(Vec4::W);
    add_fade_panel(
        c,
        color,
        (until - seconds, 0.0),
        (until, 1.0),
        FadeDraft { layer: 0, fades_out: true, at: until },
    )
}

/// Adds a panel over the whole image, whose opacity is keyed from `first` to `second`, each (time, opacity).
fn add_fade_panel(c: &Call, color: Vec4, first: (Time, f64), second: (Time, f64), fade: FadeDraft) -> Reply {
    let mut layer = Layer2d::new(Layer2dContent::Panel { size: DVec2::ONE, color });
    layer.start = first.0;
    layer.channels = vec![Channel {
        property: Property::Opacity,
        interpolation: Interpolation::Linear,
        times: vec![first.0, second.0],
        values: vec![first.1, second.1],
    }];
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.layers_2d.len(), "2D layers", &c.context.limits)?;
    let fade_ins = stage_draft.fades.iter().filter(|fade| !fade.fades_out && fade.at >= second.0);
    layer.end = if fade.fades_out { fade_ins.map(|fade| fade.at).min() } else { Some(second.0) };
    let index = stage_draft.layers_2d.len();
    stage_draft.layers_2d.push(layer);
    stage_draft.fades.push(FadeDraft { layer: index, ..fade });
    Ok(Dynamic::from(Layer2dRef(index)))
}
