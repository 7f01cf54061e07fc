//! Actors: assets on stage, their transforms, parents, morph targets, keyframes and clips.

pub(crate) use super::look_at::before_start_error;
use super::{expression, keys};
use crate::build::{ActorDraft, Chain, CueDraft, ParentDraft, check_limit};
use crate::call::{ApiError, Call, Options, Reply, api, fields, number_in, radians, rgb, unknown};
use crate::frame_callback;
use crate::procedural::MAX_LINE_WIDTH;
use crate::value::{ActorRef, AssetRef, CueRef, JointRef};
use choreo_asset::{Asset, MeshInstance};
use choreo_motion::Time;
use choreo_stage::{
    Actor, ActorEdit, ActorShadow, Attachment, Channel, FieldType, ParentChange, ParentScale, Parenting,
    Property, Skinning, Target,
};
use glam::{DQuat, DVec3};
use rhai::Dynamic;
use std::collections::BTreeSet;

api! {
    /// Puts an asset on stage as an actor. The name must be unique.
    cast("name, asset") -> Actor = cast;
    /// Sets the position in metres, +y up.
    Actor.at("x, y, z | point") = at, in_frames;
    /// Moves the actor by an offset in metres.
    Actor.move_by("x, y, z | offset") = move_by, in_frames;
    /// Rotates the actor about the vertical axis, by degrees counter-clockwise seen from above.
    Actor.turn("degrees") = turn, in_frames;
    /// Rotates the actor about x, then y, then z, in degrees, or by a quaternion [x, y, z, w].
    Actor.rotate("x, y, z | quaternion") = rotate, in_frames;
    /// Sets the scale: one factor, or one per axis. Negative factors mirror.
    Actor.scale("factor | x, y, z") = scale, in_frames;
    /// Rotates the actor about the vertical axis so that it faces a point, or another actor even while that one moves.
    Actor.face("actor_or_point") = face;
    /// Makes the actor a child of another actor or of one of its joints (parent constraint, "Child Of"), such as a
    /// sword in a hand. Its position is then in the space of the parent, in metres.
    /// - Options: scale ("keep", the default: the actor keeps its size, however the parent is scaled; "inherit": it
    ///   is scaled with the parent, and placed in its units), from and until (times; several attachments may follow
    ///   each other), blend (seconds that the change takes, default 0), keep (false: at the start of an attachment
    ///   with `from` the actor moves to its own position in the new parent; default true where `from` is above 0: it
    ///   stays where it is in the world, and goes on from there with the parent).
    /// - Where .at, .move_by, .turn or .rotate follow an attachment with `from`, they place the actor in that parent.
    ///   To move a prop into the palm of another hand, use keep: false, then .at in the new hand.
    /// - In a callback: the parent for this frame, without times.
    Actor.attach("actor_or_joint, options?") = attach, in_frames;
    /// Ends the attachment at a time: the actor stays where it is in the world.
    /// - Options: from (time), blend (seconds that it takes to stop moving with the parent, default 0), keep (false:
    ///   the actor moves to its own position in the world; default true).
    /// - In a callback: without options, the actor is placed in the world for this frame.
    Actor.detach("options?") = detach, in_frames;
    /// Hides the actor.
    Actor.hide("") = hide, in_frames;
    /// Shows the actor again.
    Actor.show("") = show, in_frames;
    /// Sets a color by which every color of the actor is multiplied.
    Actor.tint("color") = tint, in_frames;
    /// Sets how many of the copies that Asset.repeat made exist: the first N, from 0. With keyframes or in a
    /// callback the number changes over time.
    Actor.count("number") = count, in_frames;
    /// Sets the width of the actor's lines or the size of its points, in pixels or metres as in `lines(…)` or
    /// `points(…)`. At 0 nothing is drawn.
    Actor.width("width") = width, in_frames;
    /// Sets the weight of a morph target (blend shape, shape key), by name or by index from 0. It overrides the
    /// weight from clips.
    Actor.morph("name, weight") = morph, in_frames;
    /// Sets the weight (0 to 1) of a facial expression of the file, such as "happy" or "blink". It overrides the
    /// weight from clips. Expressions add to the morph targets.
    Actor.expression("name, weight") = super::expression::of_actor, in_frames;
    /// Turns the lights of the actor's file on (the default) or off.
    Actor.file_lights("on") = file_lights;
    /// Sets the skinning method: "linear" (linear blend skinning as in glTF, the default) or "dual_quaternion"
    /// (dual quaternion skinning, which keeps the volume of twisted limbs).
    Actor.skinning("how") = skinning;
    /// Sets whether the actor casts shadows and whether shadows fall on it.
    /// - Options: {}.
    Actor.shadow("options") = shadow, options(|| fields::describe_options(&ActorShadow::default(), &[]));
    /// Animates a property with keyframes [[time, value], …].
    /// - Properties: "position" (metres), "rotation" (degrees about y, [x, y, z] in degrees, or quaternions),
    ///   "scale" (a factor or [x, y, z]), "visible" (true or false, changes at the keyframe), "tint" (a color),
    ///   "width" (of lines and points), "count" (of copies, rounded down), and "morph" or "expression" with its
    ///   name as second argument.
    /// - `how`, the interpolation: "linear" (the default), "step", "smooth" (zero velocity at each keyframe) or "cubic"
    ///   (a smooth curve through the keyframes: a number never leaves the range between two keyframes, monotone cubic;
    ///   a position keeps its direction through a keyframe, so that a path that bends swings out beside it) or
    ///   "catmull_rom" (a Catmull-Rom spline, which overshoots where keyframes of different speed lie close together).
    ///   Or an easing into every keyframe: a name such as "in_out_sine" (see Cue.ease) or a Bézier curve
    ///   [x1, y1, x2, y2].
    /// - Two keyframes at the same time are a jump from the first value to the second.
    /// - A keyframe [time, value, ease] has its own easing, into that keyframe only; `how` is then "linear".
    /// - A keyframe [time, value, #{ tangent: … }] has its own tangent for a cubic Hermite spline: the change per
    ///   second, one number for all components or one for each (0 is at rest). A broken tangent has two sides,
    ///   in_tangent and out_tangent. At an end of a span without a tangent of its own, `how` sets the tangent: a
    ///   straight line for "linear". weight, in_weight and out_weight (0 to 1, default 1/3) set the length of the
    ///   handles of a Bézier curve, as a share of the span. ease sets an easing, which then forms the whole span before
    ///   the keyframe.
    Actor.key("property, keys, how? | property, name, keys, how?") = key;
    /// Plays a clip on the actor and returns its cue (an NLA strip), from time 0 or from Cue.from on. A clip of
    /// another asset is retargeted. Options as in Cue.then (from, until, fade, trim, speed, repeat and more).
    Actor.play("clip, options?") -> Cue = play;
    /// Returns a camera of the actor's file, by name or by index from 0. It moves with the actor. The argument may
    /// be left out where the file has one camera.
    Actor.camera("name_or_index?") -> Camera = super::camera::of_actor;
}

