//! Register code: what a WGSL module is lowered to once, and what [`crate::machine::Machine`] runs over many pixels at a time.
//!
//! Every component of every value has a register of its own, a column with one entry per lane. WGSL forbids recursion, so each
//! function has its registers to itself: a call copies arguments and needs no stack.

use crate::environment::Host;
use crate::operators::{Kernel, Operands, Operator, kernel};
use crate::shape::ComponentKind;
use naga::Span;

/// Steps (statements and loop rounds) that one call may take. Loops count the same number by their rounds (`loops.rs`).
pub(crate) const MAX_STEPS: u32 = choreo_plugin::MAX_EFFECT_STEPS;

/// Steps after which a call is given up that no counted loop ends: functions that call each other without end in sight.
pub(crate) const MOST_STEPS: u32 = 64 * MAX_STEPS;

/// Index of a column.
pub(crate) type Register = u32;

/// A run of registers that holds the components of one value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Registers {
    pub first: Register,
    pub count: u32,
}

impl Registers {
    pub fn iter(self) -> impl Iterator<Item = Register> {
        self.first..self.first + self.count
    }
}

/// The lowered module.
pub struct Program {
    /// Different for each program of the process.
    pub id: u64,
    pub registers: u32,
    /// Registers that hold the same bits in all lanes and are never written.
    pub constants: Vec<(Register, u32)>,
    /// Operations on parameters and constants alone: run once for each set of parameters.
    pub prologue: Vec<Compute>,
    pub routines: Vec<Routine>,
    /// Index of the entry function.
    pub entry: usize,
    /// The components of each of its parameters that anything reads.
    pub inputs: Vec<Vec<u32>>,
    /// Types of the components of its last parameter: the effect's own.
    pub parameters: Vec<ComponentKind>,
}

impl Program {
    pub fn entry(&self) -> &Routine {
        &self.routines[self.entry]
    }
}

/// A function.
pub(crate) struct Routine {
    /// One value for each parameter.
    pub arguments: Vec<Registers>,
    pub result: Registers,
    pub body: Vec<Node>,
}

/// An operation for each number of lanes that machines have.
#[derive(Clone, Copy)]
pub struct Kernels {
    pub one: Kernel<1>,
    pub quad: Kernel<4>,
    pub row: Kernel<32>,
}

impl Kernels {
    pub fn of(operator: Operator) -> Kernels {
        Kernels { one: kernel(operator), quad: kernel(operator), row: kernel(operator) }
    }
}

/// An operation on a few components, written in all lanes: inactive lanes never read what they did not compute.
#[derive(Clone, Copy)]
pub struct Compute {
    pub kernels: Kernels,
    /// The first result; it lies behind the operands, and the others follow it.
    pub out: Register,
    pub operands: Operands,
}

/// A statement, or an operation.
pub enum Node {
    /// This number of statements follows, up to the next one that branches.
    Steps(u32),
    Compute(Compute),
    /// Copies this number of registers in all lanes.
    Copy {
        to: Register,
        from: Register,
        count: u32,
    },
    /// Copies registers into a variable, in active lanes only.
    Store {
        to: Register,
        from: Register,
        count: u32,
    },
    /// Copies the register `first + offset`, with each lane's own offset. Lowering keeps offsets in range.
    LoadElement {
        to: Register,
        first: Register,
        offset: Register,
    },
    /// Like `LoadElement` in the other direction, in active lanes only.
    StoreElement {
        first: Register,
        offset: Register,
        from: Register,
    },
    If {
        condition: Register,
        accept: Vec<Node>,
        reject: Vec<Node>,
    },
    Switch {
        selector: Register,
        cases: Vec<Case>,
    },
    Loop {
        body: Vec<Node>,
        continuing: Vec<Node>,
        break_if: Option<Register>,
    },
    Break,
    Continue,
    Return(Vec<Register>),
    Call {
        routine: usize,
        arguments: Vec<Register>,
    },
    /// Calls a function of the shader around the effect's.
    Host {
        host: Host,
        arguments: Vec<Register>,
        result: Registers,
    },
}

/// A case of a switch; `value` is `None` for `default`.
pub struct Case {
    pub value: Option<u32>,
    pub body: Vec<Node>,
    pub fall_through: bool,
}

/// Something that the evaluator does not support, and its place.
pub struct Unsupported {
    pub what: String,
    pub span: Span,
}
