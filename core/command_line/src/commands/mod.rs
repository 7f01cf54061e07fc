//! The commands of the program, one module each.

pub mod check;
mod compressed;
pub mod explain;
pub mod export;
pub mod format;
pub mod help;
pub mod info;
pub mod lsp;
pub mod measure;
pub mod new;
pub mod plugins;
pub mod pose;
pub mod render;
pub mod test;
pub mod view;
