//! What is drawn, and by which renderer. What takes long (a scene's coarser levels, the light its surroundings throw
//! back, pipelines) is made in a thread of its own while the renderer at hand goes on, as far as it can follow.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::false_colour;
use super::frame_tracker::TrackedPicture;
use super::views::ViewMode;
use crate::app::input::mailbox::{Mailbox, Taken};
use crate::app::precomputed::{Onlooker, watched_renderer};
use crate::app::stopwatch::Stopwatch;
use crate::app::window::Wake;
use crate::geometry::camera::Intrinsics;
use crate::render::{Gpu, RenderError, Renderer, Shown};
use crate::scene::{Scene, Shortcuts};

/// A renderer that is wanted.
#[derive(Clone)]
struct RendererOrder {
    scene: Arc<Scene>,
    intrinsics: Intrinsics,
}

/// How far the renderer to come is with what things hide from themselves.
struct Preparing {
    /// Points that are done, and all of them; 0 where nothing is worked out.
    done_of: Mutex<[usize; 2]>,
    is_over: AtomicBool,
    wake: Wake,
}

impl Onlooker for Preparing {
    fn sees(&self, done: usize, of: usize) -> bool {
        let mut known = self.done_of.lock().unwrap_or_else(PoisonError::into_inner);
        *known = match done < of {
            true => [done.max(known[0]), of],
            false => [0; 2],
        };
        drop(known);
        (self.wake)();
        self.goes_on()
    }

    fn goes_on(&self) -> bool {
        !self.is_over.load(Ordering::Relaxed)
    }
}

struct Made {
    order: RendererOrder,
    renderer: Result<Renderer, RenderError>,
}

/// The picture of a scene that changes, through a camera that may change.
pub struct SceneCanvas {
    gpu: Arc<Gpu>,
    scene: Arc<Scene>,
    /// `None` before the first picture.
    current: Option<(RendererOrder, Renderer)>,
    orders: Arc<Mailbox<RendererOrder>>,
    made: Arc<Mailbox<Made>>,
    preparing: Arc<Preparing>,
    /// Shortcuts that are switched off.
    without: Shortcuts,
    /// Since when a renderer for the scene as it is has yet to come.
    awaited_since: Option<Stopwatch>,
    maker: Option<JoinHandle<()>>,
}

impl SceneCanvas {
    /// A canvas for a scene; `wake` is called when a better renderer is ready.
    pub fn new(gpu: Arc<Gpu>, scene: Arc<Scene>, wake: Wake) -> Self {
        let orders: Arc<Mailbox<RendererOrder>> = Arc::default();
        let made: Arc<Mailbox<Made>> = Arc::default();
        let preparing = Arc::new(Preparing {
            done_of: Mutex::default(),
            is_over: AtomicBool::new(false),
            wake: wake.clone(),
        });
        let maker = {
            let (gpu, orders, made) = (Arc::clone(&gpu), Arc::clone(&orders), Arc::clone(&made));
            let preparing = Arc::clone(&preparing);
            thread::spawn(move || {
                // Cores of its own to share: work for the frame at hand must not wait behind that for a renderer to come.
                let cores = rayon::ThreadPoolBuilder::new().build().ok();
                while let Some(order) = orders.take() {
                    let make = || {
                        watched_renderer(
                            Arc::clone(&gpu),
                            &order.scene,
                            order.intrinsics,
                            preparing.as_ref(),
                        )
                    };
                    let renderer = match &cores {
                        Some(cores) => cores.install(make),
                        None => make(),
                    };
                    if !made.put(Made { order, renderer }) {
                        return;
                    }
                    wake();
                }
            })
        };
        Self {
            gpu,
            scene,
            current: None,
            orders,
            made,
            preparing,
            without: Shortcuts::NONE,
            awaited_since: None,
            maker: Some(maker),
        }
    }

    /// Another scene, or another state of it. `lasting`: it stays so for now, and deserves its own renderer.
    pub fn set_scene(&mut self, scene: Arc<Scene>, lasting: bool) {
        let scene = self.switched(scene);
        if let Some((order, renderer)) = &mut self.current {
            let follows = renderer.follow(&scene);
            if follows {
                order.scene = Arc::clone(&scene);
            }
            if lasting || !follows {
                self.orders.put(RendererOrder {
                    scene: Arc::clone(&scene),
                    intrinsics: order.intrinsics,
                });
                self.awaited_since.get_or_insert_with(Stopwatch::start);
            }
        }
        self.scene = scene;
    }

    /// Shortcuts that are not to be taken from now on; tells whether they are others than before.
    pub fn set_without(&mut self, without: Shortcuts) -> bool {
        let changes = self.without != without;
        if changes {
            self.without = without;
            self.set_scene(Arc::clone(&self.scene), true);
        }
        changes
    }

    /// The scene without the shortcuts that are switched off.
    fn switched(&self, scene: Arc<Scene>) -> Arc<Scene> {
        if scene.shadows.without == self.without {
            return scene;
        }
        let mut switched = (*scene).clone();
        switched.shadows.without = self.without;
        Arc::new(switched)
    }

    /// Whether the scene is shown as well as can be, or a better renderer has yet to come.
    pub fn is_settled(&self) -> bool {
        self.awaited_since.is_none()
    }

