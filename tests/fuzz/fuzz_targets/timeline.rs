//! Timelines built at random: seeking to any time gives the bits that playing up to it gives, in any order, and anything
//! that `Stage::check` lets through can be evaluated at any time.
#![no_main]

use choreo_asset::*;
use choreo_fuzz::assert_finite;
use choreo_motion::spring::{RigBone, SpringBone};
use choreo_motion::{Interpolation, Time};
use choreo_plugin::{ImportScope, Importer, Source};
use choreo_stage::*;
use glam::{DQuat, DVec3, Vec3};
use libfuzzer_sys::arbitrary::{Result, Unstructured};
use libfuzzer_sys::fuzz_target;
use std::sync::{Arc, LazyLock};

static PERSON: LazyLock<Arc<Asset>> = LazyLock::new(|| {
    let source = Source { name: "choreo:mannequin".into(), bytes: Arc::default() };
    let asset = import_mannequin::Mannequin.import(
        &source,
        &choreo_fuzz::NoFiles,
        ImportScope::ALL,
        &Default::default(),
    );
    Arc::new(asset.expect("the built-in figure can be made"))
});

fn time(u: &mut Unstructured) -> Result<Time> {
    Ok(match u.int_in_range(0..=9)? {
        0 => Time::from_secs(f64::from(u.arbitrary::<i32>()?) / 1000.0),
        1 => Time(u.int_in_range(-1_000..=1_000)?),
        _ => Time::from_secs(f64::from(u.int_in_range(-500..=4_000i32)?) / 500.0),
    })
}

fn span(u: &mut Unstructured) -> Result<Time> {
    Ok(Time::from_secs(f64::from(u.int_in_range(0..=2_000u32)?) / 1000.0))
}

/// Two times, the earlier one first.
fn interval(u: &mut Unstructured) -> Result<(Time, Time)> {
    let from = span(u)?;
    Ok((from, from + span(u)?))
}

fn number(u: &mut Unstructured) -> Result<f64> {
    Ok(match u.int_in_range(0..=15)? {
        // Numbers that the callbacks of a script can reach; `check` handles NaN and infinity.
        0 => match u.arbitrary::<f64>()? {
            v if v.is_finite() => v % 1e20,
            v => v,
        },
        1 => [0.0, -0.0, 1e15, -1e15, 1e-12, 1e6][u.choose_index(6)?],
        _ => f64::from(u.arbitrary::<i16>()?) / 500.0,
    })
}

fn point(u: &mut Unstructured) -> Result<DVec3> {
    Ok(DVec3::new(number(u)?, number(u)?, number(u)?))
}

fn target(u: &mut Unstructured, actors: usize) -> Result<Target> {
    let actor = u.int_in_range(0..=actors)?;
    Ok(match u.int_in_range(0..=2)? {
        0 => Target::Point(point(u)?),
        1 => Target::Actor(actor),
        _ => Target::Joint { actor, joint: u.int_in_range(0..=60)? },
    })
}

fn cue(u: &mut Unstructured) -> Result<Cue> {
    let clip = PERSON.clips[u.choose_index(PERSON.clips.len())?].clone();
    let ends = [span(u)?, span(u)?];
    let trim = if u.arbitrary()? {
        (Time::ZERO, clip.duration)
    } else {
        (ends[0].min(ends[1]), ends[0].max(ends[1]))
    };
    let freeze = time(u)?;
    let inertialization = if u.ratio(1, 4)? { span(u)? } else { Time::ZERO };
    let plain = Cue::new(clip.clone());
    Ok(Cue {
        clip,
        start: time(u)?,
        end: if u.arbitrary()? { Some(time(u)?) } else { None },
        fade_in: span(u)?,
        fade_out: span(u)?,
        ease: if u.arbitrary()? { Ease::Linear } else { Ease::Smooth },
        speed: number(u)?,
        trim,
        repeat: [Repeat::Once, Repeat::Loop, Repeat::PingPong][u.choose_index(3)?],
        weight: f32::from(u.arbitrary::<u8>()?) / 255.0,
        freezes: if u.ratio(1, 4)? { vec![(freeze, freeze + span(u)?)] } else { Vec::new() },
        inertialization,
        ..plain
    })
}

