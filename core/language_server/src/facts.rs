//! Descriptions of files, clips and options, for hover and completion.

use choreo_asset::{Asset, Topology};
use choreo_motion::{Clip, RootMotion, RootParts, Skeleton, Time};
use choreo_plugin::OptionSpec;
use choreo_script::describe::{Entry, OptionEntry};
use std::sync::Arc;

/// Number and noun, such as "1 joint" or "3 joints".
pub(crate) fn count_with_noun(number: usize, singular: &str) -> String {
    let plural_ending = if singular.ends_with('h') { "es" } else { "s" };
    format!("{number} {singular}{}", if number == 1 { "" } else { plural_ending })
}

/// Length of a clip, such as "1.20 s, 36 frames at 30 fps".
pub(crate) fn clip_length(clip: &Clip, fps: f64) -> String {
    let secs = clip.duration.as_secs();
    let frames = (secs * fps).round();
    format!("{secs:.2} s, {frames} frames at {fps} fps")
}

/// Description of a clip in a file.
pub(crate) fn describe_clip(asset: &Asset, clip: &Arc<Clip>, fps: f64) -> String {
    let motion =
        RootMotion::new(&asset.skeleton, clip, None, RootParts::default(), (Time::ZERO, clip.duration));
    let speed = motion.map_or(0.0, |motion| motion.velocity().with_y(0.0).length());
    let travels = if speed > 0.005 { format!(", travels {speed:.2} m/s") } else { String::new() };
    format!("**{}** — clip of `{}`: {}{travels}", clip.name, asset.name, clip_length(clip, fps))
}

/// Description of the contents of a file.
pub(crate) fn describe_file(asset: &Asset, fps: f64) -> String {
    let primitives = || asset.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let triangles: usize =
        primitives().filter(|p| p.topology == Topology::Triangles).map(|p| p.indices.len() / 3).sum();
    let vertices: usize = primitives().map(|p| p.positions.len()).sum();
    let format = asset.origin.format.as_str();
    let mut lines = vec![format!("**{}**{}{format}", asset.name, if format.is_empty() { "" } else { " — " })];
    lines.push(format!(
        "{}, {vertices} vertices, {}",
        count_with_noun(triangles, "triangle"),
        count_with_noun(asset.materials.len(), "material")
    ));
    let bounds = asset.rest_bounds();
    if !bounds.is_empty() {
        let size = bounds.max - bounds.min;
        lines.push(format!("{:.2} × {:.2} × {:.2} m at rest (x, y up, z)", size.x, size.y, size.z));
    }
    lines.push(count_with_noun(asset.skeleton.len(), "joint"));
    let morphs = morph_names(asset).len();
    let others = [
        (morphs, "morph target"),
        (asset.expressions.len(), "expression"),
        (asset.cameras.len(), "camera"),
        (asset.lights.len(), "light"),
    ];
    lines.extend(others.into_iter().filter(|(n, _)| *n > 0).map(|(n, what)| count_with_noun(n, what)));
    if !asset.clips.is_empty() {
        const MAX_LISTED_CLIPS: usize = 12;
        let clips = asset
            .clips
            .iter()
            .take(MAX_LISTED_CLIPS)
            .map(|c| format!("`{}` {:.2} s", c.name, c.duration.as_secs()));
        let more = asset.clips.len().saturating_sub(MAX_LISTED_CLIPS);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        lines.push(format!(
            "{} at {fps} fps: {}{more}",
            count_with_noun(asset.clips.len(), "clip"),
            clips.collect::<Vec<_>>().join(", ")
        ));
    }
    let warnings = asset.warnings.iter().take(4).map(|w| format!("warning: {}", w.text));
    lines.extend(warnings);
    lines.join("\n\n")
}

pub(crate) fn morph_names(asset: &Asset) -> Vec<String> {
    let mut names: Vec<String> = asset.meshes.iter().flat_map(|m| m.morph_names.iter().cloned()).collect();
    names.sort();
    names.dedup();
    names
}

/// Short name of each joint that scripts may use instead of the name in the file, if there is one: `RightHand` for `mixamorig:RightHand`
/// and for `hand.r_Armature`.
pub(crate) fn short_joints(skeleton: &Skeleton) -> Vec<Option<String>> {
    let own = skeleton.names();
    let mut short: Vec<Option<String>> = vec![None; own.len()];
    let without_prefix = |name: &String| name.rsplit([':', '|']).next().unwrap_or(name).to_string();
    for name in skeleton.short_names().into_iter().chain(own.iter().map(without_prefix)) {
        let Some(joint) = skeleton.find(&name).filter(|joint| own[*joint] != name) else { continue };
        short[joint].get_or_insert(name);
    }
    short
}

/// Description of a joint, such as "joint of `a.glb`, child of Hips, 3 joints below it". `name` may be a short name, such as LeftHand for
/// hand.l.
pub(crate) fn describe_joint(asset: &Asset, name: &str) -> Option<String> {
    let skeleton = &asset.skeleton;
    let index = skeleton.find(name)?;
    let own = &skeleton.names()[index];
    let short = if own == name { String::new() } else { format!("`{own}`, ") };
    let parents = skeleton.parents();
    let below = (0..skeleton.len()).filter(|joint| {
        std::iter::successors(parents[*joint], |p| parents[*p as usize]).any(|above| above as usize == index)
    });
    let parent = match parents[index] {
        Some(parent) => format!("child of `{}`", skeleton.names()[parent as usize]),
        None => "root".to_string(),
    };
    Some(format!(
        "**{name}** — {short}joint of `{}`, {parent}, {} below it",
        asset.name,
        count_with_noun(below.count(), "joint")
    ))
}

/// An entry of the reference as Markdown.
pub(crate) fn describe_entry(entry: &Entry) -> String {
    use choreo_script::describe::Returns;
    let gives = match entry.returns {
        Returns::Nothing | Returns::Receiver => String::new(),
        Returns::Handle(kind) => format!(" → {kind}"),
        Returns::Value(what) => format!(" → {what}"),
    };
    let usages: Vec<String> = entry.usages.iter().map(|usage| format!("{usage}{gives}")).collect();
    let mut text =
        format!("```rhai\n{}\n```\n{}", usages.join("\n"), entry.about.first().map_or("", String::as_str));
    for paragraph in entry.about.iter().skip(1) {
        text.push_str(&format!("\n- {paragraph}"));
    }
    if entry.in_frames && !entry.is_constant {
        text.push_str("\n\nAlso inside `on_frame`.");
    }
    if entry.in_tests {
        text.push_str("\n\nOnly inside a test section.");
    }
    text
}

/// Description of an option of a call.
pub(crate) fn describe_option(entry: &Entry, option: &OptionEntry) -> String {
    match option.about.is_empty() {
        true => format!("**{}** — option of `{}`", option.name, entry.full_name()),
        false => format!("**{}** — option of `{}`: {}", option.name, entry.full_name(), option.about),
    }
}

/// Description of an option of a plugin, such as "how bright (0 to 10, default 1)".
pub(crate) fn describe_plugin_option(option: &OptionSpec) -> String {
    format!("{} ({}, default {})", option.about, option.allowed(), option.default())
}
