//! Pool of machines: each thread keeps machines between calls, with their constants and parameters in place.

use crate::machine::Machine;
use crate::program::Program;
use std::cell::RefCell;
use std::thread::LocalKey;

/// A machine, and the program and the bits of the parameters for which it was made.
pub(crate) struct PooledMachine<M> {
    program: u64,
    parameters: Vec<u32>,
    machine: M,
}

type Pool<M> = RefCell<Vec<PooledMachine<M>>>;

/// Machines of a width that has a pool.
pub(crate) trait Pooled: Sized + 'static {
    /// The pool of the current thread.
    fn pool() -> &'static LocalKey<Pool<Self>>;
    /// A new machine.
    fn new(program: &Program, parameters: &[f32]) -> Self;
}

macro_rules! pooled {
    ($lanes:literal, $name:ident) => {
        thread_local! { static $name: Pool<Machine<$lanes>> = const { RefCell::new(Vec::new()) }; }
        impl Pooled for Machine<$lanes> {
            fn pool() -> &'static LocalKey<Pool<Self>> {
                &$name
            }
            fn new(program: &Program, parameters: &[f32]) -> Self {
                Machine::new(program, parameters)
            }
        }
    };
}
pooled!(4, QUADS);
pooled!(32, ROWS);

/// Largest number of machines that a thread keeps; a frame has only a few effects.
const MAX_POOLED_MACHINES: usize = 12;

/// Lends a machine for a program and its parameters.
pub(crate) fn with_machine<M: Pooled>(program: &Program, parameters: &[f32], run: impl FnOnce(&mut M)) {
    let bits = || parameters.iter().map(|p| p.to_bits());
    let taken = M::pool().with_borrow_mut(|all| {
        let at = all
            .iter()
            .rposition(|kept| kept.program == program.id && kept.parameters.iter().copied().eq(bits()))?;
        Some(all.swap_remove(at))
    });
    let mut kept = taken.unwrap_or_else(|| PooledMachine {
        program: program.id,
        parameters: bits().collect(),
        machine: M::new(program, parameters),
    });
    run(&mut kept.machine);
    M::pool().with_borrow_mut(|all| {
        if all.len() >= MAX_POOLED_MACHINES {
            all.remove(0);
        }
        all.push(kept);
    });
}
