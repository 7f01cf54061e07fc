//! Images of files, made by the CPU renderer on a thread of their own and kept in the cache folder.

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

/// Pixels, 16:9.
pub const SIZE: [u32; 2] = [256, 144];
/// Share of a scene's length at which its image is taken.
const SHOWN_AT: f64 = 0.35;
/// Images of a preview: enough to see a motion.
const PREVIEW_FRAMES: u32 = 16;

/// The file, clip and character that an image shows.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Subject {
    pub file: PathBuf,
    /// A clip of the file; else its first, or the scene.
    pub clip: Option<String>,
    /// A character of the scene that plays the clip, and the scene's version.
    pub on: Option<(String, u64)>,
}

impl Subject {
    pub fn file(file: PathBuf) -> Subject {
        Subject { file, clip: None, on: None }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ClipEntry {
    pub name: String,
    pub secs: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Thumbnail {
    /// One image; of a preview several over its length.
    pub frames: Vec<Frame>,
    /// Length of a preview.
    pub secs: f64,
    /// Clips of a model's file.
    pub clips: Vec<ClipEntry>,
    /// How much of the clip a character follows.
    pub note: Option<String>,
}

/// State of an image.
#[derive(Clone, Debug)]
pub enum Made {
    Waiting,
    Ready(Arc<Thumbnail>),
    /// The file cannot be shown.
    Failed(String),
}

struct Job {
    subject: Subject,
    source: SceneSource,
    /// The character's file, for a preview.
    asset: Option<Arc<Asset>>,
}

type Finished = (Subject, Result<Thumbnail, ThumbnailError>);

/// A file that cannot be shown.
#[derive(Debug, thiserror::Error)]
enum ThumbnailError {
    #[error(transparent)]
    Session(#[from] choreo_session::WatchError),
    /// The first problem of its script or model.
    #[error("{0}")]
    Problem(String),
    #[error("it is no model")]
    NoModel,
    #[error("the file has no such clip")]
    NoClip,
    #[error(transparent)]
    Thread(#[from] std::io::Error),
    #[error(transparent)]
    Frame(#[from] choreo_session::FrameError),
    #[error(transparent)]
    NoReply(#[from] std::sync::mpsc::RecvError),
}

/// Wakes the window once an image is there.
pub type Wake = Box<dyn Fn() + Send>;

#[derive(Default)]
pub struct Thumbnails {
    known: BTreeMap<Subject, Made>,
    worker: Option<(Sender<Job>, Receiver<Finished>)>,
    /// The plugins and options of the worker; without it nothing is drawn.
    workshop: Option<(Registry, SceneSource)>,
    /// Folder in which images are kept; `None`: they are not.
    pub cache: Option<PathBuf>,
}

impl Thumbnails {
    /// `like`: options for the files, such as further folders.
    pub fn new(registry: &Registry, like: &SceneSource, cache: Option<PathBuf>) -> Thumbnails {
        Thumbnails { workshop: Some((registry.clone(), like.clone())), cache, ..Thumbnails::default() }
    }

    /// The image of a subject, which is begun where it is not known yet. `asset`: of the character that plays it.
    pub fn get(
        &mut self,
        subject: &Subject,
        asset: Option<&Arc<Asset>>,
        wake: impl FnOnce() -> Wake,
    ) -> Made {
        self.take_finished();
        if let Some(made) = self.known.get(subject) {
            return made.clone();
        }
        let made = match self.start(subject, asset, wake) {
            true => Made::Waiting,
            false => Made::Failed("images are not drawn here".to_string()),
        };
        self.known.insert(subject.clone(), made.clone());
        made
    }

    fn start(&mut self, subject: &Subject, asset: Option<&Arc<Asset>>, wake: impl FnOnce() -> Wake) -> bool {
        let Some((registry, like)) = &self.workshop else { return false };
        let worker = match self.worker.take() {
            Some(worker) => Some(worker),
            None => worker(registry.clone(), self.cache.clone(), wake()),
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
                |error| Made::Failed(error.to_string()),
                |thumbnail| Made::Ready(Arc::new(thumbnail)),
            );
            self.known.insert(subject, made);
        }
    }

    /// Files that a script reads, canonical; none where nothing is known of plugins.
    pub fn files_of(&self, script: &Path) -> Vec<PathBuf> {
        let Some((registry, like)) = &self.workshop else { return Vec::new() };
        let source = SceneSource { input: script.to_path_buf(), ..like.clone() };
        let session = Session::new(source, registry, false);
        session.map_or_else(|_| Vec::new(), |mut session| session.build(BTreeSet::new()).read)
    }

    /// Forgets what was found out about files, which may have changed; previews of older versions of the scene, too.
    pub fn forget(&mut self) {
        self.known.retain(|_, made| matches!(made, Made::Waiting));
    }

    /// How many images are still to come.
    pub fn waiting(&mut self) -> usize {
        self.take_finished();
        self.known.values().filter(|made| matches!(made, Made::Waiting)).count()
    }
}

/// A thread that works until its jobs have an end. `None` where there can be no thread.
fn worker(
    registry: Registry,
    cache: Option<PathBuf>,
    wake: Wake,
) -> Option<(Sender<Job>, Receiver<Finished>)> {
    let (jobs, taken) = channel::<Job>();
    let (done, finished) = channel();
    let work = move || {
        for job in taken {
            let subject = job.subject.clone();
            let result = kept(&registry, cache.as_deref(), job);
            if done.send((subject, result)).is_err() {
                return;
            }
            wake();
        }
    };
    std::thread::Builder::new().name("thumbnails".into()).spawn(work).ok()?;
    Some((jobs, finished))
}

/// An image from the cache, or made and kept there. Previews are not kept.
fn kept(registry: &Registry, cache: Option<&Path>, job: Job) -> Result<Thumbnail, ThumbnailError> {
    let subject = job.subject.clone();
    let file = cache
        .filter(|_| subject.on.is_none())
        .and_then(|cache| thumbnail_file::path(cache, &subject.file, subject.clip.as_deref()));
    if let Some(known) = file.as_deref().and_then(thumbnail_file::read) {
        return Ok(known);
    }
    let thumbnail = made(registry, job)?;
    if let Some(file) = file {
        thumbnail_file::write(&file, &thumbnail);
        file.parent().into_iter().for_each(|folder| thumbnail_file::limit(folder, thumbnail_file::MOST_KEPT));
    }
    Ok(thumbnail)
}

fn made(registry: &Registry, job: Job) -> Result<Thumbnail, ThumbnailError> {
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
        let (scene, secs, note) = performed(&scene, &from, clip.as_deref(), on)?;
        let times = (0..PREVIEW_FRAMES).map(|n| secs * f64::from(n) / f64::from(PREVIEW_FRAMES));
        let frames = drawn(&scene, &times.map(Time::from_secs).collect::<Vec<_>>())?;
        return Ok(Thumbnail { frames, secs, clips, note: Some(note) });
    }
    let at = Time::from_secs(scene.stage.settings.length.as_secs() * SHOWN_AT);
    Ok(Thumbnail { frames: drawn(&scene, &[at])?, secs: 0.0, clips, note: None })
}

/// A scene in which a character plays a clip of another file, its length, and how many joints follow.
fn performed(
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
    let resources = Arc::new(SceneResources::after(&SceneResources::default(), &stage));
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

fn drawn(scene: &Arc<Scene>, times: &[Time]) -> Result<Vec<Frame>, ThumbnailError> {
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
        // Motion blur would cost many images.
        renderer.ask(FrameRequest { size: SIZE, moving: true, ..request });
        let reply = reply.recv()?;
        frames.push(reply.result?.0);
    }
    Ok(frames)
}
