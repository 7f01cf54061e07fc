//! Panel of test sections: their states, expected and actual values, images side by side, and accepting images.

use super::hint::Hint;
use crate::app::Viewer;
use crate::commands::test_report::{Check, Images, Section, Status};
use crate::commands::test_run::TestSelection;
use egui::{CollapsingHeader, Color32, ColorImage, RichText, TextEdit, TextureHandle, Ui};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Size of the longer side of an image, points, depending on the room for all compared images.
const IMAGE_SIDE_RANGE: std::ops::RangeInclusive<f32> = 96.0..=220.0;
/// Indentation of the title of a section, points.
const INDENT: f32 = 24.0;

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    if viewer.commands.program.is_empty() {
        ui.label("nothing to test");
        return;
    }
    viewer.commands.set_script(viewer.path.as_deref());
    let mut choice = None;
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("tests in");
        let proposed = viewer.commands.input.display().to_string();
        ui.add(TextEdit::singleline(&mut viewer.test_path).hint_text(proposed)).labelled_by(label.id);
        if viewer.tests.is_running() {
            ui.spinner();
            if ui.button("Stop").clicked() {
                viewer.tests.stop();
            }
        } else if ui.button("Run tests").hint("all sections of this script or folder").clicked() {
            choice = Some(TestSelection::All);
        }
    });
    if let Some(why) = viewer.tests.failure() {
        ui.colored_label(ui.visuals().error_fg_color, why);
    }
    let sections = viewer.tests.sections();
    if !sections.is_empty() {
        ui.label(count_text(&sections));
    }
    let run_number = viewer.tests.runs();
    for section in
        sections.iter().filter(|s| s.has_problem()).chain(sections.iter().filter(|s| !s.has_problem()))
    {
        show_section(ui, viewer, section, run_number, &mut choice);
    }
    if let Some(choice) = choice {
        let path = match viewer.test_path.trim() {
            "" => viewer.commands.input.clone(),
            text => PathBuf::from(text),
        };
        let context = ui.ctx().clone();
        viewer.tests.start(&viewer.commands, &path, &choice, move || context.request_repaint());
    }
}

fn count_text(sections: &[Section]) -> String {
    let count_of = |status: Status| sections.iter().filter(|s| s.status == status).count();
    let all = [
        (Status::Failed, "failed"),
        (Status::Error, "with errors"),
        (Status::Passed, "passed"),
        (Status::Skipped, "skipped"),
    ];
    let parts = all.iter().map(|(status, name)| (count_of(*status), name)).filter(|(count, _)| *count > 0);
    parts.map(|(count, name)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
}

fn show_section(
    ui: &mut Ui,
    viewer: &mut Viewer,
    section: &Section,
    run_number: u64,
    choice: &mut Option<TestSelection>,
) {
    let visuals = ui.visuals();
    let (sign, color) = match section.status {
        Status::Passed => ("✔", visuals.text_color()),
        Status::Failed => ("✖", visuals.error_fg_color),
        Status::Error => ("⚠", visuals.error_fg_color),
        Status::Skipped => ("–", visuals.weak_text_color()),
    };
    let name = if section.name.is_empty() { &section.file } else { &section.name };
    let reused = if section.reused { ", reused" } else { "" };
    // The duration stays visible for long names, and nothing is wider than the panel.
    let duration = format!(" ({:.1} s{reused})", section.seconds);
    let font = egui::TextStyle::Button.resolve(ui.style());
    let end = ui.painter().layout_no_wrap(duration.clone(), font.clone(), color).size().x;
    let room = ui.available_width() - INDENT - end;
    let shown = super::truncated_text(ui.painter(), &format!("{sign} {name}"), font.size, color, room);
    let is_cut = shown.elided;
    let text: String = shown.rows.iter().map(|row| row.text()).collect();
    let title = RichText::new(format!("{text}{duration}")).color(color);
    let header = CollapsingHeader::new(title).id_salt((&section.file, &section.name));
    let header = header.default_open(section.has_problem());
    let shown = header.show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            if ui.link(format!("{}:{}", section.file, section.line)).clicked() {
                go_to_test_line(viewer, section, section.line);
            }
            if ui.add_enabled(!viewer.tests.is_running(), egui::Button::new("Run again").small()).clicked() {
                *choice = Some(TestSelection::Section(section.clone()));
            }
        });
        if !section.reason.is_empty() {
            ui.label(&section.reason);
        }
        let checks = section.checks.iter();
        for (index, check) in checks.enumerate().filter(|(_, c)| !c.passed || c.images.is_some()) {
            ui.push_id(index, |ui| show_check(ui, viewer, section, check, run_number, choice));
        }
    });
    if is_cut {
        shown.header_response.on_hover_text(name);
    }
}

