//! Cameras: placement, projection and cuts.

use super::actor::before_start_error;
use super::keys;
use crate::build::{CameraDraft, check_limit};
use crate::call::{ApiError, Call, Options, Reply, api, radians, unknown, wrong};
use crate::frame_callback;
use crate::value::{ActorRef, CameraRef};
use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_stage::{Camera, CameraEdit, CameraLook, CameraShake, Cut, Property, Rig, RigOption};
use glam::{DQuat, DVec3};
use rhai::Dynamic;

api! {
    /// Makes a camera. The first camera is active until a cut. Without .at, .follow or .orbit it frames everything.
    camera("name") -> Camera = camera;
    /// Sets the position in metres.
    Camera.at("x, y, z | point") = at, in_frames;
    /// Points the camera at an actor, a joint or a point, and keeps it pointed at the target while that moves.
    /// - Options: from and until (times; several targets may follow each other, and before and after them the camera
    ///   looks where it did without them), blend (seconds that it takes to turn to the target, and back at `until`,
    ///   default 0.5; 0 is a jump). With `from`, also for cameras that follow, orbit or belong to a file.
    /// - In a callback: without options, the target for this frame.
    Camera.look_at("target, options?") = look_at, in_frames;
    /// Rotates the camera about the vertical axis, in degrees counter-clockwise. Without rotation it looks along -z. In
    /// a callback the rotation is added to all others.
    Camera.turn("degrees") = turn, in_frames;
    /// Rotates the camera about x, then y, then z, in degrees, or by a quaternion [x, y, z, w]. In a callback the
    /// rotation is added to all others.
    Camera.rotate("x, y, z | quaternion") = rotate, in_frames;
    /// Shakes the camera by smooth noise, as a handheld camera or in a collision; further calls add to it.
    /// - Options: from (time, default 0), until (time, default none), fade (seconds that it takes to begin and to
    ///   end, default 0.3), amplitude (degrees that it pans and tilts to each side at most, 0 to 90, default 0.5; it
    ///   rolls half as far), move (metres that it moves to each side, up and down at most, 0 to 1000, default 0),
    ///   frequency (how often it goes to and fro at most, Hz, 0 to 100, default 2), seed (a whole number, default the
    ///   number of the call).
    /// - In a callback: amplitude, move, frequency and seed (default 0), for this frame.
    Camera.shake("options?") = shake, in_frames;
    /// Moves the camera with a target, at an offset [x, y, z] from it, and points it at the target. In a callback: for this frame.
    Camera.follow("target, offset") = follow, in_frames;
    /// Moves the camera in a circle around a target. Options: distance (metres, default 4), elevation (degrees, -89
    /// to 89, default 15), azimuth (degrees at time 0, default 0: in front, at +z), speed (degrees per second,
    /// default 20).
    /// - In a callback: its place for this frame, by distance, elevation and azimuth.
    Camera.orbit("target, options?") = orbit, in_frames;
    /// Places the camera so that everything visible fits into the image. Options: azimuth (degrees, default 25),
    /// elevation (degrees, -89 to 89, default 10). In a callback: for this frame.
    Camera.frame("options?") = frame, in_frames;
    /// Sets the vertical field of view in degrees (0.1 to 179, default 40.1).
    Camera.fov("degrees") = fov, in_frames;
    /// Sets the focal length of the lens in millimetres (0.2 to 13000), on full-frame film, 24 mm high: 24 is wide,
    /// 50 normal, 100 a telephoto lens. It sets the field of view.
    Camera.focal_length("millimetres") = focal_length, in_frames;
    /// Makes the camera orthographic; `height` is the height of the image in metres.
    Camera.ortho("height") = ortho, in_frames;
    /// Sets the near clipping plane in metres. The default is 0.05, or a hundredth of the way to the target of a camera
    /// that looks at, follows or orbits one, whichever is nearer.
    Camera.near("metres") = near, in_frames;
    /// Sets the far clipping plane in metres (default: none; 10000 for an orthographic camera).
    Camera.far("metres") = far, in_frames;
    /// Cuts to this camera at a time: from then on it is the active camera. Options: dissolve (seconds, from this time
    /// on, of a cross dissolve from the camera before, default 0).
    Camera.cut("time, options?") = cut;
    /// Animates a property with keyframes [[time, value], …]: "position" (dolly, crane), "rotation" (pan, tilt,
    /// roll), or "fov" in degrees or "focal_length" in millimetres (zoom). Values, `how`, easing and
    /// tangents as in Actor.key.
    Camera.key("property, keys, how?") = key;
}

