//! Image expectations (`expect_image`): draws a stage at a time and compares it with the golden image beside the test.

use crate::golden_image::{self, GoldenImage, GoldenImageError, MAX_BYTES};
use crate::outcome::{Check, Evidence, Measures, Pictures, SourceLocation};
use crate::painter::{Device, DrawError, ImageRequest, Painter};
use choreo_files::write_whole_beneath;
use choreo_image_diff::{ImageDifference, difference_image, flip_heatmap};
use choreo_plugin::Frame;
use choreo_script::testing::ImageExpectation;
use choreo_stage::Stage;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Longer side in pixels of an image whose script gives no size.
const DEFAULT_LONGER_SIDE: u32 = 256;

/// Choice of the drawn images that become golden images.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Accept {
    #[default]
    None,
    All,
    /// Only images with these names are accepted, and only they are compared.
    Named(Vec<String>),
}

impl Accept {
    pub fn includes(&self, name: &str) -> bool {
        match self {
            Accept::None => false,
            Accept::All => true,
            Accept::Named(names) => names.iter().any(|n| n == name),
        }
    }
}

/// Options for comparing images.
#[derive(Clone, Debug, Default)]
pub struct ImageOptions {
    pub accept: Accept,
    /// Device to use instead of the one that the scripts name, if given.
    pub device: Option<Device>,
    /// Whether images accepted on another device are compared too.
    pub any_device: bool,
    /// Folder for images of failed tests, if any.
    pub failures: Option<PathBuf>,
}

/// Identifies the section that an image belongs to.
pub struct SectionRef<'a> {
    pub path: &'a Path,
    /// File and section, as the user names them.
    pub file: &'a str,
    pub section: &'a str,
    pub place: SourceLocation,
}

pub enum ImageOutcome {
    /// A check, with the content hash of the golden image if one was read.
    Check(Box<Check>, Option<[u8; 32]>),
    /// This machine cannot draw the image; contains the reason.
    Skipped(String),
}

/// Draws an image and compares it with the golden image. If it differs and is to be accepted, it replaces the golden image.
pub fn judge(
    wanted: &ImageExpectation,
    stage: &Arc<Stage>,
    section_ref: &SectionRef,
    painter: &mut Painter,
    options: &ImageOptions,
) -> ImageOutcome {
    let golden_path = golden_image::path_of(section_ref.path, &wanted.name);
    let mut check = Check {
        place: section_ref.place.clone(),
        title: format!("image \"{}\" at {} s", wanted.name, wanted.at.as_secs()),
        passed: false,
        expected: crate::collect::display_path(&golden_path),
        got: String::new(),
        by: String::new(),
        hint: String::new(),
        evidence: Evidence::None,
    };
    let request = match image_request(wanted, stage, options) {
        Ok(request) => request,
        Err(unknown) => {
            return ImageOutcome::Check(Box::new(Check { got: unknown.to_string(), ..check }), None);
        }
    };
    let (frame, device_class) = match painter.draw(stage, &request) {
        Ok(drawn) => drawn,
        Err(DrawError::NoDevice(why)) => return ImageOutcome::Skipped(why),
        Err(DrawError::Failed(why)) => {
            check.got = format!("no image: {why}");
            return ImageOutcome::Check(Box::new(check), None);
        }
    };
    check.got = format!("{}x{} drawn on {device_class}", frame.width, frame.height);
    let (verdict, read) = compare_with_golden_image(wanted, &frame, &device_class, &golden_path, options);
    if let Verdict::Matches(words) = verdict {
        (check.passed, check.by) = (true, words);
    } else {
        FailedComparison {
            wanted,
            section_ref,
            options,
            golden_path,
            frame: &frame,
            device_class: &device_class,
        }
        .accept_or_explain(verdict, &mut check);
    }
    ImageOutcome::Check(Box::new(check), read)
}

/// An image that differs from its golden image, or has none.
struct FailedComparison<'a> {
    wanted: &'a ImageExpectation,
    section_ref: &'a SectionRef<'a>,
    options: &'a ImageOptions,
    golden_path: PathBuf,
    frame: &'a Frame,
    device_class: &'a str,
}

