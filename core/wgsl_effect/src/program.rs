//! A validated module, evaluated a pixel at a time: the CPU's side of an effect, from the text that Vulkan runs.
//!
//! A plain walk over naga's expressions. What it does not know is refused when the effect is loaded, with its line.

use crate::forms::Host;
use crate::maths;
use crate::prepare::{self, Code, code};
use crate::shape::{self, MOST, Value};
use naga::valid::ModuleInfo;
use naga::{
    Block, Expression, Function, Handle, Literal, Module, RelationalFunction, Span, Statement, SwitchValue,
};

/// Steps (statements and loop rounds) that one pixel may take.
pub const MOST_STEPS: u32 = 100_000;

/// What this evaluator does not know, and where it stands.
pub struct Unsupported {
    pub what: String,
    pub span: Span,
}

pub struct Program {
    module: Module,
    entry: Handle<Function>,
    functions: Vec<Code>,
    /// Function that runs in place of each function, if any.
    hosts: Vec<Option<Host>>,
    globals: Vec<Value>,
}

/// What runs in place of functions of the shader around the effect's.
pub trait Around {
    fn call(&self, host: Host, arguments: &[Value]) -> Value;
}

struct Frame<'a> {
    function: &'a Function,
    code: &'a Code,
    arguments: Vec<Value>,
    slots: Vec<Value>,
    memory: Vec<u32>,
}

enum Flow {
    Next,
    Break,
    Continue,
    Return(Value),
}

/// The step limit was reached.
pub struct TooLong {
    /// Loop with the most rounds: the one that does not end.
    pub span: Option<Span>,
    rounds: u32,
}

/// What a run gave, and how many steps it took.
pub struct Done {
    pub value: Value,
    pub steps: u32,
}

/// One run of the entry function.
struct Run<'a> {
    around: &'a dyn Around,
    steps: u32,
}

impl Program {
    /// `host`: what runs in place of a function of a name.
    pub fn new(
        module: Module,
        info: &ModuleInfo,
        entry: Handle<Function>,
        host: impl Fn(&str) -> Option<Host>,
    ) -> Result<Program, Unsupported> {
        if let Some((_, variable)) = module.global_variables.iter().next() {
            let name = variable.name.clone().unwrap_or_default();
            let span = module
                .global_variables
                .iter()
                .next()
                .map_or(Span::UNDEFINED, |(h, _)| module.global_variables.get_span(h));
            return Err(Unsupported {
                what: format!(
                    "global variable {name}: an effect is a function of one pixel and has no variables of its own"
                ),
                span,
            });
        }
        // naga orders functions so that those that are called come first.
        let mut levels = Vec::with_capacity(module.functions.len());
        for (_, function) in module.functions.iter() {
            levels.push(prepare::levels(function, &levels)?);
        }
        let functions =
            module.functions.iter().map(|(h, f)| code(&module, info, h, f)).collect::<Result<_, _>>()?;
        let hosts = module.functions.iter().map(|(_, f)| f.name.as_deref().and_then(&host)).collect();
        let mut program = Program { module, entry, functions, hosts, globals: Vec::new() };
        for (handle, expression) in program.module.global_expressions.iter() {
            let value = program.global(expression).ok_or_else(|| Unsupported {
                what: "this constant".into(),
                span: program.module.global_expressions.get_span(handle),
            })?;
            program.globals.push(value);
        }
        Ok(program)
    }

    pub fn run(&self, arguments: Vec<Value>, around: &dyn Around) -> Result<Done, TooLong> {
        let mut run = Run { around, steps: 0 };
        let value = self.call(self.entry, arguments, &mut run)?;
        Ok(Done { value, steps: run.steps })
    }