fn new_draft(c: &Call, name: String) -> CameraDraft {
    CameraDraft {
        camera: Camera { name, ..Camera::default() },
        at: c.place.clone(),
        perspective: None,
        ortho: None,
        near: None,
        far: None,
        rig: None,
        position: None,
        rotation: DQuat::IDENTITY,
        look_at: None,
        looks: Vec::new(),
    }
}

fn camera(c: &mut Call) -> Reply {
    let name = c.name(0)?;
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.cameras.len(), "cameras", &c.context.limits)?;
    if let Some(before) = stage_draft.cameras.iter().find(|k| k.camera.name == name) {
        return Err(ApiError::new(format!(
            "camera: there is a camera \"{name}\" already, from line {}",
            before.at.line
        ))
        .focus(name)
        .hint("keep it in a variable: let wide = camera(\"wide\");"));
    }
    stage_draft.cameras.push(new_draft(c, name));
    Ok(Dynamic::from(CameraRef(stage_draft.cameras.len() - 1)))
}

fn change_draft(c: &Call, change: impl FnOnce(&mut CameraDraft)) -> Reply {
    let this: CameraRef = c.this()?;
    change(c.stage_draft().camera(this.0)?);
    c.receiver()
}

fn at(c: &mut Call) -> Reply {
    let position = c.point(0)?;
    change_or_edit(c, CameraEdit::MoveTo(position), |k| k.position = Some(position))
}

/// Adds an edit of the camera to the frame of the running callback.
fn edit_frame(c: &Call, edit: CameraEdit) -> Reply {
    let this: CameraRef = c.this()?;
    frame_callback::edit_frame(|e| e.cameras.push((this.0, edit)));
    c.receiver()
}

/// Changes the draft while the stage is built, or adds an edit of the frame in a callback.
fn change_or_edit(c: &Call, of_frame: CameraEdit, draft: impl FnOnce(&mut CameraDraft)) -> Reply {
    if c.in_frame { edit_frame(c, of_frame) } else { change_draft(c, draft) }
}

/// Seconds that a camera takes to turn to its next target.
const DEFAULT_BLEND_SECS: f64 = 0.5;

fn look_at(c: &mut Call) -> Reply {
    let target = c.target(0)?;
    let o = c.options(1, if c.in_frame { &[] } else { &["from", "until", "blend"] })?;
    if c.in_frame {
        return edit_frame(c, CameraEdit::LookAt(target));
    }
    let start = o.get("from").map(|v| c.stage_time(&v, "look_at: from")).transpose()?;
    let until = o.get("until").map(|v| c.stage_time(&v, "look_at: until")).transpose()?;
    let blend = o.duration("blend")?;
    if start.is_none() && until.is_none() {
        if blend.is_some() {
            let error = ApiError::new("look_at: blend needs the start time of the change");
            return Err(error.hint("give the option from: #{ from: 2.0, blend: 0.5 }"));
        }
        return change_draft(c, |k| k.look_at = Some(target));
    }
    if let (Some(start), Some(until)) = (start, until)
        && until <= start
    {
        return Err(before_start_error("look_at: until", until, start));
    }
    let start = start.unwrap_or(Time::MIN);
    let this: CameraRef = c.this()?;
    let mut stage_draft = c.stage_draft();
    let looks = &mut stage_draft.camera(this.0)?.looks;
    check_limit(looks.len(), "look_at targets of one camera", &c.context.limits)?;
    if looks.iter().any(|(look, _)| look.start == start) {
        let when =
            if start == Time::MIN { "already".into() } else { format!("at {} s already", start.as_secs()) };
        let error = ApiError::new(format!("look_at: this camera looks at another target {when}"));
        return Err(error.hint("give each target a time of its own: #{ from: 2.0 }"));
    }
    let blend = blend.unwrap_or(Time::from_secs(DEFAULT_BLEND_SECS));
    looks.push((CameraLook { target: Some(target), start, blend }, until));
    c.receiver()
}

fn rotate_by(c: &Call, rotation: DQuat) -> Reply {
    change_or_edit(c, CameraEdit::Turn(rotation), |k| k.rotation = (rotation * k.rotation).normalize())
}

fn turn(c: &mut Call) -> Reply {
    rotate_by(c, DQuat::from_rotation_y(radians(c.number(0)?)))
}

fn rotate(c: &mut Call) -> Reply {
    let rotation = keys::angles_or_quaternion(c)?;
    rotate_by(c, rotation)
}

