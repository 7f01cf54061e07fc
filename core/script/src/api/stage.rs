//! Stage settings, parameters and per-frame callbacks: `stage`, `f`, `param`, `on_frame`.

use crate::build::{FrameCallbackDraft, Parameter, check_limit};
use crate::call::{ApiError, Call, Options, Reply, api, color, numbers, point, rgb, wrong};
use crate::frame_callback::with_copied_captures;
use crate::limits::raise_hint;
use crate::value::StageRef;
use choreo_motion::{FrameRate, Time};
use choreo_stage::{Background, Pipeline, PreSkinning, Settings, ViewTransform};
use rhai::{Dynamic, FnPtr, Map};

api! {
    /// Sets the properties of the stage. Call it once, first. Without options, inside a test, it returns the stage
    /// for `expect`.
    /// - Output: size ([width, height] in pixels, each 1 to 16384, default [1280, 720]), fps (0.001 to 1000,
    ///   default 30), length (seconds, default 4), samples (per pixel, for multisample antialiasing: 1 or 4,
    ///   default 4).
    /// - Background and light: background (a color or #{ top, bottom } for a vertical gradient, default a blue-gray
    ///   gradient), ambient (ambient light: a color, a strength of white light, or #{ up, down } for light from
    ///   above and from below; a white surface under a strength of 1 is 1), exposure (stops, -20 to 20, default 0:
    ///   1 doubles the light of surfaces and of the sky), view (the view transform, from light to the colors of a
    ///   display: "neutral", the default, Khronos PBR Neutral, keeps base colors and compresses highlights; "agx"
    ///   looks like film; "none" is no transform: values are cut off at 1 and sRGB-encoded). Unlit and toon surfaces, 2D layers, lines and plain
    ///   backgrounds keep their exact colors. The effect tonemap takes the place of the view transform; with bloom,
    ///   ambient_occlusion, depth_of_field, god_rays or heat_haze, which work on light, it runs after them, over the whole
    ///   image, so that those colors change too.
    /// - Rendering: cutouts (edges of alpha-masked surfaces such as leaves and hair at 4 samples: "smooth", the
    ///   default, or "hard"), transparency (order of transparent surfaces: "sorted" back to front mesh by mesh,
    ///   "independent" of the order, per pixel, by depth peeling with up to 8 layers, or "auto", the default:
    ///   "independent" where sorting fails), pipeline ("forward": surfaces are lit as they are drawn; "deferred":
    ///   each pixel is lit once, from a G-buffer, with 1 sample; "auto", the default: the faster of the two, by the
    ///   number of lights and the overdraw), skin_once (pre-skinning. true: a mesh is skinned once per frame for
    ///   all passes that draw it; false: in each pass; "auto", the default: once where that is cheaper),
    ///   levels_of_detail (LOD; true, the default: models that are often so small on screen that their triangles are
    ///   smaller than pixels get simplified versions, which are drawn where the difference is not visible; false:
    ///   all triangles are drawn).
    stage("options | ") -> Stage = stage;
    /// Returns the time of a frame in seconds, at the frame rate (fps) of the stage.
    f("frame") -> "float" = frame, in_frames;
    /// Declares a parameter of the script and returns its value: the default, or the value that `--set name=value`
    /// gives, converted to the type of the default. The default is a number, true or false, a text or an array of
    /// numbers; `about` is a description.
    param("name, default, about?") -> "like the default" = param;
    /// Calls a function |t| … for every frame; t is the time in seconds. What it changes on actors, cameras, lights
    /// and effects holds for that frame only.
    on_frame("callback") -> () = on_frame;
}

