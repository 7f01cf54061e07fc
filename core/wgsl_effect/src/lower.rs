//! Lowers a validated naga module to register code. Features that the machine does not support are refused here, with their place.

use crate::environment::HostFunction;
use crate::operators::{
    Conversion, FloatOperator, IntegerOperator, Operands, Operator, is_component_function,
};
use crate::program::{Case, Compute, Kernels, Node, Program, Register, Registers, Routine, Unsupported};
use crate::shape::{self, ComponentKind, MAX_COMPONENTS, Shape};
use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    BinaryOperator, Block, Expression, Function, Handle, Literal, MathFunction, Module, RelationalFunction,
    ScalarKind, Span, Statement, SwitchValue, TypeInner, UnaryOperator,
};
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicU64, Ordering};

/// Lowers a module. `host` returns the code that runs in place of a function with this name.
pub(crate) fn lower(
    module: &Module,
    info: &ModuleInfo,
    entry: Handle<Function>,
    host: impl Fn(&str) -> Option<HostFunction>,
) -> Result<Program, Unsupported> {
    static NEXT_ID: AtomicU64 = AtomicU64::new(0);
    if let Some((handle, variable)) = module.global_variables.iter().next() {
        let name = variable.name.clone().unwrap_or_default();
        return Err(Unsupported {
            what: format!(
                "global variable {name}: an effect is a function of one pixel and has no variables of its own"
            ),
            span: module.global_variables.get_span(handle),
        });
    }
    // naga orders functions so that callees come before their callers.
    let mut levels = Vec::with_capacity(module.functions.len());
    for (_, function) in module.functions.iter() {
        levels.push(nesting_depth(function, &levels)?);
    }
    let mut code = Code::default();
    // Register 0 is the operand of operators that have fewer operands.
    code.constant(0);
    let globals = constant_bits(module)?;
    let mut routines: Vec<Routine> = Vec::with_capacity(module.functions.len());
    for (handle, function) in module.functions.iter() {
        let host = function.name.as_deref().and_then(&host);
        let lowering = Lowering::new((module, info), handle, &globals, &routines, &mut code)?;
        routines.push(lowering.lower_routine(host, handle == entry)?);
    }
    let mut read = vec![false; code.registers as usize];
    routines.iter().for_each(|routine| mark_read(&routine.body, &mut read));
    let inputs = routines[entry.index()].arguments.iter().map(|argument| {
        let used = argument.iter().zip(0..).filter(|(register, _)| read[*register as usize]);
        used.map(|(_, component)| component).collect()
    });
    let inputs = inputs.collect();
    let last = module.functions[entry].arguments.last().map(|last| &module.types[last.ty].inner);
    let parameters = last.map_or_else(Vec::new, |last| shape::component_kinds(last, &module.types));
    Ok(Program {
        id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
        registers: code.registers,
        constants: code.bits.into_iter().collect(),
        prologue: code.prologue,
        routines,
        entry: entry.index(),
        inputs,
        parameters,
    })
}

/// Marks the registers that nodes read.
fn mark_read(nodes: &[Node], read: &mut [bool]) {
    for node in nodes {
        let mut mark = |register: Register| read[register as usize] = true;
        match node {
            Node::Compute(Compute { operands, .. }) => {
                let steps = operands.first.into_iter().zip(operands.step);
                steps.for_each(|(first, step)| (0..operands.count).for_each(|i| mark(first + i * step)));
            }
            Node::Copy { from, count, .. } | Node::Store { from, count, .. } => {
                (*from..from + count).for_each(&mut mark);
            }
            Node::LoadElement { first, offset, .. } => {
                mark(*offset);
                // Any element from this register on may be read.
                let end = (*first as usize + MAX_COMPONENTS).min(read.len());
                read[*first as usize..end].fill(true);
            }
            Node::StoreElement { offset, from, .. } => [*offset, *from].into_iter().for_each(&mut mark),
            Node::If { condition, accept, reject } => {
                mark(*condition);
                mark_read(accept, read);
                mark_read(reject, read);
            }
            Node::Switch { selector, cases } => {
                mark(*selector);
                cases.iter().for_each(|case| mark_read(&case.body, read));
            }
            Node::Loop { body, continuing, break_if, .. } => {
                break_if.iter().copied().for_each(&mut mark);
                mark_read(body, read);
                mark_read(continuing, read);
            }
            Node::Return(values) | Node::Call { arguments: values, .. } => {
                values.iter().copied().for_each(&mut mark);
            }
            Node::Host { arguments, .. } => arguments.iter().copied().for_each(&mut mark),
            Node::Steps(_) | Node::Break | Node::Continue => {}
        }
    }
}

/// Largest nesting of statements and calls: the machine recurses through them.
const MAX_NESTING: usize = 200;

