//! The states of a probe and how it changes between them (sec. 6, Figs. 10 and 11).

use super::optimizer::Sight;
use crate::Object;
use glam::Vec3;

/// Whether a probe traces and is asked. What is new takes its first values whole: hysteresis 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Not yet placed; every probe begins as this.
    Uninitialized,
    /// Inside of static geometry, for good.
    Off,
    /// Lights no surface.
    Sleeping,
    /// Something that moves has come near in this frame.
    NewlyAwake,
    /// Near static geometry, in its first frame.
    NewlyVigilant,
    /// Lights something that moves.
    Awake,
    /// Lights static geometry, always.
    Vigilant,
}

/// A probe but for its maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Its state.
    pub state: State,
    /// From its place on the grid, metres.
    pub offset: Vec3,
    /// Moves that the optimizer has made it consider.
    pub moves: u32,
}

impl Probe {
    /// One that is to be placed.
    pub const NEW: Self = Self { state: State::Uninitialized, offset: Vec3::ZERO, moves: 0 };

    /// Takes its first state by what it sees from its last place. All are vigilant where none may sleep.
    pub fn classify(&mut self, sight: &Sight, sleeps: bool) {
        self.state = match () {
            () if !sleeps => State::NewlyVigilant,
            () if sight.is_inside() => State::Off,
            () if sight.lights_surface => State::NewlyVigilant,
            () => State::Sleeping,
        };
    }

    /// Wakes up for objects in its cells, and goes to sleep without. `place` is on the grid, `reach` a cell and the self-shadow bias.
    pub fn meet(&mut self, objects: &[Object], place: Vec3, reach: Vec3) {
        let is_near = objects.iter().any(|object| object.holds(place, reach));
        self.state = match self.state {
            State::Sleeping if is_near => State::NewlyAwake,
            State::Awake if !is_near => State::Sleeping,
            state => state,
        };
    }
}

impl State {
    /// Whether it traces and updates.
    pub fn is_active(self) -> bool {
        self.is_new() || self.is_lit()
    }

    /// Whether its next values replace what it holds.
    pub fn is_new(self) -> bool {
        matches!(self, Self::NewlyAwake | Self::NewlyVigilant)
    }

    /// Whether what it holds is good to be asked for.
    pub fn is_lit(self) -> bool {
        matches!(self, Self::Awake | Self::Vigilant)
    }

    /// After its update.
    pub fn updated(self) -> Self {
        match self {
            Self::NewlyAwake => Self::Awake,
            Self::NewlyVigilant => Self::Vigilant,
            state => state,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sleeper_wakes_while_something_is_near_and_others_do_not_care() {
        let objects = [Object { low: Vec3::ZERO, high: Vec3::ONE }];
        let meet = |state, place| {
            let mut probe = Probe { state, ..Probe::NEW };
            probe.meet(&objects, place, Vec3::splat(0.5));
            probe.state
        };
        let (near, far) = (Vec3::splat(1.4), Vec3::new(0.5, 1.6, 0.5));
        assert_eq!(meet(State::Sleeping, near), State::NewlyAwake);
        assert_eq!(meet(State::Sleeping, far), State::Sleeping);
        assert_eq!(meet(State::Awake, near), State::Awake);
        assert_eq!(meet(State::Awake, far), State::Sleeping);
        for state in [State::Off, State::Vigilant, State::Uninitialized] {
            assert_eq!([meet(state, near), meet(state, far)], [state; 2]);
        }
        assert_eq!(State::NewlyAwake.updated(), State::Awake);
        assert_eq!(State::NewlyVigilant.updated(), State::Vigilant);
        assert!(State::NewlyAwake.is_active() && !State::NewlyAwake.is_lit());
        assert!(!State::Off.is_active() && !State::Sleeping.is_active() && State::Awake.is_lit());
    }
}
