//! State of the viewer: plain data without a UI toolkit, tested without a window.

pub mod curves;
pub mod dragged_icon;
pub mod dropped_models;
pub mod events;
pub mod history;
pub mod keyed;
mod keyed_parts;
pub mod orbit;
pub mod performance;
pub mod playhead;
pub mod reduction;
pub mod render_form;
pub mod selection;
pub mod settings;
pub mod shortcuts;
pub mod side;
pub mod span;
pub mod tangents;
pub mod tempo;
pub mod timeline;
pub mod trail;
pub mod view;
