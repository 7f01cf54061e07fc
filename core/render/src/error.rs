//! Errors of both renderers.

use thiserror::Error;

#[derive(Debug, Error)]
pub enum RenderError {
    /// No Vulkan loader, driver or device was found; the text says what to install.
    #[error("Vulkan is not available: {why}")]
    NoVulkan { why: String },
    /// A Vulkan call failed.
    #[error("Vulkan: {object}: {result}")]
    Vulkan { object: String, result: String },
    /// The device is lost and cannot be used any more; a new one can be created.
    #[error("Vulkan: {object}: the device was lost; the kernel log may name the reason")]
    DeviceLost { object: String },
    /// The device or the machine has no memory left.
    #[error("Vulkan: {object}: out of memory")]
    OutOfMemory { object: String },
    /// The driver did not finish in time and may hang. Objects that it may still use are never touched again.
    #[error("Vulkan: {object}: not finished after {secs} s")]
    TimedOut { object: String, secs: u64 },
    /// An operation failed twice, the second time on a new device with reduced demands.
    #[error("{second}; this was the second attempt, the first failed with: {first}")]
    FailedTwice { first: Box<RenderError>, second: Box<RenderError> },
    /// The validation layer reported a message (tests only).
    #[error("Vulkan validation: {0}")]
    Validation(String),
    /// A shader did not compile.
    #[error("shader {file}: {text}")]
    Shader { file: String, text: String },
    /// A requested size or count is above a limit of the device.
    #[error("{what} is {value}, the limit of this device is {limit}")]
    Limit { what: String, value: u64, limit: u64 },
    /// The renderer was called in a way that it does not support.
    #[error("{0}")]
    Usage(String),
}
