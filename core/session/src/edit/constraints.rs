//! Constraints: new ones, and the targets of `.reach("hand_r", [0.4, 1.2, 0.3])` (inverse kinematics) that the script states as points.

use super::values::{parse_literals, rewrite_literals};
use super::{Edit, EditRefused, ScriptObject};
use glam::DVec3;
use std::ops::Range;

/// Largest distance between a written point and the one on stage that are taken as the same, metres.
const POINT_TOLERANCE: f64 = 1e-6;

impl ScriptObject<'_> {
    /// Adds the call of a constraint, `reach("hand_r", ball)`, as a line of its own. `target`: the object that the call uses.
    ///
    /// # Errors
    /// The object has no name in the script, or the variable of the target is declared in another block.
    pub fn constrain(&self, call: &str, target: Option<&ScriptObject>) -> Result<Edit, EditRefused> {
        if let Some(target) = target.filter(|target| target.depth() != 0 && target.depth() != self.depth()) {
            let why = "it is made in a block, and its name is unknown outside; write the constraint there";
            return Err(EditRefused::at(target.line, why));
        }
        let needs = target.and_then(|target| Some((target.variable.as_deref()?, target.creating_call.end)));
        self.add_call(call, needs)
    }

    /// Variable that holds the object.
    ///
    /// # Errors
    /// The object has no variable.
    pub fn required_variable(&self) -> Result<&str, EditRefused> {
        let none =
            || EditRefused::at(self.line, "it has no variable in the script; write let NAME = cast(…)");
        self.variable.as_deref().ok_or_else(none)
    }

    /// Moves the target of the last `.reach` whose target is the point `from`.
    ///
    /// # Errors
    /// No `.reach` states that point with literals.
    pub fn set_reach(&self, from: DVec3, to: DVec3) -> Result<Edit, EditRefused> {
        let target = |inside: &Range<usize>| {
            let joint = self.text.value_end(inside.start, inside.end);
            let start = (joint + 1).min(inside.end);
            let point = start..self.text.value_end(start, inside.end);
            parse_literals(&self.text, &point).filter(|numbers| numbers.len() == 3)
        };
        let is_it = |numbers: &Vec<(Range<usize>, f64)>| {
            let values: Vec<f64> = numbers.iter().map(|(_, value)| *value).collect();
            (DVec3::from_slice(&values) - from).length() < POINT_TOLERANCE
        };
        let reaches: Vec<_> =
            self.calls.iter().filter(|call| &self.text[call.name.clone()] == "reach").collect();
        let found = reaches.iter().rev().find_map(|call| target(&call.inside).filter(is_it));
        let edit = found.and_then(|old| rewrite_literals(&self.text, &old, &to.to_array()));
        edit.ok_or_else(|| {
            let line = reaches.last().map_or(self.line, |call| self.line_of(call.name.start));
            EditRefused::at(line, "the target of .reach is computed; change it there")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Constraints are added to two actors in turn, with a target that is made after both.
    #[test]
    fn constraints_are_added_in_the_order_of_their_creation() {
        let mut text =
            "let a = cast(\"a\", m);\nlet b = cast(\"b\", m);\nlet ball = cast(\"ball\", s); // it\nsun();\n"
                .to_string();
        for (line, call) in [(1, "aim(\"x\", ball)"), (2, "reach(\"x\", ball)"), (1, "look_at([0, 1, 0])")] {
            let object = ScriptObject::at(&text, line, 9).unwrap();
            let ball = ScriptObject::at(&text, 3, 12).unwrap();
            let target = Some(&ball).filter(|_| call.contains("ball"));
            text = object.constrain(call, target).unwrap().apply(&text);
        }
        let added = "// it\na.aim(\"x\", ball);\na.look_at([0, 1, 0]);\nb.reach(\"x\", ball);\nsun();\n";
        assert!(text.ends_with(added), "{text}");
        // An actor without a variable has room for one constraint.
        let one = "cast(\"a\", m).at(1, 0, 0).reach(\"x\", [0, 1, 0]);";
        let refused = ScriptObject::at(one, 1, 1).unwrap().constrain("look_at([0, 1, 0])", None).unwrap_err();
        assert_eq!(refused.why, "line 1: it has no variable in the script; write let NAME = cast(…)");
    }

    #[test]
    fn the_reach_target_at_the_given_point_is_rewritten() {
        let text = "let ada = cast(\"ada\", m);\nada.reach(\"hand_l\", [1, 1.5, 0.0]); // up\nada.reach(\"hand_r\", [ -1.0, 1.5, 0 ], #{ soft: 0.1 }).until(2.0);\nada.reach(\"foot_l\", ball);\n";
        let object = ScriptObject::at(text, 1, 11).unwrap();
        let moved = |from: [f64; 3], to: [f64; 3]| {
            object.set_reach(DVec3::from_array(from), DVec3::from_array(to)).map(|edit| edit.apply(text))
        };
        let one = moved([1.0, 1.5, 0.0], [1.0, 1.75, 0.25]).unwrap();
        assert_eq!(one, text.replace("[1, 1.5, 0.0]", "[1, 1.75, 0.25]"));
        let other = moved([-1.0, 1.5, 0.0], [-1.0, 1.5, 0.4]).unwrap();
        assert_eq!(other, text.replace("[ -1.0, 1.5, 0 ]", "[ -1.0, 1.5, 0.4 ]"));
        let refused = moved([9.0, 9.0, 9.0], [0.0; 3]).unwrap_err();
        assert_eq!(refused.line, Some(4));
    }
}