fn shake(c: &mut Call) -> Reply {
    let all = ["amplitude", "move", "frequency", "seed", "from", "until", "fade"];
    let o = c.options(0, if c.in_frame { &all[..4] } else { &all[..] })?;
    let time = |name| o.get(name).map(|v| c.stage_time(&v, &o.label(name))).transpose();
    let (start, end) = (time("from")?, time("until")?);
    let start = match start {
        Some(start) => start,
        None if c.in_frame => Time::ZERO,
        None => c.stage_draft().sequence_start,
    };
    if let Some(until) = end.filter(|until| *until <= start) {
        return Err(before_start_error("shake: until", until, start));
    }
    let seed = o.read("seed", |v, label| match v.as_int().map(u32::try_from) {
        Ok(Ok(seed)) => Ok(seed),
        _ => Err(wrong(v, label, "a whole number from 0 to 4294967295")),
    })?;
    let shake = CameraShake {
        start,
        end,
        fade: o.duration("fade")?.unwrap_or(Time::from_secs(0.3)),
        angle: o.number_in("amplitude", 0.0, 90.0)?.unwrap_or(0.5).to_radians(),
        shift: o.number_in("move", 0.0, 1000.0)?.unwrap_or(0.0),
        frequency: o.number_in("frequency", 0.0, 100.0)?.unwrap_or(2.0),
        seed: 0,
    };
    if c.in_frame {
        let shake = CameraShake { seed: seed.unwrap_or(0), ..shake };
        return edit_frame(c, CameraEdit::Shake(shake));
    }
    let this: CameraRef = c.this()?;
    let mut stage_draft = c.stage_draft();
    let shakes = &mut stage_draft.camera(this.0)?.camera.shakes;
    check_limit(shakes.len(), "shakes of one camera", &c.context.limits)?;
    let seed = seed.unwrap_or(shakes.len() as u32);
    shakes.push(CameraShake { seed, ..shake });
    c.receiver()
}

fn follow(c: &mut Call) -> Reply {
    let target = c.target(0)?;
    let offset = crate::call::point(&c.value(1), &c.label(1))?;
    if offset.length() < 1e-9 {
        return Err(ApiError::new("follow: offset must not be zero, the camera would be inside its target"));
    }
    set_rig(c, Rig::Follow { target, offset })
}

fn set_rig(c: &Call, rig: Rig) -> Reply {
    change_or_edit(c, CameraEdit::Rig(rig.clone()), |k| k.rig = Some(rig))
}

fn orbit(c: &mut Call) -> Reply {
    let target = c.target(0)?;
    let [distance, elevation, azimuth, speed] = &Rig::ORBIT;
    let all = Rig::ORBIT.map(|option| option.name);
    let o = c.options(1, if c.in_frame { &all[..3] } else { &all[..] })?;
    // In a callback the azimuth is given for each frame, so there is no speed.
    let speed = if c.in_frame { 0.0 } else { rig_number(&o, speed)? };
    let orbit = Rig::Orbit {
        target,
        distance: rig_number(&o, distance)?,
        elevation: rig_number(&o, elevation)?.to_radians(),
        azimuth: radians(rig_number(&o, azimuth)?),
        speed: speed.to_radians(),
    };
    set_rig(c, orbit)
}

fn frame(c: &mut Call) -> Reply {
    let [azimuth, elevation] = &Rig::FRAME;
    let o = c.options(0, &Rig::FRAME.map(|option| option.name))?;
    let (azimuth, elevation) = (rig_number(&o, azimuth)?, rig_number(&o, elevation)?);
    set_rig(c, Rig::Frame { azimuth: radians(azimuth), elevation: elevation.to_radians() })
}

/// The value of a number option, or its default.
fn rig_number(options: &Options, of: &RigOption) -> Result<f64, ApiError> {
    let [least, most] = of.range;
    Ok(options.number_in(of.name, least, most)?.unwrap_or(of.default))
}

/// Allowed fields of view, degrees.
const FOV_RANGE_DEG: (f64, f64) = (0.1, 179.0);

fn fov(c: &mut Call) -> Reply {
    let (low, high) = FOV_RANGE_DEG;
    set_field_of_view(c, c.number_in(0, low, high)?.to_radians() as f32)
}

fn set_field_of_view(c: &Call, yfov: f32) -> Reply {
    change_or_edit(c, CameraEdit::FieldOfView(yfov), |k| {
        k.perspective = Some(yfov);
        k.ortho = None;
    })
}

fn focal_length(c: &mut Call) -> Reply {
    let millimetres = c.number_in(0, 0.2, 13_000.0)?;
    set_field_of_view(c, Camera::yfov(millimetres) as f32)
}

