//! Scenes and characters that several sections use.

use choreo_asset::Asset;
use choreo_plugin::{ImportOptions, ImportScope, Importer, OptionValue, Registry, Source};
use choreo_script::{ScriptOptions, run_file};
use choreo_stage::Stage;
use std::path::Path;
use std::sync::Arc;

struct NoFiles;

impl choreo_plugin::Files for NoFiles {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("{relative}: there are no files"))
    }
}

/// The built-in character.
pub(crate) fn mannequin() -> Result<Asset, String> {
    let source = Source { name: import_mannequin::SOURCE_NAME.into(), bytes: Arc::default() };
    import_mannequin::Mannequin
        .import(&source, &NoFiles, ImportScope::ALL, &ImportOptions::default())
        .map_err(|e| e.to_string())
}

/// Stage of a script in the repository's folder `scripts`.
pub(crate) fn stage_of_script(name: &str, registry: &Registry) -> Result<Arc<Stage>, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts").join(name);
    let script = run_file(&path, registry, &ScriptOptions::default())
        .map_err(|errors| errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))?;
    Ok(Arc::new(script.stage))
}

/// Imports a single file with the importer that claims it.
pub(crate) fn import_file(
    registry: &Registry,
    name: &str,
    bytes: Vec<u8>,
    options: &[(&str, OptionValue)],
) -> Result<Asset, String> {
    let source = Source { name: name.into(), bytes: Arc::new(bytes) };
    let options = options.iter().map(|(name, value)| (name.to_string(), value.clone())).collect();
    registry
        .import(&source, &NoFiles, ImportScope::ALL, &ImportOptions(options), None)
        .map_err(|e| e.to_string())
}
