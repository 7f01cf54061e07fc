//! Sections of a file: listed, run one by one, their expectations recorded with their places.

use crate::common::*;
use choreo_motion::Time;
use choreo_script::Diagnostic;
use choreo_script::testing::*;

const SUITE: &str = r#"// Shared by all sections.
let hero = load("hero.toy");
fn walker(name, asset) { let a = cast(name, asset); a.play(asset.clip("Walk")); a }

test("stands where it is put", || {
    let anna = walker("anna", hero).at(1, 2, 3);
    expect(anna).near([1, 2, 3]);
    expect(anna.joint("Head")).at(0.5).near([1.0, 4.0, 3.0], cm(1));
});
test("not yet", #{ skip: "no such thing", tags: ["slow"] }, || { expect(1).equals(1); });
test("wrong names", || {
    let anna = cast("anna", hero);
    anna.play(hero.clip("Wlak")); //~ error: did you mean "Walk"
    anna.joint("Hed"); //~ error: unknown joint "Hed"
});
for i in 0..3 {
    test(`number ${i}`, || { expect(i).below(3); });
}
"#;

fn options() -> TestOptions {
    TestOptions::default()
}

fn list(folder: &Folder, name: &str) -> Vec<SectionInfo> {
    list_sections(&folder.file(name), &registry(), &options()).unwrap_or_else(|e| panic!("{}", show(&e)))
}

/// Runs a section before and after the sections of its file are listed: with the list, the `test` calls of other sections are skipped. Asserts
/// that the results are equal.
fn section(folder: &Folder, name: &str, index: usize) -> SectionRun {
    let (file, registry, listed) = (folder.file(name), registry(), options());
    let run = |options: &TestOptions| {
        run_section(&file, index, &registry, options).unwrap_or_else(|e| panic!("{}", show(&e)))
    };
    let whole = run(&options());
    list_sections(&file, &registry, &listed).unwrap_or_else(|e| panic!("{}", show(&e)));
    let alone = run(&listed);
    let facts = |run: &SectionRun| {
        let sound = run.stage_errors.is_empty();
        let stages: Vec<_> = run.stages.iter().filter(|_| sound).map(|stage| stage.content_hash()).collect();
        let said = (&run.expectations, &run.expected, &run.printed, run.hash, run.second_run_hash);
        format!("{:?}", (&run.info, stages, said, &run.errors, &run.warnings, &run.stage_errors))
    };
    assert_eq!(facts(&alone), facts(&whole));
    alone
}

fn suite(text: &str) -> Folder {
    Folder::new(&[("hero.toy", ""), ("t.rhai", text)])
}

/// The messages of the only section of a text.
fn errors(text: &str) -> String {
    let folder = suite(text);
    let run = section(&folder, "t.rhai", 0);
    show(&run.errors).replace(&folder.path().display().to_string(), "FOLDER")
}

#[test]
fn sections_are_listed_without_being_run() {
    let folder = suite(SUITE);
    let sections = list(&folder, "t.rhai");
    let names: Vec<&str> = sections.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        names,
        ["stands where it is put", "not yet", "wrong names", "number 0", "number 1", "number 2"]
    );
    let lines: Vec<_> = sections.iter().map(|s| (s.line, s.end_line)).collect();
    assert_eq!(lines, [(5, 9), (10, 10), (11, 15), (17, 17), (17, 17), (17, 17)]);
    assert_eq!(sections[1].skip.as_deref(), Some("no such thing"));
    assert_eq!(sections[1].tags, ["slow"]);
}

#[test]
fn a_section_has_a_stage_of_its_own_and_expectations_with_places() {
    let folder = suite(SUITE);
    let run = section(&folder, "t.rhai", 0);
    assert!(run.errors.is_empty(), "{}", show(&run.errors));
    assert_eq!((run.stages.len(), run.stages[0].actors.len()), (1, 1));
    let at: Vec<_> = run.expectations.iter().map(|e| (e.place.line, e.place.column, e.when)).collect();
    assert_eq!(at, [(7, 18, When::Always), (8, 40, When::At(Time::from_secs(0.5)))]);
    assert_eq!(run.expectations[0].source, "expect(anna).near([1, 2, 3]);");
    assert!(!run.asserts_nothing());
    assert_eq!(run.files_used.len(), 2);
}

#[test]
fn the_closure_sees_the_loop_variable_of_its_own_round() {
    let folder = suite(SUITE);
    for i in 0..3 {
        let run = section(&folder, "t.rhai", 3 + i);
        let Claim::Value { got, .. } = &run.expectations[0].claim else { panic!("{run:?}") };
        assert_eq!(*got, Value::Int(i as i64));
    }
}

