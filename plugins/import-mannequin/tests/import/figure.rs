//! The mesh, its skin and the options.

use crate::common::{import, import_with, source};
use choreo_asset::Primitive;
use choreo_plugin::importer::OptionValue;
use choreo_plugin::{Claim, ImportOptions, ImportScope, Importer, Source};
use glam::Vec3;
use import_mannequin::Mannequin;
use std::collections::{BTreeMap, BTreeSet};

/// Edges that are not met exactly once in each direction: holes, flaps, flipped triangles.
fn open_edges(p: &Primitive) -> usize {
    let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for t in p.indices.chunks_exact(3) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry((a, b)).or_default() += 1;
        }
    }
    edges.iter().filter(|((a, b), count)| **count != 1 || edges.get(&(*b, *a)) != Some(&1)).count()
}

/// Six times the enclosed volume of each connected piece.
fn volumes(p: &Primitive) -> Vec<f32> {
    let mut piece: Vec<usize> = (0..p.positions.len()).collect();
    fn root(piece: &mut [usize], mut i: usize) -> usize {
        while piece[i] != i {
            piece[i] = piece[piece[i]];
            i = piece[i];
        }
        i
    }
    for t in p.indices.chunks_exact(3) {
        for w in t.windows(2) {
            let (a, b) = (root(&mut piece, w[0] as usize), root(&mut piece, w[1] as usize));
            piece[a] = b;
        }
    }
    let mut volumes: BTreeMap<usize, f32> = BTreeMap::new();
    for t in p.indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| p.positions[t[k] as usize]);
        // Relative to a vertex of the piece: small parts far from the origin keep their digits.
        let r = root(&mut piece, t[0] as usize);
        let o = p.positions[r];
        *volumes.entry(r).or_default() += (a - o).dot((b - o).cross(c - o));
    }
    volumes.into_values().collect()
}

/// Triangles whose vertex normals look to the other side than the triangle does.
fn inside_out(p: &Primitive) -> usize {
    let facing = |t: &[u32]| {
        let [a, b, c] = [0, 1, 2].map(|k| p.positions[t[k] as usize]);
        let n: Vec3 = t.iter().map(|i| p.normals[*i as usize]).sum();
        (b - a).cross(c - a).dot(n)
    };
    p.indices.chunks_exact(3).filter(|t| facing(t) < 0.0).count()
}

#[test]
fn every_part_is_watertight_with_outward_normals() {
    let asset = import();
    let mut triangles = 0;
    for (i, p) in asset.meshes[0].primitives.iter().enumerate() {
        triangles += p.indices.len() / 3;
        assert_eq!(open_edges(p), 0, "primitive {i}");
        assert!(volumes(p).iter().all(|v| *v > 0.0), "primitive {i}: {:?}", volumes(p));
        let wrong = inside_out(p);
        assert!(wrong * 200 <= p.indices.len() / 3, "primitive {i}: {wrong} triangles against their normals");
        assert!(p.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4), "primitive {i}");
        assert!(p.positions.iter().all(|v| v.is_finite()), "primitive {i}");
    }
    assert!((8_000..=16_500).contains(&triangles), "{triangles} triangles");
}

#[test]
fn the_mesh_checks_detect_planted_faults() {
    let mesh = &import().meshes[0];
    let mut holed = mesh.primitives[1].clone();
    holed.indices.truncate(holed.indices.len() - 3);
    assert!(open_edges(&holed) > 0);
    let mut flipped = mesh.primitives[1].clone();
    flipped.indices.chunks_exact_mut(3).for_each(|t| t.swap(0, 1));
    assert!(volumes(&flipped).iter().all(|v| *v < 0.0));
    assert!(inside_out(&flipped) * 2 > flipped.indices.len() / 3);
}

#[test]
fn weights_sum_to_one_and_stay_on_their_side() {
    let asset = import();
    let names = asset.skeleton.names();
    for p in &asset.meshes[0].primitives {
        assert_eq!(p.joint_weights.len(), p.positions.len() * p.influences);
        for (v, position) in p.positions.iter().enumerate() {
            let weights = &p.joint_weights[v * 4..v * 4 + 4];
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{weights:?}");
            assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)), "{weights:?}");
            for (weight, joint) in weights.iter().zip(&p.joint_indices[v * 4..]) {
                let name = &names[asset.skins[0].joints[*joint as usize] as usize];
                let other_side = if position.x > 0.002 { "Right" } else { "Left" };
                let alien = position.x.abs() > 0.002 && name.contains(other_side) && *weight > 0.0;
                assert!(!alien, "{position} hangs on {name}");
            }
        }
    }
}

