//! Observations at the surveyed times, and the findings that follow from them.

use crate::constraints::look_at::LOOK_AT_LIMIT_RAD;
use crate::constraints::look_at::forward_in_joint;
use crate::lights;
use crate::snapshot::{LightState, Snapshot};
use crate::stage::Stage;
use crate::stage::actor::{Actor, Attachment, Target};
use crate::stage::camera::{Camera, Rig};
use crate::stage::channel::Property;
use crate::stage::edits::{ActorEdit, FrameEdits};
use crate::stage::light::StageLight;
use crate::survey::camera_view::CameraView;
use crate::survey::camera_view::OutOfView;
use crate::survey::reaches::ReachDistances;
use crate::survey::{Finding, Subject, active_durations};
use crate::transforms::target_position;
use choreo_asset::{Asset, DAabb};
use choreo_motion::Time;
use glam::{DVec3, Vec3};

/// Largest angle between a joint's forward direction and its target at which a look counts as reached.
const REACHED_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Plausible sizes of a character in metres; other sizes suggest a file in other units.
const PLAUSIBLE_METRES: std::ops::RangeInclusive<f64> = 0.05..=30.0;

#[derive(Clone, Debug, Default)]
struct ActorFacts {
    was_visible: bool,
    was_posed_by_callback: bool,
    was_in_image: bool,
    /// Longer side of its largest area in the image so far, pixels.
    max_pixels: f64,
    /// Side of the image on which it was missed: `Some(None)` once that differs from time to time.
    out_of_view: Option<Option<OutOfView>>,
}

#[derive(Clone, Debug, Default)]
struct LookAtFacts {
    was_active: bool,
    was_reached: bool,
}

#[derive(Clone, Debug, Default)]
struct LightFacts {
    has_shone: bool,
    has_reached_actor: bool,
}

#[derive(Clone, Debug, Default)]
struct CameraFacts {
    was_active: bool,
    has_seen_actor: bool,
    was_at_target: bool,
}

#[derive(Debug)]
pub(super) struct SurveyFacts {
    actors: Vec<ActorFacts>,
    look_ats: Vec<Vec<LookAtFacts>>,
    reaches: ReachDistances,
    lights: Vec<LightFacts>,
    /// One entry per camera; the last is for the framing camera of a stage without cameras.
    cameras: Vec<CameraFacts>,
    active_durations: Vec<Time>,
    pub times: usize,
    /// Whether the survey stopped before it had evaluated all frames.
    pub stopped_early: bool,
}

impl SurveyFacts {
    pub(super) fn new(stage: &Stage) -> SurveyFacts {
        SurveyFacts {
            actors: vec![ActorFacts::default(); stage.actors.len()],
            look_ats: stage.actors.iter().map(|a| vec![LookAtFacts::default(); a.look_at.len()]).collect(),
            reaches: ReachDistances::new(stage),
            lights: vec![LightFacts::default(); stage.lights.len()],
            cameras: vec![CameraFacts::default(); stage.cameras.len() + 1],
            active_durations: active_durations(stage),
            times: 0,
            stopped_early: false,
        }
    }