fn shadow(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let mut stage_draft = c.stage_draft();
    let mut shadow = stage_draft.actor(this.id)?.actor.shadow;
    let o = c.options(0, &fields::names(&shadow, &[]))?;
    fields::fill(c, &o, &mut shadow)?;
    stage_draft.actor(this.id)?.actor.shadow = shadow;
    c.receiver()
}

fn cast(c: &mut Call) -> Reply {
    let name = c.name(0)?;
    let Some(asset) = c.value(1).try_cast::<AssetRef>() else {
        return Err(c.wrong(1, "an Asset, from load(…) or shape(…)"));
    };
    let asset = c.context.asset(&asset.load)?;
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.actors.len(), "actors", &c.context.limits)?;
    if let Some(before) = stage_draft.actors.iter().find(|a| a.actor.name == name) {
        return Err(ApiError::new(format!(
            "cast: there is an actor \"{name}\" already, from line {}",
            before.at.line
        ))
        .focus(name)
        .hint("give each actor a name of its own"));
    }
    let actor = Actor::new(&name, asset.clone());
    let id = stage_draft.actors.len();
    stage_draft.mark_used(&asset);
    let at = c.place.clone();
    stage_draft.actors.push(ActorDraft {
        actor,
        at,
        is_placed: false,
        look_at_places: Vec::new(),
        constraint_places: Vec::new(),
        root: None,
        joint_keys: Vec::new(),
        walks: Vec::new(),
        parents: Vec::new(),
        face_point: None,
        hidden_parts: BTreeSet::new(),
    });
    Ok(Dynamic::from(ActorRef { id, asset }))
}

