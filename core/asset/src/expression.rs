//! Facial expressions: named groups of morph weights, and how they suppress each other.
//!
//! VRM 1.0, "expressions.md"; `blendShapeMaster` of VRM 0.x in the same form, under 1.0's names.

use glam::{Vec2, Vec4};

/// A named facial expression: `happy`, `aa`, `blink`. Its weight is 0..=1; at 1 it adds its binds to the morph weights.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Expression {
    /// Name in the file.
    pub name: String,
    /// Whether the expression is all or nothing: a weight above 0.5 is 1, any other 0.
    pub binary: bool,
    /// Group of the expression: overrides of other expressions act on groups.
    pub group: ExpressionGroup,
    /// Morph targets that the expression moves.
    pub morphs: Vec<MorphBind>,
    /// Colors that the expression changes.
    pub colors: Vec<ColorBind>,
    /// Textures that the expression moves.
    pub uvs: Vec<UvBind>,
    /// The effect on expressions of the group mouth while this one's weight is above 0.
    pub over_mouth: Override,
    /// The effect on expressions of the group blink while this one's weight is above 0.
    pub over_blink: Override,
    /// The effect on expressions of the group gaze while this one's weight is above 0.
    pub over_gaze: Override,
}

/// Adds `weight` (at full expression) to one morph target of one mesh instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MorphBind {
    /// Index into the asset's instances.
    pub instance: u32,
    /// Index of the morph target.
    pub target: u32,
    /// Weight of the target at the full expression.
    pub weight: f32,
}

/// Blends one color of a material towards `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorBind {
    /// Index into the asset's materials.
    pub material: u32,
    /// The color of the material that changes.
    pub color: MaterialColor,
    /// Color at the full expression, linear; alpha has an effect on the base color only.
    pub to: Vec4,
}

/// A color of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialColor {
    /// Base color.
    Base,
    /// Emitted light.
    Emission,
    /// Color in the shade of a toon material.
    Shade,
    /// Factor of the matcap of a toon material.
    Matcap,
    /// Light at the rim of a toon material.
    Rim,
}

/// Blends offset and scale of all textures of a material towards these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvBind {
    /// Index into the asset's materials.
    pub material: u32,
    /// Offset of the texture coordinates at the full expression.
    pub offset: Vec2,
    /// Scale of the texture coordinates at the full expression.
    pub scale: Vec2,
}

/// Groups of expressions that programs drive procedurally (lip sync, blinking, gaze), and that others can suppress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ExpressionGroup {
    /// None of the other groups.
    #[default]
    Other,
    /// aa, ih, ou, ee, oh.
    Mouth,
    /// blink, blinkLeft, blinkRight.
    Blink,
    /// lookUp, lookDown, lookLeft, lookRight.
    Gaze,
}

impl ExpressionGroup {
    /// The group of a preset's name in VRM 1.0.
    pub fn of_preset(name: &str) -> ExpressionGroup {
        match name {
            "aa" | "ih" | "ou" | "ee" | "oh" => ExpressionGroup::Mouth,
            "blink" | "blinkLeft" | "blinkRight" => ExpressionGroup::Blink,
            "lookUp" | "lookDown" | "lookLeft" | "lookRight" => ExpressionGroup::Gaze,
            _ => ExpressionGroup::Other,
        }
    }
}

/// How an expression suppresses those of another group while its weight is above 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Override {
    /// The others stay as they are.
    #[default]
    None,
    /// The others are 0.
    Block,
    /// The others are multiplied by one minus this expression's weight.
    Blend,
}

/// Turns requested weights into effective ones, in place: clamped, all or nothing, suppressed by each other (VRM 1.0, "Procedural
/// override").
pub fn resolve_weights(expressions: &[Expression], weights: &mut [f32]) {
    for (expression, weight) in expressions.iter().zip(&mut *weights) {
        // NaN becomes 0, too.
        let clamped = if *weight > 0.0 { weight.min(1.0) } else { 0.0 };
        *weight = match expression.binary {
            true => f32::from(u8::from(clamped > 0.5)),
            false => clamped,
        };
    }
    let factor = |group: ExpressionGroup, of: fn(&Expression) -> Override, weights: &[f32]| {
        let mut suppression = 0.0f32;
        for (expression, weight) in expressions.iter().zip(weights) {
            if expression.group == group || *weight <= 0.0 {
                continue;
            }
            suppression += match of(expression) {
                Override::None => 0.0,
                Override::Block => 1.0,
                Override::Blend => *weight,
            };
        }
        1.0 - suppression.min(1.0)
    };
    // All factors come from the weights before any is suppressed.
    let factors = [
        (ExpressionGroup::Mouth, factor(ExpressionGroup::Mouth, |e| e.over_mouth, weights)),
        (ExpressionGroup::Blink, factor(ExpressionGroup::Blink, |e| e.over_blink, weights)),
        (ExpressionGroup::Gaze, factor(ExpressionGroup::Gaze, |e| e.over_gaze, weights)),
    ];
    for (expression, weight) in expressions.iter().zip(weights) {
        for (group, factor) in factors {
            if expression.group == group && factor < 1.0 {
                *weight = if expression.binary { 0.0 } else { *weight * factor };
            }
        }
    }
}