fn ortho(c: &mut Call) -> Reply {
    let height = c.number_in(0, 1e-6, 1e9)? as f32;
    change_or_edit(c, CameraEdit::Height(height), |k| {
        k.ortho = Some(height);
        k.perspective = None;
    })
}

fn near(c: &mut Call) -> Reply {
    let near = c.number_in(0, 1e-6, 1e9)? as f32;
    change_or_edit(c, CameraEdit::Near(near), |k| k.near = Some(near))
}

fn far(c: &mut Call) -> Reply {
    let far = c.number_in(0, 1e-5, 1e15)? as f32;
    change_or_edit(c, CameraEdit::Far(far), |k| k.far = Some(far))
}

fn cut(c: &mut Call) -> Reply {
    let this: CameraRef = c.this()?;
    let t: Time = c.time(0)?;
    let dissolve = c.options(1, &["dissolve"])?.duration("dissolve")?.unwrap_or_default();
    let place = c.place.clone();
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.cuts.len(), "cuts", &c.context.limits)?;
    stage_draft.camera(this.0)?;
    stage_draft.cuts.push((Cut { at: t, camera: this.0, dissolve }, place));
    c.receiver()
}

fn key(c: &mut Call) -> Reply {
    // Whether the rig allows keyframes is known only at the end of the script.
    let channel = keys::channel(c, keys::named_property(c, &keys::keyed_properties::<Camera>())?, 1)?;
    change_draft(c, |k| {
        if k.position.is_none() && channel.property == Property::Translation {
            k.position = Some(DVec3::ZERO);
        }
        if channel.property.is_lens() {
            k.camera.channels.retain(|c| !c.property.is_lens());
        }
        keys::replace_channels(&mut k.camera.channels, vec![channel]);
    })
}

fn camera_index(c: &Call, asset: &Asset) -> Result<u32, ApiError> {
    let names = || asset.cameras.iter().map(|k| k.name.as_str()).collect::<Vec<_>>();
    if asset.cameras.is_empty() {
        return Err(ApiError::new(format!("camera: \"{}\" has no camera", asset.name)));
    }
    if c.len() == 0 {
        return match asset.cameras.len() {
            1 => Ok(0),
            n => Err(ApiError::new(format!("camera: \"{}\" has {n} cameras: name one", asset.name))
                .hint(crate::suggest::list(names(), 24))),
        };
    }
    if let Ok(index) = c.value(0).as_int() {
        let found = u32::try_from(index).ok().filter(|i| (*i as usize) < asset.cameras.len());
        let n = asset.cameras.len();
        return found.ok_or_else(|| {
            ApiError::new(format!(
                "there is no camera {index} in \"{}\": it has {}, numbered from 0",
                asset.name,
                crate::errors::format_count(n, "camera")
            ))
        });
    }
    let name = c.text(0)?;
    let found = asset.cameras.iter().position(|k| k.name == name);
    found
        .map(|i| i as u32)
        .ok_or_else(|| unknown("camera", &name, &format!(" in \"{}\"", asset.name), names()))
}

fn handle_of_file_camera(c: &Call, actor: usize, camera: u32) -> Reply {
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.cameras.len(), "cameras", &c.context.limits)?;
    let owner = stage_draft.actor(actor)?;
    let file = owner.actor.asset.cameras.get(camera as usize).map(|k| k.name.clone()).unwrap_or_default();
    let name = format!("{} {file}", owner.actor.name);
    if let Some(again) = stage_draft.cameras.iter().position(|k| k.rig == Some(Rig::File { actor, camera })) {
        return Ok(Dynamic::from(CameraRef(again)));
    }
    let mut k = new_draft(c, name);
    k.rig = Some(Rig::File { actor, camera });
    stage_draft.cameras.push(k);
    Ok(Dynamic::from(CameraRef(stage_draft.cameras.len() - 1)))
}

pub(crate) fn of_actor(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let camera = camera_index(c, &this.asset)?;
    handle_of_file_camera(c, this.id, camera)
}

pub(crate) fn of_asset(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    let camera = camera_index(c, &asset)?;
    let actor = c.stage_draft().actors.iter().position(|a| std::sync::Arc::ptr_eq(&a.actor.asset, &asset));
    let actor = actor.ok_or_else(|| {
        ApiError::new(format!("camera: no actor is cast from \"{}\" yet", asset.name))
            .hint("cast it first: its camera moves with the actor")
    })?;
    handle_of_file_camera(c, actor, camera)
}
