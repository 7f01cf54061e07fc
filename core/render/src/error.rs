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
    /// The device is lost for good; another one can be created.
    #[error("Vulkan: {object}: the device was lost; the kernel log may name the reason")]
    DeviceLost { object: String },
    /// The device or the machine has no memory left.
    #[error("Vulkan: {object}: out of memory")]
    OutOfMemory { object: String },
    /// The driver may hang: the objects that it was given are never touched again.
    #[error("Vulkan: {object}: not finished after {secs} s")]
    TimedOut { object: String, secs: u64 },
    /// An operation failed twice, the second time on a new device with reduced demands.
    #[error("{second}; tried twice, before that: {first}")]
    Twice { first: Box<RenderError>, second: Box<RenderError> },
    /// The validation layer reported a message (tests only).
    #[error("Vulkan validation: {0}")]
    Validation(String),
    #[error("shader {file}: {text}")]
    Shader { file: String, text: String },
    #[error("{what} is {value}, the limit of this device is {limit}")]
    Limit { what: String, value: u64, limit: u64 },
    #[error("{0}")]
    Usage(String),
}
