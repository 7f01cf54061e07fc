//! The operators and built-in functions of WGSL on columns of lanes, as its specification defines them. Trigonometry and powers
//! come from `libm`: the same bits on every machine.

use naga::{BinaryOperator, MathFunction, UnaryOperator};

/// An operation on single components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Float(FloatOperator),
    /// Operands are `i32` if signed, else `u32` or `bool`.
    Integer {
        signed: bool,
        operator: IntegerOperator,
    },
    Math(MathFunction),
    IntegerMath {
        signed: bool,
        function: MathFunction,
    },
    Convert(Conversion),
    /// `operands[2] != 0 ? operands[1] : operands[0]`
    Select,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FloatOperator {
    Negate,
    Binary(BinaryOperator),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum IntegerOperator {
    Unary(UnaryOperator),
    Binary(BinaryOperator),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Conversion {
    FloatToInt,
    FloatToUint,
    FloatToBool,
    IntToFloat,
    UintToFloat,
    ToBool,
}

/// A component in all lanes, as bits.
#[derive(Clone, Copy)]
#[repr(align(16))]
pub(crate) struct Column<const N: usize>(pub [u32; N]);

impl<const N: usize> Column<N> {
    pub(crate) const ZERO: Column<N> = Column([0; N]);

    pub(crate) fn splat(bits: u32) -> Column<N> {
        Column([bits; N])
    }

    pub(crate) fn float(&self, lane: usize) -> f32 {
        f32::from_bits(self.0[lane])
    }

    fn is_uniform(&self) -> bool {
        self.0.iter().fold(0, |different, v| different | (v ^ self.0[0])) == 0
    }
}

/// Operands of an operation on a few components. Each operand has its first column, and a step: 1 if each component has a column of its
/// own, 0 if all share one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Operands {
    pub first: [u32; 3],
    pub step: [u32; 3],
    pub count: u32,
}

/// The columns of an operation: operands are in `low`, results at the beginning of `high`.
pub(crate) struct Columns<'a, const N: usize> {
    pub low: &'a [Column<N>],
    pub high: &'a mut [Column<N>],
    /// The lanes that are active.
    pub mask: u32,
}

impl<const N: usize> Columns<'_, N> {
    /// Calls `f` with the result column and the operand columns of each component.
    #[inline(always)]
    fn for_each_component<const K: usize>(
        &mut self,
        of: &Operands,
        f: impl Fn(&mut Column<N>, [&Column<N>; K]),
    ) {
        for (i, out) in (0..).zip(self.high.iter_mut().take(of.count as usize)) {
            f(out, std::array::from_fn(|k| &self.low[(of.first[k] + i * of.step[k]) as usize]));
        }
    }

    #[inline(always)]
    fn map_bits(&mut self, of: &Operands, f: impl Fn(u32, u32, u32) -> u32) {
        self.for_each_component(of, |out, [a, b, c]| {
            set_lanes(out, |i| f(a.0[i], b.0[i], c.0[i]));
        });
    }

    #[inline(always)]
    fn map_unary(&mut self, of: &Operands, f: impl Fn(f32) -> f32) {
        self.for_each_component(of, |out, [a]| {
            set_lanes(out, |i| f(a.float(i)).to_bits());
        });
    }

    #[inline(always)]
    fn map_binary(&mut self, of: &Operands, f: impl Fn(f32, f32) -> f32) {
        self.for_each_component(of, |out, [a, b]| {
            set_lanes(out, |i| f(a.float(i), b.float(i)).to_bits());
        });
    }

    #[inline(always)]
    fn map_ternary(&mut self, of: &Operands, f: impl Fn(f32, f32, f32) -> f32) {
        self.for_each_component(of, |out, [a, b, c]| {
            set_lanes(out, |i| f(a.float(i), b.float(i), c.float(i)).to_bits());
        });
    }

    #[inline(always)]
    fn map_comparison(&mut self, of: &Operands, f: impl Fn(f32, f32) -> bool) {
        self.for_each_component(of, |out, [a, b]| {
            set_lanes(out, |i| u32::from(f(a.float(i), b.float(i))));
        });
    }

    /// Evaluates a function that costs more than comparing all lanes: once if all lanes are equal, else for each active lane.
    #[inline(always)]
    fn map_costly_binary(&mut self, of: &Operands, f: impl Fn(f32, f32) -> f32) {
        let mask = self.mask;
        self.for_each_component(of, |out, [a, b]| {
            if N > 1 && a.is_uniform() && b.is_uniform() {
                *out = Column::splat(f(a.float(0), b.float(0)).to_bits());
                return;
            }
            for i in (0..N).filter(|i| mask >> i & 1 == 1) {
                out.0[i] = f(a.float(i), b.float(i)).to_bits();
            }
        });
    }

    /// [`Columns::map_costly_binary`] with one operand; the second operand is register 0, a constant.
    #[inline(always)]
    fn map_costly_unary(&mut self, of: &Operands, f: impl Fn(f32) -> f32) {
        self.map_costly_binary(of, |a, _| f(a));
    }
}