    /// Constants stand before what uses them; naga has folded everything else.
    fn global(&self, expression: &Expression) -> Option<Value> {
        let known = |h: &Handle<Expression>| self.globals.get(h.index()).copied();
        match expression {
            Expression::Literal(literal) => Some(value_of(*literal)),
            Expression::Constant(c) => known(&self.module.constants[*c].init),
            Expression::ZeroValue(_) => Some(Value::default()),
            Expression::Splat { size, value } => {
                let v = known(value)?;
                Some(Value::floats(&[v.f(0); 4][..*size as usize]))
            }
            Expression::Compose { ty, components } => {
                let sizes = self.component_sizes(*ty, components.len())?;
                let mut out = Value::default();
                let mut at = 0;
                for (part, size) in components.iter().zip(sizes) {
                    let part = known(part)?;
                    out.0.get_mut(at..at + size)?.copy_from_slice(&part.0[..size]);
                    at += size;
                }
                Some(out)
            }
            _ => None,
        }
    }

    fn component_sizes(&self, ty: Handle<naga::Type>, count: usize) -> Option<Vec<usize>> {
        let types = &self.module.types;
        match &types[ty].inner {
            naga::TypeInner::Struct { members, .. } => {
                members.iter().map(|m| shape::shape(&types[m.ty].inner, types).map(|s| s.size)).collect()
            }
            inner => Some(vec![shape::shape(inner, types)?.size / count.max(1); count]),
        }
    }

    fn call(
        &self,
        function: Handle<Function>,
        arguments: Vec<Value>,
        run: &mut Run<'_>,
    ) -> Result<Value, TooLong> {
        if let Some(host) = self.hosts[function.index()] {
            return Ok(run.around.call(host, &arguments));
        }
        let code = &self.functions[function.index()];
        let function = &self.module.functions[function];
        let mut frame = Frame {
            function,
            code,
            arguments,
            slots: vec![Value::default(); function.expressions.len()],
            memory: vec![0; code.memory],
        };
        for (handle, variable) in function.local_variables.iter() {
            if let Some(init) = variable.init {
                let (at, size) = code.locals[handle.index()];
                let value = self.read(&frame, init);
                frame.memory[at..at + size].copy_from_slice(&value.0[..size]);
            }
        }
        match self.block(&mut frame, &function.body, run)? {
            Flow::Return(value) => Ok(value),
            _ => Ok(Value::default()),
        }
    }

    fn block(&self, frame: &mut Frame<'_>, block: &Block, run: &mut Run<'_>) -> Result<Flow, TooLong> {
        for (statement, span) in block.span_iter() {
            run.steps += 1;
            if run.steps > MOST_STEPS {
                return Err(TooLong { span: None, rounds: 0 });
            }
            let flow = self.statement(frame, (statement, *span), run)?;
            if !matches!(flow, Flow::Next) {
                return Ok(flow);
            }
        }
        Ok(Flow::Next)
    }

    fn statement(
        &self,
        frame: &mut Frame<'_>,
        (statement, span): (&Statement, Span),
        run: &mut Run<'_>,
    ) -> Result<Flow, TooLong> {
        match statement {
            Statement::Emit(range) => {
                for handle in range.clone() {
                    frame.slots[handle.index()] = self.evaluate(frame, handle);
                }
            }
            Statement::Block(block) => return self.block(frame, block, run),
            Statement::If { condition, accept, reject } => {
                let truth = self.read(frame, *condition).0[0] != 0;
                return self.block(frame, if truth { accept } else { reject }, run);
            }
            Statement::Switch { selector, cases } => {
                let value = self.read(frame, *selector).0[0];
                let hit = |c: &naga::SwitchCase| match c.value {
                    SwitchValue::I32(v) => v as u32 == value,
                    SwitchValue::U32(v) => v == value,
                    SwitchValue::Default => false,
                };
                let default = |c: &naga::SwitchCase| c.value == SwitchValue::Default;
                let start = cases.iter().position(hit).or_else(|| cases.iter().position(default));
                for case in cases.iter().skip(start.unwrap_or(cases.len())) {
                    match self.block(frame, &case.body, run)? {
                        Flow::Next if case.fall_through => {}
                        Flow::Next | Flow::Break => break,
                        other => return Ok(other),
                    }
                }
            }
            Statement::Loop { .. } => {
                let mut rounds = 0;
                let flow = self.rounds(frame, statement, run, &mut rounds);
                return flow.map_err(|e| match e.rounds < rounds {
                    true => TooLong { span: Some(span), rounds },
                    false => e,
                });
            }
            Statement::Break => return Ok(Flow::Break),
            Statement::Continue => return Ok(Flow::Continue),
            Statement::Return { value } => {
                return Ok(Flow::Return(value.map_or(Value::default(), |v| self.read(frame, v))));
            }
            Statement::Store { pointer, value } => {
                let (at, size) = self.place(frame, *pointer);
                let value = self.read(frame, *value);
                if let Some(target) = frame.memory.get_mut(at..at + size.min(MOST)) {
                    target.copy_from_slice(&value.0[..target.len()]);
                }
            }
            Statement::Call { function, arguments, result } => {
                let arguments = arguments.iter().map(|a| self.read(frame, *a)).collect();
                let value = self.call(*function, arguments, run)?;
                if let Some(result) = result {
                    frame.slots[result.index()] = value;
                }
            }
            // Refused by `code`.
            _ => {}
        }
        Ok(Flow::Next)
    }

