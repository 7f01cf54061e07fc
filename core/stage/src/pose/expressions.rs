//! Expression weights of an actor during evaluation.

use choreo_asset::{Expression, expression};

/// Expression weights of one actor: requested by clips, scripts and looks, and resolved into shown weights.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExpressionWeights {
    pub requested: Vec<f32>,
    pub resolved: Vec<f32>,
    before: Vec<f32>,
    /// Reusable buffer: whether each joint is a turned eye or a descendant of it.
    pub is_descendant: Vec<bool>,
}

impl ExpressionWeights {
    /// Resolves the requested weights once more and adds the change to the morph weights. Returns whether anything changed.
    pub(crate) fn resolve_again(
        &mut self,
        expressions: &[Expression],
        morph_weights: &mut [Vec<f32>],
    ) -> bool {
        self.before.clone_from(&self.resolved);
        self.resolved.clone_from(&self.requested);
        expression::resolve_weights(expressions, &mut self.resolved);
        for (now, before) in self.resolved.iter().zip(&mut self.before) {
            *before = now - *before;
        }
        expression::add(expressions, &self.before, morph_weights);
        self.before.iter().any(|change| *change != 0.0)
    }
}
