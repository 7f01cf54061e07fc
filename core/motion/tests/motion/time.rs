//! Ticks, frame rates and playback are exact for any duration.

use choreo_motion::{FrameRate, FrameRateError, Playback, Repeat, Time};
use proptest::prelude::*;

const SECOND: i64 = Time::TICKS_PER_SECOND;

#[test]
fn common_frame_rates_have_whole_ticks_per_frame() {
    for fps in [24, 25, 30, 48, 50, 60, 90, 100, 120, 144, 240, 8000, 44_100, 48_000, 96_000] {
        assert_eq!(SECOND % fps, 0, "{fps}");
    }
    for base in [24u32, 30, 60, 120] {
        let rate = FrameRate::from_fps(f64::from(base) * 1000.0 / 1001.0).unwrap();
        assert_eq!(rate, FrameRate { num: base * 1000, den: 1001 });
        // A frame lasts 1001/(1000 n) s: whole ticks, so that frame f starts at exactly f times that.
        let frame = SECOND / (i64::from(base) * 1000) * 1001;
        for f in [0, 1, 17_982, 107_892, 1 << 35] {
            assert_eq!(rate.time_of(f), Time(f * frame), "{base} frame {f}");
        }
    }
}

#[test]
fn frame_rates_are_recognized_from_fps() {
    assert_eq!(FrameRate::from_fps(30.0), Ok(FrameRate { num: 30, den: 1 }));
    assert_eq!(FrameRate::from_fps(29.97), Ok(FrameRate { num: 30_000, den: 1001 }));
    assert_eq!(FrameRate::from_fps(23.976), Ok(FrameRate { num: 24_000, den: 1001 }));
    assert_eq!(FrameRate::from_fps(23.98), Ok(FrameRate { num: 24_000, den: 1001 }));
    assert_eq!(FrameRate::from_fps(12.5), Ok(FrameRate { num: 25, den: 2 }));
    // These rates are not rounded to thousandths or to NTSC rates.
    assert_eq!(FrameRate::from_fps(29.973), Ok(FrameRate { num: 29_973, den: 1000 }));
    assert_eq!(FrameRate::from_fps(12.3456), Ok(FrameRate { num: 7716, den: 625 }));
    assert_eq!(FrameRate::from_fps(1.0 / 3.0), Ok(FrameRate { num: 1, den: 3 }));
    assert_eq!(FrameRate::from_fps(0.0014), Ok(FrameRate { num: 7, den: 5000 }));
    assert_eq!(FrameRate::from_fps(999.123456789), Err(FrameRateError::Ratio));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-4, 1001.0] {
        assert_eq!(FrameRate::from_fps(bad), Err(FrameRateError::Range), "{bad}");
    }
}

#[test]
fn frames_in_counts_frames_that_start_within_a_duration() {
    let thirty = FrameRate { num: 30, den: 1 };
    let ntsc = FrameRate { num: 30_000, den: 1001 };
    assert_eq!(thirty.frames_in(Time::ZERO), 0);
    assert_eq!(thirty.frames_in(Time(-5)), 0);
    assert_eq!(thirty.frames_in(Time(1)), 1);
    assert_eq!(thirty.frames_in(Time::from_secs(4.0)), 120);
    assert_eq!(thirty.frames_in(Time(4 * SECOND + 1)), 121);
    assert_eq!(ntsc.frames_in(ntsc.time_of(300)), 300);
    // An hour of NTSC drops 108 of 108 000 frames, rounded up to the frame that has begun.
    assert_eq!(ntsc.frames_in(Time(3600 * SECOND)), 107_893);
    assert!(thirty.frames_in(Time::MAX) > 0);
}

proptest! {
    #[test]
    fn frames_in_agrees_with_time_of(num in 1u32..200_000, den in 1u32..2000, ticks in 0i64..1 << 50) {
        let rate = FrameRate { num, den };
        let n = rate.frames_in(Time(ticks));
        // Starts are rounded to a tick: the one at the border may fall on either side.
        prop_assert!(n == 0 || rate.time_of(n - 1) <= Time(ticks));
        prop_assert!(rate.time_of(n) >= Time(ticks));
    }

    #[test]
    fn looping_is_exact_at_any_distance(length in 1i64..1 << 40, loops in 0i64..10_000, into in 0i64..1 << 40) {
        let into = into % length;
        let play = Playback { speed: 1.0, trim: (Time(77), Time(77 + length)), repeat: Repeat::Loop };
        prop_assert_eq!(play.clip_time(Time(loops * length + into)), Time(77 + into));
        let back = Playback { speed: -1.0, ..play };
        prop_assert_eq!(back.clip_time(Time(loops * length + into)), Time(77 + length - into));
    }

    #[test]
    fn speed_is_the_exact_product_rounded(elapsed in 0i64..1 << 45, halves in 0i64..1 << 12) {
        // Speeds n/1024 are exact in binary: an independent integer product.
        let play = Playback { speed: halves as f64 / 1024.0, trim: (Time::ZERO, Time::MAX), repeat: Repeat::Once };
        let exact = (i128::from(elapsed) * i128::from(halves) * 2 + 1024).div_euclid(2048);
        prop_assert_eq!(play.clip_time(Time(elapsed)), Time(exact as i64));
    }

    #[test]
    fn clip_time_stays_in_the_trim(elapsed: i64, speed in -1e9f64..1e9, a in -1i64 << 40..1 << 40, length in 0i64..1 << 40, kind in 0usize..3) {
        let repeat = [Repeat::Once, Repeat::Loop, Repeat::PingPong][kind];
        let play = Playback { speed, trim: (Time(a), Time(a + length)), repeat };
        play.check().unwrap();
        let at = play.clip_time(Time(elapsed));
        prop_assert!(at >= Time(a) && at <= Time(a + length));
    }
}

