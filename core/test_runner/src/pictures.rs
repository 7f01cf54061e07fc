//! `expect_picture`: a stage drawn at a time, against the picture stored beside its test.

use crate::outcome::{Check, Evidence, Measures, Pictures, Place};
use crate::painter::{Device, NoPicture, Painter, Shot};
use crate::stored::{self, MOST_BYTES, Stored, Unreadable};
use choreo_files::write_whole_beneath;
use choreo_image_diff::{compare, difference_image};
use choreo_image_diff::{flip, flip_heatmap};
use choreo_plugin::Frame;
use choreo_script::testing::PictureExpectation;
use choreo_stage::Stage;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What passes where the script says nothing: what nobody sees side by side, and hardly anybody when the pictures alternate.
pub const TOLERANCE: u8 = 4;
pub const SHARE: f64 = 0.001;
pub const VISIBLE: f64 = choreo_image_diff::ALTERNATING;
/// Pixels of a picture whose script gives no size.
const LARGEST_SIDE: u32 = 256;

/// Which pictures are taken over as the expected ones.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Accept {
    #[default]
    None,
    All,
    /// Only images of these names.
    Named(Vec<String>),
}

impl Accept {
    pub fn takes(&self, name: &str) -> bool {
        match self {
            Accept::None => false,
            Accept::All => true,
            Accept::Named(names) => names.iter().any(|n| n == name),
        }
    }
}

/// How pictures are compared in this run.
#[derive(Clone, Debug, Default)]
pub struct PictureOptions {
    pub accept: Accept,
    /// Instead of what the scripts say.
    pub device: Option<Device>,
    /// Pictures accepted on another device count too.
    pub any_device: bool,
    /// Folder for images of failures, if any.
    pub failures: Option<PathBuf>,
}

/// Whose picture it is.
pub struct Whose<'a> {
    pub path: &'a Path,
    /// File and section as the user names them.
    pub file: &'a str,
    pub section: &'a str,
    pub place: Place,
}

pub enum Judged {
    /// A check, with the content hash of the golden image if one was read.
    Check(Box<Check>, Option<[u8; 32]>),
    /// This machine cannot draw it: the reason.
    Skipped(String),
}

/// Draws one image and compares it with the golden image, which is replaced if it is to be accepted and differs.
pub fn judge(
    wanted: &PictureExpectation,
    stage: &Arc<Stage>,
    whose: &Whose,
    painter: &mut Painter,
    options: &PictureOptions,
) -> Judged {
    let stored_at = stored::place(whose.path, &wanted.name);
    let mut check = Check {
        place: whose.place.clone(),
        title: format!("picture \"{}\" at {} s", wanted.name, wanted.at.as_secs()),
        passed: false,
        expected: crate::collect::shown(&stored_at),
        got: String::new(),
        by: String::new(),
        hint: String::new(),
        evidence: Evidence::None,
    };
    let shot = match shot(wanted, stage, options) {
        Ok(shot) => shot,
        Err(unknown) => return Judged::Check(Box::new(Check { got: unknown.to_string(), ..check }), None),
    };
    let (frame, class) = match painter.draw(stage, &shot) {
        Ok(drawn) => drawn,
        Err(NoPicture::NoDevice(why)) => return Judged::Skipped(why),
        Err(NoPicture::Failed(why)) => {
            check.got = format!("no picture: {why}");
            return Judged::Check(Box::new(check), None);
        }
    };
    check.got = format!("{}x{} drawn on {class}", frame.width, frame.height);
    let (finding, read) = find(wanted, &frame, &class, &stored_at, options);
    if let Finding::Good(words) = finding {
        (check.passed, check.by) = (true, words);
    } else {
        Failing { wanted, whose, options, stored_at, frame: &frame, class: &class }.fill(finding, &mut check);
    }
    Judged::Check(Box::new(check), read)
}

/// An image that differs from its golden image, or has none.
struct Failing<'a> {
    wanted: &'a PictureExpectation,
    whose: &'a Whose<'a>,
    options: &'a PictureOptions,
    stored_at: PathBuf,
    frame: &'a Frame,
    class: &'a str,
}

