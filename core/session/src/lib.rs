//! Hot reload: builds a scene from a script or a model, and rebuilds it on a worker thread when a file changes that it depends on. A new version
//! replaces the old one as a whole; a faulty one leaves the last good version in place and reports its errors.
//!
//! ```text
//! SceneSource ─► Session::build ─► SceneVersion ─► FrameRenderer ─► frames
//!               ▲    └ RunDependencies: the files that it depends on
//!               └── Watch ◄── the system
//! ```
//! This crate does not depend on a window or a UI toolkit.

pub mod edit;
mod frame_renderer;
pub mod model;
pub mod package;
pub mod plugin_files;
mod remembered_manifests;
mod scene_source;
mod session;
mod session_thread;
mod viewport;
mod watch;

pub use frame_renderer::{FrameError, FrameInfo, FrameRenderer, FrameReply, FrameRequest, StartRenderer};
pub use scene_source::SceneSource;
pub use session::{Problem, Scene, SceneVersion, Session, Work};
pub use session_thread::SessionThread;
pub use viewport::{PlacementOverride, ViewOverrides, ViewportCamera};
pub use watch::{Waker, Watch, WatchError, WatchEvent, WatchedPaths};
