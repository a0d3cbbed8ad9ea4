//! Damaged glTF scenes.
#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};
use localprt_fuzz::mutate;

/// Libraries may fail in their own ways where the loader catches that. What nobody catches still ends the run, behind this hook.
fn let_guarded_libraries_fail() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |failure| {
        if !localprt_scenes::is_guarded() {
            hook(failure);
        }
    }));
}

fuzz_target!(init: let_guarded_libraries_fail(), |bytes: &[u8]| {
    localprt_fuzz::gltf(bytes);
});
fuzz_mutator!(|data: &mut [u8], size: usize, most: usize, seed: u32| {
    mutate::in_place(mutate::gltf, data, size, most, seed, fuzzer_mutate)
});
