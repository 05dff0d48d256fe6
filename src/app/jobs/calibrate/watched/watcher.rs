//! The threads beside the window: one reads the camera, one looks for the target, takes views and solves. The window is
//! shown every picture; the second thread looks at the newest.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::{Result, anyhow};
use glam::DVec2;

use super::Held;
use crate::app::input::live_capture::{Arrived, CaptureEvent, LiveCapture, Tap, Tapped};
use crate::app::input::mailbox::{Mailbox, Taken};
use crate::app::window::Wake;
use crate::calibration::{
    CalibrateError, Coverage, FEWEST_VIEWS, Lack, Moment, Taker, TargetView, solve,
};
use crate::capture::Frame;
use crate::capture::live::{LiveOptions, Now};
use crate::tracking::grey_from_rgba;

/// How soon an order is obeyed while no picture comes.
const PATIENCE: Duration = Duration::from_millis(50);

/// An instruction of the person at the window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WatcherOrder {
    /// The next picture is a view, wherever the target is.
    Take,
    /// The view that was taken last is none.
    DropLast,
}

/// The state of the views after a picture.
#[derive(Debug, Clone)]
pub struct ViewsStanding {
    /// What became of the picture; `None` after an order.
    pub moment: Option<Moment>,
    /// Width and height of the pictures.
    pub size_px: [u32; 2],
    /// The outline of the target and its inner corners, where it was found; pixels.
    pub target_px: Option<([DVec2; 4], Vec<DVec2>)>,
    /// Views so far.
    pub taken: usize,
    /// What they lack.
    pub lacks: Vec<Lack>,
    /// Where their corners are.
    pub coverage: Option<Coverage>,
    /// What they give, from [`FEWEST_VIEWS`] on.
    pub solved: Option<Result<SolvedViews, String>>,
    /// Pictures of another size than the first: they are passed over.
    pub passed_over: Option<[u32; 2]>,
}

/// A calibration in a few words.
#[derive(Debug, Clone, Copy)]
pub struct SolvedViews {
    /// Root mean square distance of the corners, pixels.
    pub rms_px: f64,
    /// Focal lengths and their standard deviations, pixels.
    pub focal_px: [DVec2; 2],
}

/// A camera that is watched. Dropped, it lets the camera go.
pub struct Watcher {
    capture: Option<LiveCapture>,
    frames: Arc<Mailbox<Arc<Frame>>>,
    standings: Arc<Mailbox<ViewsStanding>>,
    orders: Option<Sender<WatcherOrder>>,
    thread: Option<JoinHandle<Result<Held, CalibrateError>>>,
}

impl Watcher {
    /// Begins to read `source`; `wake` is called, on other threads, whenever there is something new to show.
    pub fn start(source: &str, options: &LiveOptions, taker: Taker, now: &Now, wake: Wake) -> Self {
        let frames = Arc::new(Mailbox::new());
        let tap: Tap = {
            let (frames, wake) = (Arc::clone(&frames), Arc::clone(&wake));
            Box::new(move |tapped| {
                if let Tapped::Frame(frame) = tapped {
                    frames.put(Arc::clone(frame));
                    wake();
                }
            })
        };
        let capture = LiveCapture::start(source, options, Arc::clone(now), Some(tap));
        let standings = Arc::new(Mailbox::new());
        let (orders, to_obey) = channel();
        let stage = WatcherStage {
            taker,
            times_secs: Vec::new(),
            solved: None,
            orders: to_obey,
            by_hand: false,
            standings: Arc::clone(&standings),
            wake,
        };
        let captured = capture.frames();
        Self {
            capture: Some(capture),
            frames,
            standings,
            orders: Some(orders),
            thread: Some(thread::spawn(move || stage.run(&captured))),
        }
    }

    /// A picture that was not yet shown.
    pub fn frame(&self) -> Option<Arc<Frame>> {
        newest(&self.frames)
    }

    /// How things are now, if that is new.
    pub fn standing(&self) -> Option<ViewsStanding> {
        newest(&self.standings)
    }

    /// What happened to the camera, the next thing of it that was not yet told.
    pub fn next_event(&self) -> Option<CaptureEvent> {
        self.capture.as_ref()?.next_event()
    }

