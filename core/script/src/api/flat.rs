//! `text`, `picture`, `panel`, `letterbox`: flat layers over and under the scene.

use super::keys;
use crate::build::room;
use crate::call::{ApiError, Call, Def, Gives, Options, Reply, numbers, wrong};
use crate::hook;
use crate::load::from_load;
use crate::value::{FlatRef, ImageRef, Kind};
use choreo_import::pictures::{Encoded, Formats};
use choreo_motion::Time;
use choreo_stage::{Align, Fit, Flat, FlatContent, FlatEdit, Font, Image};
use glam::{DVec2, Vec4};
use rhai::Dynamic;
use std::sync::Arc;

const THIS: Gives = Gives::Itself;

pub const DEFS: &[Def] = &[
    Def::new(
        Kind::None,
        "text",
        "words, options?",
        Gives::A(Kind::Flat),
        "Words over the scene: at ([x, y], shares of the picture from its top left, [0.5, 0.5]), offset ([x, y] in pixels), anchor (which point of its box stands there: \"center\", \"left\", \"right\", \"top\", \"bottom\", \"top_left\", …), size (share of the picture's height, 0.08), color, opacity, width (share of the picture's width at which lines break), align (\"left\", \"center\", \"right\"), line_height (1.25), font (a .ttf or .otf file; else one that the program has).",
        text,
    ),
    Def::new(
        Kind::None,
        "picture",
        "image, options?",
        Gives::A(Kind::Flat),
        "A picture over the scene: an Image, or a PNG, JPEG, WebP, BMP or TGA file; options: at, offset, anchor, opacity, and height or width (shares of the picture's), or fit (\"contain\", \"cover\").",
        picture,
    ),
    Def::new(
        Kind::None,
        "panel",
        "options?",
        Gives::A(Kind::Flat),
        "A rectangle of one color over the scene: at, offset, anchor, opacity, size ([width, height] in shares of the picture, all of it), color (black).",
        panel,
    ),
    Def::new(
        Kind::None,
        "letterbox",
        "ratio, options?",
        Gives::A(Kind::Flat),
        "Bars at the edges that leave a picture ratio times as wide as high (2.39); keyed in scale they slide in. Options: color, opacity.",
        letterbox,
    ),
    Def::new(
        Kind::Flat,
        "at",
        "x, y | point",
        THIS,
        "Where its anchor stands, in shares of the picture.",
        at,
    )
    .in_frames(),
    Def::new(Kind::Flat, "opacity", "value", THIS, "0 is not seen, 1 hides what is below.", opacity)
        .in_frames(),
    Def::new(Kind::Flat, "words", "text", THIS, "What a text says.", words).in_frames(),
    Def::new(Kind::Flat, "scale", "factor", THIS, "Made larger or smaller, about its anchor.", scale),
    Def::new(Kind::Flat, "from", "time", THIS, "When it is first seen.", from),
    Def::new(Kind::Flat, "until", "time", THIS, "When it is gone.", until),
    Def::new(Kind::Flat, "fade", "seconds", THIS, "How long it takes to come in and to go.", fade),
    Def::new(Kind::Flat, "under", "", THIS, "Behind the scene, over its background.", under),
    Def::new(
        Kind::Flat,
        "key",
        "property, keys, how?",
        THIS,
        "Keys [[time, value], …] of \"position\" ([x, y] as at), \"scale\" or \"opacity\", as for actors.",
        key,
    ),
];

const PLACE: [&str; 4] = ["at", "offset", "anchor", "opacity"];

fn known<'a>(more: &[&'a str]) -> Vec<&'a str> {
    PLACE.iter().copied().chain(more.iter().copied()).collect()
}

