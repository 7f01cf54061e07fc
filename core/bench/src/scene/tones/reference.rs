//! Reference tone mapping in f64: the transforms as their authors publish them.

use glam::{DMat3, DVec3};

const fn rows(m: [[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&[
        [m[0][0], m[1][0], m[2][0]],
        [m[0][1], m[1][1], m[2][1]],
        [m[0][2], m[1][2], m[2][2]],
    ])
}

/// RGB to XYZ from the chromaticities of the primaries and the white point (SMPTE RP 177).
fn to_xyz(primaries: [[f64; 2]; 3], white: [f64; 2]) -> DMat3 {
    let xyz = |[x, y]: [f64; 2]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let m = DMat3::from_cols(xyz(primaries[0]), xyz(primaries[1]), xyz(primaries[2]));
    m * DMat3::from_diagonal(m.inverse() * xyz(white))
}

const D60: [f64; 2] = [0.32168, 0.33767];
const D65: [f64; 2] = [0.3127, 0.3290];
const SRGB: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
const AP0: [[f64; 2]; 3] = [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770]];
const AP1: [[f64; 2]; 3] = [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044]];
/// Luminance weights of AP1.
const LUMA: DVec3 = DVec3::new(0.272_228_716_8, 0.674_081_765_8, 0.053_689_517_4);

/// Bradford chromatic adaptation of XYZ from one white point to another.
fn chromatic_adaptation(from: [f64; 2], to: [f64; 2]) -> DMat3 {
    let cone = rows([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]);
    let white = |[x, y]: [f64; 2]| cone * DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    cone.inverse() * DMat3::from_diagonal(white(to) / white(from)) * cone
}

/// A uniform quadratic B-spline in log10 space between three points (x, y); constant below the first, and with the slope `slope_high` above
/// the last.
fn spline(x: f64, points: [[f64; 2]; 3], low: &[f64], high: &[f64], slope_high: f64) -> f64 {
    let x = libm::log10(x.max(6.103_515_625e-5));
    let [[x0, y0], [x1, _], [x2, y2]] = points.map(|p| p.map(libm::log10));
    let piece = |knots: &[f64], from: f64, to: f64| {
        let at = (knots.len() - 3) as f64 * (x - from) / (to - from);
        let (j, t) = (at as usize, at.fract());
        let [a, b, c] = [knots[j], knots[j + 1], knots[j + 2]];
        t * t * (0.5 * a - b + 0.5 * c) + t * (b - a) + 0.5 * (a + b)
    };
    let y = match x {
        x if x <= x0 => y0,
        x if x < x1 => piece(low, x0, x1),
        x if x < x2 => piece(high, x1, x2),
        x => x * slope_high + y2 - slope_high * x2,
    };
    libm::exp10(y)
}

fn scene_curve(x: f64) -> f64 {
    const LOW: [f64; 6] = [-4.0, -4.0, -3.157_376_577_3, -0.485_249_995_8, 1.847_732_470_6, 1.847_732_470_6];
    const HIGH: [f64; 6] = [-0.718_548_242_5, 2.081_030_717_2, 3.668_124_123_7, 4.0, 4.0, 4.0];
    let points = [[0.18 * libm::exp2(-15.0), 0.0001], [0.18, 4.8], [0.18 * libm::exp2(18.0), 10_000.0]];
    spline(x, points, &LOW, &HIGH, 0.0)
}

fn output_curve(x: f64) -> f64 {
    const LOW: [f64; 10] = [
        -1.698_970_004_3,
        -1.698_970_004_3,
        -1.4779,
        -1.2291,
        -0.8648,
        -0.448,
        0.00518,
        0.451_108_033_4,
        0.911_374_441_4,
        0.911_374_441_4,
    ];
    const HIGH: [f64; 10] = [
        0.515_438_696_5,
        0.847_043_778_3,
        1.1358,
        1.3802,
        1.5197,
        1.5985,
        1.6467,
        1.674_609_135_7,
        1.687_873_339,
        1.687_873_339,
    ];
    let at = |stops: f64| scene_curve(0.18 * libm::exp2(stops));
    spline(x, [[at(-6.5), 0.02], [at(0.0), 4.8], [at(6.5), 48.0]], &LOW, &HIGH, 0.04)
}

fn map_channels(v: DVec3, f: fn(f64) -> f64) -> DVec3 {
    DVec3::new(f(v.x), f(v.y), f(v.z))
}

/// Interpolates from the gray of the same luminance to the color.
fn scale_saturation(v: DVec3, factor: f64) -> DVec3 {
    DVec3::splat(v.dot(LUMA)).lerp(v, factor)
}

/// Weight of the red modifier: a cubic B-spline of the distance of the hue from red, 135° wide.
fn red_modifier_weight(v: DVec3) -> f64 {
    let hue = libm::atan2(3f64.sqrt() * (v.y - v.z), 2.0 * v.x - v.y - v.z).to_degrees();
    // The knots are a fourth of the width apart; the weight is 1 in the middle.
    let t = (hue / (135.0 / 4.0)).abs();
    match t {
        t if t < 1.0 => 1.0 - 1.5 * t * t + 0.75 * t * t * t,
        t if t < 2.0 => 0.25 * (2.0 - t) * (2.0 - t) * (2.0 - t),
        _ => 0.0,
    }
}