    /// All rounds of a loop, counted.
    fn rounds(
        &self,
        frame: &mut Frame<'_>,
        statement: &Statement,
        run: &mut Run<'_>,
        rounds: &mut u32,
    ) -> Result<Flow, TooLong> {
        let Statement::Loop { body, continuing, break_if } = statement else { return Ok(Flow::Next) };
        loop {
            *rounds += 1;
            run.steps += 1;
            if run.steps > MOST_STEPS {
                return Err(TooLong { span: None, rounds: 0 });
            }
            match self.block(frame, body, run)? {
                Flow::Break => return Ok(Flow::Next),
                Flow::Return(value) => return Ok(Flow::Return(value)),
                Flow::Next | Flow::Continue => {}
            }
            self.block(frame, continuing, run)?;
            if let Some(condition) = break_if
                && self.read(frame, *condition).0[0] != 0
            {
                return Ok(Flow::Next);
            }
        }
    }

    fn read(&self, frame: &Frame<'_>, handle: Handle<Expression>) -> Value {
        match &frame.function.expressions[handle] {
            Expression::Literal(literal) => value_of(*literal),
            Expression::Constant(c) => {
                self.globals.get(self.module.constants[*c].init.index()).copied().unwrap_or_default()
            }
            Expression::ZeroValue(_) => Value::default(),
            Expression::FunctionArgument(i) => frame.arguments.get(*i as usize).copied().unwrap_or_default(),
            Expression::Compose { .. } | Expression::Splat { .. } => {
                // Parts of a variable's first value are never emitted.
                self.evaluate(frame, handle)
            }
            _ => frame.slots[handle.index()],
        }
    }

    /// A pointer's first component in the frame's memory, and how many it covers.
    fn place(&self, frame: &Frame<'_>, pointer: Handle<Expression>) -> (usize, usize) {
        let size = frame.code.shapes[pointer.index()].size;
        match &frame.function.expressions[pointer] {
            Expression::LocalVariable(v) => frame.code.locals[v.index()],
            Expression::AccessIndex { base, .. } => {
                (self.place(frame, *base).0 + frame.code.offsets[pointer.index()], size)
            }
            Expression::Access { base, index } => {
                let (at, all) = self.place(frame, *base);
                (at + self.step(frame, *base, *index, all), size)
            }
            _ => (0, 0),
        }
    }

    /// Components before the element with this index; beyond the end, the last element's, as WGSL allows.
    fn step(
        &self,
        frame: &Frame<'_>,
        base: Handle<Expression>,
        index: Handle<Expression>,
        all: usize,
    ) -> usize {
        let step = frame.code.shapes[base.index()].step.max(1);
        let last = (all / step).saturating_sub(1);
        step * (self.read(frame, index).0[0] as usize).min(last)
    }

