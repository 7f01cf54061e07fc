//! Isolation of plugins: a panic ends the plugin's call, not the program. Importers and exporters return an error; a panic of an effect
//! continues as a [`PluginPanic`], which callers report. The message names the plugin and its version.

use crate::asset_check::{AssetFault, checked};
use crate::effect_hooks::{
    EffectPlugin, EffectShader, ImageEffect, LightingEffect, OutlineEffect, OverlayEffect, PixelEffect,
    ShutterEffect, SurfaceEffect, VertexEffect,
};
use crate::{
    Claim, Effect, EffectImages, EffectScene, EffectTexture, ExportError, ExportOptions, ExportedScene,
    Exporter, Files, FloatFrame, Frame, FrameSink, FrameWish, ImagePass, ImportError, ImportOptions,
    ImportScope, Importer, InvertedHull, LightSample, Manifest, Mark, Overlay, PluginFile, SceneExporter,
    SceneFiles, SceneInputs, Shutter, Source, SurfaceInputs, SurfaceSample, VertexSample, VideoInfo,
    ViewOrder,
};
use choreo_asset::{Asset, Warning};
use glam::{Vec2, Vec3, Vec4};
use std::any::Any;
use std::io::{Read, Write};
use std::num::NonZeroU64;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;

/// A panic of a plugin, and the payload with which the panic continues.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PluginPanic {
    /// Name of the plugin.
    pub plugin: String,
    /// Version of the plugin.
    pub version: String,
    /// The message of the panic.
    pub text: String,
}

choreo_motion::error_texts! { PluginPanic:
    Self { plugin, version, text } => "the plugin {plugin} {version} has failed: {text}";
}

impl PluginPanic {
    /// A panic of the plugin with this manifest.
    ///
    /// ```
    /// use choreo_plugin::{Manifest, PluginPanic};
    /// let panic = PluginPanic::new(&Manifest::new("iqm", "1.2", "characters"), "index 7 is out of range");
    /// assert_eq!(panic.to_string(), "the plugin iqm 1.2 has failed: index 7 is out of range");
    /// ```
    pub fn new(manifest: &Manifest, text: &str) -> PluginPanic {
        let Manifest { name, version, .. } = manifest;
        PluginPanic { plugin: name.clone(), version: version.clone(), text: text.into() }
    }

    /// Makes the error from the payload of a caught panic. A payload that already is a `PluginPanic` is returned as it is.
    fn caught(manifest: &Manifest, payload: &(dyn Any + Send)) -> PluginPanic {
        let known = payload.downcast_ref::<PluginPanic>().cloned();
        known.unwrap_or_else(|| PluginPanic::new(manifest, panic_text(payload)))
    }
}

