//! Skinning: characters pre-skinned once per frame, or skinned in every pass that draws them.

use crate::images::{measure_times, renderers, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Table, ratio, time};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::Plan;
use choreo_stage::PreSkinning;

const SIZE: [u32; 2] = [1280, 720];
/// Largest number of passes: the image, and a shadow map for each lamp.
const MAX_PASSES: usize = 8;
const CROWD_SIZES: [usize; 2] = [1, 25];

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Pre-skinning of characters",
        text: "The built-in figure, dancing, at 1280×720, alone and 25 times, lit by none to seven lamps, \
               each with a shadow map of 256 texels: every lamp adds a pass that draws each character. \
               Vertices are skinned by each pass, or once by a compute stage for all passes (the CPU \
               renderer: once by the same function). Times are milliseconds of the whole process for each \
               frame; both ways are drawn in turns."
            .into(),
        choices: Vec::new(),
        tables: measure_pass_counts()?,
        off_front: Vec::new(),
    })
}

fn moment(crowd: usize, lamps: usize, registry: &Registry) -> Result<Moment, String> {
    let text = format!(
        r#"
        stage(#{{ length: 2.0, ambient: 0.3 }});
        let figure = load("choreo:mannequin");
        let side = if {crowd} == 1 {{ 1 }} else {{ 5 }};
        for i in 0..{crowd} {{
            cast("figure " + i, figure).at(-3.0 + 1.5 * (i % side), 0.0, -1.5 * (i / side)).play(figure.clip("Dance_Groove"));
        }}
        cast("floor", shape("plane", #{{ size: 30.0, color: "grey" }}));
        for i in 0..{lamps} {{
            spot(#{{ outer: 60.0, direction: [0.1, -1.0, -0.9], intensity: 20.0, shadow: #{{ size: 256 }} }}).at(-6.0 + 2.0 * i, 6.0, 4.0);
        }}
        camera("front").at(0.0, 2.5, 7.0).look_at([-0.5, 0.8, -2.0]);
        "#
    );
    let stage = stage(&text, registry)?;
    Moment::new(&stage, Time::from_secs(0.7), registry.effects()).map_err(|e| e.to_string())
}

fn measure_pass_counts() -> Result<Vec<Table>, String> {
    let registry = choreo::registry();
    let mut out = Vec::new();
    for (name, mut renderer) in renderers(&registry) {
        let name = match renderer.device().name.clone() {
            device if name == "Vulkan" => format!("{name} ({device})"),
            _ => name.to_string(),
        };
        let columns = [
            ("passes", "that draw each body"),
            (">by each", "one figure"),
            (">once", "one figure"),
            (">ratio", "one figure"),
            (">by each ", "25 figures"),
            (">once ", "25 figures"),
            (">ratio ", "25 figures"),
        ];
        let mut table = Table::new(format!("Pre-skinned once, or by every pass: {name}"), &columns);
        for lamps in 0..MAX_PASSES {
            let mut cells = vec![Cell::text((lamps + 1).to_string())];
            for crowd in CROWD_SIZES {
                let moment = moment(crowd, lamps, &registry)?;
                renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
                let plan = |pre_skinning| Plan { pre_skinning, ..moment.plan(SIZE, 1) };
                let plans = [plan(PreSkinning::Never), plan(PreSkinning::Always)];
                let nanos = measure_times(&mut *renderer, &plans.each_ref(), 2.0 * BUDGET_SECS);
                cells.extend(nanos.iter().copied().map(time));
                cells.push(ratio(&nanos[0], &nanos[1]));
            }
            table.rows.push(cells);
        }
        out.push(table);
    }
    Ok(out)
}
