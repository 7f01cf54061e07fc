//! All plugins known to the program.

use crate::isolated::{
    ImporterWithClaimWarnings, IsolatedExporter, IsolatedImporter, IsolatedSceneExporter, failed_claim,
    isolated_effect,
};
use crate::suggest::{did_you_mean, list};
use crate::{
    Claim, Effect, EffectTexture, Exporter, Files, ImportError, ImportOptions, ImportScope, Importer,
    LazyEffect, OptionKind, PluginError, PluginPanic, SceneExporter, Source,
};
use choreo_asset::Asset;
use choreo_stage::{EffectImageUse, EffectUse, Stage};
use std::sync::{Arc, Mutex, PoisonError};

/// Largest number of faulty plugin files that one hint names.
const MOST_FAULTY: usize = 4;
/// Part of the file name of every importer in Rhai or WebAssembly.
const IMPORTERS: &str = ".importer.";

/// Importers, exporters of frames and of scenes, and effects, by name.
///
/// ```
/// use choreo_plugin::{Effect, EffectPlugin, Manifest, OutlineEffect, Registry};
///
/// struct Nothing(Manifest);
///
/// impl EffectPlugin for Nothing {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
/// }
///
/// impl OutlineEffect for Nothing {}
///
/// let mut registry = Registry::default();
/// registry.add_effect(Effect::outline(Nothing(Manifest::new("nothing", "1", "changes nothing"))));
/// assert_eq!(registry.effect_names().collect::<Vec<_>>(), ["nothing"]);
/// ```
///
/// Plugins of all kinds, and how they are found:
///
/// ```
/// use choreo_plugin::asset::Asset;
/// use choreo_plugin::*;
/// use std::io::Write;
/// use std::sync::Arc;
///
/// struct Mine(Manifest);
///
/// impl Importer for Mine {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn import(&self, _: &Source, _: &dyn Files, _: ImportScope, _: &ImportOptions) -> Result<Asset, ImportError> {
///         Ok(Asset::default())
///     }
/// }
///
/// impl Exporter for Mine {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn one_frame_per_file(&self) -> bool {
///         false
///     }
///     fn begin(&self, _: &VideoInfo, _: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
///         Err(ExportError::Format("not written yet".into()))
///     }
/// }
///
/// impl SceneExporter for Mine {
///     fn manifest(&self) -> &Manifest {
///         &self.0
///     }
///     fn export(&self, _: &ExportedScene, _: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
///         Ok(Vec::new())
///     }
/// }
///
/// let mine = || Mine(Manifest::new("mine", "1", "an example").extensions(["mine"]));
/// let mut registry = Registry::default();
/// registry.add_importer(mine());
/// registry.add_shared_importer(Arc::new(mine()));
/// registry.add_exporter(mine());
/// registry.add_scene_exporter(mine());
/// registry.add_shared_scene_exporter(Arc::new(mine()));
/// let fault = PluginError { text: "glow.wgsl:3:5: unknown type".into(), files: Vec::new() };
/// registry.add_lazy_effect(Arc::new(LazyEffect::new("glow", move || Err(fault))));
/// registry.add_faulty("plugins/a.importer.rhai".into(), "no function load");
/// // The last plugin of a name counts.
/// assert_eq!((registry.importers().len(), registry.exporters().len(), registry.scene_exporters().len()), (1, 1, 1));
/// assert_eq!(registry.replaced()[0], "the importer mine replaces another one of this name");
/// assert!(registry.exporter_for("a.mine").is_some() && registry.scene_exporter_for("a.MINE").is_some());
/// let source = Source { name: "a.mine".into(), bytes: Default::default() };
/// assert_eq!(registry.claims(&source)[0].0, Claim::Extension);
/// assert!(registry.failed_claims(&source).is_empty());
/// // An effect of a file is compiled when it is used; faulty files are named when a plugin is not found.
/// assert!(registry.use_effect("glow").is_err() && registry.use_effect("glw").is_ok_and(|found| found.is_none()));
/// assert_eq!(registry.faulty_hint(".importer."), "\nno plugin: plugins/a.importer.rhai: no function load");
/// assert!(registry.effects().is_empty() && registry.settled().effects().is_empty());
/// assert!(registry.settled_for([&stage::Stage::default()]).effect("glow").is_none());
/// ```
#[derive(Clone, Default)]
pub struct Registry {
    importers: Vec<Arc<dyn Importer>>,
    exporters: Vec<Arc<dyn Exporter>>,
    scene_exporters: Vec<Arc<dyn SceneExporter>>,
    effects: Vec<Effect>,
    /// Effects of plugin files. Clones of the registry share the compiled effects.
    on_use: Vec<Arc<LazyEffect>>,
    /// Faulty plugin files: the name in messages, and the reason.
    faulty: Vec<(String, String)>,
    /// Messages about plugins that replaced others of the same name.
    replaced: Vec<String>,
    /// Effects whose images a stage has chosen, as of the last [`Registry::settled_for`]. Clones of the registry share them.
    with_images: Arc<Mutex<Vec<EffectWithImages>>>,
}

