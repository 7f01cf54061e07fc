//! The numerical choices that one scene could make. Each file has one choice, and returns a [`Choice`] or the reason why the scene has
//! none.

pub mod bake;
pub mod crossfade;
pub mod mips;
pub mod renderer;
pub mod skinning;
pub mod sky;
pub mod solvers;
pub mod tones;
pub mod variants;
pub mod vertices;
pub mod video;

use crate::error::BenchError;
use crate::moment::Moment;
use crate::plots::{Choice, Row};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::Renderer;
use choreo_stage::Stage;
use std::sync::Arc;

/// The scene that is measured, with the devices and the time for it.
pub struct MeasuredScene<'a> {
    pub stage: &'a Arc<Stage>,
    pub registry: &'a Registry,
    /// Stage time at which images are taken.
    pub at: Time,
    /// Size of the images in pixels.
    pub size: [u32; 2],
    /// Renderers to compare; the first is the CPU renderer.
    pub renderers: Vec<Box<dyn Renderer>>,
    /// Whether a Vulkan device was requested: then it is chosen, whatever kind it is.
    pub asks_for_vulkan: bool,
    /// Seconds for the timings of one choice.
    pub budget_secs: f64,
}

/// The measured choices, and those that the scene does not have, as (key, reason).
#[derive(Default)]
pub struct Measured {
    pub choices: Vec<Choice>,
    pub left_out: Vec<(&'static str, String)>,
}

/// Keys of all choices, in the order in which they are measured.
pub const KEYS: [&str; 13] = [
    "bake",
    "crossfade",
    "springs",
    "ik",
    "skinning",
    "vertices",
    "mips",
    "sky",
    "shadows",
    "motion_blur",
    "tones",
    "renderer",
    "video",
];

/// Measures the choices with these keys. Errors come from the scene, a renderer or the video decoder.
pub fn measure(scene: &mut MeasuredScene, keys: &[&str]) -> Result<Measured, BenchError> {
    let moment = Moment::new(scene.stage, scene.at, scene.registry.effects())?;
    let mut measured = Measured::default();
    for key in KEYS {
        if !keys.contains(&key) {
            continue;
        }
        let found = match key {
            "bake" => bake::choices(scene),
            "crossfade" => crossfade::choices(scene),
            "springs" => solvers::springs(scene)?,
            "ik" => solvers::chains(scene)?,
            "sky" => sky::choices(scene),
            "skinning" => skinning::choices(scene, &moment),
            "vertices" => vertices::choices(scene, &moment),
            "mips" => mips::choices(scene, &moment),
            "shadows" => variants::shadows(scene, &moment)?,
            "motion_blur" => variants::motion_blur(scene, &moment)?,
            "tones" => tones::choices(scene)?,
            "renderer" => renderer::choices(scene, &moment)?,
            _ => video::choices(scene, &moment)?,
        };
        match found {
            SceneChoices::Choices(choices) => measured.choices.extend(choices),
            SceneChoices::None(why) => measured.left_out.push((key, why)),
        }
    }
    Ok(measured)
}

pub enum SceneChoices {
    Choices(Vec<Choice>),
    /// The reason why there is nothing to choose.
    None(String),
}

/// Bounds for the errors of the compared methods.
struct Limits {
    /// Largest error that counts as rounding: below it, methods are equally exact.
    rounding: f64,
    /// Smallest error that may be visible.
    visible: f64,
    /// Text of the bound `visible`.
    visible_text: &'static str,
}

/// Chooses a row: the cheapest within the limit, or the most exact one if it costs at most half as much again. If no row is within the
/// limit, the most exact one. Of rows that are equal to rounding and within a tenth of the cost, the first.
fn choose_row(choice: &mut Choice, limits: &Limits) {
    const MAX_COST_RATIO: f64 = 1.5;
    const EQUAL_COST_RATIO: f64 = 1.1;
    let Limits { rounding, visible: tolerance, visible_text: tolerance_words } = *limits;
    let cost = |r: &Row| r.cost().unwrap_or(f64::INFINITY);
    let least = choice.rows.iter().map(|r| r.worst).fold(f64::INFINITY, f64::min);
    let best: Vec<&Row> = choice.rows.iter().filter(|r| r.worst <= least.max(rounding)).collect();
    let cheapest = |rows: &[&Row]| -> Option<Row> {
        let low = rows.iter().map(|r| cost(r)).fold(f64::INFINITY, f64::min);
        rows.iter().find(|r| cost(r) <= low * EQUAL_COST_RATIO).map(|r| (*r).clone())
    };
    let Some(exact) = cheapest(&best) else { return };
    let within: Vec<&Row> = choice.rows.iter().filter(|r| r.worst <= tolerance).collect();
    let (name, why) = match cheapest(&within) {
        None => (exact.name, format!("no method stays within {tolerance_words}; this one comes closest")),
        Some(cheap) if cheap.name == exact.name => (
            exact.name,
            "no other is more accurate beyond rounding, and none within the limit is cheaper".to_string(),
        ),
        Some(cheap) if cost(&exact) <= cost(&cheap) * MAX_COST_RATIO => {
            let more = (cost(&exact) / cost(&cheap) - 1.0) * 100.0;
            (
                exact.name,
                format!(
                    "the most accurate one; costs {more:.0} % more than the cheapest within {tolerance_words}"
                ),
            )
        }
        Some(cheap) => {
            let times = cost(&exact) / cost(&cheap);
            let why = format!(
                "the cheapest within {tolerance_words}; the most accurate one costs {times:.1} times as much"
            );
            (cheap.name, why)
        }
    };
    choice.choose(&name, why);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen_row(rows: &[(&str, f64, f64)]) -> String {
        let mut c = Choice::new("c", "?");
        c.rows = rows.iter().map(|(n, e, t)| Row::new(*n).error(*e, *e).nanos(*t)).collect();
        choose_row(&mut c, &Limits { rounding: 0.01, visible: 1.0, visible_text: "1 mm" });
        c.chosen.map_or(String::new(), |i| c.rows[i].name.clone())
    }

    #[test]
    fn the_cheapest_within_the_tolerance_unless_the_exact_one_is_worth_it() {
        let rows = [("exact", 0.0, 100.0), ("good", 0.5, 40.0), ("bad", 5.0, 1.0)];
        assert_eq!(chosen_row(&rows), "good");
        assert_eq!(chosen_row(&[("exact", 0.0, 50.0), ("good", 0.5, 40.0)]), "exact");
        assert_eq!(chosen_row(&rows[2..]), "bad");
        // A difference within rounding does not change the chosen method.
        assert_eq!(chosen_row(&[("as it is", 0.002, 10.0), ("luckier", 0.001, 9.5)]), "as it is");
    }
}
