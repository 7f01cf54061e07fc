//! Loading of assets, and their contents: clips, joints, morph targets, expressions and cameras.

use crate::call::{ApiError, Call, Reply, api, describe, int_or_float, one_of, unknown};
use crate::limits::raise_hint;
use crate::loader::ImportChoice;
use crate::value::{AssetRef, ClipRef};
use choreo_motion::{Clip, Front};
use choreo_plugin::{ImportScope, OptionValue};
use rhai::{Dynamic, Map};
use std::sync::{Arc, PoisonError};

api! {
    /// Loads a model or animation clips from the folder of the script or from a search path, or a built-in asset
    /// such as "choreo:mannequin". Files are imported in parallel; the script waits for a file only where it uses
    /// the contents.
    /// - Options: facing ("+z", "-z", "+x" or "-x": the front of the model, which face, path and look_at turn to their
    ///   targets; found by its feet, eyes, knees and clips by default, see `choreo info`).
    /// - Options: importer (name of the importer; chosen by the file by default), compress (tolerance in metres,
    ///   0.000001 to 0.1: each clip is compressed as by Clip.compress), only ("clips": imports neither meshes nor
    ///   textures), and all options of the importer (`choreo plugins` lists them).
    /// - Where the script shows that it uses only the clips of a file, "clips" is the default.
    load("file, options?") -> Asset = load;
    /// Returns a clip of the file, by name or by index from 0.
    Asset.clip("name_or_index") -> Clip = clip;
    /// Returns the names of the clips.
    Asset.clips("") -> "array of texts" = clips;
    /// Returns the names of the joints (bones).
    Asset.joints("") -> "array of texts" = joints;
    /// Returns the names of the morph targets (blend shapes, shape keys).
    Asset.morphs("") -> "array of texts" = morphs;
    /// Returns the names of the facial expressions, visemes included where the file has them.
    Asset.expressions("") -> "array of texts" = super::expression::names;
    /// Returns a camera of the file, by name or by index from 0. It belongs to the first actor cast from the file
    /// and moves with it. The argument may be left out where the file has one camera.
    Asset.camera("name_or_index?") -> Camera = super::camera::of_asset;
    /// Returns the length of the clip in seconds.
    Clip.duration("") -> "float" = duration;
    /// Returns the name of the clip.
    Clip.name("") -> "text" = clip_name;
}

fn load(c: &mut Call) -> Reply {
    let name = c.text(0)?;
    let mut choice = ImportChoice::default();
    if c.len() > 1 {
        let Some(map) = c.value(1).try_cast::<Map>() else {
            return Err(c.wrong(1, "an object map like #{ name: value }"));
        };
        for (key, value) in &map {
            if key == "importer" {
                choice.importer = Some(crate::call::text(value, "load: importer")?);
                continue;
            }
            if key == "only" {
                one_of(value, "load: only", &["clips"])?;
                choice.requested_parts = Some(ImportScope::CLIPS);
                continue;
            }
            if key == "facing" {
                let given = one_of(value, "load: facing", &Front::ALL.map(|(name, _)| name))?;
                choice.front = Front::ALL.iter().find(|(name, _)| *name == given).map(|(_, front)| *front);
                continue;
            }
            if key == "compress" {
                choice.compress = Some(compression_tolerance(value)?);
                continue;
            }
            choice.options.0.insert(key.to_string(), option_value(key, value)?);
        }
    }
    let (count, limit) = (c.context.loader.import_count(), c.context.limits.files);
    if count as u64 >= limit {
        let error = ApiError::new("load: too many files").hint(raise_hint("files", limit));
        return Err(ApiError { fatal: true, ..error });
    }
    let start = c.context.test().scene.as_ref().map(|scene| scene.folder.clone());
    let clips_only = choice.requested_parts.is_none() && {
        let places = c.context.clips_only.lock().unwrap_or_else(PoisonError::into_inner);
        places.contains(&c.place)
    };
    if clips_only {
        choice.requested_parts = Some(ImportScope::CLIPS);
    }
    choice.clips = c.context.played_clips.get().cloned().unwrap_or_default();
    let started = c.context.loader.start(start.as_deref(), &name, &choice);
    let import = started.map_err(|e| ApiError::from(e).focus(name))?;
    let load = c.stage_draft().add_import_load(import, &c.place, clips_only);
    Ok(Dynamic::from(AssetRef { load, dead: false }))
}

fn compression_tolerance(value: &Dynamic) -> Result<f64, ApiError> {
    int_or_float(value).filter(|m| (1e-6..=0.1).contains(m)).ok_or_else(|| {
        let got = describe(value);
        ApiError::new(format!("load: compress must be metres, from 0.000001 to 0.1, got {got}"))
            .focus("compress")
    })
}

/// The value of an importer's option.
fn option_value(key: &str, value: &Dynamic) -> Result<OptionValue, ApiError> {
    if let Ok(n) = value.as_int() {
        return Ok(OptionValue::Number(n as f64));
    }
    if let Ok(n) = value.as_float() {
        return Ok(OptionValue::Number(n));
    }
    if let Ok(b) = value.as_bool() {
        return Ok(OptionValue::Bool(b));
    }
    if let Some(numbers) = crate::call::numbers(value) {
        return Ok(OptionValue::Numbers(numbers));
    }
    value.clone().into_string().map(OptionValue::Text).map_err(|_| {
        ApiError::new(format!(
            "load: option {key} must be a number, true or false, text or an array of numbers, got {}",
            describe(value)
        ))
        .focus(key)
    })
}

fn clip(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    let clips = &asset.clips;
    let wanted = c.value(0);
    let found: Arc<Clip> = if let Ok(index) = wanted.as_int() {
        usize::try_from(index).ok().and_then(|i| clips.get(i)).cloned().ok_or_else(|| {
            ApiError::new(format!(
                "there is no clip {index} in \"{}\": it has {}, numbered from 0",
                asset.name,
                crate::errors::format_count(clips.len(), "clip")
            ))
        })?
    } else if wanted.is_string() {
        let name = c.text(0)?;
        let names = || clips.iter().map(|clip| clip.name.as_str());
        let place = format!(" in \"{}\"", asset.name);
        clips
            .iter()
            .find(|clip| clip.name == name)
            .cloned()
            .ok_or_else(|| unknown("clip", &name, &place, names().collect::<Vec<_>>()))?
    } else {
        return Err(c.wrong(0, "the name or number of a clip"));
    };
    Ok(Dynamic::from(ClipRef { clip: found, asset, dead: false }))
}

fn text_array<'a>(names: impl Iterator<Item = &'a str>) -> Reply {
    Ok(Dynamic::from_array(names.map(|n| Dynamic::from(n.to_string())).collect()))
}

fn clips(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    c.stage_draft().mark_used(&asset);
    text_array(asset.clips.iter().map(|clip| clip.name.as_str()))
}

fn joints(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    c.stage_draft().mark_used(&asset);
    text_array(asset.skeleton.names().iter().map(String::as_str))
}

fn morphs(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    c.stage_draft().mark_used(&asset);
    let mut names: Vec<&str> =
        asset.meshes.iter().flat_map(|m| m.morph_names.iter().map(String::as_str)).collect();
    names.sort_unstable();
    names.dedup();
    text_array(names.into_iter())
}

fn duration(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    c.stage_draft().mark_used(&this.asset);
    Ok(Dynamic::from_float(this.clip.duration.as_secs()))
}

fn clip_name(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    Ok(Dynamic::from(this.clip.name.clone()))
}