fn channel(u: &mut Unstructured) -> Result<Channel> {
    let property =
        [Property::Translation, Property::Rotation, Property::Scale, Property::Visible, Property::Tint];
    let property = property[u.choose_index(5)?];
    let interpolation =
        [Interpolation::Step, Interpolation::Linear, Interpolation::CubicSpline][u.choose_index(3)?];
    let mut times = (0..u.int_in_range(1..=4)?).map(|_| time(u)).collect::<Result<Vec<_>>>()?;
    times.sort_unstable();
    times.dedup();
    let width = property.width() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let values = (0..times.len() * width).map(|_| number(u)).collect::<Result<Vec<_>>>()?;
    Ok(Channel { property, interpolation, times, values })
}

/// A joint of the figure, now and then one that it has not.
fn joint(u: &mut Unstructured) -> Result<u32> {
    u.int_in_range(0..=60)
}

/// Parents first, so that `check` lets it through.
fn chain(u: &mut Unstructured) -> Result<Vec<u32>> {
    let mut joints = vec![joint(u)?];
    for _ in 0..u.int_in_range(1..=5)? {
        let parent = PERSON.skeleton.parents().get(joints[0] as usize).copied().flatten();
        match parent {
            Some(parent) => joints.insert(0, parent),
            None => break,
        }
    }
    Ok(joints)
}

fn constraint(u: &mut Unstructured, count: usize) -> Result<Constraint> {
    let kind = match u.int_in_range(0..=2)? {
        0 => ConstraintKind::Reach(ReachConstraint {
            joints: chain(u)?,
            target: target(u, count)?,
            offset: if u.arbitrary()? { Some(point(u)?) } else { None },
            pole: if u.arbitrary()? { Some(target(u, count)?) } else { None },
            hint: [DVec3::NEG_Z, DVec3::ZERO, point(u)?][u.choose_index(3)?],
            soft: [0.0, 0.05, number(u)?][u.choose_index(3)?],
            keep_rotation: u.arbitrary()?,
        }),
        1 => {
            let joints = chain(u)?;
            let shares = joints.iter().map(|_| Ok(number(u)?.abs())).collect::<Result<_>>()?;
            ConstraintKind::Aim(AimConstraint {
                joints,
                shares,
                target: target(u, count)?,
                limit: number(u)?.abs(),
            })
        }
        _ => {
            let mut legs = Vec::new();
            for _ in 0..u.int_in_range(1..=2)? {
                let joints = chain(u)?;
                if let [.., hip, knee, foot, toe] = joints[..] {
                    legs.push(Leg { hip, knee, foot, toe: Some(toe).filter(|_| toe % 2 == 0) });
                }
            }
            let hips = if u.arbitrary()? { Some(joint(u)?) } else { None };
            let ground = if u.ratio(1, 4)? { vec![u.int_in_range(0..=count)?] } else { Vec::new() };
            let locked_spans = (0..u.int_in_range(0..=2)?).map(|_| interval(u)).collect::<Result<_>>()?;
            // Sorted, one after the other.
            let mut standing_fades: Vec<StandingFade> = Vec::new();
            for _ in 0..u.int_in_range(0..=2)? {
                let begin = standing_fades.last().map_or(Time::ZERO, |fade| fade.to);
                let from = begin + span(u)?;
                standing_fades.push(StandingFade {
                    from,
                    to: from + span(u)?,
                    ends_standing: u.arbitrary()?,
                });
            }
            ConstraintKind::FootLock(FootLock { legs, hips, ground, locked_spans, standing_fades })
        }
    };
    let end = if u.arbitrary()? { Some(time(u)?) } else { None };
    let weight = f32::from(u.arbitrary::<u8>()?) / 255.0;
    Ok(Constraint { kind, start: time(u)?, end, fade: span(u)?, weight })
}