/// Sets all lanes. Four lanes at a time are computed before they are written, which allows one vector instruction, whatever `out` may
/// overlap.
#[inline(always)]
fn set_lanes<const N: usize>(out: &mut Column<N>, f: impl Fn(usize) -> u32) {
    let (fours, rest) = out.0.as_chunks_mut::<4>();
    for (k, four) in fours.iter_mut().enumerate() {
        *four = [f(4 * k), f(4 * k + 1), f(4 * k + 2), f(4 * k + 3)];
    }
    for (i, lane) in rest.iter_mut().enumerate() {
        *lane = f(N / 4 * 4 + i);
    }
}

/// A function that applies an operator lane by lane.
pub(crate) type Kernel<const N: usize> = fn(&Operands, &mut Columns<N>);

/// The kernel of an operator. It is chosen once, so that running it costs only a call.
pub(crate) fn kernel<const N: usize>(operator: Operator) -> Kernel<N> {
    match operator {
        Operator::Float(FloatOperator::Negate) => |of, columns| columns.map_unary(of, |a| -a),
        Operator::Float(FloatOperator::Binary(operator)) => float_binary(operator),
        Operator::Integer { signed, operator } => integer(signed, operator),
        Operator::Math(function) => math(function),
        Operator::IntegerMath { signed, function } => integer_math(signed, function),
        Operator::Convert(conversion) => convert(conversion),
        Operator::Select => {
            |of, columns| columns.map_bits(of, |reject, accept, c| if c != 0 { accept } else { reject })
        }
    }
}

fn float_binary<const N: usize>(operator: BinaryOperator) -> Kernel<N> {
    use BinaryOperator as B;
    match operator {
        B::Add => |of, columns| columns.map_binary(of, |a, b| a + b),
        B::Subtract => |of, columns| columns.map_binary(of, |a, b| a - b),
        B::Multiply => |of, columns| columns.map_binary(of, |a, b| a * b),
        B::Divide => |of, columns| columns.map_binary(of, |a, b| a / b),
        B::Modulo => |of, columns| columns.map_binary(of, |a, b| a - b * trunc(a / b)),
        B::Equal => |of, columns| columns.map_comparison(of, |a, b| a == b),
        B::NotEqual => |of, columns| columns.map_comparison(of, |a, b| a != b),
        B::Less => |of, columns| columns.map_comparison(of, |a, b| a < b),
        B::LessEqual => |of, columns| columns.map_comparison(of, |a, b| a <= b),
        B::Greater => |of, columns| columns.map_comparison(of, |a, b| a > b),
        _ => |of, columns| columns.map_comparison(of, |a, b| a >= b),
    }
}

fn integer<const N: usize>(signed: bool, operator: IntegerOperator) -> Kernel<N> {
    use BinaryOperator as B;
    let operator = match operator {
        IntegerOperator::Unary(UnaryOperator::Negate) => {
            return |of, columns| columns.map_bits(of, |a, _, _| a.wrapping_neg());
        }
        IntegerOperator::Unary(UnaryOperator::LogicalNot) => {
            return |of, columns| columns.map_bits(of, |a, _, _| u32::from(a == 0));
        }
        IntegerOperator::Unary(UnaryOperator::BitwiseNot) => {
            return |of, columns| columns.map_bits(of, |a, _, _| !a);
        }
        IntegerOperator::Binary(operator) => operator,
    };
    match (operator, signed) {
        (B::Add, _) => |of, columns| columns.map_bits(of, |a, b, _| a.wrapping_add(b)),
        (B::Subtract, _) => |of, columns| columns.map_bits(of, |a, b, _| a.wrapping_sub(b)),
        (B::Multiply, _) => |of, columns| columns.map_bits(of, |a, b, _| a.wrapping_mul(b)),
        // WGSL defines x / 0 as x, and x % 0 as 0.
        (B::Divide, true) => |of, columns| {
            columns.map_bits(of, |a, b, _| match b {
                0 => a,
                _ => (a as i32).wrapping_div(b as i32) as u32,
            })
        },
        (B::Divide, false) => |of, columns| columns.map_bits(of, |a, b, _| a.checked_div(b).unwrap_or(a)),
        (B::Modulo, true) => |of, columns| {
            columns.map_bits(of, |a, b, _| match b {
                0 => 0,
                _ => (a as i32).wrapping_rem(b as i32) as u32,
            })
        },
        (B::Modulo, false) => |of, columns| columns.map_bits(of, |a, b, _| a.checked_rem(b).unwrap_or(0)),
        (B::Equal, _) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a == b)),
        (B::NotEqual, _) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a != b)),
        (B::Less, true) => |of, columns| columns.map_bits(of, |a, b, _| u32::from((a as i32) < b as i32)),
        (B::LessEqual, true) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a as i32 <= b as i32)),
        (B::Greater, true) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a as i32 > b as i32)),
        (B::GreaterEqual, true) => {
            |of, columns| columns.map_bits(of, |a, b, _| u32::from(a as i32 >= b as i32))
        }
        (B::Less, false) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a < b)),
        (B::LessEqual, false) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a <= b)),
        (B::Greater, false) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a > b)),
        (B::GreaterEqual, false) => |of, columns| columns.map_bits(of, |a, b, _| u32::from(a >= b)),
        (B::And | B::LogicalAnd, _) => |of, columns| columns.map_bits(of, |a, b, _| a & b),
        (B::InclusiveOr | B::LogicalOr, _) => |of, columns| columns.map_bits(of, |a, b, _| a | b),
        (B::ExclusiveOr, _) => |of, columns| columns.map_bits(of, |a, b, _| a ^ b),
        (B::ShiftLeft, _) => |of, columns| columns.map_bits(of, |a, b, _| a << (b & 31)),
        (B::ShiftRight, true) => |of, columns| columns.map_bits(of, |a, b, _| (a as i32 >> (b & 31)) as u32),
        (B::ShiftRight, false) => |of, columns| columns.map_bits(of, |a, b, _| a >> (b & 31)),
    }
}