impl FailedComparison<'_> {
    /// Accepts the image, or adds the difference to the check and writes the images to files.
    fn accept_or_explain(self, verdict: Verdict, check: &mut Check) {
        let (wanted, section_ref) = (self.wanted, self.section_ref);
        let name = match section_ref.section {
            "" => section_ref.file.to_string(),
            section => format!("{} > {section}", section_ref.file),
        };
        let bytes = match golden_image::encode_accepted(self.frame, self.device_class, &name) {
            Ok(bytes) => bytes,
            Err(text) => {
                check.got = format!("the image cannot be encoded as PNG: {text}");
                return;
            }
        };
        let size_error = (!wanted.large && bytes.len() > MAX_BYTES).then(|| too_large_message(bytes.len()));
        if self.options.accept.includes(&wanted.name) {
            let written = size_error.map_or_else(
                || golden_image::write(section_ref.path, &wanted.name, &bytes).map_err(|e| e.to_string()),
                Err,
            );
            check.passed = written.is_ok();
            check.by = if check.passed { ACCEPTED } else { "the image was not accepted" }.to_string();
            check.hint = written.err().unwrap_or_default();
            return;
        }
        let mut pictures = Pictures { name: wanted.name.clone(), got: bytes, ..Pictures::default() };
        self.describe(verdict, check, &mut pictures);
        pictures.stored = self.golden_path;
        size_error.into_iter().for_each(|text| add_hint(check, text));
        if let Some(folder) = &self.options.failures {
            write_images(folder, section_ref.file, &mut pictures, check);
        }
        check.evidence = Evidence::Pictures(Box::new(pictures));
    }

    /// Fills the texts of the check and the images for the reports.
    fn describe(&self, verdict: Verdict, check: &mut Check, pictures: &mut Pictures) {
        let shown = std::mem::take(&mut check.expected);
        (check.expected, check.by) = match verdict {
            Verdict::Matches(words) => (shown, words),
            Verdict::Missing => {
                (format!("{shown}, which does not exist yet"), "no image has been accepted".into())
            }
            Verdict::Damaged(why) => {
                check.hint = "restore it from version control, or accept the new image".into();
                (format!("{shown}, which cannot be read: {why}"), "the stored image is damaged".into())
            }
            Verdict::OtherDevice(device) => {
                let device = if device.is_empty() { "an unknown device".to_string() } else { device };
                check.hint = "to compare them anyway: --any-device".into();
                let by = "images of different devices are not compared";
                (format!("{shown}, accepted on {device}"), by.into())
            }
            Verdict::OtherSize((stored, bytes)) => {
                pictures.expected = bytes;
                let Frame { width, height, .. } = stored.frame;
                (format!("{shown}, {width}x{height} pixels"), "the sizes differ".into())
            }
            Verdict::Differs(found) => {
                let by = found.difference.describe();
                let expected = format!("{shown}: {}", found.difference.allowed(&self.wanted.limits));
                if let Ok(difference) = difference_image(&found.expected, self.frame) {
                    pictures.difference = golden_image::encode(&difference, &[]).unwrap_or_default();
                }
                pictures.expected = found.bytes;
                let heatmap = flip_heatmap(&found.difference.visible, found.difference.size);
                pictures.visible_difference = golden_image::encode(&heatmap, &[]).unwrap_or_default();
                pictures.measures = Some(Measures::of(&found.difference));
                (expected, by)
            }
        };
    }
}

fn too_large_message(bytes: usize) -> String {
    format!(
        "the image takes {:.1} KiB as PNG, more than the limit of {} KiB; make it smaller (size), or allow the size: \
         #{{ large: true }}",
        bytes as f64 / 1024.0,
        MAX_BYTES >> 10
    )
}

/// Text in `Check::by` for an image that has just been accepted.
pub(crate) const ACCEPTED: &str = "accepted now";

#[derive(Debug, thiserror::Error)]
#[error("unknown device \"{0}\"; the devices are \"cpu\" and \"vulkan\"")]
struct UnknownDevice(String);

