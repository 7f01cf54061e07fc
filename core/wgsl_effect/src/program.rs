//! Register code, to which a WGSL module is lowered once, and which [`crate::machine::Machine`] runs over many pixels at a time.
//!
//! Every component of every value has its own register, a column with one entry per lane. WGSL forbids recursion, so each function has its
//! own registers: a call copies its arguments and needs no stack.

use crate::environment::HostFunction;
use crate::operators::{Kernel, Operands, Operator, kernel};
use crate::shape::ComponentKind;
use naga::Span;

/// Step limit (statements and loop rounds) of one call. Counted loops have the same limit for their own steps (`loops.rs`).
pub(crate) const MAX_STEPS: u32 = choreo_plugin::MAX_EFFECT_STEPS;

/// Step limit of a call without counted loops that take too long, such as a long chain of functions that call each other.
pub(crate) const MAX_UNCOUNTED_STEPS: u32 = 64 * MAX_STEPS;

/// Index of a register, which is a column of lanes.
pub(crate) type Register = u32;

/// Consecutive registers that hold the components of one value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Registers {
    pub first: Register,
    pub count: u32,
}

impl Registers {
    pub(crate) fn iter(self) -> impl Iterator<Item = Register> {
        self.first..self.first + self.count
    }
}

/// A lowered module.
pub(crate) struct Program {
    /// Number that is unique among all programs of the process.
    pub id: u64,
    pub registers: u32,
    /// Registers that hold the same bits in all lanes and are never written.
    pub constants: Vec<(Register, u32)>,
    /// Operations that depend only on parameters and constants: they run once for each set of parameters.
    pub prologue: Vec<Compute>,
    pub routines: Vec<Routine>,
    /// Index of the entry function.
    pub entry: usize,
    /// Components that the program reads, for each parameter of the entry function.
    pub inputs: Vec<Vec<u32>>,
    /// Types of the components of the last parameter of the entry function, which are the effect's parameters.
    pub parameters: Vec<ComponentKind>,
}

impl Program {
    pub(crate) fn entry(&self) -> &Routine {
        &self.routines[self.entry]
    }
}

/// A lowered function.
pub(crate) struct Routine {
    /// Registers of each parameter.
    pub arguments: Vec<Registers>,
    pub result: Registers,
    pub body: Vec<Node>,
}

/// Kernels of an operation, one for each width of machines.
#[derive(Clone, Copy)]
pub(crate) struct Kernels {
    pub one: Kernel<1>,
    pub quad: Kernel<4>,
    pub row: Kernel<32>,
}

impl Kernels {
    pub(crate) fn of(operator: Operator) -> Kernels {
        Kernels { one: kernel(operator), quad: kernel(operator), row: kernel(operator) }
    }
}

/// An operation on a few components. It writes all lanes; inactive lanes never read such a result.
#[derive(Clone, Copy)]
pub(crate) struct Compute {
    pub kernels: Kernels,
    /// The first result; the others follow it. Results are behind the operands.
    pub out: Register,
    pub operands: Operands,
}

/// A statement, or an operation.
pub(crate) enum Node {
    /// This number of statements follows, up to the next one at which lanes may diverge.
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
    /// Copies the register `first + offset`, with each lane's own offset. The lowered code keeps offsets in range.
    LoadElement {
        to: Register,
        first: Register,
        offset: Register,
    },
    /// Copies to the register `first + offset`, in active lanes only.
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
    /// Calls a function that the shader supplies.
    Host {
        host: HostFunction,
        arguments: Vec<Register>,
        result: Registers,
    },
}

/// A case of a switch; `value` is `None` for `default`.
pub(crate) struct Case {
    pub value: Option<u32>,
    pub body: Vec<Node>,
    pub fall_through: bool,
}

/// A feature that the evaluator does not support, and its place.
pub(crate) struct Unsupported {
    pub what: String,
    pub span: Span,
}