fn convert<const N: usize>(conversion: Conversion) -> Kernel<N> {
    match conversion {
        Conversion::FloatToInt => {
            |of, columns| columns.map_bits(of, |a, _, _| f32::from_bits(a) as i32 as u32)
        }
        Conversion::FloatToUint => |of, columns| columns.map_bits(of, |a, _, _| f32::from_bits(a) as u32),
        Conversion::FloatToBool => {
            |of, columns| columns.map_bits(of, |a, _, _| u32::from(f32::from_bits(a) != 0.0))
        }
        Conversion::IntToFloat => |of, columns| columns.map_bits(of, |a, _, _| (a as i32 as f32).to_bits()),
        Conversion::UintToFloat => |of, columns| columns.map_bits(of, |a, _, _| (a as f32).to_bits()),
        Conversion::ToBool => |of, columns| columns.map_bits(of, |a, _, _| u32::from(a != 0)),
    }
}

/// Whether [`math`] supports the function on single components. Functions of whole vectors are lowered to operations on components.
pub(crate) fn is_component_function(function: MathFunction) -> bool {
    use MathFunction as M;
    matches!(
        function,
        M::Abs
            | M::Min
            | M::Max
            | M::Clamp
            | M::Saturate
            | M::Cos
            | M::Cosh
            | M::Sin
            | M::Sinh
            | M::Tan
            | M::Tanh
            | M::Acos
            | M::Asin
            | M::Atan
            | M::Atan2
            | M::Radians
            | M::Degrees
            | M::Ceil
            | M::Floor
            | M::Round
            | M::Fract
            | M::Trunc
            | M::Exp
            | M::Exp2
            | M::Log
            | M::Log2
            | M::Pow
            | M::Sign
            | M::Fma
            | M::Mix
            | M::Step
            | M::SmoothStep
            | M::Sqrt
            | M::InverseSqrt
    )
}

