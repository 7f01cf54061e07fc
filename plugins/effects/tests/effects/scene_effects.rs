//! The built-in effects that read the scene, evaluated on the CPU against closed forms and integrals in f64.

use choreo_plugin::{BACKGROUND_DISTANCE, Effect, EffectFrame, EffectImage, SceneImages};
use glam::{DVec3, Mat4, Vec3, Vec4};

const SIZE: [u32; 2] = [96, 64];
const MIDDLE: usize = 32 * 96 + 48;

/// Input of an effect: an image, and the scene that it shows.
struct Given {
    image: Vec<Vec4>,
    /// Normal and depth.
    surface: Vec<Vec4>,
    frame: EffectFrame,
}

impl Given {
    /// One color everywhere, and a wall across the view at a depth.
    fn wall(color: Vec4, depth: f32, frame: EffectFrame) -> Given {
        let count = (SIZE[0] * SIZE[1]) as usize;
        Given { image: vec![color; count], surface: vec![Vec3::Z.extend(depth); count], frame }
    }

    fn run(&self, name: &str, parameters: &[(&str, f32)]) -> Vec<Vec4> {
        let effect: Effect = effects::named(&[name]).remove(0);
        let given: Vec<(String, f64)> =
            parameters.iter().map(|(name, value)| (name.to_string(), f64::from(*value))).collect();
        let p = effect.manifest().parameters(&given);
        let rows = self.frame.rows();
        let surface = Some(EffectImage { size: SIZE, rgba: &self.surface });
        let scene = Some(SceneImages { surface, motion: None, rows: &rows });
        effect.over_image(EffectImage { size: SIZE, rgba: &self.image }, scene, &p)
    }
}

/// Parallel rays along −z, `metres` from the top of the image to its bottom.
fn parallel(metres: f32) -> EffectFrame {
    let aspect = SIZE[0] as f32 / SIZE[1] as f32;
    let scale = Vec3::new(2.0 / (metres * aspect), -2.0 / metres, 0.01);
    EffectFrame {
        clip_from_view: Mat4::from_scale(scale),
        view_from_world: Mat4::IDENTITY,
        ..EffectFrame::default()
    }
}

/// A lens with a vertical field of view.
fn perspective(yfov: f32) -> EffectFrame {
    let f = 1.0 / libm::tanf(0.5 * yfov);
    let aspect = SIZE[0] as f32 / SIZE[1] as f32;
    let columns = [
        Vec4::new(f / aspect, 0.0, 0.0, 0.0),
        Vec4::new(0.0, -f, 0.0, 0.0),
        Vec4::new(0.0, 0.0, 0.0, -1.0),
        Vec4::new(0.0, 0.0, 0.1, 0.0),
    ];
    let clip_from_view = Mat4::from_cols(columns[0], columns[1], columns[2], columns[3]);
    EffectFrame { clip_from_view, view_from_world: Mat4::IDENTITY, ..EffectFrame::default() }
}

const GRAY: Vec4 = Vec4::new(0.25, 0.25, 0.25, 1.0);

#[test]
fn a_flat_wall_is_not_occluded() {
    let out = Given::wall(GRAY, 10.0, parallel(2.0)).run("ambient_occlusion", &[]);
    assert!(out.iter().all(|color| (*color - GRAY).abs().max_element() < 1e-6));
}

/// A valley of two planes at right angles, along the image's middle column.
fn valley() -> Given {
    let mut given = Given::wall(GRAY, 10.0, parallel(2.0));
    let metres = 2.0 / SIZE[1] as f32;
    for (i, texel) in given.surface.iter_mut().enumerate() {
        let x = ((i as u32 % SIZE[0]) as f32 + 0.5 - 48.0) * metres;
        *texel = Vec3::new(-x.signum(), 0.0, 1.0).normalize().extend(10.0 - x.abs());
    }
    given
}