/// Adds the morph binds of resolved weights, or of changes in weights, to the morph weights of the mesh instances.
pub fn add(expressions: &[Expression], weights: &[f32], morph_weights: &mut [Vec<f32>]) {
    for (expression, weight) in expressions.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
        for bind in &expression.morphs {
            let slots = morph_weights.get_mut(bind.instance as usize);
            if let Some(slot) = slots.and_then(|w| w.get_mut(bind.target as usize)) {
                *slot += weight * bind.weight;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expression(name: &str, binary: bool) -> Expression {
        Expression {
            name: name.into(),
            binary,
            group: ExpressionGroup::of_preset(name),
            ..Expression::default()
        }
    }

    fn resolved(expressions: &[Expression], weights: &[f32]) -> Vec<f32> {
        let mut weights = weights.to_vec();
        resolve_weights(expressions, &mut weights);
        weights
    }

    #[test]
    fn weights_are_clamped_and_those_of_binary_expressions_rounded() {
        let faces = [expression("happy", false), expression("sad", true)];
        for (given, expected) in [
            ([0.25, 0.25], [0.25, 0.0]),
            ([1.5, 0.5], [1.0, 0.0]),
            ([-1.0, 0.51], [0.0, 1.0]),
            ([f32::NAN, f32::INFINITY], [0.0, 1.0]),
        ] {
            assert_eq!(resolved(&faces, &given), expected, "{given:?}");
        }
    }

    /// The cases of the specification: "Procedural override", "Interaction between override and isBinary".
    #[test]
    fn overrides_suppress_expressions_of_other_groups() {
        let happy = |over_blink, binary| Expression { over_blink, ..expression("happy", binary) };
        let blink = |binary| expression("blink", binary);
        let of = |over, happy_binary, blink_binary, weight| {
            resolved(&[happy(over, happy_binary), blink(blink_binary)], &[weight, 1.0])[1]
        };
        assert_eq!(of(Override::None, false, false, 0.5), 1.0);
        assert_eq!(of(Override::Block, false, false, 0.25), 0.0);
        assert_eq!(of(Override::Block, false, false, 0.0), 1.0);
        assert_eq!(of(Override::Blend, false, false, 0.25), 0.75);
        // A binary expression suppresses by its resolved weight.
        assert_eq!(of(Override::Blend, true, false, 0.25), 1.0);
        assert_eq!(of(Override::Blend, true, false, 0.75), 0.0);
        // A binary expression that is suppressed at all has weight 0.
        assert_eq!(of(Override::Blend, false, true, 0.25), 0.0);
        // Expressions of the same group, and of groups without an override, are not suppressed.
        let left = Expression { over_blink: Override::Block, ..expression("blinkLeft", false) };
        assert_eq!(resolved(&[left, blink(false)], &[1.0, 1.0]), [1.0, 1.0]);
        assert_eq!(
            resolved(&[happy(Override::Block, false), expression("aa", false)], &[1.0, 1.0]),
            [1.0, 1.0]
        );
        // Several add up.
        let both = [
            happy(Override::Blend, false),
            Expression { name: "sad".into(), ..happy(Override::Blend, false) },
            blink(false),
        ];
        assert_eq!(resolved(&both, &[0.25, 0.5, 1.0])[2], 0.25);
        assert_eq!(resolved(&both, &[0.75, 0.5, 1.0])[2], 0.0);
    }

    #[test]
    fn binds_are_summed_and_invalid_indices_are_ignored() {
        let bind = |target, weight| MorphBind { instance: 0, target, weight };
        let faces = [
            Expression { morphs: vec![bind(0, 0.5), bind(7, 1.0)], ..expression("happy", false) },
            Expression {
                morphs: vec![bind(0, 0.25), MorphBind { instance: 3, target: 0, weight: 1.0 }],
                ..expression("aa", false)
            },
        ];
        let mut weights = vec![vec![0.125, 0.0]];
        add(&faces, &[1.0, 0.5], &mut weights);
        assert_eq!(weights, [[0.75, 0.0]]);
    }
}
