//! Image-based lighting: `sky`.

use super::keys;
use crate::call::{ApiError, Call, Reply, api, unknown};
use crate::hook;
use crate::load::from_load;
use crate::value::SkyRef;
use choreo_asset::Panorama;
use choreo_stage::Sky;
use rhai::Dynamic;
use std::sync::Arc;

api! {
    /// Sets an environment map: light from all directions (image-based lighting, IBL) with reflections. `panorama`
    /// is "studio" (a built-in room with soft boxes) or an HDRI file (.hdr, equirectangular, twice as wide as high;
    /// its center is seen in the direction -z). It replaces the default sun, and the ambient light where the script
    /// sets none.
    /// - Options: turn (degrees about the vertical axis, counter-clockwise seen from above, default 0), strength (0
    ///   to 1000, default 1), background (true: visible as background, default false).
    sky("panorama, options?") -> Sky = sky;
    /// Sets the rotation about the vertical axis, in degrees counter-clockwise seen from above.
    Sky.turn("degrees") = turn, in_frames;
    /// Sets the factor of its light (default 1).
    Sky.strength("value") = strength, in_frames;
    /// Animates "turn" or "strength" with keyframes [[time, value], …]. `how` and easing as in Actor.key.
    Sky.key("property, keys, how?") = key;
}

/// The names of the built-in panoramas.
const BUILT_IN: &[&str] = &["studio"];

fn sky(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let o = c.options(1, &["turn", "strength", "background"])?;
    if let Some(before) = &c.build().sky_at {
        return Err(ApiError::new(format!("sky: a stage has one, already made in line {}", before.line))
            .hint("key its turn and strength instead"));
    }
    let panorama = match name.contains('.') {
        false if BUILT_IN.contains(&name.as_str()) => Panorama::studio(),
        false => {
            let error = unknown("sky", &name, "", BUILT_IN.iter().copied());
            let hint =
                error.hint.clone().unwrap_or_else(|| "or name a panorama file, like \"hall.hdr\"".into());
            return Err(error.hint(hint));
        }
        true => Arc::new(read(c, &name)?),
    };
    let sky = Sky {
        turn: o.number_in("turn", -1e6, 1e6)?.unwrap_or(0.0).to_radians(),
        strength: o.number_in("strength", 0.0, 1000.0)?.unwrap_or(1.0) as f32,
        background: o.flag("background")?.unwrap_or(false),
        ..Sky::new(panorama)
    };
    let mut build = c.build();
    build.sky = Some(sky);
    build.sky_at = Some(c.place.clone());
    Ok(Dynamic::from(SkyRef(0)))
}

fn read(c: &Call, name: &str) -> Result<Panorama, ApiError> {
    let loader = &c.shared.loader;
    let start = c.shared.test().scene.as_ref().map(|scene| scene.folder.clone());
    let found = loader.find_in(loader.folders(), start.as_deref(), name);
    let found = found.map_err(|e| from_load(e).focus(name))?;
    let bytes = loader.folders().read(&found, name).map_err(|e| from_load(e).focus(name))?;
    loader.note_used(&found.path, &bytes);
    choreo_importer_kit::panorama::panorama(name, &bytes).map_err(|problem| {
        let text = ApiError::new(format!("sky: \"{}\" {}", problem.place, problem.what)).focus(name);
        match problem.hint {
            Some(hint) => text.hint(hint),
            None => text,
        }
    })
}

fn turn(c: &mut Call) -> Reply {
    let turn = c.number_in(0, -1e6, 1e6)?.to_radians();
    match c.in_frame {
        true => hook::edit(|e| e.sky.turn = Some(turn)),
        false => c.build().sky()?.turn = turn,
    }
    c.itself()
}

fn strength(c: &mut Call) -> Reply {
    let strength = c.number_in(0, 0.0, 1000.0)? as f32;
    match c.in_frame {
        true => hook::edit(|e| e.sky.strength = Some(strength)),
        false => c.build().sky()?.strength = strength,
    }
    c.itself()
}

fn key(c: &mut Call) -> Reply {
    let channels = keys::read(c, keys::Owner::Sky)?;
    keys::replace(&mut c.build().sky()?.channels, channels);
    c.itself()
}
