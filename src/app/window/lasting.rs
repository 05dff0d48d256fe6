//! A window whose content outlives the device that shows it: where a GPU is lost, the window is opened again on a new one, and
//! what it shows goes on.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use anyhow::{Result, anyhow};
use eframe::egui::{Color32, Context, Ui, ViewportCommand};
use winit::event_loop::EventLoop;
use winit::platform::run_on_demand::EventLoopExtRunOnDemand as _;

use super::event_loop::{PassEnd, Passes, is_lost};
use super::opening;
use crate::app::talk;
use crate::capture::live::Now;
use crate::render::Gpu;

/// Passes in which a new device has to hold out; one that does not will not hold out longer the next time.
const LEAST_PASSES: u32 = 5;

/// What a window shows.
pub trait Content {
    /// Is shown on another device from now on, by another context.
    fn renew(&mut self, gpu: &Arc<Gpu>, creation: &eframe::CreationContext<'_>) -> Result<()>;
    /// Moves on, before it is shown.
    fn logic(&mut self, ctx: &Context);
    /// Is shown.
    fn ui(&mut self, ui: &mut Ui);
    /// The window is closed for good.
    fn close(&mut self) {}
}

/// A window that is to be opened.
pub struct LastingWindow<'a> {
    /// Its title.
    pub title: &'a str,
    /// Part of the wanted adapter's name.
    pub adapter: Option<&'a str>,
    /// The clock that passes are timed with.
    pub now: Now,
    /// Where their ends are noted.
    pub pass_end: PassEnd,
}

/// The content, once there is any.
type Kept<C> = Rc<RefCell<Option<C>>>;

impl LastingWindow<'_> {
    /// Shows what `begin` makes when the window is there, until it is closed.
    ///
    /// # Errors
    /// No adapter, no display, what `begin` says; a device that was lost and cannot be replaced. The content is closed then.
    pub fn show<C: Content + 'static>(
        &self,
        begin: impl FnOnce(&Arc<Gpu>, &eframe::CreationContext<'_>) -> Result<C> + 'static,
    ) -> Result<()> {
        let kept: Kept<C> = Rc::default();
        let mut begin = Some(begin);
        let mut gpu = Arc::new(Gpu::open(self.adapter)?);
        let mut event_loop = opening::event_loop()?;
        loop {
            let passes = Arc::new(AtomicU32::new(0));
            let ran = self.run(&mut event_loop, (&gpu, &passes), &kept, begin.take());
            let failure = match (ran, gpu.check()) {
                (Ok(()), Err(error)) if error.ends_a_device() => {
                    match passes.load(Ordering::Relaxed) {
                        0..LEAST_PASSES => Some(error.into()),
                        _ => {
                            talk::say(format_args!("{error}; a new device is opened"));
                            Gpu::open(self.adapter).map_or_else(
                                |again| Some(anyhow!("{error}, and no other opens: {again}")),
                                |opened| {
                                    gpu = Arc::new(opened);
                                    None
                                },
                            )
                        }
                    }
                }
                (ran, _) => return ran,
            };
            if let Some(failure) = failure {
                if let Some(content) = kept.borrow_mut().as_mut() {
                    content.close();
                }
                return Err(failure);
            }
        }
    }

    /// Opens the window on a device, until it is closed or the device lost.
    fn run<C: Content + 'static>(
        &self,
        event_loop: &mut EventLoop<eframe::UserEvent>,
        (gpu, passes): (&Arc<Gpu>, &Arc<AtomicU32>),
        kept: &Kept<C>,
        begin: Option<impl FnOnce(&Arc<Gpu>, &eframe::CreationContext<'_>) -> Result<C> + 'static>,
    ) -> Result<()> {
        let is_open = Arc::new(AtomicBool::new(false));
        let window = OnDevice {
            gpu: Arc::clone(gpu),
            kept: Rc::clone(kept),
            passes: Arc::clone(passes),
        };
        let opened = Arc::clone(&is_open);
        let creator = move |creation: &eframe::CreationContext<'_>| {
            let mut place = window.kept.borrow_mut();
            match (place.as_mut(), begin) {
                (Some(content), _) => content.renew(&window.gpu, creation)?,
                (None, Some(begin)) => *place = Some(begin(&window.gpu, creation)?),
                (None, None) => {}
            }
            drop(place);
            opened.store(true, Ordering::Relaxed);
            Ok(Box::new(window) as Box<dyn eframe::App>)
        };
        let options = opening::options(gpu);
        let application = eframe::create_native(self.title, options, Box::new(creator), event_loop);
        event_loop.run_app_on_demand(&mut Passes {
            application,
            gpu: Arc::clone(gpu),
            now: Arc::clone(&self.now),
            pass_end: self.pass_end.clone(),
            is_broken: false,
        })?;
        match is_lost(gpu) {
            true => Ok(()),
            false => opening::assure(&is_open),
        }
    }
}

/// The window as long as its device lasts.
struct OnDevice<C> {
    gpu: Arc<Gpu>,
    kept: Kept<C>,
    passes: Arc<AtomicU32>,
}

impl<C: Content> eframe::App for OnDevice<C> {
    fn logic(&mut self, ctx: &Context, _: &mut eframe::Frame) {
        if is_lost(&self.gpu) {
            return ctx.send_viewport_cmd(ViewportCommand::Close);
        }
        self.passes.fetch_add(1, Ordering::Relaxed);
        if let Some(content) = self.kept.borrow_mut().as_mut() {
            content.logic(ctx);
        }
    }

    fn ui(&mut self, ui: &mut Ui, _: &mut eframe::Frame) {
        // Nothing is drawn any more: egui's painter would panic.
        if is_lost(&self.gpu) {
            return ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
        if let Some(content) = self.kept.borrow_mut().as_mut() {
            content.ui(ui);
        }
    }

    fn clear_color(&self, _: &eframe::egui::Visuals) -> [f32; 4] {
        Color32::BLACK.to_normalized_gamma_f32()
    }

    fn on_exit(&mut self) {
        if let (false, Some(content)) = (is_lost(&self.gpu), self.kept.borrow_mut().as_mut()) {
            content.close();
        }
    }
}
