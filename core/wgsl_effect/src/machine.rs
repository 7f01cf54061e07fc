//! Runs a [`Program`] over up to `N` pixels at a time.
//!
//! Lanes that do not take a branch are masked out; a branch that no lane takes is skipped. Every lane gets the bits that it would get
//! alone, because each operation is one IEEE operation per lane.

use crate::environment::{Environment, HostFunction};
use crate::operators::{Column, Columns, Kernel};
use crate::program::{
    Case, Compute, Kernels, MAX_STEPS, MAX_UNCOUNTED_STEPS, Node, Program, Register, Registers, Routine,
};
use choreo_plugin::EffectImage;
use glam::Vec4;

/// The step limit was reached. A single lane took too many steps itself; several lanes may have reached the limit only together.
#[derive(Debug)]
pub(crate) struct TooLong;

/// Numbers of lanes for which there are kernels.
pub(crate) trait Width<const N: usize> {
    fn kernel(kernels: &Kernels) -> Kernel<N>;
}

/// Supported widths: one pixel, a quad of a surface, and a part of a row.
pub(crate) struct Lanes;

impl Width<1> for Lanes {
    fn kernel(kernels: &Kernels) -> Kernel<1> {
        kernels.one
    }
}

impl Width<4> for Lanes {
    fn kernel(kernels: &Kernels) -> Kernel<4> {
        kernels.quad
    }
}

impl Width<32> for Lanes {
    fn kernel(kernels: &Kernels) -> Kernel<32> {
        kernels.row
    }
}

/// The registers of a running program. Lanes are bits of a mask, so `N` is at most 32.
pub(crate) struct Machine<const N: usize> {
    registers: Vec<Column<N>>,
    /// Steps of the last run: exact for one lane, an upper bound for each of several lanes.
    pub steps: u32,
    /// Number of the loop that took too many rounds in the last run, by lane; 0 for none.
    pub endless: [u32; N],
}

/// Lanes that have exited a loop's body or a switch.
#[derive(Default)]
struct ExitedLanes {
    broken: u32,
    continued: u32,
}

struct Run<'a, const N: usize> {
    program: &'a Program,
    environment: &'a dyn Environment,
    registers: &'a mut [Column<N>],
    steps: u32,
    /// Steps of counted loops so far, by lane.
    spent: [u32; N],
    endless: [u32; N],
}