fn math<const N: usize>(function: MathFunction) -> Kernel<N> {
    use MathFunction as M;
    match function {
        M::Abs => |of, columns| columns.map_unary(of, f32::abs),
        M::Min => |of, columns| columns.map_binary(of, f32::min),
        M::Max => |of, columns| columns.map_binary(of, f32::max),
        M::Clamp => |of, columns| columns.map_ternary(of, clamp),
        M::Saturate => |of, columns| columns.map_unary(of, |x| clamp(x, 0.0, 1.0)),
        M::Ceil => |of, columns| columns.map_unary(of, |x| -floor(-x)),
        M::Floor => |of, columns| columns.map_unary(of, floor),
        M::Fract => |of, columns| columns.map_unary(of, |x| x - floor(x)),
        M::Trunc => |of, columns| columns.map_unary(of, trunc),
        M::Sqrt => |of, columns| columns.map_unary(of, f32::sqrt),
        M::InverseSqrt => |of, columns| columns.map_unary(of, |x| 1.0 / x.sqrt()),
        M::Sign => |of, columns| columns.map_unary(of, |x| f32::from(i8::from(x > 0.0) - i8::from(x < 0.0))),
        M::Radians => |of, columns| columns.map_unary(of, |x| x * (std::f32::consts::PI / 180.0)),
        M::Degrees => |of, columns| columns.map_unary(of, |x| x * (180.0 / std::f32::consts::PI)),
        M::Fma => |of, columns| columns.map_ternary(of, |a, b, c| a * b + c),
        M::Mix => |of, columns| columns.map_ternary(of, |a, b, t| a * (1.0 - t) + b * t),
        M::Step => |of, columns| columns.map_binary(of, |edge, x| f32::from(u8::from(edge <= x))),
        M::SmoothStep => |of, columns| {
            columns.map_ternary(of, |low, high, x| {
                let t = clamp((x - low) / (high - low), 0.0, 1.0);
                t * t * (3.0 - 2.0 * t)
            })
        },
        M::Round => |of, columns| columns.map_costly_unary(of, libm::rintf),
        M::Cos => |of, columns| columns.map_costly_unary(of, libm::cosf),
        M::Cosh => |of, columns| columns.map_costly_unary(of, libm::coshf),
        M::Sin => |of, columns| columns.map_costly_unary(of, libm::sinf),
        M::Sinh => |of, columns| columns.map_costly_unary(of, libm::sinhf),
        M::Tan => |of, columns| columns.map_costly_unary(of, libm::tanf),
        M::Tanh => |of, columns| columns.map_costly_unary(of, libm::tanhf),
        M::Acos => |of, columns| columns.map_costly_unary(of, libm::acosf),
        M::Asin => |of, columns| columns.map_costly_unary(of, libm::asinf),
        M::Atan => |of, columns| columns.map_costly_unary(of, libm::atanf),
        M::Exp => |of, columns| columns.map_costly_unary(of, libm::expf),
        M::Exp2 => |of, columns| columns.map_costly_unary(of, libm::exp2f),
        M::Log => |of, columns| columns.map_costly_unary(of, libm::logf),
        M::Log2 => |of, columns| columns.map_costly_unary(of, libm::log2f),
        M::Atan2 => |of, columns| columns.map_costly_binary(of, libm::atan2f),
        M::Pow => |of, columns| columns.map_costly_binary(of, libm::powf),
        _ => |of, columns| columns.map_unary(of, |_| f32::NAN),
    }
}

fn integer_math<const N: usize>(signed: bool, function: MathFunction) -> Kernel<N> {
    use MathFunction as M;
    match (function, signed) {
        (M::Abs, true) => |of, columns| columns.map_bits(of, |a, _, _| (a as i32).wrapping_abs() as u32),
        (M::Min, true) => |of, columns| columns.map_bits(of, |a, b, _| (a as i32).min(b as i32) as u32),
        (M::Max, true) => |of, columns| columns.map_bits(of, |a, b, _| (a as i32).max(b as i32) as u32),
        (M::Clamp, true) => {
            |of, columns| columns.map_bits(of, |a, b, c| (a as i32).max(b as i32).min(c as i32) as u32)
        }
        (M::Sign, true) => |of, columns| columns.map_bits(of, |a, _, _| (a as i32).signum() as u32),
        (M::Min, false) => |of, columns| columns.map_bits(of, |a, b, _| a.min(b)),
        (M::Max, false) => |of, columns| columns.map_bits(of, |a, b, _| a.max(b)),
        (M::Clamp, false) => |of, columns| columns.map_bits(of, |a, b, c| a.max(b).min(c)),
        _ => |of, columns| columns.map_bits(of, |a, _, _| a),
    }
}

#[inline(always)]
fn clamp(x: f32, low: f32, high: f32) -> f32 {
    // `f32::clamp` would panic if low > high.
    x.max(low).min(high)
}

/// Rounds towards zero, exactly, with instructions that every x86-64 has for several lanes.
#[inline(always)]
fn trunc(x: f32) -> f32 {
    // Larger numbers are whole, and NaN is kept.
    let whole = if x.abs() < 8_388_608.0 { x as i32 as f32 } else { x };
    whole.copysign(x)
}

/// Rounds down; see [`trunc`].
#[inline(always)]
fn floor(x: f32) -> f32 {
    let whole = trunc(x);
    (whole - f32::from(u8::from(whole > x))).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_equals_libm_bit_by_bit() {
        let special =
            [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 8_388_607.5, -8_388_608.0, f32::MAX, f32::INFINITY, f32::NAN];
        // The bits of NaN may differ.
        let bits = |x: f32| if x.is_nan() { 0 } else { x.to_bits() };
        let many = (0..200_000u32).map(|i| f32::from_bits(i.wrapping_mul(2_654_435_761)));
        for x in special.into_iter().chain(many) {
            assert_eq!(bits(floor(x)), bits(libm::floorf(x)), "{x:?}");
            assert_eq!(bits(trunc(x)), bits(libm::truncf(x)), "{x:?}");
            assert_eq!(bits(-floor(-x)), bits(libm::ceilf(x)), "{x:?}");
        }
    }
}