/// The mean of the paper's estimator over the disk of samples, in f64: McGuire et al. 2012, §2.3.
fn obscured(x: f64, radius: f64, bias: f64) -> f64 {
    let place = |x: f64, y: f64| DVec3::new(x, y, x.abs() - 10.0);
    let (c, n) = (place(x, 0.0), DVec3::new(-x.signum(), 0.0, 1.0).normalize());
    let (steps, mut sum) = (400, 0.0);
    for i in 0..steps {
        for k in 0..steps {
            let rho = (f64::from(i) + 0.5) / f64::from(steps) * radius;
            let angle = (f64::from(k) + 0.5) / f64::from(steps) * std::f64::consts::TAU;
            let v = place(x + rho * angle.cos(), rho * angle.sin()) - c;
            let vv = v.length_squared();
            let near = (radius * radius - vv).max(0.0).powi(3);
            sum += near * ((v.dot(n) - bias) / (vv + 0.01 * radius * radius)).max(0.0);
        }
    }
    5.0 * radius / radius.powi(6) * sum / f64::from(steps * steps)
}

#[test]
fn occlusion_in_a_valley_equals_the_integral() {
    let run = |strength: f32| {
        let options = [("radius", 0.4), ("samples", 64.0), ("strength", strength)];
        valley().run("ambient_occlusion", &options)
    };
    let metres = 2.0 / f64::from(SIZE[1]);
    let place = |x: i32| (f64::from(x) + 0.5 - 48.0) * metres;
    // The blur across stays on pixels of about the same depth.
    let expected = |x: i32, strength: f64| {
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in -4..=4 {
            let same = (1.0 - (place(x + i).abs() - place(x).abs()).abs() / (0.25 * 0.4)).max(0.0);
            let weight = (-0.08 * f64::from(i * i)).exp() * same;
            sum += weight * (1.0 - strength * obscured(place(x + i), 0.4, 0.02)).max(0.0);
            weights += weight;
        }
        sum / weights
    };
    let column = |out: &[Vec4], x: i32| {
        let rows = 12..52;
        rows.map(|y| f64::from(out[y * 96 + x as usize].x) / 0.25).sum::<f64>() / 40.0
    };
    // 64 samples, and pixels 3 cm wide.
    let near = |is: f64, should: f64| (is - should).abs() < 0.08 * (1.0 - should) + 0.004;
    let out = run(0.5);
    for x in [48, 50, 52, 54, 56, 60] {
        let (is, should) = (column(&out, x), expected(x, 0.5));
        println!("column {x}: {is:.4}, the integral gives {should:.4}");
        assert!(near(is, should), "column {x}: {is} instead of {should}");
    }
    assert!((out[32 * 96 + 80].x - 0.25).abs() < 1e-6, "a plane far from the crease");
    // A fifth more of it is seen to be too much.
    assert!(!near(column(&run(0.6), 50), expected(50, 0.5)));
}

#[test]
fn depth_of_field_keeps_focus_sharp_and_blurs_a_point_to_the_disk_of_a_thin_lens() {
    let (yfov, depth, focus, n) = (0.6f32, 8.0f32, 2.0f32, 0.7f32);
    let mut given = Given::wall(Vec4::W, depth, perspective(yfov));
    given.image[MIDDLE] = Vec4::new(1.0, 1.0, 1.0, 1.0);
    let options = [("f_number", n), ("sensor", 100.0), ("samples", 256.0), ("limit", 0.2)];
    let with = |focus: f32| given.run("depth_of_field", &[&options[..], &[("focus", focus)]].concat());
    let sharp = with(depth);
    assert!((sharp[MIDDLE].x - 1.0).abs() < 1e-3 && sharp[MIDDLE + 2].x < 1e-3);
    // f²/(N (s − f)) · |z − s| / z, with f = h / (2 tan(fov / 2)), on a sensor 100 mm high.
    let sensor = 0.1f64;
    let f = 0.5 * sensor / libm::tan(0.5 * f64::from(yfov));
    let (z, s) = (f64::from(depth), f64::from(focus));
    let diameter = f * f / (f64::from(n) * (s - f)) * (z - s).abs() / z;
    let radius = 0.5 * diameter / sensor * f64::from(SIZE[1]);
    let blurred = with(focus);
    // All pixels gather noisily: the mean of many.
    let (mut inside, mut outside, mut count) = (0.0, 0.0f64, 0.0);
    for (i, color) in blurred.iter().enumerate() {
        let off = ((i % 96) as f64 - 48.0).hypot((i / 96) as f64 - 32.0);
        if off < radius - 1.0 {
            inside += f64::from(color.x);
            count += 1.0;
        } else if off > radius + 1.5 {
            outside = outside.max(f64::from(color.x));
        }
    }
    let expected = 1.0 / (std::f64::consts::PI * radius * radius);
    println!("radius {radius:.2} pixels; inside {:.5}, a disk's {expected:.5}", inside / count);
    assert!((3.0..12.0).contains(&radius), "{radius}");
    assert_eq!(outside, 0.0, "beyond the disk");
    assert!((inside / count / expected - 1.0).abs() < 0.08, "{} instead of {expected}", inside / count);
    // Without a perspective nothing is blurred.
    given.frame = parallel(2.0);
    assert_eq!(given.run("depth_of_field", &[("focus", focus)])[MIDDLE].x, 1.0);
}

