//! Error messages of faulty effects: file, line, column, a caret, and types as WGSL writes them.

use choreo_wgsl_effect::{EffectError, WgslEffect};

const FUNCTION: &str = "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32>";

/// The text of an effect on pixels; the body of its function begins at line 3.
fn pixel_effect(body: &str) -> String {
    format!("// effect: a\n{FUNCTION} {{\n{body}\n}}\n")
}

fn compile_error(text: &str) -> EffectError {
    WgslEffect::from_text("my.wgsl", text).err().unwrap_or_else(|| panic!("no error:\n{text}"))
}

/// Function texts of an effect on pixels, with their messages.
const BODIES_AND_MESSAGES: &[(&str, &str)] = &[
    ("    return vec4(color.rgb, 1.0) * uv;", "3:12: * cannot work with vec4<f32> and vec2<f32>"),
    ("    return color.rgb;", "3:12: effect returns vec4<f32>, this value is vec3<f32>"),
    ("    return colr;", "3:12: no definition in scope for identifier: `colr`; did you mean \"color\"?"),
    ("    let x = uv.x;", "2:1: effect returns vec4<f32>, but one path through it ends without return"),
    (
        "    let x = uv.x;\n    x = 1.0;\n    return color;",
        "4:5: invalid left-hand side of assignment; consider declaring `x` with `var` instead of `let`",
    ),
    (
        "    return smothstep(0.0, 1.0, color);",
        "3:12: no definition in scope for identifier: `smothstep`; did you mean \"smoothstep\"?",
    ),
    ("    return color + uv;", "3:12: + cannot work with vec4<f32> and vec2<f32>"),
    ("    return vec4(uv, 1.0);", "3:12: vec4<f32> is made of 4 values, 3 are given"),
    ("    return vec4(1.0, 1.0, 1.0, 1.0, 1.0);", "3:12: constructor expects 4 components, found 5"),
    ("    return vec4(uv.z);", "3:20: invalid field accessor `z`"),
    ("    return color[5];", "3:5: the index is out of bounds"),
    (
        "    return vec4(cross(uv, uv), 1.0);",
        "3:17: wrong type passed as argument #1 to `cross`; argument #1 has type `vec2<f32>`; allowed: vec3<f32>",
    ),
    (
        "    return vec4(dot(color, uv));",
        "3:17: inconsistent type passed as argument #2 to `dot`; argument #2 has type vec2<f32>; allowed: vec4<f32>",
    ),
    ("    return clamp(color, 0.0);", "3:12: wrong number of arguments: expected 3, found 2"),
    (
        "    return clamp(color, vec4(0.0), vec4(1.0), vec4(1.0));",
        "3:47: too many arguments passed to `clamp`; the `clamp` function accepts at most 3 argument(s)",
    ),
    ("    if uv.x { return color; }\n    return color;", "3:8: a condition is bool, this value is f32"),
    (
        "    var x = 1;\n    x = 1.5;\n    return color;",
        "4:9: automatic conversions cannot convert elements of `float` to `i32`",
    ),
    (
        "    var x: f32 = uv;\n    return color;",
        "3:9: the type of `x` is expected to be `f32`, but got `vec2<f32>`",
    ),
    (
        "    let b = uv.x && true;\n    return color;",
        "3:5: the operator cannot work with values of these types",
    ),
    ("    return -true;", "3:12: the operator cannot work with this constant"),
    ("    let b = !uv.x;\n    return color;", "3:13: ! cannot work with f32"),
    (
        "    return select(color, uv, true);",
        "3:12: select chooses between values of one type, not vec4<f32> and vec2<f32>",
    ),
    ("    return select(color, color, uv.x);", "3:12: the condition of select is bool, this value is f32"),
    ("    return color[uv.x];", "3:12: an index is i32 or u32, this value is f32"),
    ("    return uv.x[0] * color;", "3:5: this value has neither elements nor members"),
    ("    switch uv.x { default: { } }\n    return color;", "3:12: invalid `switch` selector"),
    ("    switch 1 { case 1: { } }\n    return color;", "3:5: switch has no default case"),
    (
        "    switch 1 { case 1: { } case 1: { } default: { } }\n    return color;",
        "3:5: switch has two cases with the same value",
    ),
    ("    break;\n    return color;", "3:5: break is outside of a loop or switch"),
    ("    return;", "3:5: effect returns vec4<f32>, this return has no value"),
    ("    let i = 1 + 1.5u;\n    return color;", "3:20: expected `;`, found \"u\""),
    ("    let i = 1u + 1i;\n    return color;", "3:13: + cannot work with u32 and i32"),
    ("    let x = 1.0 / 0;\n    return color;", "3:13: this division has no finite result"),
    ("    let x = 1u << 40u;\n    return color;", "3:13: an integer of 32 bits is shifted by more than 31"),
    (
        "    let m = mat2x2<f32>(1.0, 2.0, 3.0);\n    return color;",
        "3:13: type `mat2x2<f32>` is not constructible",
    ),
    (
        "    let m = mat3x3<f32>() * color;\n    return color;",
        "3:13: * cannot work with mat3x3<f32> and vec4<f32>",
    ),
    (
        "    let a = array<f32, 2>(1.0, 2.0) * 2.0;\n    return color;",
        "3:39: this number has another type than the value beside it",
    ),
    (
        "    return textureLoad(color, vec2(0), 0);",
        "3:24: expected an image, but found `color` which is not an image",
    ),
    ("    return textureSample(image, color, uv);", "3:26: no definition in scope for identifier: `image`"),
    ("    return dpdx(color);", "3:12: not supported: a derivative: an effect is a function of one pixel"),
    ("    discard;\n    return color;", "3:5: not supported: discard: an effect gives every pixel a color"),
    (
        "    color.x = 1.0;\n    return color;",
        "3:5: invalid left-hand side of assignment; consider declaring `color` with `var` instead of `let`",
    ),
    (
        "    var c = color;\n    c.xy = uv;\n    return c;",
        "4:5: invalid left-hand side of assignment; WGSL does not support assignments to swizzles; consider assigning each component individually",
    ),
    ("    return p[red] * color", "4:1: expected `;`, found \"}\""),
    ("    return color * (1.0;", "3:24: expected `)`, found \";\""),
    (
        "    return sin(true) * color;",
        "3:16: wrong type passed as argument #1 to `sin`; argument #1 has type `bool`; allowed: f32, vec2<f32>, vec3<f32>, vec4<f32>",
    ),
    (
        "    return pow(color, 2.0);",
        "3:23: inconsistent type passed as argument #2 to `pow`; argument #2 has type float; allowed: vec4<f32>",
    ),
    ("    let x = f32(uv);\n    return color;", "3:17: cannot cast a vec2<f32> to a f32"),
    ("    let x: f64 = 1.0;\n    return color;", "3:18: effects have the scalars f32, i32, u32 and bool"),
    ("    let x: float = 1.0;\n    return color;", "3:12: no definition in scope for identifier: `float`"),
    ("    let uv = uv;\n    let uv = uv;\n    return color;", "3:9: redefinition of `uv`"),
    ("    return effect(color, uv, p);", "3:12: declaration of `effect` is recursive"),
    ("    return color == color;", "3:12: effect returns vec4<f32>, this value is vec4<bool>"),
    ("    return vec4(p);", "3:12: type `vec4` is not constructible"),
    ("    return p;", "3:5: effect returns vec4<f32>, this value is array<f32, 8>"),
    ("    return isNan(color.x) * color;", "3:12: no definition in scope for identifier: `isNan`"),
    ("    uv.x + 1.0;\n    return color;", "3:10: expected assignment or increment/decrement, found \"+\""),
    (
        "    uv.x++;\n    return color;",
        "3:5: increment/decrement operation requires reference type to be one of i32 or u32",
    ),
    ("    return color.xyzwx;", "3:18: invalid field accessor `xyzwx`"),
    ("    return color.xg;", "3:18: invalid field accessor `xg`"),
    (
        "    for (var i = 0; i < 1.5; i++) { }\n    return color;",
        "3:25: this number has another type than the value beside it",
    ),
    ("    while 1 { }\n    return color;", "3:11: a condition is bool, this value is i32"),
];

