//! Panel for renders and exports: what to render, the output, and the queue.

use super::hint::Hint;
use super::icons;
use super::values::set_widget_name;
use crate::app::Viewer;
use crate::commands::queue::{Job, JobState};
use crate::commands::{Format, OutputKind};
use crate::state::render_form::{FormScene, Range, RenderForm, Size, free_output};
use egui::{Button, ComboBox, DragValue, Grid, Label, ProgressBar, RichText, TextEdit, Ui, WidgetType};
use std::path::Path;

/// Range of a render's width and height, pixels.
const IMAGE_SIDE_RANGE: std::ops::RangeInclusive<u32> = 1..=16_384;

pub(super) fn show(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(of_scene) = viewer.scene.clone().filter(|_| !viewer.commands.program.is_empty()) else {
        ui.label("nothing to render yet");
        return;
    };
    viewer.commands.set_script(viewer.path.as_deref());
    let input = viewer.commands.input.clone();
    let settings = &of_scene.stage.settings;
    let fps = viewer.playhead.fps();
    let frame = |secs: f64| (secs * fps.as_fps()).round() as i64;
    let scene = FormScene {
        input: &input,
        frames: fps.frames_in(settings.length).max(1),
        shown: [frame(viewer.visible_span.from.max(0.0)), frame(viewer.visible_span.to) - 1],
        playhead: viewer.playhead.frame(),
        size: settings.size,
    };
    let formats = std::mem::take(&mut viewer.commands.formats);
    let form = &mut viewer.render_form;
    form.format = form.format.min(formats.len().saturating_sub(1));
    if let Some(format) = formats.get(form.format) {
        Grid::new("render").num_columns(2).show(ui, |ui| show_fields(ui, form, &scene, &formats));
        let request = form.request(&scene, format);
        let jobs = viewer.renders.jobs();
        let writer = jobs.iter().find(|job| job.is_unfinished_writer_of(&request.output));
        ui.horizontal_wrapped(|ui| {
            let what = if format.kind == OutputKind::Scene { "Export" } else { "Render" };
            let add = ui.add_enabled(writer.is_none(), Button::new(RichText::new(what).strong()));
            let add = add.hint(request.about.clone());
            if let Some(writer) = writer {
                ui.colored_label(ui.visuals().warn_fg_color, busy_output_message(writer));
                let is_taken = |path: &Path| jobs.iter().any(|job| job.is_unfinished_writer_of(path));
                let free = free_output(&request.output, is_taken);
                if ui
                    .button(format!("Write {}", shown_name(&free)))
                    .hint(free.display().to_string())
                    .clicked()
                {
                    form.output = free.display().to_string();
                }
            } else if request.output.exists() {
                ui.colored_label(ui.visuals().warn_fg_color, "replaces the file");
            }
            if add.clicked() {
                let context = ui.ctx().clone();
                viewer.renders.add(&viewer.commands, request, move || context.request_repaint());
            }
        });
    }
    viewer.commands.formats = formats;
    ui.separator();
    show_queue(ui, viewer);
}

fn show_fields(ui: &mut Ui, form: &mut RenderForm, scene: &FormScene, formats: &[Format]) {
    let format = &formats[form.format];
    ui.label("format");
    let combo = ComboBox::from_id_salt("format").selected_text(format_name(format)).show_ui(ui, |ui| {
        for (index, one) in formats.iter().enumerate() {
            ui.selectable_value(&mut form.format, index, format_name(one)).hint(&one.about);
        }
    });
    set_widget_name(combo.response, WidgetType::ComboBox, "format");
    ui.end_row();

    let label = ui.label("output");
    let proposed = form.proposed_output(scene, format).display().to_string();
    ui.add(TextEdit::singleline(&mut form.output).hint_text(proposed)).labelled_by(label.id);
    ui.end_row();

    ui.label("frames");
    ui.horizontal_wrapped(|ui| {
        let ranges = [
            (Range::Whole, "all"),
            (Range::VisibleInTimeline, "those shown"),
            (Range::Playhead, "this one"),
            (Range::Chosen, "from … to"),
        ];
        let [first, last] = form.frames(scene);
        for (range, name) in ranges {
            if ui.selectable_label(form.range == range, name).clicked() {
                form.range = range;
                form.chosen_frames = [first, last];
            }
        }
        match form.range {
            Range::Chosen => {
                form.chosen_frames.iter_mut().zip(["first frame", "last frame"]).for_each(|(at, name)| {
                    let value = ui.add(DragValue::new(at).range(0..=scene.frames - 1));
                    set_widget_name(value, WidgetType::DragValue, name).hint(name);
                })
            }
            _ => drop(ui.add(Label::new(format!("{first} to {last}")).extend())),
        }
    });
    ui.end_row();
    if format.kind != OutputKind::Scene {
        show_image_fields(ui, form, scene);
    }

    let label = ui.label("options");
    let names: Vec<&str> = format.options.iter().map(|(name, _)| name.as_str()).collect();
    let hint = match names.first() {
        Some(first) => format!("{first}=…"),
        None => "none".to_string(),
    };
    let field = TextEdit::singleline(&mut form.options).hint_text(hint);
    let all = format.options.iter().map(|(name, about)| format!("{name}: {about}"));
    let field = ui.add_enabled(!names.is_empty(), field).labelled_by(label.id);
    field.hint(all.collect::<Vec<_>>().join("\n"));
    ui.end_row();
}

