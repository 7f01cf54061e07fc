//! `cargo xtask report [NAME…]`: error against run time of the project's numerical choices. Writes `tests/report/README.md`, and a plot of
//! each choice into `tests/report/plots/`; with names, only those sections. References are closed forms, f64, or more samples.
//!
//! To add a choice, add a file here with `pub fn section() -> Result<Section, String>`, and its line in `SECTIONS`.

mod baking;
mod bloom;
mod brdf;
mod chains;
mod compositor;
mod crossfade;
mod deferred;
mod detail;
mod displacement;
mod dithering;
mod easing;
mod effects;
mod environment_brdf;
mod far_away;
mod farm;
mod farm_model;
mod fbx;
mod film;
mod foot_locking;
mod gif;
mod glass;
mod hips;
mod ik;
mod images;
mod key_weights;
mod keys;
mod mipmaps;
mod packing;
mod parallax;
mod passes;
mod path_length;
mod rays;
mod reduction;
mod retargeting;
mod root_motion;
mod rotation;
mod samples;
mod scene_export;
mod scenes;
mod shadows;
mod skinning;
mod sky;
mod springs;
mod srgb;
mod sub_frames;
mod texture_filters;
mod time;
mod tones;
mod transitions;
mod transparency;
mod video;
mod yuv;

use choreo_bench::plots::{Choice, Table, plot};
use choreo_stage::noise::{splitmix64, unit_interval};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A section of the report.
pub struct Section {
    pub title: &'static str,
    /// Question that the section answers, and a summary of its tables.
    pub text: String,
    pub choices: Vec<Choice>,
    /// Further tables by another measure, such as distance or length.
    pub tables: Vec<Table>,
    /// Reasons why a chosen method is not on the Pareto front, by key of the choice.
    pub off_front: Vec<(&'static str, &'static str)>,
}

type Measure = fn() -> Result<Section, String>;

/// Sections by name, in the order of the report.
const SECTIONS: [(&str, Measure); 46] = [
    ("rotation", rotation::section),
    ("crossfade", crossfade::section),
    ("baking", baking::section),
    ("keys", keys::section),
    ("reduction", reduction::section),
    ("retargeting", retargeting::section),
    ("fbx", fbx::section),
    ("chains", chains::section),
    ("far_away", far_away::section),
    ("time", time::section),
    ("easing", easing::section),
    ("path_length", path_length::section),
    ("root_motion", root_motion::section),
    ("transitions", transitions::section),
    ("foot_locking", foot_locking::section),
    ("springs", springs::section),
    ("ik", ik::section),
    ("skinning", skinning::section),
    ("packing", packing::section),
    ("mipmaps", mipmaps::section),
    ("texture_filters", texture_filters::section),
    ("srgb", srgb::section),
    ("sky", sky::section),
    ("brdf", brdf::section),
    ("environment_brdf", environment_brdf::section),
    ("parallax", parallax::section),
    ("displacement", displacement::section),
    ("film", film::section),
    ("shadows", shadows::section),
    ("samples", samples::section),
    ("sub_frames", sub_frames::section),
    ("effects", effects::section),
    ("bloom", bloom::section),
    ("passes", passes::section),
    ("detail", detail::section),
    ("dithering", dithering::section),
    ("tones", tones::section),
    ("transparency", transparency::section),
    ("glass", glass::section),
    ("deferred", deferred::section),
    ("yuv", yuv::section),
    ("video", video::section),
    ("gif", gif::section),
    ("scene_export", scene_export::section),
    ("compositor", compositor::section),
    ("farm", farm::section),
];

/// Seconds spent on the timings of one choice.
pub const BUDGET_SECS: f64 = 1.0;

fn main() -> ExitCode {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    match report(&wanted) {
        Ok(()) => ExitCode::SUCCESS,
        Err(text) => {
            eprintln!("report: {text}");
            ExitCode::FAILURE
        }
    }
}

