//! Earlier results are reused while nothing that they rest on has changed, and never otherwise.

use choreo_script::testing::SectionInfo;
use choreo_test_runner::collect::Case;
use choreo_test_runner::results::Results;
use choreo_test_runner::{Outcome, SourceLocation, Status};
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
        spans: [(2, 4), (5, 7)].into(),
    }
}

fn outcome() -> Outcome {
    Outcome {
        file: "t.rhai".into(),
        section: "a".into(),
        place: SourceLocation { file: "t.rhai".into(), line: 2, column: 0 },
        status: Status::Passed,
        checks: Vec::new(),
        warnings: Vec::new(),
        printed: Vec::new(),
        seconds: 1.0,
        reused: false,
        key: String::new(),
        words: String::new(),
    }
}

fn hash_of(path: &Path) -> Option<[u8; 32]> {
    Some(*blake3::hash(&std::fs::read(path).ok()?).as_bytes())
}

struct Bench {
    folder: tempfile::TempDir,
    asset: PathBuf,
    picture: PathBuf,
    other: PathBuf,
}

impl Bench {
    fn new() -> Bench {
        let folder = tempfile::tempdir().unwrap();
        let d = folder.path().canonicalize().unwrap();
        std::fs::create_dir_all(d.join("other")).unwrap();
        let (asset, picture) = (d.join("other/asset.bin"), d.join("p.png"));
        std::fs::write(d.join("t.rhai"), TEXT).unwrap();
        std::fs::write(&asset, b"asset").unwrap();
        std::fs::write(&picture, b"picture").unwrap();
        let bench = Bench { folder, asset, picture, other: d.join("other") };
        bench.keep();
        bench
    }

    fn case(&self) -> Case {
        case(&self.folder.path().canonicalize().unwrap())
    }

    fn results(&self, program: &str) -> Results {
        Results::new(self.folder.path().join("results"), &[program, "options"])
    }

    fn keep(&self) {
        let files = [(self.asset.clone(), hash_of(&self.asset).unwrap())];
        let roots = [self.folder.path().canonicalize().unwrap(), self.other.clone()];
        let pictures = [(self.picture.clone(), hash_of(&self.picture))];
        self.results("1").keep(&self.case(), &mut outcome(), &files, &pictures, &roots);
    }

    fn found(&self) -> bool {
        self.results("1").find(&self.case()).is_some()
    }
}

#[test]
fn an_unchanged_section_is_found_with_what_it_rests_on() {
    let bench = Bench::new();
    let found = bench.results("1").find(&bench.case()).unwrap();
    assert!(found.outcome.reused && found.outcome.status == Status::Passed && found.outcome.key.len() == 64);
    assert_eq!((found.files, found.pictures), (vec![bench.asset.clone()], vec![bench.picture.clone()]));
}

#[test]
fn every_change_that_counts_is_noticed() {
    let script =
        |text: String| move |b: &Bench| std::fs::write(b.folder.path().join("t.rhai"), text).unwrap();
    type Change = Box<dyn FnOnce(&Bench)>;
    let changes: Vec<(&str, Change, bool)> = vec![
        ("own line", Box::new(script(TEXT.replace("one()", "ten()"))), false),
        ("line around", Box::new(script(TEXT.replace("shared = 1", "shared = 2"))), false),
        ("another section", Box::new(script(TEXT.replace("two()", "six()"))), true),
        ("the file's end", Box::new(script(format!("{TEXT}more();\n"))), false),
        ("asset", Box::new(|b| std::fs::write(&b.asset, b"Asset").unwrap()), false),
        ("asset gone", Box::new(|b| std::fs::remove_file(&b.asset).unwrap()), false),
        ("picture", Box::new(|b| std::fs::write(&b.picture, b"Picture").unwrap()), false),
        ("image gone", Box::new(|b| std::fs::remove_file(&b.picture).unwrap()), false),
        // The file lies in a folder that is searched before the asset's.
        ("shadow", Box::new(|b| std::fs::write(b.folder.path().join("asset.bin"), b"x").unwrap()), false),
        (
            "something else",
            Box::new(|b| std::fs::write(b.folder.path().join("new.bin"), b"x").unwrap()),
            true,
        ),
        ("forgotten", Box::new(|b| b.results("1").forget(&b.case())), false),
    ];
    for (name, change, found) in changes {
        let bench = Bench::new();
        assert!(bench.found(), "{name}: before");
        change(&bench);
        assert_eq!(bench.found(), found, "{name}");
    }
}

#[test]
fn another_program_or_option_starts_anew() {
    let bench = Bench::new();
    assert!(bench.results("2").find(&bench.case()).is_none());
    let mut skipped = bench.case();
    skipped.section.as_mut().unwrap().skip = Some("why".into());
    assert!(bench.results("1").find(&skipped).is_none());
}

/// The script was saved while its section ran: what passed is the text from before.
#[test]
fn a_text_that_nobody_ran_is_not_kept() {
    let bench = Bench::new();
    let own = bench.case().path;
    for (ran, found) in [(TEXT.to_string(), true), (TEXT.replace("one()", "ten()"), false)] {
        bench.results("1").forget(&bench.case());
        let files = [(own.clone(), *blake3::hash(ran.as_bytes()).as_bytes())];
        bench.results("1").keep(&bench.case(), &mut outcome(), &files, &[], &[]);
        assert_eq!(bench.found(), found);
    }
}

/// A stored image was replaced after it was compared: what passed is the one from before.
#[test]
fn a_picture_that_nobody_compared_is_not_kept() {
    let bench = Bench::new();
    for (compared, found) in [(&b"picture"[..], true), (b"another", false)] {
        bench.results("1").forget(&bench.case());
        let pictures = [(bench.picture.clone(), Some(*blake3::hash(compared).as_bytes()))];
        bench.results("1").keep(&bench.case(), &mut outcome(), &[], &pictures, &[]);
        assert_eq!(bench.found(), found);
    }
    // Nothing could be read of it.
    bench.results("1").forget(&bench.case());
    bench.results("1").keep(&bench.case(), &mut outcome(), &[], &[(bench.picture.clone(), None)], &[]);
    assert!(!bench.found());
}

#[test]
fn damaged_entries_count_as_none() {
    let bench = Bench::new();
    let folder = bench.folder.path().join("results");
    let entry = std::fs::read_dir(&folder).unwrap().next().unwrap().unwrap().path();
    let good = std::fs::read(&entry).unwrap();
    for cut in (0..good.len()).step_by(7) {
        std::fs::write(&entry, &good[..cut]).unwrap();
        assert!(!bench.found(), "cut at {cut}");
    }
    std::fs::write(&entry, String::from_utf8(good.clone()).unwrap().replace("\"format\":1", "\"format\":0"))
        .unwrap();
    assert!(!bench.found());
    let failed = String::from_utf8(good.clone()).unwrap().replace("\"passed\"", "\"failed\"");
    std::fs::write(&entry, failed).unwrap();
    assert!(!bench.found());
    std::fs::write(&entry, good).unwrap();
    assert!(bench.found());
    // A folder that cannot be made is no error, only no help.
    let nowhere = Results::new(bench.picture.join("below"), &["1"]);
    nowhere.keep(&bench.case(), &mut outcome(), &[], &[], &[]);
    assert!(nowhere.find(&bench.case()).is_none());
}
