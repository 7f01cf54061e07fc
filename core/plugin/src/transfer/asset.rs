//! Assets as bytes. Skeletons and clips are rebuilt by constructors that check them; everything else is checked after the import, as the
//! asset of any importer.

use super::{Bytes, Result, Transfer, Written, fields, variants};
use choreo_asset::{
    AlphaMode, Asset, AssetCamera, AssetLight, FrameStrip, Image, ImageFile, ImageFileFormat, Light,
    LightKind, LineStyle, Material, MaterialLayers, Mesh, MeshInstance, MorphTarget, Origin, Outline,
    Primitive, Projection, Reflection, Sampler, Shading, Skin, TextureRef, Toon, Topology, Triplanar,
    UvMotion, Warning, Wrap,
};
use choreo_motion::{Clip, Curve, Interpolation, Path, Skeleton, Time, Transform};
use glam::{Affine2, Affine3A, DAffine3};
use std::sync::Arc;

/// Name of a part that the asset has and its bytes leave out: expressions, springs, gaze, placements, image sequences, a humanoid, or clips
/// that move expressions or properties. `None` if nothing is left out.
pub fn missing_parts(asset: &Asset) -> Option<&'static str> {
    let clips = || asset.clips.iter();
    let missing = [
        ("expressions", !asset.expressions.is_empty()),
        ("springs", !asset.springs.is_empty()),
        ("eyes", asset.eyes.is_some()),
        ("a front", asset.front.is_some()),
        ("placements", !asset.placements.is_empty()),
        ("a humanoid", asset.skeleton.humanoid().is_some()),
        ("an image sequence", asset.materials.iter().any(|m| m.sequence.is_some())),
        ("a clip of expressions", clips().any(|clip| !clip.expressions().is_empty())),
        ("a clip of properties", clips().any(|clip| clip.properties().len() > 0)),
    ];
    missing.into_iter().find(|(_, there)| *there).map(|(part, _)| part)
}

/// An asset that was read must still be checked as a whole.
impl Transfer for Asset {
    fn write(&self, out: &mut Written) {
        self.name.write(out);
        String::write_list(self.skeleton.names(), out);
        Option::write_list(self.skeleton.parents(), out);
        Transform::write_list(self.skeleton.rest(), out);
        self.meshes.write(out);
        self.skins.write(out);
        self.instances.write(out);
        self.materials.write(out);
        self.images.write(out);
        self.cameras.write(out);
        self.lights.write(out);
        self.clips.len().write(out);
        for clip in &self.clips {
            clip.name.write(out);
            clip.duration.write(out);
            Curve::write_list(clip.curves(), out);
        }
        self.origin.write(out);
        self.warnings.write(out);
    }

    fn read(from: &mut Bytes<'_>) -> Result<Asset> {
        let name = String::read(from)?;
        let (names, parents, rest): (Vec<String>, Vec<Option<u32>>, Vec<Transform>) =
            (Transfer::read(from)?, Transfer::read(from)?, Transfer::read(from)?);
        let skeleton = Skeleton::new(names, parents, rest).map_err(|e| from.error(e.to_string()))?;
        let mut asset = Asset {
            name,
            meshes: Transfer::read(from)?,
            skins: Transfer::read(from)?,
            instances: Transfer::read(from)?,
            materials: Transfer::read(from)?,
            images: Transfer::read(from)?,
            cameras: Transfer::read(from)?,
            lights: Transfer::read(from)?,
            ..Asset::default()
        };
        let count = usize::read(from)?;
        for _ in 0..count {
            let (name, duration) = (String::read(from)?, Time::read(from)?);
            let curves = Vec::<Curve>::read(from)?;
            let clip = Clip::new(name.clone(), skeleton.len(), curves);
            let mut clip = clip.map_err(|e| from.error(format!("clip \"{name}\": {e}")))?;
            // A clip may be longer than its keys.
            clip.duration = clip.duration.max(duration);
            asset.clips.push(Arc::new(clip));
        }
        asset.origin = Transfer::read(from)?;
        asset.warnings = Transfer::read(from)?;
        asset.skeleton = Arc::new(skeleton);
        Ok(asset)
    }
}

