//! Shots: one camera for each part of the timeline between two cuts.

use crate::bake::reduce::{Series, series};
use crate::bake::sample::Row;
use crate::bake::signals::{self, CameraPart, Quantity, Signal};
use crate::bake::{Baked, CAMERA_PARTS};
use choreo_plugin::ExportedScene;
use choreo_plugin::asset::Projection;
use choreo_plugin::motion::Time;
use choreo_plugin::stage::{CameraState, Evaluator, Stage, StageError};

#[derive(Clone, Debug)]
pub struct Shot {
    pub from: Time,
    /// The next cut, or the end.
    pub to: Time,
    /// How long the shot stays visible while it dissolves into the next one.
    pub fading: Time,
    pub name: String,
    /// The camera stands still: the shot has only its transform at the start.
    still: bool,
    pub projection: Projection,
    /// Position, rotation, lens.
    pub parts: [Series; 3],
}

pub fn of_stage(stage: &Stage, start: Time, end: Time) -> Vec<Shot> {
    let begun = stage.cuts.partition_point(|cut| cut.at <= start);
    let first = stage.cuts[..begun].last().map(|cut| cut.camera).or((!stage.cameras.is_empty()).then_some(0));
    let mut out = vec![shot(stage, start, first)];
    for cut in stage.cuts[begun..].iter().filter(|cut| cut.at < end) {
        if let Some(before) = out.last_mut() {
            (before.to, before.fading) = (cut.at, cut.dissolve);
            if before.from == before.to {
                out.pop();
            }
        }
        out.push(shot(stage, cut.at, Some(cut.camera)));
    }
    if let Some(last) = out.last_mut() {
        last.to = end;
    }
    out
}

fn shot(stage: &Stage, from: Time, camera: Option<usize>) -> Shot {
    let of = camera.and_then(|camera| stage.cameras.get(camera));
    Shot {
        from,
        to: from,
        fading: Time::ZERO,
        name: of.map_or_else(|| "camera".to_string(), |camera| camera.name.clone()),
        still: of.is_none_or(|camera| signals::is_still(stage, camera)),
        projection: Projection::default(),
        parts: Default::default(),
    }
}

/// Sets the camera curves of shots from sampled rows of camera signals.
pub(crate) fn take_moves(signals: &[Signal], rows: &[Row], shots: &mut [Shot]) {
    let find = |dissolving: bool, part: CameraPart| {
        let quantity = Quantity::Camera { dissolving, part };
        signals.iter().find(|signal| signal.quantity == quantity)
    };
    for shot in shots.iter_mut().filter(|shot| !shot.still) {
        for (part, out) in CAMERA_PARTS.into_iter().zip(&mut shot.parts) {
            let Some(signal) = find(false, part) else { continue };
            let value = |row: &Row, of: &Signal| Row {
                time: row.time,
                values: row.values[of.offset..][..of.width].to_vec(),
            };
            let on = |row: &&Row| shot.from <= row.time && row.time < shot.to;
            let mut own: Vec<Row> = rows.iter().filter(on).map(|row| value(row, signal)).collect();
            if let Some(fading) = find(true, part).filter(|_| shot.fading > Time::ZERO) {
                let after = |row: &&Row| shot.to <= row.time && row.time < shot.to + shot.fading;
                own.extend(rows.iter().filter(after).map(|row| value(row, fading)));
            }
            let signal = Signal { offset: 0, ..*signal };
            *out = series(&signal, &own.iter().collect::<Vec<&Row>>());
        }
    }
}

/// Evaluates the start of each shot: sets the projection of all shots, and the transform of those whose camera stands still.
pub(crate) fn place_still(scene: &ExportedScene, baked: &mut Baked<'_>) -> Result<(), StageError> {
    let mut evaluator = Evaluator::new(scene.stage.clone());
    for shot in &mut baked.shots {
        let state: CameraState = match shot.from == baked.start {
            true => baked.first.camera,
            false => evaluator.at(shot.from)?.camera,
        };
        shot.projection = state.projection;
        if !shot.parts[0].times.is_empty() {
            continue;
        }
        let mut values = Vec::new();
        for (part, out) in CAMERA_PARTS.into_iter().zip(&mut shot.parts) {
            signals::camera(&state, part, &mut values);
            let width = values.len();
            *out = Series { times: vec![shot.from], values: std::mem::take(&mut values), width };
        }
    }
    Ok(())
}
