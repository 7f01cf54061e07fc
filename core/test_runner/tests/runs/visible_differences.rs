//! Visible difference of simple faults: the table in the README, and the limits of its descriptions.

use choreo_image_diff::compare;
use choreo_image_diff::flip;
use choreo_plugin::Frame;
use choreo_test_runner::golden_image;
use std::path::Path;

fn dance_image(number: u32) -> Frame {
    let path = format!("../../tests/pictures/first_dance_{number}.png");
    golden_image::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap().0.frame
}

/// Pixel of a face in the third image.
const FACE: [u32; 2] = [200, 68];

fn changed_dance_image(change: impl Fn(u32, u32, &mut [u8])) -> Frame {
    let mut frame = dance_image(3);
    let width = frame.width;
    for (i, pixel) in frame.rgba.chunks_exact_mut(4).enumerate() {
        change(i as u32 % width, i as u32 / width, &mut pixel[..3]);
    }
    frame
}

fn brighten(pixel: &mut [u8], by: u8) {
    pixel.iter_mut().for_each(|v| *v = v.saturating_add(by));
}

/// The third image with a brighter square at the face.
fn with_brighter_square(size: u32, by: u8) -> Frame {
    changed_dance_image(|x, y, p| {
        if (FACE[0]..FACE[0] + size).contains(&x) && (FACE[1]..FACE[1] + size).contains(&y) {
            brighten(p, by);
        }
    })
}

fn shifted_right_by_one_pixel() -> Frame {
    let mut frame = dance_image(3);
    let row = frame.width as usize * 4;
    frame.rgba.chunks_exact_mut(row).for_each(|r| r.copy_within(0..row - 4, 4));
    frame
}

#[test]
fn descriptions_of_planted_faults_match_their_visibility() {
    let faults: Vec<(&str, Frame, &str)> = vec![
        (
            "every second pixel one step brighter",
            changed_dance_image(|x, y, p| brighten(p, ((x + y) % 2) as u8)),
            "not visible, even",
        ),
        ("all one step brighter", changed_dance_image(|_, _, p| brighten(p, 1)), "not visible"),
        (
            "all 4 steps brighter",
            changed_dance_image(|_, _, p| brighten(p, 4)),
            "visible when the two images alternate",
        ),
        ("all 16 steps brighter", changed_dance_image(|_, _, p| brighten(p, 16)), "visible at first sight"),
        ("one pixel 8 steps brighter", with_brighter_square(1, 8), "not visible, even"),
        ("one pixel 64 steps brighter", with_brighter_square(1, 64), "visible"),
        ("4×4 pixels 4 steps brighter", with_brighter_square(4, 4), "not visible side by side"),
        ("4×4 pixels 64 steps brighter", with_brighter_square(4, 64), "visible side by side"),
        ("all one pixel to the right", shifted_right_by_one_pixel(), "visible"),
        ("another moment of the scene", dance_image(4), "different images"),
    ];
    let mut mismatches = Vec::new();
    println!("| fault | largest | mean | words | pixels > 4 steps |\n|---|---|---|---|---|");
    for (name, frame, words) in faults {
        let v = flip(&dance_image(3), &frame).unwrap();
        let beyond = compare(&dance_image(3), &frame, 4).unwrap().share_beyond;
        println!(
            "| {name} | {:.3} | {:.4} | {} | {:.3} % |",
            v.worst,
            v.mean,
            v.description(),
            beyond * 100.0
        );
        if !v.description().starts_with(words) {
            mismatches.push(format!("{name}: {}, {:.3}, {:.4}", v.description(), v.worst, v.mean));
        }
    }
    assert!(mismatches.is_empty(), "{mismatches:#?}");
}
