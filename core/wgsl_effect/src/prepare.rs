//! What is worked out of a function before it runs; what the evaluator does not know is refused here, with its place.

use crate::maths;
use crate::program::Unsupported;
use crate::shape::{self, MOST, Shape};
use naga::valid::ModuleInfo;
use naga::{Block, Expression, Function, Handle, Module, RelationalFunction, Statement};

/// What is worked out once a function.
pub struct Code {
    pub shapes: Vec<Shape>,
    /// Offset added by an `AccessIndex`, in components.
    pub offsets: Vec<usize>,
    /// Start of each local variable in the frame's memory, and its size.
    pub locals: Vec<(usize, usize)>,
    pub memory: usize,
}

/// Statements and calls within one another that a run may be in: the evaluator goes down by recursion.
const MOST_STATEMENTS: usize = 200;

/// Refuses a function whose statements, with those of the functions that they call, are too deep within one another. `known`:
/// the levels of the functions before it, which are those that it can call.
pub fn levels(function: &Function, known: &[usize]) -> Result<usize, Unsupported> {
    let mut deepest = 0;
    within(&function.body, 1, known, &mut deepest)?;
    Ok(deepest)
}

fn within(block: &Block, level: usize, known: &[usize], deepest: &mut usize) -> Result<(), Unsupported> {
    for (statement, span) in block.span_iter() {
        let called = match statement {
            Statement::Call { function, .. } => known.get(function.index()).copied().unwrap_or(0),
            _ => 0,
        };
        if level + called > MOST_STATEMENTS {
            return Err(Unsupported {
                what: format!("more than {MOST_STATEMENTS} statements and calls within one another"),
                span: *span,
            });
        }
        *deepest = (*deepest).max(level + called);
        let mut below = |block: &Block| within(block, level + 1, known, deepest);
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

/// Works out shapes and memory, and refuses what is not known.
pub fn code(
    module: &Module,
    info: &ModuleInfo,
    handle: Handle<Function>,
    function: &Function,
) -> Result<Code, Unsupported> {
    let types = &module.types;
    let info = &info[handle];
    let mut shapes = Vec::with_capacity(function.expressions.len());
    let mut offsets = Vec::with_capacity(function.expressions.len());
    for (handle, expression) in function.expressions.iter() {
        let span = function.expressions.get_span(handle);
        let refuse = |what: &str| Unsupported { what: what.to_string(), span };
        let inner = info[handle].ty.inner_with(types);
        let shape = shape::shape(inner, types).ok_or_else(|| refuse("this type of value"))?;
        if shape.size > MOST && !shape.is_pointer {
            return Err(refuse("a value of more than 20 numbers; index it where it stands"));
        }
        if let Some(what) = unknown(expression) {
            return Err(refuse(what));
        }
        let mut offset = 0;
        if let Expression::AccessIndex { base, index } = expression {
            let base_type = match info[*base].ty.inner_with(types) {
                naga::TypeInner::Pointer { base, .. } => &types[*base].inner,
                other => other,
            };
            let base_shape: &Shape = &shapes[base.index()];
            let member = shape::member_offset(base_type, *index as usize, types);
            offset = member.unwrap_or(base_shape.step.max(1) * *index as usize);
        }
        shapes.push(shape);
        offsets.push(offset);
    }
    let mut locals = Vec::new();
    let mut memory = 0;
    for (handle, variable) in function.local_variables.iter() {
        let size =
            shape::shape(&types[variable.ty].inner, types).map(|s| s.size).ok_or_else(|| Unsupported {
                what: "a variable of this type".into(),
                span: function.local_variables.get_span(handle),
            })?;
        if size > MOST && variable.init.is_some() {
            return Err(Unsupported {
                what: "a first value of more than 20 numbers".into(),
                span: function.local_variables.get_span(handle),
            });
        }
        locals.push((memory, size));
        memory += size;
    }
    statements(&function.body)?;
    Ok(Code { shapes, offsets, locals, memory })
}

fn unknown(expression: &Expression) -> Option<&'static str> {
    match expression {
        Expression::Math { fun, .. } if !maths::is_known(*fun) => Some("this built-in function"),
        Expression::Relational { fun: RelationalFunction::IsNan | RelationalFunction::IsInf, .. } => {
            Some("isNan and isInf")
        }
        Expression::Derivative { .. } => Some("a derivative: an effect is a function of one pixel"),
        Expression::ImageSample { .. } | Expression::ImageLoad { .. } | Expression::ImageQuery { .. } => {
            Some("a texture of its own; name its file in the head comment: // texture NAME = FILE: ABOUT")
        }
        Expression::Override(_) => Some("an override; write const, or a parameter in the head comment"),
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

fn statements(block: &Block) -> Result<(), Unsupported> {
    for (statement, span) in block.span_iter() {
        match statement {
            Statement::Block(b) => statements(b)?,
            Statement::If { accept, reject, .. } => {
                statements(accept)?;
                statements(reject)?;
            }
            Statement::Switch { cases, .. } => {
                for case in cases {
                    statements(&case.body)?;
                }
            }
            Statement::Loop { body, continuing, .. } => {
                statements(body)?;
                statements(continuing)?;
            }
            Statement::Emit(_)
            | Statement::Break
            | Statement::Continue
            | Statement::Return { .. }
            | Statement::Store { .. }
            | Statement::Call { .. } => {}
            Statement::Kill => {
                return Err(Unsupported {
                    what: "discard: an effect gives every pixel a color".into(),
                    span: *span,
                });
            }
            _ => return Err(Unsupported { what: "this statement".into(), span: *span }),
        }
    }
    Ok(())
}

/// Whether parameters of functions are pointers: their memory is in another frame.
pub fn has_pointer_arguments(module: &Module, function: &Function) -> bool {
    let is_pointer = |ty: Handle<naga::Type>| {
        matches!(
            module.types[ty].inner,
            naga::TypeInner::Pointer { .. } | naga::TypeInner::ValuePointer { .. }
        )
    };
    function.arguments.iter().any(|a| is_pointer(a.ty))
}
