//! The pass of the inputs of image effects (depth, normals, motion vectors, actors), recorded before everything else.

use crate::commands::draws::DrawRecorder;
use crate::commands::{Command, Recorder, cull_of};
use crate::shader::InputTargets;

pub(super) fn record_inputs(recorder: Recorder, commands: &mut Vec<Command>) {
    let Some(pass) = &recorder.plan.scene_inputs else { return };
    commands.push(Command::BeginInputs { motion: pass.motion });
    let mut draws = DrawRecorder::new(recorder, commands);
    draws.inputs = if pass.motion { InputTargets::Motion } else { InputTargets::Surface };
    pass.draws.iter().for_each(|draw| draws.draw(draw, cull_of(draw)));
    commands.push(Command::EndInputs);
}
