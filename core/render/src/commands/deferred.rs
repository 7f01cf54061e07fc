//! Deferred shading as commands: surfaces without light, then light on what was kept of them.

use crate::Plan;
use crate::commands::draws::{DrawState, light_loop};
use crate::commands::{Command, Cull, RecordOptions, cull_of};
use crate::plan::{Deferred, Draw};

/// The pass before the scene's own: depth, and what is kept of the nearest surfaces.
pub fn geometry(
    plan: &Plan,
    mut commands: Vec<Command>,
    draws: &[Draw],
    options: RecordOptions,
    triangles: &dyn Fn(u32) -> usize,
) -> Vec<Command> {
    commands.push(Command::BeginGeometry);
    let mut state = DrawState::new(plan, commands, false, options, triangles);
    state.geometry = true;
    draws.iter().filter(|d| d.deferred).for_each(|draw| state.draw(draw, cull_of(draw)));
    commands = state.commands;
    commands.push(Command::EndPass);
    commands
}

/// First in the scene's pass.
pub fn light(plan: &Plan, deferred: &Deferred, state: &mut DrawState) {
    let mut variant = deferred.light(crate::shader::LightLoop::All);
    variant.lights = light_loop(plan, &variant.key);
    state.set_cull(Cull::None);
    let area = plan.area.part_of(plan.size);
    state.commands.extend([Command::BindPipeline(variant), Command::DrawLight { area }]);
    state.pipeline = None;
}