fn stage(c: &mut Call) -> Reply {
    let this = StageRef(c.context.test().current_stage);
    if c.len() == 0 {
        if c.context.test().is_running {
            return Ok(Dynamic::from(this));
        }
        return Err(ApiError::new("stage: options are missing").hint("write stage(#{ … })"));
    }
    let o = c.options(
        0,
        &[
            "size",
            "fps",
            "length",
            "background",
            "ambient",
            "exposure",
            "view",
            "samples",
            "cutouts",
            "transparency",
            "pipeline",
            "skin_once",
            "levels_of_detail",
        ],
    )?;
    if let Some(before) = &c.stage_draft().settings_at {
        return Err(ApiError::new(format!("stage: already called in line {}", before.line))
            .hint("call it once, before other functions"));
    }
    let mut s = c.stage_draft().settings.clone();
    if let Some(size) = o.read("size", read_size)? {
        check_pixels(c, size)?;
        s.size = size;
    }
    let length_in_frames = read_rate(c, &o, &mut s)?;
    if let Some(length) = length_in_frames.or(o.duration("length")?) {
        if length == Time::ZERO {
            return Err(ApiError::new("stage: length must be above 0 s"));
        }
        s.length = length;
    }
    if let Some(background) = o.get("background") {
        s.background = read_background(c, &background)?;
    }
    let ambient = o.get("ambient");
    if let Some(ambient) = &ambient {
        (s.ambient_up, s.ambient_down) = super::light::read_ambient(c, ambient, "stage: ambient")?;
    }
    s.exposure = o.number_in("exposure", -20.0, 20.0)?.map_or(s.exposure, |stops| stops as f32);
    s.view_transform = match o.one_of("view", &["neutral", "agx", "none"])? {
        Some("agx") => ViewTransform::Agx,
        Some("none") => ViewTransform::None,
        Some(_) => ViewTransform::Neutral,
        None => s.view_transform,
    };
    read_rendering(&o, &mut s)?;
    check_frames(c, &s)?;
    let place = c.place.clone();
    let mut stage_draft = c.stage_draft();
    stage_draft.settings = s;
    if ambient.is_some() {
        (stage_draft.sets_ambient, stage_draft.ambient_at) = (true, None);
    }
    stage_draft.settings_at = Some(place);
    Ok(Dynamic::from(this))
}

/// Reads the size of an image in pixels.
pub(crate) fn read_size(size: &Dynamic, label: &str) -> Result<[u32; 2], ApiError> {
    let sides = numbers(size).filter(|n| n.len() == 2);
    let sides = sides.filter(|n| n.iter().all(|v| v.fract() == 0.0 && (1.0..=16384.0).contains(v)));
    let sides = sides.ok_or_else(|| wrong(size, label, "[width, height], whole numbers from 1 to 16384"))?;
    Ok([sides[0] as u32, sides[1] as u32])
}

fn check_pixels(c: &Call, [width, height]: [u32; 2]) -> Result<(), ApiError> {
    let most = c.context.limits.pixels;
    if u64::from(width) * u64::from(height) > most {
        let text = format!("stage: an image of {width} x {height} has too many pixels");
        return Err(ApiError::new(text).hint(raise_hint("pixels", most)));
    }
    Ok(())
}

/// Reads the frame rate. In `stage(#{ fps: 25, length: f(50) })` the frames are converted to seconds before the call,
/// at the earlier rate; then the length is converted again.
fn read_rate(c: &Call, o: &Options, s: &mut Settings) -> Result<Option<Time>, ApiError> {
    let Some(fps) = o.number("fps")? else { return Ok(None) };
    s.fps =
        FrameRate::from_fps(fps).map_err(|why| ApiError::new(format!("stage: fps {why}, got {fps:?}")))?;
    let own_length = o.number("length").ok().flatten();
    let changed = s.fps != c.build_fps();
    match c.stage_draft().frame_calls.clone().filter(|_| changed) {
        Some((_, 1, frame, time)) if own_length == Some(time) => {
            Ok(Some(Time::from_secs(frame_secs(s.fps, frame))))
        }
        Some((place, ..)) => Err(ApiError::new(format!(
            "stage: fps cannot change after f(…) in line {} has counted frames",
            place.line
        ))
        .hint("call stage(…) first")),
        None => Ok(None),
    }
}

