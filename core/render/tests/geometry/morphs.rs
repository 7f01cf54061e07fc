//! Morph buffers: their size depends on the number of vertices that the targets move.

use choreo_asset::{MorphTarget, Primitive};
use choreo_plugin::{Files, ImportOptions, ImportScope, Importer, Source};
use choreo_render::scene_resources::morph_buffers::{morphed_ranges, morphed_vertices};
use choreo_render::scene_resources::vertex_layout::{VertexLayout, pack, pack_morphs};
use glam::{Vec3, Vec3Swizzles};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A strip of 10,000 vertices at distinct positions, of which each target moves some.
fn strip(targets: &[&[(usize, Vec3)]]) -> Primitive {
    let count = 10_000;
    let positions: Vec<Vec3> = (0..count).map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.0)).collect();
    let target = |moves: &&[(usize, Vec3)]| {
        let mut positions = vec![Vec3::ZERO; count];
        moves.iter().for_each(|(i, by)| positions[*i] = *by);
        // The target changes normals with positions, and has no tangents.
        MorphTarget { normals: positions.iter().map(|p| p.yzx()).collect(), positions, tangents: Vec::new() }
    };
    Primitive {
        normals: vec![Vec3::Z; count],
        indices: (0..count as u32 - 2).flat_map(|i| [i, i + 1, i + 2]).collect(),
        morphs: targets.iter().map(target).collect(),
        positions,
        ..Primitive::default()
    }
}

fn words(bytes: &[u8]) -> Vec<[u32; 4]> {
    bytemuck::pod_collect_to_vec(bytes)
}

/// The offsets that a target adds to each vertex, computed as pose.wgsl does.
fn offsets_of_target(words: &[[u32; 4]], target: usize, vertices: usize, list: u32) -> Vec<Vec3> {
    let [first, count, begin, _] = words[target];
    let of = |index: u32| {
        let own = index.wrapping_sub(first);
        if own >= count {
            return Vec3::ZERO;
        }
        let [x, y, z, _] = words[(begin + own + list * count) as usize].map(f32::from_bits);
        Vec3::new(x, y, z)
    };
    (0..vertices as u32).map(of).collect()
}

fn check_offsets(p: &Primitive, bytes: &[u8]) {
    let layout = VertexLayout(0b11);
    let packed = pack(p, &p.indices, layout);
    let stride = layout.attributes().1 as usize;
    for (t, target) in p.morphs.iter().enumerate() {
        for (list, truth) in [&target.positions, &target.normals].into_iter().enumerate() {
            let got = offsets_of_target(&words(bytes), t, packed.vertex_count as usize, list as u32);
            for (at, vertex) in packed.vertices.chunks_exact(stride).enumerate() {
                // The position identifies the vertex.
                let x: f32 = bytemuck::pod_read_unaligned(&vertex[..4]);
                assert_eq!(got[at], truth[x as usize], "target {t}, list {list}, vertex {x}");
            }
        }
    }
}

#[test]
fn morph_buffers_hold_only_morphed_vertices() {
    let by = Vec3::new(0.0, 1.0, 2.0);
    let p = strip(&[&[(17, by), (5_000, -by), (9_998, by)], &[], &[(5_000, by)]]);
    let bytes = pack_morphs(&p, &p.indices, VertexLayout(0b11));
    // A word for each target; positions and normals of three, no and one vertex.
    assert_eq!(bytes.len(), 16 * (3 + 2 * (3 + 1)));
    assert_eq!(morphed_vertices(&p), 3);
    check_offsets(&p, &bytes);
    // Positions only.
    assert_eq!(pack_morphs(&p, &p.indices, VertexLayout(0b1)).len(), 16 * (3 + 3 + 1));
    // Ranges in the file's order of vertices, from the first to the last morphed one.
    let every: Vec<u32> = (0..10_000).collect();
    assert_eq!(morphed_ranges(&p, &every), [17..9_999, 0..0, 5_000..5_001]);
}

#[test]
fn overlapping_and_non_finite_morph_targets_are_packed_exactly() {
    let by = Vec3::X;
    let some: Vec<(usize, Vec3)> = (100..300).map(|i| (i, by * i as f32)).collect();
    let other: Vec<(usize, Vec3)> = (250..900).step_by(3).map(|i| (i, by)).collect();
    let p = strip(&[&some, &other, &[(0, Vec3::INFINITY)]]);
    let bytes = pack_morphs(&p, &p.indices, VertexLayout(0b11));
    check_offsets(&p, &bytes);
    let dense = 16 * 3 * 2 * 10_000;
    assert!(bytes.len() < dense / 40, "{}", bytes.len());
    let nan = strip(&[&[(3, Vec3::NAN)]]);
    assert_eq!(morphed_vertices(&nan), 1);
}

#[test]
#[should_panic(expected = "target 0, list 0, vertex 17")]
fn the_check_finds_a_missing_morphed_vertex() {
    let p = strip(&[&[(17, Vec3::Y), (40, Vec3::Y)]]);
    let mut words = words(&pack_morphs(&p, &p.indices, VertexLayout(0b11)));
    words[0][0] += 1;
    words[0][1] -= 1;
    check_offsets(&p, bytemuck::cast_slice(&words));
}

struct Alone;

impl Files for Alone {
    fn read(&self, relative: &str) -> Result<Arc<Vec<u8>>, String> {
        Err(format!("no {relative}"))
    }
}

/// Faces of sample files: the share of the dense buffers' size that is kept, and the share of vertices that move.
#[test]
fn morph_buffers_of_sample_faces_are_smaller_than_dense_ones() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets");
    let root = std::env::var_os("CHOREO_ASSETS").map_or(root, PathBuf::from);
    let files = [
        "vrm/Godette_vrm_v4.vrm",
        "vrm/cool_loops.vrm",
        "gltf/RobotExpressive.glb",
        "gltf/AnimatedMorphCube.glb",
    ];
    let layout = VertexLayout(0b11);
    for file in files {
        let Ok(bytes) = std::fs::read(root.join(file)) else {
            println!("SKIP 1: no {file} in {}", root.display());
            continue;
        };
        let source = Source { name: file.into(), bytes: Arc::new(bytes) };
        let asset = import_gltf::GltfImporter::new().import(
            &source,
            &Alone,
            ImportScope::ALL,
            &ImportOptions::default(),
        );
        let (mut dense, mut kept, mut moving) = (0, 0, 0);
        for p in asset.unwrap().meshes.iter().flat_map(|m| &m.primitives).filter(|p| !p.morphs.is_empty()) {
            let vertices = pack(p, &p.indices, layout).vertex_count as usize;
            dense += 2 * vertices * p.morphs.len();
            let bytes = pack_morphs(p, &p.indices, layout);
            kept += bytes.len() / 16 - p.morphs.len();
            let words = words(&bytes);
            for target in 0..p.morphs.len() {
                let [places, normals] = [0, 1].map(|list| offsets_of_target(&words, target, vertices, list));
                moving += 2 * places
                    .iter()
                    .zip(normals)
                    .filter(|(p, n)| **p != Vec3::ZERO || *n != Vec3::ZERO)
                    .count();
            }
        }
        println!("{file}: of {dense} vectors {kept} are kept, {moving} move");
        assert!(dense > 0 && moving <= kept && kept <= dense);
    }
}