/// ACES: linear sRGB of the scene to linear sRGB of the display, 0 to 1.
pub(super) fn aces(light: DVec3) -> DVec3 {
    let (ap0, ap1, srgb) = (to_xyz(AP0, D60), to_xyz(AP1, D60), to_xyz(SRGB, D65));
    let mut c = ap0.inverse() * chromatic_adaptation(D65, D60) * srgb * light;
    // The glow module lifts dark saturated colors a little.
    let (least, most) = (c.min_element(), c.max_element());
    let saturation = (most.max(1e-10) - least.max(1e-10)) / most.max(1e-2);
    let chroma = (c.z * (c.z - c.y) + c.y * (c.y - c.x) + c.x * (c.x - c.z)).max(0.0).sqrt();
    let yc = (c.x + c.y + c.z + 1.75 * chroma) / 3.0;
    let x = (saturation - 0.4) / 0.2;
    let t = (1.0 - (0.5 * x).abs()).max(0.0);
    let gain = 0.05 * 0.5 * (1.0 + x.signum() * (1.0 - t * t));
    const MID: f64 = 0.08;
    c *= 1.0
        + match yc {
            yc if yc <= 2.0 / 3.0 * MID => gain,
            yc if yc >= 2.0 * MID => 0.0,
            yc => gain * (MID / yc - 0.5),
        };
    c.x += red_modifier_weight(c) * saturation * (0.03 - c.x) * (1.0 - 0.82);
    let ap1_from_ap0 = ap1.inverse() * ap0;
    let c = (ap1_from_ap0 * c.max(DVec3::ZERO)).max(DVec3::ZERO);
    let c = map_channels(scale_saturation(c, 0.96), scene_curve);
    // The output transform is that of a cinema of 48 nits, where black is 0.02 nits.
    let c = (map_channels(c, output_curve) - 0.02) / (48.0 - 0.02);
    // The surround correction, by luminance, adapts from a dark room to a dim one.
    let xyz = ap1 * c;
    let dim = libm::pow(xyz.y.max(0.0), 0.9811) / xyz.y.max(1e-10);
    let c = scale_saturation(ap1.inverse() * (xyz * dim), 0.93);
    (srgb.inverse() * chromatic_adaptation(D60, D65) * ap1 * c).clamp(DVec3::ZERO, DVec3::ONE)
}

const INSET: DMat3 = rows([
    [0.842_479_062_253_094, 0.078_433_599_999_999_2, 0.079_223_745_147_764_3],
    [0.042_328_242_251_076, 0.878_468_636_469_772, 0.079_166_127_460_542_1],
    [0.042_375_654_905_709_9, 0.078_433_600_000_000_2, 0.879_142_973_793_104],
]);

/// Linear sRGB to the log encoding of AgX, 0 to 1 over 16.5 stops, of which 10 are below middle gray.
pub(crate) fn agx_stops(light: DVec3) -> DVec3 {
    let v = INSET * light;
    let stops = |v: f64| ((libm::log2(v.max(1e-10)) + 12.47393) / 16.5).clamp(0.0, 1.0);
    DVec3::new(stops(v.x), stops(v.y), stops(v.z))
}

pub(super) fn sigmoid(x: f64) -> f64 {
    const SLOPE: f64 = 2.0;
    let (at, value) = (10.0 / 16.5, 0.5);
    let (below, power) = if x >= at { (1.0, 3.25) } else { (-1.0, 3.0) };
    let (room, rise) = if x >= at { (1.0 - at, 1.0 - value) } else { (at, value) };
    let scale = libm::pow(
        libm::pow(SLOPE * room, -power) * (libm::pow(SLOPE * room / rise, power) - 1.0),
        -1.0 / power,
    ) * below;
    let term = SLOPE * (x - at) / scale;
    scale * term / libm::pow(1.0 + libm::pow(term, power), 1.0 / power) + value
}

/// Linear sRGB that a display of gamma 2.2 shows for the result of the AgX curve.
pub(crate) fn agx_shown(curve: DVec3) -> DVec3 {
    map_channels(INSET.inverse() * curve, |v| libm::pow(v.clamp(0.0, 1.0), 2.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ACES 1.0.3 puts middle gray at 4.8 of 48 nits, before the dim room: 0.10 of the screen.
    #[test]
    fn aces_maps_middle_gray_to_a_tenth() {
        let gray = aces(DVec3::splat(0.18));
        assert!((gray - libm::pow((4.8 - 0.02) / 47.98, 0.9811)).abs().max_element() < 1e-4, "{gray}");
        assert!(gray.max_element() - gray.min_element() < 1e-4, "{gray}");
        assert!((sigmoid(10.0 / 16.5) - 0.5).abs() < 1e-12);
        assert!(sigmoid(0.0).abs() < 1e-12 && (sigmoid(1.0) - 1.0).abs() < 1e-12);
    }

    /// The matrix that ACES publishes as AP0_2_AP1_MAT, to ten places.
    #[test]
    fn ap1_from_ap0_equals_the_published_matrix() {
        let m = to_xyz(AP1, D60).inverse() * to_xyz(AP0, D60);
        let published = rows([
            [1.4514393161, -0.2365107469, -0.2149285693],
            [-0.0765537734, 1.1762296998, -0.0996759264],
            [0.0083161484, -0.0060324498, 0.9977163014],
        ]);
        assert!(m.abs_diff_eq(published, 1e-8), "{m}");
    }

    #[test]
    fn curves_are_monotonic_without_jumps() {
        for curve in [scene_curve as fn(f64) -> f64, output_curve] {
            let mut before = curve(1e-4);
            for i in 1..4000 {
                let next = curve(1e-4 * libm::exp10(f64::from(i) * 0.002));
                assert!(next >= before && next < before * 1.05 + 1e-6, "{i}: {before} {next}");
                before = next;
            }
        }
    }
}
