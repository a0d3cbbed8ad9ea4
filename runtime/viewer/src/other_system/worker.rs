//! Systems on a thread of their own, while a window shows what they have found.

use super::engine::{Engine, Receivers};
use super::{Found, Moment, News};
use crate::open_bake::OpenBake;
use crate::other_light::Beside;
use localprt_surfaces::rays::RayCaster;
use localprt_systems::KINDS;
use std::sync::mpsc::{Receiver, Sender, SyncSender, TryRecvError, channel, sync_channel};
use std::thread;

/// Updates without a change after which a system rests.
const REST: u32 = 320;

/// The system beneath a window, if it shows one.
#[derive(Default)]
pub(crate) struct Beneath {
    worker: Option<Worker>,
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
        if is_new || has_changed {
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
    found: Receiver<Found>,
}

impl Worker {
    /// `None` if there is no such system, or no thread.
    fn start(system: &'static str, bake: &OpenBake<'_>) -> Option<Self> {
        let kind = KINDS.iter().find(|kind| kind.name == system)?;
        let (scene, receivers) = (bake.scene().clone(), Receivers::of(&bake.baked));
        let (moments, heard) = channel();
        // One that waits to be taken and one that is being found: no more.
        let (finds, found) = sync_channel(1);
        let work = move || {
            let Ok(caster) = RayCaster::new(&scene) else { return };
            run(&mut Engine::on(kind, &caster, receivers), &heard, &finds);
        };
        thread::Builder::new().name(system.into()).spawn(work).ok()?;
        Some(Self { system, moments, found })
    }
}

/// Updates a system until nobody listens.
fn run(engine: &mut Engine<'_>, heard: &Receiver<Moment>, finds: &SyncSender<Found>) {
    let Ok(mut moment) = heard.recv() else { return };
    let mut still = 0;
    loop {
        if still == REST {
            let Ok(newer) = heard.recv() else { return };
            (moment, still) = (newer, 0);
        }
        loop {
            match heard.try_recv() {
                Ok(newer) => (moment, still) = (newer, 0),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return,
            }
        }
        if finds.send(engine.update(&moment)).is_err() {
            return;
        }
        still += 1;
    }
}
