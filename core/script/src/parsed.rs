//! A parsed script, which all runs of it share.

use crate::api_error::Place;
use crate::build::ScriptContext;
use crate::compile::{UnknownVariable, compile_with_unknown_variables};
use rhai::{AST, Engine, ParseError};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A parsed script, and what is known about it before it runs.
pub(crate) struct ParsedScript {
    pub ast: AST,
    /// Functions that the script defines, with their number of arguments.
    pub functions: Arc<Vec<(String, usize)>>,
    /// Last line of each function.
    pub function_ends: Arc<BTreeMap<String, usize>>,
    /// Places of `load` calls whose file is used for its clips only.
    pub clips_only: Vec<Place>,
    /// Unknown variables. They are errors, but the script runs to find further errors.
    pub unknown: Vec<UnknownVariable>,
}

/// The error of a text that cannot be parsed, and the unknown variables before its place.
#[derive(Clone, Debug)]
pub(crate) struct ParseFailure {
    pub error: ParseError,
    pub unknown: Vec<UnknownVariable>,
}

impl ParsedScript {
    /// Parses a script. `name`: its name in messages.
    pub(crate) fn new(
        engine: &Engine,
        context: &ScriptContext,
        name: &str,
        text: &str,
    ) -> Result<ParsedScript, ParseFailure> {
        let (parsed, unknown) = compile_with_unknown_variables(engine, context, text);
        let mut ast = match parsed {
            Ok(ast) => ast,
            Err(error) => {
                // Options without an object map look like unknown variables, so those on the line of the error are left out.
                let (line, mut unknown) = (error.1.line(), unknown);
                unknown.retain(|variable| variable.at.line() != line);
                return Err(ParseFailure { error, unknown });
            }
        };
        ast.set_source(name);
        let end = |f: &rhai::ScriptFuncDef| f.body.end_position().line().unwrap_or(0);
        Ok(ParsedScript {
            functions: Arc::new(ast.iter_functions().map(|f| (f.name.to_string(), f.params.len())).collect()),
            function_ends: Arc::new(ast.iter_fn_def().map(|f| (f.name.to_string(), end(f))).collect()),
            clips_only: crate::clips_only::find_loads_of_clips_only(&ast, name),
            ast,
            unknown,
        })
    }
}