impl Transfer for Time {
    fn write(&self, out: &mut Written) {
        self.0.write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<Time> {
        Ok(Time(Transfer::read(from)?))
    }
}

impl Transfer for Affine2 {
    fn write(&self, out: &mut Written) {
        self.to_cols_array().write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<Affine2> {
        Ok(Affine2::from_cols_array(&Transfer::read(from)?))
    }
}

impl Transfer for DAffine3 {
    fn write(&self, out: &mut Written) {
        self.to_cols_array().write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<DAffine3> {
        Ok(DAffine3::from_cols_array(&Transfer::read(from)?))
    }
}

impl Transfer for Affine3A {
    fn write(&self, out: &mut Written) {
        self.to_cols_array().write(out);
    }
    fn read(from: &mut Bytes<'_>) -> Result<Affine3A> {
        Ok(Affine3A::from_cols_array(&Transfer::read(from)?))
    }
}

fields! {
    Transform { translation, rotation, scale }
    Mesh { name, primitives, morph_targets, morph_names }
    Primitive { topology, indices, positions, normals, tangents, uvs, colors, influences, joint_indices, joint_weights, morphs, material }
    MorphTarget { positions, normals, tangents }
    Skin { joints, inverse_bind }
    MeshInstance { joint, mesh, skin, weights, copies }
    Image { name, width, height, rgba, file }
    ImageFile { format, bytes }
    AssetCamera { name, joint, projection }
    AssetLight { name, joint, light }
    Light { kind, color, intensity, range }
    Warning { place, text }
    Origin { format, importer, writer, metres_per_unit, unit_is_assumed, up, about }
    Curve { joint, path, interpolation, times, values }
    TextureRef { image, sampler, uv_set, uv_transform }
    Sampler { wrap_u, wrap_v, mag_linear, min_linear, mip_linear }
    LineStyle { width, metres, round }
    Triplanar { middle, size, sharpness }
    FrameStrip { columns, rows, count, fps, once }
    UvMotion { scroll, rotation }
    Reflection { color, texture, environment }
    MaterialLayers {
        clearcoat, clearcoat_texture, clearcoat_roughness, clearcoat_roughness_texture, clearcoat_normal_texture, clearcoat_normal_scale,
        sheen_color, sheen_color_texture, sheen_roughness, sheen_roughness_texture, transmission, transmission_texture, thickness,
        thickness_texture, ior, dispersion, attenuation_distance, attenuation_color, iridescence, iridescence_texture, iridescence_ior,
        iridescence_thickness, iridescence_thickness_texture, anisotropy, anisotropy_rotation, anisotropy_texture, diffuse_transmission,
        diffuse_transmission_texture, diffuse_transmission_color, diffuse_transmission_color_texture,
    }
    Material {
        name, shading, base_color, base_color_texture, metallic, roughness, metallic_roughness_texture, normal_texture, normal_scale,
        relief, occlusion_texture, occlusion_strength, emissive, emissive_texture, specular, specular_texture, specular_color,
        specular_color_texture, shininess, reflection, toon, alpha_mode, double_sided, uv_motion, flipbook, layers, line_style,
        triplanar; without sequence
    }
    Outline { width, on_screen, width_texture, color, lighting_mix }
    Toon {
        shade_color, shade_texture, shading_shift, shading_shift_texture, shading_shift_scale, shading_toony, gi_equalization, matcap,
        matcap_texture, rim_color, rim_fresnel_power, rim_lift, rim_texture, rim_lighting_mix, outline, uv_motion, uv_mask, uv_moved,
    }
}

variants! {
    Topology { 0 Triangles, 1 Lines, 2 Points }
    Interpolation { 0 Step, 1 Linear, 2 CubicSpline }
    Path { 0 Translation, 1 Rotation, 2 Scale, 3 Weights(count) }
    Wrap { 0 Repeat, 1 MirroredRepeat, 2 ClampToEdge }
    Shading { 0 MetallicRoughness, 1 BlinnPhong, 2 Phong, 3 Unlit, 4 Toon }
    AlphaMode { 0 Opaque, 1 Mask(cutoff), 2 Blend }
    Projection { 0 Perspective { yfov, near, far }, 1 Orthographic { height, near, far } }
    ImageFileFormat { 0 Png, 1 Jpeg, 2 WebP }
}

impl Transfer for LightKind {
    fn write(&self, out: &mut Written) {
        let (number, parameters) = self.numbered();
        number.write(out);
        parameters.iter().for_each(|parameter| parameter.write(out));
    }
    fn read(from: &mut Bytes<'_>) -> Result<LightKind> {
        let number = u8::read(from)?;
        let kind = LightKind::ALL.get(usize::from(number)).copied();
        let mut kind = kind.ok_or_else(|| from.error(format!("LightKind has no variant {number}")))?;
        for parameter in kind.parameters_mut() {
            *parameter = f32::read(from)?;
        }
        Ok(kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::{from_bytes, to_bytes};

    #[test]
    fn an_image_arrives_with_its_file() {
        let file = ImageFile { format: ImageFileFormat::Jpeg, bytes: Arc::new(vec![0xff, 0xd8]) };
        let image =
            Image { name: "i".into(), width: 1, height: 1, rgba: vec![9, 8, 7, 255], file: Some(file) };
        for image in [image.clone(), Image { file: None, ..image }] {
            let arrived: Image = from_bytes(&to_bytes(&image)).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(arrived, image);
        }
    }
}
