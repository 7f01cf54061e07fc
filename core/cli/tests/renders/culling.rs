//! Culling: actors outside the view are not posed, and images do not change.

use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::plan::motion_blur::plan_at;
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer, SceneResources};
use choreo_script::{ScriptOptions, run_text};
use choreo_stage::{Evaluator, Stage};
use choreo_wgsl_effect::WgslEffect;
use std::sync::{Arc, LazyLock};

const SIZE: [u32; 2] = [160, 90];

/// The built-in plugins, an effect that moves vertices and one that reads where surfaces were one frame ago.
static REGISTRY: LazyLock<Registry> = LazyLock::new(|| {
    let mut registry = choreo::registry();
    for text in [
        "// effect: pushed\n// hook: vertex\n// reach: 3\n\
            fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32> { return vec3<f32>(-3.0, 0.0, 0.0); }",
        "// effect: moved\n// hook: image\n\
            fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> \
            { return vec4<f32>(0.02 * motion_at(at) + 0.5, 0.0, 1.0); }",
    ] {
        registry.add_effect(WgslEffect::from_text("test.wgsl", text).unwrap());
    }
    registry
});

fn stage(script: &str) -> Arc<Stage> {
    let here = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    match run_text("test.rhai", script, here, &REGISTRY, &ScriptOptions::default()) {
        Ok(script) => Arc::new(script.stage),
        Err(errors) => panic!("{errors:?}"),
    }
}

fn draw_at(resources: &Arc<SceneResources>, evaluator: &mut Evaluator, secs: f64) -> (Vec<u8>, Plan) {
    let effects = REGISTRY.effects();
    let options = PlanOptions { effects, ..PlanOptions::new(SIZE, 1) };
    let (_, plan) = plan_at(resources, evaluator, Time::from_secs(secs), &options, None).unwrap();
    let mut renderer = CpuRenderer::new(effects);
    renderer.load(resources.clone()).unwrap();
    renderer.submit(plan.clone()).unwrap();
    (renderer.collect(None).unwrap().rgba, plan)
}

/// Asserts that images at some times are the same with and without culling, and returns the number of poses without and with it.
fn count_poses(script: &str) -> [usize; 2] {
    let stage = stage(script);
    let resources = Arc::new(SceneResources::new(&stage));
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let mut all = Evaluator::new(stage.clone());
    let mut seen = Evaluator::new(stage).for_images(aspect);
    for i in 0..8 {
        let secs = 0.37 * f64::from(i);
        let (expected, _) = draw_at(&resources, &mut all, secs);
        let (got, plan) = draw_at(&resources, &mut seen, secs);
        let differ = expected.iter().zip(&got).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "bytes of the image at {secs} s");
        let is_listed = plan.left_out.iter().any(|l| l.part == "actors outside the view");
        assert_eq!(is_listed, seen.poses() < all.poses(), "at {secs} s");
    }
    [all.total_poses(), seen.total_poses()]
}

