//! A renderer that keeps its frames for `render --watch`. `--set-from` uses it to share one renderer between films, and keeps no frames.
//!
//! A frame is identified by its content: its plan, the scene resources, the effects and the device. The same content at another time, or in
//! another version of the script, is not drawn again.

use super::png_frame::{decode_png, encode_png};
use choreo_plugin::{Effect, FloatFrame, Frame, FrameWish};
use choreo_render::plan::frame_key::{Key, frame_key};
use choreo_render::renderer::CreatedCounts;
use choreo_render::{DeviceInfo, Plan, RenderError, Renderer, SceneResources};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Largest total size of kept frames in bytes, compressed.
const MAX_CACHED_BYTES: usize = 512 << 20;

/// A renderer with a cache of its frames. Clones share one renderer and one cache.
#[derive(Clone)]
pub(crate) struct CachingRenderer {
    shared: Arc<Mutex<SharedCache>>,
    device: DeviceInfo,
}

struct SharedCache {
    renderer: Box<dyn Renderer>,
    resources: Arc<SceneResources>,
    effects: Vec<Effect>,
    /// Whether frames are kept.
    keeps_frames: bool,
    frames: BTreeMap<Key, CachedFrame>,
    bytes: usize,
    /// Frames submitted and not yet collected: the key, and whether the renderer draws the frame.
    queue: VecDeque<(Key, bool)>,
    /// Number of the current render.
    render_number: u64,
    reused: u64,
}

struct CachedFrame {
    png: Vec<u8>,
    /// Number of the render that last requested the frame.
    render_number: u64,
}

impl CachingRenderer {
    pub(crate) fn new(renderer: Box<dyn Renderer>) -> CachingRenderer {
        let device = renderer.device().clone();
        let shared = SharedCache {
            renderer,
            resources: Arc::default(),
            effects: Vec::new(),
            keeps_frames: true,
            frames: BTreeMap::new(),
            bytes: 0,
            queue: VecDeque::new(),
            render_number: 0,
            reused: 0,
        };
        CachingRenderer { shared: Arc::new(Mutex::new(shared)), device }
    }

    /// Creates a renderer that is shared by renders of different films; their frames are not kept.
    pub(crate) fn without_cache(renderer: Box<dyn Renderer>) -> CachingRenderer {
        let caching = CachingRenderer::new(renderer);
        caching.shared().keeps_frames = false;
        caching
    }

    /// Begins a new render: no frame is in flight, and none has been reused.
    pub(crate) fn begin_render(&self) -> Result<(), RenderError> {
        let mut shared = self.shared();
        shared.render_number += 1;
        shared.reused = 0;
        // Discards the frames in flight of a render that failed.
        while let Some((_, drawn)) = shared.queue.pop_front() {
            if drawn {
                shared.renderer.collect(None)?;
            }
        }
        Ok(())
    }

    /// Number of frames of this render that were taken from the cache.
    pub(crate) fn reused_frames(&self) -> u64 {
        self.shared().reused
    }

    fn shared(&self) -> MutexGuard<'_, SharedCache> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Renderer for CachingRenderer {
    fn device(&self) -> &DeviceInfo {
        &self.device
    }

    fn frames_in_flight(&self) -> usize {
        self.shared().renderer.frames_in_flight()
    }

    fn load(&mut self, resources: Arc<SceneResources>) -> Result<(), RenderError> {
        let mut shared = self.shared();
        shared.resources = resources.clone();
        shared.renderer.load(resources)
    }

    fn submit(&mut self, plan: Plan) -> Result<(), RenderError> {
        let mut shared = self.shared();
        // Float frames are too large to be kept.
        if !shared.keeps_frames || plan.wish != FrameWish::Bytes {
            shared.renderer.submit(plan)?;
            shared.queue.push_back((Key::default(), true));
            return Ok(());
        }
        let key = frame_key(&plan, &shared.resources, &shared.effects);
        // A frame that is still being drawn counts as known: it will be stored before this one is collected.
        let is_in_flight = shared.queue.iter().any(|(k, _)| *k == key);
        let drawn = !is_in_flight && !shared.frames.contains_key(&key);
        if drawn {
            shared.renderer.submit(plan)?;
        }
        // Marks the frame as used in this render, so that it is not dropped before it is collected.
        let render_number = shared.render_number;
        if let Some(known) = shared.frames.get_mut(&key) {
            known.render_number = render_number;
        }
        shared.queue.push_back((key, drawn));
        Ok(())
    }

    fn collect(&mut self, reuse: Option<Frame>) -> Result<Frame, RenderError> {
        let mut shared = self.shared();
        let Some((key, drawn)) = shared.queue.pop_front() else {
            return Err(RenderError::Usage(
                "no frame is submitted: submit a plan before you collect a frame".into(),
            ));
        };
        if drawn {
            let frame = shared.renderer.collect(reuse)?;
            if shared.keeps_frames {
                shared.cache_frame(key, &frame);
            }
            return Ok(frame);
        }
        shared.reused += 1;
        let frame = shared.frames.get(&key).and_then(|known| decode_png(&known.png, |_| true));
        frame.ok_or_else(|| RenderError::Usage("a cached frame was dropped before it was collected".into()))
    }

    fn collect_floats(&mut self) -> Result<FloatFrame, RenderError> {
        let mut shared = self.shared();
        shared.queue.pop_front();
        shared.renderer.collect_floats()
    }

    fn set_effects(&mut self, effects: &[Effect]) -> Result<(), RenderError> {
        let mut shared = self.shared();
        shared.effects = effects.to_vec();
        shared.renderer.set_effects(effects)
    }

    fn reload_shaders(&mut self) -> Result<(), RenderError> {
        let mut shared = self.shared();
        shared.frames.clear();
        shared.bytes = 0;
        shared.renderer.reload_shaders()
    }

    fn created_counts(&self) -> CreatedCounts {
        self.shared().renderer.created_counts()
    }

    fn take_notes(&mut self) -> Vec<String> {
        self.shared().renderer.take_notes()
    }
}

impl SharedCache {
    fn cache_frame(&mut self, key: Key, frame: &Frame) {
        // Speed matters more than size: the PNG never leaves this process.
        let Ok(png) = encode_png(frame, png::Compression::Fastest) else { return };
        if self.bytes + png.len() > MAX_CACHED_BYTES {
            // Frames of earlier versions go first.
            let render_number = self.render_number;
            self.frames.retain(|_, known| known.render_number == render_number);
            self.bytes = self.frames.values().map(|known| known.png.len()).sum();
        }
        // The frames of this render will be drawn again in the same order: the first ones are kept, and the rest is drawn each time. Frames
        // that are waited for belong to this render, and are never dropped.
        let waited_for = self.queue.iter().any(|(k, _)| *k == key);
        if self.bytes + png.len() <= MAX_CACHED_BYTES || waited_for {
            self.bytes += png.len();
            self.frames.insert(key, CachedFrame { png, render_number: self.render_number });
        }
    }
}
