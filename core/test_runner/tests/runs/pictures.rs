//! Image expectations, each kind of fault planted.

use choreo_image_diff::METRICS;
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::CpuRenderer;
use choreo_render::Renderer;
use choreo_script::testing::ImageExpectation;
use choreo_script::{ScriptOptions, run_text};
use choreo_stage::Stage;
use choreo_test_runner::images::{Accept, ImageOptions, Judged, SectionRef, judge};
use choreo_test_runner::painter::{Device, Painter, device_class};
use choreo_test_runner::stored::{self, Unreadable};
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

struct Bench {
    folder: tempfile::TempDir,
    stage: Arc<Stage>,
    painter: Painter,
    wanted: ImageExpectation,
    options: ImageOptions,
}

/// The default limits, but for these metrics.
fn limits(changed: &[(&str, f64)]) -> [f64; METRICS.len()] {
    METRICS.map(|metric| {
        let limit = changed.iter().find(|(name, _)| *name == metric.name);
        limit.map_or(metric.limit, |(_, limit)| *limit)
    })
}

impl Bench {
    fn new() -> Bench {
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
        Bench { stage: Arc::new(script.stage), painter, wanted, options, folder }
    }

    fn stored(&self) -> PathBuf {
        stored::place(&self.folder.path().join("walk.rhai"), &self.wanted.name)
    }

    fn judged(&mut self) -> Judged {
        let path = self.folder.path().join("walk.rhai");
        let place = SourceLocation { file: "walk.rhai".into(), line: 7, column: 5 };
        let section_ref = SectionRef { path: &path, file: "tests/walk.rhai", section: "it goes", place };
        judge(&self.wanted, &self.stage, &section_ref, &mut self.painter, &self.options)
    }

    fn check(&mut self) -> Check {
        match self.judged() {
            Judged::Check(check, _) => *check,
            Judged::Skipped(reason) => panic!("skipped: {reason}"),
        }
    }

    fn accept(&mut self) -> Check {
        let accept = std::mem::replace(&mut self.options.accept, Accept::All);
        let check = self.check();
        self.options.accept = accept;
        check
    }

    /// Changes the stored image's pixels; its device stays.
    fn plant(&self, change: impl Fn(u32, u32, &mut [u8])) {
        let (stored, _) = stored::read(&self.stored()).unwrap();
        let mut frame = stored.frame;
        let width = frame.width;
        for (i, pixel) in frame.rgba.chunks_exact_mut(4).enumerate() {
            change(i as u32 % width, i as u32 / width, pixel);
        }
        let bytes = stored::encode_accepted(&frame, &stored.device, "t").unwrap();
        std::fs::write(self.stored(), &bytes).unwrap();
    }
}

fn pictures(check: &Check) -> &Pictures {
    match &check.evidence {
        Evidence::Pictures(p) => p,
        other => panic!("{other:?}"),
    }
}

fn open(path: &Path) -> choreo_plugin::Frame {
    stored::read(path).unwrap().0.frame
}

#[test]
fn an_accepted_picture_passes_bit_for_bit_and_says_where_it_is_from() {
    let mut bench = Bench::new();
    let missing = bench.check();
    assert!(!missing.passed);
    assert!(missing.expected.ends_with("pictures/walk/start.png, which does not exist yet"), "{missing:?}");
    assert_eq!((missing.by.as_str(), missing.hint.as_str()), ("no image has been accepted", ""));
    assert!(pictures(&missing).expected.is_empty() && !pictures(&missing).got.is_empty());
    let accepted = bench.accept();
    assert_eq!((accepted.passed, accepted.by.as_str()), (true, "accepted now"));
    let (stored, bytes) = stored::read(&bench.stored()).unwrap();
    assert_eq!((stored.device.as_str(), stored.frame.width, stored.frame.height), ("cpu", 96, 54));
    assert!(bytes.len() < stored::MOST_BYTES);
    let again = bench.check();
    assert_eq!((again.passed, again.by.as_str()), (true, "equal, bit for bit"));
    // Taken over only by its own name.
    bench.plant(|_, _, p| p[0] ^= 0x80);
    bench.options.accept = Accept::Named(vec!["stars".into()]);
    assert!(!bench.check().passed);
    bench.options.accept = Accept::Named(vec!["start".into()]);
    assert!(bench.check().passed);
    // Shaped as the stage where the script gives no size.
    bench.wanted.size = None;
    bench.wanted.name = "whole".into();
    bench.accept();
    let whole = open(&bench.stored());
    assert_eq!([whole.width, whole.height], [256, 144]);
}

#[test]
fn a_planted_block_of_pixels_is_found_where_it_is() {
    let mut bench = Bench::new();
    bench.accept();
    bench.plant(|x, y, p| {
        if (40..44).contains(&x) && (20..23).contains(&y) {
            p.iter_mut().take(3).for_each(|v| *v ^= 0x40);
        }
    });
    let check = bench.check();
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
    // The three images lie where it states; the difference shows the block and nothing else.
    let [expected, got, difference] = p.written.as_slice() else { panic!("{:?}", p.written) };
    assert!(expected.ends_with("out/tests_walk/start.expected.png"), "{expected:?}");
    assert_ne!(open(expected), open(got));
    let shown = open(difference);
    let lit = shown.rgba.chunks_exact(4).filter(|c| c[..3] == [255; 3]).count();
    assert_eq!(lit, 12);
}

