//! The operators and built-in functions of WGSL on values, as its specification defines them. Trigonometry and powers come
//! from `libm`: the same bits on every machine.

use crate::shape::{Kind, Shape, Value};
use naga::{BinaryOperator as Op, MathFunction as Fun, ScalarKind, UnaryOperator};

fn each(size: usize, f: impl Fn(usize) -> u32) -> Value {
    let mut out = Value::default();
    for i in 0..size {
        out.0[i] = f(i);
    }
    out
}

fn floats(size: usize, f: impl Fn(usize) -> f32) -> Value {
    each(size, |i| f(i).to_bits())
}

pub fn unary(op: UnaryOperator, v: Value, s: Shape) -> Value {
    each(s.size, |i| match (op, s.kind) {
        (UnaryOperator::Negate, Kind::Float) => (-v.f(i)).to_bits(),
        (UnaryOperator::Negate, _) => v.0[i].wrapping_neg(),
        (UnaryOperator::LogicalNot, _) => u32::from(v.0[i] == 0),
        (UnaryOperator::BitwiseNot, _) => !v.0[i],
    })
}

pub fn binary(op: Op, a: Value, sa: Shape, b: Value, sb: Shape) -> Value {
    if op == Op::Multiply && (sa.columns > 0 || sb.columns > 0) {
        return matrix_product(a, sa, b, sb);
    }
    let size = sa.size.max(sb.size);
    // A scalar meets every component of a vector.
    let at = |v: &Value, s: Shape, i: usize| v.0[if s.size == 1 { 0 } else { i }];
    each(size, |i| component(op, sa.kind, at(&a, sa, i), at(&b, sb, i)))
}

fn component(op: Op, kind: Kind, a: u32, b: u32) -> u32 {
    let (fa, fb) = (f32::from_bits(a), f32::from_bits(b));
    let (ia, ib) = (a as i32, b as i32);
    let truth = u32::from;
    match (op, kind) {
        (Op::Add, Kind::Float) => (fa + fb).to_bits(),
        (Op::Subtract, Kind::Float) => (fa - fb).to_bits(),
        (Op::Multiply, Kind::Float) => (fa * fb).to_bits(),
        (Op::Divide, Kind::Float) => (fa / fb).to_bits(),
        (Op::Modulo, Kind::Float) => (fa - fb * libm::truncf(fa / fb)).to_bits(),
        (Op::Add, _) => a.wrapping_add(b),
        (Op::Subtract, _) => a.wrapping_sub(b),
        (Op::Multiply, _) => a.wrapping_mul(b),
        // WGSL: x / 0 is x, x % 0 is 0.
        (Op::Divide, Kind::Int) if b != 0 => ia.wrapping_div(ib) as u32,
        (Op::Divide, _) => a.checked_div(b).unwrap_or(a),
        (Op::Modulo, Kind::Int) if b != 0 => ia.wrapping_rem(ib) as u32,
        (Op::Modulo, _) => a.checked_rem(b).unwrap_or(0),
        (Op::Equal, Kind::Float) => truth(fa == fb),
        (Op::NotEqual, Kind::Float) => truth(fa != fb),
        (Op::Less, Kind::Float) => truth(fa < fb),
        (Op::LessEqual, Kind::Float) => truth(fa <= fb),
        (Op::Greater, Kind::Float) => truth(fa > fb),
        (Op::GreaterEqual, Kind::Float) => truth(fa >= fb),
        (Op::Equal, _) => truth(a == b),
        (Op::NotEqual, _) => truth(a != b),
        (Op::Less, Kind::Int) => truth(ia < ib),
        (Op::LessEqual, Kind::Int) => truth(ia <= ib),
        (Op::Greater, Kind::Int) => truth(ia > ib),
        (Op::GreaterEqual, Kind::Int) => truth(ia >= ib),
        (Op::Less, _) => truth(a < b),
        (Op::LessEqual, _) => truth(a <= b),
        (Op::Greater, _) => truth(a > b),
        (Op::GreaterEqual, _) => truth(a >= b),
        (Op::And | Op::LogicalAnd, _) => a & b,
        (Op::InclusiveOr | Op::LogicalOr, _) => a | b,
        (Op::ExclusiveOr, _) => a ^ b,
        (Op::ShiftLeft, _) => a << (b & 31),
        (Op::ShiftRight, Kind::Int) => (ia >> (b & 31)) as u32,
        (Op::ShiftRight, _) => a >> (b & 31),
    }
}

