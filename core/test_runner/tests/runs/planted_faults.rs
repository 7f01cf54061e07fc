//! Expectations of every kind detect faults: one scene meets all of them, and each planted fault fails exactly the expectations that it
//! breaks.

use crate::common::*;
use choreo_test_runner::{Check, Evidence};

/// The comment of each expectation gives its name: `// = head` names the expectation "head".
const SCENE: &str = r#"
let m = load("choreo:mannequin");
test("everything", || {
    stage(#{ size: [320, 180], fps: 30, length: 3 });
    let anna = cast("anna", m).at(1, 0, 0).turn(90);
    anna.play(m.clip("Idle")).until(1.0).then(m.clip("Wave"), #{ fade: 0.5 });
    let ball = cast("ball", shape("sphere", #{ size: 0.2 }));
    ball.key("position", [[0, [0, 1, 0]], [3, [3, 1, 0]]]);
    let foot = cast("foot", shape("box", #{ size: 0.1 }));
    foot.key("position", [[0, [0, 0.2, 0]], [1, [0, 0, 0]], [2, [0, 0, 0]], [3, [0, 0.2, 0]]]);
    let sole = foot.joint(foot.joints()[0]);
    camera("wide").at(1, 1, 5).look_at([1, 1, 0]);
    camera("close").at(1, 1.5, 2).look_at([1, 1.5, 0]).cut(2);
    sun(#{ intensity: 2 });
    on_frame(|t| { /*FRAME*/ });
    /*PLANT*/
    expect(anna.joint("LeftHand")).at(0).relative_to(anna).near(|t| HAND, mm(1)); // = hand
    expect(anna.joint("Head")).at(0).relative_to(anna).rotation().near(HEAD, 0.1); // = head
    expect(anna).rotation().near([0.0, 0.7071067811865476, 0.0, 0.7071067811865476], 0.01); // = turn
    expect(anna).rotation().near([0.0, -0.7071067811865476, 0.0, -0.7071067811865476], 0.01); // = minus turn
    expect(ball).near(|t| [t, 1.0, 0.0], mm(1)); // = path
    expect(ball).speed().near(1.0, 0.001); // = speed
    expect(ball).jerk().below(0.1); // = jerk
    expect(sole).during(0.9, 2.1).slide(#{ height: 0.01 }).below(cm(1)); // = slide
    expect(anna).at(1.25).weight("Wave").near(0.5); // = weight
    expect(stage()).events().exactly([[0, "anna: Idle starts"], [1, "anna: Idle ends"], [1, "anna: Wave starts"], [2, "cut to close"]]); // = events
    expect(anna).during(0, 1.9).in_frame(#{ height: [0.3, 0.6], upright: 5 }); // = frame
    expect(plan()).at(0).count("passes").equals(1); // = passes
    expect(plan()).at(0).count("pipelines").between(1, 3); // = pipelines
    expect(plan()).leaves_out("morph targets"); // = left out
    expect(stage()).warnings().empty(); // = warnings
    expect(stage()).count("actors").equals(3); // = actors
    expect(anna).visible(); // = visible
    expect(stage()).same_as(stage()); // = same
});
"#;

/// Names of the expectations that fail.
fn failed_expectations(plant: &str, frame: &str) -> Vec<String> {
    let text = scene(plant, frame);
    let checks = checks(&text);
    let name = |check: &Check| {
        let line = text.lines().nth(check.place.line - 1).unwrap();
        line.split_once("// = ").map_or(check.title.clone(), |(_, name)| name.to_string())
    };
    assert!(checks.len() >= 18, "{:?}", failed_check_texts(&checks));
    checks.iter().filter(|c| !c.passed).map(name).collect()
}

fn scene(plant: &str, frame: &str) -> String {
    // Position of the hand and rotation of the head at the start of the clip "Idle", from an evaluation without a stage.
    let (hand, head) = reference_pose();
    SCENE
        .replace("HAND", &format!("{hand:?}"))
        .replace("HEAD", &format!("{head:?}"))
        .replace("/*FRAME*/", frame)
        .replace("/*PLANT*/", plant)
}

/// Pose from the motion library, without a stage: position of the hand in model space, rotation of the head as a quaternion.
fn reference_pose() -> ([f64; 3], [f64; 4]) {
    use choreo_motion::{LocalToModel, Pose, Sample, Time};
    let options = options();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.rhai");
    std::fs::write(&path, "let a = cast(\"a\", load(\"choreo:mannequin\"));").unwrap();
    let script = choreo_script::run_file(&path, &registry(), &options.script).unwrap();
    let asset = &script.stage.actors[0].asset;
    let clip = asset.clips.iter().find(|c| c.name == "Idle").unwrap();
    let mut pose = Pose::rest(&asset.skeleton);
    Sample { clip, time: Time::ZERO, pose: &mut pose }.run();
    let mut joints = vec![glam::Affine3A::IDENTITY; asset.skeleton.len()];
    LocalToModel { skeleton: &asset.skeleton, pose: &pose, model_from_joint: &mut joints }.run();
    let hand = joints[asset.skeleton.find("LeftHand").unwrap()].translation;
    let (_, head, _) = joints[asset.skeleton.find("Head").unwrap()].to_scale_rotation_translation();
    (hand.as_dvec3().to_array(), head.as_dquat().to_array())
}

#[test]
fn the_scene_without_faults_meets_all_expectations() {
    let checks = checks(&scene("", ""));
    assert!(checks.iter().all(|c| c.passed), "{}", failed_check_texts(&checks).join("\n"));
    assert_eq!(checks.len(), 18);
    // A passed check has no error and no traces.
    assert!(checks.iter().all(|c| c.by.is_empty() && c.evidence == Evidence::None));
}

#[test]
fn each_planted_fault_fails_only_the_expectations_that_it_breaks() {
    // Every scene has a callback, empty by default, so that a fault in it is the only difference.
    let cases: &[(&str, &str, &str, &[&str])] = &[
        (
            "one joint off by half a degree",
            "",
            r#"anna.joint("LeftForeArm").rotate(0.5, 0.0, 0.0);"#,
            &["hand"],
        ),
        ("a joint turned the wrong way", "", r#"anna.joint("Head").turn(2.0);"#, &["head"]),
        ("a flipped component of a quaternion", "anna.turn(-180);", "", &["turn", "minus turn"]),
        ("the same rotation written as its negative", "anna.turn(360);", "", &[]),
        (
            "a late event",
            r#"cast("other", m).hide().at(9, 0, 9); camera("late").at(0, 1, 9).cut(2.5);"#,
            "",
            &["events", "actors"],
        ),
        ("an extra pass", r#"effect("vignette");"#, "", &["events", "passes"]),
        (
            "a warning",
            r#"anna.look_at(ball); anna.play(m.clip("Walk")).from(20);"#,
            "",
            &["events", "warnings"],
        ),
        (
            "a jump for one frame",
            "",
            "if t == 1.0 { ball.move_by(0.0, 0.05, 0.0); }",
            &["path", "speed", "jerk"],
        ),
        ("a sliding foot", "", "if t > 1.0 { foot.move_by(0.1 * (t - 1.0), 0.0, 0.0); }", &["slide"]),
        ("an actor that is hidden for one frame", "", "if t == 2.5 { anna.hide(); }", &["visible"]),
        ("a camera that tilts", r#"anna.rotate(0, 0, 8);"#, "", &["turn", "minus turn", "frame"]),
    ];
    for (what, plant, frame, expected) in cases {
        let got = failed_expectations(plant, frame);
        assert_eq!(
            got,
            *expected,
            "{what}: {}",
            failed_check_texts(&checks(&scene(plant, frame))).join("\n")
        );
    }
}

#[test]
fn a_late_cue_fails_the_events_with_its_delay_and_the_clip_weight() {
    let text = scene("", "").replace(".until(1.0)", ".until(1.2)");
    let checks = checks(&text);
    let failed: Vec<&Check> = checks.iter().filter(|c| !c.passed).collect();
    assert_eq!(failed.len(), 2, "{}", failed_check_texts(&checks).join("\n"));
    let weight = failed.iter().find(|c| c.title.contains("weight")).unwrap();
    assert_eq!((weight.expected.as_str(), weight.got.as_str()), ("0.5 ± 0.001", "0.1 at 1.25 s"));
    let events = failed.iter().find(|c| c.title.contains("events")).unwrap();
    assert_eq!(
        (events.expected.as_str(), events.got.as_str(), events.by.as_str()),
        ("anna: Idle ends at 1 s", "anna: Idle ends at 1.2 s", "0.2 s late")
    );
}

#[test]
fn a_failed_check_states_time_and_error_and_has_traces() {
    let checks = checks(&scene("", "if t == 1.0 { ball.move_by(0.0, 0.05, 0.0); }"));
    let path = checks.iter().find(|c| c.title.contains("[t, 1.0, 0.0]")).unwrap();
    assert_eq!(path.got, "[1, 1.05, 0] m at 1 s, the worst of 90 samples; only there");
    assert_eq!(path.by, "0.05 m, 50 times the tolerance");
    let Evidence::Traces(traces) = &path.evidence else { panic!("{path:?}") };
    let labels: Vec<&str> = traces.iter().map(|t| t.label.as_str()).collect();
    assert_eq!(labels, ["ball x", "ball y", "ball z"]);
    let y = &traces[1];
    assert_eq!((y.times.len(), y.mark, y.unit.as_str()), (90, Some(1.0), "m"));
    assert_eq!((y.got[30], y.expected[30], y.band[30]), (1.05, 1.0, [0.999, 1.001]));
    let speed = checks.iter().find(|c| c.title.contains("speed")).unwrap();
    let Evidence::Traces(traces) = &speed.evidence else { panic!("{speed:?}") };
    // The jump of 0.05 m takes 1/30 s (1.5 m/s), in addition to 1 m/s along x.
    assert!((traces[0].got.iter().copied().fold(0.0, f64::max) - (1.0f64 + 1.5 * 1.5).sqrt()).abs() < 1e-9);
    // A failure at a single time has traces of half a second around it, of which only that time has an allowed range.
    let off = crate::common::checks(&scene("", r#"anna.joint("LeftForeArm").rotate(5, 0, 0);"#));
    let hand = off.iter().find(|c| c.title.contains("LeftHand")).unwrap();
    let Evidence::Traces(traces) = &hand.evidence else { panic!("{hand:?}") };
    let asserted = traces[0].band.iter().filter(|b| !b[0].is_nan()).count();
    assert!(traces[0].times.len() >= 30 && asserted == 1, "{:?}", traces[0]);
}

#[test]
fn not_requires_a_claim_to_be_false_at_every_time() {
    let text = |body: &str| {
        format!(
            "test(\"t\", || {{ stage(#{{ length: 1 }}); let b = cast(\"b\", shape(\"box\")); \
             b.key(\"position\", [[0, [0, 0, 0]], [1, [1, 0, 0]]]); {body} }});"
        )
    };
    let fails = |body: &str| checks(&text(body)).iter().filter(|c| !c.passed).count();
    assert_eq!(fails("expect(b).not().near([5, 0, 0]);"), 0);
    // Being near at one time fails "not near at any time".
    assert_eq!(fails("expect(b).not().near([0.5, 0, 0]);"), 1);
    assert_eq!(fails("expect(b).near([0.5, 0, 0]);"), 1);
    assert_eq!(fails("expect(b).not().visible();"), 1);
    assert_eq!(fails("expect(1).not().equals(2); expect(1).not().equals(1);"), 1);
    assert_eq!(fails("expect(plan()).at(0).not().leaves_out(\"skinning\");"), 1);
    assert_eq!(
        fails("expect(plan()).at(0).not().leaves_out(\"skining\");"),
        1,
        "an unknown name must not pass"
    );
    // A hidden object is neither near nor not near.
    assert_eq!(fails("b.hide(); expect(b.joint(b.joints()[0])).not().near([5, 0, 0]);"), 1);
    assert_eq!(fails("expect(stage()).events().not().in_order([\"*\"]);"), 0);
}

#[test]
fn expected_and_unexpected_diagnostics_become_checks() {
    let runs = run_sections(
        r#"let m = load("choreo:mannequin");
test("met", || {
    cast("a", m).play(m.clip("Wlk")); //~ error: did you mean "Walk"
});
test("unmet", || {
    cast("a", m).play(m.clip("Walk")); //~ error: unknown clip
});
test("unexpected", || {
    cast("a", m).play(m.clip("Wlk"));
    expect(1).equals(2);
});
test("warned", || {
    cast("a", m).play(m.clip("Walk")).from(9);
    expect(1).equals(1);
});
test("warned as expected", || {
    cast("a", m).play(m.clip("Walk")).from(9); //~ warning: after the end of the stage
    expect(1).equals(1);
});
"#,
    );
    let failed: Vec<Vec<(usize, bool)>> =
        runs.iter().map(|(_, checks)| checks.iter().map(|c| (c.place.line, c.passed)).collect()).collect();
    assert_eq!(failed[0], [(3, true)]);
    assert_eq!(failed[1], [(6, false)]);
    // After an unexpected error nothing else is judged.
    assert_eq!(failed[2], [(9, false)]);
    assert_eq!(failed[3], [(13, false), (14, true)]);
    assert_eq!(failed[4], [(17, true), (18, true)]);
}

#[test]
fn a_script_without_sections_must_be_finite_and_free_of_diagnostics() {
    let fine = checks("let a = cast(\"a\", load(\"choreo:mannequin\")); on_frame(|t| a.turn(t));");
    assert_eq!(fine.len(), 3);
    assert!(fine.iter().all(|c| c.passed), "{}", failed_check_texts(&fine).join("\n"));
    let failed = |text: &str| failed_check_texts(&checks(text)).join("\n");
    let got = failed("let a = cast(\"a\", load(\"choreo:mannequin\")); on_frame(|t| a.at(ln(-t), 0, 0));");
    assert!(got.contains("must be a finite number"), "{got}");
    let got = failed("let m = load(\"choreo:mannequin\"); cast(\"a\", m).play(m.clip(\"Walk\")).from(9);");
    assert!(got.contains("runs without errors and warnings"), "{got}");
    let got = failed("let m = load(\"choreo:mannequin\"); m.clip(\"x\");");
    assert!(got.contains("unknown clip"), "{got}");
}

#[test]
fn evaluation_times_are_compared_as_ratios() {
    let text = |factor: &str| {
        format!(
            r#"let m = load("choreo:mannequin");
            test("t", || {{
                let one = stage_of(|| {{ stage(#{{ length: 1 }}); cast("a", m).play(m.clip("Walk")); }});
                let ten = stage_of(|| {{
                    stage(#{{ length: 1 }});
                    for i in 0..10 {{ cast("a" + i, m).at(i, 0, 0).play(m.clip("Walk")); }}
                }});
                expect(ten).costs_at_most({factor}, one);
            }});"#
        )
    };
    // Ten characters take between 3 and 30 times as long as one on any machine.
    let checks = checks(&text("30"));
    assert!(checks[0].passed, "{}", failed_check_texts(&checks).join("\n"));
    let checks = crate::common::checks(&text("3"));
    assert!(!checks[0].passed && checks[0].got.ends_with(" times"), "{:?}", checks[0]);
}

/// A quantity without a value fails every claim, negated or not, with the reason.
#[test]
fn a_claim_about_a_quantity_without_a_value_fails_with_the_reason() {
    let text = |height: &str, claim: &str| {
        format!(
            r#"test("t", || {{
                stage(#{{ fps: 30, length: 1 }});
                let ball = cast("ball", shape("sphere", #{{ size: 0.2 }})).at(0, {height}, 0);
                let wide = camera("wide").at(0, 1, 5).look_at([0, 1, 0]);
                let side = camera("side").at(3, 1, 5).look_at([0, 1, 5]);
                {claim}
            }});"#
        )
    };
    let judged = |height: &str, claim: &str| {
        let mut checks = checks(&text(height, claim));
        assert_eq!(checks.len(), 1);
        checks.remove(0)
    };
    let slide = "expect(ball.joint(ball.joints()[0]))";
    let still = judged("0", &format!("{slide}.slide().below(0.01);"));
    assert!(still.passed, "{still:?}");
    for claim in ["slide().below(0.01)", "at(0.5).slide().near(0.0)", "not().slide().above(0.01)"] {
        let flying = judged("0.5", &format!("{slide}.{claim};"));
        let why = "its lowest point is 0.5 m above it";
        assert!(!flying.passed && flying.got.contains("never touches the floor"), "{claim}: {flying:?}");
        assert!(flying.got.contains(why), "{claim}: {flying:?}");
    }
    let own = judged("1", "expect(wide).in_picture().near([0.5, 0.5, 0.0], 99.0);");
    assert!(!own.passed && own.hint.contains("camera wide is the camera of this image"), "{own:?}");
    let own = judged("1", "expect(side).in_picture(side).x().between(-99.0, 99.0);");
    assert!(!own.passed && own.hint.contains("camera side is the camera of this image"), "{own:?}");
    for claim in ["at(1.5)", "at(-0.1)", "not().at(2.0)", "during(0.5, 1.5)"] {
        let outside = judged("1", &format!("expect(ball).{claim}.near([9.0, 9.0, 9.0]);"));
        assert!(!outside.passed && outside.got.contains("is outside the stage"), "{claim}: {outside:?}");
    }
    assert!(judged("1", "expect(ball).at(1.0).near([0.0, 1.0, 0.0], 0.001);").passed, "the end is inside");
    let other = judged("1", "expect(wide).in_picture(side).near([0.5, 0.5, 3.0], 0.001);");
    assert!(other.passed, "{other:?}");
    let behind = judged("1", "ball.at(0, 1, 9); expect(ball).in_picture().y().above(0.0);");
    assert!(!behind.passed && behind.hint.contains("behind the camera"), "{behind:?}");
}

/// Each expectation of a number that fails states the difference with its unit.
#[test]
fn a_failed_number_states_its_error_with_the_unit() {
    let text = r#"
test("numbers", || {
    stage(#{ fps: 10, length: 2 });
    let ball = cast("ball", shape("sphere")).at(0, 2, 0);
    expect(ball).at(0).y().below(1.0); // = 1 m
    expect(ball).at(0).y().above(2.5); // = 0.5 m
    expect(ball).at(0).y().not().below(2.25); // = 0.25 m
    expect(ball).at(0).y().near(1.5, 0.1); // = 0.5 m, 5 times the tolerance
    expect(ball).at(0).y().not().near(1.9, 0.4); // = 0.3 m
    expect(ball).at(0).near([0, 1, 0], 0.5); // = 1 m, 2 times the tolerance
    expect(ball).at(0).rotation().near([0, 30, 0], 10); // = 30°, 3 times the tolerance
    expect(stage()).count("actors").equals(3); // = 2
    expect(stage()).events().exactly([[1, "ball: * starts"]]); // =
    expect(2.5).near(2.0, 0.25); // = 0.5, 2 times the tolerance
});
"#;
    let checks = checks(text);
    let off = |line: usize| text.lines().nth(line - 1).unwrap().split_once("// =").unwrap().1.trim();
    assert_eq!(checks.len(), 10);
    for check in &checks {
        assert!(!check.passed, "{}", check.title);
        assert_eq!(
            check.by,
            off(check.place.line),
            "{}",
            failed_check_texts(std::slice::from_ref(check)).join("")
        );
    }
}