#[test]
fn what_nobody_sees_passes_and_what_is_allowed_can_be_said() {
    let mut bench = Bench::new();
    bench.accept();
    bench.plant(|x, y, p| p[1] = p[1].saturating_add(((x + y) % 2) as u8));
    let check = bench.check();
    assert!(check.passed, "{}", check.by);
    assert!(check.by.starts_with("not visible, even when the two images alternate: "), "{}", check.by);
    let default = std::mem::replace(&mut bench.wanted.limits, limits(&[("visible", 0.0)]));
    assert!(!bench.check().passed);
    bench.wanted.limits = default;
    // A darker image: 8 steps everywhere.
    bench.accept();
    bench.plant(|_, _, p| p.iter_mut().take(3).for_each(|v| *v = v.saturating_sub(12)));
    assert!(!bench.check().passed);
    (bench.wanted.tolerance, bench.wanted.limits) = (16, limits(&[("visible", 0.6)]));
    assert!(bench.check().passed);
    bench.wanted.tolerance = 4;
    assert!(!bench.check().passed);
    bench.wanted.limits = limits(&[("visible", 0.6), ("share", 1.0)]);
    assert!(bench.check().passed);
}

#[test]
fn a_moved_thing_is_another_picture() {
    let mut bench = Bench::new();
    bench.accept();
    bench.wanted.at = Time::from_secs(0.6);
    let check = bench.check();
    assert!(!check.passed && pictures(&check).measures.as_ref().unwrap().visible_worst > 0.3, "{}", check.by);
    // A difference that is barely visible, a fiftieth of a second and a hundredth of a metre, is within the tolerance.
    bench.wanted.at = Time::from_secs(0.5002);
    assert!(bench.check().passed);
}

#[test]
fn pictures_of_other_devices_are_refused_unless_told() {
    let mut bench = Bench::new();
    bench.accept();
    let same = stored::read(&bench.stored()).unwrap().0.frame;
    for (device, named) in [
        ("vulkan:llvmpipe (LLVM 14.0.0, 256 bits)/llvmpipe 22.1", "llvmpipe 22.1"),
        ("", "an unknown device"),
    ] {
        let bytes = stored::encode_accepted(&same, device, "t").unwrap();
        std::fs::write(bench.stored(), &bytes).unwrap();
        let check = bench.check();
        assert!(!check.passed && check.expected.contains(named), "{check:?}");
        assert!(check.hint.contains("--any-device"), "{check:?}");
        bench.options.any_device = true;
        assert!(bench.check().passed);
        bench.options.any_device = false;
    }
    assert!(bench.accept().passed);
    assert_eq!(stored::read(&bench.stored()).unwrap().0.device, "cpu");
}

#[test]
fn damaged_wrong_and_heavy_pictures_are_told() {
    let mut bench = Bench::new();
    bench.accept();
    let bytes = std::fs::read(bench.stored()).unwrap();
    std::fs::write(bench.stored(), &bytes[..bytes.len() / 2]).unwrap();
    let check = bench.check();
    assert!(!check.passed && check.by == "the stored image is damaged", "{check:?}");
    std::fs::write(bench.stored(), b"not an image").unwrap();
    assert!(!bench.check().passed);
    assert!(matches!(stored::read(&bench.stored()), Err(Unreadable::Damaged(_))));
    // A damaged one can be replaced.
    assert!(bench.accept().passed && bench.check().passed);

    bench.wanted.size = Some([64, 36]);
    let check = bench.check();
    assert_eq!((check.passed, check.by.as_str()), (false, "the sizes differ"));
    assert!(check.expected.ends_with(", 96x54 pixels") && check.got.starts_with("64x36 "), "{check:?}");

    bench.wanted.name = "heavy".into();
    bench.wanted.size = Some([2048, 2048]);
    let check = bench.accept();
    assert!(!check.passed && check.hint.contains("at most 40 are kept"), "{check:?}");
    assert_eq!(stored::read(&bench.stored()), Err(Unreadable::Missing));
    bench.wanted.large = true;
    assert!(bench.accept().passed && bench.check().passed);

    bench.wanted.size = Some([100_000, 100_000]);
    let check = bench.check();
    assert!(!check.passed && check.got.contains("a test image of 100000x100000 pixels"), "{check:?}");
    bench.wanted.device = Some("gpu".into());
    assert!(bench.check().got.starts_with("unknown device \"gpu\""));
}

#[test]
fn a_folder_that_cannot_be_written_fails_the_check_with_its_reason() {
    let mut bench = Bench::new();
    std::fs::write(bench.folder.path().join("pictures"), b"in the way").unwrap();
    std::fs::write(bench.folder.path().join("out"), b"in the way").unwrap();
    let check = bench.accept();
    assert!(!check.passed && check.hint.contains("cannot write"), "{check:?}");
}

#[test]
fn vulkan_pictures_carry_device_and_driver() {
    let mut bench = Bench::new();
    bench.wanted.device = Some("vulkan".into());
    bench.painter.validation = true;
    match bench.judged() {
        Judged::Skipped(reason) => println!("SKIP 1: {reason}"),
        Judged::Check(..) => {
            assert!(bench.accept().passed);
            let device = stored::read(&bench.stored()).unwrap().0.device;
            assert!(device.starts_with("vulkan:") && device.contains('/'), "{device}");
            let check = bench.check();
            assert_eq!((check.passed, check.by.as_str()), (true, "equal, bit for bit"));
            // The CPU renderer's image of the same scene is close, but of another device.
            bench.options.device = Some(Device::Cpu);
            let check = bench.check();
            assert!(!check.passed && check.expected.contains("accepted on vulkan:"), "{check:?}");
            bench.options.any_device = true;
            bench.wanted.limits = limits(&[("share", 0.01), ("visible", 0.5)]);
            let check = bench.check();
            assert!(check.passed, "{check:?}");
        }
    }
    assert_eq!(device_class(CpuRenderer::new(&[]).device()), "cpu");
}