/// Texts below the header, with their messages. FUNCTION stands for the declaration of an effect on pixels.
const TEXTS_AND_MESSAGES: &[(&str, &str)] = &[
    (
        "fn half(x: f32) -> f32 { return 0.5 * x; }\nFUNCTION { return color * half(uv); }",
        "3:92: half: x is f32, this value is vec2<f32>",
    ),
    (
        "fn half(x: f32) -> f32 { return 0.5 * x; }\nFUNCTION { return color * half(1.0, 2.0); }",
        "3:92: half takes 1 arguments, 2 are given",
    ),
    (
        "fn half(x: f32) { }\nFUNCTION { return color * half(1.0); }",
        "3:92: function does not return any value; perhaps you meant to call the function in a separate statement?",
    ),
    (
        "fn a(x: f32) -> f32 { return b(x); }\nfn b(x: f32) -> f32 { return a(x); }\nFUNCTION { return color; }",
        "3:30: declaration of `a` is cyclic",
    ),
    (
        "struct Pair { a: f32, b: vec2<f32> }\nFUNCTION { let q = Pair(uv, 1.0); return color; }",
        "3:94: automatic conversions cannot convert `float` to `vec2<f32>`",
    ),
    (
        "struct Pair { a: f32, b: vec2<f32> }\nFUNCTION { let q = Pair(1.0, uv); return color * q; }",
        "3:100: the operator cannot work with values of these types",
    ),
    (
        "struct Pair { a: f32, b: vec2<f32> }\nFUNCTION { let q = Pair(1.0, uv); return color * q.c; }",
        "3:117: invalid field accessor `c`",
    ),
    (
        "struct Nothing { }\nFUNCTION { return color; }",
        "2:1: the type Nothing: a struct needs at least one member",
    ),
    (
        "const a: f32 = vec2(1.0);\nFUNCTION { return color; }",
        "2:7: the type of `a` is expected to be `f32`, but got `vec2<float>`",
    ),
    ("const a = b;\nFUNCTION { return color; }", "2:11: no definition in scope for identifier: `b`"),
    ("FUNCTION { return color; }\nfn effect() { }", "3:4: redefinition of `effect`"),
    (
        "@fragment\nFUNCTION { return color; }",
        "3:77: effect: an effect has no entry points; leave out its attribute",
    ),
    (
        "@group(0) @binding(0) var image: texture_2d<f32>;\nFUNCTION { return color; }",
        "2:23: not supported: global variable image: an effect is a function of one pixel and has no variables of its own",
    ),
    (
        "fn set(x: ptr<function, f32>) { *x = 1.0; }\nFUNCTION { var y = 0.0; set(&y); return color * y; }",
        "2:4: name `set` is a reserved keyword",
    ),
    ("FUNCTION { var a: array<f32>; return color; }", "2:77: a: a variable cannot have the type array<f32>"),
    (
        "override k: f32 = 1.0;\nFUNCTION { return color * k; }",
        "3:92: not supported: an override; write const, or a parameter in the header comment",
    ),
    (
        "fn effect(@location(0) color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color; }",
        "2:1: color has an attribute; parameters of an effect have none",
    ),
];