#[test]
fn clip_time_follows_the_repeat_mode() {
    let secs = Time::from_secs;
    let play = |repeat, speed, at: f64| {
        Playback { speed, trim: (secs(1.0), secs(3.0)), repeat }.clip_time(secs(at)).as_secs()
    };
    for (repeat, speed, at, wanted) in [
        (Repeat::Once, 1.0, 0.5, 1.5),
        (Repeat::Once, 1.0, 9.0, 3.0),
        (Repeat::Once, 1.0, -9.0, 1.0),
        (Repeat::Once, -2.0, 0.5, 2.0),
        (Repeat::Once, -2.0, 5.0, 1.0),
        (Repeat::Once, 0.0, 5.0, 1.0),
        (Repeat::Loop, 1.0, 2.0, 1.0),
        (Repeat::Loop, 1.0, 2.5, 1.5),
        (Repeat::Loop, -1.0, 2.5, 2.5),
        (Repeat::PingPong, 1.0, 2.0, 3.0),
        (Repeat::PingPong, 1.0, 2.5, 2.5),
        (Repeat::PingPong, 1.0, 4.0, 1.0),
        (Repeat::PingPong, -1.0, 0.5, 2.5),
        (Repeat::PingPong, -1.0, 2.5, 1.5),
    ] {
        assert_eq!(play(repeat, speed, at), wanted, "{repeat:?} {speed} at {at}");
    }
}

#[test]
fn clip_time_is_exact_after_a_hundred_hours_of_looping() {
    // A clip of 31 NTSC frames, 0.7 times as fast as drawn: whole loops and 12 345 ticks later.
    let length = 31 * 23_543_520i64;
    let play = Playback { speed: 0.75, trim: (Time::ZERO, Time(length)), repeat: Repeat::Loop };
    let loops = 100 * 3600 * SECOND / length;
    assert_eq!(play.clip_time(Time(loops * length * 4 + 4 * 12_345)), Time(3 * 12_345));
}

#[test]
fn clip_time_of_an_empty_trim_is_its_start() {
    for repeat in [Repeat::Once, Repeat::Loop, Repeat::PingPong] {
        let play = Playback { speed: 1.0, trim: (Time(5), Time(5)), repeat };
        assert_eq!(play.clip_time(Time(1_000)), Time(5));
    }
}

#[test]
fn check_of_a_playback_names_the_invalid_field() {
    let mut play = Playback::whole(Time::from_secs(1.0));
    play.speed = f64::NAN;
    assert_eq!(play.check().unwrap_err().to_string(), "`Playback.speed` is NaN, must be finite");
    assert_eq!(play.clip_time(Time(9)), Time::ZERO);
    let play = Playback { trim: (Time::from_secs(2.0), Time::from_secs(1.0)), ..Playback::whole(Time::ZERO) };
    assert_eq!(
        play.check().unwrap_err().to_string(),
        "`Playback.trim` is 2 s to 1 s, must be in order (use a negative speed)"
    );
}

#[test]
fn time_arithmetic_saturates() {
    assert_eq!(Time::MAX + Time(1), Time::MAX);
    assert_eq!(Time(i64::MIN) - Time(1), Time(i64::MIN));
    assert_eq!(-Time(i64::MIN), Time::MAX);
    assert_eq!(Time::from_secs(f64::NAN), Time::ZERO);
    assert_eq!(Time::from_secs(f64::INFINITY), Time::MAX);
    assert_eq!(Time::from_secs(-1e300), Time(i64::MIN));
    assert_eq!(Time(5).wrapped(Time::ZERO), Time::ZERO);
    assert_eq!(Time(-1).wrapped(Time(10)), Time(9));
    assert_eq!(Time(7).fraction(Time(7), Time(7)), 0.0);
    assert_eq!(Time(3).fraction(Time(1), Time(5)), 0.5);
    let top = FrameRate { num: 1, den: 1000 }.time_of(i64::MAX);
    assert_eq!(top, Time::MAX);
}
