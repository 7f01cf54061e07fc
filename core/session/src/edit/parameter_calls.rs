//! Functions of the script that get an object as an argument: `fn bounce(actor) { actor.key(…); }` and `bounce(ada);`.

use super::scan::{Call, Source};

/// A method call in a function of the script, on a parameter that the object is passed to.
#[derive(Clone)]
pub(super) struct ParameterCall {
    pub call: Call,
    /// Number of calls of the function in the script.
    pub uses: usize,
}

/// Method calls on an object in the functions that get its variable as an argument, in the order in which the script calls those functions.
/// Function calls before the byte `like`, or at another bracket depth, are ignored.
pub(super) fn parameter_calls(text: &Source, variable: &str, like: usize) -> Vec<ParameterCall> {
    let wanted = text.bracket_depth_at(like) + 1;
    let mut all = Vec::new();
    for at in text.uses_of(variable).filter(|at| *at > like) {
        let Some((given, number)) = text.argument_at(at) else { continue };
        let function = &text[given.name];
        let Some((parameter, body)) = text.parameter(function, number) else { continue };
        if text.bracket_depth_at(at) != wanted {
            continue;
        }
        // The definition of the function is not a call.
        let uses = text.calls_of(function).count() - 1;
        let chains = text.chains_of(parameter, body.start).into_iter();
        let chains = chains.filter(|(at, _)| body.contains(at));
        all.extend(chains.flat_map(|(_, chain)| chain).map(|call| ParameterCall { call, uses }));
    }
    all
}