#[test]
fn expected_errors_are_met_and_others_are_not() {
    let folder = suite(SUITE);
    let run = section(&folder, "t.rhai", 2);
    assert!(run.errors.is_empty() && run.expected.iter().all(|e| e.has_occurred), "{}", show(&run.errors));
    assert_eq!(run.expected.len(), 2);
    assert!(!run.asserts_nothing());
    // The other sections do not expect them.
    assert!(section(&folder, "t.rhai", 0).expected.is_empty());
    let folder = suite(&SUITE.replace("did you mean \"Walk\"", "did you mean \"Run\""));
    let run = section(&folder, "t.rhai", 2);
    assert_eq!(run.expected.iter().filter(|e| !e.has_occurred).count(), 1);
    assert_eq!(run.errors.len(), 1, "{}", show(&run.errors));
}

#[test]
fn sections_do_not_change_the_run_of_a_script() {
    let folder = suite(&format!("stage(#{{ length: 2 }});\n{SUITE}\ncast(\"bob\", hero);"));
    let script = folder.run("t.rhai").unwrap_or_else(|e: Vec<Diagnostic>| panic!("{}", show(&e)));
    assert_eq!(script.stage.actors.len(), 1);
}

#[test]
fn a_file_without_sections_is_one_test() {
    let folder = Folder::new(&[("hero.toy", ""), ("t.rhai", "cast(\"a\", load(\"hero.toy\"));\n")]);
    let sections = list(&folder, "t.rhai");
    assert!(sections.len() == 1 && sections[0].is_whole_file());
    let run = section(&folder, "t.rhai", 0);
    assert!(run.errors.is_empty() && run.stages[0].actors.len() == 1);
    // A file that cannot be parsed is a test as it stands, too.
    let folder = Folder::new(&[("t.rhai", "let x = ; //~ error: is a reserved\n")]);
    let run = section(&folder, "t.rhai", 0);
    assert!(run.info.is_whole_file() && run.errors.len() == 1, "{}", show(&run.errors));
}