/// Reads the rendering options.
fn read_rendering(o: &Options, s: &mut Settings) -> Result<(), ApiError> {
    if let Some(samples) = o.number("samples")? {
        if samples != 1.0 && samples != 4.0 {
            return Err(ApiError::new(format!("stage: samples must be 1 or 4, got {samples}")));
        }
        s.samples = Some(samples as u32);
    }
    s.cutouts = super::surfaces::cutouts(o)?.unwrap_or(s.cutouts);
    s.transparency = super::surfaces::transparency(o)?.unwrap_or(s.transparency);
    s.pipeline = match o.one_of("pipeline", &["auto", "forward", "deferred"])? {
        Some("forward") => Pipeline::Forward,
        Some("deferred") => Pipeline::Deferred,
        Some(_) => Pipeline::Auto,
        None => s.pipeline,
    };
    if s.pipeline == Pipeline::Deferred {
        // A G-buffer has one sample per pixel.
        if let Some(samples) = s.samples.filter(|n| *n > 1) {
            return Err(ApiError::new(format!(
                "stage: pipeline \"deferred\" has 1 sample per pixel, got samples: {samples}"
            ))
            .hint("leave samples out, or pipeline"));
        }
        s.samples = Some(1);
    }
    let when = |v: &Dynamic, label: &str| match v.as_bool() {
        Ok(true) => Ok(PreSkinning::Always),
        Ok(false) => Ok(PreSkinning::Never),
        Err(_) if v.clone().into_string().is_ok_and(|word| word == "auto") => Ok(PreSkinning::Auto),
        Err(_) => Err(wrong(v, label, "true, false or \"auto\"")),
    };
    s.pre_skinning = o.read("skin_once", when)?.unwrap_or(s.pre_skinning);
    s.levels_of_detail = o.flag("levels_of_detail")?.unwrap_or(s.levels_of_detail);
    Ok(())
}

fn check_frames(c: &Call, s: &Settings) -> Result<(), ApiError> {
    let (frames, most) = (s.fps.frames_in(s.length), c.context.limits.frames);
    if frames <= i64::try_from(most).unwrap_or(i64::MAX) {
        return Ok(());
    }
    let (length, fps) = (s.length.as_secs(), s.fps.as_fps());
    let text = format!("stage: {length} s at {fps} frames per second are too many frames, {frames}");
    Err(ApiError::new(text).hint(raise_hint("frames", most)))
}

fn read_background(c: &Call, v: &Dynamic) -> Result<Background, ApiError> {
    let Some(map) = v.read_lock::<Map>() else {
        return color(v, "stage: background").map(Background::Color);
    };
    let o = Options { function: "stage: background".into(), map: map.clone() };
    o.check(c, &["top", "bottom"])?;
    match (o.color("top")?, o.color("bottom")?) {
        (Some(top), Some(bottom)) => Ok(Background::Gradient { top: rgb(top), bottom: rgb(bottom) }),
        _ => Err(ApiError::new("stage: background needs both colors, #{ top, bottom }")),
    }
}

fn frame(c: &mut Call) -> Reply {
    let n = c.number_in(0, -1e9, 1e9)?;
    if c.in_frame {
        // The rate cannot change any more.
        let rate = c.build_fps();
        return Ok(Dynamic::from_float(frame_secs(rate, n)));
    }
    let place = c.place.clone();
    let mut stage_draft = c.stage_draft();
    let time = frame_secs(stage_draft.settings.fps, n);
    let (place, count) =
        stage_draft.frame_calls.take().map_or((place, 0), |(first, count, ..)| (first, count));
    stage_draft.frame_calls = Some((place, count + 1, n, time));
    Ok(Dynamic::from_float(time))
}

fn frame_secs(rate: FrameRate, frame: f64) -> f64 {
    if frame.fract() == 0.0 {
        return rate.time_of(frame as i64).as_secs();
    }
    frame * f64::from(rate.den) / f64::from(rate.num)
}

