//! Closed forms, leaks, and behavior in time.

mod closed_forms;
mod leaks;
mod time;