/// Matrices lie column by column; a vector left of one is a row.
fn matrix_product(a: Value, sa: Shape, b: Value, sb: Shape) -> Value {
    if sa.size == 1 || sb.size == 1 {
        let at = |v: &Value, s: Shape, i: usize| v.f(if s.size == 1 { 0 } else { i });
        return floats(sa.size.max(sb.size), |i| at(&a, sa, i) * at(&b, sb, i));
    }
    let rows = if sa.columns > 0 { sa.step } else { 1 };
    let inner = if sa.columns > 0 { sa.columns } else { sa.size };
    let columns = if sb.columns > 0 { sb.columns } else { 1 };
    floats(rows * columns, |i| {
        let (column, row) = (i / rows, i % rows);
        (0..inner).map(|k| a.f(k * rows + row) * b.f(column * inner + k)).fold(0.0, |sum, x| sum + x)
    })
}

/// Values of a type converted to another by value; `bits` keeps the bits.
pub fn convert(v: Value, from: Shape, to: ScalarKind, bits: bool) -> Value {
    if bits {
        return v;
    }
    each(from.size, |i| {
        let (x, f) = (v.0[i], v.f(i));
        match (from.kind, to) {
            (Kind::Float, ScalarKind::Sint) => (f as i32) as u32,
            (Kind::Float, ScalarKind::Uint) => f as u32,
            (Kind::Float, ScalarKind::Bool) => u32::from(f != 0.0),
            (Kind::Int, ScalarKind::Float) => (x as i32 as f32).to_bits(),
            (Kind::Uint | Kind::Bool, ScalarKind::Float) => (x as f32).to_bits(),
            (_, ScalarKind::Bool) => u32::from(x != 0),
            _ => x,
        }
    })
}

/// Whether [`maths`] knows the function.
pub fn is_known(fun: Fun) -> bool {
    use Fun::*;
    matches!(
        fun,
        Abs | Min
            | Max
            | Clamp
            | Saturate
            | Cos
            | Cosh
            | Sin
            | Sinh
            | Tan
            | Tanh
            | Acos
            | Asin
            | Atan
            | Atan2
            | Radians
            | Degrees
            | Ceil
            | Floor
            | Round
            | Fract
            | Trunc
            | Exp
            | Exp2
            | Log
            | Log2
            | Pow
            | Dot
            | Cross
            | Distance
            | Length
            | Normalize
            | Reflect
            | Sign
            | Fma
            | Mix
            | Step
            | SmoothStep
            | Sqrt
            | InverseSqrt
    )
}

