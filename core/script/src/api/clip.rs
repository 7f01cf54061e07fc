//! Mirrored, retargeted and bound clips. Edited clips: [`super::clip_edit`].

use super::joint_names::find_joint;
use crate::call::{ApiError, Call, Options, Reply, api, describe};
use crate::diagnostic::Severity;
use crate::errors::format_count;
use crate::limits::raise_hint;
use crate::suggest::list;
use crate::value::{AssetRef, ClipRef};
use choreo_asset::Asset;
use choreo_motion::retarget::{
    Coverage, Retarget, RetargetOptions, RetargetReport, Translations, bind_or_retarget,
};
use choreo_motion::{Clip, bind_by_name};
use choreo_stage::Mirroring;
use rhai::{Dynamic, Map};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

api! {
    /// Returns the clip with left and right exchanged, key by key. Joints are paired by their names. A joint
    /// without a partner stays in its rest pose.
    Clip.mirror("") -> Clip = mirror;
    /// Returns the clip retargeted to the skeleton of another asset. Actor.play does the same by default for a clip
    /// of another asset.
    /// - Joints are matched by their names, also between Mixamo, Biped, VRM, Unreal, Rigify, Daz, CMU, Character
    ///   Creator and Source, else by structure. A warning names the body parts that do not follow; it is an error
    ///   if none follows.
    /// - Options: joints (#{ "its joint": "joint of the clip", … }, false for no joint; default: matched by names,
    ///   then by structure), scale (default: ratio of the leg lengths), translations (joints that move as well as
    ///   rotate: "hips", the default, "all" or "none"), floor (true, the default: feet stay on the floor), align
    ///   (true, the default: the limbs of the rest pose (bind pose) are aligned with those of the clip, such as an
    ///   A-pose with a T-pose).
    Clip.retarget("asset, options?") -> Clip = retarget;
    /// Returns the clip bound to the joints of another asset by their names alone, unchanged (raw binding): each keyed
    /// transform relative to the parent is that of the clip, bit for bit. Nothing is retargeted or scaled.
    /// - For clips in a file of their own that was made for the character (MD5, SMD, glTF without a mesh), whatever bind
    ///   pose that file has; as an action on another armature with the same bone names in Blender.
    /// - Names must be equal. Joints without keys keep their bind pose. A warning names the joints that the asset
    ///   lacks; it is an error if it has none of them.
    Clip.bind("asset") -> Clip = bind_raw;
    /// Returns the report of a retarget, a line per joint: which joint of the other asset follows which joint of
    /// the clip, and how it was matched. It is an error if none follows. Options as in Clip.retarget.
    Clip.mapping("asset, options?") -> "array of texts" = mapping;
}

/// Makes a handle of a clip that a script has made, and counts its keyframes against the limit.
pub(crate) fn clip_handle(c: &Call, clip: Clip, asset: Arc<Asset>) -> Reply {
    count_keyframes(c, &clip)?;
    Ok(Dynamic::from(ClipRef { clip: Arc::new(clip), asset, dead: false }))
}

fn count_keyframes(c: &Call, clip: &Clip) -> Result<(), ApiError> {
    let keys: usize = clip.curves().iter().map(|curve| curve.times.len()).sum();
    let mut stage_draft = c.stage_draft();
    stage_draft.clip_keyframe_count += keys as u64;
    if stage_draft.clip_keyframe_count > c.context.limits.clip_keys {
        let error = ApiError::new(format!("{}: too many keys in clips that the script makes", c.def.name));
        return Err(ApiError {
            fatal: true,
            ..error.hint(raise_hint("clip_keys", c.context.limits.clip_keys))
        });
    }
    Ok(())
}

/// The pairs of left and right joints, morph targets and expressions of an asset.
pub(crate) fn mirroring(c: &Call, asset: &Asset) -> Result<Mirroring, ApiError> {
    Mirroring::of(asset).map_err(|e| {
        let names = asset.skeleton.names().iter().map(String::as_str);
        ApiError::new(format!("{}: \"{}\": {e}", c.def.name, asset.name))
            .hint(format!("joints: {}", list(names, 24)))
    })
}

