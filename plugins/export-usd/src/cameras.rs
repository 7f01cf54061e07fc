//! Cameras: one for each shot, with the times of the shot.

use crate::frames::Frames;
use crate::layer::{DOUBLE, FLOAT, FLOAT2, Meta, Prim, STRING, Samples, TOKEN, Value};
use crate::motion::{add_transform_ops, animate, series_samples};
use crate::names::Names;
use choreo_exporter_kit::bake::shots::Shot;
use choreo_exporter_kit::{Baked, Series};
use choreo_plugin::asset::Projection;
use choreo_plugin::glam::{Quat, Vec3};
use choreo_plugin::motion::{Time, Transform};
use choreo_plugin::stage::Stage;

/// Focal lengths and apertures in USD are in tenths of a scene unit, here tenths of a metre.
const TENTHS_PER_METRE: f64 = 10.0;
/// Height of the film gate, metres. It and the focal length determine the field of view.
const FILM_HEIGHT: f64 = 0.024;
/// Far plane of a camera that has none, metres.
const DEFAULT_FAR: f32 = 1e6;
/// The largest error of a field of view between two keys, radians.
const ANGLE_TOLERANCE: f64 = 5e-5;

pub(crate) fn of_stage<'a>(
    stage: &Stage,
    baked: &Baked<'_>,
    frames: Frames,
    names: &mut Names,
) -> Vec<Prim<'a>> {
    let [width, height] = stage.settings.size.map(|n| f64::from(n.max(1)));
    let several = baked.shots.len() > 1;
    let name = |number: usize, shot: &Shot| match several {
        false => shot.name.clone(),
        true => format!("shot {} {}", number + 1, shot.name),
    };
    let shots = baked.shots.iter().enumerate();
    shots
        .map(|(number, shot)| camera(shot, names.add_unique(&name(number, shot)), width / height, frames))
        .collect()
}

fn camera<'a>(shot: &Shot, name: String, aspect: f64, frames: Frames) -> Prim<'a> {
    let mut out = Prim::new("Camera", name);
    let mut shot_metadata = vec![
        ("camera".to_string(), Meta::Text(shot.name.clone())),
        ("start".to_string(), Meta::Double(frames.time_code(shot.from))),
        ("end".to_string(), Meta::Double(frames.time_code(shot.to))),
    ];
    if shot.fading > Time::ZERO {
        shot_metadata.push(("dissolve".to_string(), Meta::Double(frames.duration_in_frames(shot.fading))));
    }
    out.custom = vec![("shot".into(), Meta::Dictionary(shot_metadata))];
    // The same data as custom properties, which programs such as Blender show. Seconds, as in glTF.
    out.set(STRING, "userProperties:camera", Value::text(&shot.name));
    for (name, time) in [("start", shot.from), ("end", shot.to)] {
        let seconds = frames.time_code(time) / frames.per_second();
        out.set(DOUBLE, format!("userProperties:{name}"), Value::one([seconds]));
    }
    let [position, rotation, lens] = &shot.parts;
    let (near, far) = match shot.projection {
        Projection::Perspective { near, far, .. } => (near, far.unwrap_or(DEFAULT_FAR)),
        // Clipping ranges start at 0 or more: USD has no depths behind the camera.
        Projection::Orthographic { near, far, .. } => (near.max(0.0), far),
    };
    out.set_number(FLOAT2, "clippingRange", &[near, far]);
    match shot.projection {
        Projection::Perspective { .. } => {
            let film = FILM_HEIGHT * TENTHS_PER_METRE;
            out.set(FLOAT, "verticalAperture", Value::one([film]));
            out.set(FLOAT, "horizontalAperture", Value::one([film * aspect]));
            out.set(FLOAT, "focalLength", Value::one([focal_length(lens.first()[0].into())]));
            if !lens.is_still() {
                let place = out.properties.len() - 1;
                animate(&mut out, place, focal_lengths(lens, frames));
            }
        }
        Projection::Orthographic { .. } => {
            out.set(TOKEN, "projection", Value::text("orthographic"));
            for (name, factor) in
                [("horizontalAperture", aspect * TENTHS_PER_METRE), ("verticalAperture", TENTHS_PER_METRE)]
            {
                out.set(FLOAT, name, Value::one([f64::from(lens.first()[0]) * factor]));
                if !lens.is_still() {
                    let place = out.properties.len() - 1;
                    animate(&mut out, place, series_samples(lens, frames, |v| f64::from(v) * factor));
                }
            }
        }
    }
    let at = Transform {
        translation: Vec3::from_slice(position.first()),
        rotation: Quat::from_slice(rotation.first()),
        scale: Vec3::ONE,
    };
    let property_indices = add_transform_ops(&mut out, &at);
    for (series, property) in [(position, property_indices[0]), (rotation, property_indices[1])] {
        if !series.is_still() {
            animate(&mut out, property, series_samples(series, frames, f64::from));
        }
    }
    out
}

