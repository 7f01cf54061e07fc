//! Expressions of an actor while it is evaluated.

use choreo_asset::{Expression, expression};

/// What the expressions of one actor show: asked for by clips and scripts, and by what looks around; and what comes of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExpressionWeights {
    pub requested: Vec<f32>,
    pub settled: Vec<f32>,
    before: Vec<f32>,
    /// A buffer for eyes that are turned.
    pub below: Vec<bool>,
}

impl ExpressionWeights {
    /// Settles anew what is asked for by now. What has changed is added to the morph weights; whether anything has.
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
