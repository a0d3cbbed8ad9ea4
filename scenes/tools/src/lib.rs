//! What the commands of localprt share: reading what is named on a command line ([`inputs`]), writing files whole ([`output`]), saying
//! what went wrong and with which exit code ([`error`], [`program`]), showing how far they are ([`progress`]) and what they take ([`memory`]), pictures of a scene
//! ([`picture`]), figures of error ([`metrics`], [`reference_file`]) and their colors ([`ramp`], [`range`]).

pub mod arguments;
pub mod error;
pub mod inputs;
pub mod memory;
pub mod metrics;
pub mod output;
pub mod picture;
pub mod program;
pub mod progress;
pub mod ramp;
pub mod range;
pub mod reference_file;

/// Bytes as lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
