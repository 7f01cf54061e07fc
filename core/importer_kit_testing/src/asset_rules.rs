//! Checks of any asset against the rules in the doc comments of `Asset`.

use choreo_asset::{Asset, Topology};

/// Panics with `name` if the asset breaks a rule.
pub fn check(name: &str, asset: &Asset) {
    let joints = asset.skeleton.len() as u32;
    for mesh in &asset.meshes {
        for p in &mesh.primitives {
            let n = p.positions.len();
            assert!(p.indices.iter().all(|i| (*i as usize) < n), "{name}: index out of range");
            assert!(p.positions.iter().all(|v| v.is_finite()), "{name}: position not finite");
            let lens = [p.normals.len(), p.tangents.len(), p.uvs[0].len(), p.uvs[1].len(), p.colors.len()];
            assert!(lens.iter().all(|l| *l == 0 || *l == n), "{name}: {lens:?} for {n}");
            if p.topology == Topology::Triangles {
                assert_eq!(p.normals.len(), n, "{name}: normals");
                assert_eq!(p.indices.len() % 3, 0, "{name}");
            }
            assert!(p.normals.iter().all(|v| (v.length() - 1.0).abs() < 1e-4), "{name}: normal not unit");
            assert!(p.uvs.iter().flatten().all(|v| v.is_finite()), "{name}: uv not finite");
            let unit = |t: &glam::Vec4| (t.truncate().length() - 1.0).abs() < 1e-4 && t.w.abs() == 1.0;
            assert!(p.tangents.iter().all(unit), "{name}: tangent not unit");
            assert_eq!(p.joint_indices.len(), n * p.influences, "{name}");
            assert_eq!(p.joint_weights.len(), n * p.influences, "{name}");
            for w in p.joint_weights.chunks_exact(p.influences.max(1)) {
                assert!((w.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{name}: weights {w:?}");
            }
            assert_eq!(p.morphs.len(), mesh.morph_targets, "{name}");
            assert!(p.material.is_none_or(|m| (m as usize) < asset.materials.len()), "{name}: material");
        }
        assert_eq!(mesh.morph_names.len(), mesh.morph_targets, "{name}");
    }
    for instance in &asset.instances {
        assert!(instance.joint < joints, "{name}");
        let mesh = &asset.meshes[instance.mesh as usize];
        assert_eq!(instance.weights.len(), mesh.morph_targets, "{name}");
        if let Some(skin) = instance.skin {
            let skin = &asset.skins[skin as usize];
            assert_eq!(skin.joints.len(), skin.inverse_bind.len(), "{name}");
            assert!(skin.joints.iter().all(|j| *j < joints), "{name}");
            let most = mesh.primitives.iter().flat_map(|p| p.joint_indices.iter()).max();
            assert!(most.is_none_or(|j| usize::from(*j) < skin.joints.len()), "{name}");
        }
    }
    for skin in &asset.skins {
        assert!(skin.inverse_bind.iter().all(|m| m.is_finite()), "{name}: bind matrix");
    }
    for material in &asset.materials {
        let textures = [
            &material.base_color_texture,
            &material.metallic_roughness_texture,
            &material.normal_texture,
            &material.occlusion_texture,
            &material.emissive_texture,
            &material.specular_texture,
            &material.specular_color_texture,
        ];
        let toon = material.toon.iter().flat_map(|t| t.textures());
        let mirrors = material.reflection.iter().flat_map(|r| [&r.texture, &r.environment]);
        for t in textures.into_iter().chain(toon).chain(mirrors).flatten() {
            assert!((t.image as usize) < asset.images.len() && t.uv_set < 2, "{name}: texture");
            assert!(t.uv_transform.is_finite(), "{name}");
        }
        assert!(material.base_color.is_finite() && material.emissive.is_finite(), "{name}: material");
    }
    for image in &asset.images {
        assert_eq!(image.rgba.len(), image.width as usize * image.height as usize * 4, "{name}");
    }
    assert!(asset.cameras.iter().all(|c| c.joint < joints), "{name}");
    assert!(asset.lights.iter().all(|l| l.joint < joints), "{name}");
    for bind in asset.expressions.iter().flat_map(|e| &e.morphs) {
        let instance = &asset.instances[bind.instance as usize];
        assert!(
            (bind.target as usize) < asset.meshes[instance.mesh as usize].morph_targets,
            "{name}: expression"
        );
        assert!(bind.weight.is_finite(), "{name}: expression");
    }
    assert_eq!(asset.springs.check(asset.skeleton.len()), Ok(()), "{name}");
    assert!(asset.clips.iter().all(|c| c.joint_count() == asset.skeleton.len()), "{name}");
}
