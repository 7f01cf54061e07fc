//! An effect is tried before it is used: an endless loop would hang the GPU.

use crate::around::Plain;
use crate::head::Head;
use crate::overlay::MOST_FRAME_STEPS;
use crate::program::{MOST_STEPS, Program};
use crate::shape::Value;
use choreo_plugin::{Hook, Manifest, OptionKind};
use naga::Span;

/// What takes too long, and where.
pub struct Slow {
    pub what: String,
    /// `None`: the function as a whole.
    pub span: Option<Span>,
}

/// Tries a few pixels (places, corners, lights, lines) at the least, the usual and the largest parameters.
pub fn ends(program: &Program, head: &Head, manifest: &Manifest) -> Result<(), Slow> {
    for set in SETS {
        let mut p = [0.0; 8];
        for (slot, option) in p.iter_mut().zip(&manifest.options) {
            *slot = set(&option.kind);
        }
        let mut most = 0;
        for mut arguments in trials(head, &p) {
            arguments.push(Value::floats(&p));
            let done = program.run(arguments, &Plain).map_err(|slow| Slow {
                what: format!(
                    "{} takes more than {MOST_STEPS} steps; does a loop never end?",
                    what(head.hook)
                ),
                span: slow.span,
            })?;
            most = most.max(done.steps);
        }
        let count = head.count.of(&p) as u32;
        if head.hook == Hook::Overlay && u64::from(count) * u64::from(most) > u64::from(MOST_FRAME_STEPS) {
            let what = format!(
                "{count} times up to {most} steps are more than {MOST_FRAME_STEPS} a frame; give it a smaller count"
            );
            return Err(Slow { what, span: None });
        }
    }
    Ok(())
}

fn what(hook: Hook) -> &'static str {
    match hook {
        Hook::Overlay => "a line or triangle",
        Hook::Shell => "the function",
        _ => "a pixel",
    }
}

const SETS: [fn(&OptionKind) -> f32; 3] = [
    |kind| match kind {
        OptionKind::Number { min, .. } => *min as f32,
        _ => 0.0,
    },
    |kind| match kind {
        OptionKind::Number { default, .. } => *default as f32,
        OptionKind::Bool { default } => f32::from(u8::from(*default)),
        OptionKind::Text { default, one_of } => one_of.iter().position(|o| o == default).unwrap_or(0) as f32,
    },
    |kind| match kind {
        OptionKind::Number { max, .. } => *max as f32,
        OptionKind::Bool { .. } => 1.0,
        OptionKind::Text { one_of, .. } => one_of.len().saturating_sub(1) as f32,
    },
];

/// What its function is given but for the parameters: dark and bright, near and far, of every facing, the first and the last.
fn trials(head: &Head, p: &[f32; 8]) -> Vec<Vec<Value>> {
    let colors = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.25, 1.0], [8.0, 8.0, 8.0, 1.0]];
    let places = [
        [0.0; 20],
        [0.5; 20],
        [
            0.99, 0.01, 7.0, 100.0, 0.0, 1.0, 0.0, -1.0, 0.2, 0.2, 0.2, 1.0, 0.0, 0.0, 3.5, -2.0, 0.5, 0.0,
            1.6, 4.0,
        ],
    ];
    let with_color = |n: usize| -> Vec<Vec<Value>> {
        let pairs = colors.iter().flat_map(|c| places.iter().map(move |p| (c, p)));
        pairs.map(|(c, p)| vec![Value::floats(c), Value::floats(&p[..n])]).collect()
    };
    match head.hook {
        Hook::Surface => with_color(20),
        Hook::Vertex => places.iter().map(|p| vec![Value::floats(&p[..11])]).collect(),
        Hook::Lighting => places.iter().map(|p| vec![Value::floats(p)]).collect(),
        Hook::Picture => {
            let pass =
                |n: u32| [[0, 0], [63, 40], [10_000, 1]].map(|at| vec![Value::ints(at), Value::uint(n)]);
            (0..head.passes).flat_map(pass).collect()
        }
        Hook::Overlay => {
            let count = head.count.of(p) as u32;
            let bodies = [(0, 0), (40, 3)];
            let indices = [0, count / 2, count.saturating_sub(1)];
            let body =
                |(joints, number)| crate::overlay::body_value(2.5, [places[0], places[1]], [joints, number]);
            bodies.iter().flat_map(|b| indices.map(|i| vec![Value::uint(i), body(*b)])).collect()
        }
        Hook::Shell => vec![Vec::new()],
        _ => with_color(2),
    }
}
