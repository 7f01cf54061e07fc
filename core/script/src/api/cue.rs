//! Cues: clips placed on an actor's timeline.

use crate::build::{Bound, Build, CueDraft, room};
use crate::call::{ApiError, Call, Def, Gives, Reply, describe};
use crate::diagnostic::Severity;
use crate::suggest::list;
use crate::value::*;
use choreo_motion::{Clip, Time, bind_clip};
use choreo_stage::{Asset, Ease, Repeat};
use rhai::Dynamic;
use std::sync::Arc;

const THIS: Gives = Gives::Itself;
const OPTIONS: &[&str] =
    &["from", "until", "fade", "fade_out", "speed", "ease", "trim", "repeat", "reverse", "weight"];

pub const DEFS: &[Def] = &[
    Def::new(Kind::Cue, "from", "time", THIS, "When the clip starts.", from),
    Def::new(
        Kind::Cue,
        "until",
        "time",
        THIS,
        "When it is over: the next takes its place, a layer is gone by then.",
        until,
    ),
    Def::new(
        Kind::Cue,
        "then",
        "clip, options?",
        Gives::A(Kind::Cue),
        "What follows, at .until, or as the clip ends; options: fade, fade_out, speed, ease (\"linear\", \"smooth\"), trim, repeat (\"once\", \"loop\", \"ping_pong\"), reverse, weight, from, until.",
        then,
    ),
    Def::new(
        Kind::Cue,
        "fade",
        "seconds",
        THIS,
        "How long it takes to come in, and, on a layer, to go.",
        fade,
    ),
    Def::new(Kind::Cue, "fade_out", "seconds", THIS, "How long a layer takes to go.", fade_out),
    Def::new(Kind::Cue, "ease", "how", THIS, "How it fades: \"linear\" or \"smooth\".", ease),
    Def::new(Kind::Cue, "speed", "factor", THIS, "Clip seconds a second; negative plays backwards.", speed),
    Def::new(Kind::Cue, "reverse", "", THIS, "Plays backwards.", reverse),
    Def::new(
        Kind::Cue,
        "trim",
        "start, end",
        THIS,
        "Plays only this part of the clip, in seconds of the clip.",
        trim,
    ),
    Def::new(
        Kind::Cue,
        "once",
        "",
        THIS,
        "Plays once and holds the last pose; a layer goes away. What cues do that another follows without .until, and layers.",
        once,
    ),
    Def::new(Kind::Cue, "loop", "", THIS, "Plays again and again. What other cues do.", looped),
    Def::new(Kind::Cue, "ping_pong", "", THIS, "Plays there and back, again and again.", ping_pong),
    Def::new(Kind::Cue, "weight", "weight", THIS, "How much it counts: 0 not at all, 1 fully.", weight),
    Def::new(
        Kind::Cue,
        "on",
        "joints",
        THIS,
        "Makes this cue and those that follow a layer over some joints: \"Spine..\" a joint and all below it, \"Head\" one joint, \"*Arm*\" a pattern, or an array of these.",
        on,
    ),
    Def::new(
        Kind::Cue,
        "length",
        "",
        Gives::Value("float"),
        "Seconds that the clip takes once, at its speed and trim.",
        length,
    ),
    Def::new(
        Kind::Cue,
        "start",
        "",
        Gives::Value("float"),
        "When it starts, in seconds, as far as said.",
        start,
    ),
    Def::new(
        Kind::Cue,
        "end",
        "",
        Gives::Value("float"),
        "When it is over, in seconds; an error for a cue that loops without .until.",
        end,
    ),
];

/// The clip of an argument, bound to the joints of `asset`.
pub fn bound_clip(c: &Call, i: usize, asset: &Arc<Asset>) -> Result<Arc<Clip>, ApiError> {
    let Some(given) = c.value(i).try_cast::<ClipRef>() else {
        return Err(c.wrong(i, "a Clip, as in asset.clip(\"name\")"));
    };
    c.build().used(&given.asset);
    if Arc::ptr_eq(&given.asset, asset) {
        return Ok(given.clip);
    }
    let key = (Arc::as_ptr(&given.clip) as usize, Arc::as_ptr(asset) as usize);
    if let Some(bound) = c.build().bound.get(&key) {
        return Ok(bound.clip.clone());
    }
    let (bound, missing) = bind_clip(&given.clip, &given.asset.skeleton, &asset.skeleton);
    let what = || format!("clip \"{}\" of \"{}\" on \"{}\"", given.clip.name, given.asset.name, asset.name);
    if bound.curves().is_empty() && !given.clip.curves().is_empty() {
        let names = asset.skeleton.names().iter().map(String::as_str);
        return Err(ApiError::new(format!("{}: no joint has the same name", what()))
            .focus(given.clip.name.clone())
            .hint(format!(
                "animated: {}; on the actor: {}",
                list(missing.iter().map(String::as_str), 12),
                list(names, 12)
            )));
    }
    if !missing.is_empty() {
        let names = list(missing.iter().map(String::as_str), 12);
        let text = format!(
            "{}: {} animated joints have no partner of the same name: {names}",
            what(),
            missing.len()
        );
        c.shared.note(Severity::Warning, &c.place, &ApiError::new(text));
    }
    let bound = Arc::new(bound);
    c.build().bound.insert(key, Bound { clip: bound.clone(), _from: given.clip, _onto: asset.clone() });
    Ok(bound)
}