fn mirror(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    let skeleton = &this.asset.skeleton;
    let map = mirroring(c, &this.asset)?;
    let unpaired = map.joints.unpaired().iter().filter(|joint| this.clip.animates(**joint));
    let unpaired: Vec<&str> = unpaired.map(|joint| skeleton.names()[*joint as usize].as_str()).collect();
    if !unpaired.is_empty() {
        let text = format!(
            "mirror: clip \"{}\" of \"{}\" moves {} without a partner on the other side, which {} at rest: {}",
            this.clip.name,
            this.asset.name,
            format_count(unpaired.len(), "joint"),
            if unpaired.len() == 1 { "stays" } else { "stay" },
            list(unpaired.iter().copied(), 12)
        );
        c.context.add_diagnostic(Severity::Warning, &c.place, &ApiError::new(text).rule("mirror_partial"));
    }
    let mut clip = map.clip(&this.asset, &this.clip);
    clip.name = format!("{} mirrored", this.clip.name);
    clip_handle(c, clip, this.asset)
}

/// Retarget options for a clip of asset `of` on asset `on`.
fn retarget_options(c: &Call, of: &Asset, on: &Asset) -> Result<RetargetOptions, ApiError> {
    let o = c.options(1, &["joints", "scale", "translations", "floor", "align"])?;
    let mut options = RetargetOptions { joints: partner_joints(&o, of, on)?, ..RetargetOptions::default() };
    options.scale = o.number_in("scale", 1e-6, 1e6)?;
    if let Some(moving) = o.one_of("translations", &["hips", "all", "none"])? {
        options.translations = match moving {
            "hips" => Translations::Hips,
            "all" => Translations::All,
            _ => Translations::None,
        };
    }
    options.floor = o.flag("floor")?.unwrap_or(options.floor);
    options.align = o.flag("align")?.unwrap_or(options.align);
    Ok(options)
}

/// The option `joints`: pairs of a joint of asset `on` and its partner in asset `of`; `None` for no partner.
fn partner_joints(o: &Options, of: &Asset, on: &Asset) -> Result<BTreeMap<u32, Option<u32>>, ApiError> {
    let Some(given) = o.get("joints") else { return Ok(BTreeMap::new()) };
    let wrong =
        || ApiError::new(format!("{} must be an object map, got {}", o.label("joints"), describe(&given)));
    let map = given.read_lock::<Map>().ok_or_else(wrong)?;
    let pair = |(joint, source): (&rhai::Identifier, &Dynamic)| {
        let joint = find_joint(on, joint)?;
        if source.as_bool() == Ok(false) {
            return Ok((joint, None));
        }
        let name = source.clone().into_string().map_err(|_| {
            ApiError::new(format!(
                "{}: a joint's partner must be the name of a joint, or false, got {}",
                o.label("joints"),
                describe(source)
            ))
        })?;
        Ok((joint, Some(find_joint(of, &name)?)))
    };
    map.iter().map(pair).collect()
}

/// The asset given as the first argument, marked as used.
fn target_asset(c: &Call) -> Result<Arc<Asset>, ApiError> {
    let asset = c.value(0).try_cast::<AssetRef>().ok_or_else(|| c.wrong(0, "an Asset, as from load(…)"))?;
    let asset = c.context.asset(&asset.load)?;
    c.stage_draft().mark_used(&asset);
    Ok(asset)
}

fn retarget(c: &mut Call) -> Reply {
    let (this, on): (ClipRef, _) = (c.this()?, target_asset(c)?);
    c.stage_draft().mark_used(&this.asset);
    // The result without options is the same as of Actor.play: a clip made for this character stays unchanged.
    let fitted = match c.len() {
        1 => bind_or_retarget(&this.clip, &this.asset.skeleton, &on.skeleton),
        _ => {
            let retarget =
                Retarget::new(&this.asset.skeleton, &on.skeleton, retarget_options(c, &this.asset, &on)?);
            let (clip, report) = retarget.clip(&this.clip);
            (clip, retarget.coverage(&this.clip), Some(report))
        }
    };
    let clip = check_bound_clip(c, &this, &on, fitted)?;
    clip_handle(c, clip, on)
}

fn bind_raw(c: &mut Call) -> Reply {
    let (this, on): (ClipRef, _) = (c.this()?, target_asset(c)?);
    c.stage_draft().mark_used(&this.asset);
    let (clip, lacking) = bind_by_name(&this.clip, &this.asset.skeleton, &on.skeleton);
    if clip.curves().is_empty() && !this.clip.curves().is_empty() {
        return Err(NoMatchingJoints::new(&this.clip, &this.asset, &on, &lacking).error(&this.clip));
    }
    if !lacking.is_empty() {
        let moved: BTreeSet<u32> = this.clip.curves().iter().map(|curve| curve.joint).collect();
        let text = format!(
            "clip \"{}\" of \"{}\" on \"{}\": the skeleton lacks {} of {} animated joints: {}",
            this.clip.name,
            this.asset.name,
            on.name,
            lacking.len(),
            moved.len(),
            list(lacking.iter().map(String::as_str), 12)
        );
        c.context.add_diagnostic(Severity::Warning, &c.place, &ApiError::new(text).rule("retarget_partial"));
    }
    clip_handle(c, clip, on)
}