/// An effect with images that a script has chosen.
#[derive(Clone)]
struct EffectWithImages {
    original: Effect,
    with_images: Effect,
}

/// An importer with its claim on a file.
type ClaimedImporter<'r> = (Claim, &'r Arc<dyn Importer>);

impl Registry {
    /// Adds an importer. It replaces one of the same name, here and in the methods below, so that a user's plugin can take the place of a
    /// built-in one.
    pub fn add_importer(&mut self, plugin: impl Importer + 'static) {
        self.add_shared_importer(Arc::new(plugin));
    }
    /// Adds an importer that has further owners.
    pub fn add_shared_importer(&mut self, plugin: Arc<dyn Importer>) {
        let name = plugin.manifest().name.clone();
        let before = self.importers.len();
        self.importers.retain(|p| p.manifest().name != name);
        self.note_replaced("importer", &name, self.importers.len() < before);
        self.importers.push(Arc::new(IsolatedImporter(plugin)));
    }
    /// Adds an exporter; one of the same name is replaced.
    pub fn add_exporter(&mut self, plugin: impl Exporter + 'static) {
        let name = plugin.manifest().name.clone();
        let before = self.exporters.len();
        self.exporters.retain(|p| p.manifest().name != name);
        self.note_replaced("exporter", &name, self.exporters.len() < before);
        self.exporters.push(Arc::new(IsolatedExporter(Arc::new(plugin))));
    }
    /// Adds an exporter of scenes; one of the same name is replaced.
    pub fn add_scene_exporter(&mut self, plugin: impl SceneExporter + 'static) {
        self.add_shared_scene_exporter(Arc::new(plugin));
    }
    /// Adds an exporter of scenes that has further owners.
    pub fn add_shared_scene_exporter(&mut self, plugin: Arc<dyn SceneExporter>) {
        let name = plugin.manifest().name.clone();
        let before = self.scene_exporters.len();
        self.scene_exporters.retain(|p| p.manifest().name != name);
        self.note_replaced("scene exporter", &name, self.scene_exporters.len() < before);
        self.scene_exporters.push(Arc::new(IsolatedSceneExporter(plugin)));
    }
    /// Adds an effect; one of the same name is replaced.
    pub fn add_effect(&mut self, effect: impl Into<Effect>) {
        let effect = effect.into();
        self.remove_effect(&effect.manifest().name);
        self.effects.push(isolated_effect(effect));
    }
    /// Adds an effect of a plugin file, which is compiled at its first use.
    pub fn add_lazy_effect(&mut self, plugin: Arc<LazyEffect>) {
        self.remove_effect(plugin.name());
        self.on_use.push(plugin);
    }
    fn remove_effect(&mut self, name: &str) {
        let before = self.effects.len() + self.on_use.len();
        self.effects.retain(|p| p.manifest().name != name);
        self.on_use.retain(|p| p.name() != name);
        self.note_replaced("effect", name, self.effects.len() + self.on_use.len() < before);
    }
    fn note_replaced(&mut self, kind: &str, name: &str, replaced: bool) {
        if replaced {
            self.replaced.push(format!("the {kind} {name} replaces another one of this name"));
        }
    }
    /// Messages about plugins that replaced others of the same name, one sentence each, in the order in which the plugins were added.
    pub fn replaced(&self) -> &[String] {
        &self.replaced
    }
    /// Notes a file that has the name of a plugin and is not a valid one, with the reason. Hints about plugins that were not found name it.
    pub fn add_faulty(&mut self, file: String, reason: &str) {
        // Code and caret below the message are for `choreo plugins`.
        let first = reason.lines().next().unwrap_or_default();
        self.faulty.push((file, first.to_string()));
    }
    /// The importers, in the order in which they were added.
    pub fn importers(&self) -> &[Arc<dyn Importer>] {
        &self.importers
    }
    /// The exporters, in the order in which they were added.
    pub fn exporters(&self) -> &[Arc<dyn Exporter>] {
        &self.exporters
    }
    /// The exporters of scenes, in the order in which they were added.
    pub fn scene_exporters(&self) -> &[Arc<dyn SceneExporter>] {
        &self.scene_exporters
    }
    /// The effects that are ready. Effects of plugin files are among them only after [`Registry::settled`], and only if they were used.
    pub fn effects(&self) -> &[Effect] {
        &self.effects
    }
    /// An effect that is ready, or that was already made from a plugin file.
    pub fn effect(&self, name: &str) -> Option<&Effect> {
        let made = || self.on_use.iter().find(|e| e.name() == name)?.made();
        self.effects.iter().find(|e| e.manifest().name == name).or_else(made)
    }
    /// An effect to be used: an effect of a plugin file is compiled now. `None` if no effect has the name.
    pub fn use_effect(&self, name: &str) -> Result<Option<&Effect>, &PluginError> {
        let of_file = || self.on_use.iter().find(|e| e.name() == name).map(|e| e.get()).transpose();
        self.effects.iter().find(|e| e.manifest().name == name).map_or_else(of_file, |e| Ok(Some(e)))
    }
    /// Names of all effects, ready or not.
    pub fn effect_names(&self) -> impl Iterator<Item = &str> {
        self.effects.iter().map(|e| e.manifest().name.as_str()).chain(self.on_use.iter().map(|e| e.name()))
    }
    /// A copy for renderers, after a script has run: effects of plugin files that were used so far are ready, and unused ones are left out.
    pub fn settled(&self) -> Registry {
        let mut settled = Registry { on_use: Vec::new(), ..self.clone() };
        settled.effects.extend(self.on_use.iter().filter_map(|e| e.made()).cloned());
        settled
    }
    /// [`Registry::settled`], with an additional effect for each use in the stages that chooses its own images, under the name
    /// [`EffectUse::effect_name`](choreo_stage::EffectUse::effect_name). While a use keeps its images, it keeps the same effect.
    pub fn settled_for<'s>(&self, stages: impl IntoIterator<Item = &'s Stage>) -> Registry {
        let mut settled = self.settled();
        let mut known = self.with_images.lock().unwrap_or_else(PoisonError::into_inner);
        let mut all: Vec<EffectWithImages> = Vec::new();
        let effects = stages.into_iter().flat_map(|stage| &stage.effects);
        for used in effects.filter(|used| !used.images.is_empty()) {
            let name = used.effect_name();
            let Some(of) = settled.effect(&used.plugin).cloned() else { continue };
            if all.iter().any(|one| one.with_images.manifest().name == name) {
                continue;
            }
            let before =
                known.iter().find(|one| one.original.is_same(&of) && one.with_images.manifest().name == name);
            let make = || {
                Some(EffectWithImages { with_images: with_images(&of, &name, used)?, original: of.clone() })
            };
            all.extend(before.cloned().or_else(make));
        }
        settled.effects.extend(all.iter().map(|one| one.with_images.clone()));
        *known = all;
        settled
    }

    /// Hint that lists faulty plugin files and the reasons, for a plugin that was not found. Only files whose names contain `part` are
    /// listed, and all faulty package manifests (`.toml`). Empty if there are none.
    pub fn faulty_hint(&self, part: &str) -> String {
        let of_kind = |file: &str| file.contains(part) || file.ends_with(".toml");
        let faulty = self.faulty.iter().filter(|(file, _)| of_kind(file));
        let reasons: Vec<String> = faulty
            .map(|(file, why)| if why.starts_with(file) { why.clone() } else { format!("{file}: {why}") })
            .collect();
        match reasons.len() {
            0 => String::new(),
            n if n <= MOST_FAULTY => format!("\nno plugin: {}", reasons.join("\nno plugin: ")),
            n => {
                let first = reasons[..MOST_FAULTY].join("\nno plugin: ");
                format!("\nno plugin: {first}\nand {} more files", n - MOST_FAULTY)
            }
        }
    }

    /// The exporter for an output file name, by extension.
    pub fn exporter_for(&self, file_name: &str) -> Option<&Arc<dyn Exporter>> {
        self.exporters.iter().find(|e| e.manifest().writes(file_name))
    }

    /// The exporter of scenes for an output file name, by extension; of several the one added last, so that a user's own plugin
    /// wins over ours.
    pub fn scene_exporter_for(&self, file_name: &str) -> Option<&Arc<dyn SceneExporter>> {
        self.scene_exporters.iter().rfind(|e| e.manifest().writes(file_name))
    }

    /// The claims of all importers on a file, the greatest first. Of equal claims, those of importers whose manifest has the file's
    /// extension come first, then those of importers added later, so that a user's own plugin wins over ours.
    pub fn claims(&self, source: &Source) -> Vec<(Claim, &Arc<dyn Importer>)> {
        self.collect_claims(source).0
    }

    /// The failures of importers that were asked whether the file is their own. These importers claim nothing.
    pub fn failed_claims(&self, source: &Source) -> Vec<PluginPanic> {
        self.collect_claims(source).1
    }

    fn collect_claims(&self, source: &Source) -> (Vec<ClaimedImporter<'_>>, Vec<PluginPanic>) {
        let (extension, mut failures) = (source.extension(), Vec::new());
        let mut claim = |importer: &Arc<dyn Importer>| {
            importer.checked_claim(source).unwrap_or_else(|panic| {
                failures.push(panic);
                Claim::NotMine
            })
        };
        let mut claims: Vec<_> = self.importers.iter().map(|i| (claim(i), i)).rev().collect();
        claims.sort_by_key(|(claim, i)| std::cmp::Reverse((*claim, i.manifest().has_extension(&extension))));
        (claims, failures)
    }

    /// The importer with the greatest claim on the file ([`Registry::claims`]), or the one with the name `named`. Its assets have a warning
    /// about each importer that has failed to claim the file.
    ///
    /// # Errors
    /// No importer claims the file, or none has the name.
    ///
    /// ```
    /// use choreo_plugin::{Registry, Source};
    /// let source = Source { name: "a.xyz".into(), bytes: Default::default() };
    /// let error = Registry::default().importer_for(&source, None).err().unwrap();
    /// assert_eq!(error.to_string(), "a.xyz: no importer knows this kind of file");
    /// ```
    pub fn importer_for(
        &self,
        source: &Source,
        named: Option<&str>,
    ) -> Result<Arc<dyn Importer>, ImportError> {
        let names = || self.importers.iter().map(|i| i.manifest().name.as_str());
        let error = |what: String, hint: String| ImportError {
            file: source.name.clone(),
            place: String::new(),
            what,
            hint: Some(hint),
        };
        if let Some(named) = named {
            return self.importers.iter().rfind(|i| i.manifest().name == named).cloned().ok_or_else(|| {
                let what = format!("unknown importer \"{named}\"{}", did_you_mean(named, names()));
                error(what, format!("importers: {}{}", list(names(), 30), self.faulty_hint(IMPORTERS)))
            });
        }
        let (claims, failures) = self.collect_claims(source);
        match claims.first() {
            Some((claim, importer)) if *claim > Claim::NotMine => {
                let importer = Arc::clone(importer);
                Ok(match failures.is_empty() {
                    true => importer,
                    false => Arc::new(ImporterWithClaimWarnings { importer, failures }),
                })
            }
            _ => Err(error(
                failures.iter().fold("no importer knows this kind of file".to_string(), |what, panic| {
                    format!("{what}; {}", failed_claim(panic))
                }),
                format!(
                    "known importers: {}; name one with #{{ importer: … }}{}",
                    list(names(), 30),
                    self.faulty_hint(IMPORTERS)
                ),
            )),
        }
    }

    /// Imports a file by the importer that claims it, or by the one with the name `named`. Options are checked and completed.
    pub fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
        named: Option<&str>,
    ) -> Result<Asset, ImportError> {
        let importer = self.importer_for(source, named)?;
        let options = importer.manifest().complete(options).map_err(|e| ImportError {
            file: source.name.clone(),
            place: String::new(),
            what: e.message,
            hint: e.hint,
        })?;
        importer.import(source, files, needs, &options)
    }
}

