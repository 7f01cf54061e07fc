//! The report as one self-contained HTML file, with images as data URLs and plots as SVG, which can be opened from a disk.

use super::html_trace::plots;
use super::junit::escape_xml;
use super::{accept_command, rerun_command};
use crate::collect::display_path;
use crate::outcome::{Check, Evidence, Outcome, Pictures, Status};
use crate::run::Report;
use base64::Engine;
use choreo_script::printable;
use std::fmt::Write;

const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");

/// Writes the report. `about`: one line with version, device and command.
pub fn report(report: &Report, about: &str) -> String {
    let counts = report.counts();
    let bad = counts.failed + counts.errors;
    let (mark, word) = match report.failure() {
        None => ("good", "passed".to_string()),
        Some(why) => ("bad", why),
    };
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>choreo test: {}</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>choreo test <span class=\"{mark}\">{}</span></h1>\n",
        escaped_text(&word),
        escaped_text(&word),
    );
    html.push_str("<ul class=\"counts\">\n");
    let mut number = |n: usize, class: &str, what: &str| {
        if n > 0 || what == "passed" || what == "failed" {
            let _ = writeln!(html, "<li class=\"{class}\"><b>{n}</b> {what}</li>");
        }
    };
    number(counts.passed, "good", "passed");
    number(bad, if bad > 0 { "bad" } else { "" }, "failed");
    number(counts.skipped, "skip", "skipped");
    number(counts.reused, "", "reused");
    number(counts.accepted, "", "accepted");
    number(counts.checks, "", "checks");
    number(counts.warnings, "", "warnings");
    let _ = writeln!(html, "<li><b>{:.1}</b> s</li>\n</ul>", report.seconds);
    let _ = writeln!(html, "<p class=\"about\">{}</p>", escaped_text(about));
    html.push_str(
        "<p class=\"tools\"><input id=\"filter\" type=\"search\" placeholder=\"filter by file, section or text\" \
         aria-label=\"filter\"> <label><input id=\"only\" type=\"checkbox\"> failures only</label> \
         <span id=\"shown\"></span></p>\n</header>\n<main>\n",
    );
    for file in report.outcomes.chunk_by(|a, b| a.file == b.file) {
        write_file(&mut html, file);
    }
    if !report.unused_images.is_empty() {
        html.push_str("<section class=\"file\"><h2>Stored images that no section uses</h2><ul>\n");
        for path in &report.unused_images {
            let _ = writeln!(html, "<li><code>{}</code></li>", escaped_text(&display_path(path)));
        }
        html.push_str("</ul></section>\n");
    }
    let _ = write!(html, "</main>\n<script>\n{SCRIPT}</script>\n</body>\n</html>\n");
    html
}

fn escaped_text(text: &str) -> String {
    escape_xml(&printable(text))
}

fn write_file(html: &mut String, outcomes: &[Outcome]) {
    let Some(first) = outcomes.first() else { return };
    let bad = outcomes.iter().filter(|o| o.has_failed()).count();
    let _ = writeln!(
        html,
        "<section class=\"file\"><h2><code>{}</code> <span class=\"{}\">{}</span></h2>",
        escaped_text(&first.file),
        if bad > 0 { "bad" } else { "good" },
        match bad {
            0 if outcomes.len() == 1 => "1 section".to_string(),
            0 => format!("{} sections", outcomes.len()),
            n => format!("{n} of {} failed", outcomes.len()),
        }
    );
    for outcome in outcomes {
        write_section(html, outcome);
    }
    html.push_str("</section>\n");
}

fn write_section(html: &mut String, o: &Outcome) {
    let (class, word) = match &o.status {
        Status::Passed => ("good", if o.reused { "passed, reused" } else { "passed" }),
        Status::Failed => ("bad", "failed"),
        Status::Error(_) => ("bad", "error"),
        Status::Skipped(_) => ("skip", "skipped"),
    };
    let name = if o.section.is_empty() { "whole file" } else { &o.section };
    let _ = writeln!(
        html,
        "<details class=\"case {class}\"{}><summary><span class=\"{class} word\">{word}</span> {} \
         <span class=\"dim\">{}{} check{}, {:.0} ms</span></summary>",
        if o.has_failed() { " open" } else { "" },
        escaped_text(name),
        if o.place.line > 0 { format!("line {}, ", o.place.line) } else { String::new() },
        o.checks.len(),
        if o.checks.len() == 1 { "" } else { "s" },
        o.seconds * 1e3,
    );
    match &o.status {
        Status::Skipped(reason) => {
            let _ = writeln!(html, "<p>{}</p>", escaped_text(reason));
        }
        Status::Error(what) => {
            let _ = writeln!(html, "<pre class=\"bad\">{}</pre>", escaped_text(what));
        }
        _ => {}
    }
    for check in o.checks.iter().filter(|c| !c.passed) {
        write_failed_check(html, o, check);
    }
    let passed: Vec<&Check> = o.checks.iter().filter(|c| c.passed).collect();
    if !passed.is_empty() {
        html.push_str("<ul class=\"passed\">\n");
        for check in passed {
            let place = check.place.to_string();
            let by =
                if check.by.is_empty() { String::new() } else { format!(" — {}", escaped_text(&check.by)) };
            let _ = writeln!(
                html,
                "<li><code>{}</code> {}{by}</li>",
                escaped_text(&place),
                escaped_text(&check.title)
            );
        }
        html.push_str("</ul>\n");
    }
    for (title, lines) in [("warnings", &o.warnings), ("printed", &o.printed)] {
        if !lines.is_empty() {
            let _ =
                writeln!(html, "<p class=\"dim\">{title}</p><pre>{}</pre>", escaped_text(&lines.join("\n")));
        }
    }
    if o.has_failed() {
        let _ =
            writeln!(html, "<p>Alone: <code class=\"type\">{}</code></p>", escaped_text(&rerun_command(o)));
        if let Some(accept) = accept_command(o) {
            let _ = writeln!(html, "<p>Accept: <code class=\"type\">{}</code></p>", escaped_text(&accept));
        }
    }
    html.push_str("</details>\n");
}