#[test]
fn each_error_is_worded_in_the_terms_of_wgsl() {
    let bodies = BODIES_AND_MESSAGES.iter().map(|(body, expected)| (pixel_effect(body), *expected));
    let texts = TEXTS_AND_MESSAGES
        .iter()
        .map(|(text, expected)| (format!("// effect: a\n{}", text.replace("FUNCTION", FUNCTION)), *expected));
    let mut wrong = Vec::new();
    for (text, expected) in bodies.chain(texts) {
        let error = compile_error(&text);
        if format!("{}:{}: {}", error.line, error.column, error.message) != expected {
            wrong.push(format!("{expected}\nbut got: {error}"));
        }
        for internal in ["naga", "Abstract", "Handle", "Expression", "["] {
            assert!(!error.message.contains(internal), "{error}");
        }
        // The caret is below the character at the reported column.
        let shown = error.to_string();
        let [_, code, caret] = shown.lines().collect::<Vec<_>>()[..] else { panic!("{shown}") };
        let line = text.lines().nth(error.line - 1).unwrap();
        let below = code.chars().nth(caret.chars().count() - 1);
        assert_eq!(below, line.chars().nth(error.column - 1), "{shown}");
        assert!(line.contains(code.trim()), "{shown}");
    }
    assert!(wrong.is_empty(), "{} are wrong:\n{}", wrong.len(), wrong.join("\n"));
}