/// A row of eleven walking actors with swords, two metres apart, of which about three are in view.
const ROW: &str = r#"
    stage(#{ size: [160, 90], length: 3.0 });
    let figure = load("choreo:mannequin");
    for i in 0..11 {
        let walker = cast("walker " + i, figure).at(4.0 * (i - 5), 0.0, 0.0).turn(90);
        walker.root_motion();
        walker.play(figure.clip("Walk"));
        cast("sword " + i, shape("box", #{ size: [0.03, 0.9, 0.03], color: "gold" })).attach(walker.joint("RightHand"));
    }
    cast("floor", shape("plane", #{ size: 60.0, color: "gray" }));
    camera("c").at(0.0, 1.4, 6.0).look_at([0.0, 0.9, 0.0]);
"#;

#[test]
fn actors_out_of_view_are_not_posed() {
    let [all, seen] = count_poses(ROW);
    assert!(3 * seen <= 2 * all, "{seen} of {all} poses");
}

/// Constraints rotate joints and lower the hips. Constraints of actors outside the view are not solved, and these actors are not posed.
#[test]
fn actors_out_of_view_with_constraints_are_not_posed() {
    let [plain, free] = count_poses(ROW);
    for constraint in [
        "walker.plant_feet();",
        "walker.aim(\"Head\", [0.0, 1.5, 3.0]);",
        "walker.reach(\"RightHand\", [0.0, 1.2, 0.5]);",
    ] {
        let script = ROW.replace("walker.root_motion();", &format!("walker.root_motion(); {constraint}"));
        let [all, seen] = count_poses(&script);
        assert_eq!(all, plain, "{constraint}");
        assert!(seen <= free + free / 10, "{constraint}: {seen} poses, {free} without it");
        let stage = stage(&script);
        let mut evaluator = Evaluator::new(stage.clone()).for_images(16.0 / 9.0);
        let snapshot = evaluator.at(Time::from_secs(1.0)).unwrap();
        let solved = evaluator.costs(&snapshot).constraints;
        let posed = snapshot.actors.iter().filter(|a| !a.culled && a.model_from_joint.len() > 5).count();
        assert!(0 < solved && solved <= posed && posed < 8, "{constraint}: {solved} solved for {posed}");
    }
}

#[test]
fn actors_whose_shadow_is_in_view_are_posed() {
    // The light comes from low on the right: actors on that side may cast shadows on visible surfaces, the others cannot.
    let low = format!("{ROW} sun(#{{ direction: [-1.0, -0.25, 0.0], shadow: true }});");
    let [all, seen] = count_poses(&low);
    assert!(5 * seen <= 4 * all && 2 * seen > all, "{seen} of {all} poses");
    let lamp = format!("{ROW} point(#{{ position: [0.0, 2.5, 1.0], intensity: 60, shadow: true }});");
    let [all, seen] = count_poses(&lamp);
    assert!(3 * seen <= 2 * all, "{seen} of {all} poses");
    // Of this actor only the shadow is in view: without the actor the image is different.
    let alone = r#"
        stage(#{ size: [160, 90], length: 3.0 });
        let figure = load("choreo:mannequin");
        let actor = cast("actor", figure).at(6.0, 0.0, 0.0);
        actor.play(figure.clip("Wave"));
        cast("floor", shape("plane", #{ size: 60.0, color: "gray" }));
        camera("c").at(0.0, 1.2, 3.0).look_at([0.0, 0.3, 0.0]).fov(30);
        sun(#{ direction: [-1.0, -0.25, 0.0], shadow: true });
    "#;
    let [all, seen] = count_poses(alone);
    assert_eq!(seen, all, "the shadow of the actor is in view");
    let with = draw_script(alone);
    assert_ne!(with, draw_script(&format!("{alone} actor.hide();")), "the shadow changes the image");
    assert_eq!(
        count_poses(&alone.replace("[-1.0, -0.25, 0.0]", "[1.0, -0.25, 0.0]"))[1],
        8,
        "the floor alone"
    );
}

fn draw_script(script: &str) -> Vec<u8> {
    let stage = stage(script);
    let resources = Arc::new(SceneResources::new(&stage));
    draw_at(&resources, &mut Evaluator::new(stage), 1.0).0
}

#[test]
fn culling_follows_turning_and_moving_cameras() {
    for camera in [
        r#"camera("o").orbit([0.0, 1.0, 0.0], #{ distance: 5.0, elevation: 20, azimuth: 0, speed: 60 }).cut(0.0);"#,
        r#"camera("k").look_at([0.0, 1.0, 0.0]).key("position", [[0.0, [-20.0, 2.0, 6.0]], [3.0, [20.0, 2.0, 6.0]]]).cut(0.0);"#,
        r#"camera("f").ortho(3.0).at(0.0, 1.0, 9.0).look_at([0.0, 1.0, 0.0]).cut(0.0);"#,
        r#"let p = camera("p").at(0.0, 1.4, 6.0).cut(0.0); on_frame(|t| p.at(8.0 * sin(t), 1.4, 6.0));"#,
    ] {
        let [all, seen] = count_poses(&format!("{ROW} {camera}"));
        assert!(4 * seen <= 3 * all, "{camera}: {seen} of {all} poses");
    }
    // If a camera follows a joint, or frames all actors, every actor is posed.
    for camera in [
        r#"camera("j").follow(actor("walker 5").joint("Head"), [0.0, 0.2, 2.0]).cut(0.0);"#,
        r#"camera("all").cut(0.0);"#,
    ] {
        let camera = camera.replace(r#"actor("walker 5")"#, r#"cast("extra", figure)"#);
        let [all, seen] = count_poses(&format!("{ROW} {camera}"));
        assert_eq!(seen, all, "{camera}");
    }
}

/// An actor that others aim at, hold or stand on is posed wherever it is.
#[test]
fn culled_actors_that_others_refer_to_are_posed() {
    let script = r#"
        stage(#{ size: [160, 90], length: 3.0 });
        let figure = load("choreo:mannequin");
        let far = cast("far", figure).at(40.0, 0.0, 0.0);
        far.play(figure.clip("Wave"));
        let here = cast("here", figure);
        here.play(figure.clip("Idle"));
        here.look_at(far.joint("RightHand"));
        camera("c").at(0.0, 1.4, 6.0).look_at([0.0, 0.9, 0.0]);
    "#;
    let stage = stage(script);
    let mut seen = Evaluator::new(stage.clone()).for_images(16.0 / 9.0);
    let snapshot = seen.at(Time::from_secs(1.0)).unwrap();
    assert!(snapshot.actors[0].culled && !snapshot.actors[0].model_from_joint.is_empty());
    let without_culling = Evaluator::new(stage).at(Time::from_secs(1.0)).unwrap();
    assert_eq!(snapshot.actors[1].model_from_joint, without_culling.actors[1].model_from_joint);
}

/// Effects that only change the colors of an image need no actors outside the view. Effects that move vertices, draw outlines, read motion
/// or draw beside actors need all actors, or those to which they are applied.
#[test]
fn effects_prevent_culling_only_of_the_actors_that_they_need() {
    let posed = |effect: &str| {
        let script = format!(
            r#"
            stage(#{{ size: [160, 90], length: 3.0 }});
            let figure = load("choreo:mannequin");
            let far = cast("far", figure).at(500.0, 0.0, 0.0);
            far.aim("Head", [0.0, 1.5, 3.0]);
            far.reach("RightHand", [500.0, 1.2, 0.5]);
            far.plant_feet();
            let here = cast("here", figure);
            camera("c").at(0.0, 1.4, 6.0).look_at([0.0, 0.9, 0.0]);
            {effect}
            "#
        );
        let mut seen = Evaluator::new(stage(&script)).for_images(16.0 / 9.0);
        let snapshot = seen.at(Time::from_secs(1.0)).unwrap();
        let posed = !snapshot.actors[0].model_from_joint.is_empty();
        assert_eq!(seen.costs(&snapshot).constraints, 3 * usize::from(posed), "{effect}");
        assert_eq!(seen.poses(), 1 + usize::from(posed), "{effect}");
        posed
    };
    for free in [
        "",
        "effect(\"vignette\");",
        "effect(\"bloom\");",
        "effect(\"depth_of_field\", #{ focus: here });",
        "effect(\"ambient_occlusion\");",
        "effect(\"film_grain\");",
        "effect(\"fog\");",
        "effect(\"toon\");",
        "effect(\"motion_blur\");",
        "effect(\"outline\").on(here);",
        "effect(\"pushed\").on(here);",
    ] {
        assert!(!posed(free), "{free}");
    }
    for needs in [
        "effect(\"pushed\");",
        "effect(\"pushed\").on(far);",
        "effect(\"outline\").on([here, far]);",
        "effect(\"skeleton\");",
        "effect(\"moved\");",
        "effect(\"depth_of_field\", #{ focus: far.joint(\"Head\") });",
        "effect(\"vignette\"); effect(\"wireframe\");",
    ] {
        assert!(posed(needs), "{needs}");
    }
}

#[test]
fn effects_give_the_same_image_with_culling() {
    for effect in ["fog", "motion_blur", "bloom", "depth_of_field", "edge_lines", "xray"] {
        let [all, seen] = count_poses(&format!("{ROW} effect(\"{effect}\");"));
        assert!(3 * seen <= 2 * all, "{effect}: {seen} of {all} poses");
    }
    for effect in ["pushed", "outline", "moved"] {
        let [all, seen] = count_poses(&format!("{ROW} effect(\"{effect}\");"));
        assert_eq!(seen, all, "{effect}");
    }
}

/// An actor that leaves the view while the shutter is open, and so is culled at its end, is blurred as far as without culling.
#[test]
fn an_actor_that_leaves_while_the_shutter_is_open_is_blurred() {
    let script = r#"
        stage(#{ size: [160, 90], length: 3.0, fps: 1 });
        let figure = load("choreo:mannequin");
        let actor = cast("actor", figure);
        WAY
        camera("c").at(0.0, 1.4, 6.0).look_at([0.0, 0.9, 0.0]);
        effect("motion_blur", #{ samples: 256, shutter: 360.0, around: "start" });
    "#;
    for (way, least) in [
        ("[1.0, [0.0, 0.0, 0.0]], [2.0, [80.0, 0.0, 0.0]]", 200),
        ("[1.0, [0.0, 0.0, 0.0]], [2.0, [0.0, 0.0, 0.0]]", 1),
    ] {
        let stage = stage(&script.replace("WAY", &format!("actor.key(\"position\", [{way}]);")));
        let resources = Arc::new(SceneResources::new(&stage));
        let options = PlanOptions { effects: REGISTRY.effects(), ..PlanOptions::new(SIZE, 1) };
        let counts = [Evaluator::new(stage.clone()), Evaluator::new(stage.clone()).for_images(16.0 / 9.0)]
            .map(|mut evaluator| {
                plan_at(&resources, &mut evaluator, Time::from_secs(1.0), &options, None)
                    .unwrap()
                    .1
                    .subframes
                    .len()
            });
        println!("{way}: {counts:?} sub-frames");
        assert!(counts[0] == counts[1] && counts[1] >= least, "{way}: {counts:?}");
    }
}