/// Refuses a function whose statements, together with those of the functions that they call, are nested too deeply. `known`: the levels of
/// the functions before it, which are the only ones that it can call.
fn nesting_depth(function: &Function, known: &[usize]) -> Result<usize, Unsupported> {
    let mut deepest = 0;
    check_nesting(&function.body, 1, known, &mut deepest)?;
    Ok(deepest)
}

fn check_nesting(
    block: &Block,
    level: usize,
    known: &[usize],
    deepest: &mut usize,
) -> Result<(), Unsupported> {
    for (statement, span) in block.span_iter() {
        let called = match statement {
            Statement::Call { function, .. } => known.get(function.index()).copied().unwrap_or(0),
            _ => 0,
        };
        if level + called > MAX_NESTING {
            return Err(Unsupported {
                what: format!("more than {MAX_NESTING} nested statements and calls"),
                span: *span,
            });
        }
        *deepest = (*deepest).max(level + called);
        let mut below = |block: &Block| check_nesting(block, level + 1, known, deepest);
        match statement {
            Statement::Block(block) => below(block)?,
            Statement::If { accept, reject, .. } => {
                below(accept)?;
                below(reject)?;
            }
            Statement::Switch { cases, .. } => cases.iter().try_for_each(|case| below(&case.body))?,
            Statement::Loop { body, continuing, .. } => {
                below(body)?;
                below(continuing)?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Bits of the module's constant expressions, by index. Constants come before their uses, and naga has folded all other expressions.
fn constant_bits(module: &Module) -> Result<Vec<Vec<u32>>, Unsupported> {
    let mut all: Vec<Vec<u32>> = Vec::with_capacity(module.global_expressions.len());
    for (handle, expression) in module.global_expressions.iter() {
        let size =
            |ty: Handle<naga::Type>| shape::shape(&module.types[ty].inner, &module.types).map(|s| s.size);
        let value = match expression {
            Expression::Literal(literal) => Some(vec![bits_of(*literal)]),
            Expression::Constant(c) => Some(all[module.constants[*c].init.index()].clone()),
            Expression::ZeroValue(ty) => size(*ty).map(|size| vec![0; size]),
            Expression::Splat { size, value } => Some(vec![all[value.index()][0]; *size as usize]),
            Expression::Compose { components, .. } => {
                Some(components.iter().flat_map(|part| all[part.index()].iter().copied()).collect())
            }
            _ => None,
        };
        all.push(value.ok_or_else(|| Unsupported {
            what: "this constant".into(),
            span: module.global_expressions.get_span(handle),
        })?);
    }
    Ok(all)
}

fn bits_of(literal: Literal) -> u32 {
    match literal {
        Literal::F32(v) => v.to_bits(),
        Literal::U32(v) => v,
        Literal::I32(v) => v as u32,
        Literal::Bool(v) => u32::from(v),
        Literal::AbstractInt(v) => v as u32,
        Literal::AbstractFloat(v) => (v as f32).to_bits(),
        _ => 0,
    }
}

/// The registers that are allocated, and their known properties.
#[derive(Default)]
struct Code {
    registers: u32,
    /// First registers of constant scalars and vectors, by their bits; the components of a vector are in consecutive registers.
    constants: HashMap<Vec<u32>, Register>,
    bits: HashMap<Register, u32>,
    /// Registers of parameters, and of results that depend only on parameters and constants: they are the same in all lanes and batches.
    invariant: HashSet<Register>,
    prologue: Vec<Compute>,
}

impl Code {
    fn allocate(&mut self, count: usize) -> Registers {
        let first = self.registers;
        self.registers += count as u32;
        Registers { first, count: count as u32 }
    }

    fn constant(&mut self, bits: u32) -> Register {
        self.constant_vector(vec![bits])
    }

    fn constant_vector(&mut self, vector: Vec<u32>) -> Register {
        if let Some(known) = self.constants.get(&vector) {
            return *known;
        }
        let registers = self.allocate(vector.len());
        self.bits.extend(registers.iter().zip(vector.iter().copied()));
        self.constants.insert(vector, registers.first);
        registers.first
    }

    fn is_invariant(&self, register: Register) -> bool {
        self.bits.contains_key(&register) || self.invariant.contains(&register)
    }

    /// The same components, in consecutive registers if they are constants.
    fn consecutive_if_constant(&mut self, components: Vec<Register>) -> Vec<Register> {
        let bits: Option<Vec<u32>> = components.iter().map(|r| self.bits.get(r).copied()).collect();
        match bits {
            Some(bits) if !components.windows(2).all(|w| w[0] == w[1]) => {
                let first = self.constant_vector(bits);
                (first..).take(components.len()).collect()
            }
            _ => components,
        }
    }
}

/// The value of an expression during lowering.
#[derive(Clone)]
enum Value {
    /// One register per component. Swizzles and members share the registers of the value from which they are taken.
    Components(Vec<Register>),
    /// A variable or a part of it: its first register, and an offset that can differ in each lane.
    Pointer { first: Register, offset: Option<Register> },
}

/// The function that is being lowered.
struct Lowering<'a> {
    module: &'a Module,
    function: &'a Function,
    infos: &'a ModuleInfo,
    info: &'a FunctionInfo,
    globals: &'a [Vec<u32>],
    routines: &'a [Routine],
    code: &'a mut Code,
    shapes: Vec<Shape>,
    /// Values of the expressions lowered so far.
    values: Vec<Option<Value>>,
    parameters: Vec<Registers>,
    /// Registers of the parameters; those of the caller if the function is inlined.
    arguments: Vec<Vec<Register>>,
    result: Registers,
    /// The returned value, if the function is inlined.
    returned: Option<Vec<Register>>,
    is_inlined: bool,
    locals: Vec<Registers>,
    /// Vectors of this block and the blocks around it whose components are in separate registers. At the second use they are copied to
    /// consecutive registers; the value is the first of these.
    contiguous_copies: HashMap<Vec<Register>, Option<Register>>,
    nodes: Vec<Node>,
}

impl<'a> Lowering<'a> {
    fn new(
        (module, infos): (&'a Module, &'a ModuleInfo),
        handle: Handle<Function>,
        globals: &'a [Vec<u32>],
        routines: &'a [Routine],
        code: &'a mut Code,
    ) -> Result<Lowering<'a>, Unsupported> {
        let function = &module.functions[handle];
        let (types, info) = (&module.types, &infos[handle]);
        let mut shapes = Vec::with_capacity(function.expressions.len());
        for (handle, expression) in function.expressions.iter() {
            let refuse = |what: &str| {
                Err(Unsupported { what: what.into(), span: function.expressions.get_span(handle) })
            };
            let Some(shape) = shape::shape(info[handle].ty.inner_with(types), types) else {
                return refuse("this type of value");
            };
            if shape.size > MAX_COMPONENTS && !shape.is_pointer {
                return refuse("a value of more than 64 numbers; index the variable directly");
            }
            if let Some(what) = unsupported_feature(expression) {
                return refuse(what);
            }
            shapes.push(shape);
        }
        let size = |ty: Handle<naga::Type>| shape::shape(&types[ty].inner, types).map_or(0, |s| s.size);
        let parameters: Vec<_> = function.arguments.iter().map(|a| code.allocate(size(a.ty))).collect();
        let result = code.allocate(function.result.as_ref().map_or(0, |r| size(r.ty)));
        let mut locals = Vec::new();
        for (handle, variable) in function.local_variables.iter() {
            let refuse = |what: &str| {
                Err(Unsupported { what: what.into(), span: function.local_variables.get_span(handle) })
            };
            let Some(shape) = shape::shape(&types[variable.ty].inner, types) else {
                return refuse("a variable of this type");
            };
            if shape.size > MAX_COMPONENTS && variable.init.is_some() {
                return refuse("an initial value of more than 64 numbers");
            }
            locals.push(code.allocate(shape.size));
        }
        let values = vec![None; function.expressions.len()];
        Ok(Lowering {
            module,
            function,
            infos,
            info,
            globals,
            routines,
            code,
            shapes,
            values,
            arguments: parameters.iter().map(|parameter| parameter.iter().collect()).collect(),
            parameters,
            result,
            returned: None,
            is_inlined: false,
            locals,
            contiguous_copies: HashMap::new(),
            nodes: Vec::new(),
        })
    }

    /// Finishes the routine. With `host`, the routine only calls the supplied function, and needs no body.
    fn lower_routine(mut self, host: Option<HostFunction>, is_entry: bool) -> Result<Routine, Unsupported> {
        if let Some(host) = host {
            let arguments: Vec<Register> = self.arguments.concat();
            let body = vec![Node::Host { host, arguments, result: self.result }];
            return Ok(Routine { arguments: self.parameters, result: self.result, body });
        }
        if let Some(last) = self.parameters.last().filter(|_| is_entry) {
            self.code.invariant.extend(last.iter());
        }
        self.lower_body()?;
        Ok(Routine { arguments: self.parameters, result: self.result, body: self.nodes })
    }

    /// Lowers the initial values of variables, and the statements.
    fn lower_body(&mut self) -> Result<(), Unsupported> {
        for (handle, variable) in self.function.local_variables.iter() {
            let to = self.locals[handle.index()];
            let first = variable.init.map(|init| self.components(init));
            let zero = self.code.constant(0);
            for (i, to) in to.iter().enumerate() {
                let from = first.as_ref().and_then(|first| first.get(i)).copied().unwrap_or(zero);
                self.nodes.push(Node::Copy { to, from, count: 1 });
            }
        }
        let function = self.function;
        let statements = self.lower_block(&function.body)?;
        self.nodes.extend(statements);
        Ok(())
    }

    /// Lowers a call. A function is inlined if its only `return` is at the end, and if it calls only functions of the shader.
    fn lower_call(
        &mut self,
        handle: Handle<Function>,
        arguments: Vec<Vec<Register>>,
    ) -> Result<Vec<Register>, Unsupported> {
        let routine = &self.routines[handle.index()];
        let own = |code: &mut Code| code.allocate(routine.result.count as usize);
        if let [Node::Host { host, .. }] = routine.body[..] {
            let (arguments, result) = (arguments.concat(), own(self.code));
            self.nodes.push(Node::Host { host, arguments, result });
            return Ok(result.iter().collect());
        }
        if is_straight(&self.module.functions[handle], self.routines) {
            let module = (self.module, self.infos);
            let mut inner = Lowering::new(module, handle, self.globals, self.routines, self.code)?;
            (inner.arguments, inner.is_inlined) = (arguments, true);
            inner.lower_body()?;
            let (returned, nodes) = (inner.returned.unwrap_or_default(), inner.nodes);
            self.nodes.extend(nodes);
            return Ok(returned);
        }
        self.nodes.push(Node::Call { routine: handle.index(), arguments: arguments.concat() });
        // The result is copied, because the next call of the function overwrites its registers.
        let (to, from) = (own(self.code), routine.result);
        if to.count > 0 {
            self.nodes.push(Node::Copy { to: to.first, from: from.first, count: to.count });
        }
        Ok(to.iter().collect())
    }

    fn lower_block(&mut self, block: &Block) -> Result<Vec<Node>, Unsupported> {
        let before = std::mem::take(&mut self.nodes);
        let contiguous_copies = self.contiguous_copies.clone();
        let statements: Vec<(&Statement, &Span)> = block.span_iter().collect();
        // Steps are counted together up to the next statement at which lanes may diverge.
        for straight in statements.split_inclusive(|(statement, _)| may_diverge(statement)) {
            self.nodes.push(Node::Steps(straight.len() as u32));
            straight.iter().try_for_each(|(statement, span)| self.lower_statement(statement, **span))?;
        }
        self.contiguous_copies = contiguous_copies;
        Ok(std::mem::replace(&mut self.nodes, before))
    }

    fn lower_statement(&mut self, statement: &Statement, span: Span) -> Result<(), Unsupported> {
        let refuse = |what: &str| Err(Unsupported { what: what.into(), span });
        match statement {
            Statement::Emit(range) => {
                for handle in range.clone() {
                    let value = self.evaluate(handle);
                    self.values[handle.index()] = Some(value);
                }
            }
            Statement::Block(block) => {
                let nodes = self.lower_block(block)?;
                self.nodes.extend(nodes);
            }
            Statement::If { condition, accept, reject } => {
                let condition = self.component(*condition);
                let (accept, reject) = (self.lower_block(accept)?, self.lower_block(reject)?);
                self.nodes.push(Node::If { condition, accept, reject });
            }
            Statement::Switch { selector, cases } => {
                let selector = self.component(*selector);
                let cases = cases.iter().map(|case| {
                    let value = match case.value {
                        SwitchValue::I32(v) => Some(v as u32),
                        SwitchValue::U32(v) => Some(v),
                        SwitchValue::Default => None,
                    };
                    Ok(Case { value, body: self.lower_block(&case.body)?, fall_through: case.fall_through })
                });
                let cases = cases.collect::<Result<_, Unsupported>>()?;
                self.nodes.push(Node::Switch { selector, cases });
            }
            Statement::Loop { body, continuing, break_if } => {
                let (body, continuing) = (self.lower_block(body)?, self.lower_block(continuing)?);
                let break_if = break_if.map(|condition| self.component(condition));
                self.nodes.push(Node::Loop { body, continuing, break_if });
            }
            Statement::Break => self.nodes.push(Node::Break),
            Statement::Continue => self.nodes.push(Node::Continue),
            Statement::Return { value } => {
                let value = value.map_or_else(Vec::new, |value| self.components(value));
                if self.is_inlined {
                    self.returned = Some(value);
                } else {
                    self.nodes.push(Node::Return(value));
                }
            }
            Statement::Store { pointer, value } => self.lower_store(*pointer, *value),
            Statement::Call { function, arguments, result } => {
                let arguments = arguments.iter().map(|a| self.components(*a)).collect();
                let returned = self.lower_call(*function, arguments)?;
                if let Some(result) = result {
                    self.values[result.index()] = Some(Value::Components(returned));
                }
            }
            Statement::Kill => return refuse("discard: an effect gives every pixel a color"),
            _ => return refuse("this statement"),
        }
        Ok(())
    }

    fn lower_store(&mut self, pointer: Handle<Expression>, value: Handle<Expression>) {
        let value = self.components(value);
        let Value::Pointer { first, offset } = self.value(pointer) else { return };
        if let (None, Some((from, 1))) = (offset, contiguous_run(&value)) {
            self.nodes.push(Node::Store { to: first, from, count: value.len() as u32 });
            return;
        }
        self.nodes.extend((first..).zip(value).map(|(to, from)| match offset {
            None => Node::Store { to, from, count: 1 },
            Some(offset) => Node::StoreElement { first: to, offset, from },
        }));
    }

    /// The value of an expression: as computed where it was emitted, or evaluated here if it needs no computation.
    fn value(&mut self, handle: Handle<Expression>) -> Value {
        match &self.values[handle.index()] {
            Some(value) => value.clone(),
            None => self.evaluate(handle),
        }
    }

    fn components(&mut self, handle: Handle<Expression>) -> Vec<Register> {
        match self.value(handle) {
            Value::Components(registers) => registers,
            Value::Pointer { .. } => Vec::new(),
        }
    }

    fn component(&mut self, handle: Handle<Expression>) -> Register {
        self.components(handle).first().copied().unwrap_or(0)
    }

    /// An operation on single components.
    fn compute(&mut self, operator: Operator, operands: &[Register]) -> Register {
        let mut first = [0; 3];
        first[..operands.len()].copy_from_slice(operands);
        let out = self.code.allocate(1).first;
        self.push_operation(operator, out, Operands { first, step: [0; 3], count: 1 });
        out
    }

    /// An operation on vectors; a scalar operand is used for every component.
    fn compute_vector(&mut self, operator: Operator, operands: &[&[Register]]) -> Vec<Register> {
        let count = operands.iter().map(|operand| operand.len()).max().unwrap_or(0);
        let mut together = Operands { count: count as u32, ..Operands::default() };
        let mut is_together = true;
        for (k, operand) in operands.iter().enumerate() {
            match self.first_and_step(operand) {
                Some((first, step)) => (together.first[k], together.step[k]) = (first, step),
                None => is_together = false,
            }
        }
        let out = self.code.allocate(count);
        if is_together && count > 0 {
            self.push_operation(operator, out.first, together);
            return out.iter().collect();
        }
        for (i, out) in out.iter().enumerate() {
            let mut first = [0; 3];
            for (first, operand) in first.iter_mut().zip(operands) {
                *first = operand[if operand.len() == 1 { 0 } else { i }];
            }
            self.push_operation(operator, out, Operands { first, step: [0; 3], count: 1 });
        }
        out.iter().collect()
    }

    fn push_operation(&mut self, operator: Operator, out: Register, operands: Operands) {
        let node = Compute { kernels: Kernels::of(operator), out, operands };
        let mut all =
            (0..operands.count).flat_map(|i| (0..3).map(move |k| operands.first[k] + i * operands.step[k]));
        if all.all(|register| self.code.is_invariant(register)) {
            self.code.invariant.extend(out..out + operands.count);
            self.code.prologue.push(node);
        } else {
            self.nodes.push(Node::Compute(node));
        }
    }

    /// The first register of a vector and the step to the next. If the components are in separate registers, a vector that is used again is
    /// copied.
    fn first_and_step(&mut self, vector: &[Register]) -> Option<(Register, u32)> {
        if let Some(found) = contiguous_run(vector) {
            return Some(found);
        }
        match self.contiguous_copies.get(vector) {
            Some(Some(first)) => Some((*first, 1)),
            Some(None) => {
                let first = self.copy_to_consecutive(vector);
                self.contiguous_copies.insert(vector.to_vec(), Some(first));
                Some((first, 1))
            }
            None => {
                self.contiguous_copies.insert(vector.to_vec(), None);
                None
            }
        }
    }

    fn compute_float(&mut self, operator: BinaryOperator, a: Register, b: Register) -> Register {
        self.compute(Operator::Float(FloatOperator::Binary(operator)), &[a, b])
    }

    fn evaluate(&mut self, handle: Handle<Expression>) -> Value {
        let shape = self.shapes[handle.index()];
        let components = match &self.function.expressions[handle] {
            Expression::Literal(literal) => vec![self.code.constant(bits_of(*literal))],
            Expression::Constant(c) => {
                let bits = &self.globals[self.module.constants[*c].init.index()];
                (self.code.constant_vector(bits.clone())..).take(bits.len()).collect()
            }
            Expression::ZeroValue(_) => vec![self.code.constant(0); shape.size],
            Expression::FunctionArgument(i) => self.arguments[*i as usize].clone(),
            Expression::LocalVariable(v) => {
                return Value::Pointer { first: self.locals[v.index()].first, offset: None };
            }
            Expression::Compose { components, .. } => {
                let components = components.iter().flat_map(|part| self.components(*part)).collect();
                self.code.consecutive_if_constant(components)
            }
            Expression::Splat { size, value } => vec![self.component(*value); *size as usize],
            Expression::Swizzle { size, vector, pattern } => {
                let vector = self.components(*vector);
                pattern[..*size as usize].iter().map(|c| vector[*c as usize]).collect()
            }
            Expression::Access { base, index } => return self.lower_access(*base, *index, shape),
            Expression::AccessIndex { base, index } => return self.lower_member(*base, *index, handle),
            Expression::Load { pointer } => self.lower_load(*pointer, shape.size),
            Expression::Unary { op, expr } => self.lower_unary(*op, *expr),
            Expression::Binary { op, left, right } => self.lower_binary(*op, *left, *right),
            Expression::Select { condition, accept, reject } => {
                let [c, a, r] = [*condition, *accept, *reject].map(|handle| self.components(handle));
                self.compute_vector(Operator::Select, &[&r, &a, &c])
            }
            Expression::Relational { fun, argument } => self.lower_relational(*fun, *argument),
            Expression::Math { fun, arg, arg1, arg2, .. } => {
                let arguments: Vec<_> = [Some(*arg), *arg1, *arg2].into_iter().flatten().collect();
                self.lower_math(*fun, &arguments)
            }
            Expression::As { expr, kind, convert } => self.lower_convert(*expr, *kind, convert.is_none()),
            // Results of calls are set at the call; all other expressions were refused.
            _ => vec![self.code.constant(0); shape.size],
        };
        Value::Components(components)
    }

    /// `base[index]` with a computed index. An index beyond the end reads the last element, as WGSL allows.
    fn lower_access(&mut self, base: Handle<Expression>, index: Handle<Expression>, shape: Shape) -> Value {
        let of = self.shapes[base.index()];
        let step = of.step.max(1);
        let (last, step) = (self.code.constant((of.size / step).saturating_sub(1) as u32), step as u32);
        let index = self.component(index);
        let unsigned = |function| Operator::IntegerMath { signed: false, function };
        let integer =
            |operator| Operator::Integer { signed: false, operator: IntegerOperator::Binary(operator) };
        let mut offset = self.compute(unsigned(MathFunction::Min), &[index, last]);
        if step > 1 {
            let step = self.code.constant(step);
            offset = self.compute(integer(BinaryOperator::Multiply), &[offset, step]);
        }
        match self.value(base) {
            Value::Pointer { first, offset: outer } => {
                let offset = match outer {
                    Some(outer) => self.compute(integer(BinaryOperator::Add), &[outer, offset]),
                    None => offset,
                };
                Value::Pointer { first, offset: Some(offset) }
            }
            Value::Components(registers) => {
                let first = self.copy_to_consecutive(&registers);
                let own = self.code.allocate(shape.size);
                let loads = own.iter().zip(first..);
                self.nodes.extend(loads.map(|(to, first)| Node::LoadElement { to, first, offset }));
                Value::Components(own.iter().collect())
            }
        }
    }

    /// Copies these values to consecutive registers, and returns the first one.
    fn copy_to_consecutive(&mut self, registers: &[Register]) -> Register {
        let first = registers.first().copied().unwrap_or(0);
        if registers.iter().copied().eq(first..first + registers.len() as u32) {
            return first;
        }
        let own = self.code.allocate(registers.len());
        let copies = own.iter().zip(registers);
        self.nodes.extend(copies.map(|(to, from)| Node::Copy { to, from: *from, count: 1 }));
        own.first
    }

    fn lower_member(&mut self, base: Handle<Expression>, index: u32, handle: Handle<Expression>) -> Value {
        let (shape, of) = (self.shapes[handle.index()], self.shapes[base.index()]);
        let types = &self.module.types;
        let before = shape::member_offset(self.info[base].ty.inner_with(types), index as usize, types);
        let before = before.unwrap_or(of.step.max(1) * index as usize);
        match self.value(base) {
            Value::Pointer { first, offset } => Value::Pointer { first: first + before as u32, offset },
            Value::Components(all) => Value::Components(all[before..before + shape.size].to_vec()),
        }
    }

    fn lower_load(&mut self, pointer: Handle<Expression>, size: usize) -> Vec<Register> {
        let Value::Pointer { first, offset } = self.value(pointer) else { return Vec::new() };
        let own = self.code.allocate(size);
        match offset {
            None => self.nodes.push(Node::Copy { to: own.first, from: first, count: own.count }),
            Some(offset) => {
                let loads = own.iter().zip(first..);
                self.nodes.extend(loads.map(|(to, first)| Node::LoadElement { to, first, offset }));
            }
        }
        own.iter().collect()
    }

    fn lower_unary(&mut self, op: UnaryOperator, value: Handle<Expression>) -> Vec<Register> {
        let operator = match (op, self.shapes[value.index()].kind) {
            (UnaryOperator::Negate, ComponentKind::Float) => Operator::Float(FloatOperator::Negate),
            _ => Operator::Integer { signed: false, operator: IntegerOperator::Unary(op) },
        };
        let value = self.components(value);
        self.compute_vector(operator, &[&value])
    }

    fn lower_binary(
        &mut self,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Vec<Register> {
        let (a, b) = (self.components(left), self.components(right));
        let [sa, sb] = [left, right].map(|side| self.shapes[side.index()]);
        let is_product = (sa.columns > 0 || sb.columns > 0) && sa.size > 1 && sb.size > 1;
        if op == BinaryOperator::Multiply && is_product {
            return self.matrix_product((&a, &sa), (&b, &sb));
        }
        let operator = match sa.kind {
            ComponentKind::Float => Operator::Float(FloatOperator::Binary(op)),
            kind => Operator::Integer {
                signed: kind == ComponentKind::Int,
                operator: IntegerOperator::Binary(op),
            },
        };
        self.compute_vector(operator, &[&a, &b])
    }

    /// Matrices are stored column by column; a vector to the left of one is a row vector.
    fn matrix_product(
        &mut self,
        (a, sa): (&[Register], &Shape),
        (b, sb): (&[Register], &Shape),
    ) -> Vec<Register> {
        let rows = if sa.columns > 0 { sa.step } else { 1 };
        let inner = if sa.columns > 0 { sa.columns } else { sa.size };
        let columns = if sb.columns > 0 { sb.columns } else { 1 };
        let entry = |i: usize| {
            let (column, row) = (i / rows, i % rows);
            let left: Vec<Register> = (0..inner).map(|k| a[k * rows + row]).collect();
            self.dot(&left, &b[column * inner..(column + 1) * inner])
        };
        (0..rows * columns).map(entry).collect()
    }

    /// Dot product, summed from the first component on.
    fn dot(&mut self, a: &[Register], b: &[Register]) -> Register {
        let multiply = Operator::Float(FloatOperator::Binary(BinaryOperator::Multiply));
        let products = self.compute_vector(multiply, &[a, b]).into_iter();
        products.reduce(|sum, product| self.compute_float(BinaryOperator::Add, sum, product)).unwrap_or(0)
    }

    fn lower_relational(&mut self, fun: RelationalFunction, argument: Handle<Expression>) -> Vec<Register> {
        let of = match fun {
            RelationalFunction::All => BinaryOperator::LogicalAnd,
            _ => BinaryOperator::LogicalOr,
        };
        let operator = Operator::Integer { signed: false, operator: IntegerOperator::Binary(of) };
        let all = self.components(argument).into_iter();
        all.reduce(|a, b| self.compute(operator, &[a, b])).into_iter().collect()
    }

    fn lower_convert(
        &mut self,
        value: Handle<Expression>,
        to: ScalarKind,
        keeps_bits: bool,
    ) -> Vec<Register> {
        let components = self.components(value);
        let conversion = match (self.shapes[value.index()].kind, to) {
            _ if keeps_bits => return components,
            (ComponentKind::Float, ScalarKind::Sint) => Conversion::FloatToInt,
            (ComponentKind::Float, ScalarKind::Uint) => Conversion::FloatToUint,
            (ComponentKind::Float, ScalarKind::Bool) => Conversion::FloatToBool,
            (ComponentKind::Int, ScalarKind::Float) => Conversion::IntToFloat,
            (ComponentKind::Uint | ComponentKind::Bool, ScalarKind::Float) => Conversion::UintToFloat,
            (_, ScalarKind::Bool) => Conversion::ToBool,
            _ => return components,
        };
        self.compute_vector(Operator::Convert(conversion), &[&components])
    }

    fn lower_math(&mut self, function: MathFunction, arguments: &[Handle<Expression>]) -> Vec<Register> {
        use BinaryOperator::{Add, Divide, Multiply, Subtract};
        let kind = self.shapes[arguments[0].index()].kind;
        let values: Vec<Vec<Register>> = arguments.iter().map(|a| self.components(*a)).collect();
        let (a, b) = (&values[0], values.get(1).unwrap_or(&values[0]));
        if kind != ComponentKind::Float {
            return self.lower_integer_math(function, kind == ComponentKind::Int, &values);
        }
        match function {
            MathFunction::Dot => vec![self.dot(a, b)],
            MathFunction::Length => vec![self.length(a)],
            MathFunction::Distance => {
                let subtract = Operator::Float(FloatOperator::Binary(Subtract));
                let apart = self.compute_vector(subtract, &[a, b]);
                vec![self.length(&apart)]
            }
            MathFunction::Normalize => {
                let length = self.length(a);
                self.compute_vector(Operator::Float(FloatOperator::Binary(Divide)), &[a, &[length]])
            }
            MathFunction::Cross => (0..3)
                .map(|i| {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    let (x, y) =
                        (self.compute_float(Multiply, a[j], b[k]), self.compute_float(Multiply, a[k], b[j]));
                    self.compute_float(Subtract, x, y)
                })
                .collect(),
            MathFunction::Reflect => {
                let dot = self.dot(b, a);
                let twice = self.compute_float(Add, dot, dot);
                let part = |(x, n): (&Register, &Register)| {
                    let along = self.compute_float(Multiply, twice, *n);
                    self.compute_float(Subtract, *x, along)
                };
                a.iter().zip(b).map(part).collect()
            }
            _ => {
                let all: Vec<&[Register]> = values.iter().map(Vec::as_slice).collect();
                self.compute_vector(Operator::Math(function), &all)
            }
        }
    }

    fn length(&mut self, a: &[Register]) -> Register {
        let square = self.dot(a, a);
        self.compute(Operator::Math(MathFunction::Sqrt), &[square])
    }

    fn lower_integer_math(
        &mut self,
        function: MathFunction,
        signed: bool,
        values: &[Vec<Register>],
    ) -> Vec<Register> {
        if function != MathFunction::Dot {
            let all: Vec<&[Register]> = values.iter().map(Vec::as_slice).collect();
            return self.compute_vector(Operator::IntegerMath { signed, function }, &all);
        }
        let of = |op| Operator::Integer { signed, operator: IntegerOperator::Binary(op) };
        let multiply = |(a, b): (&Register, &Register)| self.compute(of(BinaryOperator::Multiply), &[*a, *b]);
        let products: Vec<Register> = values[0].iter().zip(&values[1]).map(multiply).collect();
        let add = |a, b| self.compute(of(BinaryOperator::Add), &[a, b]);
        products.into_iter().reduce(add).into_iter().collect()
    }
}

/// The first of registers that are consecutive or all the same, and the step from each to the next. `None` for other registers.
fn contiguous_run(registers: &[Register]) -> Option<(Register, u32)> {
    let first = *registers.first()?;
    let step = registers.get(1).map_or(0, |second| second.wrapping_sub(first));
    let is_run =
        (0..).zip(registers).all(|(i, register)| *register == first.wrapping_add(step.wrapping_mul(i)));
    (step <= 1 && is_run).then_some((first, step))
}

/// Whether a function returns only at its end, and calls only functions of the shader.
fn is_straight(function: &Function, routines: &[Routine]) -> bool {
    fn is_inner(block: &Block, routines: &[Routine]) -> bool {
        block.iter().all(|statement| match statement {
            Statement::Return { .. } => false,
            Statement::Call { function, .. } => {
                matches!(routines[function.index()].body[..], [Node::Host { .. }])
            }
            Statement::Block(block) => is_inner(block, routines),
            Statement::If { accept, reject, .. } => is_inner(accept, routines) && is_inner(reject, routines),
            Statement::Switch { cases, .. } => cases.iter().all(|case| is_inner(&case.body, routines)),
            Statement::Loop { body, continuing, .. } => {
                is_inner(body, routines) && is_inner(continuing, routines)
            }
            _ => true,
        })
    }
    let Some((Statement::Return { .. }, before)) = function.body.split_last() else { return false };
    before.iter().all(|statement| match statement {
        Statement::Return { .. } => false,
        _ => is_inner(&Block::from_vec(vec![statement.clone()]), routines),
    })
}

/// Whether lanes may diverge or end at a statement.
fn may_diverge(statement: &Statement) -> bool {
    !matches!(statement, Statement::Emit(_) | Statement::Store { .. })
}

fn unsupported_feature(expression: &Expression) -> Option<&'static str> {
    use MathFunction as M;
    let of_vectors = [M::Dot, M::Length, M::Distance, M::Normalize, M::Cross, M::Reflect];
    match expression {
        Expression::Math { fun, .. } if !is_component_function(*fun) && !of_vectors.contains(fun) => {
            Some("this built-in function")
        }
        Expression::Relational { fun: RelationalFunction::IsNan | RelationalFunction::IsInf, .. } => {
            Some("isNan and isInf")
        }
        Expression::Derivative { .. } => Some("a derivative: an effect is a function of one pixel"),
        Expression::ImageSample { .. } | Expression::ImageLoad { .. } | Expression::ImageQuery { .. } => {
            Some("a texture of its own; name its file in the header comment: // texture NAME = FILE: ABOUT")
        }
        Expression::Override(_) => Some("an override; write const, or a parameter in the header comment"),
        Expression::Literal(_)
        | Expression::Constant(_)
        | Expression::ZeroValue(_)
        | Expression::Compose { .. }
        | Expression::Access { .. }
        | Expression::AccessIndex { .. }
        | Expression::Splat { .. }
        | Expression::Swizzle { .. }
        | Expression::FunctionArgument(_)
        | Expression::LocalVariable(_)
        | Expression::Load { .. }
        | Expression::Unary { .. }
        | Expression::Binary { .. }
        | Expression::Select { .. }
        | Expression::Relational { .. }
        | Expression::Math { .. }
        | Expression::As { .. }
        | Expression::CallResult(_) => None,
        _ => Some("this expression"),
    }
}

/// Whether a parameter of a function is a pointer. Pointers are not supported, because they would refer to registers of another function.
pub(crate) fn has_pointer_arguments(module: &Module, function: &Function) -> bool {
    let is_pointer = |ty: Handle<naga::Type>| {
        matches!(module.types[ty].inner, TypeInner::Pointer { .. } | TypeInner::ValuePointer { .. })
    };
    function.arguments.iter().any(|a| is_pointer(a.ty))
}
