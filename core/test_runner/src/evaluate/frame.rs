//! Positions and extents of actors in the image, computed from the posed vertices.

use super::Judgment;
use super::band::{Band, Series, judge_band};
use super::judge_error::JudgeError;
use super::snapshot_cache::SnapshotCache;
use super::text_format;
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_script::testing::{Expectation, InFrame, Subject};
use choreo_stage::posed_meshes;
use glam::{DAffine3, DVec3};

/// Bounding box of a posed actor in world space (minimum, maximum); NaN if it has no visible vertices.
pub(super) fn posed_bounds(
    snapshots: &mut SnapshotCache,
    actor: usize,
    time: Time,
) -> Result<(DVec3, DVec3), JudgeError> {
    let points = posed_vertices(snapshots, actor, time)?;
    let fold = |f: fn(DVec3, DVec3) -> DVec3| points.iter().copied().reduce(f).unwrap_or(DVec3::NAN);
    Ok((fold(DVec3::min), fold(DVec3::max)))
}

fn posed_vertices(snapshots: &mut SnapshotCache, actor: usize, time: Time) -> Result<Vec<DVec3>, JudgeError> {
    let snapshot = snapshots.at(time)?;
    let (Some(state), Some(of)) = (snapshot.actors.get(actor), snapshots.stage.actors.get(actor)) else {
        return Ok(Vec::new());
    };
    let meshes = posed_meshes(&of.asset, state);
    Ok(meshes.into_iter().flat_map(|m| m.primitives).flat_map(|p| p.positions).collect())
}

/// A camera at a time: transforms from world space to the image.
pub(super) struct CameraView {
    view_from_world: DAffine3,
    projection: Projection,
    aspect: f64,
}

impl CameraView {
    pub(super) fn new(
        snapshots: &mut SnapshotCache,
        camera: Option<usize>,
        time: Time,
    ) -> Result<CameraView, JudgeError> {
        let [width, height] = snapshots.stage.settings.size.map(|n| f64::from(n.max(1)));
        let state = snapshots.camera_state(camera, time)?;
        Ok(CameraView {
            view_from_world: state.world_from_view.inverse(),
            projection: state.projection,
            aspect: width / height,
        })
    }

    /// Half the height of the view in metres, at a depth in front of the camera.
    fn half_height(&self, depth: f64) -> f64 {
        match self.projection {
            Projection::Perspective { yfov, .. } => libm::tan(f64::from(yfov) / 2.0) * depth,
            Projection::Orthographic { height, .. } => f64::from(height) / 2.0,
        }
    }

    /// Projects a point in world space: x from 0 (left) to 1 (right), y from 0 (top) to 1 (bottom), z in metres in front of the camera. x
    /// and y are NaN behind a perspective camera.
    pub(super) fn project(&self, world: DVec3) -> DVec3 {
        let p = self.view_from_world.transform_point3(world);
        let depth = -p.z;
        let perspective = matches!(self.projection, Projection::Perspective { .. });
        if perspective && depth <= 0.0 {
            return DVec3::new(f64::NAN, f64::NAN, depth);
        }
        let half = self.half_height(depth);
        DVec3::new(0.5 + 0.5 * p.x / (half * self.aspect), 0.5 - 0.5 * p.y / half, depth)
    }
}

/// Bounding box of an actor in the image.
pub(super) struct ImageBounds {
    pub min: DVec3,
    pub max: DVec3,
    /// Fraction of the vertices that are in the image, 0..=1.
    pub share: f64,
    behind_camera: bool,
}

impl ImageBounds {
    pub(super) fn height(&self) -> f64 {
        self.max.y - self.min.y
    }

