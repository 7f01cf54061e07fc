//! The parameters and result of the function of each hook, in WGSL and as components.

use crate::environment::HostFunction;
use naga::{Module, ScalarKind, TypeInner, VectorSize};

/// Type of a parameter or of the result of an effect's function.
#[derive(Clone, Copy)]
enum ValueType {
    Scalar(ScalarKind),
    Vector(ScalarKind, VectorSize),
    /// The struct with this name.
    Struct(&'static str),
    /// The struct `Parameters`, or `array<f32, 8>`.
    Parameters,
}

/// Parameters and result of the function of a hook.
pub(crate) struct Signature {
    pub text: &'static str,
    parameter_types: &'static [ValueType],
    /// The result has one of these types.
    result_types: &'static [ValueType],
    /// Types that the shader declares; appended below the author's text, so that its line numbers stay.
    pub declared: &'static str,
    /// Functions that the shader supplies, as [`HostFunction`] lists them. Their WGSL is only parsed, never run.
    pub functions: &'static [Declared],
    /// Further functions, if the header requests a history.
    pub with_history: &'static [Declared],
}

/// Name, WGSL declaration, and the code that runs on the CPU.
type Declared = (&'static str, &'static str, HostFunction);

const FLOAT: ScalarKind = ScalarKind::Float;
const INT: ScalarKind = ScalarKind::Sint;
const UINT: ScalarKind = ScalarKind::Uint;

const PIXEL: Signature = Signature {
    text: "fn effect(color: vec4<f32>, uv: vec2<f32>, p: Parameters) -> vec4<f32>",
    parameter_types: &[
        ValueType::Vector(FLOAT, VectorSize::Quad),
        ValueType::Vector(FLOAT, VectorSize::Bi),
        ValueType::Parameters,
    ],
    result_types: &[ValueType::Vector(FLOAT, VectorSize::Quad)],
    declared: "",
    functions: &[],
    with_history: &[],
};

/// The signature of shaders/surface.wgsl, and the order of `choreo_plugin::SurfaceSample`.
const SURFACE: Signature = Signature {
    text: "fn effect(color: vec4<f32>, surface: SurfaceSample, p: Parameters) -> vec4<f32>",
    parameter_types: &[
        ValueType::Vector(FLOAT, VectorSize::Quad),
        ValueType::Struct("SurfaceSample"),
        ValueType::Parameters,
    ],
    result_types: &[ValueType::Vector(FLOAT, VectorSize::Quad)],
    declared: "struct SurfaceSample { world: vec3<f32>, distance: f32, normal: vec3<f32>, facing: f32, background: vec3<f32>, \
        joints: vec3<f32>, uv: vec2<f32>, shadow: f32, viewer: vec3<f32> }\n",
    functions: &[],
    with_history: &[],
};

/// The signature of shaders/displace.wgsl, and the order of `choreo_plugin::VertexSample`.
const VERTEX: Signature = Signature {
    text: "fn effect(vertex: VertexSample, p: Parameters) -> vec3<f32>",
    parameter_types: &[ValueType::Struct("VertexSample"), ValueType::Parameters],
    result_types: &[ValueType::Vector(FLOAT, VectorSize::Tri)],
    declared: "struct VertexSample { world: vec3<f32>, normal: vec3<f32>, uv: vec2<f32>, model: vec3<f32> }\n",
    functions: &[],
    with_history: &[],
};

/// The signature of shaders/surface.wgsl, and the order of `choreo_plugin::LightSample`.
const LIGHTING: Signature = Signature {
    text: "fn effect(sample: LightSample, p: Parameters) -> vec3<f32>",
    parameter_types: &[ValueType::Struct("LightSample"), ValueType::Parameters],
    result_types: &[ValueType::Vector(FLOAT, VectorSize::Tri)],
    declared: "struct LightSample { cosine: f32, share: f32, color: vec3<f32>, base: vec3<f32>, normal: vec3<f32>, \
        viewer: vec3<f32>, light: vec3<f32>, lit: vec3<f32> }\n",
    functions: &[],
    with_history: &[],
};

/// The signature of shaders/post.wgsl.
const IMAGE: Signature = Signature {
    text: "fn effect(at: vec2<i32>, pass_number: u32, p: Parameters) -> vec4<f32>",
    parameter_types: &[
        ValueType::Vector(INT, VectorSize::Bi),
        ValueType::Scalar(UINT),
        ValueType::Parameters,
    ],
    result_types: &[ValueType::Vector(FLOAT, VectorSize::Quad)],
    declared: "",
    functions: &[
        (
            "picture",
            "fn picture(at: vec2<i32>) -> vec4<f32> { return vec4(f32(at.x)); }\n",
            HostFunction::Picture,
        ),
        (
            "original",
            "fn original(at: vec2<i32>) -> vec4<f32> { return vec4(f32(at.x)); }\n",
            HostFunction::Original,
        ),
        ("picture_size", "fn picture_size() -> vec2<i32> { return vec2(1); }\n", HostFunction::PictureSize),
        (
            "original_size",
            "fn original_size() -> vec2<i32> { return vec2(1); }\n",
            HostFunction::OriginalSize,
        ),
        ("shrink_factor", "fn shrink_factor() -> i32 { return 1; }\n", HostFunction::Shrink),
    ],
    with_history: &[(
        "previous",
        "fn previous(frames: u32, at: vec2<i32>) -> vec4<f32> { return vec4(f32(at.x) + f32(frames)); }\n",
        HostFunction::Previous,
    )],
};

/// Signature of a pass of an effect whose passes have textures. The name of the pass replaces `effect`.
pub(crate) const NAMED_PASS: Signature = Signature {
    text: "fn effect(at: vec2<i32>, p: Parameters) -> vec4<f32>",
    parameter_types: &[ValueType::Vector(INT, VectorSize::Bi), ValueType::Parameters],
    ..IMAGE
};

/// The order of the members of [`choreo_plugin::Stroke`] and [`choreo_plugin::Triangle`].
const OVERLAY: Signature = Signature {
    text: "fn effect(index: u32, actor: ActorSample, p: Parameters) -> Line, or -> Triangle, or -> Lattice",
    parameter_types: &[ValueType::Scalar(UINT), ValueType::Struct("ActorSample"), ValueType::Parameters],
    result_types: &[
        ValueType::Struct(LINE_STRUCT),
        ValueType::Struct(TRIANGLE_STRUCT),
        ValueType::Struct(LATTICE_STRUCT),
    ],
    declared: "struct ActorSample { time: f32, position: vec3<f32>, low: vec3<f32>, high: vec3<f32>, joints: u32, number: u32 }\n\
        struct Line { a: vec3<f32>, b: vec3<f32>, width: f32, color: vec4<f32> }\n\
        struct Triangle { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, color: vec4<f32> }\n\
        struct Lattice { origin: vec3<f32>, along: vec3<f32>, across: vec3<f32>, cell: f32, every: u32, widths: vec2<f32>, \
        color: vec4<f32>, fade: f32 }\n",
    functions: &[
        ("joint", "fn joint(number: u32) -> vec3<f32> { return vec3(f32(number)); }\n", HostFunction::Joint),
        ("parent", "fn parent(number: u32) -> i32 { return i32(number) - 1; }\n", HostFunction::Parent),
        ("in_world", "fn in_world(place: vec3<f32>) -> vec3<f32> { return place; }\n", HostFunction::InWorld),
    ],
    with_history: &[
        (
            "previous_joint",
            "fn previous_joint(frames: u32, number: u32) -> vec3<f32> { return vec3(f32(number + frames)); }\n",
            HostFunction::PreviousJoint,
        ),
        (
            "previous_in_world",
            "fn previous_in_world(frames: u32, place: vec3<f32>) -> vec3<f32> { return place * f32(frames); }\n",
            HostFunction::PreviousInWorld,
        ),
    ],
};
pub(crate) const LINE_STRUCT: &str = "Line";
pub(crate) const TRIANGLE_STRUCT: &str = "Triangle";
pub(crate) const LATTICE_STRUCT: &str = "Lattice";

/// The order of the members of [`choreo_plugin::InvertedHull`].
const OUTLINE: Signature = Signature {
    text: "fn effect(p: Parameters) -> InvertedHull, or -> Wireframe",
    parameter_types: &[ValueType::Parameters],
    result_types: &[ValueType::Struct("InvertedHull"), ValueType::Struct(WIREFRAME)],
    declared: "struct InvertedHull { width: f32, color: vec3<f32>, lighting_mix: f32 }\nstruct Wireframe { color: vec3<f32> }\n",
    functions: &[],
    with_history: &[],
};
/// The struct of an effect's parameters.
pub(crate) const PARAMETERS: &str = "Parameters";
pub(crate) const WIREFRAME: &str = "Wireframe";

/// The shutter of a frame: number of images, how long it is open, and the share of that before the frame.
const SHUTTER: Signature = Signature {
    text: "fn effect(p: Parameters) -> Shutter",
    parameter_types: &[ValueType::Parameters],
    result_types: &[ValueType::Struct("Shutter")],
    declared: "struct Shutter { samples: u32, degrees: f32, before: f32 }\n",
    functions: &[],
    with_history: &[],
};

pub(crate) fn signature(hook: choreo_plugin::Hook) -> &'static Signature {
    use choreo_plugin::Hook;
    match hook {
        Hook::Surface => &SURFACE,
        Hook::Vertex => &VERTEX,
        Hook::Lighting => &LIGHTING,
        Hook::Image => &IMAGE,
        Hook::Overlay => &OVERLAY,
        Hook::Outline => &OUTLINE,
        Hook::Shutter => &SHUTTER,
        // `Hook` is non-exhaustive; here only pixels are left.
        _ => &PIXEL,
    }
}

