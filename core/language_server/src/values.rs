//! Types of expressions, inferred from the result types in the description of the API. No code is run.

use crate::source::{Source, is_string, is_word};
use choreo_script::BUILT_IN;
use choreo_script::describe::{self, Returns};
use std::cell::Cell;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// Known properties of an expression's value.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ScriptValue {
    /// Type of a handle, or a word for plain values ("text", "number", "array", "map", "function"); empty if unknown.
    pub kind: String,
    /// File that the value comes from, as written in the script.
    pub file: Option<String>,
    /// Name of an actor, camera, clip or effect; for a text, its characters.
    pub name: Option<String>,
    /// File and name of the clip that a cue plays.
    pub clip: Option<(String, String)>,
    /// Element of an array.
    pub element: Option<Box<ScriptValue>>,
    /// Opening brackets, in this source, of the object maps that the value may be: one map, or the rows of an array.
    maps: Vec<usize>,
}

impl ScriptValue {
    fn of(kind: &str) -> ScriptValue {
        ScriptValue { kind: kind.to_string(), ..ScriptValue::default() }
    }

    /// The value as seen from another source, which cannot refer to brackets of this one.
    fn without_maps(self) -> ScriptValue {
        let element = self.element.map(|element| Box::new(element.without_maps()));
        ScriptValue { element, maps: Vec::new(), ..self }
    }

    pub(crate) fn is_handle(&self) -> bool {
        self.kind.starts_with(char::is_uppercase)
    }
}

/// A variable, function or parameter that a script declares.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Declaration {
    /// Token of the name.
    pub token: usize,
    pub kind: DeclarationKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DeclarationKind {
    /// Declared by `let` or `const`: the value begins after `=`.
    Variable,
    /// Declared by `for NAME in`.
    Loop,
    /// Parameter of a function, with its index.
    Parameter(usize),
    /// Parameter of a closure, with its index.
    ClosureParameter(usize),
    Function,
    /// Declared by `import "…" as NAME`.
    Module,
}

/// Modules that a script imports, by the names in its imports.
pub(crate) trait Modules {
    fn module(&self, name: &str) -> Option<Arc<Source>>;
    /// Path of a module.
    fn path(&self, name: &str) -> Option<PathBuf>;
}

/// Infers the types of expressions in a source.
#[derive(Clone, Copy)]
pub(crate) struct Types<'a> {
    pub source: &'a Source,
    pub modules: &'a dyn Modules,
    budget: &'a Budget,
    depth: usize,
}

/// Number of expressions that may still be evaluated for a request. Without a limit, a variable that is used three times by a variable that
/// is used three times, and so on, would take exponential time.
pub(crate) struct Budget(Cell<u32>);

impl Default for Budget {
    fn default() -> Budget {
        Budget(Cell::new(20_000))
    }
}

/// Largest depth of evaluation: declarations may refer to each other in a cycle.
const MAX_DEPTH: usize = 24;

impl<'a> Types<'a> {
    pub(crate) fn new(source: &'a Source, modules: &'a dyn Modules, budget: &'a Budget) -> Types<'a> {
        Types { source, modules, budget, depth: 0 }
    }

    fn with_next_depth(self) -> Option<Types<'a>> {
        let left = self.budget.0.get().checked_sub(1)?;
        self.budget.0.set(left);
        (self.depth < MAX_DEPTH).then_some(Types { depth: self.depth + 1, ..self })
    }

    /// Value of the expression that ends before a token, such as the dot of a method call.
    pub(crate) fn value_ending_at(self, end: usize) -> ScriptValue {
        let Some(start) = self.chain_start(end) else { return ScriptValue::default() };
        self.value(start..end)
    }

    /// First token of a chain of calls that ends before a token.
    fn chain_start(self, end: usize) -> Option<usize> {
        let mut index = end.checked_sub(1)?;
        loop {
            match self.source.get(index) {
                ")" | "]" => {
                    let open = self.source.matching_bracket(index)?;
                    let called = open.checked_sub(1).filter(|before| {
                        let token = self.source.get(*before);
                        (is_word(token) && (!is_keyword(token) || self.is_after_dot(*before)))
                            || (self.source.get(open) == "[" && matches!(token, ")" | "]"))
                    });
                    match called {
                        Some(before) => index = before,
                        None => return Some(open),
                    }
                    if matches!(self.source.get(index), ")" | "]") {
                        continue;
                    }
                }
                token if is_word(token) || is_string(token) => {}
                _ => return None,
            }
            match self.source.token_before(index, 1) {
                "." | "?." | "::" => index = index.checked_sub(2)?,
                _ => return Some(index),
            }
        }
    }

