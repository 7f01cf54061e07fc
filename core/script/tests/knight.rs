//! DESIGN.md's example with characters by other people, where they are.

use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_script::{ScriptOptions, run_text};
use std::path::{Path, PathBuf};

#[test]
fn a_knight_walks_runs_and_stands() {
    let assets = std::env::var_os("CHOREO_ASSETS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets"), PathBuf::from);
    let folder =
        ["gltf", "gltf/kaykit", "."].iter().map(|f| assets.join(f)).find(|f| f.join("Knight.glb").is_file());
    let Some(folder) = folder else {
        println!("SKIP 1: no Knight.glb below {}", assets.display());
        return;
    };
    let mut registry = Registry::default();
    registry.add_importer(import_gltf::GltfImporter);
    let text = r#"
        stage(#{ size: [1280, 720], fps: 30, length: 8.0 });
        let hero  = load("Knight.glb");
        let anna  = cast("anna", hero).at(-1.0, 0.0, 0.0);
        let boris = cast("boris", hero).at(1.0, 0.0, 0.0).face(anna);
        anna.play(hero.clip("Walking_A")).until(3.0)
            .then(hero.clip("Running_A"), #{ fade: 0.4, speed: 1.1 }).until(6.0)
            .then(hero.clip("Idle"), #{ fade: 0.3 });
        boris.play(hero.clip("Idle")).loop();
        boris.look_at(anna.joint("Head")).from(1.0);
        camera("wide").at(0.0, 1.6, 6.0).look_at(anna);
        camera("close").follow(anna.joint("Head"), [0.0, 0.0, 1.2]).cut(4.0);
        sun(#{ direction: [-1.0, -2.0, -1.0] });
        on_frame(|t| boris.turn(10.0 * sin(t)));
    "#;
    let run = || {
        run_text("knight.rhai", text, &folder, &registry, &ScriptOptions::default()).unwrap_or_else(|e| {
            panic!("{}", e.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
        })
    };
    let (a, b) = (run(), run());
    assert_eq!(a.stage.content_hash(), b.stage.content_hash());
    for t in [0.0, 3.2, 7.9] {
        let shot = a.stage.at(Time::from_secs(t)).unwrap();
        assert_eq!(shot.content_hash(), b.stage.at(Time::from_secs(t)).unwrap().content_hash());
        assert!(shot.actors[0].model_from_joint.len() > 30);
    }
}
