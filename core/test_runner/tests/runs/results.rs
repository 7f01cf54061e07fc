//! Earlier results are reused only while nothing that they depend on has changed.

use choreo_script::testing::SectionInfo;
use choreo_test_runner::collect::Case;
use choreo_test_runner::results::Results;
use choreo_test_runner::{Outcome, Status};
use std::path::{Path, PathBuf};

const TEXT: &str = "let shared = 1;\ntest(\"a\", || {\n  one();\n});\ntest(\"b\", || {\n  two();\n});\n";

fn case(folder: &Path) -> Case {
    let info = SectionInfo {
        index: 0,
        name: "a".into(),
        file: "t.rhai".into(),
        line: 2,
        end_line: 4,
        skip: None,
        fails: None,
        tags: Vec::new(),
    };
    Case {
        path: folder.join("t.rhai"),
        file: "t.rhai".into(),
        root: None,
        section: Ok(info),
        section_lines: [(2, 4), (5, 7)].into(),
    }
}

fn outcome() -> Outcome {
    Outcome { seconds: 1.0, ..Outcome::new("t.rhai", "a", 2) }
}

fn hash_of(path: &Path) -> Option<[u8; 32]> {
    Some(*blake3::hash(&std::fs::read(path).ok()?).as_bytes())
}

struct ResultsTest {
    folder: tempfile::TempDir,
    asset: PathBuf,
    picture: PathBuf,
    other: PathBuf,
}

impl ResultsTest {
    fn new() -> ResultsTest {
        let folder = tempfile::tempdir().unwrap();
        let d = folder.path().canonicalize().unwrap();
        std::fs::create_dir_all(d.join("other")).unwrap();
        let (asset, picture) = (d.join("other/asset.bin"), d.join("p.png"));
        std::fs::write(d.join("t.rhai"), TEXT).unwrap();
        std::fs::write(&asset, b"asset").unwrap();
        std::fs::write(&picture, b"picture").unwrap();
        let test = ResultsTest { folder, asset, picture, other: d.join("other") };
        test.store();
        test
    }

    fn case(&self) -> Case {
        case(&self.folder.path().canonicalize().unwrap())
    }

    fn results(&self, program: &str) -> Results {
        Results::new(self.folder.path().join("results"), &[program, "options"])
    }

    fn store(&self) {
        let files = [(self.asset.clone(), hash_of(&self.asset).unwrap())];
        let roots = [self.folder.path().canonicalize().unwrap(), self.other.clone()];
        let pictures = [(self.picture.clone(), hash_of(&self.picture))];
        self.results("1").store(&self.case(), &mut outcome(), &files, &pictures, &roots);
    }

    fn is_found(&self) -> bool {
        self.results("1").find(&self.case()).is_some()
    }
}

#[test]
fn an_unchanged_section_is_found_with_its_files_and_images() {
    let test = ResultsTest::new();
    let found = test.results("1").find(&test.case()).unwrap();
    assert!(found.outcome.reused && found.outcome.status == Status::Passed && found.outcome.key.len() == 64);
    assert_eq!((found.files, found.pictures), (vec![test.asset.clone()], vec![test.picture.clone()]));
}