/// Checks a clip bound or retargeted to another skeleton. Reports joints that are unpaired. Error: no joint is left.
fn check_bound_clip(
    c: &Call,
    of: &ClipRef,
    on: &Asset,
    (clip, coverage, report): (Clip, Coverage, Option<RetargetReport>),
) -> Result<Clip, ApiError> {
    if clip.curves().is_empty() && clip.expressions().is_empty() && !of.clip.curves().is_empty() {
        return Err(NoMatchingJoints::new(&of.clip, &of.asset, on, &coverage.left_out).error(&of.clip));
    }
    if let Some(report) = &report {
        warn_about_tolerance(c, of, on, report);
        warn_about_rest_poses(c, of, on, report);
    }
    // Retargeting between characters leaves out joints outside the known body parts, such as twist joints, without a
    // warning.
    if !coverage.parts.is_empty() || (report.is_none() && !coverage.left_out.is_empty()) {
        c.context.add_diagnostic(
            Severity::Warning,
            &c.place,
            &partial_retarget_warning(of, on, &coverage).rule("retarget_partial"),
        );
    }
    Ok(clip)
}

/// The warning that body parts stay at rest. If no parts are known, it lists joints.
fn partial_retarget_warning(of: &ClipRef, on: &Asset, coverage: &Coverage) -> ApiError {
    let clip = format!("clip \"{}\" of \"{}\" on \"{}\"", of.clip.name, of.asset.name, on.name);
    if coverage.parts.is_empty() {
        let (count, names) = (coverage.left_out.len(), coverage.left_out.iter().map(String::as_str));
        return ApiError::new(format!(
            "{clip}: {} {} no partner of the same name: {}",
            format_count(count, "animated joint"),
            if count == 1 { "has" } else { "have" },
            list(names, 12)
        ));
    }
    ApiError::new(format!("{clip}: {}", describe_coverage(coverage))).hint(
        "name their partners: clip.retarget(asset, #{ joints: #{ \"its joint\": \"joint of the clip\" } }); clip.mapping(asset) lists the pairs",
    )
}

/// A summary such as "9 of 61 animated joints have a partner; these body parts stay at rest: left arm, head".
fn describe_coverage(coverage: &Coverage) -> String {
    let parts = match coverage.parts.is_empty() {
        true => String::new(),
        false => format!("; these body parts stay at rest: {}", coverage.parts.join(", ")),
    };
    format!("{} of {} animated joints have a partner{parts}", coverage.followed(), coverage.moved)
}

/// Error of a retarget: no joint of the target follows a joint that the clip animates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoMatchingJoints {
    pub message: String,
    pub hint: String,
}

impl NoMatchingJoints {
    fn new(clip: &Clip, of: &Asset, on: &Asset, left_out: &[String]) -> NoMatchingJoints {
        let message = format!(
            "clip \"{}\" of \"{}\" on \"{}\": no joint matches, neither by name nor by body part",
            clip.name, of.name, on.name
        );
        let hint = format!(
            "animated: {}; on the actor: {}",
            list(left_out.iter().map(String::as_str), 12),
            list(on.skeleton.names().iter().map(String::as_str), 12)
        );
        NoMatchingJoints { message, hint }
    }

    fn error(self, clip: &Clip) -> ApiError {
        ApiError::new(self.message).focus(clip.name.clone()).hint(self.hint)
    }
}

/// Warns that a retargeted clip has too many keys to stay within the tolerance.
fn warn_about_tolerance(c: &Call, of: &ClipRef, on: &Asset, report: &RetargetReport) {
    if report.coarse {
        let text = format!(
            "clip \"{}\" of \"{}\" on \"{}\": it has too many keys to be retargeted within the tolerance",
            of.clip.name, of.asset.name, on.name
        );
        c.context.add_diagnostic(Severity::Warning, &c.place, &ApiError::new(text).rule("retarget_coarse"));
    }
}