impl<const N: usize> Machine<N>
where
    Lanes: Width<N>,
{
    /// Makes a machine whose lanes all have the same parameters, given as the numbers of the manifest.
    pub(crate) fn new(program: &Program, parameters: &[f32]) -> Machine<N> {
        const { assert!(N <= 32) };
        let mut registers = vec![Column::ZERO; program.registers as usize];
        for (register, bits) in &program.constants {
            registers[*register as usize] = Column::splat(*bits);
        }
        if let Some(last) = program.entry().arguments.last() {
            for ((register, kind), value) in last.iter().zip(&program.parameters).zip(parameters) {
                registers[register as usize] = Column::splat(kind.bits_of(*value));
            }
        }
        for node in &program.prologue {
            run_kernel(node, &mut registers, u32::MAX);
        }
        Machine { registers, steps: 0, endless: [0; N] }
    }

    /// Sets an argument of the entry function in one lane. Only components that the program reads are set.
    pub(crate) fn set(&mut self, program: &Program, argument: usize, lane: usize, bits: &[u32]) {
        let first = program.entry().arguments[argument].first;
        for component in &program.inputs[argument] {
            self.registers[(first + component) as usize].0[lane] = bits[*component as usize];
        }
    }

    /// Sets an argument in many lanes. `component` returns one component of a lane's value.
    #[inline(always)]
    pub(crate) fn fill<T>(
        &mut self,
        program: &Program,
        argument: usize,
        values: &[T],
        component: impl Fn(&T, usize) -> f32,
    ) {
        let first = program.entry().arguments[argument].first;
        for number in &program.inputs[argument] {
            let column = &mut self.registers[(first + number) as usize].0;
            for (out, value) in column.iter_mut().zip(values) {
                *out = component(value, *number as usize).to_bits();
            }
        }
    }

    /// Passes the first four components of the entry function's result to `set`, for as many lanes as `out` has.
    #[inline(always)]
    pub(crate) fn read<T>(&self, program: &Program, out: &mut [T], set: impl Fn(&mut T, [f32; 4])) {
        let Registers { first, count } = program.entry().result;
        let zero = Column::ZERO;
        let column = |i: u32| if i < count { &self.registers[(first + i) as usize] } else { &zero };
        let [x, y, z, w] = [column(0), column(1), column(2), column(3)];
        for (i, out) in out.iter_mut().enumerate().take(N) {
            set(out, [x.float(i), y.float(i), z.float(i), w.float(i)]);
        }
    }

    /// A machine with one lane of this one, with its arguments.
    pub(crate) fn lane(&self, program: &Program, lane: usize) -> Machine<1> {
        let registers = self.registers.iter().map(|column| Column([column.0[lane]])).collect();
        debug_assert_eq!(self.registers.len(), program.registers as usize);
        Machine { registers, steps: 0, endless: [0; 1] }
    }

    /// A component of the entry function's result.
    pub(crate) fn float(&self, program: &Program, lane: usize, component: u32) -> f32 {
        f32::from_bits(self.bits(program, lane, component))
    }

    pub(crate) fn bits(&self, program: &Program, lane: usize, component: u32) -> u32 {
        let result = program.entry().result;
        if component < result.count { self.registers[(result.first + component) as usize].0[lane] } else { 0 }
    }

    /// Runs the entry function for the first `lanes` lanes.
    pub(crate) fn run(
        &mut self,
        program: &Program,
        lanes: usize,
        environment: &dyn Environment,
    ) -> Result<(), TooLong> {
        let mask = if lanes >= 32 { u32::MAX } else { (1 << lanes) - 1 };
        let registers = &mut self.registers;
        let mut run = Run { program, environment, registers, steps: 0, spent: [0; N], endless: [0; N] };
        let done = run.run_block(&program.entry().body, mask, program.entry(), &mut ExitedLanes::default());
        (self.steps, self.endless) = (run.steps, run.endless);
        done.map(|_| ())
    }
}

