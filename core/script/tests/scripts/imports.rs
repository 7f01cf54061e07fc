//! Files that a script loads are imported side by side, and reported in the order of the script.

use crate::common::*;
use choreo_asset::Asset;
use choreo_plugin::*;
use choreo_script::{Imports, ScriptOptions, run_text};
use std::sync::{Arc, Condvar, LazyLock, Mutex};
use std::time::{Duration, Instant};

static MANIFEST: LazyLock<Manifest> =
    LazyLock::new(|| Manifest::new("meet", "1", "for tests").extensions(["meet"]));

/// Ends only once two files are being imported at the same time.
#[derive(Clone, Default)]
struct Meet(Arc<(Mutex<usize>, Condvar)>);

impl Importer for Meet {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }
    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        _: ImportScope,
        _: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let fail = |what: &str| ImportError {
            file: source.name.clone(),
            place: String::new(),
            what: what.into(),
            hint: None,
        };
        if source.bytes.starts_with(b"endless") {
            // Until it is called off.
            let start = Instant::now();
            while files.progress(0.5) {
                if start.elapsed() > Duration::from_secs(300) {
                    return Err(fail("nobody called it off"));
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            return Err(fail("called off"));
        }
        let (count, changed) = &*self.0;
        let mut count = count.lock().unwrap();
        *count += 1;
        changed.notify_all();
        while *count < 2 {
            let (now, late) = changed.wait_timeout(count, Duration::from_secs(300)).unwrap();
            count = now;
            if late.timed_out() {
                return Err(fail("it was imported alone"));
            }
        }
        drop(count);
        AssetBuilder::default().finish(&source.name).map_err(|e| fail(&e.to_string()))
    }
}

fn with_meet() -> Registry {
    let mut registry = registry();
    registry.add_importer(Meet::default());
    registry
}

#[test]
fn two_loads_at_the_head_of_a_script_run_at_the_same_time() {
    let folder = Folder::new(&[("a.meet", ""), ("b.meet", "")]);
    let text =
        "let a = load(\"a.meet\");\nlet b = load(\"b.meet\");\ncast(\"a\", a);\ncast(\"b\", b).at(1, 0, 0);";
    let options = ScriptOptions::default();
    let script = run_text("t.rhai", text, folder.path(), &with_meet(), &options);
    let script = script.unwrap_or_else(|e| panic!("{}", show(&e)));
    assert_eq!(script.stage.actors.len(), 2);
    let progress = options.imports.progress();
    assert_eq!(progress.files, progress.done, "{progress:?}");
}

#[test]
fn errors_come_in_the_order_of_the_script_whenever_they_are_found() {
    let text = r#"
let a = load("broken.toy");
shape("cube");
let b = load("textured.toy");
shape("cuboid");
cast("b", b);
let c = load("broken.toy");
cast("a", a);
load("nothing.toy");
"#;
    let lines = |errors: &[choreo_script::Diagnostic]| errors.iter().map(|d| d.line).collect::<Vec<_>>();
    for _ in 0..20 {
        let errors = run(text).unwrap_err();
        assert_eq!(lines(&errors), [2, 3, 4, 5, 7, 9], "{}", show(&errors));
        assert!(errors[0].message.contains("this is broken") && errors[0].column == 14, "{}", show(&errors));
    }
}

#[test]
fn a_file_that_is_not_used_is_imported_too() {
    let errors =
        run("let a = load(\"hero.toy\");\ncast(\"a\", a);\nlet b = load(\"broken.toy\");").unwrap_err();
    assert_eq!((errors.len(), errors[0].line), (1, 3));
}

#[test]
fn equal_files_are_imported_once() {
    let script = run_or_panic(
        r#"
        let a = load("hero.toy");
        let b = load("models/../hero.toy");
        cast("a", a);
        cast("b", load("hero.toy")).at(1.0, 0.0, 0.0);
        cast("c", b).at(2.0, 0.0, 0.0);
        "#,
    );
    let assets: Vec<_> = script.stage.actors.iter().map(|a| &a.asset).collect();
    assert!(assets.iter().all(|a| Arc::ptr_eq(a, assets[0])));
}

#[test]
fn imports_show_progress_and_can_be_cancelled() {
    let folder = Folder::new(&[("a.meet", "endless")]);
    let options = ScriptOptions { imports: Imports::default(), ..ScriptOptions::default() };
    let imports = options.imports.clone();
    let watcher = std::thread::spawn(move || {
        loop {
            let now = imports.progress();
            if now.files == 1 && now.bytes_done > 0 {
                assert_eq!((now.done, now.bytes, now.bytes_done), (0, 7, 3), "{now:?}");
                assert_eq!(now.names, ["a.meet"]);
                imports.cancel();
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    let errors = run_text("t.rhai", "cast(\"a\", load(\"a.meet\"));", folder.path(), &with_meet(), &options)
        .unwrap_err();
    watcher.join().unwrap();
    assert!(errors[0].message.contains("cancelled") && errors[0].line == 1, "{}", show(&errors));
}
