//! What every system is to the one who compares them.

use crate::moving::Object;
use crate::shader_light::ShaderLight;
use crate::world::World;
use glam::Vec3;
use localprt_scenes::{Camera, SurfacePoint};
use std::ops::AddAssign;

/// A real-time global illumination system.
pub trait System: Send + Sync {
    /// One frame: traces, shades and stores what it wants to.
    fn update(&mut self, frame: &Frame<'_>) -> Work;

    /// Says where things that move are from now on; the worlds of frames have their surfaces. Systems that trace and keep no more
    /// than that need not know.
    fn set_moving(&mut self, _: &[Object]) {}

    /// Irradiance at points, W m^-2, `[n]`, with what the last frame left. Not negative.
    fn irradiance(&self, world: &World<'_>, query: &Query<'_>) -> Vec<Vec3>;

    /// The same for surfaces that probes' rays met: light of earlier bounces.
    fn feedback(&self, world: &World<'_>, points: &[Shaded]) -> Vec<Vec3> {
        self.irradiance(world, &Query::of(points))
    }

    /// What a shader needs to find [`System::irradiance`] for every pixel by itself; `None` for systems that trace rays for their points,
    /// blend several volumes or weigh probes in a way of their own.
    fn shader_light(&self) -> Option<ShaderLight> {
        None
    }

    /// Probes that it has.
    fn probes(&self) -> usize;

    /// Bytes that it keeps from frame to frame, in the formats of its paper.
    fn bytes(&self) -> u64;
}

/// A system as it is chosen by name, before there is a scene.
pub struct Kind {
    /// Its key in `metrics.json`.
    pub name: &'static str,
    /// Its row of the table.
    pub title: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// Bytes of one more probe, for as many probes as fit into a number of bytes.
    pub probe_bytes: u64,
    /// Its probes stand around the camera, or get their light from what the camera sees: every view has a run of its own.
    pub follows_camera: bool,
    /// Frames in which every set of points is to be asked for at rest: of a system that averages what it finds for them.
    pub averaged_frames: u32,
    /// Makes its probes for a scene. Light comes with the frames.
    pub prepare: fn(&World<'_>, &Setup<'_>) -> Box<dyn System>,
}

/// What a system is prepared for.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// Probes, about: not more than these.
    pub probes: usize,
    /// Views that the light is for.
    pub cameras: &'a [Camera],
    /// Seed of what is random.
    pub seed: u64,
}

/// One frame.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// The scene and its light in this frame.
    pub world: &'a World<'a>,
    /// Frames before this one.
    pub number: u64,
    /// The view, for systems that start from what is on screen or keep their probes around it.
    pub camera: Option<&'a Camera>,
    /// The light of earlier bounces.
    pub feedback: Feedback<'a>,
    /// What changed since the last frame, as an application would say.
    pub events: &'a [Event],
    /// World and feedback give just what they gave to the last frame: what is a function of them alone need not be found again. Work
    /// counts as if it were.
    pub still: bool,
}

/// Where surfaces that are met by probes' rays have their indirect light from.
#[derive(Clone, Copy)]
pub enum Feedback<'a> {
    /// From the system itself, as its last frame left it: every bounce, in time.
    Own,
    /// From nowhere: the first bounce alone.
    Nothing,
    /// From another system, at rest. Of one that has converged to k gathers: k + 1.
    Of(&'a dyn System),
}

/// A change that an application knows of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A small lighting change, as a torch switched on.
    SmallLight,
    /// A large one, as the time of day.
    LargeLight,
    /// A large object appeared, moved or went away.
    LargeObject,
}

/// A surface point and from where it is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaded {
    /// The point.
    pub point: SurfacePoint,
    /// Unit direction to the eye, or along a ray back to its origin.
    pub to_eye: Vec3,
}

/// Points to be shaded.
#[derive(Clone, Copy, Debug)]
pub struct Query<'a> {
    /// The points. A normal of zero stands for a pixel without a surface, whose light nobody reads.
    pub points: &'a [Shaded],
    /// Pixels per row, where the points are those of a picture, row by row: for systems that filter on screen.
    pub width: Option<usize>,
}

/// What a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Rays of probes.
    pub rays: u64,
    /// Rays through probes' maps for points that were asked for since the last frame: they go with the points, not with the update.
    pub query_rays: u64,
    /// Rays to lights from the surfaces that these met.
    pub shadow_rays: u64,
    /// Texels, or coefficients, that were written.
    pub texels: u64,
    /// Probes that were updated.
    pub probes: u64,
}

impl Shaded {
    /// A point that is looked at from straight above.
    pub fn from_above(point: SurfacePoint) -> Self {
        Self { point, to_eye: point.normal }
    }
}

impl<'a> Query<'a> {
    /// Points that are no picture.
    pub fn of(points: &'a [Shaded]) -> Self {
        Self { points, width: None }
    }
}

impl Feedback<'_> {
    /// Indirect irradiance at points, for the system `own`.
    pub fn irradiance(&self, own: &dyn System, world: &World<'_>, points: &[Shaded]) -> Vec<Vec3> {
        match self {
            Self::Own => own.feedback(world, points),
            Self::Nothing => vec![Vec3::ZERO; points.len()],
            Self::Of(other) => other.feedback(world, points),
        }
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.query_rays += other.query_rays;
        self.shadow_rays += other.shadow_rays;
        self.texels += other.texels;
        self.probes += other.probes;
    }
}
