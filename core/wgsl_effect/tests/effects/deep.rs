//! Deeply nested texts are refused, with their place, before naga or the evaluator could overflow a thread's stack.

use choreo_plugin::PixelEffect;
use choreo_wgsl_effect::{EffectError, WgslEffect};
use glam::{Vec2, Vec4};
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Stack size: a quarter of the default of threads.
const STACK_BYTES: usize = 512 << 10;

const NESTING_KINDS: [&str; 17] = [
    "chain",
    "comparisons",
    "else_ifs",
    "brackets",
    "not",
    "minus",
    "blocks",
    "ifs",
    "loops",
    "calls",
    "members",
    "indices",
    "arrays",
    "functions",
    "functions_back",
    "constants",
    "structs",
];

/// An effect of one kind of nesting, `n` deep.
fn nested_text(kind: &str, n: usize) -> String {
    let r = |text: &str| text.repeat(n);
    let body = match kind {
        "chain" => format!("return vec4(1.0{});", r("+uv.x")),
        "comparisons" => format!("var b = true{}; return color;", r("==true")),
        "else_ifs" => format!(
            "if uv.x < 0.0 {{ return color; }}{} return color;",
            r(" else if uv.x < 0.1 { return color; }")
        ),
        "brackets" => format!("return vec4({}uv.x{});", r("("), r(")")),
        "not" => format!("let b = {}true; return color;", r("!")),
        "minus" => format!("let b = {}uv.x; return color;", r("- ")),
        "blocks" => format!("{} {} return color;", r("{"), r("}")),
        "ifs" => format!("{} {} return color;", r("if uv.x < 0.5 {"), r("}")),
        "loops" => format!("{} {} return color;", r("for (var i = 0; i < 1; i++) {"), r("}")),
        "calls" => format!("return vec4({}uv.x{});", r("sin("), r(")")),
        "members" => format!("return color{};", r(".xyzw")),
        "indices" => format!("var a = uv.x; let z = color{}; return color;", r("[0]")),
        "arrays" => format!("var a: {}f32{}; return color;", r("array<"), r(",1>")),
        _ => "return vec4(g0(uv.x));".into(),
    };
    let below: Vec<String> = match kind {
        "functions" => {
            (0..n).map(|i| format!("fn g{i}(x: f32) -> f32 {{ return g{}(x); }}\n", i + 1)).collect()
        }
        "functions_back" => {
            (0..n).rev().map(|i| format!("fn g{i}(x: f32) -> f32 {{ return g{}(x); }}\n", i + 1)).collect()
        }
        "constants" => (0..n).map(|i| format!("const c{i} = c{};\n", i + 1)).collect(),
        "structs" => (0..n).map(|i| format!("struct S{i} {{ a: S{} }}\n", i + 1)).collect(),
        _ => Vec::new(),
    };
    let last = match kind {
        "functions" | "functions_back" => format!("fn g{n}(x: f32) -> f32 {{ return x; }}\n"),
        "constants" => format!("fn g0(x: f32) -> f32 {{ return c0; }}\nconst c{n} = 1.0;\n"),
        "structs" => format!("fn g0(x: f32) -> f32 {{ var s: S0; return x; }}\nstruct S{n} {{ a: f32 }}\n"),
        _ => String::new(),
    };
    let head = "// effect: deep\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {";
    format!("{head} {body} }}\n{}{last}", below.concat())
}

fn compile(text: &str) -> Result<WgslEffect, String> {
    let first_line = |e: EffectError| e.to_string().lines().next().unwrap_or_default().to_string();
    WgslEffect::from_text("deep.wgsl", text).map_err(first_line)
}

/// Compiles a text, valid or not, as for Vulkan.
fn compile_with_naga(text: &str) {
    let Ok(module) = naga::front::wgsl::parse_str(text) else { return };
    let Ok(info) = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module) else {
        return;
    };
    let options = naga::back::spv::Options { lang_version: (1, 3), ..Default::default() };
    let _ = naga::back::spv::write_vec(&module, &info, &options, None);
}

fn run_on_small_stack(work: impl FnOnce() + Send + 'static) {
    std::thread::Builder::new().stack_size(STACK_BYTES).spawn(work).unwrap().join().unwrap();
}

