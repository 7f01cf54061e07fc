//! Provenance: how an image or video was made, as (keyword, text). Exporters write it into their files, `choreo info` shows it, and
//! `--resume` requires it to be equal.

use crate::failure::Failure;
use crate::output::media::ID_KEYWORD;
use crate::scene::OpenedScene;
use choreo_motion::{FrameRate, Time};
use choreo_plugin::{ExportOptions, Manifest, OptionValue};
use choreo_render::DeviceInfo;
use choreo_stage::Settings;
use std::collections::BTreeSet;
use std::path::Path;

/// Keyword of the time of a single image: seconds of the scene's timeline.
pub(crate) const TIME_KEYWORD: &str = "choreo:time";

/// Provenance of an image or video. It does not depend on the range of frames, the time or the machine: the halves of a video have the
/// provenance of the whole.
pub(crate) fn of_render(
    scene: &OpenedScene,
    settings: &Settings,
    samples: u32,
    options: &ExportOptions,
    device: &DeviceInfo,
) -> Vec<(String, String)> {
    let [w, h] = settings.size;
    let arguments = format!("--size {w}x{h} --fps {} --samples {samples}", format_fps(settings.fps));
    scene_provenance(scene, arguments, options, Some(device))
}

/// Provenance of a scene that is exported; includes name and version of the exporter.
pub(crate) fn of_scene_export(
    scene: &OpenedScene,
    rate: FrameRate,
    options: &ExportOptions,
    exporter: &Manifest,
) -> Vec<(String, String)> {
    let mut all = scene_provenance(scene, format!("--fps {}", format_fps(rate)), options, None);
    all.push(("choreo:exporter".to_string(), exporter.to_string()));
    all
}

fn scene_provenance(
    scene: &OpenedScene,
    mut arguments: String,
    options: &ExportOptions,
    device: Option<&DeviceInfo>,
) -> Vec<(String, String)> {
    for argument in &scene.arguments {
        arguments.push(' ');
        arguments.push_str(argument);
    }
    for (name, value) in &options.0 {
        let value = match value {
            OptionValue::Number(v) => v.to_string(),
            OptionValue::Bool(v) => v.to_string(),
            OptionValue::Text(v) => v.clone(),
            OptionValue::Numbers(v) => v.iter().map(f64::to_string).collect::<Vec<_>>().join(","),
        };
        arguments.push_str(&format!(" --export {name}={value}"));
    }
    // Each value must fit on one line, even if a parameter contains line breaks.
    let line = |v: String| match v.contains(char::is_control) {
        true => v
            .chars()
            .map(|c| if c.is_control() { c.escape_default().to_string() } else { c.into() })
            .collect(),
        false => v,
    };
    let entry = |k: &str, v: String| (k.to_string(), line(v));
    let mut all = vec![
        entry("Software", scene.software.clone()),
        entry("choreo:source", scene.name.clone()),
        entry(if scene.is_script { "choreo:script" } else { "choreo:model" }, short_hex(&scene.input_hash)),
        entry("choreo:stage", short_hex(&scene.stage.content_hash())),
        entry("choreo:plugins", plugin_list(scene)),
        entry("choreo:arguments", arguments),
    ];
    all.extend(device.map(|d| entry("choreo:device", format!("{} ({})", d.name, d.driver))));
    let mut hasher = blake3::Hasher::new();
    for text in all.iter().flat_map(|(k, v)| [k, v]) {
        hasher.update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
    }
    all.push(entry(ID_KEYWORD, short_hex(hasher.finalize().as_bytes())[..16].to_string()));
    all
}

/// Names and versions of the importers and effects that made the scene, each once.
fn plugin_list(scene: &OpenedScene) -> String {
    let importers = scene.stage.actors.iter().map(|actor| actor.asset.origin.importer.clone());
    let effect = |name: &str| scene.registry.effect(name).map(|effect| effect.manifest().to_string());
    let effects = scene.stage.effects.iter().filter_map(|used| effect(&used.plugin));
    let used: BTreeSet<String> = importers.chain(effects).filter(|name| !name.is_empty()).collect();
    used.into_iter().collect::<Vec<_>>().join(", ")
}

/// The provenance of one image, with its time.
pub(crate) fn with_time(provenance: &[(String, String)], time: Time) -> Vec<(String, String)> {
    let mut all = provenance.to_vec();
    all.push((TIME_KEYWORD.to_string(), time.as_secs().to_string()));
    all
}

/// First half of a hash in hexadecimal digits: enough to tell any two inputs apart.
fn short_hex(hash: &[u8; 32]) -> String {
    choreo_script::hex(&hash[..16])
}

fn format_fps(rate: FrameRate) -> String {
    match rate.den {
        1 => rate.num.to_string(),
        den => format!("{}/{den}", rate.num),
    }
}

/// The differences between two renders: keyword, old value, new value.
pub(crate) fn differences(
    before: &[(String, String)],
    now: &[(String, String)],
) -> Vec<(String, String, String)> {
    let value = |list: &[(String, String)], keyword: &str| -> String {
        let found = list.iter().find(|(k, _)| k == keyword);
        found.map_or("not known".to_string(), |(_, v)| v.clone())
    };
    let mut found: Vec<(String, String, String)> = Vec::new();
    for (keyword, _) in before.iter().chain(now).filter(|(k, _)| k != ID_KEYWORD) {
        let (before, now) = (value(before, keyword), value(now, keyword));
        let keyword = keyword.trim_start_matches("choreo:");
        if before != now && found.iter().all(|(known, ..)| known != keyword) {
            found.push((keyword.to_string(), before, now));
        }
    }
    found
}

/// Refuses to resume a render that was made with other settings, and names the differences. `shown`: the output in messages;
/// `part`: the file or folder of the stopped render.
pub(crate) fn check_same_settings(
    shown: &str,
    part: &Path,
    before: &[(String, String)],
    now: &[(String, String)],
) -> Result<(), Failure> {
    let found = differences(before, now);
    if found.is_empty() {
        return Ok(());
    }
    let lines = found.iter().map(|(keyword, before, now)| format!("\n    {keyword}: {before}, now {now}"));
    Err(Failure::Output(format!(
        "{shown}: --resume cannot go on with {}: it was made with other settings{}\n    hint: give the same \
         settings again, or leave --resume out to render everything again",
        part.display(),
        lines.collect::<String>()
    )))
}
