//! Reports of every kind of outcome; special characters in texts do not break them.

use choreo_test_runner::golden_image;
use choreo_test_runner::report::{html, json, junit, rerun_command, terminal};
use choreo_test_runner::run::Report;
use choreo_test_runner::{Check, Evidence, Measures, Outcome, Pictures, SourceLocation, Status, Trace};

fn check(passed: bool, evidence: Evidence) -> Check {
    Check {
        place: SourceLocation { file: "t/a.rhai".into(), line: 4, column: 3 },
        title: "anna <LeftHand> near [0, 1, 0] & so on".into(),
        passed,
        expected: "[0, 1, 0] ± 0.001 m".into(),
        got: "[0, 1.2, 0] m \u{1b}[31m]]>".into(),
        by: "0.2 m".into(),
        hint: "type \"this\"".into(),
        evidence,
    }
}

fn outcome(file: &str, section: &str, status: Status, checks: Vec<Check>) -> Outcome {
    Outcome {
        status,
        checks,
        warnings: vec!["t/a.rhai:1:1: warning: slow </script>".into()],
        printed: vec!["hello <b>".into()],
        seconds: 0.25,
        ..Outcome::new(file, section, 3)
    }
}

fn png(value: u8) -> Vec<u8> {
    let frame = choreo_plugin::Frame { width: 8, height: 4, rgba: [value, 20, 30, 255].repeat(32) };
    golden_image::encode(&frame, &[]).unwrap()
}

fn report_with_every_outcome() -> Report {
    let pictures = Pictures {
        name: "start".into(),
        stored: "t/pictures/a/start.png".into(),
        expected: png(10),
        got: png(200),
        difference: png(255),
        visible_difference: png(0),
        written: vec!["out/e.png".into(), "out/g.png".into(), "out/d.png".into()],
        measures: Some(Measures {
            worst: 190,
            words: "visible at first sight".into(),
            ..Measures::default()
        }),
    };
    let trace = Trace {
        label: "anna LeftHand y".into(),
        unit: "m".into(),
        times: vec![0.0, 1.0, 2.0],
        got: vec![1.0, 1.2, 1.1],
        expected: vec![1.0, 1.0, 1.0],
        band: vec![[0.99, 1.01]; 3],
        mark: Some(1.0),
    };
    let mut reused = outcome("t/a.rhai", "again", Status::Passed, vec![check(true, Evidence::None)]);
    reused.reused = true;
    Report {
        outcomes: vec![
            outcome("t/a.rhai", "good", Status::Passed, vec![check(true, Evidence::None)]),
            reused,
            outcome(
                "t/a.rhai",
                "it's \"off\"",
                Status::Failed,
                vec![check(true, Evidence::None), check(false, Evidence::Traces(vec![trace]))],
            ),
            outcome(
                "t/a.rhai",
                "looks",
                Status::Failed,
                vec![check(false, Evidence::Pictures(Box::new(pictures)))],
            ),
            outcome("t/b.rhai", "", Status::Error("t/b.rhai:1:1: unknown\n    hint: <x>".into()), vec![]),
            outcome("t/b.rhai", "later", Status::Skipped("no Vulkan".into()), vec![]),
            outcome("t/b.rhai", "later too", Status::Skipped("no Vulkan".into()), vec![]),
        ],
        seconds: 2.0,
        ..Report::default()
    }
}

#[test]
fn the_terminal_report_states_expected_and_actual_values_and_commands() {
    let report = report_with_every_outcome();
    let off = terminal::failure(&report.outcomes[2]);
    let expected = "FAILED t/a.rhai > it's \"off\"\n    printed: hello <b>\n  t/a.rhai:4:3: anna <LeftHand> near [0, 1, 0] & so on\n      \
                    of        anna LeftHand y\n      expected  [0, 1, 0] ± 0.001 m\n      got       [0, 1.2, 0] m \u{fffd}[31m]]>\n      off by    0.2 m\n      \
                    hint      type \"this\"\n  t/a.rhai:1:1: warning: slow </script>\n  \
                    alone:  choreo test t/a.rhai --filter 'it'\\''s \"off\"'\n";
    assert_eq!(off, expected);
    let looks = terminal::failure(&report.outcomes[3]);
    assert!(
        looks.contains("\n      see       out/e.png\n      see       out/g.png\n      see       out/d.png\n"),
        "{looks}"
    );
    assert!(looks.ends_with("  accept: choreo test t/a.rhai --accept=start\n"), "{looks}");
    assert!(
        terminal::failure(&report.outcomes[4])
            .contains("ERROR t/b.rhai\n  t/b.rhai:1:1: unknown\n      hint: <x>\n")
    );
    assert_eq!(terminal::failure(&report.outcomes[0]), "");
    assert_eq!(
        terminal::summary(&report),
        "skipped 2: no Vulkan\n2 passed (reused 1), 3 failed, 2 skipped, 7 warnings; 5 checks in 2.0 s\n"
    );
    assert_eq!(terminal::file_line(&report.outcomes[..4]), "FAILED t/a.rhai  4 sections, 2 failed, 1 reused");
    assert_eq!(rerun_command(&report.outcomes[4]), "choreo test t/b.rhai");
}

