//! Metrics by which a test compares two images. [`METRICS`] lists them, each with its name in scripts, its limit, its evaluation
//! and its texts.

use crate::flip::{FlipDifference, MAX_INVISIBLE_SIDE_BY_SIDE, flip};
use crate::pixels::{CompareError, Comparison, compare};
use choreo_plugin::Frame;

/// Measured differences of two images of one size.
pub struct ImageDifference {
    pub pixels: Comparison,
    pub visible: FlipDifference,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

/// A measure of an [`ImageDifference`] with a limit: 0 for equal images, 1 at most.
pub struct ImageMetric {
    /// Option of `expect_image` that sets the limit: the metric's name in scripts.
    pub name: &'static str,
    /// Name of the limited quantity, as in the API reference.
    pub doc: &'static str,
    /// Limit if a test sets none: a difference that is not visible side by side, and hardly visible when the images alternate.
    pub limit: f64,
    pub value: fn(&ImageDifference) -> f64,
    /// The allowed values, in words.
    pub allowed: fn(&ImageDifference, f64) -> String,
    /// The measured value, in words.
    pub measured: fn(&ImageDifference) -> String,
}

/// All metrics. An image passes if no value is above its limit.
pub const METRICS: [ImageMetric; 2] = [
    ImageMetric {
        name: "visible",
        doc: "largest perceived difference by FLIP",
        limit: MAX_INVISIBLE_SIDE_BY_SIDE,
        value: |d| d.visible.worst,
        allowed: |_, limit| format!("visible difference at most {limit}"),
        measured: |d| {
            format!("visible difference {:.3} at worst, {:.4} in the mean", d.visible.worst, d.visible.mean)
        },
    },
    ImageMetric {
        name: "share",
        doc: "of pixels beyond the tolerance",
        limit: 0.001,
        value: |d| d.pixels.share_beyond,
        allowed: |d, limit| {
            format!("at most {} % of pixels more than {} steps off", limit * 100.0, d.pixels.tolerance)
        },
        measured: describe_share,
    },
];

impl ImageDifference {
    /// Measures the difference of two images. `tolerance`: difference of a channel, in steps of 255, up to which it is ignored.
    pub fn new(a: &Frame, b: &Frame, tolerance: u8) -> Result<ImageDifference, CompareError> {
        let size = [a.width, a.height];
        Ok(ImageDifference { pixels: compare(a, b, tolerance)?, visible: flip(a, b)?, size })
    }

    /// Whether no metric is above its limit. `limits` are in the order of [`METRICS`].
    pub fn within(&self, limits: &[f64; METRICS.len()]) -> bool {
        METRICS.iter().zip(limits).all(|(metric, limit)| (metric.value)(self) <= *limit)
    }

    /// The allowed values of all metrics, in words.
    pub fn allowed(&self, limits: &[f64; METRICS.len()]) -> String {
        let one = |(metric, limit): (&ImageMetric, &f64)| (metric.allowed)(self, *limit);
        METRICS.iter().zip(limits).map(one).collect::<Vec<_>>().join(", ")
    }

    /// The difference in words: as an observer would describe it, then by each metric.
    pub fn describe(&self) -> String {
        let measured: Vec<String> = METRICS.iter().map(|metric| (metric.measured)(self)).collect();
        format!("{}: {}", self.visible.description(), measured.join("; "))
    }
}

fn describe_share(d: &ImageDifference) -> String {
    let c = &d.pixels;
    let pixels = f64::from(d.size[0]) * f64::from(d.size[1]);
    let beyond = libm::round(c.share_beyond * pixels);
    let part = match c.share_beyond {
        0.0 => "none",
        s if s <= 0.0005 => "single pixels",
        s if s <= 0.01 => "a spot or edges",
        s if s <= 0.2 => "a part of the image",
        _ => "much of the image",
    };
    let region = match c.region {
        Some([x, y, w, h]) => format!(" within {w}x{h} at ({x}, {y})"),
        None => String::new(),
    };
    format!(
        "{beyond} of {pixels} pixels ({:.3} %: {part}) more than {} steps off{region}, the worst {} at ({}, {})",
        c.share_beyond * 100.0,
        c.tolerance,
        c.worst,
        c.worst_at[0],
        c.worst_at[1],
    )
}