/// Changes the draft while the stage is built, or adds an edit of the frame in a callback.
pub(super) fn change(c: &Call, edit: ActorEdit, draft: impl FnOnce(&mut ActorDraft)) -> Reply {
    let this: ActorRef = c.this()?;
    if c.in_frame {
        frame_callback::edit_frame(|e| e.actors.push((this.id, edit)));
    } else {
        draft(c.stage_draft().actor(this.id)?);
    }
    c.receiver()
}

/// Changes position or rotation as [`change`] does.
///
/// # Errors
/// Returns an error if `walk_to` sets position and rotation already.
fn change_placement(c: &Call, edit: ActorEdit, draft: impl FnOnce(&mut ActorDraft)) -> Reply {
    let this: ActorRef = c.this()?;
    if !c.in_frame {
        c.stage_draft().actor(this.id)?.check_not_walking(c.def.name)?;
    }
    change(c, edit, draft)
}

fn at(c: &mut Call) -> Reply {
    let p = c.point(0)?;
    change_placement(c, ActorEdit::MoveTo(p), |d| {
        d.placement_mut().translation = p;
        d.is_placed = true;
    })
}

fn move_by(c: &mut Call) -> Reply {
    let offset = c.point(0)?;
    change_placement(c, ActorEdit::MoveBy(offset), |d| {
        d.placement_mut().translation += offset;
        d.is_placed = true;
    })
}

fn rotate_by(c: &Call, rotation: DQuat) -> Reply {
    change_placement(c, ActorEdit::Turn(rotation), |d| {
        let placement = d.placement_mut();
        placement.rotation = (rotation * placement.rotation).normalize();
    })
}

fn turn(c: &mut Call) -> Reply {
    let degrees = c.number(0)?;
    rotate_by(c, DQuat::from_rotation_y(radians(degrees)))
}

fn rotate(c: &mut Call) -> Reply {
    let rotation = keys::angles_or_quaternion(c)?;
    rotate_by(c, rotation)
}

fn scale(c: &mut Call) -> Reply {
    let factor = if c.len() == 1 { DVec3::splat(c.number(0)?) } else { c.point(0)? };
    let allowed = |v: f64| (1e-6..=1e6).contains(&v.abs());
    if !factor.to_array().into_iter().all(allowed) {
        return Err(ApiError::new(format!(
            "scale: factor must be from 0.000001 to 1000000 (or mirrored, negative), got {:?}, {:?}, {:?}",
            factor.x, factor.y, factor.z
        ))
        .hint("to make it invisible, use .hide()"));
    }
    change(c, ActorEdit::Scale(factor), |d| d.actor.transform.scale = factor)
}

fn face(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let target = c.target(0)?;
    let mut stage_draft = c.stage_draft();
    let draft = stage_draft.actor(this.id)?;
    draft.check_not_walking("face")?;
    draft.actor.face = None;
    draft.face_point = None;
    match target {
        Target::Actor(other) if other == this.id => {
            return Err(ApiError::new("face: an actor cannot face itself"));
        }
        Target::Actor(other) | Target::Joint { actor: other, .. } => draft.actor.face = Some(other),
        Target::Point(p) => draft.face_point = Some(p),
    }
    c.receiver()
}