#[test]
fn grain_has_its_strength_no_bias_and_differs_between_frames() {
    let frame = |frame: u32| EffectFrame { frame, ..EffectFrame::default() };
    let run = |number: u32, size: f32| {
        let given = Given::wall(GRAY, 1.0, frame(number));
        given.run("film_grain", &[("strength", 0.1), ("size", size)])
    };
    for size in [1.0, 2.5] {
        let out = run(7, size);
        // At perceptual middle gray, the standard deviation is the strength.
        let off: Vec<f64> = out.iter().map(|c| f64::from(c.x).sqrt() - 0.5).collect();
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        let deviation = (off.iter().map(|o| o * o).sum::<f64>() / off.len() as f64).sqrt();
        println!("grains of {size}: mean {mean:.4}, deviation {deviation:.4}");
        assert!(mean.abs() < 0.008 && (deviation - 0.1).abs() < 0.008, "{mean} {deviation}");
        assert_eq!(out, run(7, size));
        assert_ne!(out, run(8, size));
    }
    // Film is clear or dense all over.
    for color in [Vec4::W, Vec4::ONE] {
        let given = Given::wall(color, 1.0, frame(3));
        assert_eq!(given.run("film_grain", &[("strength", 0.5)]), given.image);
    }
}

#[test]
fn light_shafts_are_the_sum_of_the_sky_towards_the_sun() {
    let mut frame = perspective(0.6);
    // Straight ahead.
    frame.sun = Some(Vec3::NEG_Z);
    let mut given = Given::wall(GRAY, BACKGROUND_DISTANCE, frame);
    given.surface.fill(SceneImages::NO_SURFACE);
    let p = [("strength", 0.8), ("decay", 2.0), ("samples", 256.0), ("radius", 10.0)];
    // At the sun: ∫₀¹ e^(−2 s) ds of the sky's light.
    let expected = 0.25 * (1.0 + 0.8 * (1.0 - (-2.0f64).exp()) / 2.0);
    let out = given.run("god_rays", &p)[MIDDLE].x;
    assert!((f64::from(out) / expected - 1.0).abs() < 0.01, "{out} instead of {expected}");
    // An occluder at half of the distance hides the half beyond it, here the sun's side.
    let blocked = |given: &mut Given, from: usize| {
        for (i, texel) in given.surface.iter_mut().enumerate().filter(|(i, _)| i % 96 >= from) {
            *texel = Vec3::Z.extend(if i % 96 >= from { 3.0 } else { 1e9 });
        }
    };
    blocked(&mut given, 30);
    let out = given.run("god_rays", &[&p[..], &[("reach", 1.0)]].concat());
    // From column 10 to the sun at 48: 20 of 38 columns show sky.
    let way = 38.0f64;
    let expected = 0.25 * (1.0 + 0.8 * (1.0 - (-2.0 * 19.5 / way).exp()) / 2.0);
    let is = f64::from(out[32 * 96 + 10].x);
    assert!((is / expected - 1.0).abs() < 0.02, "{is} instead of {expected}");
    assert_eq!(given.run("god_rays", &p)[32 * 96 + 60], GRAY, "the whole path to the sun is blocked");
    given.frame.sun = None;
    assert_eq!(given.run("god_rays", &p), given.image);
    given.frame.sun = Some(Vec3::Z);
    assert_eq!(given.run("god_rays", &p), given.image, "behind the camera");
}