/// `s` is the first argument's shape; further scalars meet every component.
pub fn maths(fun: Fun, args: &[(Value, Shape)]) -> Value {
    let (a, s) = args[0];
    let arg = |n: usize, i: usize| args.get(n).map_or(0, |(v, s)| v.0[if s.size == 1 { 0 } else { i }]);
    let f = |n: usize, i: usize| f32::from_bits(arg(n, i));
    let dot = |n: usize, m: usize| (0..s.size).fold(0.0, |sum, i| sum + f(n, i) * f(m, i));
    if s.kind != Kind::Float {
        return each(s.size, |i| {
            integer(fun, s.kind, arg(0, i), arg(1, i), arg(2, i), || {
                (0..s.size).fold(0u32, |sum, i| sum.wrapping_add(arg(0, i).wrapping_mul(arg(1, i))))
            })
        });
    }
    let one: Option<fn(f32) -> f32> = match fun {
        Fun::Abs => Some(libm::fabsf),
        Fun::Saturate => Some(|x| clamp(x, 0.0, 1.0)),
        Fun::Cos => Some(libm::cosf),
        Fun::Cosh => Some(libm::coshf),
        Fun::Sin => Some(libm::sinf),
        Fun::Sinh => Some(libm::sinhf),
        Fun::Tan => Some(libm::tanf),
        Fun::Tanh => Some(libm::tanhf),
        Fun::Acos => Some(libm::acosf),
        Fun::Asin => Some(libm::asinf),
        Fun::Atan => Some(libm::atanf),
        Fun::Radians => Some(|x| x * (std::f32::consts::PI / 180.0)),
        Fun::Degrees => Some(|x| x * (180.0 / std::f32::consts::PI)),
        Fun::Ceil => Some(libm::ceilf),
        Fun::Floor => Some(libm::floorf),
        Fun::Round => Some(libm::rintf),
        Fun::Trunc => Some(libm::truncf),
        Fun::Fract => Some(|x| x - libm::floorf(x)),
        Fun::Exp => Some(libm::expf),
        Fun::Exp2 => Some(libm::exp2f),
        Fun::Log => Some(libm::logf),
        Fun::Log2 => Some(libm::log2f),
        Fun::Sign => Some(|x| f32::from(i8::from(x > 0.0) - i8::from(x < 0.0))),
        Fun::Sqrt => Some(libm::sqrtf),
        Fun::InverseSqrt => Some(|x| 1.0 / libm::sqrtf(x)),
        _ => None,
    };
    if let Some(one) = one {
        return floats(s.size, |i| one(a.f(i)));
    }
    match fun {
        Fun::Dot => Value::floats(&[dot(0, 1)]),
        Fun::Length => Value::floats(&[libm::sqrtf(dot(0, 0))]),
        Fun::Distance => {
            let squares = (0..s.size).fold(0.0, |sum, i| sum + (f(0, i) - f(1, i)) * (f(0, i) - f(1, i)));
            Value::floats(&[libm::sqrtf(squares)])
        }
        Fun::Normalize => {
            let length = libm::sqrtf(dot(0, 0));
            floats(s.size, |i| a.f(i) / length)
        }
        Fun::Cross => floats(3, |i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            f(0, j) * f(1, k) - f(0, k) * f(1, j)
        }),
        Fun::Reflect => {
            let d = 2.0 * dot(1, 0);
            floats(s.size, |i| f(0, i) - d * f(1, i))
        }
        _ => {
            let size = args.iter().map(|(_, s)| s.size).max().unwrap_or(1);
            floats(size, |i| three(fun, f(0, i), f(1, i), f(2, i)))
        }
    }
}

fn clamp(x: f32, low: f32, high: f32) -> f32 {
    // Not `f32::clamp`, which ends the program where low > high.
    x.max(low).min(high)
}

fn three(fun: Fun, a: f32, b: f32, c: f32) -> f32 {
    match fun {
        Fun::Min => a.min(b),
        Fun::Max => a.max(b),
        Fun::Clamp => clamp(a, b, c),
        Fun::Atan2 => libm::atan2f(a, b),
        Fun::Pow => libm::powf(a, b),
        Fun::Fma => a * b + c,
        Fun::Mix => a * (1.0 - c) + b * c,
        Fun::Step => f32::from(u8::from(a <= b)),
        Fun::SmoothStep => {
            let t = clamp((c - a) / (b - a), 0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }
        _ => f32::NAN,
    }
}

fn integer(fun: Fun, kind: Kind, a: u32, b: u32, c: u32, dot: impl Fn() -> u32) -> u32 {
    let (ia, ib, ic) = (a as i32, b as i32, c as i32);
    match (fun, kind) {
        (Fun::Abs, Kind::Int) => ia.wrapping_abs() as u32,
        (Fun::Min, Kind::Int) => ia.min(ib) as u32,
        (Fun::Max, Kind::Int) => ia.max(ib) as u32,
        (Fun::Clamp, Kind::Int) => ia.max(ib).min(ic) as u32,
        (Fun::Sign, Kind::Int) => ia.signum() as u32,
        (Fun::Min, _) => a.min(b),
        (Fun::Max, _) => a.max(b),
        (Fun::Clamp, _) => a.max(b).min(c),
        (Fun::Dot, _) => dot(),
        _ => a,
    }
}
