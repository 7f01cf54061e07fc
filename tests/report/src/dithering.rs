//! Dithering: quantization of a gradient to 8 bits.

use crate::Section;
use crate::images::{draw_frame, stage};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Table, quantity};
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Renderer};

/// 8-bit codes of gray at the top and at the bottom.
const GRADIENT_CODES: [f64; 2] = [40.0, 52.0];
const SIZE: [usize; 2] = [128, 256];
const BLOCK_SIDE: usize = 16;
const METHODS: [&str; 4] =
    ["→ ranks of blue noise (the renderer's image)", "rounded", "ranks of Bayer, 8 × 8", "white noise"];

pub(crate) fn section() -> Result<Section, String> {
    let exact = reference_gradient();
    let mut table = Table::new(
        format!(
            "A gradient over {} codes in {} pixels: codes of 255",
            GRADIENT_CODES[1] - GRADIENT_CODES[0],
            SIZE[1]
        ),
        &[
            ("way", "way"),
            (">mean of 16 × 16 pixels, worst", "worst"),
            (">mean", "mean"),
            (">of 4 × 4 pixels, worst", "small"),
            (">longest run of one code in a column", "run"),
        ],
    );
    for (method, name) in METHODS.iter().enumerate() {
        let codes = quantize(method, &exact)?;
        let (worst, mean) = worst_and_mean_error(&codes, &exact, BLOCK_SIDE);
        let (small, _) = worst_and_mean_error(&codes, &exact, 4);
        let cell = |v: f64| Cell::number(quantity(v), v);
        table.rows.push(vec![
            Cell::text(*name),
            cell(worst),
            cell(mean),
            cell(small),
            Cell::count(longest_run(&codes)),
        ]);
    }
    table.notes.push("error: of the mean code of a square, against the gradient in f64".into());
    Ok(Section {
        title: "Dithering of gradients",
        text: "In a dark gradient over a screen one 8-bit code covers many pixels, and the edges between \
               codes are visible as bands. Ranks of blue noise choose the pixels that take the upper code: \
               no band remains, and the mean of few pixels is right. Dithering is on for gradients and the \
               sky, and for whole images after effects on images and motion blur; colors that are exact \
               codes stay as they are."
            .into(),
        choices: Vec::new(),
        tables: vec![table],
        off_front: Vec::new(),
    })
}

/// The exact gradient in codes, row by row: equal steps of linear light from the top of the image to the bottom.
fn reference_gradient() -> Vec<f64> {
    let light = GRADIENT_CODES.map(|code| choreo_asset::linear_from_srgb(code / 255.0));
    let row = |y: usize| {
        let share = (y as f64 + 0.5) / SIZE[1] as f64;
        255.0 * choreo_asset::srgb_from_linear(light[0] + (light[1] - light[0]) * share)
    };
    (0..SIZE[1]).map(row).collect()
}

fn quantize(method: usize, exact: &[f64]) -> Result<Vec<f64>, String> {
    if method == 0 {
        return render_gradient();
    }
    let mut random = crate::Random(5);
    let bayer = |x: usize, y: usize| {
        let bit = |b: usize| ((((x ^ y) >> b) & 1) << 1 | ((y >> b) & 1)) << (2 * (2 - b));
        ((bit(0) + bit(1) + bit(2)) as f64 + 0.5) / 64.0
    };
    let mut code = |i: usize| {
        let (x, y) = (i % SIZE[0], i / SIZE[0]);
        let threshold = match method {
            1 => 0.5,
            2 => bayer(x, y),
            _ => random.unit(),
        };
        (exact[y] + threshold).floor()
    };
    Ok((0..SIZE[0] * SIZE[1]).map(&mut code).collect())
}

fn render_gradient() -> Result<Vec<f64>, String> {
    let registry = choreo::registry();
    let hex = GRADIENT_CODES.map(|code| format!("#{0:02x}{0:02x}{0:02x}", code as u8));
    let [width, height] = SIZE;
    let text = format!(
        "stage(#{{ size: [{width}, {height}], background: #{{ top: \"{}\", bottom: \"{}\" }} }});
         cast(\"far\", shape(\"box\")).at(0, 0, 90);
         camera(\"c\").at(0, 0, 0).look_at([0, 0, -1]);",
        hex[0], hex[1]
    );
    let stage = stage(&text, &registry)?;
    let moment = Moment::new(&stage, Time::ZERO, registry.effects()).map_err(|e| e.to_string())?;
    let mut renderer = CpuRenderer::new(registry.effects());
    renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
    let frame = draw_frame(&mut renderer, &moment.plan(SIZE.map(|n| n as u32), 1))?;
    Ok(frame.rgba.chunks_exact(4).map(|p| f64::from(p[0])).collect())
}

/// Worst and mean error of the averages over blocks.
fn worst_and_mean_error(codes: &[f64], exact: &[f64], block: usize) -> (f64, f64) {
    let (mut worst, mut sum, mut count) = (0.0f64, 0.0, 0.0);
    for y in (0..SIZE[1]).step_by(block) {
        let truth = exact[y..y + block].iter().sum::<f64>() / block as f64;
        for x in (0..SIZE[0]).step_by(block) {
            let pixels = (0..block * block).map(|i| codes[(y + i / block) * SIZE[0] + x + i % block]);
            let difference = (pixels.sum::<f64>() / (block * block) as f64 - truth).abs();
            worst = worst.max(difference);
            sum += difference;
            count += 1.0;
        }
    }
    (worst, sum / count)
}

/// Largest number of vertically adjacent pixels with the same code.
fn longest_run(codes: &[f64]) -> usize {
    let longest = |x: usize| {
        let column: Vec<f64> = (0..SIZE[1]).map(|y| codes[y * SIZE[0] + x]).collect();
        column.chunk_by(|a, b| a == b).map(<[f64]>::len).max().unwrap_or(0)
    };
    (0..SIZE[0]).map(longest).max().unwrap_or(0)
}