    /// Records the observations of one time.
    pub(super) fn record(&mut self, stage: &Stage, edits: &FrameEdits, snapshot: &Snapshot, time: Time) {
        self.times += 1;
        let view = CameraView::new(&snapshot.camera, stage.settings.size);
        let camera = snapshot.camera.camera.unwrap_or(stage.cameras.len());
        let mut boxes = Vec::with_capacity(stage.actors.len());
        for (index, (actor, state)) in stage.actors.iter().zip(&snapshot.actors).enumerate() {
            if !state.visible {
                continue;
            }
            let facts = &mut self.actors[index];
            facts.was_visible = true;
            let bounds = view.actor_bounds(&actor.asset, state);
            if bounds.is_empty() {
                continue;
            }
            match view.covered_pixels(&bounds) {
                Ok(pixels) => {
                    facts.was_in_image = true;
                    facts.max_pixels = facts.max_pixels.max(pixels);
                    self.cameras[camera].has_seen_actor = true;
                }
                Err(miss) => {
                    let same = facts.out_of_view.is_none_or(|before| before == Some(miss));
                    facts.out_of_view = Some(same.then_some(miss));
                }
            }
            boxes.push(bounds);
        }
        self.cameras[camera].was_active = true;
        if let Some(Rig::Fixed { look_at: Some(target), .. }) = stage.cameras.get(camera).map(|c| &c.rig) {
            let at = target_position(stage, &snapshot.actors, target);
            let from = snapshot.camera.world_from_view.translation;
            self.cameras[camera].was_at_target |= at.is_some_and(|at| (at - from).length() < 1e-6);
        }
        for (actor, edit) in &edits.actors {
            if let ActorEdit::TurnJoint { .. } = edit
                && let Some(facts) = self.actors.get_mut(*actor)
            {
                facts.was_posed_by_callback = true;
            }
        }
        self.record_look_ats(stage, snapshot, time);
        self.reaches.record(stage, snapshot, time);
        for (index, light) in stage.lights.iter().enumerate() {
            let state = lights::stage_light(stage, light, index, edits, time, &snapshot.actors);
            if let Some(state) = state {
                self.lights[index].has_shone = true;
                self.lights[index].has_reached_actor |= boxes.iter().any(|b| light_reaches(&state, &view, b));
            }
        }
    }

    fn record_look_ats(&mut self, stage: &Stage, snapshot: &Snapshot, time: Time) {
        for (index, (actor, state)) in stage.actors.iter().zip(&snapshot.actors).enumerate() {
            for (look, facts) in actor.look_at.iter().zip(&mut self.look_ats[index]) {
                // The look is off, or still fading.
                if look.weight_at(time) < 0.999 {
                    continue;
                }
                facts.was_active = true;
                let joint = look.joint as usize;
                let rest = actor.asset.rest_model_from_joint();
                let (Some(posed), Some(rest)) = (state.model_from_joint.get(joint), rest.get(joint)) else {
                    facts.was_reached = true;
                    continue;
                };
                let Some(target) = target_position(stage, &snapshot.actors, &look.target) else { continue };
                let target = state.world_from_model.inverse().transform_point3(target);
                let way = (target - Vec3::from(posed.translation).as_dvec3()).try_normalize();
                let ahead = Vec3::from(posed.matrix3 * forward_in_joint(rest, actor.asset.front()))
                    .as_dvec3()
                    .try_normalize();
                facts.was_reached |= match (way, ahead) {
                    (Some(way), Some(ahead)) => libm::acos(way.dot(ahead).clamp(-1.0, 1.0)) < REACHED_RAD,
                    // The target is in the joint.
                    _ => true,
                };
            }
        }
    }

    /// Whether another time could still remove a finding.
    pub(super) fn may_change(&self, stage: &Stage) -> bool {
        let is_unseen = |(actor, f): (&Actor, &ActorFacts)| {
            has_meshes(&actor.asset) && (!f.was_in_image || f.max_pixels < 1.0)
        };
        let has_callbacks = !stage.frame_callbacks.is_empty();
        stage.actors.iter().zip(&self.actors).any(is_unseen)
            || self.actors.iter().any(|f| !f.was_visible)
            || has_callbacks
                && stage
                    .actors
                    .iter()
                    .zip(&self.actors)
                    .any(|(a, f)| plays_no_clip(a) && !f.was_posed_by_callback)
            || self.look_ats.iter().flatten().any(|f| !f.was_active || !f.was_reached)
            || self.reaches.may_change(stage)
            || self.lights.iter().any(|f| !f.has_shone || !f.has_reached_actor)
            || stage
                .cameras
                .iter()
                .zip(&self.cameras)
                .any(|(c, f)| may_pass_its_target(c) && !f.was_at_target)
            || self
                .active_durations
                .iter()
                .zip(&self.cameras)
                .any(|(on, f)| *on > Time::ZERO && !(f.was_active && f.has_seen_actor))
    }

