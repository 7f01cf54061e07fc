//! Compares every sample file with assimp: triangles, points, skin joints, clips and their lengths, cameras, lights, extents.
//! The table in README.md lists differences and their reasons. An unlisted difference fails, and so does a row that is no
//! longer true. `CHOREO_TABLE=1` prints the rows as they are.

use choreo_asset::{Asset, Topology};
use choreo_importer_kit_testing::{assets, pose};
use importers::assimp::{self, Scene};
use importers::{SAMPLES, import_whole, samples};
use std::collections::BTreeSet;
use std::path::Path;

type Facts = Vec<(&'static str, String)>;

/// Whether the only mesh is the generated one that shows the bones of a file without a mesh.
fn bones_only(asset: &Asset) -> bool {
    asset.meshes.len() == 1 && asset.meshes[0].name == "bones"
}

fn choreo_facts(asset: &Asset) -> Facts {
    let all = || asset.meshes.iter().flat_map(|m| &m.primitives);
    let triangles = all().filter(|p| p.topology == Topology::Triangles).map(|p| p.indices.len() / 3);
    let points = all().flat_map(|p| &p.positions).map(|p| (*p + 0.0).to_array().map(f32::to_bits));
    let joints: BTreeSet<u32> = asset.skins.iter().flat_map(|s| used_joints(asset, s)).collect();
    let mut facts = facts([
        triangles.sum::<usize>().to_string(),
        points.collect::<BTreeSet<_>>().len().to_string(),
        joints.len().to_string(),
        asset.clips.len().to_string(),
        lengths(asset.clips.iter().map(|c| c.duration.as_secs())),
        asset.cameras.len().to_string(),
        asset.lights.len().to_string(),
        proportions(extent(asset)),
    ]);
    if bones_only(asset) {
        // Both importers create a visible mesh for the bones; that of assimp has all its nodes as joints.
        facts.retain(|f| !["triangles", "points", "extents"].contains(&f.0));
        let nodes = asset.skeleton.len().to_string();
        facts.iter_mut().filter(|f| f.0 == "skin joints").for_each(|f| f.1.clone_from(&nodes));
    }
    facts
}

/// Joints of a skin but the one that points without influence go with.
fn used_joints<'a>(asset: &'a Asset, skin: &'a choreo_asset::Skin) -> impl Iterator<Item = u32> {
    let carrier = |joint: &u32| asset.instances.iter().any(|i| i.joint == *joint);
    skin.joints.iter().filter(move |j| !carrier(j)).copied()
}

fn assimp_facts(scene: &Scene) -> Facts {
    facts([
        scene.triangles.to_string(),
        scene.points.to_string(),
        scene.bones.to_string(),
        scene.animations.len().to_string(),
        lengths(scene.animations.iter().map(|a| a.secs)),
        scene.cameras.to_string(),
        scene.lights.to_string(),
        proportions(scene.extent),
    ])
}

fn facts(values: [String; 8]) -> Facts {
    let names = ["triangles", "points", "skin joints", "clips", "lengths, s", "cameras", "lights", "extents"];
    names.into_iter().zip(values).collect()
}

fn lengths(secs: impl Iterator<Item = f64>) -> String {
    let list: Vec<String> = secs.map(|s| format!("{s:.3}")).collect();
    if list.is_empty() { "none".into() } else { list.join(" ") }
}

/// Extent of the meshes at their nodes, without skins: assimp's is the same.
fn extent(asset: &Asset) -> [[f64; 3]; 2] {
    let model = pose::at(asset, None, 0.0);
    let mut out = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for instance in &asset.instances {
        let place = model[instance.joint as usize];
        for p in asset.meshes[instance.mesh as usize].primitives.iter().flat_map(|p| &p.positions) {
            let at = place.transform_point3(*p).to_array();
            for axis in 0..3 {
                out[0][axis] = out[0][axis].min(f64::from(at[axis]));
                out[1][axis] = out[1][axis].max(f64::from(at[axis]));
            }
        }
    }
    out
}

