//! Expression weights of an actor during evaluation.

use choreo_asset::{Expression, expression};

/// Expression weights of one actor: requested by clips, scripts and looks, and settled into shown weights.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExpressionWeights {
    pub requested: Vec<f32>,
    pub settled: Vec<f32>,
    before: Vec<f32>,
    /// A buffer that marks the joints below a turned eye.
    pub below: Vec<bool>,
}

impl ExpressionWeights {
    /// Settles the requested weights once more and adds the change to the morph weights. Returns whether anything changed.
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
