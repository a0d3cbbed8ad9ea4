//! What stands for other systems in a viewer without them.

use super::{Found, Moment, News};
use crate::open_bake::OpenBake;
use crate::other_light::Beside;
use localprt_formats::Checked;
use localprt_surfaces::rays::RayCaster;

/// There is none.
pub enum Engine<'a> {
    /// Never.
    #[doc(hidden)]
    Never(std::convert::Infallible, std::marker::PhantomData<&'a ()>),
}

/// There are none.
pub fn names() -> impl Iterator<Item = &'static str> {
    std::iter::empty()
}

impl<'a> Engine<'a> {
    /// Nothing.
    pub fn new(_: &str, _: &'a RayCaster<'a>, _: &Checked<'a>) -> Option<Self> {
        None
    }

    /// Never.
    pub fn update(&mut self, _: &Moment) -> Found {
        let Self::Never(never, _) = self;
        match *never {}
    }
}

/// Nothing.
#[derive(Default)]
pub(crate) struct Beneath;

impl Beneath {
    /// Nothing.
    pub(crate) fn follow(&mut self, _: &OpenBake<'_>, _: Option<Beside>, _: bool, _: impl FnOnce() -> Moment) -> News {
        News::Nothing
    }

    /// Never.
    pub(crate) fn is_there(&self) -> bool {
        false
    }
}