/// The message of a panic.
fn panic_text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or(payload.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

/// The call's result, or its panic.
fn isolated<T>(manifest: &Manifest, call: impl FnOnce() -> T) -> Result<T, PluginPanic> {
    catch_unwind(AssertUnwindSafe(call)).map_err(|payload| PluginPanic::caught(manifest, &*payload))
}

/// An importer whose panics and faulty assets become import errors. Its assets name the importer in their origin.
pub(crate) struct IsolatedImporter(pub Arc<dyn Importer>);

impl Importer for IsolatedImporter {
    fn manifest(&self) -> &Manifest {
        self.0.manifest()
    }

    /// A claim that fails counts as [`Claim::NotMine`].
    fn claim(&self, source: &Source) -> Claim {
        self.checked_claim(source).unwrap_or(Claim::NotMine)
    }

    fn checked_claim(&self, source: &Source) -> Result<Claim, PluginPanic> {
        isolated(self.manifest(), || self.0.checked_claim(source))?
    }

    fn file(&self) -> Option<&PluginFile> {
        self.0.file()
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let manifest = self.manifest();
        let fault = |place: String, what: String| ImportError {
            file: source.name.clone(),
            place,
            what,
            hint: Some("this is a fault of the plugin; please report it to its author with the file".into()),
        };
        let imported = isolated(manifest, || self.0.import(source, files, needs, options));
        let mut asset = imported.unwrap_or_else(|panic| Err(fault(String::new(), panic.to_string())))?;
        asset.origin.importer = manifest.to_string();
        checked(asset, needs).map_err(|AssetFault { place, what }| {
            let Manifest { name, version, .. } = manifest;
            fault(place, format!("the plugin {name} {version} has returned a faulty asset: {what}"))
        })
    }
}

/// An importer of a file that other importers have failed to claim. It adds a warning about each of them to its assets.
pub(crate) struct ImporterWithClaimWarnings {
    pub importer: Arc<dyn Importer>,
    pub failures: Vec<PluginPanic>,
}

/// A sentence about the failure of a claim.
pub(crate) fn failed_claim(panic: &PluginPanic) -> String {
    format!("{panic} (while it checked whether it can read the file; the other importers were tried)")
}

impl Importer for ImporterWithClaimWarnings {
    fn manifest(&self) -> &Manifest {
        self.importer.manifest()
    }

    fn claim(&self, source: &Source) -> Claim {
        self.importer.claim(source)
    }

    fn file(&self) -> Option<&PluginFile> {
        self.importer.file()
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let mut asset = self.importer.import(source, files, needs, options)?;
        let warning = |panic| Warning { place: String::new(), text: failed_claim(panic) };
        asset.warnings.extend(self.failures.iter().map(warning));
        Ok(asset)
    }
}

/// An exporter whose panics are export errors.
pub(crate) struct IsolatedExporter(pub Arc<dyn Exporter>);

impl IsolatedExporter {
    fn call<T>(&self, call: impl FnOnce(&dyn Exporter) -> Result<T, ExportError>) -> Result<T, ExportError> {
        isolated(self.0.manifest(), || call(&*self.0))?
    }

    fn sink(&self, sink: Box<dyn FrameSink>) -> Box<dyn FrameSink> {
        Box::new(IsolatedSink { exporter: self.0.clone(), sink })
    }
}

impl Exporter for IsolatedExporter {
    fn manifest(&self) -> &Manifest {
        self.0.manifest()
    }

    fn one_frame_per_file(&self) -> bool {
        self.0.one_frame_per_file()
    }

    fn wish(&self, options: &ExportOptions) -> Result<FrameWish, ExportError> {
        self.call(|exporter| exporter.wish(options))
    }

    fn notes(&self, info: &VideoInfo) -> Vec<String> {
        isolated(self.manifest(), || self.0.notes(info)).unwrap_or_else(|panic| vec![panic.to_string()])
    }

    fn head_comes_last(&self) -> bool {
        self.0.head_comes_last()
    }

    fn begin(&self, info: &VideoInfo, out: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
        self.call(|exporter| exporter.begin(info, out)).map(|sink| self.sink(sink))
    }

    fn with_provenance(
        &self,
        info: &VideoInfo,
        made: &[u8],
        out: Box<dyn Write + Send>,
    ) -> Result<bool, ExportError> {
        self.call(|exporter| exporter.with_provenance(info, made, out))
    }

    fn piece(&self, info: &VideoInfo) -> Option<NonZeroU64> {
        // A panic here makes a file without pieces; the next call reports it.
        isolated(self.manifest(), || self.0.piece(info)).unwrap_or_default()
    }

    fn resume(
        &self,
        info: &VideoInfo,
        states: &[Vec<u8>],
        so_far: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        self.call(|exporter| exporter.resume(info, states, so_far, out)).map(|sink| self.sink(sink))
    }
}

/// A file that an isolated exporter writes.
struct IsolatedSink {
    exporter: Arc<dyn Exporter>,
    sink: Box<dyn FrameSink>,
}

impl FrameSink for IsolatedSink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        isolated(self.exporter.manifest(), || self.sink.frame(frame))?
    }

    fn float_frame(&mut self, frame: &FloatFrame) -> Result<(), ExportError> {
        isolated(self.exporter.manifest(), || self.sink.float_frame(frame))?
    }

    fn repeat(&mut self, frame: &Frame) -> Result<(), ExportError> {
        isolated(self.exporter.manifest(), || self.sink.repeat(frame))?
    }

    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        let IsolatedSink { exporter, sink } = *self;
        isolated(exporter.manifest(), || sink.finish())?
    }

    fn mark(&mut self) -> Mark<'_> {
        isolated(self.exporter.manifest(), || self.sink.mark()).unwrap_or(Mark::Nothing)
    }

    fn again(&mut self, kept: &[u8]) -> Result<(), ExportError> {
        isolated(self.exporter.manifest(), || self.sink.again(kept))?
    }
}

