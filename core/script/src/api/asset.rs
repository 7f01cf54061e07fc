//! `load`, `shape`, clips of an asset.

use crate::call::{ApiError, Call, Def, Gives, Reply, describe, one_of, unknown};
use crate::folders::LoadError;
use crate::limits::raise_hint;
use crate::loader::ImportChoice;
use crate::shapes;
use crate::value::{AssetRef, ClipRef, Kind};
use choreo_motion::Clip;
use choreo_plugin::{Needs, OptionValue};
use rhai::{Dynamic, Map};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

pub const DEFS: &[Def] = &[
    Def::new(
        Kind::None,
        "load",
        "file, options?",
        Gives::A(Kind::Asset),
        "Loads a model or clips from the script's folder or a search path, or a built-in like \"choreo:mannequin\"; options are the importer's, and importer: NAME, only: \"clips\" for files of which nothing is seen.",
        load,
    ),
    Def::new(
        Kind::None,
        "shape",
        "kind, options?",
        Gives::A(Kind::Asset),
        "A \"plane\", \"box\", \"sphere\" or \"cylinder\": size, color, roughness, metallic, unlit, or shininess and specular (a color) for Blinn–Phong; checker: a second color, tiles: their number.",
        shape,
    ),
    Def::new(
        Kind::Asset,
        "clip",
        "name_or_index",
        Gives::A(Kind::Clip),
        "A clip of the file, by name or number.",
        clip,
    ),
    Def::new(Kind::Asset, "clips", "", Gives::Value("array of texts"), "Names of the clips.", clips),
    Def::new(Kind::Asset, "joints", "", Gives::Value("array of texts"), "Names of the joints.", joints),
    Def::new(
        Kind::Asset,
        "morphs",
        "",
        Gives::Value("array of texts"),
        "Names of the morph targets.",
        morphs,
    ),
    Def::new(
        Kind::Asset,
        "expressions",
        "",
        Gives::Value("array of texts"),
        "Names of the facial expressions.",
        super::expression::names,
    ),
    Def::new(
        Kind::Asset,
        "camera",
        "name_or_index?",
        Gives::A(Kind::Camera),
        "A camera of the file, on the first actor cast from it.",
        super::camera::of_asset,
    ),
    Def::new(Kind::Clip, "duration", "", Gives::Value("float"), "Length of the clip in seconds.", duration),
    Def::new(Kind::Clip, "name", "", Gives::Value("text"), "Name of the clip.", clip_name),
];

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
                choice.needs = Some(Needs::CLIPS);
                continue;
            }
            choice.options.0.insert(key.to_string(), option_value(key, value)?);
        }
    }
    let (loaded, most) = (c.shared.loader.loaded(), c.shared.limits.files);
    if loaded as u64 >= most {
        let error = ApiError::new("load: too many files").hint(raise_hint("files", most));
        return Err(ApiError { fatal: true, ..error });
    }
    // Loading takes as long as the files are large: the script's own time stands still, but not for what fails or is there
    // already, which could be asked for without end.
    let before = Instant::now();
    let start = c.shared.test().scene.as_ref().map(|scene| scene.folder.clone());
    let loaded = c.shared.loader.load_from(start.as_deref(), &name, &choice);
    let taken = before.elapsed();
    if let Some(deadline) = c.shared.deadline.lock().unwrap_or_else(PoisonError::into_inner).as_mut()
        && loaded.is_ok()
        && taken > Duration::from_millis(1)
    {
        *deadline += taken;
    }
    let asset = loaded.map_err(|e| from_load(e).focus(name))?;
    c.build().loaded(&asset, &c.place);
    Ok(Dynamic::from(AssetRef { asset, dead: false }))
}

fn from_load(e: LoadError) -> ApiError {
    let mut error = ApiError::new(e.message);
    error.hint = e.hint;
    error
}

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
    value.clone().into_string().map(OptionValue::Text).map_err(|_| {
        ApiError::new(format!(
            "load: option {key} must be a number, true or false, or text, got {}",
            describe(value)
        ))
        .focus(key)
    })
}

fn shape(c: &mut Call) -> Reply {
    let asset = shapes::shape(c)?;
    c.build().loaded(&asset, &c.place);
    Ok(Dynamic::from(AssetRef { asset, dead: false }))
}

fn clip(c: &mut Call) -> Reply {
    let this: AssetRef = c.this()?;
    let clips = &this.asset.clips;
    let wanted = c.value(0);
    let found: Arc<Clip> = if let Ok(index) = wanted.as_int() {
        usize::try_from(index).ok().and_then(|i| clips.get(i)).cloned().ok_or_else(|| {
            ApiError::new(format!(
                "clip {index} of \"{}\": it has {} clips, from 0",
                this.asset.name,
                clips.len()
            ))
        })?
    } else if wanted.is_string() {
        let name = c.text(0)?;
        let names = || clips.iter().map(|clip| clip.name.as_str());
        let place = format!(" in \"{}\"", this.asset.name);
        clips
            .iter()
            .find(|clip| clip.name == name)
            .cloned()
            .ok_or_else(|| unknown("clip", &name, &place, names().collect::<Vec<_>>()))?
    } else {
        return Err(c.wrong(0, "the name or number of a clip"));
    };
    Ok(Dynamic::from(ClipRef { clip: found, asset: this.asset, dead: false }))
}

fn texts<'a>(names: impl Iterator<Item = &'a str>) -> Reply {
    Ok(Dynamic::from_array(names.map(|n| Dynamic::from(n.to_string())).collect()))
}

fn clips(c: &mut Call) -> Reply {
    let this: AssetRef = c.this()?;
    c.build().used(&this.asset);
    texts(this.asset.clips.iter().map(|clip| clip.name.as_str()))
}

fn joints(c: &mut Call) -> Reply {
    let this: AssetRef = c.this()?;
    c.build().used(&this.asset);
    texts(this.asset.skeleton.names().iter().map(String::as_str))
}

fn morphs(c: &mut Call) -> Reply {
    let this: AssetRef = c.this()?;
    c.build().used(&this.asset);
    let mut names: Vec<&str> =
        this.asset.meshes.iter().flat_map(|m| m.morph_names.iter().map(String::as_str)).collect();
    names.sort_unstable();
    names.dedup();
    texts(names.into_iter())
}

fn duration(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    c.build().used(&this.asset);
    Ok(Dynamic::from_float(this.clip.duration.as_secs()))
}

fn clip_name(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    Ok(Dynamic::from(this.clip.name.clone()))
}
