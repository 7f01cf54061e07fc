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
    /// Of these names.
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
    /// Where the pictures of failures go; `None`: nowhere.
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
    /// With the content hash of the stored picture, where one was read.
    Check(Box<Check>, Option<[u8; 32]>),
    /// This machine cannot draw it: the reason.
    Skipped(String),
}

/// Draws and compares one picture. The stored one is replaced where it is to be accepted and is not good as it is.
pub fn judge(
    wanted: &PictureExpectation,
    stage: &Arc<Stage>,
    whose: &Whose,
    painter: &mut Painter,
    options: &PictureOptions,
) -> Judged {
    let stored_at = stored::place(whose.path, &wanted.name);
    let shown = crate::collect::shown(&stored_at);
    let mut check = Check {
        place: whose.place.clone(),
        title: format!("picture \"{}\" at {} s", wanted.name, wanted.at.as_secs()),
        passed: false,
        expected: shown.clone(),
        got: String::new(),
        by: String::new(),
        hint: String::new(),
        evidence: Evidence::None,
    };
    let shot = match shot(wanted, stage, options) {
        Ok(shot) => shot,
        Err(text) => {
            check.got = text;
            return Judged::Check(Box::new(check), None);
        }
    };
    let (frame, class) = match painter.draw(stage, &shot) {
        Ok(drawn) => drawn,
        Err(NoPicture::NoDevice(why)) => return Judged::Skipped(why),
        Err(NoPicture::Failed(why)) => {
            check.got = format!("no picture: {why}");
            return Judged::Check(Box::new(check), None);
        }
    };
    let [w, h] = shot.size;
    check.got = format!("{w}x{h} drawn on {class}");
    let name = match whose.section {
        "" => whose.file.to_string(),
        section => format!("{} > {section}", whose.file),
    };
    let (finding, read) = find(wanted, &frame, &class, &stored_at, options);
    if let Finding::Good(words) = finding {
        (check.passed, check.by) = (true, words);
        return Judged::Check(Box::new(check), read);
    }
    let bytes = match stored::encode_accepted(&frame, &class, &name) {
        Ok(bytes) => bytes,
        Err(text) => {
            check.got = format!("no PNG: {text}");
            return Judged::Check(Box::new(check), read);
        }
    };
    let light = wanted.large || bytes.len() <= MOST_BYTES;
    let weight = format!(
        "the picture takes {:.1} KiB as PNG, at most {} are kept; make it smaller (size), or say that it is meant: #{{ large: true }}",
        bytes.len() as f64 / 1024.0,
        MOST_BYTES >> 10
    );
    if options.accept.takes(&wanted.name) {
        let done = if light { stored::write(whose.path, &wanted.name, &bytes) } else { Err(weight.clone()) };
        match done {
            Ok(()) => {
                check.passed = true;
                check.by = ACCEPTED.to_string();
                return Judged::Check(Box::new(check), read);
            }
            Err(text) => {
                check.by = "not accepted".to_string();
                check.hint = text;
                return Judged::Check(Box::new(check), read);
            }
        }
    }
    let mut pictures =
        Pictures { name: wanted.name.clone(), stored: stored_at, got: bytes, ..Pictures::default() };
    match finding {
        Finding::Good(_) => {}
        Finding::Missing => {
            check.expected = format!("{shown}, which is not there yet");
            check.by = "no picture has been accepted".into();
        }
        Finding::Damaged(why) => {
            check.expected = format!("{shown}, which cannot be read: {why}");
            check.by = "the stored picture is damaged".into();
            check.hint = "restore it from version control, or accept what came".into();
        }
        Finding::OtherDevice(device) => {
            let device = if device.is_empty() { "an unknown device".to_string() } else { device };
            check.expected = format!("{shown}, accepted on {device}");
            check.by = "pictures of different devices are not compared".into();
            check.hint = "to compare all the same: --any-device".into();
        }
        Finding::OtherSize(expected) => {
            check.expected =
                format!("{shown}, {}x{} pixels", expected.0.frame.width, expected.0.frame.height);
            check.by = "the sizes differ".into();
            pictures.expected = expected.1;
        }
        Finding::Differs(found) => {
            check.expected = format!(
                "{shown}: at most {} % of pixels more than {} steps off, visible difference at most {}",
                found.share * 100.0,
                found.measures.tolerance,
                found.visible
            );
            check.by = describe(&found.measures, shot.size);
            pictures.expected = found.bytes;
            if let Ok(difference) = difference_image(&found.expected, &frame) {
                pictures.difference = stored::encode(&difference, &[]).unwrap_or_default();
            }
            pictures.seen = stored::encode(&found.seen, &[]).unwrap_or_default();
            pictures.measures = Some(found.measures);
        }
    }
    if !light {
        hint(&mut check, weight);
    }
    if let Some(folder) = &options.failures {
        write(folder, whose.file, &mut pictures, &mut check);
    }
    check.evidence = Evidence::Pictures(Box::new(pictures));
    Judged::Check(Box::new(check), read)
}

/// `Check::by` of a picture that has just been taken over.
pub const ACCEPTED: &str = "accepted now";

fn shot(wanted: &PictureExpectation, stage: &Stage, options: &PictureOptions) -> Result<Shot, String> {
    let device = match (options.device, wanted.device.as_deref()) {
        (Some(device), _) => device,
        (None, None | Some("cpu")) => Device::Cpu,
        (None, Some("vulkan")) => Device::Vulkan,
        (None, Some(other)) => {
            return Err(format!("unknown device \"{other}\"; there are \"cpu\" and \"vulkan\""));
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
    /// With words for the difference.
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
    /// Where the eye sees it.
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