    /// Whether a token follows a dot: there, keywords of Rhai are method names.
    fn is_after_dot(self, token: usize) -> bool {
        matches!(self.source.token_before(token, 1), "." | "?.")
    }

    /// Value of the expression in a range of tokens.
    pub(crate) fn value(self, tokens: Range<usize>) -> ScriptValue {
        let Some(deeper) = self.with_next_depth() else { return ScriptValue::default() };
        let (mut value, mut index) = deeper.primary_value(tokens.start, tokens.end);
        while index < tokens.end {
            match self.source.get(index) {
                "." | "?." if self.source.get(index + 2) == "(" => {
                    value = deeper.method_result(&value, index + 1);
                    index = self.source.matching_bracket(index + 2).map_or(tokens.end, |close| close + 1);
                }
                "." | "?." if value.kind == "map" => {
                    value = deeper.field(&value, self.source.get(index + 1));
                    index += 2;
                }
                "[" if value.kind == "map" => {
                    let key = self.source.string_value(index + 1).unwrap_or_default();
                    value = deeper.field(&value, &key);
                    index = self.source.matching_bracket(index).map_or(tokens.end, |close| close + 1);
                }
                "[" => {
                    value = value.element.map(|element| *element).unwrap_or_default();
                    index = self.source.matching_bracket(index).map_or(tokens.end, |close| close + 1);
                }
                _ => break,
            }
        }
        value
    }

    /// Value before the first dot, and the token after it.
    fn primary_value(self, index: usize, end: usize) -> (ScriptValue, usize) {
        let after = |open: usize| self.source.matching_bracket(open).map_or(end, |close| close + 1);
        let token = self.source.get(index);
        match token {
            "[" => {
                let rows = self.source.arguments(index);
                let mut element = rows.first().map(|first| Box::new(self.value(first.clone())));
                if let Some(element) = element.as_mut().filter(|element| element.kind == "map") {
                    let maps = rows.iter().skip(1).map(|row| row.start);
                    element.maps.extend(maps.filter(|row| self.source.get(*row) == "#{"));
                }
                (ScriptValue { element, ..ScriptValue::of("array") }, after(index))
            }
            "#{" => (ScriptValue { maps: vec![index], ..ScriptValue::of("map") }, after(index)),
            "(" => (self.value(index + 1..self.source.matching_bracket(index).unwrap_or(end)), after(index)),
            "|" | "||" => (ScriptValue::of("function"), end),
            "true" | "false" => (ScriptValue::of("flag"), index + 1),
            _ if is_string(token) => {
                (ScriptValue { name: self.source.string_value(index), ..ScriptValue::of("text") }, index + 1)
            }
            _ if token.starts_with(|c: char| c.is_ascii_digit() || c == '-') => {
                (ScriptValue::of("number"), index + 1)
            }
            _ if is_word(token) && self.source.get(index + 1) == "::" => {
                let value = self.module_member_value(token, index + 2);
                let open = index + 3;
                (value, if self.source.get(open) == "(" { after(open) } else { open })
            }
            _ if is_word(token) && self.source.get(index + 1) == "(" => {
                (self.function_result(index), after(index + 1))
            }
            _ if is_word(token) => (self.variable_value(token, index), index + 1),
            _ => (ScriptValue::default(), end),
        }
    }

    /// Entries of a map in this source: keys, and the tokens of their values.
    fn map_entries(self, open: usize) -> impl Iterator<Item = (String, Range<usize>)> {
        let source = self.source;
        let entries = source.arguments(open).into_iter();
        entries.filter(move |entry| source.get(entry.start + 1) == ":").map(move |entry| {
            let key = source.string_value(entry.start).unwrap_or_else(|| source.get(entry.start).to_string());
            (key, entry.start + 2..entry.end)
        })
    }

    /// Value of an entry of an object map.
    pub(crate) fn field(self, map: &ScriptValue, key: &str) -> ScriptValue {
        let mut entries = map.maps.iter().flat_map(|open| self.map_entries(*open));
        entries.find(|(known, _)| known == key).map(|(_, tokens)| self.value(tokens)).unwrap_or_default()
    }

