//! Passes for compositors: samples needed for Cryptomatte IDs, pixel formats of OpenEXR files, cost of each pass.

use crate::images::{renderers, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Choice, Row, Table};
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_importer_kit_testing::export::SharedBytes;
use choreo_motion::{FrameRate, Time};
use choreo_plugin::{FloatFrame, FrameWish, IdMatte, OptionValue, Passes, Registry, VideoInfo};
use choreo_render::{CpuRenderer, Plan, PlanOptions, Renderer};
use exr::prelude::{ReadChannels, ReadLayers};
use std::cell::RefCell;
use std::io::Cursor;

const SIZE: [u32; 2] = [320, 180];
/// Supersampling of the reference along each side of a pixel; each of its pixels has one name.
const SUPERSAMPLING: u32 = 16;

/// Two dancers one behind the other, thin posts, a floor, light from a window: many edges, and values far above 1.
const SCENE: &str = r##"
    stage(#{ length: 2.0, fps: 24, background: "#10182000" });
    let figure = load("choreo:mannequin");
    for i in 0..3 { cast("figure " + i, figure).at(0.7 * i - 0.7, 0.0, -0.6 * i).play(figure.clip("Dance_Groove")).from(-0.4 * i); }
    for i in 0..9 { cast("post " + i, shape("cylinder", #{ size: [0.02, 1.6, 0.02], color: "gold" })).at(0.5 * i - 2.0, 0.0, -1.9).rotate(0, 0, 7.0 * i); }
    cast("floor", shape("plane", #{ size: 8.0, color: "#808890" }));
    sun(#{ direction: [-0.6, -1.0, -0.9], intensity: 12.0, shadow: true });
    camera("front").fov(38).at(0.4, 1.3, 4.2).look_at([0.0, 0.85, -0.5]);
"##;

fn test_moment(registry: &Registry) -> Result<Moment, String> {
    Moment::new(&stage(SCENE, registry)?, Time::from_secs(0.7), registry.effects()).map_err(|e| e.to_string())
}

fn plan(moment: &Moment, size: [u32; 2], passes: Passes) -> Plan {
    let wish = FrameWish::Scene(passes);
    let options = PlanOptions { effects: &moment.effects, wish, ..PlanOptions::new(size, 4) };
    Plan::new(&moment.resources, &moment.stage, &moment.snapshot, &options)
}

fn draw_float_frame(renderer: &mut dyn Renderer, plan: &Plan) -> Result<FloatFrame, String> {
    renderer.submit(plan.clone()).map_err(|e| e.to_string())?;
    renderer.collect_floats().map_err(|e| e.to_string())
}

/// Coverage of each name at each pixel: one row per pixel, one number per name.
fn coverage_by_name(matte: &IdMatte) -> Vec<Vec<f64>> {
    let pixels = matte.ranks.first().map_or(0, Vec::len);
    let mut out = vec![vec![0.0; matte.names.len()]; pixels];
    for rank in &matte.ranks {
        for (row, share) in out.iter_mut().zip(rank) {
            if let Some(name) = (share.number as usize).checked_sub(1) {
                row[name] += f64::from(share.share);
            }
        }
    }
    out
}

/// Averages coverage over squares of `SUPERSAMPLING` × `SUPERSAMPLING` pixels.
fn average_to_pixels(fine: &[Vec<f64>], [width, height]: [u32; 2]) -> Vec<Vec<f64>> {
    let (step, names) = (SUPERSAMPLING as usize, fine.first().map_or(0, Vec::len));
    let mut out = vec![vec![0.0; names]; (width * height) as usize];
    let row = width as usize * step;
    for (index, shares) in fine.iter().enumerate() {
        let (x, y) = (index % row / step, index / row / step);
        for (sum, share) in out[y * width as usize + x].iter_mut().zip(shares) {
            *sum += share / (step * step) as f64;
        }
    }
    out
}

fn compare_id_samples(moment: &Moment) -> Result<Choice, String> {
    let mut renderer = CpuRenderer::new(&moment.effects);
    renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
    let ids = |samples| Passes { id: true, id_samples: samples, ..Passes::default() };
    let missing = || "the frame has no ids".to_string();
    let fine = draw_float_frame(&mut renderer, &plan(moment, SIZE.map(|n| n * SUPERSAMPLING), ids(1)))?;
    let truth = average_to_pixels(&coverage_by_name(&fine.actors.ok_or_else(missing)?), SIZE);
    let mut choice = Choice::new("cryptomatte", "How many samples for the ids of actors?");
    choice.error_unit = "% of a pixel";
    choice.by_mean = true;
    choice.reference = format!(
        "{} samples of each pixel; for pixels that show more than one name, or a name and nothing",
        SUPERSAMPLING * SUPERSAMPLING
    );
    choice.per = format!("frame of {}×{} with ids alone", SIZE[0], SIZE[1]);
    let plans = [1, 4, 16].map(|samples| (samples, plan(moment, SIZE, ids(samples))));
    for (samples, plan) in &plans {
        let frame = draw_float_frame(&mut renderer, plan)?;
        let own = coverage_by_name(&frame.actors.ok_or_else(missing)?);
        let (mut worst, mut sum, mut count, mut at) = (0.0f64, 0.0, 0, 0);
        for (index, (own, truth)) in own.iter().zip(&truth).enumerate() {
            if !truth.iter().any(|share| *share > 0.0 && *share < 1.0) {
                continue;
            }
            let difference = own.iter().zip(truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            (sum, count) = (sum + difference, count + 1);
            if difference > worst {
                (worst, at) = (difference, index as u32);
            }
        }
        let name = if *samples == 1 { "1 sample".into() } else { format!("{samples} samples") };
        let place = format!("pixel {}, {}", at % SIZE[0], at / SIZE[0]);
        let row = Row::new(name).error(100.0 * worst, 100.0 * sum / f64::from(count.max(1))).at(place);
        choice.rows.push(row.note(format!("{count} pixels")));
    }
    let cell = RefCell::new(renderer);
    let case = |(_, plan): &(u32, Plan)| {
        let cell = &cell;
        let plan = plan.clone();
        Case::new(1, move || drop(draw_float_frame(&mut *cell.borrow_mut(), &plan)))
    };
    let nanos =
        interleaved(Clock::Process, 4.0 * BUDGET_SECS, &mut plans.iter().map(case).collect::<Vec<_>>());
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        "4 samples",
        "as many as color has by default, at the same places, so that an actor's share of a pixel is that of its color; --export id_samples=16 \
         for finer edges",
    );
    Ok(choice)
}

/// Encodes the frame as a file with these options.
fn encode_exr(
    registry: &Registry,
    frame: &FloatFrame,
    passes: &str,
    options: [&str; 2],
) -> Result<Vec<u8>, String> {
    let exporter = registry.exporter_for("out.exr").ok_or("no exporter writes .exr")?;
    let mut given = exporter.manifest().complete(&Default::default()).map_err(|e| e.message)?;
    for (name, value) in ["pixels", "compression", "passes"].iter().zip([options[0], options[1], passes]) {
        given.0.insert((*name).into(), OptionValue::Text(value.into()));
    }
    let info = VideoInfo {
        width: frame.width,
        height: frame.height,
        fps: FrameRate { num: 24, den: 1 },
        frames: 1,
        provenance: Vec::new(),
        options: given,
    };
    let out = SharedBytes::default();
    let mut sink = exporter.begin(&info, Box::new(out.clone())).map_err(|e| e.to_string())?;
    sink.float_frame(frame).map_err(|e| e.to_string())?;
    sink.finish().map_err(|e| e.to_string())?;
    Ok(out.bytes())
}

/// Channels R, G and B of a file, concatenated.
fn decode_color_channels(file: &[u8]) -> Result<Vec<f32>, String> {
    let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = read.first_valid_layer().all_attributes().from_buffered(Cursor::new(file));
    let image = image.map_err(|e| e.to_string())?;
    let mut out = Vec::new();
    for name in ["R", "G", "B"] {
        let channel = image.layer_data.channel_data.list.iter().find(|channel| channel.name.eq(name));
        out.extend(channel.ok_or(format!("the file has no {name}"))?.sample_data.values_as_f32());
    }
    Ok(out)
}

fn compare_exr_pixel_types(moment: &Moment, registry: &Registry) -> Result<Choice, String> {
    let mut renderer = CpuRenderer::new(&moment.effects);
    renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
    let color = Passes { color: true, ..Passes::default() };
    let frame = draw_float_frame(&mut renderer, &plan(moment, SIZE, color))?;
    let truth: Vec<f32> =
        (0..3).flat_map(|channel| frame.color.iter().map(move |color| color[channel])).collect();
    let mut choice = Choice::new("exr_pixels", "In which format does an OpenEXR file store light?");
    choice.error_unit = "% of the value";
    choice.reference =
        "the renderer's own 32-bit floats, of values above 0.0001, read again from the file".into();
    choice.per = format!("file of {}×{}, color alone", SIZE[0], SIZE[1]);
    let methods: Vec<[&str; 2]> = ["half", "float"]
        .into_iter()
        .flat_map(|pixels| ["none", "zips", "zip"].map(|c| [pixels, c]))
        .collect();
    for method in &methods {
        let file = encode_exr(registry, &frame, "color", *method)?;
        let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0u32);
        for (own, truth) in
            decode_color_channels(&file)?.iter().zip(&truth).filter(|(_, truth)| **truth > 1e-4)
        {
            let difference = 100.0 * f64::from((own - truth).abs() / truth);
            (worst, sum, count) = (worst.max(difference), sum + difference, count + 1);
        }
        let row = Row::new(method.join(", ")).error(worst, sum / f64::from(count.max(1)));
        choice.rows.push(row.bytes(file.len() as f64));
    }
    let case = |method: &[&'static str; 2]| {
        let (frame, method) = (&frame, *method);
        Case::new(1, move || drop(encode_exr(registry, frame, "color", method)))
    };
    let nanos =
        interleaved(Clock::Process, 2.0 * BUDGET_SECS, &mut methods.iter().map(case).collect::<Vec<_>>());
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        "half, zip",
        "0.05 % is invisible after color grading, in the smallest file; every compositor reads it",
    );
    Ok(choice)
}

/// Cost of a frame with each pass in addition to color, on each device, and the bytes that the pass adds to the file.
fn measure_pass_costs(moment: &Moment, registry: &Registry) -> Result<Table, String> {
    let columns = [
        ("passes", "passes"),
        (">CPU renderer, ms", "cpu"),
        (">Vulkan, ms", "vulkan"),
        (">file, kB", "file"),
    ];
    let title = format!("Cost of passes: a frame of {}×{}, 4 samples; all threads", SIZE[0], SIZE[1]);
    let mut table = Table::new(title, &columns);
    let lists = [
        "color",
        "color,depth",
        "color,normal",
        "color,motion",
        "color,albedo",
        "color,id",
        "color,depth,normal,motion,albedo,id",
    ];
    let mut cells: Vec<Vec<Cell>> = lists.iter().map(|list| vec![Cell::text(*list)]).collect();
    let mut files = Vec::new();
    let mut all = renderers(registry);
    for (name, renderer) in &mut all {
        renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
        let plans: Vec<Plan> = lists
            .iter()
            .map(|list| Ok(plan(moment, SIZE, Passes::parse(list).map_err(|e| e.to_string())?)))
            .collect::<Result<_, String>>()?;
        if *name == "CPU renderer" {
            for (plan, list) in plans.iter().zip(lists) {
                let frame = draw_float_frame(&mut **renderer, plan)?;
                files.push(encode_exr(registry, &frame, list, ["half", "zip"])?.len() as f64);
            }
        }
        let cell = RefCell::new(renderer);
        let case = |plan: &Plan| {
            let (cell, plan) = (&cell, plan.clone());
            Case::new(1, move || drop(draw_float_frame(&mut ***cell.borrow_mut(), &plan)))
        };
        let nanos =
            interleaved(Clock::Process, 6.0 * BUDGET_SECS, &mut plans.iter().map(case).collect::<Vec<_>>());
        for (cells, nanos) in cells.iter_mut().zip(nanos) {
            let ms = nanos.median * 1e-6;
            cells.push(Cell::number(format!("{ms:.1}"), ms));
        }
    }
    for (mut cells, bytes) in cells.into_iter().zip(files) {
        cells.resize(3, Cell::empty());
        cells.push(Cell::number(format!("{:.0}", bytes / 1e3), bytes));
        table.rows.push(cells);
    }
    Ok(table)
}

pub(crate) fn section() -> Result<Section, String> {
    let registry = choreo::registry();
    let moment = test_moment(&registry)?;
    Ok(Section {
        title: "Passes for compositors",
        text: "Passes that nobody requests are not drawn. Depth, normals and motion vectors come from one \
               pass with one sample, so the second of them is nearly free; albedo is the frame drawn again \
               without light; ids are drawn once for each of their samples (decision 64)."
            .into(),
        choices: vec![compare_id_samples(&moment)?, compare_exr_pixel_types(&moment, &registry)?],
        tables: vec![measure_pass_costs(&moment, &registry)?],
        off_front: vec![(
            "exr_pixels",
            "compression takes time that an uncompressed file saves; but frames are compressed on threads \
             beside the renderer, and disks and networks are slower.",
        )],
    })
}
