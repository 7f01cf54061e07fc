//! Functions of the script to which an object is handed: `fn bounce(actor) { actor.key(…); }` and `bounce(ada);`.

use super::scan::{Call, Source};

/// A call of a method in a function, on the object that the function is given.
#[derive(Clone)]
pub(super) struct HandedCall {
    pub call: Call,
    /// How many calls of the function the script has.
    pub uses: usize,
}

/// The calls of methods on an object of this variable in functions that it is handed to behind a byte, as deep in brackets as `like`; in the
/// order of the calls of those functions.
pub(super) fn handed_calls(text: &Source, variable: &str, like: usize) -> Vec<HandedCall> {
    let wanted = text.depth_to(like) + 1;
    let mut all = Vec::new();
    for at in text.uses_of(variable).filter(|at| *at > like) {
        let Some((given, number)) = text.argument_at(at) else { continue };
        let function = &text[given.name];
        let Some((parameter, body)) = text.parameter(function, number) else { continue };
        if text.depth_to(at) != wanted {
            continue;
        }
        // The first of them is its definition.
        let uses = text.calls_of(function).count() - 1;
        let chains = text.chains_of(parameter, body.start).into_iter();
        let chains = chains.filter(|(at, _)| body.contains(at));
        all.extend(chains.flat_map(|(_, chain)| chain).map(|call| HandedCall { call, uses }));
    }
    all
}
