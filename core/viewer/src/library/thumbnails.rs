//! Thumbnails of files, drawn by the CPU renderer on a thread of its own and stored in the cache folder.

use super::thumbnail_file;
use choreo_asset::Asset;
use choreo_motion::Time;
use choreo_motion::retarget::bind_or_retarget;
use choreo_plugin::{Frame, Registry};
use choreo_render::{CpuRenderer, Renderer, SceneResources};
use choreo_session::{FrameRenderer, FrameReply, FrameRequest, Scene, SceneSource, Session};
use choreo_stage::{Cue, Evaluator, Repeat, Stage};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Width and height, pixels, 16:9.
pub const SIZE: [u32; 2] = [256, 144];
/// Time of a scene's thumbnail, as a fraction of its length.
const SCENE_TIME_FRACTION: f64 = 0.35;
/// Number of images of a preview, enough to show a motion.
const PREVIEW_FRAMES: u32 = 16;

/// The file, clip and character that a thumbnail shows.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Subject {
    pub file: PathBuf,
    /// Name of a clip in the file. `None`: the first clip, or the scene of a script.
    pub clip: Option<String>,
    /// Name of the character that plays the clip in a preview, and the version of its scene.
    pub character: Option<(String, u64)>,
}

impl Subject {
    pub fn file(file: PathBuf) -> Subject {
        Subject { file, clip: None, character: None }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ClipEntry {
    pub name: String,
    pub secs: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Thumbnail {
    /// One image, or several over the length of a preview.
    pub frames: Vec<Frame>,
    /// Length of a preview, seconds.
    pub secs: f64,
    /// Clips of a model file.
    pub clips: Vec<ClipEntry>,
    /// Note about how many joints of the character follow the clip.
    pub note: Option<String>,
}

/// State of a thumbnail.
#[derive(Clone, Debug)]
pub enum ThumbnailState {
    Waiting,
    Ready(Arc<Thumbnail>),
    /// The file cannot be displayed; with the reason.
    Failed(String),
}

struct Job {
    subject: Subject,
    source: SceneSource,
    /// Asset of the character, for a preview.
    asset: Option<Arc<Asset>>,
}

type FinishedThumbnail = (Subject, Result<Thumbnail, ThumbnailError>);

/// Reason why a file has no thumbnail.
#[derive(Debug, thiserror::Error)]
enum ThumbnailError {
    #[error(transparent)]
    Session(#[from] choreo_session::WatchError),
    /// First problem of the script or model.
    #[error("{0}")]
    Problem(String),
    #[error("the file is not a model")]
    NoModel,
    #[error("the file does not contain this clip")]
    NoClip,
    #[error(transparent)]
    Thread(#[from] std::io::Error),
    #[error(transparent)]
    Frame(#[from] choreo_session::FrameError),
    #[error(transparent)]
    NoReply(#[from] std::sync::mpsc::RecvError),
}

/// Callback that wakes the window when a thumbnail is ready.
pub type Wake = Box<dyn Fn() + Send>;

#[derive(Default)]
pub struct Thumbnails {
    known: BTreeMap<Subject, ThumbnailState>,
    worker: Option<(Sender<Job>, Receiver<FinishedThumbnail>)>,
    /// Plugins and options of the worker. `None`: no thumbnails are drawn.
    registry_and_options: Option<(Registry, SceneSource)>,
    /// Folder of cached thumbnails. `None`: no cache.
    pub cache: Option<PathBuf>,
}

impl Thumbnails {
    /// `like`: options for loading the files, such as additional folders.
    pub fn new(registry: &Registry, like: &SceneSource, cache: Option<PathBuf>) -> Thumbnails {
        Thumbnails {
            registry_and_options: Some((registry.clone(), like.clone())),
            cache,
            ..Thumbnails::default()
        }
    }

    /// State of the thumbnail of a subject; the first call starts drawing it. `asset`: asset of the character that plays the clip.
    pub fn get(
        &mut self,
        subject: &Subject,
        asset: Option<&Arc<Asset>>,
        wake: impl FnOnce() -> Wake,
    ) -> ThumbnailState {
        self.take_finished();
        if let Some(made) = self.known.get(subject) {
            return made.clone();
        }
        let made = match self.send_job(subject, asset, wake) {
            true => ThumbnailState::Waiting,
            false => ThumbnailState::Failed("the thumbnail thread is not running".to_string()),
        };
        self.known.insert(subject.clone(), made.clone());
        made
    }

    fn send_job(
        &mut self,
        subject: &Subject,
        asset: Option<&Arc<Asset>>,
        wake: impl FnOnce() -> Wake,
    ) -> bool {
        let Some((registry, like)) = &self.registry_and_options else { return false };
        let worker = match self.worker.take() {
            Some(worker) => Some(worker),
            None => start_worker(registry.clone(), self.cache.clone(), wake()),
        };
        let source = SceneSource { size: Some(SIZE), clip: subject.clip.clone(), ..like.clone() };
        let source = SceneSource { input: subject.file.clone(), ..source };
        let job = Job { subject: subject.clone(), source, asset: asset.cloned() };
        let sent = worker.as_ref().is_some_and(|(jobs, _)| jobs.send(job).is_ok());
        self.worker = worker;
        sent
    }

    fn take_finished(&mut self) {
        let Some((_, finished)) = &self.worker else { return };
        for (subject, result) in finished.try_iter() {
            let made = result.map_or_else(
                |error| ThumbnailState::Failed(error.to_string()),
                |thumbnail| ThumbnailState::Ready(Arc::new(thumbnail)),
            );
            self.known.insert(subject, made);
        }
    }

    /// Canonical paths of the files that a script reads. Empty if the plugins are unknown.
    pub fn files_of(&self, script: &Path) -> Vec<PathBuf> {
        let Some((registry, like)) = &self.registry_and_options else { return Vec::new() };
        let source = SceneSource { input: script.to_path_buf(), ..like.clone() };
        let session = Session::new(source, registry, false);
        session.map_or_else(|_| Vec::new(), |mut session| session.build(BTreeSet::new()).read_files)
    }

    /// Forgets finished thumbnails, since files may have changed, and previews of older versions of the scene.
    pub fn forget(&mut self) {
        self.known.retain(|_, made| matches!(made, ThumbnailState::Waiting));
    }

    /// Number of thumbnails that are not finished.
    pub fn waiting(&mut self) -> usize {
        self.take_finished();
        self.known.values().filter(|made| matches!(made, ThumbnailState::Waiting)).count()
    }
}

/// Starts a thread that draws thumbnails until the sender of jobs is dropped. `None` if no thread can be started.
fn start_worker(
    registry: Registry,
    cache: Option<PathBuf>,
    wake: Wake,
) -> Option<(Sender<Job>, Receiver<FinishedThumbnail>)> {
    let (jobs, taken) = channel::<Job>();
    let (done, finished) = channel();
    let work = move || {
        for job in taken {
            let subject = job.subject.clone();
            let result = cached_thumbnail(&registry, cache.as_deref(), job);
            if done.send((subject, result)).is_err() {
                return;
            }
            wake();
        }
    };
    std::thread::Builder::new().name("thumbnails".into()).spawn(work).ok()?;
    Some((jobs, finished))
}

/// A thumbnail from the cache, else drawn and stored there. Previews are not cached.
fn cached_thumbnail(
    registry: &Registry,
    cache: Option<&Path>,
    job: Job,
) -> Result<Thumbnail, ThumbnailError> {
    let subject = job.subject.clone();
    let file = cache
        .filter(|_| subject.character.is_none())
        .and_then(|cache| thumbnail_file::path(cache, &subject.file, subject.clip.as_deref()));
    if let Some(known) = file.as_deref().and_then(thumbnail_file::read) {
        return Ok(known);
    }
    let thumbnail = make_thumbnail(registry, job)?;
    if let Some(file) = file {
        thumbnail_file::write(&file, &thumbnail);
        file.parent()
            .into_iter()
            .for_each(|folder| thumbnail_file::delete_oldest(folder, thumbnail_file::MAX_CACHE_BYTES));
    }
    Ok(thumbnail)
}

fn make_thumbnail(registry: &Registry, job: Job) -> Result<Thumbnail, ThumbnailError> {
    let is_script = job.source.is_script();
    let clip = job.source.clip.clone();
    let source = SceneSource { clip: clip.clone().filter(|_| job.asset.is_none()), ..job.source };
    let mut session = Session::new(source, registry, false)?;
    let version = session.build(BTreeSet::new());
    let first = |problems: &[choreo_session::Problem]| {
        problems.first().map(|p| p.message.clone()).unwrap_or_default()
    };
    let scene = version.scene.ok_or_else(|| ThumbnailError::Problem(first(&version.problems)))?;
    let asset = scene.stage.actors.first().filter(|_| !is_script).map(|actor| actor.asset.clone());
    let clips = asset.iter().flat_map(|asset| &asset.clips);
    let clips: Vec<ClipEntry> =
        clips.map(|clip| ClipEntry { name: clip.name.clone(), secs: clip.duration.as_secs() }).collect();
    if let Some(on) = job.asset {
        let from = asset.ok_or(ThumbnailError::NoModel)?;
        let (scene, secs, note) = preview_scene(&scene, &from, clip.as_deref(), on)?;
        let times = (0..PREVIEW_FRAMES).map(|n| secs * f64::from(n) / f64::from(PREVIEW_FRAMES));
        let frames = draw_frames(&scene, &times.map(Time::from_secs).collect::<Vec<_>>())?;
        return Ok(Thumbnail { frames, secs, clips, note: Some(note) });
    }
    let at = Time::from_secs(scene.stage.settings.length.as_secs() * SCENE_TIME_FRACTION);
    Ok(Thumbnail { frames: draw_frames(&scene, &[at])?, secs: 0.0, clips, note: None })
}

/// A scene in which a character plays a clip of another file, the length of the clip in seconds, and a note about how many joints follow.
fn preview_scene(
    read: &Scene,
    from: &Asset,
    clip: Option<&str>,
    on: Arc<Asset>,
) -> Result<(Arc<Scene>, f64, String), ThumbnailError> {
    let found = from.clips.iter().find(|c| clip.is_none_or(|name| c.name == name));
    let clip = found.ok_or(ThumbnailError::NoClip)?;
    let (bound, coverage, _) = bind_or_retarget(clip, &from.skeleton, &on.skeleton);
    let mut stage = Stage::default();
    stage.settings.size = SIZE;
    let secs = clip.duration.as_secs().max(1e-3);
    stage.settings.length = Time::from_secs(secs);
    let actor = stage.cast("preview", on);
    stage.play(actor, Cue { repeat: Repeat::Once, ..Cue::new(Arc::new(bound)) });
    let stage = Arc::new(stage);
    let resources = Arc::new(SceneResources::new_reusing(&SceneResources::default(), &stage));
    let scene = Scene {
        number: 1,
        evaluator: Evaluator::new(stage.clone()),
        stage,
        resources,
        registry: read.registry.clone(),
        all_plugins: read.all_plugins.clone(),
        places: Default::default(),
        parameters: Vec::new(),
        printed: Vec::new(),
        assets: Default::default(),
        text: Default::default(),
    };
    let note = format!("{} of {} animated joints are followed", coverage.followed(), coverage.moved);
    Ok((Arc::new(scene), secs, note))
}

fn draw_frames(scene: &Arc<Scene>, times: &[Time]) -> Result<Vec<Frame>, ThumbnailError> {
    let (to, reply) = channel::<FrameReply>();
    let effects = scene.registry.effects().to_vec();
    let start = Box::new(move || {
        let renderer: Box<dyn Renderer> = Box::new(CpuRenderer::new(&effects));
        Ok((renderer, None))
    });
    let renderer = FrameRenderer::start(start, move |reply| drop(to.send(reply)))?;
    let mut frames = Vec::new();
    for (ticket, time) in times.iter().enumerate() {
        let request = FrameRequest::new(scene.clone(), *time, 4, ticket as u64);
        // Motion blur would need many sub-frames.
        renderer.request_frame(FrameRequest { size: SIZE, moving: true, ..request });
        let reply = reply.recv()?;
        frames.push(reply.result?.0);
    }
    Ok(frames)
}
