//! Closed forms and leaks, behavior in time, states and places of probes, volumes.

mod light;
mod places;
mod time;
mod volumes;