fn show_image_fields(ui: &mut Ui, form: &mut RenderForm, scene: &FormScene) {
    ui.label("size");
    ui.horizontal_wrapped(|ui| {
        let scales = [(1, 4, "¼"), (1, 2, "½"), (1, 1, "as written"), (2, 1, "double")];
        let pixels = form.image_size(scene);
        for (numerator, denominator, name) in scales {
            ui.selectable_value(&mut form.size, Size::Scaled(numerator, denominator), name);
        }
        if ui.selectable_label(form.size == Size::Chosen, "pixels").clicked() {
            form.size = Size::Chosen;
            form.chosen_size = pixels;
        }
        match form.size {
            Size::Chosen => form.chosen_size.iter_mut().zip(["width", "height"]).for_each(|(side, name)| {
                let value = ui.add(DragValue::new(side).range(IMAGE_SIDE_RANGE));
                set_widget_name(value, WidgetType::DragValue, name).hint(name);
            }),
            Size::Scaled(..) => drop(ui.add(Label::new(format!("{}×{}", pixels[0], pixels[1])).extend())),
        }
    });
    ui.end_row();

    ui.label("quality");
    ui.horizontal_wrapped(|ui| {
        let all = [(None, "as written"), (Some(1), "draft"), (Some(4), "smooth edges")];
        for (samples, name) in all {
            ui.selectable_value(&mut form.samples, samples, name);
        }
    });
    ui.end_row();
}

fn format_name(format: &Format) -> String {
    let what = match format.kind {
        OutputKind::Film => "film",
        OutputKind::Images => "images",
        OutputKind::Scene => "scene",
    };
    format!(".{} ({what})", format.extension)
}

/// Message that another job already writes to the output.
fn busy_output_message(job: &Job) -> String {
    let name = shown_name(&job.output);
    match job.state {
        JobState::Waiting => format!("{name} will be written by a waiting {}", job.command),
        _ => format!("{name} is being written by a running {}", job.command),
    }
}

/// List of jobs, the newest at the bottom. A click on the cross cancels a job, or removes a finished one.
fn show_queue(ui: &mut Ui, viewer: &Viewer) {
    let jobs = viewer.renders.jobs();
    if jobs.is_empty() {
        ui.weak("Renders run one after the other in the background. Each shows the script as it is saved when the render begins.");
    }
    for job in jobs {
        ui.push_id(job.number, |ui| {
            ui.horizontal(|ui| {
                let is_cancelable = matches!(job.state, JobState::Running { .. } | JobState::Waiting);
                let (icon, name) =
                    if is_cancelable { (icons::X, "Cancel") } else { (icons::TRASH, "Remove") };
                if icons::small_button(ui, icon, name, "").clicked() {
                    viewer.renders.cancel(job.number);
                }
                let name = shown_name(&job.output);
                let label = ui.add(egui::Label::new(RichText::new(name).strong()).truncate());
                label.hint(format!("{}\n{}", job.output.display(), job.about));
            });
            show_job_state(ui, &job);
        });
        ui.separator();
    }
}

/// Displayed name of an output. Numbered images include their folder, which distinguishes them.
fn shown_name(output: &Path) -> String {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    match output.parent().map(name).filter(|folder| !folder.is_empty() && name(output).contains('%')) {
        Some(folder) => format!("{folder}/{}", name(output)),
        None => name(output),
    }
}

fn show_job_state(ui: &mut Ui, job: &Job) {
    let visuals = ui.visuals();
    let (error, weak) = (visuals.error_fg_color, visuals.weak_text_color());
    match &job.state {
        JobState::Waiting => drop(ui.colored_label(weak, format!("waits: {}", job.about))),
        JobState::Running { frames: 0, .. } => {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label("reading the scene");
            });
        }
        JobState::Running { done, frames } => {
            let part = *done as f32 / (*frames).max(1) as f32;
            ui.add(ProgressBar::new(part).text(format!("{done} of {frames} frames")));
        }
        JobState::Finished(text) => drop(ui.label(text)),
        JobState::Failed(text) => drop(ui.colored_label(error, text)),
        JobState::Canceled => drop(ui.colored_label(weak, "canceled: no file was written")),
    }
}