fn write_failed_check(html: &mut String, o: &Outcome, c: &Check) {
    let _ = writeln!(
        html,
        "<div class=\"check\"><h3><code>{}</code> {}</h3>\n<dl>",
        escaped_text(&c.place.to_string()),
        escaped_text(&c.title)
    );
    let rows = [("expected", &c.expected), ("got", &c.got), ("off by", &c.by), ("hint", &c.hint)];
    for (name, value) in rows.into_iter().filter(|(_, v)| !v.is_empty()) {
        let _ = writeln!(html, "<dt>{name}</dt><dd>{}</dd>", escaped_text(value));
    }
    html.push_str("</dl>\n");
    match &c.evidence {
        Evidence::None => {}
        Evidence::Traces(traces) => html.push_str(&plots(traces)),
        Evidence::Pictures(p) => write_images(html, o, c, p),
    }
    html.push_str("</div>\n");
}

/// Shows the images side by side, alternating, and the difference. Radio buttons switch the view, so that it works without JavaScript.
fn write_images(html: &mut String, o: &Outcome, c: &Check, p: &Pictures) {
    if p.got.is_empty() {
        return;
    }
    let image = |bytes: &[u8], what: &str, class: &str| {
        let width = shown_width(bytes);
        let data = base64::engine::general_purpose::STANDARD.encode(bytes);
        format!(
            "<img class=\"{class}\" alt=\"{what}\" style=\"width:{width}px\" src=\"data:image/png;base64,{data}\">"
        )
    };
    let figure = |bytes: &[u8], what: &str| {
        format!("<figure>{}<figcaption>{what}</figcaption></figure>", image(bytes, what, ""))
    };
    if p.expected.is_empty() {
        let _ = writeln!(html, "<div class=\"side\">{}</div>", figure(&p.got, "got"));
        return;
    }
    // Both images are shown with the same width; if their sizes differ, the captions give them.
    let size = |bytes: &[u8], what: &str| match (png_size(&p.expected), png_size(&p.got)) {
        (Some(a), Some(b)) if a != b => {
            png_size(bytes).map_or(what.to_string(), |[w, h]| format!("{what}, {w}x{h} pixels"))
        }
        _ => what.to_string(),
    };
    let (expected, got) = (size(&p.expected, "expected"), size(&p.got, "got"));
    // Name of the radio group, unique on the page.
    let id = format!("p{}", &blake3_hex(&[&o.file, &o.section, &c.place.to_string(), &p.name])[..16]);
    let _ = write!(html, "<div class=\"views\">");
    let mut views = vec![
        ("side by side", "side", [figure(&p.expected, &expected), figure(&p.got, &got)].concat()),
        (
            "blink",
            "blink",
            format!(
                "<figure>{}{}<figcaption class=\"turn\"><span>{got}</span><span class=\"over\">{expected}</span></figcaption></figure>",
                image(&p.got, "got", "under"),
                image(&p.expected, "expected", "over")
            ),
        ),
    ];
    if !p.difference.is_empty() {
        let what = "difference: blue 1–2 steps of 255, orange to 15, red to 63, white beyond";
        views.push(("difference", "diff", figure(&p.difference, what)));
    }
    if !p.visible_difference.is_empty() {
        let what = "visible difference when the images alternate: black none, pale yellow the most";
        views.push(("visible difference", "seen", figure(&p.visible_difference, what)));
    }
    for (i, (name, class, _)) in views.iter().enumerate() {
        let checked = if i == 0 { " checked" } else { "" };
        let _ = write!(
            html,
            "<input type=\"radio\" name=\"{id}\" id=\"{id}{class}\" class=\"{class}\"{checked}><label for=\"{id}{class}\">{name}</label>"
        );
    }
    for (_, class, view) in views {
        let _ = write!(html, "<div class=\"view {class}\">{view}</div>");
    }
    html.push_str("</div>\n");
}

fn blake3_hex(parts: &[&str]) -> String {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// Displayed width in pixels. Small images are enlarged by a whole number, so that single pixels can be distinguished.
fn shown_width(png: &[u8]) -> u32 {
    let width = png_size(png).map_or(256, |[width, _]| width);
    width * (480 / width.max(1)).clamp(1, 4)
}

/// Width and height of a PNG.
fn png_size(png: &[u8]) -> Option<[u32; 2]> {
    let side = |at: usize| Some(u32::from_be_bytes(png.get(at..at + 4)?.try_into().ok()?));
    Some([side(16)?, side(20)?])
}
