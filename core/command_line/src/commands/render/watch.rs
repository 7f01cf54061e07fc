//! `choreo render --watch`: after every save, the affected frames are drawn again and the output is rewritten.

use crate::args::RenderArgs;
use crate::args::values;
use crate::commands::render::draw;
use crate::commands::render::summary;
use crate::drawing::device;
use crate::drawing::frame_cache::CachingRenderer;
use crate::drawing::pipeline::render_failure;
use crate::failure::{Failure, print, print_message};
use crate::output::target::Target;
use crate::process::interrupt;
use crate::process::memory;
use crate::scene;
use crate::scene::opening::ReopenState;
use choreo_plugin::Registry;
use choreo_script::content_of;
use choreo_session::package::FILE_ENDINGS;
use choreo_session::{Watch, WatchEvent, WatchedPaths};
use std::path::Path;
use std::time::{Duration, Instant};

pub(super) fn run(args: &RenderArgs, plugins: &Registry) -> Result<(), Failure> {
    let jobs = args.jobs.as_deref().map(values::parse_jobs).transpose()?;
    let target = Target::parse(&args.output)?;
    if target == Target::Stdout {
        return Err(Failure::Usage(
            "--watch rewrites a file after each change; it cannot write to standard output".into(),
        ));
    }
    let failed = |e: choreo_session::WatchError| Failure::input(format!("--watch: {e}"));
    let mut watch = Watch::new().map_err(failed)?;
    let started = device::start_renderer(args.device, plugins.effects()).wait()?;
    let renderer = CachingRenderer::new(started.renderer);
    let (mut note, reason) = (started.note, started.reason);
    let reopen_state = ReopenState::default();
    loop {
        let start = Instant::now();
        let render_once = || {
            let registry = scene::registry_with_plugin_files(&args.scene, plugins)?;
            let job = super::prepare_job(args, target.clone(), &registry, Some(&reopen_state))?;
            renderer.begin_render().map_err(render_failure)?;
            let started = device::StartedRenderer {
                renderer: Box::new(renderer.clone()),
                time: None,
                stages: None,
                note: note.take(),
                reason: reason.clone(),
            };
            let mut drawn = draw::draw_job(args, &job, started, jobs)?;
            drawn.counts.drawn -= renderer.reused_frames().min(drawn.counts.drawn);
            summary::report(args, &job, &drawn, start.elapsed().as_secs_f64())
        };
        // The next save may correct the error.
        match { render_once }() {
            Ok(()) => {}
            Err(failure @ (Failure::Interrupted | Failure::ClosedPipe | Failure::Usage(_))) => {
                return Err(failure);
            }
            Err(failure) => failure.message_lines().iter().for_each(print_message),
        }
        watch.set(paths_to_watch(args, &reopen_state));
        memory::stop_guard();
        let changed = loop {
            match watch.wait(Some(Duration::from_millis(200))).map_err(failed)? {
                WatchEvent::Changed(files) => break files,
                _ if interrupt::is_interrupted() => return Err(Failure::Interrupted),
                _ => {}
            }
        };
        if !args.quiet && !args.json {
            let names: Vec<String> =
                changed.iter().map(|f| choreo_test_runner::collect::display_path(f)).collect();
            print(&format!("changed: {}\n", names.join(", ")))?;
        }
    }
}

/// Files of the last round, and folders in which plugin files would be found.
fn paths_to_watch(args: &RenderArgs, reopen_state: &ReopenState) -> WatchedPaths {
    let dependencies = reopen_state.dependencies();
    let mut paths_to_watch = WatchedPaths::default();
    paths_to_watch.files.extend(dependencies.read.into_iter().map(|(path, hash)| (path, Some(hash))));
    for path in dependencies.missing_or_linked_paths {
        let content = content_of(&path);
        paths_to_watch.files.entry(path).or_insert(content);
    }
    let named = &args.scene.import.plugins;
    let inputs = [args.scene.input.as_path()];
    if let Ok(listing) =
        choreo_session::plugin_files::list_plugin_files(&Registry::default(), named, &inputs, None)
    {
        for file in listing.files() {
            paths_to_watch.files.entry(file.to_path_buf()).or_insert_with(|| content_of(file));
        }
        for folder in listing.folders {
            if let Ok(folder) = std::path::absolute(folder) {
                let folder = folder.canonicalize().unwrap_or(folder);
                paths_to_watch.folders.extend(FILE_ENDINGS.iter().map(|e| (folder.clone(), e.to_string())));
            }
        }
    }
    // If a render fails before it has read a file, its input is watched.
    if let Ok(input) = std::path::absolute(Path::new(&args.scene.input)) {
        let input = input.canonicalize().unwrap_or(input);
        let content = content_of(&input);
        paths_to_watch.files.entry(input).or_insert(content);
    }
    paths_to_watch
}