#[test]
fn a_run_succeeds_only_if_a_section_passed_and_none_failed() {
    let report = |outcomes: Vec<Outcome>| Report { outcomes, ..Report::default() }.failure();
    let of = |status: Status| outcome("a", "b", status, vec![]);
    assert_eq!(report(vec![of(Status::Passed), of(Status::Skipped("x".into()))]), None);
    assert_eq!(report(vec![]).unwrap(), "no section was found, so nothing was tested");
    let skipped = report(vec![of(Status::Skipped("x".into())), of(Status::Skipped("y".into()))]);
    assert_eq!(skipped.unwrap(), "all 2 sections were skipped, so nothing was tested");
    assert_eq!(report(vec![of(Status::Passed), of(Status::Failed)]).unwrap(), "1 section failed");
    assert_eq!(report(vec![of(Status::Error("x".into())), of(Status::Failed)]).unwrap(), "2 sections failed");
}

/// Elements of an XML text with their attributes, in order. Panics if the XML is not well-formed; namespaces are not supported.
fn elements(xml: &str) -> Vec<(String, Vec<(String, String)>)> {
    let mut found = Vec::new();
    let mut open: Vec<String> = Vec::new();
    let mut rest = xml;
    while let Some(at) = rest.find('<') {
        assert!(!rest[..at].contains('>'), "a bare > in {:?}", &rest[..at]);
        let end = rest.find('>').expect("a tag ends with >");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if tag.starts_with('?') {
            continue;
        }
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name));
            continue;
        }
        let closed = tag.ends_with('/');
        let tag = tag.trim_end_matches('/');
        let (name, mut text) = tag.split_once(' ').unwrap_or((tag, ""));
        let mut attributes = Vec::new();
        while let Some((key, after)) = text.trim_start().split_once("=\"") {
            let (value, after) = after.split_once('"').expect("the value of an attribute ends with a quote");
            attributes.push((key.to_string(), value.to_string()));
            text = after;
        }
        found.push((name.to_string(), attributes));
        if !closed {
            open.push(name.to_string());
        }
    }
    assert!(open.is_empty(), "{open:?}");
    found
}

#[test]
fn junit_xml_is_well_formed_and_has_the_right_counts() {
    let xml = junit::report(&report_with_every_outcome());
    let elements = elements(&xml);
    let count = |name: &str| elements.iter().filter(|(n, _)| n == name).count();
    assert_eq!((count("testsuites"), count("testsuite"), count("testcase")), (1, 2, 7));
    assert_eq!((count("failure"), count("error"), count("skipped")), (2, 1, 2));
    let attribute = |name: &str, nth: usize, key: &str| -> String {
        let element = elements.iter().filter(|(n, _)| n == name).nth(nth).unwrap();
        element.1.iter().find(|(k, _)| k == key).unwrap_or_else(|| panic!("{key}")).1.clone()
    };
    for (key, value) in [("tests", "7"), ("failures", "2"), ("errors", "1"), ("time", "2.000")] {
        assert_eq!(attribute("testsuites", 0, key), value);
    }
    for (key, value) in [("tests", "3"), ("failures", "0"), ("errors", "1"), ("skipped", "2")] {
        assert_eq!(attribute("testsuite", 1, key), value);
    }
    assert_eq!(attribute("testcase", 2, "name"), "it&apos;s &quot;off&quot;");
    assert_eq!(attribute("testcase", 4, "name"), "whole file");
    assert!(!xml.chars().any(|c| c.is_control() && c != '\n'), "no control characters");
}

#[test]
fn json_contains_all_outcomes_and_the_commands_to_type() {
    let value = json::report(&report_with_every_outcome(), &serde_json::json!({ "changed": false }));
    assert_eq!((&value["ok"], &value["passed"], &value["failed"]), (&false.into(), &2.into(), &2.into()));
    assert_eq!((&value["errors"], &value["skipped"], &value["reused"]), (&1.into(), &2.into(), &1.into()));
    let looks = &value["sections"][3];
    assert_eq!(looks["checks"][0]["picture"]["got"], "out/g.png");
    assert_eq!(looks["checks"][0]["picture"]["measures"]["words"], "visible at first sight");
    assert_eq!(looks["accept"], "choreo test t/a.rhai --accept=start");
    assert_eq!(value["sections"][2]["checks"][1]["traces"][0]["band"][1], serde_json::json!([0.99, 1.01]));
    assert_eq!(value["sections"][5]["text"], "no Vulkan");
}

#[test]
fn the_html_report_is_self_contained_and_escapes_all_texts() {
    let page = html::report(&report_with_every_outcome(), "choreo <1>: t");
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 6);
    for outside in ["http:", "https:", "src=\"/", "<link", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    // The page contains one script; those in texts are escaped.
    assert_eq!(page.matches("</script>").count(), 1);
    assert!(
        page.contains("slow &lt;/script&gt;") && page.contains("hello &lt;b&gt;") && !page.contains('\u{1b}')
    );
    for part in [
        "class=\"trace\"",
        "class=\"band\"",
        "class=\"view blink\"",
        "class=\"view diff\"",
        "class=\"view seen\"",
        "3 sections failed",
        "prefers-color-scheme: dark",
    ] {
        assert!(page.contains(part), "{part}");
    }
    let count =
        |tag: &str| (page.matches(&format!("<{tag}")).count(), page.matches(&format!("</{tag}>")).count());
    for tag in ["details", "section", "div", "figure", "svg", "dl", "ul"] {
        let (open, close) = count(tag);
        assert_eq!(open, close, "{tag}");
    }
}