/// Warns about a rest pose, of the clip's character or of the target, that does not stand on both feet.
fn warn_about_rest_poses(c: &Call, of: &ClipRef, on: &Asset, report: &RetargetReport) {
    if !report.rests_standing {
        let error = ApiError::new(format!(
            "clip \"{}\" of \"{}\" on \"{}\": the rest pose of \"{}\" does not stand on both feet, as is common in files of clips \
             only; this pose is taken as upright",
            of.clip.name, of.asset.name, on.name, of.asset.name
        ));
        let hint = "retarget it to the character that it was made for first: clip.retarget(its_character).retarget(asset)";
        c.context.add_diagnostic(Severity::Warning, &c.place, &error.hint(hint).rule("retarget_rest"));
    }
    if !report.target_stands {
        let error = ApiError::new(format!(
            "clip \"{}\" of \"{}\" on \"{}\": the rest pose of \"{}\" does not stand on both feet; the lower foot is taken as the one \
             on the ground",
            of.clip.name, of.asset.name, on.name, on.name
        ));
        c.context.add_diagnostic(Severity::Warning, &c.place, &error.rule("retarget_rest"));
    }
}

fn mapping(c: &mut Call) -> Reply {
    let (this, on): (ClipRef, _) = (c.this()?, target_asset(c)?);
    c.stage_draft().mark_used(&this.asset);
    let options = retarget_options(c, &this.asset, &on)?;
    let lines = mapping_lines(&this.asset, &on, &this.clip, options).map_err(|e| e.error(&this.clip))?;
    Ok(Dynamic::from_array(lines.into_iter().map(Dynamic::from).collect()))
}

/// Report of a retarget, one line per joint: "upperarm.l ← LeftArm (by body, turned 43° at rest)". Error: no joint
/// follows.
pub fn mapping_lines(
    of: &Asset,
    on: &Asset,
    clip: &Clip,
    options: RetargetOptions,
) -> Result<Vec<String>, NoMatchingJoints> {
    let retarget = Retarget::new(&of.skeleton, &on.skeleton, options);
    let coverage = retarget.coverage(clip);
    if coverage.moved > 0 && coverage.followed() == 0 {
        return Err(NoMatchingJoints::new(clip, of, on, &coverage.left_out));
    }
    let (_, report) = retarget.clip(clip);
    let mut lines = vec![format!(
        "{} on {}: scale {:.4}, turned by {}°, {} of {} joints follow",
        of.name,
        on.name,
        retarget.scale(),
        retarget.yaw_degrees(),
        retarget.map().pairs().count(),
        on.skeleton.len()
    )];
    let turned: BTreeMap<u32, f64> = retarget.alignment().into_iter().collect();
    for (joint, source, how) in retarget.map().pairs() {
        let name = |asset: &Asset, joint: u32| asset.skeleton.names()[joint as usize].clone();
        let turned = turned.get(&joint).map_or(String::new(), |d| format!(", turned {d:.0}° at rest"));
        lines.push(format!("{} ← {} ({}{turned})", name(on, joint), name(of, source), how.as_str()));
    }
    if !report.sampled.is_empty() {
        let names = report.sampled.iter().map(String::as_str);
        lines.push(format!("sampled, {} keys each: {}", report.sampled_keys, list(names, 24)));
    }
    let (low, high) = report.raised;
    lines.push(format!(
        "hips raised by {:.1} to {:.1} mm so that feet stay on the floor",
        low * 1e3,
        high * 1e3
    ));
    for (name, far) in &report.held {
        lines.push(format!(
            "{name} is translated by the clip, by up to {:.0} mm, but only rotates here (translations: \"all\" keeps its translation)",
            far * 1e3
        ));
    }
    if !coverage.left_out.is_empty() {
        lines.push(describe_coverage(&coverage));
        lines.push(format!("without a partner: {}", list(coverage.left_out.iter().map(String::as_str), 48)));
    }
    Ok(lines)
}

/// A clip on an actor's skeleton: bound unchanged if the joints match, else retargeted. Joints that are lost are
/// reported.
pub(crate) fn fit_to_skeleton(c: &Call, given: &ClipRef, asset: &Asset) -> Result<Clip, ApiError> {
    let fitted = bind_or_retarget(&given.clip, &given.asset.skeleton, &asset.skeleton);
    let retargeted = fitted.2.is_some();
    let clip = check_bound_clip(c, given, asset, fitted)?;
    if retargeted {
        count_keyframes(c, &clip)?;
    }
    Ok(clip)
}
