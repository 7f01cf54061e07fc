//! The commands of the program, one module each.

pub(crate) mod check;
mod compressed;
pub(crate) mod explain;
pub(crate) mod export;
pub(crate) mod farm;
pub(crate) mod format;
pub(crate) mod help;
pub(crate) mod info;
pub(crate) mod join;
pub(crate) mod lsp;
pub(crate) mod measure;
pub(crate) mod new;
pub(crate) mod pack;
pub(crate) mod plugins;
pub(crate) mod pose;
pub(crate) mod render;
pub(crate) mod test;
pub(crate) mod view;
