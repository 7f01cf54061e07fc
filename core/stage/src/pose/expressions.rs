//! Expressions of an actor while it is evaluated.

use choreo_asset::{Expression, expression};

/// Expression weights of one actor: requested by clips, scripts and looks, and settled into those that are shown.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExpressionWeights {
    pub requested: Vec<f32>,
    pub settled: Vec<f32>,
    before: Vec<f32>,
    /// A buffer for eyes that are turned.
    pub below: Vec<bool>,
}

impl ExpressionWeights {
    /// Settles the requested weights once more and adds the change to the morph weights; true if there was any.
    pub(crate) fn settle_again(
        &mut self,
        expressions: &[Expression],
        morph_weights: &mut [Vec<f32>],
    ) -> bool {
        self.before.clone_from(&self.settled);
        self.settled.clone_from(&self.requested);
        expression::settle(expressions, &mut self.settled);
        for (now, before) in self.settled.iter().zip(&mut self.before) {
            *before = now - *before;
        }
        expression::add(expressions, &self.before, morph_weights);
        self.before.iter().any(|change| *change != 0.0)
    }
}