impl Signature {
    /// Names of the types that the shader declares.
    pub(crate) fn structs(&self) -> impl Iterator<Item = &'static str> {
        self.declared
            .split("struct ")
            .filter_map(|text| text.split(' ').next())
            .filter(|name| !name.is_empty())
    }

    /// Whether a function has this signature.
    pub(crate) fn fits(&self, module: &Module, function: &naga::Function) -> bool {
        let types = &module.types;
        let is = |part: &ValueType, ty: naga::Handle<naga::Type>| match (part, &types[ty].inner) {
            (ValueType::Scalar(kind), TypeInner::Scalar(s)) => s.kind == *kind && s.width == 4,
            (ValueType::Vector(kind, n), TypeInner::Vector { size, scalar: s }) => {
                size == n && s.kind == *kind && s.width == 4
            }
            (ValueType::Struct(name), TypeInner::Struct { .. }) => types[ty].name.as_deref() == Some(name),
            (ValueType::Parameters, TypeInner::Array { base, size: naga::ArraySize::Constant(n), .. }) => {
                n.get() == 8 && types[*base].inner == TypeInner::Scalar(naga::Scalar::F32)
            }
            (ValueType::Parameters, TypeInner::Struct { .. }) => {
                types[ty].name.as_deref() == Some(PARAMETERS)
            }
            _ => false,
        };
        let arguments = &function.arguments;
        let result_types = |r: &naga::FunctionResult| self.result_types.iter().any(|part| is(part, r.ty));
        let result_types = function.result.as_ref().is_some_and(result_types);
        result_types
            && arguments.len() == self.parameter_types.len()
            && arguments.iter().zip(self.parameter_types).all(|(argument, part)| is(part, argument.ty))
    }
}