fn limit(u: &mut Unstructured) -> Result<(u32, Limit)> {
    let axis = [DVec3::X, DVec3::Y, DVec3::NEG_Z, point(u)?][u.choose_index(4)?];
    let (a, b) = (number(u)? % 4.0, number(u)? % 4.0);
    let ends = (a.min(b), a.max(b));
    let limit = if u.arbitrary()? {
        Limit::Hinge { axis, angle: ends }
    } else {
        Limit::SwingTwist { axis, swing: number(u)?.abs() % 3.5, twist: ends }
    };
    Ok((joint(u)?, limit))
}

fn springs(u: &mut Unstructured) -> Result<ActorSprings> {
    let mut springs = ActorSprings { wind: point(u)?, pre_roll: span(u)?, ..ActorSprings::default() };
    for joint in chain(u)? {
        springs.rig.add(RigBone {
            joint,
            tail: [Vec3::Y * 0.1, Vec3::ZERO, point(u)?.as_vec3()][u.choose_index(3)?],
            spring: SpringBone::new(number(u)?.abs(), number(u)?.abs()),
            gravity: point(u)?,
            pull: DVec3::ZERO,
            hit_radius: number(u)?.abs(),
            center: None,
            colliders: Vec::new(),
        });
    }
    springs.rig.ground = if u.arbitrary()? { Some(number(u)?) } else { None };
    Ok(springs)
}

fn stage(u: &mut Unstructured) -> Result<Stage> {
    let mut stage = Stage::default();
    stage.settings.size = [u.int_in_range(1..=64)?, u.int_in_range(1..=64)?];
    let count = u.int_in_range(1..=3usize)?;
    let joints = PERSON.skeleton.len();
    for i in 0..count {
        let id = stage.cast(&format!("a{i}"), PERSON.clone());
        for _ in 0..u.int_in_range(0..=2)? {
            let mut cues = (0..u.int_in_range(0..=4)?).map(|_| cue(u)).collect::<Result<Vec<_>>>()?;
            cues.sort_by_key(|c| c.start);
            let mask = if u.arbitrary()? {
                Some(Arc::new((0..joints).map(|j| if j % 3 == 0 { 1.0 } else { 0.25 }).collect()))
            } else {
                None
            };
            let base = stage.actors[id].layers.is_empty();
            let from =
                [Reference::FirstFrame, Reference::Rest, Reference::At(span(u)?)][u.choose_index(3)?];
            let modes = [LayerMode::Override, LayerMode::Additive(from), LayerMode::Subtractive(from)];
            let mode = if base { LayerMode::Override } else { modes[u.choose_index(3)?] };
            stage.actors[id].layers.push(Layer { mask, cues, mode, ..Layer::default() });
        }
        let actor = &mut stage.actors[id];
        actor.transform.translation = point(u)?;
        actor.transform.rotation = DQuat::from_rotation_y(number(u)? % 7.0);
        actor.visible = u.ratio(7, 8)?;
        if u.ratio(1, 3)? {
            actor.channels.push(channel(u)?);
        }
        if u.ratio(1, 3)? {
            let joint = if u.arbitrary()? { Some(u.int_in_range(0..=60)?) } else { None };
            let to = Attachment { actor: u.int_in_range(0..=count)?, joint };
            actor.parents = vec![if u.arbitrary()? {
                Parenting::always(to)
            } else {
                Parenting { blend: span(u)?, ..Parenting::from(Some(to), time(u)?) }
            }];
        }
        if u.ratio(1, 4)? {
            actor.face = Some(u.int_in_range(0..=count)?);
        }
        if u.ratio(1, 3)? {
            let (target, joint) = (target(u, count)?, u.int_in_range(0..=60)?);
            let end = if u.arbitrary()? { Some(time(u)?) } else { None };
            actor.look_at.push(LookAt { joint, target, start: time(u)?, end, fade: span(u)?, weight: 0.75 });
        }
        if u.ratio(1, 3)? {
            actor.constraints =
                (0..u.int_in_range(1..=3)?).map(|_| constraint(u, count)).collect::<Result<_>>()?;
        }
        if u.ratio(1, 6)? {
            actor.limits = (0..u.int_in_range(1..=3)?).map(|_| limit(u)).collect::<Result<_>>()?;
        }
        if u.ratio(1, 6)? {
            actor.springs = Some(Arc::new(springs(u)?));
        }
    }
    for i in 0..u.int_in_range(0..=2)? {
        let rig = match u.int_in_range(0..=3)? {
            0 => Rig::Fixed {
                position: point(u)?,
                rotation: DQuat::IDENTITY,
                look_at: Some(target(u, count)?),
            },
            1 => Rig::Follow { target: target(u, count)?, offset: point(u)? },
            2 => Rig::Orbit {
                target: target(u, count)?,
                distance: number(u)?.abs(),
                elevation: 0.3,
                azimuth: number(u)?,
                speed: number(u)?,
            },
            _ => Rig::Frame { azimuth: number(u)?, elevation: 0.2 },
        };
        stage.cameras.push(Camera::new(&format!("c{i}"), rig));
        stage.cuts.push(Cut::new(time(u)?, i));
    }
    stage.cuts.sort_by_key(|c| c.at);
    if u.ratio(1, 4)? {
        let parent = Some(Attachment { actor: u.int_in_range(0..=count)?, joint: None });
        let light = Light { kind: LightKind::Directional, color: Vec3::ONE, intensity: 3.0, range: None };
        let channels = Vec::new();
        let position = point(u)?;
        stage.lights.push(StageLight {
            name: "l".into(),
            light,
            position,
            direction: -Vec3::Y,
            parent,
            channels,
            shadow: None,
            attenuation: None,
        });
    }
    Ok(stage)
}