    fn evaluate(&self, frame: &Frame<'_>, handle: Handle<Expression>) -> Value {
        let shape_of = |h: Handle<Expression>| frame.code.shapes[h.index()];
        let here = shape_of(handle);
        match &frame.function.expressions[handle] {
            Expression::Compose { components, .. } => {
                let mut out = Value::default();
                let mut at = 0;
                for part in components {
                    let size = shape_of(*part).size;
                    if let Some(target) = out.0.get_mut(at..at + size) {
                        target.copy_from_slice(&self.read(frame, *part).0[..size]);
                    }
                    at += size;
                }
                out
            }
            Expression::Splat { size, value } => {
                let mut out = Value::default();
                out.0[..*size as usize].fill(self.read(frame, *value).0[0]);
                out
            }
            Expression::Swizzle { size, vector, pattern } => {
                let v = self.read(frame, *vector);
                let mut out = Value::default();
                for (slot, component) in out.0.iter_mut().zip(pattern).take(*size as usize) {
                    *slot = v.0[*component as usize];
                }
                out
            }
            // Pointers are worked out where they are used.
            Expression::Access { .. } | Expression::AccessIndex { .. } if here.is_pointer => Value::default(),
            Expression::Access { base, index } => {
                let at = self.step(frame, *base, *index, shape_of(*base).size);
                part(self.read(frame, *base), at, here.size)
            }
            Expression::AccessIndex { base, .. } => {
                part(self.read(frame, *base), frame.code.offsets[handle.index()], here.size)
            }
            Expression::Load { pointer } => {
                let (at, size) = self.place(frame, *pointer);
                let mut out = Value::default();
                if let Some(source) = frame.memory.get(at..at + size.min(MOST)) {
                    out.0[..source.len()].copy_from_slice(source);
                }
                out
            }
            Expression::Unary { op, expr } => maths::unary(*op, self.read(frame, *expr), here),
            Expression::Binary { op, left, right } => maths::binary(
                *op,
                self.read(frame, *left),
                shape_of(*left),
                self.read(frame, *right),
                shape_of(*right),
            ),
            Expression::Select { condition, accept, reject } => {
                let (c, a, r) =
                    (self.read(frame, *condition), self.read(frame, *accept), self.read(frame, *reject));
                let one = shape_of(*condition).size == 1;
                let mut out = Value::default();
                for i in 0..here.size {
                    out.0[i] = if c.0[if one { 0 } else { i }] != 0 { a.0[i] } else { r.0[i] };
                }
                out
            }
            Expression::Relational { fun, argument } => {
                let v = self.read(frame, *argument);
                let s = shape_of(*argument);
                let mut truths = v.0[..s.size].iter().map(|t| *t != 0);
                let truth = match fun {
                    RelationalFunction::All => truths.all(|t| t),
                    _ => truths.any(|t| t),
                };
                let mut out = Value::default();
                out.0[0] = u32::from(truth);
                out
            }
            Expression::Math { fun, arg, arg1, arg2, arg3 } => {
                let first = (self.read(frame, *arg), shape_of(*arg));
                let mut all = [first; 4];
                let mut count = 1;
                for next in [arg1, arg2, arg3].into_iter().flatten() {
                    all[count] = (self.read(frame, *next), shape_of(*next));
                    count += 1;
                }
                maths::maths(*fun, &all[..count])
            }
            Expression::As { expr, kind, convert } => {
                maths::convert(self.read(frame, *expr), shape_of(*expr), *kind, convert.is_none())
            }
            _ => self.read(frame, handle),
        }
    }
}

fn part(v: Value, at: usize, size: usize) -> Value {
    let mut out = Value::default();
    if let Some(source) = v.0.get(at..at + size) {
        out.0[..size].copy_from_slice(source);
    }
    out
}

fn value_of(literal: Literal) -> Value {
    let mut out = Value::default();
    out.0[0] = match literal {
        Literal::F32(v) => v.to_bits(),
        Literal::U32(v) => v,
        Literal::I32(v) => v as u32,
        Literal::Bool(v) => u32::from(v),
        Literal::AbstractInt(v) => v as u32,
        Literal::AbstractFloat(v) => (v as f32).to_bits(),
        _ => 0,
    };
    out
}