/// A scene exporter whose panics are export errors.
pub(crate) struct IsolatedSceneExporter(pub Arc<dyn SceneExporter>);

impl SceneExporter for IsolatedSceneExporter {
    fn manifest(&self) -> &Manifest {
        self.0.manifest()
    }

    fn file(&self) -> Option<&PluginFile> {
        self.0.file()
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        isolated(self.manifest(), || self.0.export(scene, files))?
    }
}

/// Isolates an effect: its panics continue as [`PluginPanic`].
pub(crate) fn isolated_effect(effect: Effect) -> Effect {
    match effect {
        Effect::Pixel(effect) => Effect::Pixel(Arc::new(Isolated(effect))),
        Effect::Image(effect) => Effect::Image(Arc::new(Isolated(effect))),
        Effect::Surface(effect) => Effect::Surface(Arc::new(Isolated(effect))),
        Effect::Vertex(effect) => Effect::Vertex(Arc::new(Isolated(effect))),
        Effect::Lighting(effect) => Effect::Lighting(Arc::new(Isolated(effect))),
        Effect::Outline(effect) => Effect::Outline(Arc::new(Isolated(effect))),
        Effect::Overlay(effect) => Effect::Overlay(Arc::new(Isolated(effect))),
        Effect::Shutter(effect) => Effect::Shutter(Arc::new(Isolated(effect))),
    }
}

/// A plugin each of whose calls is isolated.
struct Isolated<T: ?Sized>(Arc<T>);

impl<T: EffectPlugin + ?Sized> Isolated<T> {
    fn call<'a, R>(&'a self, call: impl FnOnce(&'a T) -> R) -> R {
        isolated(self.0.manifest(), || call(&self.0)).unwrap_or_else(|panic| resume_unwind(Box::new(panic)))
    }
}

/// Implements methods that forward their arguments to the isolated plugin.
macro_rules! forward {
    ($(fn $name:ident(&self $(, $argument:ident: $type:ty)* $(,)?) $(-> $result:ty)?;)*) => {
        $(fn $name(&self $(, $argument: $type)*) $(-> $result)? {
            self.call(|effect| effect.$name($($argument),*))
        })*
    };
}

impl<T: EffectPlugin + ?Sized> EffectPlugin for Isolated<T> {
    fn manifest(&self) -> &Manifest {
        self.0.manifest()
    }
    forward! {
        fn file(&self) -> Option<&PluginFile>;
        fn off(&self, parameters: &[f32]) -> Option<String>;
        fn loops(&self) -> &[String];
    }
}

impl<T: EffectShader + ?Sized> EffectShader for Isolated<T> {
    forward! {
        fn wgsl(&self) -> &str;
        fn reads_frame(&self) -> bool;
        fn textures(&self) -> &[EffectTexture];
        fn with_images(&self, name: &str, images: &[EffectTexture]) -> Option<Effect>;
    }
}

impl PixelEffect for Isolated<dyn PixelEffect> {
    forward! {
        fn view_order(&self) -> ViewOrder;
        fn pixels(&self, colors: &mut [Vec4], uv: &[Vec2], parameters: &[f32]);
    }
}