/// Side lengths of the box relative to the largest, sorted, and so independent of unit and up axis.
fn proportions([min, max]: [[f64; 3]; 2]) -> String {
    let mut sides: Vec<f64> = (0..3).map(|i| max[i] - min[i]).collect();
    sides.sort_by(f64::total_cmp);
    let most = sides[2];
    if !most.is_finite() || most <= 0.0 {
        return "none".into();
    }
    let parts: Vec<String> = sides.iter().map(|s| format!("{:.3}", s / most)).collect();
    parts.join(" ")
}

/// Rows of README.md's table: file, what, ours, assimp's; the last cell is the reason.
fn explained() -> BTreeSet<[String; 4]> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    let mut rows = BTreeSet::new();
    for line in text.lines().skip_while(|l| !l.starts_with("| file | what |")).skip(2) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [file, what, ours, theirs, why] = cells.as_slice() else { break };
        assert!(why.len() > 10, "no reason: {line}");
        rows.insert([file, what, ours, theirs].map(|s| s.to_string()));
    }
    rows
}

fn differences(name: &str, ours: &Facts, theirs: &Facts) -> Vec<[String; 4]> {
    let pairs = ours.iter().filter_map(|a| Some((a, theirs.iter().find(|b| b.0 == a.0)?)));
    let pairs = pairs.filter(|(a, b)| !is_same_fact(&a.1, &b.1));
    pairs.map(|(a, b)| [name.to_string(), a.0.to_string(), a.1.clone(), b.1.clone()]).collect()
}

/// Numbers as they are written, but for the last digit of those with a point.
fn is_same_fact(a: &str, b: &str) -> bool {
    let split = |s: &str| s.split(' ').map(str::to_string).collect::<Vec<_>>();
    let (a, b) = (split(a), split(b));
    a.len() == b.len()
        && a.iter().zip(&b).all(|(a, b)| match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(x), Ok(y)) if a.contains('.') => (x - y).abs() < 0.0021,
            _ => a == b,
        })
}

#[test]
fn differences_are_those_of_the_table() {
    let Some(folder) = assets(SAMPLES) else { return };
    let work = std::env::temp_dir().join(format!("choreo-assimp-{}", std::process::id()));
    std::fs::create_dir_all(&work).unwrap();
    let files = samples(&folder);
    assert!(files.len() >= SAMPLES, "{} of {SAMPLES} sample files", files.len());
    let (mut found, mut compared) = (BTreeSet::new(), 0);
    for name in &files {
        let path = folder.join(name);
        let shown = name.display().to_string();
        let Some(scene) = assimp::scene(&path, &work) else {
            println!("SKIP {SAMPLES}: assimp is not installed");
            return;
        };
        let mine = choreo_facts(&import_whole(&path));
        let Ok(scene) = scene else {
            found.insert([shown, "all".into(), "read".into(), "refused".into()]);
            continue;
        };
        found.extend(differences(&shown, &mine, &assimp_facts(&scene)));
        compared += mine.len();
        // A planted fault: another number is seen everywhere.
        let mut wrong = mine.clone();
        wrong.iter_mut().for_each(|f| f.1.insert(0, '1'));
        assert_eq!(differences(&shown, &wrong, &mine).len(), mine.len(), "{shown}");
    }
    let _ = std::fs::remove_dir_all(&work);
    if std::env::var_os("CHOREO_TABLE").is_some() {
        found.iter().for_each(|row| println!("| {} | |", row.join(" | ")));
    }
    let told = explained();
    let (new, old): (Vec<_>, Vec<_>) = (found.difference(&told).collect(), told.difference(&found).collect());
    println!("{compared} facts of {} files compared, {} differences explained", files.len(), told.len());
    assert!(new.is_empty(), "differences without a row in README.md: {new:#?}");
    assert!(old.is_empty(), "rows of README.md that are no longer true: {old:#?}");
}
