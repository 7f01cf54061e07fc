//! Rewords messages of naga's parser and validator in the author's terms: types as WGSL writes them, the place, and no numbering of naga's
//! own.

use naga::common::wgsl::TypeContext;
use naga::front::Typifier;
use naga::front::wgsl::ParseError;
use naga::proc::{ResolveContext, TypeResolution};
use naga::valid::{
    CallError, ComposeError, ExpressionError, FunctionError, LocalVariableError, TypeError, ValidationError,
};
use naga::{
    BinaryOperator, Block, Expression, Function, Handle, MathFunction, Module, Span, Statement, Type,
    TypeInner, UnaryOperator, WithSpan,
};

/// A mistake in a WGSL text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Bytes of the text that are wrong; `None` if naga does not report them.
    pub span: Option<std::ops::Range<usize>>,
    /// The problem.
    pub text: String,
}

impl Mistake {
    fn new(span: Span, text: String) -> Mistake {
        Mistake { span: span.to_range(), text }
    }
}

/// A mistake that the parser found. `end`: bytes before it are the author's, all others are the program's.
pub fn of_parser(error: &ParseError, end: usize) -> Mistake {
    let labels: Vec<(Span, String)> =
        error.labels().map(|(span, text)| (span, without_naga_names(text))).collect();
    let start = |span: &Span| span.to_range().map_or(usize::MAX, |range| range.start);
    // The span of a parameter's value is its declaration; the place of the call is better.
    let first = labels.first().map_or(0, |(span, _)| start(span));
    let tells_type = |(span, text): &&(Span, String)| {
        text.starts_with("this expression has type") || text.starts_with("argument #") && start(span) >= first
    };
    let all = || labels.iter().filter(|(span, _)| start(span) < end);
    let is_call = labels.first().is_some_and(|(_, text)| text.is_empty());
    let at = all().find(tells_type);
    let at = at.or(all().find(|(span, text)| !text.is_empty() && (!is_call || start(span) >= first)));
    let at = at.or(all().next());
    let mut text = without_naga_names(error.message());
    if let Some((_, label)) = labels.iter().find(|(_, label)| label.starts_with("argument #")) {
        text.push_str(&format!("; {label}"));
    }
    let allowed: Vec<String> = error.notes().filter_map(allowed_type).collect();
    if !allowed.is_empty() {
        text.push_str(&format!("; allowed: {}", allowed.join(", ")));
    }
    // Notes for users of wgpu do not concern authors, and allowed types are already in the text.
    let is_left_out = |note: &str| {
        let words =
            ["http", "wgpu", "aga", "`enable", "allowed type", "accepted for", "accepts the", "Because"];
        words.iter().any(|word| note.contains(word))
    };
    for note in error.notes().filter(|note| !is_left_out(note)) {
        text.push_str(&format!("; {}", without_naga_names(note)));
    }
    Mistake { span: at.and_then(|(span, _)| span.to_range()), text }
}

/// A type from a note "allowed type: …", if effects can have this type.
fn allowed_type(note: &str) -> Option<String> {
    let ty = note.strip_prefix("allowed type: ")?;
    let foreign = ["Abstract", "f16", "f64", "i64", "u64", "i16", "u16"].iter().any(|word| ty.contains(word));
    (!foreign).then(|| ty.to_string())
}

/// Text in the author's terms for a message of naga about an expression without a type or a constant value.
fn reworded_constant_error(message: &str) -> Option<&'static str> {
    let table = [
        ("index ", "the index is out of bounds"),
        ("invalid access into", "this value has neither elements nor members"),
        ("invalid sub-access", "this value has neither elements nor members"),
        ("incompatible operands", "the operator cannot work with values of these types"),
        ("call to builtin", "the built-in function does not take arguments of these types"),
        ("function without return type", "the function returns no value"),
        ("cannot apply the unary op", "the operator cannot work with this constant"),
        ("cannot apply the binary op", "the operator cannot work with these constants"),
        ("cannot apply math function", "the built-in function cannot work with this constant"),
        ("rhs of shift", "an integer of 32 bits is shifted by more than 31"),
        ("divide operation overflowed", "this division has no finite result"),
        ("abstract types may only", "this number has another type than the value beside it"),
        ("using `", "effects have the scalars f32, i32, u32 and bool"),
        ("subexpression(s) are not constant", "a constant is needed here"),
        ("unexpected runtime-expression", "a constant is needed here"),
    ];
    let message = message.to_lowercase();
    table.iter().find(|(start, _)| message.starts_with(start)).map(|(_, text)| *text)
}

