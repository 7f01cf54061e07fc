//! 2D layers in front of the scene and behind it: `text`, `picture`, `panel`, `letterbox`.

use super::keys;
use crate::build::check_limit;
use crate::call::fields::pair;
use crate::call::{ApiError, Call, Options, Reply, api, fields};
use crate::fonts;
use crate::frame_callback;
use crate::value::{ImageRef, Layer2dRef};
use choreo_asset::Image;
use choreo_importer_kit::images::{Encoded, Formats};
use choreo_stage::{Align, Fit, Font, Layer2d, Layer2dContent, Layer2dEdit, TextOutline, TextPanel};
use glam::{DVec2, Vec4};
use rhai::Dynamic;
use std::sync::Arc;

api! {
    /// Adds a text (title, caption) over the frame.
    /// - Place: {}, anchor (the point of its box that is placed there: "center", the default, "left", "right",
    ///   "top", "bottom", "top_left", "top_right", "bottom_left" or "bottom_right").
    /// - Text: size (fraction of the image height, default 0.08), color (default white), width
    ///   (fraction of the image width at which lines break, default none), align ("left", "center", the
    ///   default, or "right"), line_height (in sizes, default 1.25), font (a .ttf or .otf file, default a built-in
    ///   font). Characters that the font lacks are drawn in another built-in font, else in one of the system, with a
    ///   warning. Letters run from left to right and are not joined.
    text("words, options?") -> Layer2d = text, options(|| fields::describe_options(&default_layer(), &METHODS));
    /// Adds an image over the frame: an Image, or a PNG, JPEG, WebP, BMP or TGA file. Options: at, offset, anchor
    /// and opacity as in `text`; and one of height or width (fraction of that of the frame, default height 0.3) and
    /// fit ("contain": as large as fits, "cover": fills the frame).
    picture("image, options?") -> Layer2d = picture;
    /// Adds a rectangle of one color over the frame. Options: at, offset, anchor and opacity as in `text`, size
    /// ([width, height] as fractions of the image, default all of it), color (default black).
    panel("options?") -> Layer2d = panel;
    /// Adds bars at the edges that leave an image ratio times as wide as high, such as 2.39. With keyframes of
    /// "scale" they slide in. Options: color (default black), opacity (0 to 1, default 1).
    letterbox("ratio, options?") -> Layer2d = letterbox;
    /// Sets the position of the layer's anchor, as fractions of the image.
    Layer2d.at("x, y | point") = at, in_frames;
    /// Sets the opacity: 0 is invisible, 1 hides what is below.
    Layer2d.opacity("value") = opacity, in_frames;
    /// Changes the words of a text.
    Layer2d.words("text") = words, in_frames;
    /// Draws an outline around the letters of a text. Options: color (default black), width (how far it reaches beyond
    /// the letters, in sizes of the text, 0 to 1, default 0.08).
    Layer2d.outline("options?") = outline;
    /// Puts a rectangle behind a text, as large as its lines and a margin; the text stays where it is. Options: color
    /// (default black with an opacity of 0.6), padding (the margin in sizes of the text, a number or [at the sides, at
    /// the top and the bottom], default [0.4, 0.15]), radius (of the rounding, in sizes of the text, 0 to 10,
    /// default 0.2).
    Layer2d.panel("options?") = text_panel;
    /// Scales the layer about its anchor.
    Layer2d.scale("factor") = field;
    /// Sets the start time (default 0).
    Layer2d.from("time") = field;
    /// Sets the end time.
    Layer2d.until("time") = until;
    /// Sets the duration of the fade-in and of the fade-out in seconds (default 0).
    Layer2d.fade("seconds") = field;
    /// Moves the layer behind the scene, in front of the background. By default it is in front of everything.
    Layer2d.under("") = field;
    /// Animates a property with keyframes [[time, value], …]: "position" ([x, y] as in Layer2d.at), "scale" or
    /// "opacity". `how`, easing and tangents as in Actor.key.
    Layer2d.key("property, keys, how?") = key;
}

/// Fields of a 2D layer that are methods, not options.
const METHODS: [&str; 5] = ["scale", "from", "until", "fade", "under"];

/// Option names of a 2D layer: those of all layers, and `more`.
fn option_names<'a>(layer: &Layer2d, more: &[&'a str]) -> Vec<&'a str> {
    [&fields::names(layer, &METHODS)[..], &["anchor"], more].concat()
}

/// A 2D layer with default values.
fn default_layer() -> Layer2d {
    Layer2d::new(Layer2dContent::Panel { size: DVec2::ONE, color: Vec4::W })
}