/// Goes to a line of the open script; a line of another file opens in the external editor.
fn go_to_test_line(viewer: &mut Viewer, section: &Section, line: usize) {
    let shown = viewer.path.as_ref().and_then(|path| path.canonicalize().ok());
    if shown.is_some() && Path::new(&section.file).canonicalize().ok() == shown {
        viewer.script_scroll_line = Some(line);
    } else {
        viewer.note = Some(format!("this test is in {}, line {line}", section.file));
    }
}

fn show_check(
    ui: &mut Ui,
    viewer: &mut Viewer,
    section: &Section,
    check: &Check,
    run_number: u64,
    choice: &mut Option<TestSelection>,
) {
    let color = if check.passed { ui.visuals().text_color() } else { ui.visuals().error_fg_color };
    let title = RichText::new(format!("line {}: {}", check.line, check.title)).color(color);
    let label = ui.add(egui::Label::new(title).sense(egui::Sense::click()));
    if label.on_hover_cursor(egui::CursorIcon::PointingHand).clicked() {
        go_to_test_line(viewer, section, check.line);
    }
    let texts = [
        ("expected", &check.expected),
        ("got", &check.actual),
        ("off by", &check.difference_text),
        ("hint", &check.hint),
    ];
    for (name, text) in texts {
        if !text.is_empty() && !check.passed {
            ui.add(egui::Label::new(RichText::new(format!("{name}: {text}")).monospace()).wrap());
        }
    }
    let Some(images) = check.images.as_ref().filter(|_| !check.passed) else { return };
    draw_comparison(ui, images, run_number);
    let accept = ui.add_enabled(!viewer.tests.is_running(), egui::Button::new("Accept"));
    let accept =
        accept.hint(format!("the rendered image becomes the golden image {}", images.golden.display()));
    if accept.clicked() {
        *choice = Some(TestSelection::Accept(section.clone(), images.name.clone()));
    }
}

/// Draws the golden image, the rendered image and their difference, side by side.
fn draw_comparison(ui: &mut Ui, images: &Images, run_number: u64) {
    let files = [
        ("expected", images.expected.as_ref()),
        ("actual", images.actual.as_ref()),
        ("difference", images.difference.as_ref()),
    ];
    let count = files.iter().filter(|(_, file)| file.is_some()).count().max(1) as f32;
    let space = ui.spacing().item_spacing.x + 4.0;
    let side = ((ui.available_width() - INDENT) / count - space)
        .clamp(*IMAGE_SIDE_RANGE.start(), *IMAGE_SIDE_RANGE.end());
    ui.horizontal_wrapped(|ui| {
        for (name, file) in files {
            let Some(file) = file else { continue };
            ui.vertical(|ui| {
                ui.label(name);
                match load_texture(ui, file, run_number) {
                    Some(texture) => {
                        let size = texture.size_vec2();
                        let scale = side / size.max_elem().max(1.0);
                        let shown = egui::Image::new((texture.id(), size * scale.min(4.0)));
                        let response = ui.add(shown.alt_text(format!("{name} image")));
                        response.on_hover_ui(|ui| {
                            ui.label(file.display().to_string());
                            let fits = (900.0 / size.max_elem().max(1.0)).min(1.0);
                            ui.image((texture.id(), size * fits));
                        });
                    }
                    None => drop(ui.weak(format!("{} cannot be read", file.display()))),
                }
            });
            ui.add_space(4.0);
        }
    });
}

/// Textures of the images of the last results.
#[derive(Clone, Default)]
struct TestImages {
    run_number: u64,
    textures: BTreeMap<PathBuf, Option<TextureHandle>>,
}

fn load_texture(ui: &Ui, file: &Path, run_number: u64) -> Option<TextureHandle> {
    let id = egui::Id::new("images of tests");
    let mut read: Arc<TestImages> =
        ui.data_mut(|data| data.get_temp_mut_or_default::<Arc<TestImages>>(id).clone());
    if read.run_number != run_number {
        read = Arc::new(TestImages { run_number, ..TestImages::default() });
    }
    if let Some(known) = read.textures.get(file) {
        return known.clone();
    }
    let image = image::open(file).ok().map(|image| image.into_rgba8());
    let texture = image.map(|image| {
        let size = [image.width() as usize, image.height() as usize];
        let pixels = image.pixels().map(|p| Color32::from_rgba_unmultiplied(p[0], p[1], p[2], p[3]));
        let image = ColorImage::new(size, pixels.collect());
        ui.ctx().load_texture(file.display().to_string(), image, egui::TextureOptions::LINEAR)
    });
    Arc::make_mut(&mut read).textures.insert(file.to_path_buf(), texture.clone());
    ui.data_mut(|data| data.insert_temp(id, read));
    texture
}