#[test]
fn the_skeleton_is_a_mixamorig_in_t_pose() {
    let asset = import();
    let rest = asset.rest_model_from_joint();
    let names: BTreeSet<&str> = asset.skeleton.names().iter().map(String::as_str).collect();
    assert_eq!(names.len(), 55, "no name twice");
    let at = |name: &str| {
        let joint = asset.skeleton.find(name).unwrap_or_else(|| panic!("no joint {name}"));
        rest[joint]
    };
    let along = |name: &str| Vec3::from(at(name).matrix3.y_axis);
    for (name, direction) in [
        ("mixamorig:LeftForeArm", Vec3::X),
        ("mixamorig:RightForeArm", Vec3::NEG_X),
        ("mixamorig:LeftUpLeg", Vec3::NEG_Y),
        ("mixamorig:RightLeg", Vec3::NEG_Y),
        ("mixamorig:LeftToeBase", Vec3::Z),
        ("mixamorig:Spine1", Vec3::Y),
    ] {
        assert!(along(name).distance(direction) < 1e-5, "{name} lies along {}", along(name));
    }
    for (left, right) in [("LeftHand", "RightHand"), ("LeftFoot", "RightFoot"), ("LeftArm", "RightArm")] {
        let (l, r) = (at(left).translation, at(right).translation);
        assert!((l.x + r.x).abs() < 1e-5 && l.x > 0.05 && (l.y - r.y).abs() < 1e-5, "{left} {l} {right} {r}");
    }
    let bounds = asset.rest_bounds();
    assert!(bounds.min.y.abs() < 0.003, "stands on the floor, lowest point {}", bounds.min.y);
    assert!((bounds.max.y - 1.75).abs() < 0.01, "{} tall", bounds.max.y);
    assert!(asset.rest_pose().len() == 55);
}

#[test]
fn inverse_bind_matrices_undo_the_rest_pose() {
    let asset = import();
    for (joint, inverse) in asset.skins[0].joints.iter().zip(&asset.skins[0].inverse_bind) {
        let product = glam::Mat4::from(asset.rest_model_from_joint()[*joint as usize]) * *inverse;
        assert!(product.abs_diff_eq(glam::Mat4::IDENTITY, 1e-5), "joint {joint}: {product}");
    }
}

#[test]
fn options_color_and_height() {
    let text = |s: &str| OptionValue::Text(s.into());
    let tall =
        import_with(&[("height", OptionValue::Number(3.5)), ("color", text("#ff0000"))], ImportScope::ALL);
    let tall = tall.expect("valid options");
    assert!((tall.rest_bounds().max.y - 3.5).abs() < 0.02);
    assert_eq!(tall.materials[0].base_color.to_array(), [1.0, 0.0, 0.0, 1.0]);
    // Every CSS name, as the table of the plugin API has it.
    for (name, _) in choreo_plugin::color::NAMES {
        let options = Mannequin.manifest().complete(&ImportOptions([("accent".into(), text(name))].into()));
        let expected = choreo_plugin::color::parse(name).unwrap().truncate().to_array().map(f64::from);
        assert_eq!(options.unwrap().numbers("accent"), Some(&expected[..]), "{name}");
    }
    let (small, large) = (&import().clips[0], &tall.clips[0]);
    assert_eq!(large.curves()[0].values[1], small.curves()[0].values[1] * 2.0);
}

#[test]
fn errors_of_wrong_options_name_the_allowed_values() {
    let refuse = |name: &str, value: &str| {
        let given = ImportOptions([(name.into(), OptionValue::Text(value.into()))].into());
        Mannequin.manifest().complete(&given).unwrap_err()
    };
    let refused = refuse("color", "corall");
    assert_eq!(
        refused.to_string(),
        "mannequin: option color: unknown color \"corall\"; did you mean \"coral\"?"
    );
    assert!(refused.hint.unwrap().starts_with("a color is a CSS name"));
    for bad in ["#12345", "#12345g", "#+12345", ""] {
        refuse("accent", bad);
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let refused = import_with(&[("height", OptionValue::Number(bad))], ImportScope::ALL).unwrap_err();
        assert!(refused.to_string().contains("must be a number from 0.3 to 10"), "{refused}");
    }
}

#[test]
fn it_claims_only_its_name_and_creates_only_the_import_scope() {
    let named = |name: &str| Source { name: name.into(), ..source() };
    assert_eq!(Mannequin.claim(&source()), Claim::Content(100));
    for other in ["mannequin", "choreo:mannequin.glb", "choreo:", "a/choreo:mannequin"] {
        assert_eq!(Mannequin.claim(&named(other)), Claim::NotMine, "{other}");
    }
    let none =
        ImportScope { geometry: false, clips: false, textures: false, pixels: false, image_files: false };
    let bare = import_with(&[], none).expect("no options");
    assert!(bare.meshes.is_empty() && bare.clips.is_empty() && bare.skeleton.len() == 55);
}

#[test]
fn generation_is_deterministic_and_fast() {
    let start = std::time::Instant::now();
    let first = import();
    println!("import: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    assert_eq!(first.content_hash(), import().content_hash());
}