const ANCHORS: [(&str, [f64; 2]); 9] = [
    ("center", [0.5, 0.5]),
    ("left", [0.0, 0.5]),
    ("right", [1.0, 0.5]),
    ("top", [0.5, 0.0]),
    ("bottom", [0.5, 1.0]),
    ("top_left", [0.0, 0.0]),
    ("top_right", [1.0, 0.0]),
    ("bottom_left", [0.0, 1.0]),
    ("bottom_right", [1.0, 1.0]),
];

/// Reads the options that all 2D layers have, and adds the layer to the stage.
fn add_layer(c: &Call, o: &Options, content: Layer2dContent) -> Reply {
    let mut layer = Layer2d::new(content);
    fields::fill(c, o, &mut layer)?;
    if let Some(name) = o.one_of("anchor", &ANCHORS.map(|(name, _)| name))? {
        let found = ANCHORS.iter().find(|(known, _)| *known == name);
        layer.anchor = found.map_or(layer.anchor, |(_, at)| DVec2::from_array(*at));
    }
    let mut stage_draft = c.stage_draft();
    check_limit(stage_draft.layers_2d.len(), "2D layers", &c.context.limits)?;
    stage_draft.layers_2d.push(layer);
    stage_draft.layer_2d_places.push(c.place.clone());
    Ok(Dynamic::from(Layer2dRef(stage_draft.layers_2d.len() - 1)))
}

fn color_option(o: &Options, default: Vec4) -> Result<Vec4, ApiError> {
    Ok(o.color("color")?.unwrap_or(default))
}

fn text(c: &mut Call) -> Reply {
    let words = c.text(0)?;
    let o = c.options(
        1,
        &option_names(&default_layer(), &["size", "color", "font", "width", "align", "line_height"]),
    )?;
    let font = match o.text("font")? {
        Some(name) => Font::new(&name, c.context.read_file(&name)?)
            .map_err(|e| ApiError::new(format!("text: \"{name}\" {e}")).focus(&name))?,
        None => Font::built_in(),
    };
    fonts::warn_about_missing_characters(c, &font, &words);
    let content = Layer2dContent::Text {
        words,
        font,
        size: o.number_in("size", 1e-4, 10.0)?.unwrap_or(0.08),
        width: o.number_in("width", 1e-3, 10.0)?,
        align: match o.one_of("align", &["left", "center", "right"])? {
            Some("left") => Align::Left,
            Some("right") => Align::Right,
            _ => Align::Center,
        },
        line_height: o.number_in("line_height", 0.1, 10.0)?.unwrap_or(1.25),
        color: color_option(&o, Vec4::ONE)?,
        outline: None,
        panel: None,
    };
    add_layer(c, &o, content)
}

fn picture(c: &mut Call) -> Reply {
    let o = c.options(1, &option_names(&default_layer(), &["height", "width", "fit"]))?;
    let given = c.value(0);
    let image: Arc<Image> = match given.read_lock::<ImageRef>().map(|i| i.decoded()).transpose()? {
        Some(image) => image,
        None => {
            let name = c.text(0).map_err(|_| c.wrong(0, "an Image or the name of a file"))?;
            let bytes = c.context.read_file(&name)?;
            let problem = |p: choreo_importer_kit::Problem| {
                let error = ApiError::new(format!("picture: {}", p.what)).focus(&name);
                match p.hint {
                    Some(hint) => error.hint(hint),
                    None => error,
                }
            };
            let encoded = Encoded::examine(name.clone(), name.clone(), bytes, Formats::All);
            encoded.and_then(|e| e.decode()).map_err(problem)?
        }
    };
    let (height, width) = (o.number_in("height", 1e-4, 10.0)?, o.number_in("width", 1e-4, 10.0)?);
    let fit = match (height, width, o.one_of("fit", &["contain", "cover"])?) {
        (Some(share), None, None) => Fit::Height(share),
        (None, Some(share), None) => Fit::Width(share),
        (None, None, Some("contain")) => Fit::Contain,
        (None, None, Some(_)) => Fit::Cover,
        (None, None, None) => Fit::Height(0.3),
        _ => return Err(ApiError::new("picture: give one of height, width and fit")),
    };
    let hash = image.content_hash();
    add_layer(c, &o, Layer2dContent::Picture { image, hash, fit })
}

fn panel(c: &mut Call) -> Reply {
    let o = c.options(0, &option_names(&default_layer(), &["size", "color"]))?;
    let size = match o.get("size") {
        Some(size) => pair(&size, "panel: size")?,
        None => DVec2::ONE,
    };
    let color = color_option(&o, Vec4::W)?;
    add_layer(c, &o, Layer2dContent::Panel { size, color })
}

