//! Image expectations, with each kind of fault planted.

use choreo_image_diff::METRICS;
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::CpuRenderer;
use choreo_render::Renderer;
use choreo_script::testing::ImageExpectation;
use choreo_script::{ScriptOptions, run_text};
use choreo_stage::Stage;
use choreo_test_runner::golden_image::{self, GoldenImageError};
use choreo_test_runner::images::{Accept, ImageOptions, ImageOutcome, SectionRef, judge};
use choreo_test_runner::painter::{Device, Painter, device_class};
use choreo_test_runner::{Check, Evidence, Pictures, SourceLocation};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const SCRIPT: &str = r##"
    stage(#{ size: [1280, 720], length: 2.0 });
    cast("box", shape("box", #{ size: [1.0, 1.0, 1.0], color: "#c05040" })).at(0.0, 0.5, 0.0).turn(30.0);
    cast("ball", shape("sphere", #{ size: [0.8, 0.8, 0.8], color: "teal" })).key("position", [[0.0, [1.2, 0.4, 0.0]], [2.0, [1.2, 1.4, 0.0]]]);
    camera("c").at(1.0, 1.6, 4.0).look_at([0.4, 0.6, 0.0]);
    sun(#{ direction: [-1.0, -2.0, -1.0] });
"##;

struct ImageTest {
    folder: tempfile::TempDir,
    stage: Arc<Stage>,
    painter: Painter,
    wanted: ImageExpectation,
    options: ImageOptions,
}

/// The default limits, except for these metrics.
fn limits(changed: &[(&str, f64)]) -> [f64; METRICS.len()] {
    METRICS.map(|metric| {
        let limit = changed.iter().find(|(name, _)| *name == metric.name);
        limit.map_or(metric.limit, |(_, limit)| *limit)
    })
}

impl ImageTest {
    fn new() -> ImageTest {
        let folder = tempfile::tempdir().unwrap();
        let registry = Registry::default();
        let script = run_text("s.rhai", SCRIPT, folder.path(), &registry, &ScriptOptions::default()).unwrap();
        let wanted = ImageExpectation {
            at: Time::from_secs(0.5),
            size: Some([96, 54]),
            ..ImageExpectation::new("start")
        };
        let options = ImageOptions { failures: Some(folder.path().join("out")), ..ImageOptions::default() };
        let painter = Painter::new(registry.effects(), None);
        ImageTest { stage: Arc::new(script.stage), painter, wanted, options, folder }
    }

    fn golden_path(&self) -> PathBuf {
        golden_image::path_of(&self.folder.path().join("walk.rhai"), &self.wanted.name)
    }

    fn judge_image(&mut self) -> ImageOutcome {
        let path = self.folder.path().join("walk.rhai");
        let place = SourceLocation { file: "walk.rhai".into(), line: 7, column: 5 };
        let section_ref = SectionRef { path: &path, file: "tests/walk.rhai", section: "it goes", place };
        judge(&self.wanted, &self.stage, &section_ref, &mut self.painter, &self.options)
    }

    fn check(&mut self) -> Check {
        match self.judge_image() {
            ImageOutcome::Check(check, _) => *check,
            ImageOutcome::Skipped(reason) => panic!("skipped: {reason}"),
        }
    }

    fn accept(&mut self) -> Check {
        let accept = std::mem::replace(&mut self.options.accept, Accept::All);
        let check = self.check();
        self.options.accept = accept;
        check
    }

    /// Changes pixels of the golden image, but not its device.
    fn change_golden_image(&self, change: impl Fn(u32, u32, &mut [u8])) {
        let (stored, _) = golden_image::read(&self.golden_path()).unwrap();
        let mut frame = stored.frame;
        let width = frame.width;
        for (i, pixel) in frame.rgba.chunks_exact_mut(4).enumerate() {
            change(i as u32 % width, i as u32 / width, pixel);
        }
        let bytes = golden_image::encode_accepted(&frame, &stored.device, "t").unwrap();
        std::fs::write(self.golden_path(), &bytes).unwrap();
    }
}

fn pictures(check: &Check) -> &Pictures {
    match &check.evidence {
        Evidence::Pictures(p) => p,
        other => panic!("{other:?}"),
    }
}

fn read_frame(path: &Path) -> choreo_plugin::Frame {
    golden_image::read(path).unwrap().0.frame
}

#[test]
fn an_accepted_image_passes_bit_for_bit_and_records_its_device() {
    let mut test = ImageTest::new();
    let missing = test.check();
    assert!(!missing.passed);
    assert!(missing.expected.ends_with("pictures/walk/start.png, which does not exist yet"), "{missing:?}");
    assert_eq!((missing.by.as_str(), missing.hint.as_str()), ("no image has been accepted", ""));
    assert!(pictures(&missing).expected.is_empty() && !pictures(&missing).got.is_empty());
    let accepted = test.accept();
    assert_eq!((accepted.passed, accepted.by.as_str()), (true, "accepted now"));
    let (stored, bytes) = golden_image::read(&test.golden_path()).unwrap();
    assert_eq!((stored.device.as_str(), stored.frame.width, stored.frame.height), ("cpu", 96, 54));
    assert!(bytes.len() < golden_image::MAX_BYTES);
    let again = test.check();
    assert_eq!((again.passed, again.by.as_str()), (true, "equal, bit for bit"));
    // The image is accepted only under its own name.
    test.change_golden_image(|_, _, p| p[0] ^= 0x80);
    test.options.accept = Accept::Named(vec!["stars".into()]);
    assert!(!test.check().passed);
    test.options.accept = Accept::Named(vec!["start".into()]);
    assert!(test.check().passed);
    // Without a size in the script, the image has the aspect ratio of the stage.
    test.wanted.size = None;
    test.wanted.name = "whole".into();
    test.accept();
    let whole = read_frame(&test.golden_path());
    assert_eq!([whole.width, whole.height], [256, 144]);
}

#[test]
fn a_changed_block_of_pixels_fails_with_its_rectangle() {
    let mut test = ImageTest::new();
    test.accept();
    test.change_golden_image(|x, y, p| {
        if (40..44).contains(&x) && (20..23).contains(&y) {
            p.iter_mut().take(3).for_each(|v| *v ^= 0x40);
        }
    });
    let check = test.check();
    assert!(!check.passed);
    let p = pictures(&check);
    let m = p.measures.as_ref().unwrap();
    assert_eq!((m.region, m.worst), (Some([40, 20, 4, 3]), 64));
    assert!((m.share_beyond - 12.0 / (96.0 * 54.0)).abs() < 1e-12);
    assert!(m.visible_worst > 0.3, "{m:?}");
    assert!(check.by.starts_with("visible side by side, in a part of the image: "), "{}", check.by);
    assert!(
        check.by.contains(
            "12 of 5184 pixels (0.231 %: a spot or edges) more than 4 steps off within 4x3 at (40, 20)"
        ),
        "{}",
        check.by
    );
    // The three images are at the stated paths; the difference shows only the block.
    let [expected, got, difference] = p.written.as_slice() else { panic!("{:?}", p.written) };
    assert!(expected.ends_with("out/tests_walk/start.expected.png"), "{expected:?}");
    assert_ne!(read_frame(expected), read_frame(got));
    let shown = read_frame(difference);
    let white = shown.rgba.chunks_exact(4).filter(|c| c[..3] == [255; 3]).count();
    assert_eq!(white, 12);
}

#[test]
fn invisible_differences_pass_and_larger_limits_allow_visible_ones() {
    let mut test = ImageTest::new();
    test.accept();
    test.change_golden_image(|x, y, p| p[1] = p[1].saturating_add(((x + y) % 2) as u8));
    let check = test.check();
    assert!(check.passed, "{}", check.by);
    assert!(check.by.starts_with("not visible, even when the two images alternate: "), "{}", check.by);
    let default = std::mem::replace(&mut test.wanted.limits, limits(&[("visible", 0.0)]));
    assert!(!test.check().passed);
    test.wanted.limits = default;
    // An image that is 12 steps darker everywhere.
    test.accept();
    test.change_golden_image(|_, _, p| p.iter_mut().take(3).for_each(|v| *v = v.saturating_sub(12)));
    assert!(!test.check().passed);
    (test.wanted.tolerance, test.wanted.limits) = (16, limits(&[("visible", 0.6)]));
    assert!(test.check().passed);
    test.wanted.tolerance = 4;
    assert!(!test.check().passed);
    test.wanted.limits = limits(&[("visible", 0.6), ("share", 1.0)]);
    assert!(test.check().passed);
}

#[test]
fn an_image_at_another_time_fails_unless_barely_different() {
    let mut test = ImageTest::new();
    test.accept();
    test.wanted.at = Time::from_secs(0.6);
    let check = test.check();
    assert!(!check.passed && pictures(&check).measures.as_ref().unwrap().visible_worst > 0.3, "{}", check.by);
    // A difference that is barely visible, a fiftieth of a second and a hundredth of a metre, is within the tolerance.
    test.wanted.at = Time::from_secs(0.5002);
    assert!(test.check().passed);
}

#[test]
fn images_of_other_devices_are_compared_only_if_any_device_is_allowed() {
    let mut test = ImageTest::new();
    test.accept();
    let same = golden_image::read(&test.golden_path()).unwrap().0.frame;
    for (device, named) in [
        ("vulkan:llvmpipe (LLVM 14.0.0, 256 bits)/llvmpipe 22.1", "llvmpipe 22.1"),
        ("", "an unknown device"),
    ] {
        let bytes = golden_image::encode_accepted(&same, device, "t").unwrap();
        std::fs::write(test.golden_path(), &bytes).unwrap();
        let check = test.check();
        assert!(!check.passed && check.expected.contains(named), "{check:?}");
        assert!(check.hint.contains("--any-device"), "{check:?}");
        test.options.any_device = true;
        assert!(test.check().passed);
        test.options.any_device = false;
    }
    assert!(test.accept().passed);
    assert_eq!(golden_image::read(&test.golden_path()).unwrap().0.device, "cpu");
}

#[test]
fn damaged_differently_sized_and_too_large_images_fail_with_the_reason() {
    let mut test = ImageTest::new();
    test.accept();
    let bytes = std::fs::read(test.golden_path()).unwrap();
    std::fs::write(test.golden_path(), &bytes[..bytes.len() / 2]).unwrap();
    let check = test.check();
    assert!(!check.passed && check.by == "the stored image is damaged", "{check:?}");
    std::fs::write(test.golden_path(), b"not an image").unwrap();
    assert!(!test.check().passed);
    assert!(matches!(golden_image::read(&test.golden_path()), Err(GoldenImageError::Damaged(_))));
    // A damaged golden image can be replaced.
    assert!(test.accept().passed && test.check().passed);

    test.wanted.size = Some([64, 36]);
    let check = test.check();
    assert_eq!((check.passed, check.by.as_str()), (false, "the sizes differ"));
    assert!(check.expected.ends_with(", 96x54 pixels") && check.got.starts_with("64x36 "), "{check:?}");

    test.wanted.name = "heavy".into();
    test.wanted.size = Some([2048, 2048]);
    let check = test.accept();
    assert!(!check.passed && check.hint.contains("more than the limit of 40 KiB"), "{check:?}");
    assert_eq!(golden_image::read(&test.golden_path()), Err(GoldenImageError::Missing));
    test.wanted.large = true;
    assert!(test.accept().passed && test.check().passed);

    test.wanted.size = Some([100_000, 100_000]);
    let check = test.check();
    assert!(!check.passed && check.got.contains("a test image of 100000x100000 pixels"), "{check:?}");
    test.wanted.device = Some("gpu".into());
    assert!(test.check().got.starts_with("unknown device \"gpu\""));
}

#[test]
fn a_folder_that_cannot_be_written_fails_the_check_with_its_reason() {
    let mut test = ImageTest::new();
    std::fs::write(test.folder.path().join("pictures"), b"in the way").unwrap();
    std::fs::write(test.folder.path().join("out"), b"in the way").unwrap();
    let check = test.accept();
    assert!(!check.passed && check.hint.contains("cannot write"), "{check:?}");
}

#[test]
fn vulkan_images_record_device_and_driver() {
    let mut test = ImageTest::new();
    test.wanted.device = Some("vulkan".into());
    test.painter.validation = true;
    match test.judge_image() {
        ImageOutcome::Skipped(reason) => println!("SKIP 1: {reason}"),
        ImageOutcome::Check(..) => {
            assert!(test.accept().passed);
            let device = golden_image::read(&test.golden_path()).unwrap().0.device;
            assert!(device.starts_with("vulkan:") && device.contains('/'), "{device}");
            let check = test.check();
            assert_eq!((check.passed, check.by.as_str()), (true, "equal, bit for bit"));
            // The CPU renderer draws nearly the same image, but it is another device.
            test.options.device = Some(Device::Cpu);
            let check = test.check();
            assert!(!check.passed && check.expected.contains("accepted on vulkan:"), "{check:?}");
            test.options.any_device = true;
            test.wanted.limits = limits(&[("share", 0.01), ("visible", 0.5)]);
            let check = test.check();
            assert!(check.passed, "{check:?}");
        }
    }
    assert_eq!(device_class(CpuRenderer::new(&[]).device()), "cpu");
}