/// Bodies of an effect on images, with their messages.
#[test]
fn misspelt_and_misplaced_scene_inputs_get_suggestions() {
    let image = |body: &str| {
        format!(
            "// effect: a\n// hook: image\n\
             fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> {{\n{body}\n}}\n"
        )
    };
    for (body, message) in [
        (
            "    return vec4(depht_at(at));",
            "4:17: no definition in scope for identifier: `depht_at`; did you mean \"depth_at\"?",
        ),
        (
            "    return vec4(normals_at(at), 1.0);",
            "4:17: no definition in scope for identifier: `normals_at`; did you mean \"normal_at\"?",
        ),
        (
            "    return vec4(depth_at(vec2<f32>(at)));",
            "4:26: depth_at: at is vec2<i32>, this value is vec2<f32>",
        ),
        ("    return vec4(depth_at());", "4:17: depth_at takes 1 arguments, 0 are given"),
        ("    return vec4(frame());", "4:12: effect returns vec4<f32>, this value is vec4<u32>"),
        (
            "    return vec4(world_normal(at), 1.0);",
            "4:17: no definition in scope for identifier: `world_normal`; functions of the scene: normal_at, view_from_world, world_from_view",
        ),
        (
            "    return previous(1u, at);",
            "4:12: no definition in scope for identifier: `previous`; previous() needs a line // history: FRAMES",
        ),
    ] {
        let text = compile_error(&image(body)).to_string();
        println!("{text}");
        assert!(text.contains(message), "{body}: {text}");
    }
    // Effects of other hooks cannot read images of the scene.
    let text = compile_error(&pixel_effect("    return vec4(depth_at(vec2(0)));")).to_string();
    let hint = "3:17: no definition in scope for identifier: `depth_at`; depth_at() is an input of effects with // hook: image";
    assert!(text.contains(hint), "{text}");
    // For functions and types of another hook, the message names the line of the header that adds them; a parameter is an element of p.
    let seen = compile_error(&pixel_effect("    return vec4(color.rgb, f32(SurfaceSample(color.rgb).x));"))
        .to_string();
    assert!(seen.contains("`SurfaceSample`; SurfaceSample needs // hook: surface"), "{seen}");
    let picture = compile_error(&pixel_effect("    return picture(vec2(1));")).to_string();
    assert!(
        picture.contains(
            "3:12: no definition in scope for identifier: `picture`; picture() needs // hook: image"
        ),
        "{picture}"
    );
    let slope = "// effect: a\n// param slope = 1 in 0..2: how steep\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return color * p.slope;\n}";
    let slope = compile_error(slope).to_string();
    assert!(
        slope.contains("invalid field accessor `slope`; write p[slope], or declare p: Parameters"),
        "{slope}"
    );
    // A function that the author declares is not a scene input.
    let own = "// effect: a\nfn time() -> f32 { return 0.5; }\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color * time(); }";
    assert!(WgslEffect::from_text("my.wgsl", own).is_ok());
    assert!(
        WgslEffect::from_text(
            "my.wgsl",
            &image("    return vec4(frame_of(f32(frame())));\n}\nfn frame_of(f: f32) -> f32 { return f;")
        )
        .is_ok()
    );
}