fn attach(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let to = attachment(c, 0)?;
    if to.actor == this.id {
        return Err(ApiError::new("attach: an actor cannot be attached to itself"));
    }
    let o =
        c.options(1, if c.in_frame { &["scale"] } else { &["scale", "from", "until", "blend", "keep"] })?;
    let mut change = ParentChange::default();
    fields::fill(c, &o, &mut change)?;
    let mut parent = parenting(&o, Some(to), change)?;
    if o.one_of("scale", &["keep", "inherit"])? == Some("inherit") {
        parent.scale = ParentScale::Inherit;
    }
    if let (Some(start), Some(until)) = (change.from, change.until)
        && until <= start
    {
        return Err(before_start_error("attach: until", until, start));
    }
    add_parent(c, ParentDraft { parent, until: change.until, at: c.place.clone() })
}

fn detach(c: &mut Call) -> Reply {
    let o = c.options(0, if c.in_frame { &[] } else { &["from", "blend", "keep"] })?;
    let mut change = ParentChange::default();
    fields::fill(c, &o, &mut change)?;
    if change.from.is_none() && !c.in_frame {
        return Err(ApiError::new("detach: from is missing").hint("give a time: .detach(#{ from: 2.0 })"));
    }
    let parent = parenting(&o, None, change)?;
    add_parent(c, ParentDraft { parent, until: None, at: c.place.clone() })
}

/// A parent with its start time and the options `blend` and `keep`. A parent without a start time is in effect from the beginning
/// of the stage, so `keep` does not apply.
fn parenting(o: &Options, to: Option<Attachment>, change: ParentChange) -> Result<Parenting, ApiError> {
    let ParentChange { from: start, blend, keep, .. } = change;
    if start.is_none() && (blend.is_some() || keep == Some(true)) {
        let error =
            ApiError::new(format!("{}: blend and keep need the start time of the change", o.function));
        return Err(error.hint("give the option from"));
    }
    let parent = Parenting::from(to, start.unwrap_or(Time::MIN));
    // There is no earlier placement to keep at the beginning of the stage.
    let keep = start.is_some_and(|start| keep.unwrap_or(start > Time::ZERO));
    Ok(Parenting { blend: blend.unwrap_or_default(), keep, ..parent })
}

fn add_parent(c: &Call, draft: ParentDraft) -> Reply {
    let this: ActorRef = c.this()?;
    if c.in_frame {
        frame_callback::edit_frame(|e| e.actors.push((this.id, ActorEdit::Attach(draft.parent))));
        return c.receiver();
    }
    let mut stage_draft = c.stage_draft();
    let actor = stage_draft.actor(this.id)?;
    check_limit(actor.parents.len(), "attachments of one actor", &c.context.limits)?;
    if let Some(before) = actor.parents.iter().find(|p| p.parent.start == draft.parent.start) {
        let when = match draft.parent.start {
            Time::MIN => "already".to_string(),
            start => format!("at {} s already", start.as_secs()),
        };
        let text = format!("{}: its parent changes {when}, in line {}", c.def.name, before.at.line);
        return Err(ApiError::new(text).hint("give each attachment a time of its own: #{ from: 2.0 }"));
    }
    actor.parents.push(draft);
    actor.is_placed = true;
    c.receiver()
}

/// Reads argument `i` as a parent: an actor or a joint.
pub(crate) fn attachment(c: &Call, i: usize) -> Result<Attachment, ApiError> {
    let value = c.value(i);
    if let Some(actor) = value.read_lock::<ActorRef>() {
        return Ok(Attachment { actor: actor.id, joint: None });
    }
    if let Some(joint) = value.read_lock::<JointRef>() {
        return Ok(Attachment { actor: joint.actor, joint: Some(joint.joint) });
    }
    Err(c.wrong(i, "an Actor or a Joint"))
}

fn set_visible(c: &Call, visible: bool) -> Reply {
    change(c, ActorEdit::Visible(visible), |d| d.actor.visible = visible)
}

