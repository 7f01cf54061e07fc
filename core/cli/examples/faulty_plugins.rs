//! The program choreo with an importer, an exporter and an effect that panic; run by `tests/plugins/faulty_plugins.rs`.

use choreo_asset::Asset;
use choreo_plugin::{
    Claim, Effect, EffectPlugin, EffectScene, ExportError, Exporter, Files, Frame, FrameSink, ImportError,
    ImportOptions, ImportScope, Importer, Manifest, Overlay, OverlayEffect, Source, VideoInfo,
};
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut app = choreo::app();
    let manifest = || Manifest::new("faulty", "1.2", "panics").extensions(["faulty"]);
    app.registry.add_importer(Faulty(manifest()));
    app.registry.add_exporter(Faulty(manifest()));
    app.registry.add_effect(Effect::overlay(Faulty(manifest())));
    choreo::run(std::env::args_os(), &app)
}

struct Faulty(Manifest);

impl Importer for Faulty {
    fn manifest(&self) -> &Manifest {
        &self.0
    }

    /// Panics for empty files of any format.
    fn claim(&self, source: &Source) -> Claim {
        match source.bytes.len() {
            0 => panic!("no first byte"),
            _ => self.0.claim(source),
        }
    }

    fn import(
        &self,
        source: &Source,
        _: &dyn Files,
        _: ImportScope,
        _: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        panic!("{} has no header", source.name)
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
        Ok(Box::new(FaultySink(0)))
    }
}

/// Panics at the third frame.
struct FaultySink(u32);

impl FrameSink for FaultySink {
    fn frame(&mut self, _: &Frame) -> Result<(), ExportError> {
        self.0 += 1;
        assert!(self.0 < 3, "three frames are too many");
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        Ok(Vec::new())
    }
}

impl EffectPlugin for Faulty {
    fn manifest(&self) -> &Manifest {
        &self.0
    }
}

impl OverlayEffect for Faulty {
    fn overlay(&self, _: &EffectScene, _: &[f32]) -> Overlay {
        panic!("nothing to draw")
    }
}