    pub(super) fn findings(&self, stage: &Stage) -> Vec<Finding> {
        let mut findings = Vec::new();
        for index in 0..stage.actors.len() {
            findings.extend(self.actor_findings(stage, index));
            findings.extend(self.look_findings(stage, index));
            findings.extend(self.reaches.findings(stage, index, &self.times_note()));
        }
        for (index, camera) in stage.cameras.iter().enumerate() {
            let facts = &self.cameras[index];
            let mut add = |rule, text: String, hint: &str| {
                let hint = (!hint.is_empty()).then(|| hint.to_string());
                findings.push(Finding { rule, note: false, subject: Subject::Camera(index), text, hint });
            };
            if facts.was_at_target {
                add(
                    "camera_in_target",
                    format!("camera \"{}\" is at the point that it looks at", camera.name),
                    "move it away: .at(x, y, z)",
                );
            } else if facts.was_active
                && !facts.has_seen_actor
                && stage.actors.iter().any(|a| has_meshes(&a.asset))
            {
                add(
                    "camera_sees_nothing",
                    format!(
                        "camera \"{}\" never has anything in its image{}",
                        camera.name,
                        self.times_note()
                    ),
                    "aim it with .look_at(actor), or leave .at out to frame everything",
                );
            }
        }
        for (index, light) in stage.lights.iter().enumerate() {
            findings.extend(self.light_findings(stage, index, light));
        }
        findings
    }

    /// The number of surveyed times, in words; empty if every frame was surveyed.
    fn times_note(&self) -> String {
        match self.stopped_early {
            true => format!(" (checked at {} times)", self.times),
            false => String::new(),
        }
    }

    fn actor_findings(&self, stage: &Stage, index: usize) -> Vec<Finding> {
        let (actor, facts) = (&stage.actors[index], &self.actors[index]);
        let name = &actor.name;
        let mut found = Vec::new();
        let mut add = |rule, note, text: String, hint: &str| {
            let hint = (!hint.is_empty()).then(|| hint.to_string());
            found.push(Finding { rule, note, subject: Subject::Actor(index), text, hint });
        };
        let is_used = is_used(stage, index);
        if !has_meshes(&actor.asset) {
            if !is_used {
                let text = format!("\"{name}\" has nothing to draw: \"{}\" holds no mesh", actor.asset.name);
                add("nothing_to_draw", false, text, "cast a file with a model; clips are played with .play");
            }
            return found;
        }
        if !facts.was_visible {
            if let Some(hidden) = hidden_parent(stage, &self.actors, index) {
                let text =
                    format!("\"{name}\" is never seen: it is attached to \"{hidden}\", which is hidden");
                add(
                    "attached_to_hidden",
                    false,
                    text,
                    "an attached actor is hidden together with its parent",
                );
            } else if !is_used {
                add("always_hidden", true, format!("\"{name}\" is hidden all the time"), "");
            }
            return found;
        }
        if !facts.was_in_image {
            let place = match facts.out_of_view {
                Some(Some(miss)) => format!(": it is {}", miss.description()),
                _ => String::new(),
            };
            let text = format!("\"{name}\" is never in the image{place}{}", self.times_note());
            add("never_in_picture", false, text, "");
        } else if facts.max_pixels < 1.0 {
            let text = format!(
                "\"{name}\" is never larger than {:.2} pixels{}",
                facts.max_pixels,
                self.times_note()
            );
            add(
                "smaller_than_a_pixel",
                false,
                text,
                "is its file in other units? .scale(100.0) makes metres of centimetres",
            );
        }
        if plays_no_clip(actor) && !facts.was_posed_by_callback && facts.was_in_image {
            let text = format!("\"{name}\" plays no clip: it stands in its rest pose");
            let clips = actor.asset.clips.iter().map(|c| format!("\"{}\"", c.name)).take(6);
            let clips: Vec<String> = clips.collect();
            let more = if actor.asset.clips.len() > clips.len() { ", …" } else { "" };
            add("no_clip", false, text, &format!("its file has {}{more}", clips.join(", ")));
        }
        if !actor.asset.skins.is_empty() && facts.was_in_image {
            let bounds = actor.asset.rest_bounds();
            let high = f64::from((bounds.max - bounds.min).max_element())
                * actor.transform.scale.abs().max_element();
            let keyed = actor.channels.iter().any(|c| c.property == Property::Scale);
            let many = !actor.asset.placements.is_empty();
            if bounds.is_empty()
                || many
                || keyed
                || !actor.parents.is_empty()
                || PLAUSIBLE_METRES.contains(&high)
            {
                return found;
            }
            let digits = if high < 0.001 { 9 } else { 3 };
            let text = format!("\"{name}\" is {high:.digits$} m large");
            add(
                "odd_size",
                true,
                text,
                "is its file in other units than metres? .scale(0.01) makes metres of centimetres",
            );
        }
        found
    }