fn hide(c: &mut Call) -> Reply {
    set_visible(c, false)
}

fn show(c: &mut Call) -> Reply {
    set_visible(c, true)
}

fn tint(c: &mut Call) -> Reply {
    let tint = c.color(0)?;
    change(c, ActorEdit::Tint(tint), |d| d.actor.tint = tint)
}

fn width(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    check_has_line_width(&this.asset, "width")?;
    let width = number_in(&c.value(0), "width: width", 0.0, f64::from(MAX_LINE_WIDTH))? as f32;
    change(c, ActorEdit::LineWidth(width), |d| d.actor.line_width = Some(width))
}

fn count(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    check_has_copies(&this.asset, "count")?;
    let count = number_in(&c.value(0), "count: number", 0.0, f64::from(u32::MAX))? as u32;
    change(c, ActorEdit::Copies(count), |d| d.actor.copies = Some(count))
}

/// Refuses an asset without copies (instances), which has no count to set.
pub(crate) fn check_has_copies(asset: &Asset, function: &str) -> Result<(), ApiError> {
    if asset.has_copies() {
        return Ok(());
    }
    let text = format!("{function}: {} has no copies", asset.name);
    Err(ApiError::new(text).hint("cast asset.repeat(places) to make copies"))
}

/// Refuses an asset without lines or points that have a width.
fn check_has_line_width(asset: &Asset, function: &str) -> Result<(), ApiError> {
    if asset.materials.iter().any(|m| m.line_style.is_some()) {
        return Ok(());
    }
    let text = format!("{function}: {} has neither lines nor points with a width", asset.name);
    Err(ApiError::new(text).hint("give lines(…) a width, points(…) a size, or either of them metres"))
}

/// Pairs of mesh instance and morph target: all targets with a name, or the target with an index in every instance.
pub(crate) fn morph_targets(
    asset: &Asset,
    wanted: &Dynamic,
    label: &str,
) -> Result<Vec<(u32, u32)>, ApiError> {
    let mesh = |i: &MeshInstance| asset.meshes.get(i.mesh as usize);
    let mut found = Vec::new();
    let mut names: Vec<&str> = Vec::new();
    for (instance, i) in asset.instances.iter().enumerate() {
        let Some(mesh) = mesh(i) else { continue };
        names.extend(mesh.morph_names.iter().map(String::as_str));
        let targets: Vec<usize> = if let Ok(n) = wanted.as_int() {
            usize::try_from(n).ok().filter(|n| *n < mesh.morph_targets).into_iter().collect()
        } else {
            let name = crate::call::text(wanted, label)?;
            (0..mesh.morph_names.len()).filter(|t| mesh.morph_names[*t] == name).collect()
        };
        found.extend(targets.into_iter().map(|t| (instance as u32, t as u32)));
    }
    if !found.is_empty() {
        return Ok(found);
    }
    names.sort_unstable();
    names.dedup();
    let wanted = wanted.to_string();
    if asset.expressions.iter().any(|e| e.name == wanted) {
        let error = ApiError::new(format!("{label}: \"{wanted}\" of \"{}\" is an expression", asset.name));
        return Err(error
            .focus(wanted)
            .hint("write .expression(name, weight), or key(\"expression\", name, keys)"));
    }
    if asset.instances.iter().filter_map(mesh).all(|m| m.morph_targets == 0) {
        return Err(ApiError::new(format!("{label}: \"{}\" has no morph targets", asset.name)).focus(wanted));
    }
    Err(unknown("morph target", &wanted, &format!(" in \"{}\"", asset.name), names))
}

fn morph(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let weight = c.number_in(1, -1000.0, 1000.0)? as f32;
    let targets = morph_targets(&this.asset, &c.value(0), &c.label(0))?;
    if c.in_frame {
        frame_callback::edit_frame(|e| {
            let edit = |(instance, target)| (this.id, ActorEdit::Morph { instance, target, weight });
            e.actors.extend(targets.into_iter().map(edit));
        });
        return c.receiver();
    }
    let mut stage_draft = c.stage_draft();
    let draft = stage_draft.actor(this.id)?;
    draft.actor.morphs.retain(|(i, t, _)| !targets.contains(&(*i, *t)));
    draft.actor.morphs.extend(targets.into_iter().map(|(i, t)| (i, t, weight)));
    c.receiver()
}

