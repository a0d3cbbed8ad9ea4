//! Damaged baked files.
#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use localprt_fuzz::mutate;

fuzz_target!(|bytes: &[u8]| {
    localprt_fuzz::file(bytes);
});
fuzz_mutator!(|data: &mut [u8], size: usize, most: usize, seed: u32| {
    mutate::in_place(mutate::file, data, size, most, seed, fuzzer_mutate)
});
