//! Systems on a thread of their own, while a window shows what they have found.

use super::engine::Engine;
use crate::open_bake::OpenBake;
use crate::other_light::Beside;
use crate::other_system::{Found, Moment, News, UPDATES};
use localprt_surfaces::rays::RayCaster;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, TryRecvError, channel, sync_channel};
use std::thread;

/// The system beneath a window, if it shows one.
#[derive(Default)]
pub(crate) struct Beneath {
    worker: Option<Worker>,
    /// Something has changed that the system has not been told of.
    is_behind: bool,
}

impl Beneath {
    /// Starts, changes or ends the system that a state wants, tells it what has changed, and takes what it has found.
    pub(crate) fn follow(
        &mut self,
        bake: &OpenBake<'_>,
        beside: Option<Beside>,
        has_changed: bool,
        moment: impl FnOnce() -> Moment,
    ) -> News {
        let wanted = beside.map(|beside| beside.system);
        let is_new = self.worker.as_ref().map(|worker| worker.system) != wanted;
        if is_new {
            self.worker = wanted.and_then(|system| Worker::start(system, bake));
        }
        let Some(worker) = &self.worker else { return if is_new { News::Gone } else { News::Nothing } };
        self.is_behind |= is_new || has_changed;
        // One at a time, and the newest: lightings may have large skies, and updates may take seconds.
        if self.is_behind && !worker.is_untold.swap(true, Ordering::AcqRel) {
            self.is_behind = false;
            // The thread ends with its worker alone.
            let _ = worker.moments.send(moment());
        }
        match worker.found.try_iter().last() {
            Some(found) => News::Found(found),
            None if is_new => News::Gone,
            None => News::Nothing,
        }
    }

    /// Whether there may be something to take soon.
    pub(crate) fn is_there(&self) -> bool {
        self.worker.is_some()
    }
}

/// A thread with a system. It ends when this is dropped, after the update that it is at.
struct Worker {
    system: &'static str,
    moments: Sender<Moment>,
    /// A moment was sent that the thread has not taken yet.
    is_untold: Arc<AtomicBool>,
    found: Receiver<Found>,
}

impl Worker {
    /// `None` if there is no thread.
    fn start(system: &'static str, bake: &OpenBake<'_>) -> Option<Self> {
        let (scene, baked) = (bake.scene().clone(), bake.files.baked.clone());
        let (moments, told) = channel();
        let is_untold = Arc::new(AtomicBool::new(false));
        // One that waits to be taken and one that is being found: no more.
        let (finds, found) = sync_channel(1);
        let heard = Heard { told, is_untold: Arc::clone(&is_untold) };
        let work = move || {
            let (Ok(caster), Ok(baked)) = (RayCaster::new(&scene), baked.checked()) else { return };
            if let Some(mut engine) = Engine::new(system, &caster, &baked) {
                run(&mut engine, &heard, &finds);
            }
        };
        thread::Builder::new().name(system.into()).spawn(work).ok()?;
        Some(Self { system, moments, is_untold, found })
    }
}

/// The thread's end of what it is told.
struct Heard {
    told: Receiver<Moment>,
    is_untold: Arc<AtomicBool>,
}

impl Heard {
    /// Waits for a moment; `None` once nobody tells any more.
    fn next(&self) -> Option<Moment> {
        let moment = self.told.recv().ok()?;
        self.is_untold.store(false, Ordering::Release);
        Some(moment)
    }

    /// A moment if there is one now.
    fn newer(&self) -> Result<Moment, TryRecvError> {
        let moment = self.told.try_recv()?;
        self.is_untold.store(false, Ordering::Release);
        Ok(moment)
    }
}

/// Updates a system until nobody listens.
fn run(engine: &mut Engine<'_>, heard: &Heard, finds: &SyncSender<Found>) {
    let Some(mut moment) = heard.next() else { return };
    let mut still = 0;
    loop {
        match heard.newer() {
            Ok(newer) => (moment, still) = (newer, 0),
            Err(TryRecvError::Disconnected) => return,
            Err(TryRecvError::Empty) if still == UPDATES => {
                let Some(newer) = heard.next() else { return };
                (moment, still) = (newer, 0);
            }
            Err(TryRecvError::Empty) => {}
        }
        if finds.send(engine.update(&moment)).is_err() {
            return;
        }
        still += 1;
    }
}