/// Errors with parameters in the struct `Parameters`, with their places.
#[test]
fn errors_with_typed_parameters_have_their_place() {
    const HEADER: &str = "// effect: a\n// param tint = color(gold): x\n// param mode = soft of soft|hard: x\n\
                        // param fall = curve(0 0, 1 1) in 0..1: x\n";
    const FUNCTION: &str = "fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32>";
    let good = format!("{HEADER}{FUNCTION} {{ return vec4(p.tint * curve_at(p.fall, uv.x), f32(p.mode)); }}");
    assert!(WgslEffect::from_text("my.wgsl", &good).is_ok());
    for (body, message) in [
        ("{ return vec4(p.tnit, 1.0); }", "5:88: invalid field accessor `tnit`; did you mean \"tint\"?"),
        (
            "{ return vec4(p.tint, f32(p.mode == MODE_HRAD)); }",
            "5:108: no definition in scope for identifier: `MODE_HRAD`; did you mean \"MODE_HARD\"?",
        ),
    ] {
        let error = compile_error(&format!("{HEADER}{FUNCTION} {body}"));
        assert_eq!(format!("{}:{}: {}", error.line, error.column, error.message), message);
    }
    let own = |declared: &str| {
        compile_error(&format!("{HEADER}{declared}\n{FUNCTION} {{ return color * p.tint.x; }}")).message
    };
    let taken =
        |name: &str, what: &str| format!("{name} is {what} that the program declares; use another name");
    assert_eq!(own("fn tint() -> f32 { return 1.0; }"), taken("tint", "a parameter"));
    assert_eq!(own("struct Parameters { x: f32 }"), taken("Parameters", "a type"));
    assert_eq!(own("fn curve_at(x: f32) -> f32 { return x; }"), taken("curve_at", "a function"));
    let array = format!("{HEADER}{} {{ return color; }}", FUNCTION.replace("Parameters", "array<f32, 8>"));
    assert_eq!(
        compile_error(&array).message,
        format!("effect must be {FUNCTION}"),
        "20 numbers do not fit in 8"
    );
}

/// The parser continues into the declarations that the program appends if a brace is missing.
#[test]
fn a_missing_brace_is_reported_at_the_end_of_the_text() {
    for body in [
        "return vec4(depth_at(at));",
        "if at.x > 3 { return vec4(f32(pass_number)); }\n    return vec4(p[0]);",
    ] {
        let text = format!(
            "// effect: a\n// hook: image\n// param amount = 1 in 0..2: how much\n\
             fn effect(at: vec2<i32>, pass_number: u32, p: array<f32, 8>) -> vec4<f32> {{\n    {body}\n"
        );
        assert!(WgslEffect::from_text("my.wgsl", &format!("{text}}}\n")).is_ok());
        let error = compile_error(&text);
        assert_eq!(error.message, "missing `}`: the text ends within the braces that line 4 opens");
        assert_eq!(error.line, 4 + body.lines().count(), "{error}");
    }
}

/// An effect whose passes have textures: lines of its header, and functions.
fn effect_with_passes(lines: &[&str], functions: &str) -> String {
    let lines: String = lines.iter().map(|line| format!("// pass {line}\n")).collect();
    format!("// effect: a\n// hook: image\n{lines}{functions}")
}

/// The function of a pass that returns a value.
fn pass_function(name: &str, value: &str) -> String {
    format!("fn {name}(at: vec2<i32>, p: Parameters) -> vec4<f32> {{ return {value}; }}\n")
}

