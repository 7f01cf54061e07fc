//! The commands of the program, one module each.

pub mod check;
mod compressed;
pub mod explain;
pub mod export;
pub mod farm;
pub mod format;
pub mod help;
pub mod info;
pub mod join;
pub mod lsp;
pub mod measure;
pub mod new;
pub mod pack;
pub mod plugins;
pub mod pose;
pub mod render;
pub mod test;
pub mod view;