/// The largest depth that is not refused for its depth.
fn deepest_accepted(kind: &str) -> usize {
    let is_refused = |n: usize| {
        let error = compile(&nested_text(kind, n)).err();
        error.is_some_and(|e| {
            e.contains("levels deep")
                || e.contains("declarations")
                || e.contains("nested statements and calls")
        })
    };
    let (mut good, mut bad) = (1, 4096);
    assert!(is_refused(bad), "{kind}: {:?}", compile(&nested_text(kind, bad)).err());
    while bad - good > 1 {
        let middle = (good + bad) / 2;
        *if is_refused(middle) { &mut bad } else { &mut good } = middle;
    }
    good
}

/// A text within the limits goes through naga, and runs, on a quarter of a thread's usual stack. (Without the limits these texts
/// overflow a whole one at 1,500 `else if`s, at 4,000 operators, structs or members and at 6,000 constants.)
#[test]
fn accepted_texts_need_little_stack() {
    for kind in NESTING_KINDS {
        let n = deepest_accepted(kind);
        println!("{kind}: {n}");
        let text = nested_text(kind, n);
        run_on_small_stack(move || {
            compile_with_naga(&text);
            if let Ok(effect) = compile(&text) {
                effect.pixels(&mut [Vec4::ONE], &[Vec2::ONE], &[0.0; 8]);
            }
        });
    }
}

#[test]
fn too_deep_texts_are_refused_with_their_place() {
    let error = |kind: &str, n: usize| compile(&nested_text(kind, n)).err().unwrap();
    let levels = "nested more than 350 levels deep: each bracket counts 5, each operator and else if of a statement 1; split it \
        with let, or use a loop or switch";
    // Cases that once overflowed: a sum of 100 KB, and 3,000 `else if`s.
    assert_eq!(error("chain", 20_000), format!("deep.wgsl:2:907: {levels}"));
    assert_eq!(error("else_ifs", 3_000), format!("deep.wgsl:2:11968: {levels}"));
    assert_eq!(error("structs", 2_000), "deep.wgsl:1002:1: more than 1000 declarations");
    let calls = error("functions", 900);
    assert!(calls.ends_with("more than 200 nested statements and calls"), "{calls}");
}

/// Nesting after comments and numbers is counted.
#[test]
fn comments_and_numbers_do_not_hide_depth() {
    let head = "// effect: deep\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {";
    let is_refused =
        |body: String| compile(&format!("{head} {body} }}")).is_err_and(|e| e.contains("levels deep"));
    assert!(is_refused(format!("return vec4(1.0{});", ".x".repeat(400))));
    assert!(is_refused(format!("// a comment\rreturn vec4(1.0{});", "+1.0".repeat(400))));
    assert!(is_refused(format!("// a comment\u{2028}return vec4(1.0{});", "+1.0".repeat(400))));
    assert!(is_refused(format!("/* /* */ */ return vec4(1.0{});", "+1.0".repeat(400))));
    assert!(!is_refused(format!("return vec4(1.0{});", "+1.5e-3".repeat(150))));
}

/// Long texts without deep nesting are accepted.
#[test]
fn long_flat_texts_are_accepted() {
    let head = "// effect: long\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    var a = uv.x;\n";
    let lines = "    if a > 2.0 { a -= 1.0; } else if a < 0.0 { a += 1.0; } else { a = -a; }\n    a = sin(a * 2.0) + max(a, 0.5);\n    // ((((\n";
    let text = format!("{head}{}    /* {{ /* {{ */ */\n    return color * a;\n}}\n", lines.repeat(400));
    assert_eq!(compile(&text).err(), None);
}

#[test]
fn a_byte_order_mark_shifts_no_column() {
    let text = "\u{feff}// effect: marked\n// texture t = a.png: it\nfn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return colour; }";
    assert_eq!(choreo_wgsl_effect::effect_name(text).as_deref(), Some("marked"));
    assert!(choreo_wgsl_effect::declares_effect(text));
    assert_eq!(choreo_wgsl_effect::texture_files(text), ["a.png"]);
    let error = compile(text).err().unwrap();
    assert!(error.starts_with("deep.wgsl:3:84: no definition in scope for identifier: `colour`"), "{error}");
    let first = compile("\u{feff}// effect: Marked").err().unwrap();
    assert!(first.starts_with("deep.wgsl:1:1: \"Marked\" must be"), "{first}");
}