    fn look_findings(&self, stage: &Stage, index: usize) -> Vec<Finding> {
        let actor = &stage.actors[index];
        let mut found = Vec::new();
        if !self.actors[index].was_visible {
            return found;
        }
        for (number, (look, facts)) in actor.look_at.iter().zip(&self.look_ats[index]).enumerate() {
            let joint = actor.asset.skeleton.names().get(look.joint as usize).map_or("", String::as_str);
            let mut add = |rule, text: String| {
                let subject = Subject::Look { actor: index, look: number };
                found.push(Finding { rule, note: false, subject, text, hint: None });
            };
            let length = stage.settings.length;
            if look.weight == 0.0 || look.start >= length || look.end.is_some_and(|e| e <= Time::ZERO) {
                let why = match look.weight == 0.0 {
                    true => "its weight is 0".to_string(),
                    false => format!(
                        "it begins at {} s, the stage ends at {} s",
                        look.start.as_secs(),
                        length.as_secs()
                    ),
                };
                add("look_never", format!("\"{}\" never looks at its target: {why}", actor.name));
            } else if facts.was_active && !facts.was_reached {
                add(
                    "look_out_of_reach",
                    format!(
                        "\"{joint}\" of \"{}\" never faces its target: the target is outside the {}° that it \
                         can turn{}",
                        actor.name,
                        LOOK_AT_LIMIT_RAD.to_degrees().round(),
                        self.times_note()
                    ),
                );
            }
        }
        found
    }

    fn light_findings(&self, stage: &Stage, index: usize, light: &StageLight) -> Option<Finding> {
        let facts = &self.lights[index];
        let name = &light.name;
        let subject = Subject::Light(index);
        if !facts.has_shone {
            let why = if light.light.color == Vec3::ZERO {
                "its color is black"
            } else if light.light.intensity > 0.0 {
                "its keys or a callback keep it dark"
            } else {
                "its intensity is 0"
            };
            let text = format!("light \"{name}\" never shines: {why}{}", self.times_note());
            return Some(Finding { rule: "light_never_shines", note: false, subject, text, hint: None });
        }
        if facts.has_reached_actor
            || !stage.actors.iter().zip(&self.actors).any(|(a, f)| f.was_visible && has_meshes(&a.asset))
        {
            return None;
        }
        let why = match (light.light.kind.cone(), light.light.range) {
            (Some(_), None) => "nothing is in its cone".to_string(),
            (Some(_), Some(range)) => format!("nothing is in its cone within its range of {range} m"),
            (_, range) => format!("nothing is within its range of {} m", range.unwrap_or(f32::INFINITY)),
        };
        let text = format!("light \"{name}\" reaches nothing: {why}{}", self.times_note());
        Some(Finding { rule: "light_reaches_nothing", note: false, subject, text, hint: None })
    }
}

