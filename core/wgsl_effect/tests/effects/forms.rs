//! Geometry that effects draw: lines and triangles against closed forms, hulls, and elements that are refused or left out.

use choreo_asset::*;
use choreo_motion::{Skeleton, Time, Transform};
use choreo_plugin::effect::endless_loop;
use choreo_plugin::{EffectScene, Hook, InvertedHull, OutlineEffect, Overlay, OverlayEffect};
use choreo_stage::*;
use choreo_wgsl_effect::WgslEffect;
use glam::{Affine3A, DAffine3, DVec3, Mat4, Vec3, Vec4};
use std::sync::Arc;

const LINE_FUNCTION: &str = "fn effect(index: u32, actor: ActorSample, p: array<f32, 8>) -> Line";
const TRIANGLE_FUNCTION: &str = "fn effect(index: u32, actor: ActorSample, p: array<f32, 8>) -> Triangle";

fn effect(text: &str) -> WgslEffect {
    WgslEffect::from_text("my.wgsl", text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn error_message(text: &str) -> String {
    let error = WgslEffect::from_text("my.wgsl", text).err().unwrap_or_else(|| panic!("no error:\n{text}"));
    // The following lines, tested in `mistakes.rs`, show the source line with a caret.
    error.to_string().lines().next().unwrap_or_default().to_string()
}

fn overlay(header: &str, gives: &str, body: &str) -> WgslEffect {
    let params = "// param n = 4 in 0..2000: how many\n// param thru = false: over all";
    effect(&format!("// effect: o\n{params}\n// hook: overlay\n{header}\n{gives} {{\n{body}\n}}"))
}

/// Three joints in a chain, a metre apart along Y, of which the first and the last are bones.
fn three_joint_asset(places: &[Affine3A]) -> Arc<Asset> {
    let up = Transform { translation: Vec3::Y, ..Transform::IDENTITY };
    let names = ["root", "between", "tip"].map(String::from).to_vec();
    let skeleton = Skeleton::new(names, vec![None, Some(0), Some(1)], vec![Transform::IDENTITY, up, up]);
    let skin = Skin { joints: vec![0, 2], inverse_bind: vec![Mat4::IDENTITY; 2] };
    let skeleton = Arc::new(skeleton.unwrap());
    Arc::new(Asset { skeleton, skins: vec![skin], placements: places.into(), ..Asset::default() })
}

struct TestScene {
    stage: Stage,
    snapshot: Snapshot,
    before: Vec<Snapshot>,
}

/// A scene of these actors in their rest pose, at 1.5 s.
fn test_scene(actors: &[(&Arc<Asset>, DAffine3)]) -> TestScene {
    let mut seen = TestScene { stage: Stage::default(), snapshot: Snapshot::default(), before: Vec::new() };
    seen.snapshot.time = Time::from_secs(1.5);
    for (i, (asset, place)) in actors.iter().enumerate() {
        seen.stage.actors.push(Actor::new(&format!("a{i}"), (*asset).clone()));
        seen.snapshot.actors.push(ActorState {
            visible: true,
            world_from_model: *place,
            model_from_joint: asset.rest_model_from_joint().to_vec(),
            ..ActorState::default()
        });
    }
    seen
}

impl TestScene {
    fn draw(&self, effect: &WgslEffect, p: &[f32]) -> Overlay {
        let mut parameters = [0.0; 8];
        parameters[..p.len()].copy_from_slice(p);
        effect.overlay(
            &EffectScene { stage: &self.stage, snapshot: &self.snapshot, before: &self.before, on: &[] },
            &parameters,
        )
    }
}

fn translated(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// The members of the actor sample have the values that their names say, for each actor.
#[test]
fn overlay_lines_read_the_actor_around_which_they_are_drawn() {
    let asset = three_joint_asset(&[]);
    let quarter = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2);
    let scene =
        test_scene(&[(&asset, translated(5.0, 0.0, 0.0)), (&asset, translated(0.0, 0.0, 7.0) * quarter)]);
    let all = |from: &str, to: &str, width: &str| {
        let body = format!("return Line({from}, {to}, {width}, vec4(f32(index), p[n], actor.time, 0.5));");
        scene.draw(&overlay("// count: n", LINE_FUNCTION, &body), &[2.0])
    };
    let made = all("actor.position", "actor.high - actor.low", "f32(actor.number) + 1.0");
    assert_eq!((made.strokes.len(), made.over, made.left_out.len()), (4, false, 0));
    let [first, .., last] = made.strokes[..] else { panic!() };
    assert_eq!((first.from, first.to, first.width), (DVec3::X * 5.0, DVec3::Y * 2.0, 1.0));
    assert_eq!((last.from, last.to, last.width), (DVec3::Z * 7.0, DVec3::Y * 2.0, 2.0));
    assert_eq!(last.color, Vec4::new(1.0, 2.0, 1.5, 0.5));
    // Two of three joints are bones: the parent bone of the tip is the root. A missing bone has the position of the actor.
    let made = all("joint(index)", "vec3(f32(parent(index)), f32(parent(7u)), f32(actor.joints))", "1.0");
    let got: Vec<_> = made.strokes[..2].iter().map(|s| (s.from, s.to)).collect();
    let (root, tip) = (DVec3::new(5.0, 0.0, 0.0), DVec3::new(5.0, 2.0, 0.0));
    assert_eq!(got, [(root, DVec3::new(-1.0, -1.0, 2.0)), (tip, DVec3::new(0.0, -1.0, 2.0))]);
    assert_eq!(all("joint(9u)", "actor.low", "1.0").strokes[0].from, root);
    let made = all("in_world(vec3(1.0, 2.0, 0.0))", "actor.position", "1.0");
    assert_eq!(made.strokes[0].from, DVec3::new(6.0, 2.0, 0.0));
    assert!(made.strokes[2].from.abs_diff_eq(DVec3::new(0.0, 2.0, 6.0), 1e-6), "{:?}", made.strokes[2]);
}

#[test]
fn overlay_lines_are_drawn_for_each_placement_of_a_model() {
    let places = [1.0, 2.0, 3.0].map(|x| Affine3A::from_translation(Vec3::X * x));
    let mut scene = test_scene(&[(&three_joint_asset(&places), translated(0.0, 0.0, 4.0))]);
    let dots =
        overlay("// count: 1", LINE_FUNCTION, "return Line(joint(1u), actor.position, 3.0, vec4(1.0));");
    let at = |made: Overlay| made.strokes.iter().map(|s| [s.from.x, s.from.y, s.to.z]).collect::<Vec<_>>();
    assert_eq!(at(scene.draw(&dots, &[])), [[1.0, 2.0, 4.0], [2.0, 2.0, 4.0], [3.0, 2.0, 4.0]]);
    scene.snapshot.actors[0].copies = Some(2);
    assert_eq!(scene.draw(&dots, &[]).strokes.len(), 2);
    scene.snapshot.actors[0].visible = false;
    assert_eq!(scene.draw(&dots, &[]), Overlay::default());
}

#[test]
fn overlay_lines_read_previous_positions_of_joints() {
    let places = [0.0, 9.0].map(|x| Affine3A::from_translation(Vec3::X * x));
    let mut scene = test_scene(&[(&three_joint_asset(&places), translated(0.0, 0.0, 4.0))]);
    let trail = "return Line(previous_joint(index, 1u), previous_in_world(index, vec3(1.0, 0.0, 0.0)), 1.0, vec4(1.0));";
    let trail = overlay("// count: 4\n// history: 2", LINE_FUNCTION, trail);
    assert_eq!(trail.history(&[0.0; 8]), 2);
    let at = |scene: &TestScene| {
        scene
            .draw(&trail, &[])
            .strokes
            .iter()
            .map(|s| [s.from.x, s.from.z, s.to.x, s.to.z])
            .collect::<Vec<_>>()
    };
    let now = |x: f64| [x, 4.0, x + 1.0, 4.0];
    assert_eq!(at(&scene)[..4], [now(0.0); 4], "a frame alone has none before it");
    for z in [3.0, 1.0] {
        let mut before = scene.snapshot.clone();
        before.actors[0].world_from_model = translated(0.0, 0.0, z);
        scene.before.push(before);
    }
    let then = |x: f64, z: f64| [x, z, x + 1.0, z];
    // A request beyond the declared history gives its oldest frame.
    let of_copy = |x: f64| [now(x), then(x, 3.0), then(x, 1.0), then(x, 1.0)];
    assert_eq!(at(&scene), [of_copy(0.0), of_copy(9.0)].concat());
    // An actor that was not visible then has its current position.
    scene.before[1].actors[0].visible = false;
    assert_eq!(at(&scene)[1..3], [then(0.0, 3.0), now(0.0)]);
    let without = error_message(&format!(
        "// effect: a\n// hook: overlay\n// count: 1\n{LINE_FUNCTION} {{ return Line(previous_joint(1u, 0u), vec3(0.0), 1.0, vec4(1.0)); }}"
    ));
    assert!(without.contains("no definition in scope for identifier: `previous_joint`"), "{without}");
}

#[test]
fn overlay_joints_are_found_by_name() {
    let scene = test_scene(&[(&three_joint_asset(&[]), translated(5.0, 0.0, 0.0))]);
    let header = "// count: 1\n// joint end = no_such|tip: a bone\n// joint middle = between: none of the bones\n// joint tail = tail: not there";
    let text = "return Line(joint(end()), joint(middle()) + joint(tail()), 1.0, vec4(f32(end()), f32(middle()), f32(parent(middle())), f32(actor.joints) / 4.0));";
    let made = scene.draw(&overlay(header, LINE_FUNCTION, text), &[]);
    let line = made.strokes[0];
    assert_eq!((line.from, line.to), (DVec3::new(5.0, 2.0, 0.0), DVec3::new(10.0, 1.0, 0.0)));
    assert_eq!(line.color, Vec4::new(1.0, 2.0, 0.0, 0.5));
    assert_eq!(made.left_out, ["\"\" has no joint tail for the effect's \"tail\""]);
}

#[test]
fn overlay_triangles_are_drawn_once_for_the_scene_and_over_it() {
    let asset = three_joint_asset(&[]);
    let scene = test_scene(&[(&asset, translated(-3.0, 0.0, 0.0)), (&asset, translated(4.0, 0.0, 1.0))]);
    let text =
        "return Triangle(actor.low, actor.high, vec3(f32(index)), vec4(0.1, 0.2, 0.3, 2.0 - f32(index)));";
    let made = scene
        .draw(&overlay("// count: n\n// over: thru\n// of: scene", TRIANGLE_FUNCTION, text), &[3.0, 1.0]);
    // Opacities are clamped to 1, and invisible triangles are left out.
    assert_eq!((made.triangles.len(), made.strokes.len(), made.over), (2, 0, true));
    let corners = [DVec3::new(-3.0, 0.0, 0.0), DVec3::new(4.0, 2.0, 1.0), DVec3::ONE];
    assert_eq!(
        (made.triangles[1].vertices, made.triangles[1].color),
        (corners, Vec4::new(0.1, 0.2, 0.3, 1.0))
    );
    let per_scene = overlay("// count: n\n// of: scene", TRIANGLE_FUNCTION, text);
    assert!(
        !per_scene.applies_to_actors() && overlay("// count: n", TRIANGLE_FUNCTION, text).applies_to_actors()
    );
    assert_eq!(per_scene.hook(), Hook::Overlay);
}

#[test]
fn elements_that_cannot_be_drawn_are_reported() {
    let scene = test_scene(&[(&three_joint_asset(&[]), DAffine3::IDENTITY)]);
    let made = |body: &str, n: f32| scene.draw(&overlay("// count: n", LINE_FUNCTION, body), &[n, 0.0]);
    let bad = made("return Line(vec3(0.0), vec3(1.0 / f32(index % 2u)), 1.0, vec4(1.0));", 10.0);
    // Renderers report lines whose color marks a fault.
    let faulty = |made: &Overlay| made.strokes.iter().filter(|s| !s.color.is_finite()).count();
    assert_eq!(
        (bad.strokes.len(), faulty(&bad), &bad.left_out[..]),
        (10, 5, &["5 of 10 lines have numbers that are not finite".into()][..])
    );
    // The loop is endless only for inputs that no trial uses.
    let ends = "var x = 0.0; loop { x += 1.0; if x > 9.0 && actor.time < 1.2 || actor.time > 2.0 { break; } }\nreturn Line(vec3(x), vec3(0.0), 1.0, vec4(1.0));";
    let slow = made(ends, 3.0);
    assert_eq!(
        (slow.strokes.len(), faulty(&slow), &slow.left_out[..]),
        (3, 3, &["3 of 3 lines take more than 100000 steps each".into()][..])
    );
    assert_eq!(slow.strokes.iter().find_map(|s| endless_loop(s.color.x)), Some(1));
    let slow = made(ends, 1000.0);
    assert_eq!(slow.left_out.len(), 2, "{:?}", slow.left_out);
    assert!(
        slow.left_out[1].starts_with("0 of 1000 lines are drawn, made in 20000000 steps;"),
        "{:?}",
        slow.left_out
    );
    assert_eq!(made("return Line(vec3(0.0), vec3(1.0), 0.0, vec4(1.0));", 4.0), Overlay::default());
}

#[test]
fn outline_effects_return_hulls_and_wireframes() {
    let shell = |gives: &str, body: &str| {
        effect(&format!(
            "// effect: s\n// hook: outline\n// param width = 2 in 0..9: pixels\nfn effect(p: array<f32, 8>) -> {gives} {{ {body} }}"
        ))
    };
    let p = [3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let hull = shell("InvertedHull", "return InvertedHull(2.0 * p[width], vec3(0.1, 0.2, 0.3), 1.5);");
    let expected = InvertedHull { width: 6.0, color: Vec3::new(0.1, 0.2, 0.3), lighting_mix: 1.0 };
    assert_eq!(
        (hull.hook(), hull.inverted_hull(&p), hull.wireframe(&p)),
        (Hook::Outline, Some(expected), None)
    );
    assert!(hull.applies_to_actors());
    assert_eq!(hull.inverted_hull(&[0.0; 8]), None);
    let edges = shell("Wireframe", "return Wireframe(vec3(p[width], 1.0, 0.5));");
    assert_eq!((edges.inverted_hull(&p), edges.wireframe(&p)), (None, Some(Vec3::new(3.0, 1.0, 0.5))));
    // Numbers that are not finite are kept, for the renderers to report.
    let bad = shell("InvertedHull", "return InvertedHull(2.0, vec3(0.0, 1.0 / (p[width] - 3.0), 0.0), 0.0);");
    assert_eq!(bad.inverted_hull(&p).map(|hull| hull.color.y), Some(f32::INFINITY));
    assert!(bad.inverted_hull(&[1.0; 8]).is_some_and(|hull| hull.color.is_finite()));
    let bad = shell("InvertedHull", "return InvertedHull(sqrt(2.0 - p[width]), vec3(0.0), 0.0);");
    assert!(bad.inverted_hull(&p).is_some_and(|hull| hull.width.is_nan()));
}

#[test]
fn header_errors_have_their_line_and_a_suggestion() {
    let of = |header: &str, code: &str| error_message(&format!("// effect: a\n{header}\n{code}"));
    let line = |body: &str| {
        of(
            "// hook: overlay\n// count: 4\n// param amount = 1 in 0..2: much",
            &format!("{LINE_FUNCTION} {{\n{body}\n}}"),
        )
    };
    assert_eq!(
        line("  return Line(actor.position, actor.positoin, 1.0, vec4(1.0));"),
        "my.wgsl:6:37: invalid field accessor `positoin`; did you mean \"position\"?"
    );
    let text = line("  return Line(joint(index), actor.position, p[amuont], vec4(1.0));");
    assert_eq!(
        text,
        "my.wgsl:6:47: no definition in scope for identifier: `amuont`; did you mean \"amount\"?"
    );
    let text = line("  return Line(jiont(index), actor.position, 1.0, vec4(1.0));");
    assert_eq!(text, "my.wgsl:6:15: no definition in scope for identifier: `jiont`; did you mean \"joint\"?");
    let endless = "  var x = 0u;\n  for (var i = 0; i < 4; i++) {\n    loop { x += 1u; if x == 0u { break; } }\n  }\n  return Line();";
    assert_eq!(
        line(endless),
        "my.wgsl:8:5: a line or triangle takes more than 100000 steps; does a loop never end?"
    );
    let long = "  var x = 0.0;\n  for (var i = 0; i < 3000; i++) { x += 1.0; }\n  return Line(vec3(x), vec3(0.0), 1.0, vec4(1.0));";
    let many = of("// hook: overlay\n// count: 9000", &format!("{LINE_FUNCTION} {{\n{long}\n}}"));
    assert!(
        many.starts_with("my.wgsl:4:1: 9000 times up to ") && many.ends_with("give it a smaller count"),
        "{many}"
    );
    let form = "effect must be fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line, or -> Triangle, or -> Lattice";
    let wrong =
        of("// hook: overlay\n// count: 4", "fn effect(p: array<f32, 8>) -> vec4<f32> { return vec4(0.0); }");
    assert_eq!(wrong, format!("my.wgsl:4:1: {form}"));
    let taken = of("// hook: overlay\n// count: 4", "struct ActorSample { x: f32 }");
    assert_eq!(taken, "my.wgsl:4:1: ActorSample is a type that the program declares; use another name");
    let taken = of("// hook: overlay\n// count: 4\n// param joint = 1 in 0..2: x", "");
    assert_eq!(taken, "my.wgsl:4:1: joint is a function that the program declares; use another name");
    let hull = of("// hook: outline", "fn effect(p: array<f32, 8>) -> InvertedHul { return InvertedHul(); }");
    assert_eq!(
        hull,
        "my.wgsl:3:32: no definition in scope for identifier: `InvertedHul`; did you mean \"InvertedHull\"?"
    );
}

/// The examples of the README compile unchanged, except for their names.
#[test]
fn the_examples_of_the_readme_are_effects() {
    let readme = include_str!("../../README.md");
    let examples: Vec<&str> =
        readme.split("```wgsl\n").skip(1).filter_map(|text| text.split("```").next()).collect();
    let hooks = examples.iter().map(|text| {
        let named = text.contains("// effect:");
        let text = if named { text.to_string() } else { format!("// effect: example\n{text}") };
        effect(&text).hook()
    });
    use Hook::*;
    assert_eq!(
        hooks.collect::<Vec<_>>(),
        [Pixel, Surface, Lighting, Vertex, Image, Image, Vertex, Image, Overlay, Outline, Shutter]
    );
}
