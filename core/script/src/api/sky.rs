//! Image-based lighting: `sky`.

use super::keys;
use crate::call::{ApiError, Call, Reply, api, fields, unknown};
use crate::frame_callback;
use crate::value::SkyRef;
use choreo_asset::Panorama;
use choreo_stage::{Described, FieldValue, Sky};
use rhai::Dynamic;
use std::sync::Arc;

api! {
    /// Sets an environment map: light from all directions (image-based lighting, IBL) with reflections. `panorama`
    /// is "studio" (a built-in room with soft boxes) or an HDRI file (.hdr or .exr, equirectangular, twice as wide as high;
    /// its center is seen in the direction -z). It replaces the default sun, and the ambient light where the script
    /// sets none.
    /// - Options: {}.
    sky("panorama, options?") -> Sky = sky, options(|| fields::describe_options(&Sky::new(Panorama::studio()), &[]));
    /// Sets the rotation about the vertical axis, in degrees counter-clockwise seen from above.
    Sky.turn("degrees") = set_field, in_frames;
    /// Sets the factor of the sky's light (default 1).
    Sky.strength("value") = set_field, in_frames;
    /// Animates "turn" or "strength" with keyframes [[time, value], …]. `how`, easing and tangents
    /// as in Actor.key.
    Sky.key("property, keys, how?") = key;
}

/// The names of the built-in panoramas.
const BUILT_IN: &[&str] = &["studio"];

fn sky(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let options: Vec<&str> = Sky::FIELDS.iter().map(|field| field.name).collect();
    let o = c.options(1, &options)?;
    if let Some(before) = &c.stage_draft().sky_at {
        return Err(ApiError::new(format!(
            "sky: a stage has only one sky, already made in line {}",
            before.line
        ))
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
        true => Arc::new(read_panorama(c, &name)?),
    };
    let mut sky = Sky::new(panorama);
    fields::fill(c, &o, &mut sky)?;
    let mut stage_draft = c.stage_draft();
    stage_draft.sky = Some(sky);
    stage_draft.sky_at = Some(c.place.clone());
    Ok(Dynamic::from(SkyRef(0)))
}

fn read_panorama(c: &Call, name: &str) -> Result<Panorama, ApiError> {
    let bytes = c.context.read_file(name)?;
    let mut panorama = choreo_importer_kit::panorama::panorama(name, &bytes).map_err(|problem| {
        let text = ApiError::new(format!("sky: \"{}\" {}", problem.place, problem.what)).focus(name);
        match problem.hint {
            Some(hint) => text.hint(hint),
            None => text,
        }
    })?;
    let radiance = bytes.starts_with(b"#?");
    panorama.file = (radiance && c.context.loader.requested_parts().image_files).then(|| Arc::new(bytes));
    Ok(panorama)
}

fn set_field(c: &mut Call) -> Reply {
    let (field, value) = fields::field_and_value::<Sky>(c)?;
    match (c.in_frame, value) {
        (false, value) => (field.set)(c.stage_draft().sky()?, value),
        (true, FieldValue::Number(turn)) if field.name == "turn" => {
            frame_callback::edit_frame(|e| e.sky.turn = Some(turn))
        }
        (true, FieldValue::Number(strength)) => {
            frame_callback::edit_frame(|e| e.sky.strength = Some(strength as f32))
        }
        (true, _) => {}
    }
    c.receiver()
}

fn key(c: &mut Call) -> Reply {
    let sky = c.stage_draft().sky()?.clone();
    let channels = keys::channels_of(c, &sky)?;
    keys::replace_channels(&mut c.stage_draft().sky()?.channels, channels);
    c.receiver()
}