impl<const N: usize> Run<'_, N>
where
    Lanes: Width<N>,
{
    fn count_steps(&mut self, count: u32) -> Result<(), TooLong> {
        self.steps = self.steps.saturating_add(count);
        if self.steps > MAX_UNCOUNTED_STEPS { Err(TooLong) } else { Ok(()) }
    }

    fn column(&self, register: Register) -> &Column<N> {
        &self.registers[register as usize]
    }

    /// Mask of the lanes in which a register is not 0.
    fn nonzero_lanes(&self, register: Register) -> u32 {
        self.column(register).0.iter().enumerate().fold(0, |lanes, (i, v)| lanes | u32::from(*v != 0) << i)
    }

    fn store(&mut self, to: Register, value: Column<N>, mask: u32) {
        let out = &mut self.registers[to as usize];
        if mask.trailing_ones() as usize >= N {
            *out = value;
            return;
        }
        for (i, (out, value)) in out.0.iter_mut().zip(value.0).enumerate() {
            *out = if mask >> i & 1 == 1 { value } else { *out };
        }
    }

    /// Runs statements, and returns the lanes that reach their end.
    fn run_block(
        &mut self,
        nodes: &[Node],
        mut mask: u32,
        routine: &Routine,
        exited: &mut ExitedLanes,
    ) -> Result<u32, TooLong> {
        for node in nodes {
            match node {
                Node::Compute(node) => run_kernel(node, self.registers, mask),
                Node::Copy { to, from, count } => {
                    let from = *from as usize;
                    self.registers.copy_within(from..from + *count as usize, *to as usize);
                }
                Node::Store { to, from, count } => {
                    for i in 0..*count {
                        self.store(to + i, *self.column(from + i), mask);
                    }
                }
                Node::Steps(count) => self.count_steps(*count)?,
                Node::LoadElement { .. } | Node::StoreElement { .. } => self.access_element(node, mask),
                Node::If { condition, accept, reject } => {
                    let truths = self.nonzero_lanes(*condition);
                    let mut side = |nodes: &[Node], mask: u32| match mask {
                        0 => Ok(0),
                        _ => self.run_block(nodes, mask, routine, exited),
                    };
                    mask = side(accept, mask & truths)? | side(reject, mask & !truths)?;
                }
                Node::Switch { selector, cases } => {
                    mask = self.run_switch(*selector, cases, mask, routine, exited)?
                }
                Node::Loop { .. } => mask = self.run_loop(node, mask, routine)?,
                Node::Break => {
                    exited.broken |= mask;
                    return Ok(0);
                }
                Node::Continue => {
                    exited.continued |= mask;
                    return Ok(0);
                }
                Node::Return(value) => {
                    for (to, from) in routine.result.iter().zip(value) {
                        self.store(to, *self.column(*from), mask);
                    }
                    return Ok(0);
                }
                Node::Call { routine, arguments } => {
                    let routine = &self.program.routines[*routine];
                    let to = routine.arguments.iter().flat_map(|argument| argument.iter());
                    for (to, from) in to.zip(arguments) {
                        self.registers[to as usize] = *self.column(*from);
                    }
                    self.run_block(&routine.body, mask, routine, &mut ExitedLanes::default())?;
                }
                Node::Host { host, arguments, result } => {
                    self.call_host(*host, arguments, result.iter(), mask);
                }
            }
            if mask == 0 {
                break;
            }
        }
        Ok(mask)
    }

    /// Loads or stores an array element, at each lane's own offset.
    fn access_element(&mut self, node: &Node, mask: u32) {
        let active = (0..N).filter(|i| mask >> i & 1 == 1);
        match node {
            Node::LoadElement { to, first, offset } => {
                let offsets = *self.column(*offset);
                for i in active {
                    let from = self.column(first + offsets.0[i]).0[i];
                    self.registers[*to as usize].0[i] = from;
                }
            }
            Node::StoreElement { first, offset, from } => {
                let (offsets, value) = (*self.column(*offset), *self.column(*from));
                for i in active {
                    self.registers[(first + offsets.0[i]) as usize].0[i] = value.0[i];
                }
            }
            _ => {}
        }
    }

    fn run_switch(
        &mut self,
        selector: Register,
        cases: &[Case],
        mask: u32,
        routine: &Routine,
        exited: &mut ExitedLanes,
    ) -> Result<u32, TooLong> {
        let values = *self.column(selector);
        let default = cases.iter().position(|case| case.value.is_none());
        let mut starts = vec![0u32; cases.len()];
        for i in (0..N).filter(|i| mask >> i & 1 == 1) {
            let hit = cases.iter().position(|case| case.value == Some(values.0[i])).or(default);
            if let Some(hit) = hit {
                starts[hit] |= 1 << i;
            }
        }
        // Lanes that match no case, and lanes that reach the end of a case.
        let mut after = mask & !starts.iter().fold(0, |all, lanes| all | lanes);
        let (mut inner, mut falling) = (ExitedLanes::default(), 0);
        for (case, start) in cases.iter().zip(starts) {
            let now = falling | start;
            let end = if now == 0 { 0 } else { self.run_block(&case.body, now, routine, &mut inner)? };
            falling = if case.fall_through { end } else { 0 };
            after |= end & !falling;
        }
        exited.continued |= inner.continued;
        Ok(after | falling | inner.broken)
    }

    /// Runs all rounds of a loop.
    fn run_loop(&mut self, node: &Node, mask: u32, routine: &Routine) -> Result<u32, TooLong> {
        let Node::Loop { body, continuing, break_if } = node else { return Ok(mask) };
        let (mut live, mut after) = (mask, 0);
        while live != 0 {
            self.count_steps(1)?;
            let mut exited = ExitedLanes::default();
            let end = self.run_block(body, live, routine, &mut exited)?;
            after |= exited.broken;
            live = end | exited.continued;
            if live != 0 {
                live = self.run_block(continuing, live, routine, &mut ExitedLanes::default())?;
                if let Some(condition) = break_if {
                    let done = live & self.nonzero_lanes(*condition);
                    after |= done;
                    live &= !done;
                }
            }
        }
        Ok(after)
    }

    /// `effect_round` of effect_faults.wgsl: 1 in the lanes that took too many steps.
    fn count_round(&mut self, cost: [u32; N], number: [u32; N], mask: u32) -> Column<N> {
        let mut over = Column::ZERO;
        for i in (0..N).filter(|i| mask >> i & 1 == 1) {
            self.spent[i] = self.spent[i].saturating_add(cost[i]);
            if self.spent[i] > MAX_STEPS {
                over.0[i] = 1;
                self.endless[i] = if self.endless[i] == 0 { number[i] } else { self.endless[i] };
            }
        }
        over
    }

    fn call_host(
        &mut self,
        host: HostFunction,
        arguments: &[Register],
        mut result: impl Iterator<Item = Register>,
        mask: u32,
    ) {
        if let (HostFunction::CountRound, [cost, number]) = (host, arguments) {
            let (cost, number) = (self.column(*cost).0, self.column(*number).0);
            let over = self.count_round(cost, number, mask);
            if let Some(to) = result.next() {
                self.registers[to as usize] = over;
            }
            return;
        }
        if let (Some(image), [x, y]) = (self.environment.image(host), arguments) {
            let (x, y) = (*self.column(*x), *self.column(*y));
            let first = result.map(|r| r as usize).next().unwrap_or(0);
            if let Some(out) = self.registers[first..].first_chunk_mut::<4>() {
                read_pixels(image, &x, &y, mask, out);
            }
            return;
        }
        let result: Vec<Register> = result.collect();
        if arguments.is_empty() {
            for (to, bits) in result.iter().zip(self.environment.call(host, &[])) {
                self.registers[*to as usize] = Column::splat(bits);
            }
            return;
        }
        let mut values = [0; 4];
        for i in (0..N).filter(|i| mask >> i & 1 == 1) {
            for (value, register) in values.iter_mut().zip(arguments) {
                *value = self.column(*register).0[i];
            }
            let count = arguments.len().min(values.len());
            let given = self.environment.call(host, &values[..count]);
            for (to, bits) in result.iter().zip(given) {
                self.registers[*to as usize].0[i] = bits;
            }
        }
    }
}