    /// How long a better renderer has been awaited, milliseconds.
    pub fn awaited_ms(&self) -> Option<f64> {
        self.awaited_since.map(|since| since.elapsed_ms())
    }

    /// The part that is done, 0 to 1, of what takes the renderer to come longest; `None` where it takes no time.
    pub fn preparing(&self) -> Option<f32> {
        let known = self.preparing.done_of.lock();
        let [done, of] = *known.unwrap_or_else(PoisonError::into_inner);
        (of > 0).then(|| done as f32 / of as f32)
    }

    /// Takes a better renderer if one is ready; tells whether.
    ///
    /// # Errors
    /// It could not be made.
    pub fn improve(&mut self) -> Result<bool, RenderError> {
        let Taken::New(made) = self.made.take_within(Duration::ZERO) else {
            return Ok(false);
        };
        let mut renderer = made.renderer?;
        let is_of_now = Arc::ptr_eq(&made.order.scene, &self.scene);
        // What was edited meanwhile, it may follow.
        if !is_of_now && !renderer.follow(&self.scene) {
            return Ok(false);
        }
        let fits =
            |(order, _): &(RendererOrder, Renderer)| order.intrinsics == made.order.intrinsics;
        if !self.current.as_ref().is_some_and(fits) {
            return Ok(false);
        }
        if is_of_now {
            self.awaited_since = None;
        }
        let order = RendererOrder {
            scene: Arc::clone(&self.scene),
            ..made.order
        };
        self.current = Some((order, renderer));
        Ok(true)
    }

    /// Draws a picture; it is then the renderer's.
    ///
    /// # Errors
    /// The device failed, or cannot hold a picture of that size.
    pub fn draw(&mut self, picture: &TrackedPicture, view: ViewMode) -> Result<(), RenderError> {
        let fits = |(order, _): &(RendererOrder, Renderer)| order.intrinsics == picture.intrinsics;
        if !self.current.as_ref().is_some_and(fits) {
            self.begin(picture.intrinsics)?;
        }
        let Some((order, renderer)) = &mut self.current else {
            return Ok(());
        };
        renderer.upload(&picture.frame)?;
        let placed = picture.camera_from_nodes(&order.scene);
        let visibility: Vec<f64> = picture.poses.iter().map(|pose| pose.visibility).collect();
        // Poses of other anchors than the scene's are none.
        let visibility = match picture.is_of(&order.scene) {
            true => order.scene.of_nodes(&visibility),
            false => vec![0.0; placed.len()],
        };
        let shown = match view {
            ViewMode::Bare => Shown::Bare,
            _ => Shown::Composite,
        };
        renderer.set_time(picture.frame.time_secs);
        renderer.draw_fading(&placed, &visibility, shown);
        let size_px = picture.intrinsics.size_px;
        let replaced = match view {
            ViewMode::Composite | ViewMode::Bare | ViewMode::Silhouettes | ViewMode::Volumes => {
                None
            }
            ViewMode::StencilCount => {
                let role = renderer.layers()?.role;
                Some(false_colour::counts(&renderer.stencil_counts()?, &role))
            }
            ViewMode::Depth => Some(false_colour::depth(&renderer.layers()?.depth_m)),
            ViewMode::Gain => Some(false_colour::gain(&renderer.layers()?.gain)),
            ViewMode::Phantoms => {
                let focal_px = picture.intrinsics.focal_px.x as f32;
                renderer.draw(&placed, Shown::Bare);
                let (layers, video) = (renderer.layers()?, renderer.read_picture()?);
                Some(false_colour::phantoms(&video, &layers, size_px, focal_px))
            }
        };
        if let Some(rgba) = replaced {
            renderer.replace_picture(&rgba);
        }
        Ok(())
    }

    /// The renderer that drew last, and the pictures' size; `None` before the first picture.
    pub fn renderer(&self) -> Option<(&Renderer, [u32; 2])> {
        let (order, renderer) = self.current.as_ref()?;
        Some((renderer, order.intrinsics.size_px))
    }

    /// Takes note of what the last picture took to draw, milliseconds, for the scene's frame budget.
    pub fn spent(&mut self, frame_ms: f64) {
        if let Some((_, renderer)) = &mut self.current {
            renderer.spent(frame_ms);
        }
    }

    /// Another camera: the video is shown at once, its things follow.
    fn begin(&mut self, intrinsics: Intrinsics) -> Result<(), RenderError> {
        let empty = Arc::new(self.scene.without_things());
        let renderer =
            crate::app::precomputed::renderer(Arc::clone(&self.gpu), &empty, intrinsics)?;
        let order = RendererOrder {
            scene: empty,
            intrinsics,
        };
        self.current = Some((order, renderer));
        self.orders.put(RendererOrder {
            scene: Arc::clone(&self.scene),
            intrinsics,
        });
        self.awaited_since.get_or_insert_with(Stopwatch::start);
        Ok(())
    }
}

impl Drop for SceneCanvas {
    fn drop(&mut self) {
        self.orders.close();
        self.made.close();
        self.preparing.is_over.store(true, Ordering::Relaxed);
        if let Some(maker) = self.maker.take() {
            // A panic in it has been told on stderr.
            _ = maker.join();
        }
    }
}