/// All bits of a snapshot as text: `{:?}` distinguishes all floats except NaN payloads.
fn shown(stage: &Result2<Snapshot>) -> String {
    format!("{stage:?}")
}

type Result2<T> = std::result::Result<T, StageError>;

fn compare(u: &mut Unstructured) -> Result<()> {
    let stage = stage(u)?;
    if !stage.check().is_empty() {
        // Lenient mode skips missing objects, and must not panic.
        let _ = stage.at(Time(time(u)?.0 % Time::from_secs(8.0).0));
        return Ok(());
    }
    let mut times = (0..u.int_in_range(2..=6)?).map(|_| time(u)).collect::<Result<Vec<_>>>()?;
    if stage.actors.iter().any(|a| a.springs.is_some()) {
        // Springs have to go all the way.
        times.iter_mut().for_each(|t| *t = Time(t.0 % Time::from_secs(8.0).0));
    }
    let sought: Vec<String> = times.iter().map(|t| shown(&stage.at(*t))).collect();
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by_key(|i| times[*i]);
    let mut evaluator = Evaluator::new(Arc::new(stage));
    let mut snapshot = Snapshot::default();
    for i in order.iter().copied().chain(order.iter().rev().copied()).chain(0..times.len()) {
        let played = evaluator.at_into(times[i], &mut snapshot).map(|()| snapshot.clone());
        assert_eq!(shown(&played), sought[i], "at {} s", times[i].as_secs());
        if let Ok(played) = &played {
            assert_finite(played);
        }
    }
    times.clear();
    Ok(())
}

fuzz_target!(|bytes: &[u8]| {
    // Too few bytes is no finding.
    let _ = compare(&mut Unstructured::new(bytes));
});