fn file_lights(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let on = c.value(0).as_bool().map_err(|_| c.wrong(0, "true or false"))?;
    c.stage_draft().actor(this.id)?.actor.file_lights = on;
    c.receiver()
}

const SKINNINGS: [(&str, Skinning); 2] =
    [("linear", Skinning::Linear), ("dual_quaternion", Skinning::DualQuaternion)];

fn skinning(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let name = c.name(0)?;
    let Some((_, how)) = SKINNINGS.iter().find(|(known, _)| *known == name) else {
        return Err(unknown("skinning", &name, "", SKINNINGS.iter().map(|(known, _)| *known)));
    };
    c.stage_draft().actor(this.id)?.actor.skinning = *how;
    c.receiver()
}

/// The channels of `.key(property, keys, how?)` or `.key("morph", name, keys, how?)`.
fn key_channels(c: &Call, asset: &Asset) -> Result<Vec<Channel>, ApiError> {
    let weights = |name, property, (low, high)| keys::KeyedProperty {
        name,
        property,
        field_type: FieldType::Number(low, high, ""),
    };
    let morph = weights("morph", Property::Morph { instance: 0, target: 0 }, (-1000.0, 1000.0));
    let expression = weights("expression", Property::Expression { expression: 0 }, (0.0, 1.0));
    let keyed =
        keys::named_property(c, &[keys::keyed_properties::<Actor>(), vec![morph, expression]].concat())?;
    let targets: Vec<Property> = match keyed.name {
        "width" => check_has_line_width(asset, "key").map(|()| vec![keyed.property])?,
        "count" => check_has_copies(asset, "key").map(|()| vec![keyed.property])?,
        "morph" => {
            let found = morph_targets(asset, &c.value(1), "key: name")?.into_iter();
            found.map(|(instance, target)| Property::Morph { instance, target }).collect()
        }
        "expression" => {
            vec![Property::Expression {
                expression: expression::find_expression(asset, &c.value(1), "key: name")?,
            }]
        }
        _ => vec![keyed.property],
    };
    let channel = keys::channel(c, keyed, if matches!(keyed.name, "morph" | "expression") { 2 } else { 1 })?;
    Ok(targets.into_iter().map(|property| Channel { property, ..channel.clone() }).collect())
}

fn key(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let channels = key_channels(c, &this.asset)?;
    let mut stage_draft = c.stage_draft();
    let draft = stage_draft.actor(this.id)?;
    let moves_actor =
        |channel: &Channel| matches!(channel.property, Property::Translation | Property::Rotation);
    if channels.iter().any(moves_actor) {
        draft.check_not_walking("key")?;
    }
    draft.is_placed |= channels.iter().any(|ch| ch.property == Property::Translation);
    keys::replace_channels(&mut draft.actor.channels, channels);
    c.receiver()
}

fn play(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let clip = super::cue::bound_clip(c, 0, &this.asset)?;
    let chain = c.stage_draft().chains.len();
    check_limit(c.stage_draft().cues.len(), "cues", &c.context.limits)?;
    let origin = c.stage_draft().sequence_start;
    let mut cue = CueDraft { origin, ..CueDraft::new(chain, clip, c.place.clone()) };
    super::cue::read_options(c, 1, &mut cue)?;
    let mut stage_draft = c.stage_draft();
    stage_draft.chains.push(Chain::new(this.id));
    stage_draft.cues.push(cue);
    Ok(Dynamic::from(CueRef(stage_draft.cues.len() - 1)))
}

/// Linear RGB of a color argument.
pub(crate) fn rgb_arg(c: &Call, i: usize) -> Result<glam::Vec3, ApiError> {
    c.color(i).map(rgb)
}