pub fn read_options(c: &Call, i: usize, cue: &mut CueDraft) -> Result<(), ApiError> {
    let o = c.options(i, OPTIONS)?;
    let time = |name: &str| o.get(name).map(|v| crate::call::time(&v, &o.label(name))).transpose();
    cue.start = time("from")?.or(cue.start);
    cue.until = time("until")?.or(cue.until);
    cue.fade_in = o.duration("fade")?.unwrap_or(cue.fade_in);
    cue.fade_out = o.duration("fade_out")?.or(o.duration("fade")?).or(cue.fade_out);
    if let Some(speed) = o.number("speed")? {
        set_speed(cue, speed, &o.label("speed"))?;
    }
    if let Some(ease) = o.one_of("ease", &["linear", "smooth"])? {
        cue.ease = ease_of(ease);
    }
    if let Some(trim) = o.get("trim") {
        let ends = crate::call::numbers(&trim).filter(|n| n.len() == 2);
        let ends = ends.ok_or_else(|| crate::call::wrong(&trim, &o.label("trim"), "[start, end]"))?;
        set_trim(cue, Time::from_secs(ends[0]), Time::from_secs(ends[1]))?;
    }
    match o.one_of("repeat", &["once", "loop", "ping_pong"])? {
        Some("once") => cue.repeat = Some(Repeat::Once),
        Some("loop") => cue.repeat = Some(Repeat::Loop),
        Some(_) => cue.repeat = Some(Repeat::PingPong),
        None => {}
    }
    if o.flag("reverse")? == Some(true) {
        cue.reverse = !cue.reverse;
    }
    if let Some(weight) = o.number_in("weight", 0.0, 1.0)? {
        cue.weight = weight as f32;
    }
    Ok(())
}

fn ease_of(name: &str) -> Ease {
    if name == "smooth" { Ease::Smooth } else { Ease::Linear }
}

fn set_speed(cue: &mut CueDraft, speed: f64, label: &str) -> Result<(), ApiError> {
    if !(0.001..=1000.0).contains(&speed.abs()) {
        return Err(ApiError::new(format!(
            "{label} must be from 0.001 to 1000 (or negative, backwards), got {speed:?}"
        )));
    }
    cue.speed = speed.abs();
    cue.reverse = speed < 0.0;
    Ok(())
}

fn set_trim(cue: &mut CueDraft, start: Time, end: Time) -> Result<(), ApiError> {
    let duration = cue.clip.duration;
    if start < Time::ZERO || end > duration || start >= end {
        return Err(ApiError::new(format!(
            "trim: from {} s to {} s is no part of clip \"{}\", which runs from 0 s to {} s",
            start.as_secs(),
            end.as_secs(),
            cue.clip.name,
            duration.as_secs()
        )));
    }
    cue.trim = Some((start, end));
    Ok(())
}

fn change(c: &Call, change: impl FnOnce(&mut CueDraft) -> Result<(), ApiError>) -> Reply {
    let this: CueRef = c.this()?;
    change(c.build().cue(this.0)?)?;
    c.itself()
}

fn from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |cue| {
        cue.start = Some(t);
        Ok(())
    })
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change(c, |cue| {
        cue.until = Some(t);
        Ok(())
    })
}