#[test]
fn only_a_change_of_a_dependency_invalidates_the_stored_outcome() {
    let script =
        |text: String| move |b: &ResultsTest| std::fs::write(b.folder.path().join("t.rhai"), text).unwrap();
    type Change = Box<dyn FnOnce(&ResultsTest)>;
    let changes: Vec<(&str, Change, bool)> = vec![
        ("a line of the section", Box::new(script(TEXT.replace("one()", "ten()"))), false),
        ("a line outside the sections", Box::new(script(TEXT.replace("shared = 1", "shared = 2"))), false),
        ("another section", Box::new(script(TEXT.replace("two()", "six()"))), true),
        ("the file's end", Box::new(script(format!("{TEXT}more();\n"))), false),
        ("asset", Box::new(|b| std::fs::write(&b.asset, b"Asset").unwrap()), false),
        ("asset gone", Box::new(|b| std::fs::remove_file(&b.asset).unwrap()), false),
        ("picture", Box::new(|b| std::fs::write(&b.picture, b"Picture").unwrap()), false),
        ("image gone", Box::new(|b| std::fs::remove_file(&b.picture).unwrap()), false),
        // The file lies in a folder that is searched before the asset's.
        (
            "a file of the same name in an earlier folder",
            Box::new(|b| std::fs::write(b.folder.path().join("asset.bin"), b"x").unwrap()),
            false,
        ),
        (
            "something else",
            Box::new(|b| std::fs::write(b.folder.path().join("new.bin"), b"x").unwrap()),
            true,
        ),
        ("a removed entry", Box::new(|b| b.results("1").remove(&b.case())), false),
    ];
    for (name, change, found) in changes {
        let test = ResultsTest::new();
        assert!(test.is_found(), "{name}: before");
        change(&test);
        assert_eq!(test.is_found(), found, "{name}");
    }
}

#[test]
fn outcomes_of_another_program_or_option_are_not_found() {
    let test = ResultsTest::new();
    assert!(test.results("2").find(&test.case()).is_none());
    let mut skipped = test.case();
    skipped.section.as_mut().unwrap().skip = Some("why".into());
    assert!(test.results("1").find(&skipped).is_none());
}

/// If the script is saved while its section runs, the earlier text has passed, not the new one.
#[test]
fn an_outcome_is_not_stored_if_the_script_changed_during_the_run() {
    let test = ResultsTest::new();
    let own = test.case().path;
    for (ran, found) in [(TEXT.to_string(), true), (TEXT.replace("one()", "ten()"), false)] {
        test.results("1").remove(&test.case());
        let files = [(own.clone(), *blake3::hash(ran.as_bytes()).as_bytes())];
        test.results("1").store(&test.case(), &mut outcome(), &files, &[], &[]);
        assert_eq!(test.is_found(), found);
    }
}

/// If a golden image is replaced after it was compared, the earlier image has passed, not the new one.
#[test]
fn an_outcome_is_not_stored_if_a_golden_image_changed_after_the_comparison() {
    let test = ResultsTest::new();
    for (compared, found) in [(&b"picture"[..], true), (b"another", false)] {
        test.results("1").remove(&test.case());
        let pictures = [(test.picture.clone(), Some(*blake3::hash(compared).as_bytes()))];
        test.results("1").store(&test.case(), &mut outcome(), &[], &pictures, &[]);
        assert_eq!(test.is_found(), found);
    }
    // The golden image could not be read.
    test.results("1").remove(&test.case());
    test.results("1").store(&test.case(), &mut outcome(), &[], &[(test.picture.clone(), None)], &[]);
    assert!(!test.is_found());
}

#[test]
fn damaged_entries_are_ignored() {
    let test = ResultsTest::new();
    let folder = test.folder.path().join("results");
    let entry = std::fs::read_dir(&folder).unwrap().next().unwrap().unwrap().path();
    let good = std::fs::read(&entry).unwrap();
    for cut in (0..good.len()).step_by(7) {
        std::fs::write(&entry, &good[..cut]).unwrap();
        assert!(!test.is_found(), "cut at {cut}");
    }
    std::fs::write(&entry, String::from_utf8(good.clone()).unwrap().replace("\"format\":1", "\"format\":0"))
        .unwrap();
    assert!(!test.is_found());
    let failed = String::from_utf8(good.clone()).unwrap().replace("\"passed\"", "\"failed\"");
    std::fs::write(&entry, failed).unwrap();
    assert!(!test.is_found());
    std::fs::write(&entry, good).unwrap();
    assert!(test.is_found());
    // A folder that cannot be created is not an error, but nothing is stored.
    let nowhere = Results::new(test.picture.join("below"), &["1"]);
    nowhere.store(&test.case(), &mut outcome(), &[], &[], &[]);
    assert!(nowhere.find(&test.case()).is_none());
}