fn image_request(
    wanted: &ImageExpectation,
    stage: &Stage,
    options: &ImageOptions,
) -> Result<ImageRequest, UnknownDevice> {
    let device = match (options.device, wanted.device.as_deref()) {
        (Some(device), _) => device,
        (None, None | Some("cpu")) => Device::Cpu,
        (None, Some("vulkan")) => Device::Vulkan,
        (None, Some(other)) => {
            return Err(UnknownDevice(other.to_string()));
        }
    };
    // A small image with the stage's aspect ratio.
    let [w, h] = stage.settings.size;
    let largest = w.max(h).max(1);
    let scaled = |v: u32| match largest > DEFAULT_LONGER_SIDE {
        true => ((u64::from(v) * u64::from(DEFAULT_LONGER_SIDE) / u64::from(largest)) as u32).max(1),
        false => v,
    };
    Ok(ImageRequest {
        at: wanted.at,
        size: wanted.size.unwrap_or([scaled(w), scaled(h)]),
        samples: wanted.samples.or(stage.settings.samples).unwrap_or(4),
        device,
    })
}

/// Result of comparing an image with its golden image.
enum Verdict {
    /// The images are equal within the tolerance; the text describes the difference.
    Matches(String),
    Missing,
    Damaged(String),
    OtherDevice(String),
    /// The golden image has another size; contains it and its file.
    OtherSize((GoldenImage, Vec<u8>)),
    Differs(Box<DifferentImage>),
}

struct DifferentImage {
    expected: Frame,
    bytes: Vec<u8>,
    difference: ImageDifference,
}

fn compare_with_golden_image(
    wanted: &ImageExpectation,
    frame: &Frame,
    device_class: &str,
    golden_path: &Path,
    options: &ImageOptions,
) -> (Verdict, Option<[u8; 32]>) {
    match golden_image::read(golden_path) {
        Ok((expected, bytes)) => {
            let hash = *blake3::hash(&bytes).as_bytes();
            (compare(wanted, frame, device_class, (expected, bytes), options), Some(hash))
        }
        Err(GoldenImageError::Missing) => (Verdict::Missing, None),
        Err(GoldenImageError::Damaged(why)) => (Verdict::Damaged(why), None),
    }
}

fn compare(
    wanted: &ImageExpectation,
    frame: &Frame,
    device_class: &str,
    (expected, bytes): (GoldenImage, Vec<u8>),
    options: &ImageOptions,
) -> Verdict {
    if expected.device != device_class && !options.any_device {
        return Verdict::OtherDevice(expected.device);
    }
    if expected.frame == *frame {
        return Verdict::Matches("equal, bit for bit".into());
    }
    let Ok(difference) = ImageDifference::new(&expected.frame, frame, wanted.tolerance) else {
        return Verdict::OtherSize((expected, bytes));
    };
    match difference.within(&wanted.limits) {
        true => Verdict::Matches(difference.describe()),
        false => Verdict::Differs(Box::new(DifferentImage { expected: expected.frame, bytes, difference })),
    }
}

fn add_hint(check: &mut Check, text: String) {
    check.hint = if check.hint.is_empty() { text } else { format!("{}; {text}", check.hint) };
}

/// Writes the expected image, the drawn image and the difference to files.
fn write_images(folder: &Path, file: &str, pictures: &mut Pictures, check: &mut Check) {
    for (kind, bytes) in
        [("expected", &pictures.expected), ("got", &pictures.got), ("difference", &pictures.difference)]
    {
        let name = Path::new(&path_as_folder_name(file)).join(format!("{}.{kind}.png", pictures.name));
        let path = folder.join(&name);
        if bytes.is_empty() {
            // A file of an earlier run does not belong to this failure.
            let _ = std::fs::remove_file(&path);
            pictures.written.push(PathBuf::new());
            continue;
        }
        match write_whole_beneath(folder, &name, bytes) {
            Ok(()) => pictures.written.push(path),
            Err(e) => {
                pictures.written.push(PathBuf::new());
                add_hint(check, format!("{}: cannot write: {e}", path.display()));
            }
        }
    }
}

/// Turns a path into a single folder name.
fn path_as_folder_name(file: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' };
    let name: String = file.trim_start_matches(['.', '/']).chars().map(plain).collect();
    name.strip_suffix(".rhai").unwrap_or(&name).to_string()
}