fn then(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let (chain, actor) = {
        let mut build = c.build();
        let chain = build.cue(this.0)?.chain;
        (chain, build.chains[chain].actor)
    };
    let asset = c.build().actor(actor)?.actor.asset.clone();
    let clip = bound_clip(c, 0, &asset)?;
    room(c.build().cues.len(), "cues", &c.shared.limits)?;
    let mut cue = CueDraft {
        chain,
        clip,
        at: c.place.clone(),
        after: Some(this.0),
        start: None,
        until: None,
        fade_in: Time::ZERO,
        fade_out: None,
        ease: Ease::Linear,
        speed: 1.0,
        reverse: false,
        trim: None,
        repeat: None,
        weight: 1.0,
        followed: false,
    };
    read_options(c, 1, &mut cue)?;
    let mut build = c.build();
    let before = build.cue(this.0)?;
    if before.followed {
        return Err(ApiError::new("then: something follows this cue already")
            .hint("chain the next .then to that one"));
    }
    let endless = matches!(before.repeat, Some(Repeat::Loop | Repeat::PingPong)) && before.until.is_none();
    if endless && cue.start.is_none() {
        return Err(ApiError::new("then: the cue before repeats without end")
            .hint("say when it is over, with .until(time)"));
    }
    before.followed = true;
    build.cues.push(cue);
    Ok(Dynamic::from(CueRef(build.cues.len() - 1)))
}

fn fade(c: &mut Call) -> Reply {
    let t = c.duration(0)?;
    change(c, |cue| {
        cue.fade_in = t;
        cue.fade_out = Some(t);
        Ok(())
    })
}

fn fade_out(c: &mut Call) -> Reply {
    let t = c.duration(0)?;
    change(c, |cue| {
        cue.fade_out = Some(t);
        Ok(())
    })
}

fn ease(c: &mut Call) -> Reply {
    let how = crate::call::one_of(&c.value(0), &c.label(0), &["linear", "smooth"])?;
    change(c, |cue| {
        cue.ease = ease_of(how);
        Ok(())
    })
}

fn speed(c: &mut Call) -> Reply {
    let (factor, label) = (c.number(0)?, c.label(0));
    change(c, |cue| set_speed(cue, factor, &label))
}

fn reverse(c: &mut Call) -> Reply {
    change(c, |cue| {
        cue.reverse = !cue.reverse;
        Ok(())
    })
}

fn trim(c: &mut Call) -> Reply {
    let (start, end) = (c.duration(0)?, c.duration(1)?);
    change(c, |cue| set_trim(cue, start, end))
}

fn repeat(c: &Call, repeat: Repeat) -> Reply {
    change(c, |cue| {
        cue.repeat = Some(repeat);
        Ok(())
    })
}

fn once(c: &mut Call) -> Reply {
    repeat(c, Repeat::Once)
}

fn looped(c: &mut Call) -> Reply {
    repeat(c, Repeat::Loop)
}

fn ping_pong(c: &mut Call) -> Reply {
    repeat(c, Repeat::PingPong)
}

fn weight(c: &mut Call) -> Reply {
    let w = c.number_in(0, 0.0, 1.0)? as f32;
    change(c, |cue| {
        cue.weight = w;
        Ok(())
    })
}

fn on(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let value = c.value(0);
    let label = c.label(0);
    let patterns: Vec<String> = match value.read_lock::<rhai::Array>() {
        Some(array) => array.iter().map(|v| crate::call::text(v, &label)).collect::<Result<_, _>>()?,
        None if value.is_string() => vec![c.text(0)?],
        None => {
            return Err(ApiError::new(format!(
                "{label} must be text like \"Spine..\", or an array of such, got {}",
                describe(&value)
            ))
            .hint("post effects know .on(actor); a clip is played by the actor that play was called on"));
        }
    };
    let mut build = c.build();
    let chain = build.cue(this.0)?.chain;
    let actor = build.chains[chain].actor;
    let asset = build.actor(actor)?.actor.asset.clone();
    let mask = mask(&asset, &patterns)?;
    build.chains[chain].mask = Some(mask);
    drop(build);
    c.itself()
}

/// Weight 1 on the joints that any pattern matches.
fn mask(asset: &Asset, patterns: &[String]) -> Result<Vec<f32>, ApiError> {
    let skeleton = &asset.skeleton;
    let mut weights = vec![0.0; skeleton.len()];
    for pattern in patterns {
        let (name, below) = match pattern.strip_suffix("..") {
            Some(name) => (name, true),
            None => (pattern.as_str(), false),
        };
        let mut hit = vec![false; skeleton.len()];
        if name.contains('*') {
            for (joint, given) in skeleton.names().iter().enumerate() {
                hit[joint] = matches(name.as_bytes(), given.as_bytes());
            }
            if !hit.contains(&true) {
                return Err(ApiError::new(format!(
                    "no joint of skeleton \"{}\" matches \"{pattern}\"",
                    asset.name
                ))
                .focus(pattern.clone())
                .hint(format!("joints: {}", list(skeleton.names().iter().map(String::as_str), 24))));
            }
        } else {
            let joint = super::actor::find_joint(asset, name).map_err(|e| e.focus(pattern.clone()))?;
            hit[joint as usize] = true;
        }
        if below {
            for joint in 0..skeleton.len() {
                hit[joint] |= skeleton.parents()[joint].is_some_and(|p| hit[p as usize]);
            }
        }
        for (weight, hit) in weights.iter_mut().zip(hit) {
            if hit {
                *weight = 1.0;
            }
        }
    }
    Ok(weights)
}