    /// Tells the thread that looks what to do.
    pub fn order(&self, order: WatcherOrder) {
        if let Some(orders) = &self.orders {
            // A thread that has ended tells why when it is asked for what it has.
            _ = orders.send(order);
        }
    }

    /// Whether a library has failed: [`Watcher::finish`] tells how.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_some_and(JoinHandle::is_finished)
    }

    /// What there is.
    ///
    /// # Errors
    /// A failure of a library.
    pub fn finish(mut self) -> Result<Held> {
        let ended = self.end().ok_or_else(|| anyhow!("it has ended already"))?;
        let held = ended.map_err(|_| anyhow!("looking for the target has broken down"))?;
        Ok(held?)
    }

    fn end(&mut self) -> Option<thread::Result<Result<Held, CalibrateError>>> {
        self.capture = None;
        self.orders = None;
        self.thread.take().map(JoinHandle::join)
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        // A panic in it has been told on stderr.
        _ = self.end();
    }
}

fn newest<T>(mailbox: &Mailbox<T>) -> Option<T> {
    match mailbox.take_within(Duration::ZERO) {
        Taken::New(newest) => Some(newest),
        Taken::Nothing | Taken::Closed => None,
    }
}

struct WatcherStage {
    taker: Taker,
    times_secs: Vec<f64>,
    solved: Option<Result<SolvedViews, String>>,
    orders: Receiver<WatcherOrder>,
    /// Whether the next picture is to be taken.
    by_hand: bool,
    standings: Arc<Mailbox<ViewsStanding>>,
    wake: Wake,
}

impl WatcherStage {
    /// Until nobody gives orders any more.
    fn run(mut self, captured: &Mailbox<Arrived>) -> Result<Held, CalibrateError> {
        loop {
            match captured.take_within(PATIENCE) {
                Taken::New(arrived) => self.look(&arrived.frame)?,
                Taken::Nothing => {}
                // A recording has ended; what it showed can still be dropped.
                Taken::Closed => match self.orders.recv() {
                    Ok(order) => self.obey(order),
                    Err(_) => break,
                },
            }
            match self.orders.try_recv() {
                Ok(order) => self.obey(order),
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Disconnected) => break,
            }
        }
        Ok(Held {
            views: self.taker.into_views(),
            times_secs: self.times_secs,
        })
    }

    fn obey(&mut self, order: WatcherOrder) {
        match order {
            WatcherOrder::Take => self.by_hand = true,
            WatcherOrder::DropLast => {
                if self.taker.drop_last() {
                    self.solve();
                }
                self.tell(None, None, None);
            }
        }
    }

    fn look(&mut self, frame: &Frame) -> Result<(), CalibrateError> {
        let size_px = self.taker.views().size_px();
        if size_px.is_some_and(|size_px| size_px != frame.size_px) {
            self.tell(None, None, Some(frame.size_px));
            return Ok(());
        }
        let mut grey = Vec::new();
        grey_from_rgba(frame, &mut grey)?;
        let by_hand = std::mem::take(&mut self.by_hand);
        let (moment, view) = self.taker.show(&grey, frame.size_px, by_hand)?;
        self.times_secs.push(frame.time_secs);
        if moment == Moment::Taken {
            // It is seen to be taken before the time that solving takes.
            self.tell(Some(moment), view.as_ref(), None);
            self.solve();
        }
        self.tell(Some(moment), view.as_ref(), None);
        Ok(())
    }

    fn solve(&mut self) {
        let views = self.taker.views();
        self.solved = (views.kept().len() >= FEWEST_VIEWS).then(|| {
            let solved = solve(views).map(|calibration| SolvedViews {
                rms_px: calibration.rms_px,
                focal_px: [
                    calibration.intrinsics.focal_px,
                    calibration.focal_deviation_px,
                ],
            });
            solved.map_err(|error| error.to_string())
        });
    }

    fn tell(
        &self,
        moment: Option<Moment>,
        view: Option<&TargetView>,
        passed_over: Option<[u32; 2]>,
    ) {
        let views = self.taker.views();
        self.standings.put(ViewsStanding {
            moment,
            size_px: views.size_px().unwrap_or_default(),
            target_px: view.map(|view| (view.outline_px(), view.pixels().collect())),
            taken: views.kept().len(),
            lacks: views.lacks(),
            coverage: views.coverage(),
            solved: self.solved.clone(),
            passed_over,
        });
        (self.wake)();
    }
}