/// Folder of this crate.
fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn report(wanted: &[String]) -> Result<(), String> {
    if let Some(unknown) = wanted.iter().find(|w| !SECTIONS.iter().any(|s| s.0 == w.as_str())) {
        let names: Vec<&str> = SECTIONS.iter().map(|s| s.0).collect();
        return Err(format!("there is no section {unknown}; sections: {}", names.join(", ")));
    }
    let plots = folder().join("plots");
    std::fs::create_dir_all(&plots).map_err(|e| format!("{}: {e}", plots.display()))?;
    let mut text = String::from(INTRODUCTION);
    let mut complaints = Vec::new();
    for (name, section) in SECTIONS {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == name) {
            continue;
        }
        eprintln!("{name} …");
        let section = section().map_err(|e| format!("{name}: {e}"))?;
        complaints.extend(unexplained_defaults(&section));
        write_section(&mut text, &section, &plots)?;
        if !wanted.is_empty() {
            section.choices.iter().for_each(|c| println!("{}", c.table().text()));
            section.tables.iter().for_each(|t| println!("{}", t.text()));
        }
    }
    let path = folder().join("README.md");
    if !wanted.is_empty() {
        let page = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        text = merge_sections(&page, &text);
    }
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    match complaints.is_empty() {
        true => Ok(()),
        false => Err(complaints.join("\n")),
    }
}

/// The page with regenerated sections; sections that it lacked are added at the end.
fn merge_sections(page: &str, made: &str) -> String {
    let mut page = page.to_string();
    for section in made.split("\n## ").skip(1) {
        let title = section.lines().next().unwrap_or_default();
        let begin = page.find(&format!("\n## {title}\n"));
        let Some(begin) = begin else {
            page += &format!("\n## {}\n", section.trim_end());
            continue;
        };
        let end = page[begin + 4..].find("\n## ").map_or(page.len(), |at| begin + 4 + at);
        page.replace_range(begin..end, &format!("\n## {}\n", section.trim_end()));
    }
    page
}

const INTRODUCTION: &str = "\
# Error against run time

What each numerical choice of the project costs and how far it is from the truth: a closed form, f64 or many more samples,
never our own earlier output. `cargo xtask report` writes this page and its images; `choreo measure SCRIPT` measures the choices
that one scene could make.

Times are CPU time of one thread (of all threads for images), medians of rounds in which all ways take turns, on a shared virtual
machine with two cores (Xeon, AVX2) that is busy with other work: compare them within one table only. → marks the default. A way is
on the Pareto front (the dashed line) if no other is both cheaper and more exact; if a default is not on it and the text gives no
reason, the command fails.
";

/// Added where a section was regenerated without `cargo xtask report`.
const DEVELOPMENT_BUILD_NOTE: &str = "\nTimes of this section come from a development build with checked arithmetic: \
                           compare them only with each other.\n";

/// Messages about defaults that are not on the Pareto front and have no explanation.
fn unexplained_defaults(section: &Section) -> Vec<String> {
    let unexplained = |c: &&Choice| {
        c.chosen.is_some()
            && !c.chosen_is_on_front()
            && !section.off_front.iter().any(|(key, _)| *key == c.key)
    };
    let told = |c: &Choice| {
        let chosen = c.chosen.map_or("", |i| c.rows[i].name.as_str());
        format!("{}: {chosen} is not on the front, and no reason is given", c.key)
    };
    section.choices.iter().filter(unexplained).map(told).collect()
}

fn write_section(text: &mut String, section: &Section, plots: &Path) -> Result<(), String> {
    let _ = writeln!(text, "\n## {}\n\n{}", section.title, section.text);
    for choice in &section.choices {
        let _ = writeln!(text, "\n**{}**\n", choice.question);
        if let Some(svg) = plot(choice) {
            let path = plots.join(format!("{}.svg", choice.key));
            std::fs::write(&path, svg).map_err(|e| format!("{}: {e}", path.display()))?;
            let _ = writeln!(text, "![{}](plots/{}.svg)\n", choice.question, choice.key);
        }
        let _ = writeln!(text, "{}", choice.table().markdown().trim_end());
        // Methods of nearly the same cost change places between runs.
        let is_explained_off_front =
            |(key, _): &&(&str, &str)| *key == choice.key && !choice.chosen_is_on_front();
        for (_, why) in section.off_front.iter().filter(is_explained_off_front) {
            let _ = writeln!(text, "\nNot on the front: {why}");
        }
    }
    let timed = section.choices.iter().flat_map(|choice| &choice.rows).any(|row| row.nanos.is_some());
    if timed && cfg!(debug_assertions) {
        text.push_str(DEVELOPMENT_BUILD_NOTE);
    }
    for table in &section.tables {
        let _ = writeln!(text, "\n**{}**\n\n{}", table.title, table.markdown().trim_end());
    }
    Ok(())
}