/// Whether `*` (any letters) and plain letters, ASCII case ignored, cover the whole text. Greedy with one step back,
/// so the time is at most the product of the lengths.
fn matches(pattern: &[u8], text: &[u8]) -> bool {
    let (mut p, mut t, mut star) = (0, 0, None);
    while t < text.len() {
        if p < pattern.len() && pattern[p] == b'*' {
            star = Some((p, t));
            p += 1;
        } else if p < pattern.len() && pattern[p].eq_ignore_ascii_case(&text[t]) {
            p += 1;
            t += 1;
        } else if let Some((at, from)) = star {
            star = Some((at, from + 1));
            p = at + 1;
            t = from + 1;
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|c| *c == b'*')
}

impl CueDraft {
    pub fn part(&self) -> (Time, Time) {
        self.trim.unwrap_or((Time::ZERO, self.clip.duration))
    }

    /// How long the part takes, once, at its speed.
    pub fn length(&self) -> Time {
        let (start, end) = self.part();
        (end - start).scaled(1.0 / self.speed)
    }

    /// What the script said, else: once for layers and for cues that another follows, else again and again.
    pub fn repeats(&self, layer: bool) -> Repeat {
        let once = layer || (self.followed && self.until.is_none());
        self.repeat.unwrap_or(if once { Repeat::Once } else { Repeat::Loop })
    }
}

/// Start and end of every cue; no end where one repeats without.
pub fn all_times(build: &Build) -> Vec<(Time, Option<Time>)> {
    let mut times: Vec<(Time, Option<Time>)> = Vec::with_capacity(build.cues.len());
    // A cue comes later in the list than the one it follows.
    for cue in &build.cues {
        let follows = cue.after.map(|before| (&build.cues[before], times[before]));
        times.push(cue_times(build, cue, follows));
    }
    times
}

/// Start and end of one cue, given the one before it in its chain and that one's times.
fn cue_times(
    build: &Build,
    cue: &CueDraft,
    follows: Option<(&CueDraft, (Time, Option<Time>))>,
) -> (Time, Option<Time>) {
    let start = match follows {
        None => Time::ZERO,
        Some((_, (start, None))) => start,
        Some((before, (_, Some(end)))) => {
            // Where the one before is not cut off but ends by itself, this one comes in while it still moves.
            let natural = before.until.is_none();
            end - if natural { cue.fade_in.min(before.length()) } else { Time::ZERO }
        }
    };
    let start = cue.start.unwrap_or(start);
    let layer = build.chains[cue.chain].mask.is_some();
    let natural = (cue.repeats(layer) == Repeat::Once).then(|| start + cue.length());
    (start, cue.until.or(natural))
}

/// Start and end of one cue.
fn times(build: &Build, id: usize) -> (Time, Option<Time>) {
    // To the front of the chain and back again, without recursion.
    let mut walk = vec![id];
    while let Some(before) = walk.last().and_then(|id| build.cues[*id].after) {
        walk.push(before);
    }
    let mut last = None;
    for id in walk.into_iter().rev() {
        let cue = &build.cues[id];
        last = Some((cue, cue_times(build, cue, last)));
    }
    last.map_or((Time::ZERO, None), |(_, times)| times)
}

fn length(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let length = c.build().cue(this.0)?.length();
    Ok(Dynamic::from_float(length.as_secs()))
}

fn start(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    c.build().cue(this.0)?;
    let (start, _) = times(&c.build(), this.0);
    Ok(Dynamic::from_float(start.as_secs()))
}

fn end(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    c.build().cue(this.0)?;
    let (_, end) = times(&c.build(), this.0);
    let end = end.ok_or_else(|| {
        ApiError::new("end: this cue repeats without end").hint("say when it is over, with .until(time)")
    })?;
    Ok(Dynamic::from_float(end.as_secs()))
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn patterns_cover_the_whole_name() {
        assert!(matches(b"*Arm*", b"LeftForeArm"));
        assert!(matches(b"left*", b"LeftForeArm"));
        assert!(!matches(b"*Arm", b"LeftArmTwist"));
        assert!(matches(b"*", b""));
        assert!(!matches(b"a*b*c", b"abbd"));
    }
}