#[test]
fn another_script_is_taken_with_its_parameters_and_its_folder() {
    let folder = Folder::new(&[
        ("shows/hero.toy", ""),
        ("shows/steps.rhai", "fn twice(x) { 2 * x }"),
        ("shows/open.rhai", "let a = 1;\n/* cast("),
        (
            "shows/show.rhai",
            r#"import "steps" as steps;
               stage(#{ length: param("length", 3) });
               cast("anna", load("hero.toy")).at(steps::twice(1), 0, 0);
               camera("wide").at(0, 1, 4); sun();
               test("its own", || expect(1).equals(2));"#,
        ),
        (
            "tests/t.rhai",
            r#"test("it", || {
                   let show = scene("../shows/show.rhai", #{ set: #{ length: 5 } });
                   expect(show.actor("anna")).at(1).near([2, 0, 0]);
                   expect(show.camera("wide")).at(1).on();
                   expect(show.light(0)).at(1).intensity().near(3);
               });
               test("wrong", || {
                   scene("../shows/show.rhai", #{ set: #{ lenght: 5 } }); //~ error: no parameter "lenght"; did you mean "length"?
                   scene("../shows/show.rhai"); //~ error: already called in line 8
                   expect(1).equals(1);
               });
               test("open", || { scene("../shows/open.rhai"); expect(1).equals(1); });"#,
        ),
    ]);
    let path = folder.file("tests/t.rhai");
    let options = TestOptions { root: Some(folder.path().to_path_buf()), ..TestOptions::default() };
    for index in 0..2 {
        let run = run_section(&path, index, &registry(), &options).unwrap();
        assert!(run.errors.is_empty(), "{}", show(&run.errors));
        assert!(run.expected.iter().all(|e| e.has_occurred), "{:?}", run.expected);
        if index == 0 {
            assert_eq!(run.stages[0].settings.length, Time::from_secs(5.0));
            assert_eq!((run.expectations.len(), run.files_used.len()), (3, 4));
        }
    }
    let run = run_section(&path, 2, &registry(), &options).unwrap();
    let errors = show(&run.errors);
    assert!(errors.contains("open.rhai:2:1: this comment is never closed"), "{errors}");
    // Without the root the file lies outside.
    let run = run_section(&path, 0, &registry(), &TestOptions::default()).unwrap();
    assert!(show(&run.errors).contains("leads out of the folders"), "{}", show(&run.errors));
}

#[test]
fn other_stages_do_not_change_the_stage_of_the_section() {
    let folder = suite(
        r#"let hero = load("hero.toy");
           let round = |x| stage_of(|| { let a = cast("a", hero).at(x, 0, 0); expect(a).near([x, 0, 0]); on_frame(|t| a.turn(t)); });
           test("two", || {
               cast("mine", hero);
               let one = round.call(1);
               expect(one).same_as(round.call(1));
               expect(one).not().same_as(round.call(2));
           });
           test("leak", || {
               let a = cast("a", hero);
               stage_of(|| expect(a).near([0, 0, 0])); //~ error: uses an Actor of the stage around it
           });"#,
    );
    let run = section(&folder, "t.rhai", 0);
    assert!(run.errors.is_empty(), "{}", show(&run.errors));
    let actors: Vec<_> = run.stages.iter().map(|s| s.actors.len()).collect();
    assert_eq!(actors, [1, 1, 1, 1]);
    let stages: Vec<_> = run.expectations.iter().map(|e| e.stage).collect();
    assert_eq!(stages, [1, 2, 1, 3, 1]);
    assert_eq!(run.stages[1].content_hash(), run.stages[2].content_hash());
    assert_ne!(run.stages[1].content_hash(), run.stages[3].content_hash());
    let run = section(&folder, "t.rhai", 1);
    assert!(run.errors.is_empty() && run.expected[0].has_occurred, "{}", show(&run.errors));
}

#[test]
fn formulas_are_functions_of_the_time() {
    let folder = suite(
        r#"let hero = load("hero.toy"); let r = 2.0;
           test("circle", || {
               let a = cast("a", hero);
               expect(a).near(|t| [r * cos(t), 0.0, r * sin(t)], 0.001);
               expect(a).near(|t| t, 0.001);
           });"#,
    );
    let run = section(&folder, "t.rhai", 0);
    let formula = |i: usize| match &run.expectations[i].claim {
        Claim::Vector { test: VectorTest::Near { goal: VectorGoal::Formula(f), .. }, .. } => f.clone(),
        other => panic!("{other:?}"),
    };
    assert_eq!(formula(0).at(Time::ZERO).unwrap(), [2.0, 0.0, 0.0]);
    let error = formula(1).at(Time::from_secs(1.5)).unwrap_err().to_string();
    assert!(
        error.contains("t.rhai:5:26: near: the function must give [x, y, z], got 1.5 at 1.5 s"),
        "{error}"
    );
}

#[test]
fn misuse_of_expect_has_a_specific_error() {
    let cases = [
        ("test(\"a\", || { expect(1); });", "this expect has no comparison"),
        (
            "test(\"a\", || { expect(1).equals(1).not(); });",
            "not has no effect: no comparison comes after it",
        ),
        ("test(\"a\", || { expect(stage()).count(\"actors\").equals(0).at(1); });", "at has no effect"),
        ("on_frame(|t| expect(1)); test(\"a\", || 1);", "it is for test sections"),
        ("test(\"a\", || { expect(1).near(); });", "write near(goal, tolerance?), not with 0 arguments"),
        ("test(\"a\", || { expect(1).visble(); });", "did you mean \"visible\"?"),
        ("test(\"a\", || { expect(stage()).count(\"actor\"); });", "did you mean \"actors\"?"),
        ("test(\"a\", || { expect(camera(\"c\")).weight(\"Walk\"); });", "weight: a Camera plays no clips"),
        ("test(\"a\", || { expect(1).at(2).equals(1); });", "equals: a value does not change over time"),
        ("test(\"a\", || { test(\"b\", || 1); });", "a section cannot hold another one"),
        ("test(\"a\", || 1); test(\"a\", || 1);", "the name \"a\" is already taken by the section in line 1"),
        ("test(\"a\", #{ skip: \"\" }, || 1);", "test: skip must give a reason"),
        ("expect(1).equals(1); test(\"a\", || 1);", "expect can be used in test sections only"),
        ("test(\"a\", || { expect_image(\"a b\"); });", "it is a file's name"),
        ("test(\"a\", || { expect(load(\"hero.toy\")); });", "expect: what must be an Actor, Joint"),
        ("test(\"a\", || { expect(stage()).at(1).near(1); });", "near: the argument of expect must be"),
        ("test(\"a\", || { throw \"no\"; });", "t.rhai:1:16: no"),
        ("test(\"a\", || { loop { } });", "does a loop never end?"),
        ("test(\"a\", || 1); //~ eror: x", "this //~ comment states no expected message"),
    ];
    for (text, expected) in cases {
        let got = errors(text);
        assert!(got.contains(expected), "{text}\nexpected: {expected}\ngot: {got}");
    }
}

#[test]
fn assets_are_imported_once_and_again_when_their_files_change() {
    let folder = Folder::new(&[
        ("hero.toy", "beside skin.png"),
        ("skin.png", "1"),
        (
            "t.rhai",
            "let hero = load(\"hero.toy\"); test(\"a\", || { cast(\"a\", hero); expect(1).equals(1); });",
        ),
    ]);
    let options = TestOptions::default();
    let asset = || {
        let run = run_section(&folder.file("t.rhai"), 0, &registry(), &options).unwrap();
        assert!(run.errors.is_empty(), "{}", show(&run.errors));
        (run.stages[0].actors[0].asset.clone(), run.hash)
    };
    let (first, hash) = asset();
    let (again, same_hash) = asset();
    assert!(std::sync::Arc::ptr_eq(&first, &again) && hash == same_hash);
    std::fs::write(folder.file("skin.png"), "2").unwrap();
    let (other, other_hash) = asset();
    assert!(!std::sync::Arc::ptr_eq(&first, &other) && hash != other_hash);
}

/// The code around the sections counts wherever it stands; what others do inside does not.
#[test]
fn a_section_runs_the_same_alone_and_among_others() {
    let folder = suite(
        r#"
let n = 1;
let list = [0];
let bump = |v| { v += 1; v };
test("first", || { n += 1; list.push(n); print(`first ${n} ${list}`); expect(n).equals(2); });
n += 10;
print(`between ${n} ${bump.call(n)} ${n}`);
test("second", #{ tags: ["a", "b"] }, || { n += 100; print(`second ${n} ${list}`); expect(n).equals(111); });
let n = 5;
for row in [1, 2, 3] {
    test(`row ${row}`, || { n += row; print(`row ${n}`); expect(n).equals(5 + row); });
}
fn table(rows) { for row in rows { test("in a function " + row, || { expect(row).above(0); }); } }
table([1, 2]);
let copy = n;
copy += 1;
print(`end ${n} ${copy} ${bump.call(n)} ${n}`);
test("last", || { print(`last ${n}`); expect(copy).equals(6); });
"#,
    );
    let count = list(&folder, "t.rhai").len();
    assert_eq!(count, 8);
    let printed: Vec<Vec<String>> =
        (0..count).map(|index| section(&folder, "t.rhai", index).printed).collect();
    assert_eq!(printed[0][0], "first 2 [0, 2]");
    assert_eq!(printed[1][1], "second 111 [0]");
    assert_eq!(printed[7].last().unwrap(), "last 5");
    let told = printed[4].iter().find(|line| line.starts_with("row")).unwrap();
    assert_eq!(told, "row 8");
}

/// A file that has changed since it was listed is run as it is now.
#[test]
fn a_section_of_a_file_that_has_changed() {
    let folder = suite(
        "test(\"a\", || { print(1); expect(1).equals(1); });\ntest(\"b\", || { expect(2).equals(2); });",
    );
    let options = options();
    let run = |index| run_section(&folder.file("t.rhai"), index, &registry(), &options);
    list_sections(&folder.file("t.rhai"), &registry(), &options).unwrap();
    assert_eq!(run(0).unwrap().printed, ["1"]);
    std::fs::write(folder.file("t.rhai"), "test(\"c\", || { print(3); expect(1).equals(1); });").unwrap();
    assert_eq!((run(0).unwrap().info.name.as_str(), run(0).unwrap().printed.len()), ("c", 1));
    assert!(show(&run(1).unwrap_err()).contains("section 1 no longer exists: the file now has 1"));
}

/// Processor time of a section in a file of 32 times as many; it was 32 times as long and more.
#[test]
fn a_section_costs_the_same_in_a_long_file() {
    let file = |sections: usize| -> String {
        let one =
            |i| format!("test(\"number {i}\", || {{\n    let x = {i};\n    expect(x).equals({i});\n}});\n");
        (0..sections).map(one).collect()
    };
    let folder = Folder::new(&[("short.rhai", &file(60)), ("long.rhai", &file(1920))]);
    let mut options = options();
    options.script.limits.functions = 10_000;
    let least = |name: &str| {
        assert!(list_sections(&folder.file(name), &registry(), &options).is_ok());
        let registry = registry();
        let round = || {
            let started = std::time::Instant::now();
            for index in 0..20 {
                run_section(&folder.file(name), index, &registry, &options).unwrap();
            }
            started.elapsed()
        };
        (0..5).map(|_| round()).min().unwrap()
    };
    let (short, long) = (least("short.rhai"), least("long.rhai"));
    println!("20 sections: {short:?} of 60, {long:?} of 1920");
    assert!(long < 4 * short, "20 sections: {short:?} of 60, {long:?} of 1920");
}

#[test]
fn a_section_ends_at_its_timeout() {
    let folder = suite("test(\"a\", || { let n = 0;\nwhile true { n += 1; } });");
    let options = TestOptions { timeout: Some(Timeout::after(0.05)), ..options() };
    let run = run_section(&folder.file("t.rhai"), 0, &registry(), &options).unwrap();
    assert!(run.errors.len() == 1 && (1..=2).contains(&run.errors[0].line), "{}", show(&run.errors));
    assert_eq!(run.errors[0].message, "this section takes longer than 0.05 s");
    assert_eq!(
        run.errors[0].hint.as_deref(),
        Some("make it shorter, or raise the time with --timeout SECONDS")
    );
}