fn pair(v: &Dynamic, label: &str) -> Result<DVec2, ApiError> {
    let two = numbers(v).filter(|n| n.len() == 2 && n.iter().all(|n| n.abs() <= 1e6));
    two.map(|n| DVec2::new(n[0], n[1])).ok_or_else(|| wrong(v, label, "[x, y]"))
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

/// With what all flats have.
fn add(c: &Call, o: &Options, content: FlatContent) -> Reply {
    let mut flat = Flat::new(content);
    if let Some(at) = o.get("at") {
        flat.at = pair(&at, &o.label("at"))?;
    }
    if let Some(offset) = o.get("offset") {
        flat.offset = pair(&offset, &o.label("offset"))?;
    }
    if let Some(name) = o.one_of("anchor", &ANCHORS.map(|(name, _)| name))? {
        let found = ANCHORS.iter().find(|(known, _)| *known == name);
        flat.anchor = found.map_or(flat.anchor, |(_, at)| DVec2::from_array(*at));
    }
    flat.opacity = o.number_in("opacity", 0.0, 1.0)?.unwrap_or(1.0);
    let mut build = c.build();
    room(build.flats.len(), "flats", &c.shared.limits)?;
    build.flats.push(flat);
    Ok(Dynamic::from(FlatRef(build.flats.len() - 1)))
}

fn color(o: &Options, usual: Vec4) -> Result<Vec4, ApiError> {
    Ok(o.color("color")?.unwrap_or(usual))
}

fn text(c: &mut Call) -> Reply {
    let words = c.text(0)?;
    let o = c.options(1, &known(&["size", "color", "font", "width", "align", "line_height"]))?;
    let font = match o.text("font")? {
        Some(name) => Font::new(&name, read_file(c, &name)?)
            .map_err(|e| ApiError::new(format!("text: \"{name}\" {e}")).focus(&name))?,
        None => Font::built_in(),
    };
    if let Some(missing) = font.missing(&words).first() {
        let error = ApiError::new(format!("text: the font \"{}\" has no '{missing}'", font.name));
        return Err(error.hint("give a font that has it: font: \"file.ttf\""));
    }
    let content = FlatContent::Text {
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
        color: color(&o, Vec4::ONE)?,
    };
    add(c, &o, content)
}

/// A file of the script's folder or a search path, noted for hot reload.
pub fn read_file(c: &Call, name: &str) -> Result<Vec<u8>, ApiError> {
    let loader = &c.shared.loader;
    let start = c.shared.test().scene.as_ref().map(|scene| scene.folder.clone());
    let found = loader.find_in(loader.folders(), start.as_deref(), name);
    let found = found.map_err(|e| from_load(e).focus(name))?;
    let bytes = loader.folders().read(&found, name).map_err(|e| from_load(e).focus(name))?;
    loader.note_used(&found.path, &bytes);
    Ok(bytes)
}

fn picture(c: &mut Call) -> Reply {
    let o = c.options(1, &known(&["height", "width", "fit"]))?;
    let given = c.value(0);
    let image: Arc<Image> = match given.read_lock::<ImageRef>().map(|i| i.image.clone()) {
        Some(image) => image,
        None => {
            let name = c.text(0).map_err(|_| c.wrong(0, "an Image or the name of a file"))?;
            let bytes = read_file(c, &name)?;
            let problem = |p: choreo_import::Problem| {
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
    add(c, &o, FlatContent::Picture { image, hash, fit })
}

fn panel(c: &mut Call) -> Reply {
    let o = c.options(0, &known(&["size", "color"]))?;
    let size = match o.get("size") {
        Some(size) => pair(&size, "panel: size")?,
        None => DVec2::ONE,
    };
    let color = color(&o, Vec4::W)?;
    add(c, &o, FlatContent::Panel { size, color })
}

fn letterbox(c: &mut Call) -> Reply {
    let ratio = c.number_in(0, 0.1, 10.0)?;
    let o = c.options(1, &["color", "opacity"])?;
    let color = color(&o, Vec4::W)?;
    add(c, &o, FlatContent::Bars { ratio, color })
}

fn change(c: &Call, change: impl FnOnce(&mut Flat)) -> Reply {
    let this: FlatRef = c.this()?;
    change(c.build().flat(this.0)?);
    c.itself()
}

fn at(c: &mut Call) -> Reply {
    let at = match c.len() {
        1 => pair(&c.value(0), "at")?,
        _ => DVec2::new(c.number_in(0, -1e6, 1e6)?, c.number_in(1, -1e6, 1e6)?),
    };
    if c.in_frame {
        let this: FlatRef = c.this()?;
        hook::edit(|e| e.flats.push(FlatEdit::At { flat: this.0, at }));
        return c.itself();
    }
    change(c, |flat| flat.at = at)
}

fn opacity(c: &mut Call) -> Reply {
    let opacity = c.number_in(0, 0.0, 1.0)?;
    if c.in_frame {
        let this: FlatRef = c.this()?;
        hook::edit(|e| e.flats.push(FlatEdit::Opacity { flat: this.0, opacity }));
        return c.itself();
    }
    change(c, |flat| flat.opacity = opacity)
}

fn words(c: &mut Call) -> Reply {
    let said = c.text(0)?;
    let this: FlatRef = c.this()?;
    if c.in_frame {
        hook::edit(|e| e.flats.push(FlatEdit::Words { flat: this.0, words: said }));
        return c.itself();
    }
    match &mut c.build().flat(this.0)?.content {
        FlatContent::Text { words, .. } => *words = said,
        _ => return Err(ApiError::new("words: only a text says anything")),
    }
    c.itself()
}

fn scale(c: &mut Call) -> Reply {
    let scale = c.number_in(0, 0.0, 1000.0)?;
    change(c, |flat| flat.scale = scale)
}

fn from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |flat| flat.start = t)
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    let this: FlatRef = c.this()?;
    let start = c.build().flat(this.0)?.start;
    if t < start {
        return Err(super::actor::before_start("until", t, start));
    }
    change(c, |flat| flat.end = Some(t))
}

fn fade(c: &mut Call) -> Reply {
    let t: Time = c.duration(0)?;
    change(c, |flat| flat.fade = t)
}

fn under(c: &mut Call) -> Reply {
    change(c, |flat| flat.under = true)
}

fn key(c: &mut Call) -> Reply {
    let this: FlatRef = c.this()?;
    let channels = keys::read(c, keys::Owner::Flat)?;
    keys::replace(&mut c.build().flat(this.0)?.channels, channels);
    c.itself()
}