impl Failing<'_> {
    /// Accepts the image, or fills the check with the difference and writes the images for people to look at.
    fn fill(self, finding: Finding, check: &mut Check) {
        let (wanted, whose) = (self.wanted, self.whose);
        let name = match whose.section {
            "" => whose.file.to_string(),
            section => format!("{} > {section}", whose.file),
        };
        let bytes = match stored::encode_accepted(self.frame, self.class, &name) {
            Ok(bytes) => bytes,
            Err(text) => {
                check.got = format!("no PNG: {text}");
                return;
            }
        };
        let heavy = (!wanted.large && bytes.len() > MOST_BYTES).then(|| too_heavy(bytes.len()));
        if self.options.accept.takes(&wanted.name) {
            let written = heavy.map_or_else(
                || stored::write(whose.path, &wanted.name, &bytes).map_err(|e| e.to_string()),
                Err,
            );
            check.passed = written.is_ok();
            check.by = if check.passed { ACCEPTED } else { "not accepted" }.to_string();
            check.hint = written.err().unwrap_or_default();
            return;
        }
        let mut pictures = Pictures { name: wanted.name.clone(), got: bytes, ..Pictures::default() };
        self.describe(finding, check, &mut pictures);
        pictures.stored = self.stored_at;
        heavy.into_iter().for_each(|text| hint(check, text));
        if let Some(folder) = &self.options.failures {
            write(folder, whose.file, &mut pictures, check);
        }
        check.evidence = Evidence::Pictures(Box::new(pictures));
    }

    fn describe(&self, finding: Finding, check: &mut Check, pictures: &mut Pictures) {
        let shown = std::mem::take(&mut check.expected);
        (check.expected, check.by) = match finding {
            Finding::Good(words) => (shown, words),
            Finding::Missing => {
                (format!("{shown}, which is not there yet"), "no picture has been accepted".into())
            }
            Finding::Damaged(why) => {
                check.hint = "restore it from version control, or accept what came".into();
                (format!("{shown}, which cannot be read: {why}"), "the stored picture is damaged".into())
            }
            Finding::OtherDevice(device) => {
                let device = if device.is_empty() { "an unknown device".to_string() } else { device };
                check.hint = "to compare all the same: --any-device".into();
                let by = "pictures of different devices are not compared";
                (format!("{shown}, accepted on {device}"), by.into())
            }
            Finding::OtherSize((stored, bytes)) => {
                pictures.expected = bytes;
                let Frame { width, height, .. } = stored.frame;
                (format!("{shown}, {width}x{height} pixels"), "the sizes differ".into())
            }
            Finding::Differs(found) => {
                let by = describe(&found.measures, [self.frame.width, self.frame.height]);
                let expected = format!(
                    "{shown}: at most {} % of pixels more than {} steps off, visible difference at most {}",
                    found.share * 100.0,
                    found.measures.tolerance,
                    found.visible
                );
                if let Ok(difference) = difference_image(&found.expected, self.frame) {
                    pictures.difference = stored::encode(&difference, &[]).unwrap_or_default();
                }
                pictures.expected = found.bytes;
                pictures.seen = stored::encode(&found.seen, &[]).unwrap_or_default();
                pictures.measures = Some(found.measures);
                (expected, by)
            }
        };
    }
}

fn too_heavy(bytes: usize) -> String {
    format!(
        "the picture takes {:.1} KiB as PNG, at most {} are kept; make it smaller (size), or say that it is meant: #{{ large: true }}",
        bytes as f64 / 1024.0,
        MOST_BYTES >> 10
    )
}

/// `Check::by` of a picture that has just been taken over.
pub const ACCEPTED: &str = "accepted now";

#[derive(Debug, thiserror::Error)]
#[error("unknown device \"{0}\"; there are \"cpu\" and \"vulkan\"")]
struct UnknownDevice(String);

fn shot(wanted: &PictureExpectation, stage: &Stage, options: &PictureOptions) -> Result<Shot, UnknownDevice> {
    let device = match (options.device, wanted.device.as_deref()) {
        (Some(device), _) => device,
        (None, None | Some("cpu")) => Device::Cpu,
        (None, Some("vulkan")) => Device::Vulkan,
        (None, Some(other)) => {
            return Err(UnknownDevice(other.to_string()));
        }
    };
    // As the stage is shaped, and small.
    let [w, h] = stage.settings.size;
    let largest = w.max(h).max(1);
    let scaled = |v: u32| match largest > LARGEST_SIDE {
        true => ((u64::from(v) * u64::from(LARGEST_SIDE) / u64::from(largest)) as u32).max(1),
        false => v,
    };
    Ok(Shot {
        at: wanted.at,
        size: wanted.size.unwrap_or([scaled(w), scaled(h)]),
        samples: wanted.samples.or(stage.settings.samples).unwrap_or(4),
        device,
    })
}

enum Finding {
    /// The images are equal within the tolerance; the text describes the difference.
    Good(String),
    Missing,
    Damaged(String),
    OtherDevice(String),
    /// The stored picture and its file.
    OtherSize((Stored, Vec<u8>)),
    Differs(Box<Found>),
}