fn has_meshes(asset: &Asset) -> bool {
    asset.instance_bounds().iter().any(|i| !i.parts.is_empty())
}

/// Whether an actor has a skin and clips, but plays none of them.
fn plays_no_clip(actor: &Actor) -> bool {
    let plays = actor.layers.iter().any(|l| !l.cues.is_empty());
    !plays && !actor.asset.skins.is_empty() && !actor.asset.clips.is_empty()
}

/// Whether the actor is of use to something else: as a parent, a target or a faced actor, or by its cameras or lights.
fn is_used(stage: &Stage, index: usize) -> bool {
    let on = |target: &Target| match *target {
        Target::Point(_) => false,
        Target::Actor(actor) | Target::Joint { actor, .. } => actor == index,
    };
    let attached = |at: &Option<Attachment>| at.is_some_and(|a| a.actor == index);
    let camera = |c: &Camera| match &c.rig {
        Rig::Fixed { look_at, .. } => look_at.as_ref().is_some_and(on),
        Rig::Follow { target, .. } | Rig::Orbit { target, .. } => on(target),
        Rig::File { actor, .. } => *actor == index,
        Rig::Frame { .. } => false,
    };
    let camera = |c: &Camera| camera(c) || c.looks.iter().any(|look| look.target.as_ref().is_some_and(on));
    let actor = |a: &Actor| {
        a.parents.iter().any(|parent| attached(&parent.to))
            || a.face == Some(index)
            || a.look_at.iter().any(|look| on(&look.target))
            || a.constraints.iter().any(|constraint| constraint.targets().any(|target| on(&target)))
    };
    stage.actors.iter().any(actor)
        || stage.cameras.iter().any(camera)
        || stage.lights.iter().any(|l| attached(&l.parent))
        || (stage.actors[index].file_lights && !stage.actors[index].asset.lights.is_empty())
}

/// Name of the first of an actor's parents that is never visible; `None` if the actor itself is hidden.
fn hidden_parent<'a>(stage: &'a Stage, facts: &[ActorFacts], index: usize) -> Option<&'a str> {
    if !stage.actors[index].visible {
        return None;
    }
    let mut parents = stage.actors[index].parents.iter().filter_map(|parent| Some(parent.to?.actor));
    let hidden = parents.find(|parent| facts.get(*parent).is_some_and(|f| !f.was_visible))?;
    Some(stage.actors[hidden].name.as_str())
}

/// Whether light can fall on a box in view axes. A box that is just out of reach may count, too.
fn light_reaches(light: &LightState, view: &CameraView, bounds: &DAabb) -> bool {
    if light.light.kind.is_directional() {
        return true;
    }
    let position = view.view_from_world.transform_point3(light.position);
    let nearest = position.clamp(bounds.min, bounds.max);
    if light.light.range.is_some_and(|range| (nearest - position).length() > f64::from(range)) {
        return false;
    }
    let Some([_, outer]) = light.light.kind.cone() else { return true };
    let direction: DVec3 =
        view.view_from_world.transform_vector3(light.direction.as_dvec3()).normalize_or(DVec3::NEG_Y);
    let (center, radius) = ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).length() * 0.5);
    let way = center - position;
    let distance = way.length();
    if distance <= radius {
        return true;
    }
    let angle = libm::acos((way.dot(direction) / distance).clamp(-1.0, 1.0));
    angle <= f64::from(outer) + libm::asin(radius / distance)
}

/// Whether a camera has a target and keyed positions, so that both may coincide in single frames.
fn may_pass_its_target(camera: &Camera) -> bool {
    let looks = matches!(camera.rig, Rig::Fixed { look_at: Some(_), .. });
    looks && camera.channels.iter().any(|channel| channel.property == Property::Translation)
}
