//! Tries an effect before it is used, because an endless loop would hang the GPU.

use crate::environment::Placeholder;
use crate::header::Header;
use crate::machine::Machine;
use crate::overlay::{MAX_FRAME_STEPS, trial_body};
use crate::program::{MAX_STEPS, Program};
use choreo_plugin::{Hook, Manifest, OptionKind, OptionSpec};
use glam::DVec3;

/// The part of an effect that takes too long.
pub(crate) struct SlowPart {
    pub what: String,
    /// Number of the counted loop; `None`: the whole function.
    pub in_loop: Option<u32>,
}

/// Runs the function for a few pixels (places, vertices, lights, lines), with the smallest, the default and the largest parameters.
pub(crate) fn run_trials(program: &Program, header: &Header, manifest: &Manifest) -> Result<(), SlowPart> {
    for p in trial_parameters(manifest) {
        let mut most = 0;
        for arguments in trial_arguments(header, &p) {
            let mut machine = Machine::<1>::new(program, &p);
            for (number, bits) in arguments.iter().enumerate() {
                machine.set(program, number, 0, bits);
            }
            let done = machine.run(program, 1, &Placeholder);
            if done.is_err() || machine.steps > MAX_STEPS || machine.endless != [0] {
                let what = item_name(header.hook);
                return Err(SlowPart {
                    what: format!("{what} takes more than {MAX_STEPS} steps; does a loop never end?"),
                    in_loop: (machine.endless != [0]).then_some(machine.endless[0]),
                });
            }
            most = most.max(machine.steps);
        }
        let count = header.count.of(&p) as u32;
        if header.hook == Hook::Overlay && u64::from(count) * u64::from(most) > u64::from(MAX_FRAME_STEPS) {
            let what = format!(
                "{count} times up to {most} steps are more than {MAX_FRAME_STEPS} a frame; give it a smaller count"
            );
            return Err(SlowPart { what, in_loop: None });
        }
    }
    Ok(())
}

fn item_name(hook: Hook) -> &'static str {
    match hook {
        Hook::Overlay => "a line or triangle",
        Hook::Outline | Hook::Shutter => "the function",
        _ => "a pixel",
    }
}

/// The smallest, the default and the largest parameters.
fn trial_parameters(manifest: &Manifest) -> [Vec<f32>; 3] {
    let ends = |end: fn(&OptionSpec) -> f64| {
        let numbers =
            manifest.options.iter().flat_map(|o| std::iter::repeat_n(end(o) as f32, o.number_count()));
        let mut all: Vec<f32> = numbers.collect();
        all.resize(manifest.parameter_length(), 0.0);
        all
    };
    let least = ends(|o| o.bounds().map_or(0.0, |[min, _]| min));
    let most = ends(|o| match &o.kind {
        OptionKind::Text { one_of, .. } => one_of.len().saturating_sub(1) as f64,
        _ => o.bounds().map_or(1.0, |[_, max]| max),
    });
    [least, manifest.parameters(&[]), most]
}

/// Arguments of the function before the parameters: dark and bright, near and far, facing all directions, the first and the last element.
fn trial_arguments(header: &Header, p: &[f32]) -> Vec<Vec<Vec<u32>>> {
    let colors = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.25, 1.0], [8.0, 8.0, 8.0, 1.0]];
    let samples = [
        [0.0; 20],
        [0.5; 20],
        [
            0.99, 0.01, 7.0, 100.0, 0.0, 1.0, 0.0, -1.0, 0.2, 0.2, 0.2, 1.0, 0.0, 0.0, 3.5, -2.0, 0.5, 0.0,
            1.6, 4.0,
        ],
    ];
    let bits = |values: &[f32]| -> Vec<u32> { values.iter().map(|v| v.to_bits()).collect() };
    match header.hook {
        Hook::Vertex | Hook::Lighting => samples.iter().map(|s| vec![bits(s)]).collect(),
        Hook::Image => {
            const PLACES: [[u32; 2]; 3] = [[0, 0], [63, 40], [10_000, 1]];
            if !header.pass_lines.is_empty() {
                return PLACES.map(|at| vec![at.to_vec()]).to_vec();
            }
            let pass = |n: u32| PLACES.map(|at| vec![at.to_vec(), vec![n]]);
            (0..header.passes).flat_map(pass).collect()
        }
        Hook::Overlay => {
            let count = header.count.of(p) as u32;
            let indices = [0, count / 2, count.saturating_sub(1)];
            let body = |(joints, number)| {
                trial_body(2.5, [DVec3::ZERO, DVec3::splat(0.5)], [joints, number]).to_vec()
            };
            [(0, 0), (40, 3)].iter().flat_map(|b| indices.map(|i| vec![vec![i], body(*b)])).collect()
        }
        Hook::Outline | Hook::Shutter => vec![Vec::new()],
        // This branch is for effects on pixels and surfaces.
        _ => {
            let pairs = colors.iter().flat_map(|c| samples.iter().map(move |s| (c, s)));
            pairs.map(|(color, sample)| vec![bits(color), bits(sample)]).collect()
        }
    }
}