#[test]
fn errors_of_passes_with_textures_have_their_place() {
    let black = "vec4(0.0)";
    let (wide, fine) = ("wide = 1/4: a", "fine = 1: b");
    let text = |lines: &[&str], functions: &[(&str, &str)]| {
        effect_with_passes(
            lines,
            &functions.iter().map(|(name, value)| pass_function(name, value)).collect::<String>(),
        )
    };
    let of_header =
        "1: write // pass NAME = 1/2: ABOUT, with 1 or 1/2 to 1/64, or = halve PARAMETER to PIXELS: ABOUT";
    for (text, expected) in [
        (
            text(&[wide], &[("wide", black), ("effect", "wide_at(at) + wdie_uv(vec2(0.5))")]),
            "5:77: no definition in scope for identifier: `wdie_uv`; did you mean \"wide_uv\"?",
        ),
        (
            text(&[wide], &[("wide", black), ("effect", "wide_at(at) + halo_at(at)")]),
            "5:77: no definition in scope for identifier: `halo_at`; a texture halo needs a line // pass halo = 1/2: ABOUT",
        ),
        (
            text(
                &[wide, fine],
                &[("wide", "fine_at(at)"), ("fine", black), ("effect", "wide_at(at) + fine_at(at)")],
            ),
            "5:61: the pass fine runs after wide; move its line above that of wide",
        ),
        (
            text(
                &[wide, fine],
                &[("wide", "fine_at(at)"), ("fine", "wide_at(at)"), ("effect", "wide_at(at)")],
            ),
            "5:61: the passes wide and fine read each other; a pass reads those declared above it",
        ),
        (
            text(&[wide], &[("wide", "wide_uv(vec2(0.0))"), ("effect", "wide_at(at)")]),
            "4:61: the pass wide reads its own texture; a pass reads those declared above it",
        ),
        (
            text(&[wide, fine], &[("wide", black), ("fine", "wide_at(at)"), ("effect", "wide_at(at)")]),
            "4:9: nothing reads the texture of the pass fine; call fine_at or fine_uv, or leave out this line",
        ),
        (
            text(&[wide], &[("effect", "wide_at(at)")]),
            "3:9: the pass wide has no function; write fn wide(at: vec2<i32>, p: Parameters) -> vec4<f32>",
        ),
        (
            effect_with_passes(&[wide], "fn wide(at: vec2<i32>) -> vec4<f32> { return vec4(0.0); }\n")
                + &pass_function("effect", "wide_at(at)"),
            "4:1: wide must be fn wide(at: vec2<i32>, p: Parameters) -> vec4<f32>",
        ),
        (text(&["wide = 2: a"], &[]), &format!("3:{of_header}")),
        (text(&["wide = 1/65: a"], &[]), &format!("3:{of_header}")),
        (text(&["wide = halve far to 8: a"], &[]), &format!("3:{of_header}")),
        (text(&[wide, "wide = 1/2: b"], &[]), "4:1: wide is declared twice"),
        (
            text(&["depth = 1/2: a"], &[]),
            "3:1: the program has a function depth_at; give the pass depth another name",
        ),
        (
            text(&["picture = 1/2: a"], &[]),
            "3:1: the program has a function picture; give the pass picture another name",
        ),
        (
            text(&[wide], &[]).replace("// hook: image", "// about: x"),
            "3:1: pass is only for effects with hook: image",
        ),
        (
            text(&[wide], &[]).replace("// hook: image", "// hook: image\n// passes: 2"),
            "3:1: passes is only for effects without lines // pass NAME, which give it for each pass",
        ),
        (
            text(&["wide = 1/2: x"], &[("wide", black), ("effect", "wide_at(at)"), ("wide_at", black)]),
            "6:1: wide_at is a function that the program declares; use another name",
        ),
    ] {
        let error = compile_error(&text);
        assert_eq!(format!("{}:{}: {}", error.line, error.column, error.message), expected, "{text}");
    }
    // Reading a texture through another function counts; the number of passes and of read textures is limited.
    let through =
        effect_with_passes(&[wide], "fn both(at: vec2<i32>) -> vec4<f32> { return 2.0 * wide_at(at); }\n")
            + &pass_function("wide", black)
            + &pass_function("effect", "both(at) + picture_uv(uv_at(at))");
    assert!(WgslEffect::from_text("my.wgsl", &through).is_ok());
    let many: Vec<String> = (0..16).map(|i| format!("t{i} = 1: a")).collect();
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    assert_eq!(compile_error(&text(&many, &[])).message, "an effect has at most 15 passes with textures");
    let all: Vec<String> = (0..9).map(|i| pass_function(&format!("t{i}"), black)).collect();
    let sum: Vec<String> = (0..9).map(|i| format!("t{i}_at(at)")).collect();
    let nine = effect_with_passes(&many[..9], &(all.concat() + &pass_function("effect", &sum.join(" + "))));
    assert_eq!(compile_error(&nine).message, "effect reads 9 textures of passes, at most 8");
}
