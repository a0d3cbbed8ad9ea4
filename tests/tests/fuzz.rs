//! The bodies of the fuzz targets, held against their seeds and some thousand mutations of them: `scripts/fuzz.sh` runs them for longer.

// The part that speaks to libFuzzer is for the targets alone.
#[path = "../../fuzz/src/lib.rs"]
#[allow(dead_code)]
mod bodies;

use bodies::mutate::Dice;
use std::time::{Duration, Instant};

/// An input may take this long, on a machine that does ten other things at once; most take well under a millisecond.
const PATIENCE: Duration = Duration::from_secs(5);
/// What all mutations of a target may take.
const TIME: Duration = Duration::from_secs(4);
/// Mutations of a target, at most.
const MUTATIONS: u64 = 4000;
/// Bytes of an input, at most.
const MOST: usize = 1 << 16;

/// Changes some bytes, as a fuzzer would.
fn change(bytes: &mut Vec<u8>, most: usize, dice: &mut Dice) {
    let numbers = [0u64, 1, 2, 127, 128, 255, 256, 0x7fff_ffff, 0xffff_ffff, 1 << 32, 1 << 63, u64::MAX];
    for _ in 0..1 + dice.below(3) {
        let (at, length) = (dice.below(bytes.len()), 1 + dice.below(16));
        let end = (at + length).min(bytes.len());
        match dice.below(6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << dice.below(8),
            1 if at < bytes.len() => bytes[at] = dice.any() as u8,
            2 => drop(bytes.drain(at..end)),
            3 if bytes.len() + length <= most => drop(bytes.splice(at..at, (0..length).map(|_| dice.any() as u8))),
            4 if bytes.len() + end - at <= most => bytes.extend_from_within(at..end),
            _ => {
                let number = numbers[dice.below(numbers.len())].to_le_bytes();
                bytes[at..end].iter_mut().zip(number).for_each(|(byte, new)| *byte = new);
            }
        }
    }
}

#[test]
fn damaged_inputs_are_refused_or_read() {
    for target in bodies::targets() {
        assert!(!target.seeds.is_empty(), "{}: no seeds", target.name);
        for (number, seed) in target.seeds.iter().enumerate() {
            assert!((target.run)(seed), "{}: nothing is read in seed {number}", target.name);
        }
        let began = Instant::now();
        let mut inputs = target.seeds.clone();
        let (mut tried, mut read) = (0, 0);
        while tried < MUTATIONS && began.elapsed() < TIME {
            let (mut dice, mut of_change) = (Dice::new(2 * tried), Dice::new(2 * tried + 1));
            let place = dice.below(inputs.len());
            let mutated = (target.mutation)(&inputs[place], MOST, &mut dice, &mut |bytes, most| {
                change(bytes, most, &mut of_change)
            });
            let started = Instant::now();
            match std::panic::catch_unwind(|| (target.run)(&mutated)) {
                Ok(is_read) => read += u64::from(is_read),
                Err(_) => panic!("{}: mutation {tried}, {} bytes", target.name, mutated.len()),
            }
            assert!(started.elapsed() < PATIENCE, "{}: mutation {tried} took {:?}", target.name, started.elapsed());
            // Some go on from there.
            if mutated.len() <= MOST && dice.below(4) == 0 {
                match inputs.len() {
                    0..64 => inputs.push(mutated),
                    length => inputs[target.seeds.len() + dice.below(length - target.seeds.len())] = mutated,
                }
            }
            tried += 1;
        }
        println!("{}: {tried} mutations in {:.1} s, {read} read", target.name, began.elapsed().as_secs_f64());
        assert!(tried > 100 && 0 < read && read < tried, "{}: {read} of {tried} mutations read", target.name);
    }
}