/// A message without naga's internal names.
fn without_naga_names(text: &str) -> String {
    if let Some(text) = reworded_constant_error(text) {
        return text.into();
    }
    let mut out = text.replace("{AbstractFloat}", "float").replace("{AbstractInt}", "integer");
    // naga prints handles as `[4]`.
    while let Some((start, end)) = handle_in(&out) {
        out.replace_range(start..end, "this value");
    }
    // The message follows a colon, so it begins in lower case.
    if out.starts_with(|c: char| c.is_ascii_uppercase()) && !out[1..].starts_with(|c: char| c.is_uppercase())
    {
        out[..1].make_ascii_lowercase();
    }
    out
}

/// Bytes of the first handle, such as `[4]`, that follows a blank.
fn handle_in(text: &str) -> Option<(usize, usize)> {
    text.match_indices(" [").find_map(|(at, _)| {
        let digits = text[at + 2..].bytes().take_while(u8::is_ascii_digit).count();
        let end = at + 2 + digits;
        (digits > 0 && text[end..].starts_with(']')).then_some((at + 1, end + 1))
    })
}

/// A mistake that the validator found.
pub fn of_validator(error: &WithSpan<ValidationError>, module: &Module) -> Mistake {
    // The last span is the innermost.
    let innermost = error.spans().last().map_or(Span::UNDEFINED, |(span, _)| *span);
    let mistake = match error.as_inner() {
        ValidationError::Function { handle, source, .. } => {
            let function = &module.functions[*handle];
            let function_span = module.functions.get_span(*handle);
            FunctionContext::new(module, function, innermost, function_span).function_mistake(source)
        }
        ValidationError::EntryPoint { name, source, .. } => {
            let found = module.entry_points.iter().find(|e| e.name == *name);
            match (found, source) {
                (Some(entry), naga::valid::EntryPointError::Function(source)) => {
                    FunctionContext::new(module, &entry.function, innermost, innermost)
                        .function_mistake(source)
                }
                _ => Mistake::new(innermost, format!("entry point {name}: {}", error_chain(source))),
            }
        }
        ValidationError::Type { handle, source, .. } => {
            let name = module.to_ctx().type_to_string(*handle);
            let what = match source {
                TypeError::EmptyStruct => "a struct needs at least one member".to_string(),
                TypeError::MissingCapability(_) | TypeError::WidthError(_) => {
                    "effects have the scalars f32, i32, u32 and bool".to_string()
                }
                other => without_naga_names(&error_chain(other)),
            };
            Mistake::new(module.types.get_span(*handle), format!("the type {name}: {what}"))
        }
        ValidationError::Constant { name, source, .. } => Mistake::new(
            innermost,
            format!("the constant {name}: {}", without_naga_names(&error_chain(source))),
        ),
        ValidationError::GlobalVariable { name, source, .. } => Mistake::new(
            innermost,
            format!("the variable {name}: {}", without_naga_names(&error_chain(source))),
        ),
        other => Mistake::new(innermost, without_naga_names(&error_chain(other))),
    };
    Mistake { span: mistake.span.or(innermost.to_range()), ..mistake }
}

/// The text of an error and its causes.
fn error_chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(Some(error), |e| e.source()).map(|e| e.to_string());
    causes.collect::<Vec<_>>().join("; ")
}

/// A function that the validator refuses.
struct FunctionContext<'a> {
    module: &'a Module,
    function: &'a Function,
    types: Typifier,
    /// Number of expressions whose types are known.
    known: usize,
    /// The innermost span that the validator gives, and that of the function.
    innermost: Span,
    function_span: Span,
}