fn param(c: &mut Call) -> Reply {
    let name = c.name(0)?;
    let valid = name.starts_with(|ch: char| ch.is_ascii_alphabetic() || ch == '_')
        && name.chars().all(|ch| ch.is_ascii_alphanumeric() || ch == '_' || ch == '-');
    if !valid {
        return Err(ApiError::new(format!(
            "param: name must be letters, digits, _ or -, starting with a letter, got \"{name}\""
        )));
    }
    let about = if c.len() > 2 { c.text(2)? } else { String::new() };
    let default = c.value(1);
    let kind = kind_of_parameter(&default)
        .ok_or_else(|| c.wrong(1, "a number, true or false, text or an array of numbers"))?;
    if let Some(before) = c.stage_draft().parameters.iter().find(|p| p.name == name) {
        return Err(ApiError::new(format!("param: \"{name}\" is already declared in line {}", before.line)));
    }
    check_limit(c.stage_draft().parameters.len(), "parameters", &c.context.limits)?;
    let of_scene = c.context.test().scene.as_ref().map(|scene| scene.set_parameters.clone());
    let set = of_scene.as_ref().unwrap_or(&c.context.set_parameters);
    let given = set.iter().rev().find(|(n, _)| *n == name).map(|(_, v)| v.clone());
    let value = match &given {
        None => default.clone(),
        Some(text) => parse_parameter(kind, text).ok_or_else(|| {
            ApiError::new(format!("param: --set {name}={text} is not {}", kind_in_words(kind)))
                .hint(format!("the default is {}", display_value(&default)))
        })?,
    };
    let line = c.place.line;
    let parameter =
        Parameter { name, kind, default: display_value(&default), value: display_value(&value), about, line };
    c.stage_draft().parameters.push(parameter);
    Ok(value)
}

fn kind_of_parameter(v: &Dynamic) -> Option<&'static str> {
    if v.is_int() {
        Some("int")
    } else if v.is_float() {
        Some("float")
    } else if v.is_bool() {
        Some("bool")
    } else if v.is_string() {
        Some("text")
    } else if v.is_array() && numbers(v).is_some() {
        Some("numbers")
    } else {
        None
    }
}

fn kind_in_words(kind: &str) -> &'static str {
    match kind {
        "int" => "a whole number",
        "float" => "a number",
        "bool" => "true or false",
        "numbers" => "numbers like 1,2.5,3",
        _ => "text",
    }
}

fn parse_parameter(kind: &str, text: &str) -> Option<Dynamic> {
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    match kind {
        "int" => text.trim().parse::<i64>().ok().map(Dynamic::from_int),
        "float" => number(text).map(Dynamic::from_float),
        "bool" => text.trim().parse::<bool>().ok().map(Dynamic::from_bool),
        "numbers" => {
            let inside = text.trim().trim_start_matches('[').trim_end_matches(']');
            let values: Option<Vec<f64>> = inside.split(',').map(number).collect();
            values.map(|v| Dynamic::from_array(v.into_iter().map(Dynamic::from_float).collect()))
        }
        _ => Some(Dynamic::from(text.to_string())),
    }
}

pub(crate) fn display_value(v: &Dynamic) -> String {
    match numbers(v) {
        Some(values) => values.iter().map(f64::to_string).collect::<Vec<_>>().join(","),
        None => v.to_string(),
    }
}

fn on_frame(c: &mut Call) -> Reply {
    let Some(callback) = c.value(0).try_cast::<FnPtr>() else {
        return Err(c.wrong(0, "a function of the time, |t| …"));
    };
    check_limit(c.stage_draft().frame_callbacks.len(), "on_frame callbacks", &c.context.limits)?;
    let callback = with_copied_captures(&callback)?;
    #[allow(deprecated, reason = "volatile, not deprecated, says Rhai")]
    let native_context = {
        let mut native_context = c.native_context.store_data();
        native_context.global.num_operations = Default::default();
        native_context
    };
    let at = c.place.clone();
    c.stage_draft().frame_callbacks.push(FrameCallbackDraft { callback, native_context, at });
    Ok(Dynamic::UNIT)
}

impl Call<'_, '_> {
    fn build_fps(&self) -> FrameRate {
        self.stage_draft().settings.fps
    }

    /// Reads a direction: a vector of any length but zero, normalized.
    pub(crate) fn direction(v: &Dynamic, label: &str) -> Result<glam::DVec3, ApiError> {
        let d = point(v, label)?;
        let length = d.length();
        if length < 1e-9 {
            return Err(ApiError::new(format!("{label} must not be zero")));
        }
        Ok(d / length)
    }
}