impl ImageEffect for Isolated<dyn ImageEffect> {
    forward! {
        fn view_order(&self) -> ViewOrder;
        fn passes(&self) -> u32;
        fn named_passes(&self) -> &[ImagePass];
        fn shrink(&self, pass_number: u32, size: [u32; 2], parameters: &[f32]) -> u32;
        fn history(&self, parameters: &[f32]) -> u32;
        fn scene_inputs(&self) -> SceneInputs;
        fn image_row(
            &self,
            images: &EffectImages,
            y: u32,
            pass_number: u32,
            parameters: &[f32],
            row: &mut [Vec4],
        );
    }
}

impl SurfaceEffect for Isolated<dyn SurfaceEffect> {
    forward! {
        fn surface_inputs(&self, parameters: &[f32]) -> SurfaceInputs;
        fn changes_background(&self, parameters: &[f32]) -> bool;
        fn surfaces(&self, colors: &mut [Vec4], samples: &[SurfaceSample], parameters: &[f32]);
    }
}

impl VertexEffect for Isolated<dyn VertexEffect> {
    forward! {
        fn surface_inputs(&self, parameters: &[f32]) -> SurfaceInputs;
        fn reach(&self, parameters: &[f32]) -> f32;
        fn in_model_space(&self) -> bool;
        fn vertex(&self, sample: &VertexSample, parameters: &[f32]) -> Vec3;
    }
}

impl LightingEffect for Isolated<dyn LightingEffect> {
    forward! {
        fn surface_inputs(&self, parameters: &[f32]) -> SurfaceInputs;
        fn lights(&self, samples: &mut [LightSample], parameters: &[f32]);
    }
}

impl OutlineEffect for Isolated<dyn OutlineEffect> {
    forward! {
        fn inverted_hull(&self, parameters: &[f32]) -> Option<InvertedHull>;
        fn wireframe(&self, parameters: &[f32]) -> Option<Vec3>;
    }
}

impl OverlayEffect for Isolated<dyn OverlayEffect> {
    forward! {
        fn applies_to_actors(&self) -> bool;
        fn history(&self, parameters: &[f32]) -> u32;
        fn overlay(&self, scene: &EffectScene, parameters: &[f32]) -> Overlay;
    }
}

impl ShutterEffect for Isolated<dyn ShutterEffect> {
    forward! {
        fn shutter(&self, parameters: &[f32]) -> Option<Shutter>;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MemoryFiles, Registry};

    /// A plugin that fails in every call that can fail.
    struct Faulty(Manifest);

    impl Importer for Faulty {
        fn manifest(&self) -> &Manifest {
            &self.0
        }
        fn claim(&self, source: &Source) -> Claim {
            assert!(source.name != "claim.x", "no such claim");
            self.0.claim(source)
        }
        fn import(
            &self,
            _: &Source,
            _: &dyn Files,
            _: ImportScope,
            _: &ImportOptions,
        ) -> Result<Asset, ImportError> {
            panic!("index {} is out of range", 7)
        }
    }

    impl Exporter for Faulty {
        fn manifest(&self) -> &Manifest {
            &self.0
        }
        fn one_frame_per_file(&self) -> bool {
            false
        }
        fn begin(&self, _: &VideoInfo, _: Box<dyn Write + Send>) -> Result<Box<dyn FrameSink>, ExportError> {
            Ok(Box::new(FaultySink))
        }
    }

    struct FaultySink;