impl<'a> FunctionContext<'a> {
    fn new(
        module: &'a Module,
        function: &'a Function,
        innermost: Span,
        function_span: Span,
    ) -> FunctionContext<'a> {
        let mut types = Typifier::new();
        let context = ResolveContext::with_locals(module, &function.local_variables, &function.arguments);
        let mut has_type =
            |handle: Handle<Expression>| types.grow(handle, &function.expressions, &context).is_ok();
        let known = function.expressions.iter().take_while(|(handle, _)| has_type(*handle)).count();
        FunctionContext { module, function, types, known, innermost, function_span }
    }

    /// The type of a value as WGSL writes it.
    fn type_text(&self, value: Handle<Expression>) -> String {
        match value.index() < self.known {
            true => self.resolved_type_text(&self.types[value]),
            false => "of another type".into(),
        }
    }

    fn resolved_type_text(&self, resolution: &TypeResolution) -> String {
        let text = self.module.to_ctx().type_resolution_to_string(resolution);
        // A value that is read from a variable has the type of the variable.
        let pointee = text.strip_prefix("ptr<function, ").and_then(|rest| rest.strip_suffix('>'));
        without_naga_names(pointee.unwrap_or(&text))
    }

    fn inner_type_name(&self, inner: &TypeInner) -> String {
        self.resolved_type_text(&TypeResolution::Value(inner.clone()))
    }

    fn type_name(&self, ty: Handle<Type>) -> String {
        without_naga_names(&self.module.to_ctx().type_to_string(ty))
    }

    fn at(&self, value: Handle<Expression>, text: String) -> Mistake {
        // The span of a parameter's value is its declaration; the statement is better.
        let span = match &self.function.expressions[value] {
            Expression::FunctionArgument(_) => {
                statement_using(&self.function.body, value).unwrap_or(self.innermost)
            }
            _ => self.function.expressions.get_span(value),
        };
        Mistake::new(if span.is_defined() { span } else { self.innermost }, text)
    }

    fn at_innermost(&self, text: impl Into<String>) -> Mistake {
        Mistake::new(self.innermost, text.into())
    }

    fn function_mistake(&self, error: &FunctionError) -> Mistake {
        let named = || self.function.name.clone().unwrap_or_default();
        match error {
            FunctionError::Expression { handle, source } => self.expression_mistake(*handle, source),
            FunctionError::LocalVariable { name, source, handle } => {
                let variable = &self.function.local_variables[*handle];
                let ty = self.type_name(variable.ty);
                let what = match (source, variable.init) {
                    (LocalVariableError::InitializerType, Some(init)) => {
                        format!("{name} is {ty}, its initial value is {}", self.type_text(init))
                    }
                    (LocalVariableError::InvalidType(_), _) => {
                        format!("{name}: a variable cannot have the type {ty}")
                    }
                    (other, _) => format!("{name}: {}", without_naga_names(&error_chain(other))),
                };
                Mistake::new(self.function.local_variables.get_span(*handle), what)
            }
            FunctionError::InvalidReturnType { expression, expected_ty } => {
                let returns = match expected_ty {
                    Some(ty) => format!("{} returns {}", named(), self.type_name(*ty)),
                    None => format!("{} returns nothing", named()),
                };
                match expression {
                    Some(value) => {
                        self.at(*value, format!("{returns}, this value is {}", self.type_text(*value)))
                    }
                    None if self.innermost == self.function_span => Mistake::new(
                        self.function_span,
                        format!("{returns}, but one path through it ends without return"),
                    ),
                    None => self.at_innermost(format!("{returns}, this return has no value")),
                }
            }
            FunctionError::InvalidIfType(value) => {
                self.at(*value, format!("a condition is bool, this value is {}", self.type_text(*value)))
            }
            FunctionError::InvalidSwitchType(value) => {
                self.at(*value, format!("switch takes i32 or u32, this value is {}", self.type_text(*value)))
            }
            FunctionError::InvalidStoreTypes { pointer, value } => self.at(
                *value,
                format!(
                    "the variable is {}, this value is {}",
                    self.type_text(*pointer),
                    self.type_text(*value)
                ),
            ),
            FunctionError::InvalidStorePointer(pointer) => {
                self.at(*pointer, "this cannot be assigned to; declare it with var".into())
            }
            FunctionError::InvalidCall { function, error } => self.call_mistake(*function, error),
            FunctionError::BreakOutsideOfLoopOrSwitch => {
                self.at_innermost("break is outside of a loop or switch")
            }
            FunctionError::ContinueOutsideOfLoop => self.at_innermost("continue is outside of a loop"),
            FunctionError::InvalidReturnSpot => self.at_innermost("return is inside a continuing block"),
            FunctionError::ConflictingSwitchCase(_) => Mistake::new(
                switch_with_equal_cases(&self.function.body).unwrap_or(self.innermost),
                "switch has two cases with the same value".into(),
            ),
            FunctionError::ConflictingCaseType => {
                self.at_innermost("the cases of switch have different types")
            }
            FunctionError::MissingDefaultCase => self.at_innermost("switch has no default case"),
            FunctionError::MultipleDefaultCases => self.at_innermost("switch has two default cases"),
            FunctionError::PipelineInputRegularFunction { name } => {
                self.at_innermost(format!("{name} has an attribute; parameters of an effect have none"))
            }
            FunctionError::PipelineOutputRegularFunction => {
                self.at_innermost("the result has an attribute; that of an effect has none")
            }
            FunctionError::InvalidArgumentType { name, .. } => {
                self.at_innermost(format!("{name}: a parameter cannot have this type"))
            }
            FunctionError::NonConstructibleReturnType => {
                self.at_innermost("a function cannot return this type")
            }
            other => self.at_innermost(without_naga_names(&error_chain(other))),
        }
    }

    fn call_mistake(&self, callee: Handle<Function>, error: &CallError) -> Mistake {
        let function = &self.module.functions[callee];
        let name = function.name.clone().unwrap_or_default();
        match error {
            CallError::ArgumentCount { required, seen } => {
                self.at_innermost(format!("{name} takes {required} arguments, {seen} are given"))
            }
            CallError::ArgumentType { index, required, seen_expression } => {
                let parameter =
                    function.arguments.get(*index).and_then(|a| a.name.clone()).unwrap_or_default();
                let (wanted, given) = (self.type_name(*required), self.type_text(*seen_expression));
                self.at(*seen_expression, format!("{name}: {parameter} is {wanted}, this value is {given}"))
            }
            other => self.at_innermost(format!("{name}: {}", without_naga_names(&error_chain(other)))),
        }
    }

    fn expression_mistake(&self, handle: Handle<Expression>, error: &ExpressionError) -> Mistake {
        use ExpressionError as E;
        let text = match error {
            E::InvalidBinaryOperandTypes { op, lhs_type, rhs_type, .. } => {
                format!(
                    "{} cannot work with {} and {}",
                    operator_text(*op),
                    self.inner_type_name(lhs_type),
                    self.inner_type_name(rhs_type)
                )
            }
            E::InvalidUnaryOperandType(op, value) => {
                let sign = match op {
                    UnaryOperator::Negate => "-",
                    UnaryOperator::LogicalNot => "!",
                    UnaryOperator::BitwiseNot => "~",
                };
                format!("{sign} cannot work with {}", self.type_text(*value))
            }
            E::SelectValuesTypeMismatch { accept, reject } => {
                format!(
                    "select chooses between values of one type, not {} and {}",
                    self.inner_type_name(reject),
                    self.inner_type_name(accept)
                )
            }
            E::SelectConditionNotABool { actual } => {
                format!("the condition of select is bool, this value is {}", self.inner_type_name(actual))
            }
            E::InvalidIndexType(value) => {
                format!("an index is i32 or u32, this value is {}", self.type_text(*value))
            }
            E::IndexOutOfBounds(_, index) => format!("the index {index} is out of bounds"),
            E::NegativeIndex(_) => "the index is negative".into(),
            E::InvalidBaseType(value) => format!("{} has no elements", self.type_text(*value)),
            E::InvalidSwizzleComponent(component, size) => {
                let letter = format!("{component:?}").to_lowercase();
                format!("a vector of {} components has no {letter}", *size as u8)
            }
            E::InvalidArgumentType(function, index, value) => {
                format!(
                    "{} cannot take {} as argument {}",
                    name_of(*function),
                    self.type_text(*value),
                    index + 1
                )
            }
            E::WrongArgumentCount(function) => {
                format!("{} is called with the wrong number of arguments", name_of(*function))
            }
            E::InvalidBooleanVector(value) => {
                format!("a vector of bool is needed, this value is {}", self.type_text(*value))
            }
            E::InvalidFloatArgument(value) => {
                format!("a float is needed, this value is {}", self.type_text(*value))
            }
            E::InvalidCastArgument => "this value cannot be converted to that type".into(),
            E::InvalidSplatType(value) => {
                format!("a scalar is needed, this value is {}", self.type_text(*value))
            }
            E::Compose(error) => self.compose_message(handle, error),
            E::ShiftAmountTooLarge { lhs_type, .. } => {
                format!("{} has fewer bits than it is shifted by", self.inner_type_name(lhs_type))
            }
            E::DivideByZero => "division by zero".into(),
            other => without_naga_names(&error_chain(other)),
        };
        self.at(handle, text)
    }

    fn compose_message(&self, handle: Handle<Expression>, error: &ComposeError) -> String {
        let Expression::Compose { ty, components } = &self.function.expressions[handle] else {
            return without_naga_names(&error_chain(error));
        };
        let ty = self.type_name(*ty);
        match error {
            ComposeError::ComponentCount { given, expected } => {
                format!("{ty} is made of {expected} values, {given} are given")
            }
            ComposeError::ComponentType { index } => {
                let given =
                    components.get(*index as usize).map_or_else(String::new, |part| self.type_text(*part));
                format!("{ty} cannot be made of {given} as value {}", index + 1)
            }
            ComposeError::Type(_) => format!("{ty} cannot be made of values"),
        }
    }
}

