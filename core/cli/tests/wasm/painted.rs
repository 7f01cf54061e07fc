//! Importer of `.painted`: the name of a PNG file, which is painted on a square.

use choreo_plugin::asset::{
    Asset, Image, ImageFile, ImageFileFormat, Material, Sampler, Shading, TextureRef,
};
use choreo_plugin::glam::Affine2;
use choreo_plugin::{
    AssetBuilder, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, MeshData, Source,
};
use std::io::Cursor;
use std::sync::{Arc, LazyLock};

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new("painted", env!("CARGO_PKG_VERSION"), "a picture on a square").extensions(["painted"])
});

#[derive(Clone, Copy, Debug, Default)]
pub struct PaintedImporter;

choreo_plugin::wasm_importer!(PaintedImporter);

impl Importer for PaintedImporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        _: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let error =
            |what: String| ImportError { file: source.name.clone(), place: String::new(), what, hint: None };
        let name = String::from_utf8_lossy(&source.bytes).trim().to_string();
        let mut builder = AssetBuilder::default();
        let mut material = Material { name: name.clone(), shading: Shading::Unlit, ..Material::default() };
        if needs.textures {
            let bytes = files.read(&name).map_err(error)?;
            let mut image = decode_png(&name, &bytes).map_err(|e| error(format!("{name}: {e}")))?;
            image.file = needs.image_files.then_some(ImageFile { format: ImageFileFormat::Png, bytes });
            let image = builder.decoded_image(Arc::new(image));
            let uv_transform = Affine2::IDENTITY;
            let texture = TextureRef { image, sampler: Sampler::default(), uv_set: 0, uv_transform };
            material.base_color_texture = Some(texture);
        }
        let material = builder.material(material).map_err(|e| error(e.to_string()))?;
        let square = MeshData {
            positions: vec![-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 0.0, -1.0, 2.0, 0.0],
            uvs: vec![0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
            indices: vec![0, 1, 2, 0, 2, 3],
            material: Some(material),
            ..MeshData::default()
        };
        builder.mesh(square).map_err(|e| error(e.to_string()))?;
        builder.finish(&source.name).map_err(|e| error(e.to_string()))
    }
}

/// A PNG of 8 bits a channel with alpha.
fn decode_png(name: &str, bytes: &[u8]) -> Result<Image, String> {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().map_err(|e| e.to_string())?;
    let mut rgba = vec![0; reader.output_buffer_size().ok_or("it is too large")?];
    let frame = reader.next_frame(&mut rgba).map_err(|e| e.to_string())?;
    match (frame.color_type, frame.bit_depth) {
        (png::ColorType::Rgba, png::BitDepth::Eight) => {
            Ok(Image { name: name.into(), width: frame.width, height: frame.height, rgba, file: None })
        }
        other => Err(format!("{other:?} is not supported")),
    }
}