/// Halvings of the interval between two keys of an angle, at most.
const MAX_HALVINGS: u32 = 10;

fn focal_length(angle: f64) -> f64 {
    0.5 * FILM_HEIGHT * TENTHS_PER_METRE / libm::tan(0.5 * angle)
}

fn angle(focal_length: f64) -> f64 {
    2.0 * libm::atan(0.5 * FILM_HEIGHT * TENTHS_PER_METRE / focal_length)
}

/// Keys of a field of view as keys of a focal length. Adds keys where interpolated lengths would miss the interpolated angle.
fn focal_lengths<'a>(view_angles: &Series, frames: Frames) -> Samples<'a> {
    let (mut times, mut lengths) =
        (vec![view_angles.times[0]], vec![focal_length(view_angles.values[0].into())]);
    for (pair, angles) in view_angles.times.windows(2).zip(view_angles.values.windows(2)) {
        let [a, b] = [angles[0], angles[1]].map(f64::from);
        halve([(pair[0], a), (pair[1], b)], MAX_HALVINGS, &mut |time, angle| {
            times.push(time);
            lengths.push(focal_length(angle));
        });
    }
    Samples::of(frames.time_codes(&times), None, 1, lengths)
}

/// Passes on the second of two keys, preceded by as many keys as keep the field of view in the middle of each interval within
/// [`ANGLE_TOLERANCE`].
fn halve([a, b]: [(Time, f64); 2], depth: u32, receive: &mut impl FnMut(Time, f64)) {
    let between = angle(0.5 * (focal_length(a.1) + focal_length(b.1)));
    let middle = (a.0.middle(b.0), 0.5 * (a.1 + b.1));
    if depth == 0 || middle.0 <= a.0 || (between - middle.1).abs() <= ANGLE_TOLERANCE {
        return receive(b.0, b.1);
    }
    halve([a, middle], depth - 1, receive);
    halve([middle, b], depth - 1, receive);
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::motion::FrameRate;

    #[test]
    fn sampled_focal_lengths_follow_a_linear_angle_of_view() {
        let frames = Frames { start: Time::ZERO, rate: FrameRate { num: 24, den: 1 } };
        let times = vec![Time::ZERO, Time::from_secs(2.0)];
        let samples = focal_lengths(&Series { times, values: vec![0.2, 1.6], width: 1 }, frames);
        let crate::layer::SampleValues::Numbers { each, .. } = samples.values else { panic!("numbers") };
        let mut lengths = Vec::new();
        each(&mut |row| {
            lengths.push(row[0]);
            Ok(())
        })
        .unwrap();
        for (i, pair) in lengths.windows(2).enumerate() {
            let time = 0.5 * (samples.times[i] + samples.times[i + 1]);
            let truth = 0.2 + 1.4 * time / 48.0;
            let found = angle(0.5 * (pair[0] + pair[1]));
            assert!((found - truth).abs() < 4.0 * ANGLE_TOLERANCE, "{found} is not {truth}");
        }
        assert!(lengths.len() > 4 && lengths.len() < 200, "{}", lengths.len());
    }
}
