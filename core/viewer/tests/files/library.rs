//! Files, folders and shortcuts as plain data: folder lists, names of new files, lessons, recent files, and the user's shortcuts.

use choreo_viewer::library::documents::Documents;
use choreo_viewer::library::file_dialog::{FileDialog, Purpose};
use choreo_viewer::library::folder::{FileKind, list_folder, model_extensions};
use choreo_viewer::library::lessons::{find_lessons, lessons_in};
use choreo_viewer::library::templates::TEMPLATES;
use choreo_viewer::state::shortcuts::{Chord, Shortcuts};

#[test]
fn a_folder_shows_folders_scripts_and_models() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("zoo")).unwrap();
    for name in ["b.rhai", "A.RHAI", "x.GLB", "notes.txt", ".hidden.glb", "own.importer.rhai", "glow.wgsl"] {
        std::fs::write(folder.path().join(name), "").unwrap();
    }
    let endings = model_extensions(&choreo::registry());
    let names: Vec<(String, FileKind)> =
        list_folder(folder.path(), &endings).unwrap().into_iter().map(|e| (e.name, e.kind)).collect();
    let expected = [
        ("zoo", FileKind::Folder),
        ("A.RHAI", FileKind::Script),
        ("b.rhai", FileKind::Script),
        ("x.GLB", FileKind::Model),
    ];
    assert_eq!(names, expected.map(|(name, kind)| (name.to_string(), kind)));
    assert!(list_folder(&folder.path().join("nowhere"), &endings).is_err());
}

#[test]
fn lessons_are_numbered_scripts_and_folders_with_one() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    };
    [
        "10_more_of_it.rhai",
        "2_a.rhai",
        "3_b/lesson.rhai",
        "4_c/other.rhai",
        "5_d.txt",
        "x_e.rhai",
        "README.md",
    ]
    .into_iter()
    .for_each(write);
    let titles: Vec<String> = lessons_in(folder.path()).into_iter().map(|lesson| lesson.title).collect();
    assert_eq!(titles, ["2 a", "3 b", "10 more of it"]);
    assert!(lessons_in(&folder.path().join("nowhere")).is_empty());
    assert!(find_lessons().len() > 40, "those of the sources");
}

#[test]
fn the_save_dialog_completes_names_and_never_overwrites_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().canonicalize().unwrap();
    std::fs::write(at.join("a.rhai"), "x").unwrap();
    std::fs::create_dir(at.join("sub")).unwrap();
    let mut new = FileDialog::new(Purpose::New(TEMPLATES[0]), &at, "b", &[]);
    assert_eq!(new.accept(), Some(at.join("b.rhai")));
    new.name = "a.rhai".into();
    assert_eq!((new.accept(), new.accept()), (None, None));
    assert_eq!(new.problem.as_deref(), Some("a.rhai already exists; choose another name"));
    let mut save = FileDialog::new(Purpose::SaveAs, &at, "a", &[]);
    assert_eq!(save.accept(), None);
    assert!(save.problem.as_ref().unwrap().contains("save once more"));
    assert_eq!(save.accept(), Some(at.join("a.rhai")));
    let mut open = FileDialog::new(Purpose::Open, &at, "none.rhai", &[]);
    assert_eq!(open.accept(), None);
    assert_eq!(open.problem.as_deref(), Some("none.rhai: there is no such file"));
    open.name = "sub".into();
    assert_eq!((open.accept(), open.folder.clone()), (None, at.join("sub")));
    open.change_folder(&at.join("nowhere"));
    assert_eq!(open.folder, at.join("sub"), "it stays where it was");
    open.change_folder(&at);
    let first = open.entries.iter().find(|e| e.kind == FileKind::Script).unwrap().clone();
    open.choose(&first);
    assert_eq!(open.accept(), Some(at.join("a.rhai")));
}

#[test]
fn recent_files_are_unique_and_newest_first() {
    let folder = tempfile::tempdir().unwrap();
    let mut documents = Documents::default();
    for name in ["a", "b", "a"] {
        documents.record_opened(&folder.path().join(name));
    }
    let names: Vec<_> = documents.recent.iter().map(|p| p.file_name().unwrap().to_owned()).collect();
    assert_eq!(names, ["a", "b"]);
    (0..40).for_each(|n| documents.record_opened(&folder.path().join(n.to_string())));
    assert_eq!(documents.recent.len(), 12);
    std::fs::write(folder.path().join("scene.rhai"), "").unwrap();
    documents.open_dialog(Purpose::New(TEMPLATES[0]), Some(&folder.path().join("scene.rhai")));
    assert_eq!(documents.dialog.unwrap().name, "scene_2.rhai");
}

#[test]
fn user_shortcuts_override_the_preset_and_the_defaults() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("choreo").join(Shortcuts::FILE);
    assert_eq!(Shortcuts::read(&file), (Shortcuts::default(), None));
    let mut keys = Shortcuts { preset: "blender".into(), ..Shortcuts::default() };
    assert_eq!(keys.display_text("scale", "B"), "S");
    assert_eq!(keys.display_text("delete", "Delete"), "X, Delete");
    assert_eq!(keys.display_text("play", "Space"), "Space");
    keys.user_keys.insert("delete".into(), "Ctrl+Shift+Backspace, alt+D".into());
    keys.user_keys.insert("play".into(), String::new());
    assert_eq!(keys.display_text("delete", "Delete"), "Ctrl Shift Backspace, Alt D");
    assert_eq!(keys.chords_of("play", "Space"), []);
    std::fs::create_dir(file.parent().unwrap()).unwrap();
    let own = r#"{ "keys": { "delete": "Ctrl+Shift+Backspace, alt+D", "play": "" } }"#;
    std::fs::write(&file, own).unwrap();
    assert_eq!(keys.write(&file), None);
    assert_eq!(Shortcuts::read(&file), (keys, None));
    for (text, wrong) in [
        ("[", "EOF"),
        ("{\"preset\": \"maya\"}", "unknown preset \"maya\"; presets: choreo, blender, unity"),
        ("{\"keys\": {\"play\": 3}}", "play: keys must be a string"),
    ] {
        std::fs::write(&file, text).unwrap();
        let problem = Shortcuts::read(&file).1.unwrap();
        assert!(problem.contains(wrong), "{problem}");
    }
    assert_eq!(Chord::parse("Hyper+Z"), None);
    assert_eq!(Chord::parse("Ctrl+"), None);
}