    /// Distance by which the box crosses the margin, as a fraction of the image; at most 0 if it stays inside.
    fn distance_outside(&self, margin: f64) -> f64 {
        if self.behind_camera {
            return f64::INFINITY;
        }
        let (low, high) = (margin, 1.0 - margin);
        [low - self.min.x, self.max.x - high, low - self.min.y, self.max.y - high]
            .into_iter()
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

pub(super) fn image_bounds(
    snapshots: &mut SnapshotCache,
    actor: usize,
    camera: Option<usize>,
    time: Time,
) -> Result<ImageBounds, JudgeError> {
    let view = CameraView::new(snapshots, camera, time)?;
    let points = posed_vertices(snapshots, actor, time)?;
    let mut image_bounds =
        ImageBounds { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY, share: 0.0, behind_camera: false };
    let mut inside = 0usize;
    for point in &points {
        let p = view.project(*point);
        if p.x.is_nan() {
            image_bounds.behind_camera = true;
            continue;
        }
        image_bounds.min = image_bounds.min.min(p);
        image_bounds.max = image_bounds.max.max(p);
        let within = (0.0..=1.0).contains(&p.x) && (0.0..=1.0).contains(&p.y) && p.z > 0.0;
        inside += usize::from(within);
    }
    if points.is_empty() {
        (image_bounds.min, image_bounds.max) = (DVec3::NAN, DVec3::NAN);
        image_bounds.share = f64::NAN;
    } else {
        image_bounds.share = inside as f64 / points.len() as f64;
    }
    Ok(image_bounds)
}

/// Angle in degrees, in the image, between up and the subject's +y axis, 0..=180; 90 if the axis points straight towards or away from the
/// camera.
pub(super) fn tilt_deg(
    snapshots: &mut SnapshotCache,
    subject: Subject,
    camera: Option<usize>,
    time: Time,
) -> Result<f64, JudgeError> {
    let world_from = snapshots.world_from_subject(subject, time)?;
    let view = CameraView::new(snapshots, camera, time)?;
    let p = view.view_from_world.transform_point3(world_from.translation);
    let up = view.view_from_world.transform_vector3(world_from.matrix3.y_axis).normalize_or_zero();
    let (x, y) = match view.projection {
        Projection::Orthographic { .. } => (up.x, up.y),
        // Derivatives of x/depth and y/depth along the subject's +y axis, times depth².
        Projection::Perspective { .. } => {
            let depth = -p.z;
            if depth <= 0.0 || depth.is_nan() {
                return Ok(f64::NAN);
            }
            (up.x * depth + p.x * up.z, up.y * depth + p.y * up.z)
        }
    };
    if libm::hypot(x, y) < 1e-12 {
        return Ok(90.0);
    }
    Ok(libm::atan2(x.abs(), y).to_degrees())
}

pub(super) fn judge(snapshots: &mut SnapshotCache, e: &Expectation, claim: &InFrame) -> Judgment {
    match try_judge(snapshots, e, claim) {
        Ok(judged) => judged,
        Err(why) => Judgment::impossible("an image to check", why),
    }
}

fn try_judge(
    snapshots: &mut SnapshotCache,
    e: &Expectation,
    claim: &InFrame,
) -> Result<Judgment, JudgeError> {
    let name = super::vector::subject_name(snapshots, Subject::Actor(claim.actor));
    let mut expected = match claim.margin > 0.0 {
        true => format!("{name} inside the image, {} free at each side", percent(claim.margin)),
        false => format!("{name} inside the image"),
    };
    if let Some((low, high)) = claim.height {
        expected.push_str(&format!(", {} to {} of its height", percent(low), percent(high)));
    }
    if let Some(upright) = claim.upright {
        expected.push_str(&format!(", tilted by at most {}°", text_format::number(upright)));
    }
    let times = snapshots.times_and_ends(e)?;
    let (mut distances, mut heights, mut got_texts) = (Vec::new(), Vec::new(), Vec::new());
    for time in &times {
        let visible = snapshots.at(*time)?.actors.get(claim.actor).is_some_and(|state| state.visible);
        let image_bounds = image_bounds(snapshots, claim.actor, claim.camera, *time)?;
        let mut worst = image_bounds.distance_outside(claim.margin);
        let mut got = match (visible, image_bounds.behind_camera) {
            (false, _) => "it is hidden".to_string(),
            (true, true) => "a part of it is behind the camera".to_string(),
            (true, false) => format!(
                "x from {} to {}, y from {} to {}",
                percent(image_bounds.min.x),
                percent(image_bounds.max.x),
                percent(image_bounds.min.y),
                percent(image_bounds.max.y)
            ),
        };
        if !visible || image_bounds.min.x.is_nan() {
            worst = f64::INFINITY;
        }
        if let (Some((low, high)), true) = (claim.height, worst.is_finite()) {
            worst = worst.max(low - image_bounds.height()).max(image_bounds.height() - high);
            got.push_str(&format!(", {} high", percent(image_bounds.height())));
        }
        if let (Some(upright), true) = (claim.upright, worst.is_finite()) {
            let tilt = tilt_deg(snapshots, Subject::Actor(claim.actor), claim.camera, *time)?;
            worst = worst.max((tilt - upright) / 180.0);
            got.push_str(&format!(", tilted by {}°", text_format::number((tilt * 10.0).round() / 10.0)));
        }
        distances.push(worst);
        heights.push(image_bounds.height());
        got_texts.push(got);
    }
    let series = Series { times, values: heights };
    let allowed = claim.height.map_or([f64::NEG_INFINITY, f64::INFINITY], |(low, high)| [low, high]);
    let band = Band {
        allowed: vec![allowed; distances.len()],
        distances,
        expected_curve: Vec::new(),
        tolerance: 0.0,
        description: expected,
    };
    // Values are off, not unknown, if the actor is hidden or behind the camera.
    let known = Series {
        times: series.times.clone(),
        values: series.values.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect(),
    };
    let mut judged = judge_band(&known, &band, e, &format!("{name} height in the image"), "");
    let worst = judged.traces.first().and_then(|trace| trace.mark).unwrap_or(0.0);
    if let Some(i) = series.times.iter().position(|t| t.as_secs() == worst) {
        let when = judged.got.split_once(" at ").map_or(String::new(), |(_, when)| format!(" at {when}"));
        judged.got = format!("{}{when}", got_texts[i]);
        judged.by = match band.distances[i].is_finite() && !e.negated {
            true => format!("{} of the image", percent(band.distances[i].max(0.0))),
            false => String::new(),
        };
    }
    judged.hint = "x and y run from 0 % at the top left to 100 %; move the camera or widen its fov".into();
    Ok(judged)
}

fn percent(share: f64) -> String {
    if !share.is_finite() {
        return "nothing".into();
    }
    format!("{} %", text_format::number((share * 1000.0).round() / 10.0 + 0.0))
}
