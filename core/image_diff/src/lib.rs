//! How much two images differ: pixel by pixel ([`compare`]) and as an observer perceives it ([`flip()`]).

mod flip;
mod metrics;
mod pixels;

pub use flip::{ALTERNATING, FlipDifference, NOT_VISIBLE, SIDE_BY_SIDE, flip, flip_heatmap};
pub use metrics::{ImageDifference, ImageMetric, METRICS};
pub use pixels::{CompareError, Comparison, compare, difference_image};