#[inline(always)]
fn run_kernel<const N: usize>(node: &Compute, registers: &mut [Column<N>], mask: u32)
where
    Lanes: Width<N>,
{
    let (low, high) = registers.split_at_mut(node.out as usize);
    Lanes::kernel(&node.kernels)(&node.operands, &mut Columns { low, high, mask });
}

/// Reads the pixels of an image at the coordinates of each active lane.
fn read_pixels<const N: usize>(
    image: EffectImage,
    x: &Column<N>,
    y: &Column<N>,
    mask: u32,
    out: &mut [Column<N>; 4],
) {
    let (first, row) = (x.0[0] as i32, y.0[0] as i32);
    let [width, height] = image.size.map(|s| s as i32);
    // Most calls read neighboring pixels of a row.
    let off = |i: usize| x.0[i].wrapping_sub(i as u32) ^ x.0[0] | y.0[i] ^ y.0[0];
    let in_row = (0..N).fold(0, |all, i| all | off(i)) == 0;
    if in_row && first >= 0 && i64::from(first) + N as i64 <= i64::from(width) {
        let start = row.clamp(0, height - 1) as usize * width as usize + first as usize;
        let (fours, rest) = image.rgba[start..start + N].as_chunks::<4>();
        for (k, four) in fours.iter().enumerate() {
            let [p, q, r, s] = four.map(|pixel| pixel.to_array().map(f32::to_bits));
            for (c, out) in out.iter_mut().enumerate() {
                out.0[4 * k..4 * k + 4].copy_from_slice(&[p[c], q[c], r[c], s[c]]);
            }
        }
        for (i, pixel) in rest.iter().enumerate() {
            set_lane(out, N / 4 * 4 + i, *pixel);
        }
    } else {
        for i in (0..N).filter(|i| mask >> i & 1 == 1) {
            set_lane(out, i, image.at(x.0[i] as i32, y.0[i] as i32));
        }
    }
}

/// Sets the four components of one lane.
#[inline(always)]
fn set_lane<const N: usize>(out: &mut [Column<N>; 4], lane: usize, value: Vec4) {
    for (column, component) in out.iter_mut().zip(value.to_array()) {
        column.0[lane] = component.to_bits();
    }
}