    impl FrameSink for FaultySink {
        fn frame(&mut self, _: &Frame) -> Result<(), ExportError> {
            panic!("no such color")
        }
        fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
            panic!("not finished")
        }
    }

    impl EffectPlugin for Faulty {
        fn manifest(&self) -> &Manifest {
            &self.0
        }
    }

    impl ShutterEffect for Faulty {
        fn shutter(&self, _: &[f32]) -> Option<Shutter> {
            panic!("no shutter")
        }
    }

    impl SceneExporter for Faulty {
        fn manifest(&self) -> &Manifest {
            &self.0
        }
        fn export(&self, _: &ExportedScene, _: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
            panic!("no such actor")
        }
    }

    struct NoFiles;

    impl Files for NoFiles {
        fn read(&self, name: &str) -> Result<Arc<Vec<u8>>, String> {
            Err(format!("no file {name}"))
        }
    }

    fn faulty() -> Faulty {
        Faulty(Manifest::new("faulty", "1.2", "fails").extensions(["x"]))
    }

    /// Reads every file.
    struct Good(Manifest);

    impl Importer for Good {
        fn manifest(&self) -> &Manifest {
            &self.0
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

    #[test]
    fn a_panic_of_a_claim_is_reported_and_another_importer_reads_the_file() {
        let mut registry = Registry::default();
        registry.add_importer(faulty());
        let source = Source { name: "claim.x".into(), bytes: Arc::default() };
        let import = |registry: &Registry| {
            registry.import(&source, &NoFiles, ImportScope::ALL, &ImportOptions::default(), None)
        };
        let panic = "the plugin faulty 1.2 has failed: no such claim";
        assert_eq!(
            registry.failed_claims(&source).iter().map(ToString::to_string).collect::<Vec<_>>(),
            [panic]
        );
        let error = import(&registry).err().unwrap();
        assert!(
            error
                .what
                .starts_with(&format!("no importer knows this kind of file; {panic} (while it checked")),
            "{error}"
        );
        registry.add_importer(Good(Manifest::new("good", "2", "reads").extensions(["x"])));
        let asset = import(&registry).unwrap();
        assert_eq!(asset.origin.importer, "good 2");
        assert_eq!(asset.warnings.len(), 1);
        assert!(asset.warnings[0].text.starts_with(panic), "{:?}", asset.warnings);
        // The claim fails for that file alone.
        let other = Source { name: "a.x".into(), ..source };
        assert!(registry.failed_claims(&other).is_empty());
        assert_eq!(registry.importer_for(&other, None).unwrap().manifest().name, "good");
    }

    #[test]
    fn panics_of_plugins_are_errors_with_their_names() {
        let mut registry = Registry::default();
        registry.add_importer(faulty());
        registry.add_exporter(faulty());
        registry.add_effect(Effect::shutter(faulty()));
        registry.add_scene_exporter(faulty());
        let source = Source { name: "a.x".into(), bytes: Arc::default() };
        let error =
            registry.import(&source, &NoFiles, ImportScope::ALL, &ImportOptions::default(), None).err();
        let text = error.map(|e| e.what).unwrap_or_default();
        assert_eq!(text, "the plugin faulty 1.2 has failed: index 7 is out of range");
        let info = VideoInfo {
            width: 1,
            height: 1,
            fps: choreo_motion::FrameRate { num: 30, den: 1 },
            frames: 1,
            provenance: Vec::new(),
            options: Default::default(),
        };
        let exporter = registry.exporter_for("a.x").unwrap();
        let mut sink = exporter.begin(&info, Box::new(Vec::new())).unwrap();
        let frame = Frame { width: 1, height: 1, rgba: vec![0; 4] };
        let failed = |result: Result<(), ExportError>| result.err().unwrap().to_string();
        assert_eq!(failed(sink.frame(&frame)), "the plugin faulty 1.2 has failed: no such color");
        assert_eq!(failed(sink.finish().map(drop)), "the plugin faulty 1.2 has failed: not finished");
        let scene = ExportedScene::new("a.rhai", Arc::default());
        let exported =
            registry.scene_exporter_for("a.X").unwrap().export(&scene, &mut MemoryFiles::default());
        assert_eq!(failed(exported.map(drop)), "the plugin faulty 1.2 has failed: no such actor");
        let Some(Effect::Shutter(effect)) = registry.effect("faulty") else { panic!("the effect is there") };
        let panic = catch_unwind(AssertUnwindSafe(|| effect.shutter(&[0.0; 8]))).unwrap_err();
        let panic = panic.downcast_ref::<PluginPanic>().unwrap().to_string();
        assert_eq!(panic, "the plugin faulty 1.2 has failed: no shutter");
    }
}