/// The blocks within a statement.
fn blocks_of(statement: &Statement) -> Vec<&Block> {
    match statement {
        Statement::Block(block) => vec![block],
        Statement::If { accept, reject, .. } => vec![accept, reject],
        Statement::Switch { cases, .. } => cases.iter().map(|case| &case.body).collect(),
        Statement::Loop { body, continuing, .. } => vec![body, continuing],
        _ => Vec::new(),
    }
}

/// The first statement that fulfills a condition; inner statements come before those around them.
fn find_statement(block: &Block, is_it: &dyn Fn(&Statement) -> bool) -> Option<Span> {
    block.span_iter().find_map(|(statement, span)| {
        let inside = blocks_of(statement).into_iter().find_map(|block| find_statement(block, is_it));
        inside.or_else(|| is_it(statement).then_some(*span))
    })
}

/// The statement that uses a value directly.
fn statement_using(body: &Block, value: Handle<Expression>) -> Option<Span> {
    find_statement(body, &|statement| match statement {
        Statement::Return { value: returned } => *returned == Some(value),
        Statement::Store { value: stored, pointer } => *stored == value || *pointer == value,
        Statement::Call { arguments, .. } => arguments.contains(&value),
        Statement::If { condition, .. } => *condition == value,
        Statement::Switch { selector, .. } => *selector == value,
        _ => false,
    })
}

/// The switch that has two cases for one value.
fn switch_with_equal_cases(body: &Block) -> Option<Span> {
    find_statement(body, &|statement| {
        let Statement::Switch { cases, .. } = statement else { return false };
        cases.iter().enumerate().any(|(i, case)| cases[..i].iter().any(|before| before.value == case.value))
    })
}

fn name_of(function: MathFunction) -> String {
    use naga::common::wgsl::TryToWgsl;
    function.try_to_wgsl().map_or_else(|| "the built-in function".into(), str::to_string)
}

/// The operator in WGSL.
fn operator_text(operator: BinaryOperator) -> &'static str {
    use BinaryOperator as B;
    match operator {
        B::Add => "+",
        B::Subtract => "-",
        B::Multiply => "*",
        B::Divide => "/",
        B::Modulo => "%",
        B::Equal => "==",
        B::NotEqual => "!=",
        B::Less => "<",
        B::LessEqual => "<=",
        B::Greater => ">",
        B::GreaterEqual => ">=",
        B::And => "&",
        B::ExclusiveOr => "^",
        B::InclusiveOr => "|",
        B::LogicalAnd => "&&",
        B::LogicalOr => "||",
        B::ShiftLeft => "<<",
        B::ShiftRight => ">>",
    }
}
