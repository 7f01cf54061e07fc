//! KHR_materials_pbrSpecularGlossiness: glossiness that varies over a texture becomes a roughness texture.

use choreo_asset::{Image, Material, TextureRef};
use std::sync::Arc;

/// A material with a specular-glossiness texture, now its specular color texture, whose alpha channel holds glossiness.
pub(crate) struct Glossy {
    pub material: usize,
    pub factor: f32,
}

/// Adds roughness textures to the materials, one for each distinct texture and factor. Needs the decoded images.
pub(crate) fn convert(glossy: &[Glossy], materials: &mut [Material], images: &mut Vec<Arc<Image>>) {
    let mut made: Vec<(u32, f32, u32)> = Vec::new();
    for Glossy { material, factor } in glossy {
        let Some(material) = materials.get_mut(*material) else { continue };
        let Some(of) = &material.specular_color_texture else { continue };
        let Some(source) = images.get(of.image as usize).cloned() else { continue };
        if source.rgba.as_chunks::<4>().0.iter().all(|p| p[3] == 255) {
            continue;
        }
        let known = made.iter().find(|(image, f, _)| (*image, *f) == (of.image, *factor));
        let image = known.map(|(_, _, image)| *image).unwrap_or_else(|| {
            let rough = Image {
                name: format!("{} roughness", source.name),
                rgba: source.rgba.as_chunks::<4>().0.iter().flat_map(|p| roughness(p[3], *factor)).collect(),
                width: source.width,
                height: source.height,
                file: None,
            };
            images.push(Arc::new(rough));
            made.push((of.image, *factor, images.len() as u32 - 1));
            images.len() as u32 - 1
        });
        material.roughness = 1.0;
        material.metallic_roughness_texture = Some(TextureRef { image, ..of.clone() });
    }
}

/// A texel of a metallic-roughness texture: roughness = 1 − glossiness in G, metalness 0 in B.
fn roughness(alpha: u8, factor: f32) -> [u8; 4] {
    let glossiness = f32::from(alpha) / 255.0 * factor;
    [0, ((1.0 - glossiness).clamp(0.0, 1.0) * 255.0 + 0.5) as u8, 0, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glossiness_is_one_minus_roughness() {
        let image = Image {
            name: "sg".into(),
            width: 2,
            height: 1,
            rgba: vec![9, 9, 9, 255, 9, 9, 9, 51],
            file: None,
        };
        let texture = TextureRef {
            image: 0,
            sampler: Default::default(),
            uv_set: 0,
            uv_transform: glam::Affine2::IDENTITY,
        };
        let material = Material { specular_color_texture: Some(texture), ..Material::default() };
        let mut materials = vec![material.clone(), material];
        let mut images = vec![Arc::new(image)];
        let glossy = [Glossy { material: 0, factor: 0.5 }, Glossy { material: 1, factor: 0.5 }];
        convert(&glossy, &mut materials, &mut images);
        assert_eq!(images.len(), 2, "equal ones once");
        // 1 − 0.5 and 1 − 0.5 · 0.2.
        assert_eq!(images[1].rgba, [0, 128, 0, 255, 0, 230, 0, 255]);
        let made = materials[1].metallic_roughness_texture.as_ref().unwrap();
        assert_eq!((made.image, materials[1].roughness), (1, 1.0));
        // A texture with constant glossiness (alpha 255) adds no image.
        let mut images =
            vec![Arc::new(Image { rgba: vec![255; 8], width: 2, height: 1, ..Image::default() })];
        convert(&glossy, &mut materials, &mut images);
        assert_eq!(images.len(), 1);
    }
}
