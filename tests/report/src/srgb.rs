//! sRGB: decoding and encoding of colors.

use crate::{BUDGET_SECS, Section};
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_render::scene_resources::mipmap::{linear_to_srgb8, srgb_to_linear_table};

const DECODE_METHODS: [&str; 4] = ["table of 256", "formula, f32 power", "2.2 power", "cubic polynomial"];
const ENCODE_METHODS: [&str; 5] = [
    "thresholds, found by a table",
    "formula, f32 power, rounded",
    "1/2.2 power, rounded",
    "table of 4096",
    "three square roots, rounded",
];

/// Reference decoding of an 8-bit code by IEC 61966-2-1, in f64.
fn reference_decode(code: f64) -> f64 {
    let v = code / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn reference_encode(light: f64) -> f64 {
    255.0 * if light <= 0.003_130_8 { light * 12.92 } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

fn decode(method: usize, code: u8) -> f32 {
    let v = f32::from(code) / 255.0;
    match method {
        0 => srgb_to_linear_table()[usize::from(code)],
        1 if v <= 0.04045 => v / 12.92,
        1 => ((v + 0.055) / 1.055).powf(2.4),
        2 => v.powf(2.2),
        // Polynomial fitted by C. Hable, "sRGB approximations for HLSL", 2010.
        _ => v * (v * (v * 0.305_306_01 + 0.682_171_1) + 0.012_522_878),
    }
}

fn encode(method: usize, light: f32, table: &[u8]) -> u8 {
    let code = match method {
        0 => return linear_to_srgb8(light),
        1 if light <= 0.003_130_8 => light * 12.92,
        1 => 1.055 * light.powf(1.0 / 2.4) - 0.055,
        2 => light.powf(1.0 / 2.2),
        3 => return table[(light * 4095.0 + 0.5) as usize],
        _ => {
            // Fit of the same author.
            let s1 = light.sqrt();
            let s2 = s1.sqrt();
            let s3 = s2.sqrt();
            0.662_002_7 * s1 + 0.684_122_1 * s2 - 0.323_583_6 * s3 - 0.022_541_147 * light
        }
    };
    (code.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "sRGB",
        text: "Textures are decoded to light and frames encoded from it, pixel by pixel. Errors are in \
               steps of 8-bit codes: for decoding, the error of the light converted by the slope of the \
               curve; for encoding, the distance from the exact value, at most half a code if rounding is \
               correct."
            .into(),
        choices: vec![compare_decoding(), compare_encoding()],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}

fn compare_decoding() -> Choice {
    let mut choice = Choice::new("srgb_decode", "How is an sRGB code decoded to light?");
    choice.error_unit = "codes";
    choice.reference = "the formula of IEC 61966-2-1 in f64, all 256 codes".into();
    choice.per = "channel".into();
    let case = |method: usize| {
        Case::new(256, move || {
            (0..=255u8).for_each(|code| _ = std::hint::black_box(decode(method, std::hint::black_box(code))))
        })
    };
    let nanos =
        interleaved(Clock::Thread, BUDGET_SECS, &mut (0..DECODE_METHODS.len()).map(case).collect::<Vec<_>>());
    for (method, name) in DECODE_METHODS.into_iter().enumerate() {
        let (mut error, mut place) = (ErrorStats::default(), String::new());
        for code in 0..=255u8 {
            // Error in codes: the value is encoded exactly, without rounding.
            let difference =
                (reference_encode(f64::from(decode(method, code)).max(0.0)) - f64::from(code)).abs();
            if error.add(difference) {
                place = format!("code {code}, {:.2e}", reference_decode(f64::from(code)));
            }
        }
        choice.rows.push(Row::new(name).error(error.worst, error.mean()).nanos(nanos[method]).at(place));
    }
    choice.choose(DECODE_METHODS[0], "exact to f32; the only cheaper way is 5 codes off");
    choice
}

fn compare_encoding() -> Choice {
    let table: Vec<u8> = (0..4096).map(|i| reference_encode(f64::from(i) / 4095.0).round() as u8).collect();
    let lights: Vec<f32> = (0..=20_000).map(|i| i as f32 / 20_000.0).collect();
    let mut choice = Choice::new("srgb_encode", "How is light encoded to 8 bits of sRGB?");
    choice.error_unit = "codes";
    choice.reference =
        "the formula of IEC 61966-2-1 in f64, not rounded, at 20001 values; 0.5 is correct rounding".into();
    choice.per = "channel".into();
    let (some, table) = (&lights[..], &table[..]);
    let case = |method: usize| {
        Case::new(some.len(), move || {
            some.iter().for_each(|light| {
                _ = std::hint::black_box(encode(method, std::hint::black_box(*light), table))
            });
        })
    };
    let nanos =
        interleaved(Clock::Thread, BUDGET_SECS, &mut (0..ENCODE_METHODS.len()).map(case).collect::<Vec<_>>());
    for (method, name) in ENCODE_METHODS.into_iter().enumerate() {
        let (mut error, mut place) = (ErrorStats::default(), String::new());
        for light in some {
            let difference =
                (f64::from(encode(method, *light, table)) - reference_encode(f64::from(*light))).abs();
            if error.add(difference) {
                place = format!("light {light:.5}");
            }
        }
        choice.rows.push(Row::new(name).error(error.worst, error.mean()).nanos(nanos[method]).at(place));
    }
    choice.choose(ENCODE_METHODS[0], "rounds every value correctly, for less than the power costs");
    choice
}
