//! Effects in WGSL: results against closed forms and a CPU reference in Rust, and refused texts.

use choreo_plugin::effect::endless_loop;
use choreo_plugin::{
    EffectImage, EffectImages, EffectPlugin, ImageEffect, LightSample, LightingEffect, PixelEffect,
    SurfaceEffect, SurfaceSample, VertexEffect, VertexSample,
};
use choreo_wgsl_effect::WgslEffect;
use glam::{Vec2, Vec3, Vec4};

fn effect(text: &str) -> WgslEffect {
    WgslEffect::from_text("my.wgsl", text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// `effect` with this body, at color (0.25, 0.5, 0.75, 1), uv (0.2, 0.6), p = 0, 1, 2 …
fn run_body(code: &str) -> Vec4 {
    let text = format!(
        "// effect: a\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {{\n{code}\n}}"
    );
    let p = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
    run_pixel(&effect(&text), Vec4::new(0.25, 0.5, 0.75, 1.0), Vec2::new(0.2, 0.6), &p)
}

fn run_pixel(effect: &WgslEffect, color: Vec4, uv: Vec2, p: &[f32]) -> Vec4 {
    let mut colors = [color];
    effect.pixels(&mut colors, &[uv], p);
    colors[0]
}

fn error_message(text: &str) -> String {
    let error = WgslEffect::from_text("my.wgsl", text).err().unwrap_or_else(|| panic!("no error:\n{text}"));
    // The following lines, tested in `mistakes.rs`, show the source line with a caret.
    error.to_string().lines().next().unwrap_or_default().to_string()
}

#[test]
fn surface_samples_have_each_value_in_its_member() {
    let part = |part: &str| {
        let text = format!(
            "// effect: s\n// hook: surface\n// param k = 2 in 0..4: times\n\
             fn effect(color: vec4<f32>, surface: SurfaceSample, p: array<f32, 8>) -> vec4<f32> {{ return p[k] * vec4<f32>({part}); }}"
        );
        let made = effect(&text);
        let seen = SurfaceSample {
            world: Vec3::new(1.0, 2.0, 3.0),
            distance: 4.0,
            normal: Vec3::new(5.0, 6.0, 7.0),
            facing: 8.0,
            background: Vec3::new(9.0, 10.0, 11.0),
            joints: Vec3::new(12.0, 13.0, 14.0),
            uv: Vec2::new(15.0, 16.0),
            shadow: 17.0,
            viewer: Vec3::new(18.0, 19.0, 20.0),
        };
        let mut colors = [Vec4::ZERO];
        made.surfaces(&mut colors, &[seen], &[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        (colors[0].to_array(), SurfaceEffect::surface_inputs(&made, &[0.0; 8]))
    };
    assert_eq!(part("surface.world, surface.distance").0, [2.0, 4.0, 6.0, 8.0]);
    let (got, needs) = part("surface.normal, surface.facing");
    assert_eq!((got, needs.normals, needs.uvs), ([10.0, 12.0, 14.0, 16.0], true, false));
    assert_eq!(part("surface.background, 1.0").0, [18.0, 20.0, 22.0, 2.0]);
    let (got, needs) = part("surface.shadow");
    assert_eq!((got, needs.shadow, needs.normals), ([34.0; 4], true, false));
    assert_eq!(part("surface.viewer, 1.0").0, [36.0, 38.0, 40.0, 2.0]);
    assert_eq!(part("surface.joints, 1.0").0, [24.0, 26.0, 28.0, 2.0]);
    let (got, needs) = part("surface.uv, 0.0, 1.0");
    assert_eq!((got, needs.uvs), ([30.0, 32.0, 0.0, 2.0], true));
    let wrong = "// effect: s\n// hook: surface\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color; }";
    assert!(
        error_message(wrong).contains("effect must be fn effect(color: vec4<f32>, surface: SurfaceSample,"),
        "{}",
        error_message(wrong)
    );
}

/// The arguments of each hook's function have the values that their names say, and its result is used as its signature says.
#[test]
fn vertex_light_and_image_arguments_are_in_their_members() {
    let p = [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let vertex = |part: &str| {
        effect(&format!(
            "// effect: v\n// hook: vertex\n// reach: k\n// param k = 2 in 0..4: times\n\
             fn effect(vertex: VertexSample, p: array<f32, 8>) -> vec3<f32> {{ return p[k] * vec3<f32>({part}); }}"
        ))
    };
    let place = VertexSample {
        world: Vec3::new(1.0, 2.0, 3.0),
        normal: Vec3::new(4.0, 5.0, 6.0),
        uv: Vec2::new(7.0, 8.0),
        model: Vec3::new(9.0, 10.0, 11.0),
    };
    let parts = ["vertex.world", "vertex.normal", "vertex.uv, 0.0", "vertex.model"];
    let expected = [[2.0, 4.0, 6.0], [8.0, 10.0, 12.0], [14.0, 16.0, 0.0], [18.0, 20.0, 22.0]];
    for (part, expected) in parts.iter().zip(expected) {
        assert_eq!(vertex(part).vertex(&place, &p).to_array(), expected, "{part}");
    }
    let made = vertex("vertex.uv, 0.0");
    let needs = VertexEffect::surface_inputs(&made, &p);
    assert_eq!((made.reach(&p), made.in_model_space(), needs.uvs, needs.normals), (2.0, false, true, false));

    let lighting = |part: &str| {
        let text = format!(
            "// effect: l\n// hook: lighting\nfn effect(sample: LightSample, p: array<f32, 8>) -> vec3<f32> {{ return vec3<f32>({part}); }}"
        );
        let v = |x: f32| Vec3::new(x, x + 1.0, x + 2.0);
        let falling = LightSample {
            cosine: 1.0,
            share: 2.0,
            color: v(3.0),
            base: v(6.0),
            normal: v(9.0),
            viewer: v(12.0),
            light: v(15.0),
            lit: v(18.0),
        };
        let mut samples = [falling];
        effect(&text).lights(&mut samples, &p);
        samples[0].lit.to_array()
    };
    assert_eq!(lighting("sample.cosine, sample.share, 0.0"), [1.0, 2.0, 0.0]);
    for (name, x) in
        [("color", 3.0), ("base", 6.0), ("normal", 9.0), ("viewer", 12.0), ("light", 15.0), ("lit", 18.0)]
    {
        assert_eq!(lighting(&format!("sample.{name}")), [x, x + 1.0, x + 2.0], "{name}");
    }

    let made = effect(
        "// effect: w\n// hook: image\n// passes: 3\n// history: 2\n\
         fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> {\n\
         return vec4(picture(at + vec2(1, 0)).x, original(vec2(-9, 9)).x, previous(2u, at).x, f32(pass_number) + 10.0 * f32(picture_size().x)) + previous(9u, at) * 0.0; }",
    );
    assert_eq!((made.passes(), made.history(&p)), (3, 2));
    let rows = |x: f32| (0..4).map(|i| Vec4::splat(x + i as f32)).collect::<Vec<_>>();
    let all = [rows(0.0), rows(10.0), rows(20.0), rows(30.0)];
    let [now, original, one, two] = std::array::from_fn(|i| EffectImage { size: [2, 2], rgba: &all[i] });
    let pictures = EffectImages { now, original, passes: &[], before: &[one, two], scene: None };
    // Outside of the image the nearest border pixel is read: here the lower left one of the original.
    let mut row = [Vec4::ZERO; 2];
    made.image_row(&pictures, 1, 2, &p, &mut row);
    assert_eq!(row[0], Vec4::new(3.0, 12.0, 32.0, 22.0));
}

#[test]
fn effects_may_not_declare_names_of_the_program() {
    let text = "// effect: w\n// hook: image\nfn picture(at: vec2<i32>) -> vec4<f32> { return vec4(0.0); }\n\
         fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> { return picture(at); }";
    let expected = "my.wgsl:3:1: picture is a function that the program declares; use another name";
    assert_eq!(error_message(text), expected);
    let text = "// effect: w\n// texture ink = ink.png: t\n\
         fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return ink(uv); }";
    assert_eq!(
        error_message(text),
        "my.wgsl:2:1: texture ink: \"ink.png\": an effect without a file cannot read other files"
    );
    let text = "// effect: w\n// hook: vertex\n// reach: 1\n\
         fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color; }";
    assert!(
        error_message(text)
            .contains("effect must be fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32>")
    );
}

#[test]
fn operators_and_built_in_functions_match_the_wgsl_specification() {
    let cases: [(&str, [f32; 4]); 16] = [
        ("return color.bgra;", [0.75, 0.5, 0.25, 1.0]),
        ("return vec4(uv, p[7] % 4.0, (-p[7] - 0.5) % 2.0);", [0.2, 0.6, 3.0, -1.5]),
        (
            "return vec4(f32(i32(p[7]) / 2), f32(i32(-p[7]) / 2), f32(u32(p[7]) / 2u), f32(i32(-p[7]) % 4));",
            [3.0, -3.0, 3.0, -3.0],
        ),
        (
            "let z = i32(p[0]); return vec4(f32(7 / z), f32(7 % z), f32(1u << 3u), f32(-8 >> 1u));",
            [7.0, 0.0, 8.0, -4.0],
        ),
        ("return vec4(f32(i32(2.9)), f32(u32(-2.0)), f32(i32(-2.9)), f32(true));", [2.0, 0.0, -2.0, 1.0]),
        ("return select(vec4(1.0), vec4(2.0), vec4(p[0]) < color);", [2.0, 2.0, 2.0, 2.0]),
        (
            "return vec4(mix(p[1], p[3], 0.25), step(0.5, uv.x), smoothstep(0.0, p[1], color.y), clamp(p[5], 0.0, 2.0));",
            [1.5, 0.0, 0.5, 2.0],
        ),
        (
            "return vec4(fract(-color.x), floor(-color.y), sign(-p[3]), round(p[2] + 0.5));",
            [0.75, -1.0, -1.0, 2.0],
        ),
        (
            "return vec4(dot(color.rgb, vec3(1.0)), length(vec2(p[3], 4.0)), distance(vec2(p[1]), vec2(4.0, 5.0)), 1.0);",
            [1.5, 5.0, 5.0, 1.0],
        ),
        (
            "return vec4(cross(vec3(p[1], 0.0, 0.0), vec3(0.0, 1.0, 0.0)), normalize(vec2(0.0, p[7])).y);",
            [0.0, 0.0, 1.0, 1.0],
        ),
        (
            "let m = mat2x2(p[1], 2.0, 3.0, 4.0); return vec4(m * vec2(1.0, 10.0), vec2(1.0, 10.0) * m);",
            [31.0, 42.0, 21.0, 43.0],
        ),
        (
            "let m = mat2x2(p[1], 2.0, 3.0, 4.0) * mat2x2(0.0, p[1], 1.0, 0.0); return vec4(m[0], m[1]);",
            [3.0, 4.0, 1.0, 2.0],
        ),
        (
            "return vec4(p[u32(p[3])], p[100u % 8u], f32(bitcast<u32>(p[1]) >> 23u), 0.0);",
            [3.0, 4.0, 127.0, 0.0],
        ),
        (
            "return vec4(f32(all(color > vec4(0.2))), f32(any(color > vec4(0.9))), f32(!true), f32(~0u & 255u));",
            [1.0, 1.0, 0.0, 255.0],
        ),
        (
            "return vec4(pow(p[2], 3.0), sqrt(p[4] * p[4]), exp2(p[3]), log2(p[4] * 2.0));",
            [8.0, 4.0, 8.0, 3.0],
        ),
        (
            "return vec4(f32(max(-1, i32(p[2]))), f32(abs(i32(-p[3]))), f32(min(3u, u32(p[2]))), f32(clamp(i32(9.0 * p[1]), 0, 4)));",
            [2.0, 3.0, 2.0, 4.0],
        ),
    ];
    for (code, expected) in cases {
        assert_eq!(run_body(code).to_array(), expected, "{code}");
    }
}

#[test]
fn loops_branches_variables_and_functions_are_evaluated() {
    let sum = "var s = 0.0; for (var i = 0u; i < 8u; i++) { if i == 3u { continue; } if i == 6u { break; } s += p[i]; } return vec4(s);";
    assert_eq!(run_body(sum).x, 0.0 + 1.0 + 2.0 + 4.0 + 5.0);
    let array =
        "var a = array<vec2<f32>, 3>(); a[1] = uv; a[2].y = 9.0; let k = u32(p[2]); return vec4(a[1], a[k]);";
    assert_eq!(run_body(array).to_array(), [0.2, 0.6, 0.0, 9.0]);
    let switched = "switch u32(p[2]) { case 1u: { return vec4(1.0); } case 2u, 3u: { return vec4(2.0); } default: { return vec4(3.0); } }";
    assert_eq!(run_body(switched).x, 2.0);
    let text = "// effect: a
        const weights = array<f32, 3>(0.2126, 0.7152, 0.0722);
        struct Pair { a: vec2<f32>, b: f32 }
        fn pair(x: f32) -> Pair { return Pair(vec2(x, 2.0 * x), 3.0 * x); }
        fn luma(c: vec3<f32>) -> f32 { var l = 0.0; for (var i = 0; i < 3; i++) { l += weights[i] * c[i]; } return l; }
        fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
            var q = pair(p[1]);
            q.b += 1.0;
            return vec4(q.a, q.b, luma(vec3(1.0)));
        }";
    let got = run_pixel(&effect(text), Vec4::ZERO, Vec2::ZERO, &[0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(got.abs_diff_eq(Vec4::new(5.0, 10.0, 16.0, 1.0), 1e-6), "{got}");
}

#[test]
fn parameter_names_are_index_constants() {
    let text = "// effect: tint\n// about: one color for all\n// param red = 0.5 in 0..1: how red\n// param blue = 0.25 in 0..1: how blue\n\
        fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return vec4(p[red], 0.0, p[blue], color.a); }";
    let e = effect(text);
    assert_eq!((e.manifest().name.as_str(), e.manifest().options.len()), ("tint", 2));
    let p = [0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(run_pixel(&e, Vec4::ONE, Vec2::ZERO, &p), Vec4::new(0.1, 0.0, 0.2, 1.0));
}

#[test]
fn errors_have_the_line_of_the_author() {
    let header = "// effect: a\n";
    let good = "fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32>";
    assert_eq!(
        error_message("fn effect() {}"),
        "my.wgsl:1:1: the header comment must name the effect: // effect: NAME"
    );
    assert_eq!(
        error_message(&format!("{header}fn other() {{}}")),
        format!("my.wgsl:1:1: there is no function effect; write {good}")
    );
    assert_eq!(
        error_message(&format!("{header}\nfn effect(c: f32) {{}}")),
        format!("my.wgsl:3:1: effect must be {good}")
    );
    let text = error_message(&format!("{header}{good} {{\n  return colr;\n}}"));
    assert!(text.starts_with("my.wgsl:3:10: ") && text.contains("colr"), "{text}");
    let text = error_message(&format!("{header}{good} {{\n  return 1;\n}}"));
    assert!(text.starts_with("my.wgsl:"), "{text}");
    let text = error_message(&format!("{header}{good} {{\n  return color * dpdx(uv.x);\n}}"));
    assert!(text.starts_with("my.wgsl:3:"), "{text}");
    let text = error_message(&format!("{header}var<private> x: f32;\n{good} {{\n  return color * x;\n}}"));
    assert!(text.starts_with("my.wgsl:2:1: not supported: global variable x"), "{text}");
    let text = error_message(&format!(
        "{header}{good} {{\n  loop {{ if uv.x > 9.0 {{ break; }} }}\n  return color;\n}}"
    ));
    assert_eq!(text, "my.wgsl:3:3: a pixel takes more than 100000 steps; does a loop never end?");
}

/// A loop that is endless for some pixels only: these get a fault with the loop's number in place of a color, the others their color.
#[test]
fn endless_loops_are_stopped_and_reported() {
    let text = "// effect: rings
fn turns(x: f32) -> f32 {
    var y = x;
    loop { if y >= 1.0 { break; } if x > 0.1 { y += 0.25; } }
    return y;
}
fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {
    var sum = 0.0;
    for (var i = 0; i < 4; i++) { sum += p[i]; }
    return vec4(turns(uv.x), sum, color.ba);
}";
    let made = effect(&text.replace("x > 0.1", "(x < 0.9 && x > 0.1) || x == 0.0 || x > 0.95"));
    assert_eq!(made.loops(), ["my.wgsl:4:5"]);
    for (x, expected) in [(0.25, Some(1.0)), (0.05, None), (1.0, Some(1.0)), (0.9375, None)] {
        let got = run_pixel(&made, Vec4::ONE, Vec2::new(x, 0.0), &[0.5; 8]);
        match expected {
            Some(red) => assert_eq!(got.to_array(), [red, 2.0, 1.0, 1.0], "{x}"),
            None => assert_eq!(endless_loop(got.x), Some(1), "{x}"),
        }
    }
    // A row whose pixels take different branches gives the result of each pixel alone.
    let uv: Vec<Vec2> = (0..64).map(|i| Vec2::new(i as f32 / 64.0, 0.0)).collect();
    let mut row = vec![Vec4::ONE; uv.len()];
    made.pixels(&mut row, &uv, &[0.5; 8]);
    for (got, uv) in row.iter().zip(&uv) {
        let alone = run_pixel(&made, Vec4::ONE, *uv, &[0.5; 8]);
        assert_eq!(got.to_array().map(f32::to_bits), alone.to_array().map(f32::to_bits), "{uv}");
    }
    assert!(row.iter().any(|c| c.x == 1.0) && row.iter().any(|c| endless_loop(c.x).is_some()));
}
