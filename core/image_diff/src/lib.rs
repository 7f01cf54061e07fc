//! How much two images differ: pixel by pixel ([`compare`]) and as an observer perceives it ([`flip()`]).

mod flip;
mod metrics;
mod pixels;

pub use flip::{
    FlipDifference, MAX_INVISIBLE, MAX_INVISIBLE_SIDE_BY_SIDE, MAX_SUBTLY_VISIBLE, flip, flip_heatmap,
};
pub use metrics::{ImageDifference, ImageMetric, METRICS};
pub use pixels::{CompareError, Comparison, compare, difference_image};