#[test]
fn edges_lie_at_steps_and_creases_and_nowhere_else() {
    let mut given = Given::wall(GRAY, 10.0, parallel(2.0));
    let lines = |given: &Given, p: &[(&str, f32)]| {
        let out = given.run("edge_lines", p);
        (0..96).filter(|x| out[32 * 96 + x].x < 0.05).collect::<Vec<usize>>()
    };
    assert!(lines(&given, &[]).is_empty());
    // A step of 3 % of the distance between columns 47 and 48.
    for (_, texel) in given.surface.iter_mut().enumerate().filter(|(i, _)| i % 96 >= 48) {
        texel.w = 9.7;
    }
    assert_eq!(lines(&given, &[]), [47]);
    assert_eq!(lines(&given, &[("width", 3.0)]), [46, 47, 48]);
    assert!(lines(&given, &[("depth", 0.05)]).is_empty());
    assert!(lines(&given, &[("far", 5.0)]).is_empty());
    // Two planes at right angles meet between columns 47 and 48; a plane at 45° alone has no line.
    assert_eq!(lines(&valley(), &[("depth", 1.0)]), [47]);
    assert!(lines(&valley(), &[("depth", 1.0), ("angle", 100.0)]).is_empty());
    // Against the sky.
    given.surface.fill(Vec3::Z.extend(10.0));
    for (_, texel) in given.surface.iter_mut().enumerate().filter(|(i, _)| i % 96 >= 48) {
        *texel = SceneImages::NO_SURFACE;
    }
    assert_eq!(lines(&given, &[]), [47]);
}

#[test]
fn heat_haze_shifts_distant_surfaces_by_at_most_its_strength() {
    let at = |time: f32, depth: f32| {
        let mut given = Given::wall(GRAY, depth, EffectFrame { time, ..EffectFrame::default() });
        // Each pixel's place as its color.
        for (i, pixel) in given.image.iter_mut().enumerate() {
            *pixel = Vec4::new((i % 96) as f32, (i / 96) as f32, 0.0, 1.0);
        }
        given
    };
    let p = [("strength", 0.05), ("scale", 0.2)];
    let near = at(0.5, 2.9);
    assert_eq!(near.run("heat_haze", &p), near.image);
    let far = at(0.5, 100.0);
    let out = far.run("heat_haze", &p);
    let bend: Vec<f32> = out
        .iter()
        .zip(&far.image)
        .filter(|(_, at)| (8.0..88.0).contains(&at.x) && (8.0..56.0).contains(&at.y))
        .map(|(out, at)| (*out - *at).truncate().length())
        .collect();
    let most = bend.iter().fold(0.0f32, |most, b| most.max(*b));
    // 5 % of 64 pixels are 3.2; the noise stays below √2 · 1.4 · 0.9 of it.
    println!("bent by up to {most:.2} pixels");
    assert!((1.0..3.2 * 1.8).contains(&most), "{most}");
    assert_eq!(out, at(0.5, 100.0).run("heat_haze", &p));
    assert_ne!(out, at(0.6, 100.0).run("heat_haze", &p));
    // A nearer surface is not bent into the far view.
    let mut split = at(0.5, 100.0);
    for (_, texel) in split.surface.iter_mut().enumerate().filter(|(i, _)| i % 96 >= 48) {
        texel.w = 1.0;
    }
    let out = split.run("heat_haze", &p);
    assert!((0..48).all(|x| out[32 * 96 + x].x < 48.0));
}