/// Random numbers by splitmix64, the same on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        let bits = splitmix64(self.0);
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        bits
    }

    /// Uniform number in 0..1.
    pub fn unit(&mut self) -> f64 {
        unit_interval(self.bits())
    }

    /// Uniform number in −1..1.
    pub fn signed(&mut self) -> f64 {
        self.unit() * 2.0 - 1.0
    }

    /// Uniformly distributed unit vector.
    pub fn direction(&mut self) -> glam::DVec3 {
        loop {
            let v = glam::DVec3::new(self.signed(), self.signed(), self.signed());
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    pub fn rotation(&mut self) -> glam::DQuat {
        glam::DQuat::from_axis_angle(self.direction(), self.unit() * std::f64::consts::TAU)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_bench::plots::Row;

    #[test]
    fn a_default_off_the_pareto_front_needs_a_reason() {
        let mut choice = Choice::new("c", "?");
        choice.rows =
            vec![Row::new("good").error(1.0, 1.0).nanos(1.0), Row::new("bad").error(2.0, 2.0).nanos(2.0)];
        choice.choose("bad", "habit");
        let mut section = Section {
            title: "t",
            text: String::new(),
            choices: vec![choice],
            tables: Vec::new(),
            off_front: Vec::new(),
        };
        assert_eq!(unexplained_defaults(&section), ["c: bad is not on the front, and no reason is given"]);
        section.off_front.push(("c", "it is the only one that works"));
        assert!(unexplained_defaults(&section).is_empty());
    }

    #[test]
    fn a_new_section_replaces_its_old_text() {
        let page = "# A\n\n## one\n\n1\n\n## two\n\n2\n";
        assert_eq!(merge_sections(page, "# A\n\n## one\n\n11\n"), "# A\n\n## one\n\n11\n\n## two\n\n2\n");
        assert_eq!(merge_sections(page, "# A\n\n## two\n\n22\n"), "# A\n\n## one\n\n1\n\n## two\n\n22\n");
        assert_eq!(merge_sections(page, "# A\n\n## new\n\n3\n"), format!("{page}\n## new\n\n3\n"));
    }

    /// The committed page must contain exactly the existing sections.
    #[test]
    fn every_section_is_in_the_page() {
        let page = std::fs::read_to_string(folder().join("README.md")).unwrap();
        assert_eq!(page.matches("\n## ").count(), SECTIONS.len());
        for plot in page.split("](plots/").skip(1).filter_map(|rest| rest.split(')').next()) {
            assert!(folder().join("plots").join(plot).is_file(), "{plot} is missing");
        }
    }

    /// Choices that were once missing on the page. A row that is lost when the page is regenerated is noticed here.
    #[test]
    fn no_choice_is_lost_from_the_page() {
        let page = std::fs::read_to_string(folder().join("README.md")).unwrap();
        for question in [
            "How are values interpolated between \"cubic\" keys?",
            "How is the weight of a Bézier easing computed at a time?",
            "How is the length of a section of a path computed?",
            "How close are sampled keys of a retargeted clip to the motion?",
            "How is the root motion of many loops of a clip accumulated?",
            "How does one clip blend into another?",
            "How far do the feet of a walk slide?",
            "How is a texture read?",
            "How is an sRGB code decoded to light?",
            "How is light encoded to 8 bits of sRGB?",
            "How much of a light does a rough surface reflect towards the viewer?",
            "How much of an even environment does a rough surface reflect?",
            "Where is the background read behind a pane 0.25 m thick?",
            "How often is a plane with displaced waves subdivided?",
            "With how many colors and how much dithering is a frame written as GIF?",
            "How far may rotations of an FBX file be off between keys?",
            "By the extent of the scene: the default shadow within 4 m",
        ] {
            assert!(page.contains(&format!("\n**{question}")), "{question}");
        }
    }
}