fn letterbox(c: &mut Call) -> Reply {
    let ratio = c.number_in(0, 0.1, 10.0)?;
    let o = c.options(1, &["color", "opacity"])?;
    let color = color_option(&o, Vec4::W)?;
    add_layer(c, &o, Layer2dContent::Bars { ratio, color })
}

fn change_layer(c: &Call, change: impl FnOnce(&mut Layer2d)) -> Reply {
    let this: Layer2dRef = c.this()?;
    change(c.stage_draft().layer_2d(this.0)?);
    c.receiver()
}

/// Changes the layer while the stage is built, or notes an edit of the frame.
fn change_or_edit(c: &Call, edit: Layer2dEdit, draft: impl FnOnce(&mut Layer2d)) -> Reply {
    if !c.in_frame {
        return change_layer(c, draft);
    }
    let this: Layer2dRef = c.this()?;
    frame_callback::edit_frame(|e| e.layers_2d.push((this.0, edit)));
    c.receiver()
}

fn at(c: &mut Call) -> Reply {
    let at = match c.len() {
        1 => pair(&c.value(0), "at")?,
        _ => DVec2::new(c.number_in(0, -1e6, 1e6)?, c.number_in(1, -1e6, 1e6)?),
    };
    change_or_edit(c, Layer2dEdit::At(at), |layer| layer.at = at)
}

fn opacity(c: &mut Call) -> Reply {
    let opacity = c.number_in(0, 0.0, 1.0)?;
    change_or_edit(c, Layer2dEdit::Opacity(opacity), |layer| layer.opacity = opacity)
}

fn words(c: &mut Call) -> Reply {
    let text = c.text(0)?;
    let this: Layer2dRef = c.this()?;
    if c.in_frame {
        frame_callback::edit_frame(|e| e.layers_2d.push((this.0, Layer2dEdit::Words(text))));
        return c.receiver();
    }
    let font = match &mut c.stage_draft().layer_2d(this.0)?.content {
        Layer2dContent::Text { words, font, .. } => {
            words.clone_from(&text);
            font.clone()
        }
        _ => return Err(ApiError::new("words: only a text has words")),
    };
    fonts::warn_about_missing_characters(c, &font, &text);
    c.receiver()
}

fn outline(c: &mut Call) -> Reply {
    let o = c.options(0, &["color", "width"])?;
    let outline = TextOutline {
        color: color_option(&o, Vec4::W)?,
        width: o.number_in("width", 0.0, 1.0)?.unwrap_or(0.08),
    };
    change_text_layer(c, |content| {
        if let Layer2dContent::Text { outline: of_text, .. } = content {
            *of_text = Some(outline);
        }
    })
}

fn text_panel(c: &mut Call) -> Reply {
    let o = c.options(0, &["color", "padding", "radius"])?;
    let padding = match o.get("padding") {
        None => DVec2::new(0.4, 0.15),
        Some(both) if both.is_array() => pair(&both, "panel: padding")?,
        Some(_) => DVec2::splat(o.number_in("padding", 0.0, 10.0)?.unwrap_or_default()),
    };
    let panel = TextPanel {
        color: color_option(&o, Vec4::W * 0.6)?,
        padding,
        radius: o.number_in("radius", 0.0, 10.0)?.unwrap_or(0.2),
    };
    change_text_layer(c, |content| {
        if let Layer2dContent::Text { panel: of_text, .. } = content {
            *of_text = Some(panel);
        }
    })
}

/// Changes the content of a text layer. Error: the layer is no text.
fn change_text_layer(c: &Call, change_text: impl FnOnce(&mut Layer2dContent)) -> Reply {
    let this: Layer2dRef = c.this()?;
    if !matches!(c.stage_draft().layer_2d(this.0)?.content, Layer2dContent::Text { .. }) {
        return Err(ApiError::new(format!("{}: only a text has this", c.def.name)));
    }
    change_layer(c, |layer| change_text(&mut layer.content))
}

/// Runs the method with the name of a field.
fn field(c: &mut Call) -> Reply {
    let (field, value) = fields::field_and_value::<Layer2d>(c)?;
    change_layer(c, |layer| (field.set)(layer, value))
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    let this: Layer2dRef = c.this()?;
    let start = c.stage_draft().layer_2d(this.0)?.start;
    if t < start {
        return Err(super::actor::before_start_error("until", t, start));
    }
    change_layer(c, |layer| layer.end = Some(t))
}

fn key(c: &mut Call) -> Reply {
    let this: Layer2dRef = c.this()?;
    let layer = c.stage_draft().layer_2d(this.0)?.clone();
    let channels = keys::channels_of(c, &layer)?;
    keys::replace_channels(&mut c.stage_draft().layer_2d(this.0)?.channels, channels);
    c.receiver()
}