struct Found {
    expected: Frame,
    bytes: Vec<u8>,
    measures: Measures,
    /// Visible differences by FLIP, as an image.
    seen: Frame,
    /// What was allowed.
    share: f64,
    visible: f64,
}

fn find(
    wanted: &PictureExpectation,
    frame: &Frame,
    class: &str,
    stored_at: &Path,
    options: &PictureOptions,
) -> (Finding, Option<[u8; 32]>) {
    match stored::read(stored_at) {
        Ok((expected, bytes)) => {
            let hash = *blake3::hash(&bytes).as_bytes();
            (against(wanted, frame, class, (expected, bytes), options), Some(hash))
        }
        Err(Unreadable::Missing) => (Finding::Missing, None),
        Err(Unreadable::Damaged(why)) => (Finding::Damaged(why), None),
    }
}

fn against(
    wanted: &PictureExpectation,
    frame: &Frame,
    class: &str,
    (expected, bytes): (Stored, Vec<u8>),
    options: &PictureOptions,
) -> Finding {
    if expected.device != class && !options.any_device {
        return Finding::OtherDevice(expected.device);
    }
    if expected.frame == *frame {
        return Finding::Good("equal, bit for bit".into());
    }
    let tolerance = wanted.tolerance.unwrap_or(TOLERANCE);
    let share = wanted.share.unwrap_or(SHARE);
    let allowed = wanted.visible.unwrap_or(VISIBLE);
    let (Ok(comparison), Ok(visible)) =
        (compare(&expected.frame, frame, tolerance), flip(&expected.frame, frame))
    else {
        return Finding::OtherSize((expected, bytes));
    };
    let measures = Measures {
        share_beyond: comparison.share_beyond,
        tolerance,
        worst: comparison.worst,
        worst_at: comparison.worst_at,
        region: comparison.region,
        visible_mean: visible.mean,
        visible_worst: visible.worst,
        words: visible.words().to_string(),
    };
    match comparison.share_beyond <= share && visible.worst <= allowed {
        true => Finding::Good(describe(&measures, [frame.width, frame.height])),
        false => Finding::Differs(Box::new(Found {
            expected: expected.frame,
            bytes,
            measures,
            seen: flip_heatmap(&visible, [frame.width, frame.height]),
            share,
            visible: allowed,
        })),
    }
}

/// Both measures, each with words.
pub fn describe(m: &Measures, [w, h]: [u32; 2]) -> String {
    let pixels = f64::from(w) * f64::from(h);
    let beyond = libm::round(m.share_beyond * pixels);
    let part = match m.share_beyond {
        0.0 => "none",
        s if s <= 0.0005 => "single ones",
        s if s <= 0.01 => "a spot, or edges",
        s if s <= 0.2 => "a part of the picture",
        _ => "much of the picture",
    };
    let region = match m.region {
        Some([x, y, w, h]) => format!(" within {w}x{h} at ({x}, {y})"),
        None => String::new(),
    };
    format!(
        "{}: visible difference {:.3} at worst, {:.4} in the mean; {beyond} of {pixels} pixels ({:.3} %: {part}) more than {} steps off{region}, the worst {} at ({}, {})",
        m.words,
        m.visible_worst,
        m.visible_mean,
        m.share_beyond * 100.0,
        m.tolerance,
        m.worst,
        m.worst_at[0],
        m.worst_at[1],
    )
}

fn hint(check: &mut Check, text: String) {
    check.hint = if check.hint.is_empty() { text } else { format!("{}; {text}", check.hint) };
}

/// The three pictures where a person can open them.
fn write(folder: &Path, file: &str, pictures: &mut Pictures, check: &mut Check) {
    for (kind, bytes) in
        [("expected", &pictures.expected), ("got", &pictures.got), ("difference", &pictures.difference)]
    {
        let name = Path::new(&flat(file)).join(format!("{}.{kind}.png", pictures.name));
        let path = folder.join(&name);
        if bytes.is_empty() {
            // Of an earlier run; not this failure's.
            let _ = std::fs::remove_file(&path);
            pictures.written.push(PathBuf::new());
            continue;
        }
        match write_whole_beneath(folder, &name, bytes) {
            Ok(()) => pictures.written.push(path),
            Err(e) => {
                pictures.written.push(PathBuf::new());
                hint(check, format!("{}: cannot write: {e}", path.display()));
            }
        }
    }
}

/// A path as one folder name.
fn flat(file: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' };
    let name: String = file.trim_start_matches(['.', '/']).chars().map(plain).collect();
    name.strip_suffix(".rhai").unwrap_or(&name).to_string()
}