    /// Keys of an object map; for the rows of an array, the keys of all rows.
    pub(crate) fn keys(self, map: &ScriptValue) -> Vec<String> {
        let mut keys: Vec<String> = Vec::new();
        for (key, _) in map.maps.iter().flat_map(|open| self.map_entries(*open)) {
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        keys
    }

    /// Result of a function call, given the token of the function name.
    fn function_result(self, name: usize) -> ScriptValue {
        let called = self.source.get(name);
        let arguments = self.source.arguments(name + 1);
        if let Some(declared) = self.script_function(called) {
            return self.script_function_result(declared);
        }
        let Some(entry) = describe::entry("", called) else { return ScriptValue::default() };
        self.api_result(entry.returns, &ScriptValue::default(), &arguments, called)
    }

    /// Result of a method call, given the receiver and the token of the method name.
    fn method_result(self, on: &ScriptValue, name: usize) -> ScriptValue {
        let called = self.source.get(name);
        let arguments = self.source.arguments(name + 1);
        match describe::entry(&on.kind, called) {
            Some(entry) => {
                let value = self.api_result(entry.returns, on, &arguments, called);
                let scene = on.name.as_deref().filter(|_| on.kind == "Scene" && called == "actor");
                let cast = scene.zip(value.name.as_deref());
                cast.and_then(|(scene, name)| self.actor_cast_in_script(scene, name)).unwrap_or(value)
            }
            None => ScriptValue::default(),
        }
    }

    /// The actor that the script of another file casts under a name.
    fn actor_cast_in_script(self, file: &str, name: &str) -> Option<ScriptValue> {
        let source = self.modules.module(file)?;
        let types = Types { source: &source, ..self.with_next_depth()? };
        let is_cast_of_name = |at: &usize| {
            let first_argument =
                || source.arguments(at + 1).into_iter().next().and_then(|a| source.string_value(a.start));
            source.get(*at) == "cast"
                && source.get(at + 1) == "("
                && first_argument().as_deref() == Some(name)
        };
        let value = types.function_result((0..source.tokens.len()).find(is_cast_of_name)?).without_maps();
        // Paths in that script are relative to its folder.
        let folder = file.rsplit_once('/').map(|(folder, _)| folder);
        let relative_to_script = |model: String| match folder.filter(|_| !model.starts_with(BUILT_IN)) {
            Some(folder) => format!("{folder}/{model}"),
            None => model,
        };
        Some(ScriptValue { file: value.file.map(relative_to_script), ..value })
    }

    /// Result of an API function or method.
    fn api_result(
        self,
        returns: Returns,
        on: &ScriptValue,
        arguments: &[Range<usize>],
        called: &str,
    ) -> ScriptValue {
        let values: Vec<ScriptValue> =
            arguments.iter().take(3).map(|argument| self.value(argument.clone())).collect();
        let first = values.first().cloned().unwrap_or_default();
        match returns {
            Returns::Nothing => ScriptValue::default(),
            // The method returns a changed receiver: the same object with another texture, a copy and so on.
            Returns::Receiver => on.clone(),
            Returns::Handle(kind) => {
                let loaded = (called == "load").then(|| first.name.clone()).flatten();
                let given = values.iter().find_map(|value| value.file.clone().filter(|_| value.is_handle()));
                let clip = values.iter().filter(|value| value.kind == "Clip");
                let clip = clip.filter_map(|value| Some((value.file.clone()?, value.name.clone()?))).next();
                ScriptValue {
                    file: loaded.or_else(|| on.file.clone()).or(given),
                    name: first
                        .name
                        .filter(|_| first.kind == "text")
                        .or_else(|| on.name.clone().filter(|_| on.kind == kind)),
                    clip: clip.or_else(|| on.clip.clone()),
                    ..ScriptValue::of(kind)
                }
            }
            Returns::Value(_) if called == "param" => values.get(1).cloned().unwrap_or_default(),
            Returns::Value(what) => match what {
                "float" | "int" | "number" => ScriptValue::of("number"),
                "array of texts" => ScriptValue {
                    element: Some(Box::new(ScriptValue::of("text"))),
                    ..ScriptValue::of("array")
                },
                what => ScriptValue::of(what),
            },
        }
    }

    /// Value of a variable that is visible at a token.
    fn variable_value(self, name: &str, from: usize) -> ScriptValue {
        match self.declaration(name, from) {
            Some(declaration) => self.declared_value(&declaration),
            None if matches!(name, "PI" | "TAU") => ScriptValue::of("number"),
            None => ScriptValue::default(),
        }
    }

    /// Declaration of a name that is visible at a token: the last one before it whose block contains the token.
    pub(crate) fn declaration(self, name: &str, from: usize) -> Option<Declaration> {
        let candidates =
            (0..from.min(self.source.tokens.len())).rev().filter(|i| self.source.get(*i) == name);
        let seen = self.first_visible(candidates.filter_map(|token| self.declaration_at(token)), from);
        seen.or_else(|| self.script_function(name))
    }

    /// The first of some declarations of a name that is visible at a token. The declarations are given in backward order.
    pub(crate) fn first_visible(
        self,
        candidates: impl Iterator<Item = Declaration>,
        from: usize,
    ) -> Option<Declaration> {
        let enclosing_brackets: Vec<Option<usize>> =
            std::iter::successors(Some(self.source.enclosing_bracket(from)), |p| {
                p.map(|p| self.source.enclosing_bracket(p))
            })
            .collect();
        let is_visible = |declaration: &Declaration| {
            let block = match declaration.kind {
                DeclarationKind::Variable | DeclarationKind::Function | DeclarationKind::Module => {
                    self.source.enclosing_bracket(declaration.token)
                }
                _ => return self.visible_tokens(declaration).is_some_and(|tokens| tokens.contains(&from)),
            };
            enclosing_brackets.contains(&block)
        };
        let mut seen = candidates.filter(is_visible);
        let first = seen.next();
        // The second `a` in `let a = a.at(…)` is the variable declared before.
        let contains_use =
            |d: &Declaration| d.kind == DeclarationKind::Variable && self.statement_end(d.token) > from;
        let before = first.as_ref().filter(|d| contains_use(d)).and_then(|_| seen.find(|d| !contains_use(d)));
        before.or(first)
    }

    fn script_function(self, name: &str) -> Option<Declaration> {
        let token = self.source.function_named(name)?;
        Some(Declaration { token, kind: DeclarationKind::Function })
    }

    /// The declaration whose name is this token.
    pub(crate) fn declaration_at(self, token: usize) -> Option<Declaration> {
        let source = self.source;
        let kind = match (source.token_before(token, 1), source.get(token + 1)) {
            ("let" | "const", _) => DeclarationKind::Variable,
            ("fn", _) => DeclarationKind::Function,
            ("for", "in" | ",") => DeclarationKind::Loop,
            ("as", _) if is_string(source.token_before(token, 2)) => DeclarationKind::Module,
            // A loop with an index: `for (line, number) in lines`.
            ("(" | ",", ")" | ",") if self.is_in_loop_pair(token) => DeclarationKind::Loop,
            ("(" | ",", ")" | ",") => {
                let open = source.enclosing_bracket(token)?;
                let named = source.token_before(open, 2) == "fn" && source.get(open) == "(";
                let number = source.arguments(open).iter().position(|a| a.start == token);
                return Some(Declaration {
                    token,
                    kind: DeclarationKind::Parameter(number.filter(|_| named)?),
                });
            }
            ("|" | ",", "|" | ",") => {
                return self.closure_start(token).map(|start| Declaration {
                    token,
                    kind: DeclarationKind::ClosureParameter((token - start - 1) / 2),
                });
            }
            _ => return None,
        };
        Some(Declaration { token, kind })
    }

    fn is_in_loop_pair(self, token: usize) -> bool {
        self.source.enclosing_bracket(token).is_some_and(|open| self.source.token_before(open, 1) == "for")
    }

    /// The `|` before the parameters of a closure, given one of its parameters.
    fn closure_start(self, token: usize) -> Option<usize> {
        let mut start = token;
        while self.source.token_before(start, 1) == "," && is_word(self.source.token_before(start, 2)) {
            start -= 2;
        }
        let bar = start.checked_sub(1).filter(|bar| self.source.get(*bar) == "|")?;
        // The bars in `a | b | c` are operators, not a closure.
        let is_value = |t: &str| is_word(t) && !matches!(t, "return" | "in") || matches!(t, ")" | "]");
        (!is_value(self.source.token_before(bar, 1))).then_some(bar)
    }

    /// Tokens between which a parameter or loop variable is visible: the body of its function, closure or loop.
    fn visible_tokens(self, declaration: &Declaration) -> Option<Range<usize>> {
        let source = self.source;
        let from = match declaration.kind {
            DeclarationKind::Parameter(_) => {
                source.matching_bracket(source.enclosing_bracket(declaration.token)?)? + 1
            }
            DeclarationKind::ClosureParameter(_) => {
                (declaration.token..source.tokens.len()).find(|i| source.get(*i) == "|")? + 1
            }
            DeclarationKind::Loop => {
                (declaration.token..source.tokens.len()).find(|i| source.get(*i) == "{")?
            }
            _ => return None,
        };
        let block =
            (source.get(from) == "{").then(|| source.matching_bracket(from).unwrap_or(source.tokens.len()));
        let around =
            source.enclosing_bracket(declaration.token).and_then(|open| source.matching_bracket(open));
        Some(from..block.or(around).unwrap_or(source.tokens.len()))
    }

    /// Value of a declared name.
    pub(crate) fn declared_value(self, declaration: &Declaration) -> ScriptValue {
        let Some(types) = self.with_next_depth() else { return ScriptValue::default() };
        let (source, token) = (self.source, declaration.token);
        match declaration.kind {
            DeclarationKind::Variable if source.get(token + 1) == "=" => {
                types.value(token + 2..self.statement_end(token))
            }
            DeclarationKind::Variable => ScriptValue::default(),
            DeclarationKind::Function => ScriptValue::of("function"),
            DeclarationKind::Module => {
                ScriptValue { name: source.string_value(token - 2), ..ScriptValue::of("module") }
            }
            DeclarationKind::Loop => {
                if source.token_before(token, 1) == "," {
                    return ScriptValue::of("number");
                }
                let Some(start) = (token..token + 5).find(|i| source.get(*i) == "in") else {
                    return ScriptValue::default();
                };
                let end = (start..source.tokens.len()).find(|i| source.get(*i) == "{");
                let over = types.value(start + 1..end.unwrap_or(start + 1));
                over.element.map(|element| *element).unwrap_or_default()
            }
            DeclarationKind::Parameter(number) => {
                let Some(function) = source.enclosing_bracket(token).and_then(|open| open.checked_sub(1))
                else {
                    return ScriptValue::default();
                };
                let name = source.get(function);
                let calls = (0..source.tokens.len())
                    .filter(|i| *i != function && source.get(*i) == name && source.get(i + 1) == "(");
                let given = calls.filter_map(|call| source.arguments(call + 1).get(number).cloned());
                given
                    .map(|tokens| types.value(tokens))
                    .find(|value| !value.kind.is_empty())
                    .unwrap_or_default()
            }
            DeclarationKind::ClosureParameter(_) => types.closure_parameter(token),
        }
    }

    /// Value of a closure's parameter: the actor of `perform(actors, |actor| …)`, the time of `on_frame(|t| …)`.
    fn closure_parameter(self, token: usize) -> ScriptValue {
        let source = self.source;
        let Some(bar) = self.closure_start(token) else { return ScriptValue::default() };
        let performing_actor = |open: usize| {
            let who =
                source.arguments(open).into_iter().next().map(|who| self.value(who)).unwrap_or_default();
            who.element.clone().map_or(who, |element| *element)
        };
        if source.token_before(bar, 1) == "=" {
            let name = source.token_before(bar, 2);
            let is_call = |i: &usize| source.get(*i) == "perform" && source.get(i + 1) == "(";
            let uses = |open: &usize| source.arguments(*open).iter().any(|a| source.get(a.start) == name);
            let call = (0..source.tokens.len()).filter(is_call).map(|i| i + 1).find(uses);
            return call.map(performing_actor).unwrap_or_default();
        }
        match source.enclosing_bracket(bar).map(|open| (open, source.token_before(open, 1))) {
            Some((open, "perform")) => performing_actor(open),
            Some((_, "on_frame")) => ScriptValue::of("number"),
            _ => ScriptValue::default(),
        }
    }

    /// Token that ends the statement that contains a token.
    pub(crate) fn statement_end(self, from: usize) -> usize {
        let source = self.source;
        let mut index = from;
        while index < source.tokens.len() {
            match source.get(index) {
                ";" | ")" | "]" | "}" => return index,
                // A new statement begins: the one before is not finished.
                "let" | "fn" | "const" | "import" if index > from => return index,
                "(" | "[" | "{" | "#{" => index = source.matching_bracket(index).unwrap_or(index),
                _ => {}
            }
            index += 1;
        }
        index
    }

    /// Result of a function that the script defines: its last expression.
    fn script_function_result(self, function: Declaration) -> ScriptValue {
        let Some(types) = self.with_next_depth() else { return ScriptValue::default() };
        let source = self.source;
        let Some(parameters) = source.matching_bracket(function.token + 1) else {
            return ScriptValue::default();
        };
        let open = parameters + 1;
        let Some(close) = source.matching_bracket(open).filter(|_| source.get(open) == "{") else {
            return ScriptValue::default();
        };
        let inside = |i: &usize| source.enclosing_bracket(*i) == Some(open);
        let last = (open + 1..close).filter(inside).rfind(|i| matches!(source.get(*i), ";" | "}"));
        let value = types.value(last.unwrap_or(open) + 1..close);
        if !value.kind.is_empty() {
            return value;
        }
        let returned = (open + 1..close).find(|i| source.get(*i) == "return");
        returned.map(|at| types.value(at + 1..self.statement_end(at + 1))).unwrap_or_default()
    }

    /// Value of `MODULE::name` or `MODULE::name(…)`.
    fn module_member_value(self, module: &str, name: usize) -> ScriptValue {
        let path = self.variable_value(module, name).name;
        let Some((source, types)) = path.and_then(|p| self.modules.module(&p)).zip(self.with_next_depth())
        else {
            return ScriptValue::default();
        };
        let types = Types { source: &source, ..types };
        let wanted = self.source.get(name);
        let value = match self.source.get(name + 1) {
            "(" => types.script_function(wanted).map(|f| types.script_function_result(f)).unwrap_or_default(),
            _ => types.variable_value(wanted, source.tokens.len()),
        };
        value.without_maps()
    }
}

/// Keywords of the language.
pub(crate) const KEYWORDS: [&str; 27] = [
    "let", "const", "fn", "if", "else", "for", "in", "while", "loop", "do", "until", "return", "break",
    "continue", "switch", "true", "false", "import", "export", "as", "private", "throw", "try", "catch",
    "this", "global", "is",
];

pub(crate) fn is_keyword(word: &str) -> bool {
    KEYWORDS.contains(&word)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct StepsModule;
    impl Modules for StepsModule {
        fn module(&self, path: &str) -> Option<Arc<Source>> {
            let text = "fn walker(x) { let a = load(\"walk.bvh\"); a.clip(\"Walk\") } fn table() { #{ who: sun() } }";
            (path == "steps").then(|| Arc::new(Source::new(text)))
        }
        fn path(&self, _: &str) -> Option<PathBuf> {
            None
        }
    }

    /// The value before the dot that is written as `.|`.
    fn value_at_mark(text: &str) -> ScriptValue {
        let at = text.find(".|").unwrap();
        let source = Source::new(&text.replacen(".|", ".", 1));
        let dot = source.tokens.iter().position(|t| t.start == at).unwrap();
        Types::new(&source, &StepsModule, &Budget::default()).value_ending_at(dot)
    }

    fn type_at_mark(text: &str) -> String {
        value_at_mark(text).kind
    }

    #[test]
    fn method_chains_have_the_result_types_of_the_api() {
        assert_eq!(type_at_mark("let a = load(\"a.glb\");\na.|"), "Asset");
        assert_eq!(type_at_mark("cast(\"x\", load(\"a.glb\")).at(0, 1, 2).|\nlet b = 3;"), "Actor");
        assert_eq!(
            type_at_mark("let a = cast(\"x\", load(\"a\")); a.play(a.joint(\"b\")).until(3).|"),
            "Cue"
        );
        assert_eq!(type_at_mark("let l = [camera(\"a\"), camera(\"b\")]; l[0].|"), "Camera");
        assert_eq!(type_at_mark("for c in [camera(\"a\")] { c.| }"), "Camera");
        assert_eq!(type_at_mark("for (c, i) in [camera(\"a\")] { c.| }"), "Camera");
        assert_eq!(type_at_mark("(sun()).|"), "Light");
        assert_eq!(type_at_mark("x.|"), "");
        assert_eq!(type_at_mark("let x = x.|"), "");
    }

    #[test]
    fn method_chains_keep_the_file_and_name_of_their_value() {
        let walk = value_at_mark("let a = load(\"a.glb\"); let w = a.clip(\"Walk\"); w.|");
        assert_eq!((walk.file.as_deref(), walk.name.as_deref()), (Some("a.glb"), Some("Walk")));
        let hero = value_at_mark("let f = param(\"m\", \"b.fbx\"); let h = cast(\"hero\", load(f)); h.|");
        assert_eq!((hero.file.as_deref(), hero.name.as_deref()), (Some("b.fbx"), Some("hero")));
        let cue = value_at_mark("let h = cast(\"h\", load(\"b\")); h.play(load(\"c\").clip(\"Run\")).|");
        assert_eq!((cue.file.as_deref(), cue.clip), (Some("b"), Some(("c".into(), "Run".into()))));
        assert_eq!(value_at_mark("effect(\"bloom\").|").name.as_deref(), Some("bloom"));
    }

    /// The rows of the guide's dialogue.
    #[test]
    fn fields_of_object_maps_have_the_types_of_their_values() {
        let rows = "let ada = cast(\"ada\", load(\"a.glb\")); let ben = cast(\"ben\", load(\"b.glb\"));\n\
                    let lines = [#{ who: ada, from: 0.5 }, #{ \"who\": ben, until: camera(\"c\") }];\n";
        let of = |rest: &str| value_at_mark(&format!("{rows}{rest}"));
        let who = of("for line in lines { line.who.| }");
        assert_eq!((who.kind.as_str(), who.file.as_deref()), ("Actor", Some("a.glb")));
        assert_eq!(of("for line in lines { line.who.play(x).| }").kind, "Cue");
        assert_eq!(of("for line in lines { line.until.| }").kind, "Camera");
        assert_eq!(of("let q = lines[1]; q.who.|").kind, "Actor");
        assert_eq!(of("lines[0][\"who\"].|").kind, "Actor");
        assert_eq!(of("let m = #{ a: #{ b: sun() } }; m.a.b.|").kind, "Light");
        assert_eq!([of("lines[0].none.|").kind, of("let m = #{ a: m.a }; m.a.|").kind], ["", ""]);
        let source = Source::new(rows);
        let budget = Budget::default();
        let types = Types::new(&source, &StepsModule, &budget);
        let row = types.variable_value("lines", source.tokens.len()).element.unwrap();
        assert_eq!(types.keys(&row), ["who", "from", "until"]);
        // Brackets of another source mean nothing here.
        let module = value_at_mark("import \"steps\" as s; s::table().who.|");
        assert_eq!(module.kind, "");
    }

    #[test]
    fn evaluation_of_repeated_and_recursive_references_ends() {
        let mut text = String::from("let a0 = sun();\n");
        for i in 1..60 {
            text += &format!("let a{i} = cast(a{0}, a{0}, a{0});\n", i - 1);
        }
        assert_eq!(type_at_mark(&(text + "a59.|")), "Actor");
        assert_eq!(type_at_mark("fn f(x) { f(f(f(x))) }\nf(f(1)).|"), "");
    }

    #[test]
    fn variables_are_visible_only_in_their_block() {
        assert_eq!(type_at_mark("let a = sun(); { let a = camera(\"c\"); }\na.|"), "Light");
        assert_eq!(type_at_mark("let a = sun(); { let a = camera(\"c\"); a.| }"), "Camera");
        assert_eq!(type_at_mark("let a = sun(); let a = a.at(0, 1, 2); a.|"), "Light");
        assert_eq!(type_at_mark("fn f() { let a = sun(); }\na.|"), "");
    }

    #[test]
    fn functions_parameters_and_modules_have_types() {
        assert_eq!(type_at_mark("fn f(x) { let a = load(x); cast(x, a) }\nf(\"b\").|"), "Actor");
        assert_eq!(type_at_mark("fn f(x, y) { y.| }\nf(1, camera(\"c\"));"), "Camera");
        assert_eq!(type_at_mark("let l = [cast(\"a\", load(\"b\"))]; perform(l, |who| { who.| });"), "Actor");
        assert_eq!(
            type_at_mark("let a = cast(\"a\", load(\"b\")); let g = |who| { who.| }; perform(a, g);"),
            "Actor"
        );
        assert_eq!(type_at_mark("fn f() { return sun(); }\nf().|"), "Light");
        assert_eq!(value_at_mark("import \"steps\" as s; s::walker(1).|").name.as_deref(), Some("Walk"));
    }
}