/// A copy of an effect that reads the images which its use has chosen.
fn with_images(effect: &Effect, name: &str, used: &EffectUse) -> Option<Effect> {
    let texture = |chosen: &EffectImageUse| {
        let OptionKind::Texture { srgb, .. } = effect.manifest().option(&chosen.parameter).ok()?.kind else {
            return None;
        };
        let image = &chosen.image;
        EffectTexture::new(&chosen.parameter, [image.width, image.height], &image.rgba, srgb)
    };
    let images: Vec<EffectTexture> = used.images.iter().filter_map(texture).collect();
    effect.shader()?.with_images(name, &images).map(isolated_effect)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Manifest;

    struct FixedClaim(Manifest, Claim);

    impl Importer for FixedClaim {
        fn manifest(&self) -> &Manifest {
            &self.0
        }
        fn claim(&self, _: &Source) -> Claim {
            self.1
        }
        fn import(
            &self,
            _: &Source,
            _: &dyn Files,
            _: ImportScope,
            _: &ImportOptions,
        ) -> Result<Asset, ImportError> {
            Ok(Asset::default())
        }
    }

    fn claim_order(importers: &[(&str, &str, Claim)]) -> Vec<String> {
        let mut registry = Registry::default();
        for (name, extension, claim) in importers {
            registry.add_importer(FixedClaim(Manifest::new(name, "1", "").extensions([*extension]), *claim));
        }
        let source = Source { name: "a.dat".into(), bytes: Arc::default() };
        registry.claims(&source).iter().map(|(_, i)| i.manifest().name.clone()).collect()
    }

    #[test]
    fn claims_by_content_precede_claims_by_extension() {
        let all = [
            ("no", "dat", Claim::NotMine),
            ("named", "dat", Claim::Extension),
            ("likely", "x", Claim::Content(50)),
            ("sure", "x", Claim::Content(95)),
        ];
        assert_eq!(claim_order(&all), ["sure", "likely", "named", "no"]);
    }

    #[test]
    fn equal_claims_are_ordered_by_extension_then_by_last_added() {
        let c = Claim::Content(90);
        assert_eq!(claim_order(&[("a", "dat", c), ("b", "x", c)]), ["a", "b"]);
        assert_eq!(claim_order(&[("a", "x", c), ("b", "dat", c)]), ["b", "a"]);
        assert_eq!(claim_order(&[("ours", "dat", c), ("yours", "dat", c)]), ["yours", "ours"]);
    }

    struct Named(Manifest);

    impl crate::EffectPlugin for Named {
        fn manifest(&self) -> &Manifest {
            &self.0
        }
    }

    impl crate::OutlineEffect for Named {}

    fn named(name: &str) -> Effect {
        Effect::outline(Named(Manifest::new(name, "1", "")))
    }

    #[test]
    fn a_lazy_effect_is_compiled_once_at_its_first_use() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let made = Arc::new(AtomicUsize::new(0));
        let mut registry = Registry::default();
        registry.add_effect(named("fog"));
        let count = made.clone();
        registry.add_lazy_effect(Arc::new(LazyEffect::new("fog", move || {
            count.fetch_add(1, Ordering::Relaxed);
            Ok(named("fog"))
        })));
        let fault = PluginError { text: "bad.wgsl:1:1: faulty".into(), files: Vec::new() };
        let same = fault.clone();
        registry.add_lazy_effect(Arc::new(LazyEffect::new("bad", move || Err(same.clone()))));
        assert_eq!(registry.effect_names().collect::<Vec<_>>(), ["fog", "bad"]);
        assert!(registry.effect("fog").is_none() && registry.settled().effects().is_empty());
        assert_eq!(made.load(Ordering::Relaxed), 0);
        let clone = registry.clone();
        assert!(clone.use_effect("fog").unwrap().is_some() && clone.use_effect("none").unwrap().is_none());
        assert_eq!(clone.use_effect("bad").err(), Some(&fault));
        registry.use_effect("fog").unwrap();
        assert_eq!(made.load(Ordering::Relaxed), 1);
        assert!(registry.effect("fog").is_some() && registry.effect("bad").is_none());
        let names = |r: &Registry| r.effects().iter().map(|e| e.manifest().name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&registry.settled()), ["fog"]);
    }

    #[test]
    fn an_unclaimed_file_is_an_error_with_a_hint() {
        let mut registry = Registry::default();
        registry.add_importer(FixedClaim(Manifest::new("gltf", "1", ""), Claim::NotMine));
        let source = Source { name: "a.dat".into(), bytes: Arc::default() };
        let error = |named| registry.importer_for(&source, named).err().unwrap();
        assert_eq!(error(None).to_string(), "a.dat: no importer knows this kind of file");
        assert_eq!(
            error(Some("glft")).to_string(),
            "a.dat: unknown importer \"glft\"; did you mean \"gltf\"?"
        );
        assert!(registry.importer_for(&source, Some("gltf")).is_ok());
        let dots = "plugins/dots.importer.rhai";
        registry.add_faulty(dots.into(), "plugins/dots.importer.rhai:3:1: no function load\n    fn lod");
        registry.add_faulty("plugins/a.wgsl".into(), "no line // effect: NAME");
        let hint = registry.importer_for(&source, None).err().unwrap().hint.unwrap();
        assert!(hint.ends_with("\nno plugin: plugins/dots.importer.rhai:3:1: no function load"), "{hint}");
        assert_eq!(registry.faulty_hint(".wgsl"), "\nno plugin: plugins/a.wgsl: no line // effect: NAME");
    }
}
