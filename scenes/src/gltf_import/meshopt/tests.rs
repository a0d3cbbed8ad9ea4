//! What the reference encoder wrote (`tests/compressed/make.mjs`), and damage.

use super::*;
use glam::{Quat, Vec3};

fn file(name: &str) -> Vec<u8> {
    let path = format!("{}/tests/compressed/{name}.bin", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn compressed(mode: Mode, filter: Filter, count: u64, byte_stride: u64) -> Compressed {
    Compressed { buffer: 0, byte_offset: 0, byte_length: 0, byte_stride, count, mode, filter }
}

fn attributes(name: &str, filter: Filter, count: u64, stride: u64) -> Vec<u8> {
    compressed(Mode::Attributes, filter, count, stride)
        .decode(&file(name))
        .unwrap_or_else(|fault| panic!("{name}: {fault}"))
}

#[test]
fn attributes_of_both_versions_come_back_to_the_bit() {
    let mixed = |i: u32| {
        let words = (0..4).flat_map(move |k| ((i * i * (k + 1) + 7 * k) as u16).to_le_bytes());
        words.chain((0..2).flat_map(move |k| (0.25 * i as f32 + k as f32).to_le_bytes()))
    };
    let expected: Vec<u8> = (0..300).flat_map(mixed).collect();
    for name in ["attributes-v0", "attributes-v1-level0", "attributes-v1-level3"] {
        assert_eq!(attributes(name, Filter::None, 300, 16), expected, "{name}");
    }
    let wide: Vec<u8> =
        (0..256 * 70u32).map(|at| if at % 256 < 8 { (at >> 8) * (at % 256) } else { at % 256 } as u8).collect();
    assert_eq!(attributes("attributes-wide", Filter::None, 70, 256), wide);
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_103_515_245).wrapping_add(12345);
        (state >> 16) as u8
    };
    let noise: Vec<u8> = (0..4 * 37).map(|at| if at % 4 == 0 { 7 } else { random() }).collect();
    assert_eq!(attributes("attributes-noise", Filter::None, 37, 4), noise);
}

fn triangle_indices() -> Vec<u32> {
    let squares = (0..5).flat_map(|y| (0..6).flat_map(move |x| [0, 1, 7, 1, 8, 7].map(|corner| 7 * y + x + corner)));
    let single = |y: u32, x: u32| [0, 3, 9, 9, 3].map(|corner| 1000 + 350 * y + x + corner).into_iter().chain([40]);
    squares.chain([4, 2, 0].into_iter().flat_map(|y| [5, 2].into_iter().flat_map(move |x| single(y, x)))).collect()
}

#[test]
fn indices_come_back() {
    let expected = triangle_indices();
    for (name, mode) in [("triangles", Mode::Triangles), ("indices", Mode::Indices)] {
        let decoded = compressed(mode, Filter::None, expected.len() as u64, 4).decode(&file(name)).expect(name);
        // The encoder of triangles may begin each with another corner.
        let turned = |bytes: &[u8]| -> Vec<[u32; 3]> {
            let index = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
            let corners = (0..bytes.len() / 12).map(|each| [0, 4, 8].map(|at| index(12 * each + at)));
            corners.map(|[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().expect("three")).collect()
        };
        assert_eq!(turned(&decoded), turned(&indices::packed(&expected, 4)), "{name}");
        let halves = compressed(mode, Filter::None, expected.len() as u64, 2).decode(&file(name)).expect(name);
        let words: Vec<u8> = decoded.chunks_exact(4).flat_map(|index| [index[0], index[1]]).collect();
        assert_eq!(halves, words);
    }
}

#[test]
fn deltas_of_the_specification_are_its_values() {
    // A block of one byte of 16 elements, from the text's example, in an element of 4 bytes.
    let mut bytes = vec![0xa0, 2, 0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5, 0, 0, 0];
    bytes.extend([0; 32]);
    let decoded = attributes::decode(&bytes, 16, 4).expect("sound");
    let expected = [-1i32, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0];
    let mut sum = 0;
    for (element, delta) in decoded.chunks_exact(4).zip(expected) {
        sum += delta;
        assert_eq!(element, [sum as u8, 0, 0, 0]);
    }
}

fn dirs() -> impl Iterator<Item = Vec3> {
    (0..50).map(|i| {
        let z = 1.0 - (2 * i + 1) as f32 / 50.0;
        let angle = 2.399963 * i as f32;
        Vec3::new(angle.cos(), angle.sin(), 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
    })
}

fn words(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(2).map(|word| f32::from(i16::from_le_bytes([word[0], word[1]]))).collect()
}

#[test]
fn filters_give_what_was_filtered_to_their_bits() {
    // 7 bits of octahedral coordinates: up to half a step of 1/63 along both axes, three times that on the sphere, since a face of the
    // octahedron leans and is nearer to its middle by 3^(1/2) each; and 8 bits of three components.
    let bound = |steps: f32, largest: f32| 0.5 / steps * 2f32.sqrt() * 3.0 + 0.5 / largest * 3f32.sqrt();
    let bytes = attributes("octahedral-8", Filter::Octahedral, 50, 4);
    for (i, (found, dir)) in bytes.chunks_exact(4).zip(dirs()).enumerate() {
        let vector = Vec3::new(f32::from(found[0] as i8), f32::from(found[1] as i8), f32::from(found[2] as i8)) / 127.0;
        assert!(vector.distance(dir) < bound(63.0, 127.0), "{i}: {vector} {dir}");
        assert_eq!(found[3] as i8, if i % 2 == 1 { 127 } else { -127 });
    }
    let found = words(&attributes("octahedral-16", Filter::Octahedral, 50, 8));
    for (found, dir) in found.chunks_exact(4).zip(dirs()) {
        assert!((Vec3::new(found[0], found[1], found[2]) / 32767.0).distance(dir) < bound(2047.0, 32767.0));
    }
    // 14 bits of components up to 0.71.
    let found = words(&attributes("quaternion", Filter::Quaternion, 50, 8));
    for (i, (found, dir)) in found.chunks_exact(4).zip(dirs()).enumerate() {
        let turn = Quat::from_xyzw(found[0], found[1], found[2], found[3]).normalize();
        let (sin, cos) = (0.1 * i as f32).sin_cos();
        let expected = Quat::from_xyzw(dir.x * sin, dir.y * sin, dir.z * sin, cos);
        assert!(turn.dot(expected).abs() > 1.0 - 1e-6, "{i}: {turn} {expected}");
    }
    // 15 bits of mantissa, one of them the sign, and an exponent that the three of a vector share.
    let bytes = attributes("exponential", Filter::Exponential, 50, 12);
    let expected = |i: usize| (i as f32 - 70.0) * 0.37 * 2f32.powi(i as i32 % 40 - 20);
    for (i, word) in bytes.chunks_exact(4).enumerate() {
        let found = f32::from_le_bytes([word[0], word[1], word[2], word[3]]);
        let largest = (0..3).map(|k| expected(i / 3 * 3 + k).abs()).fold(0.0, f32::max);
        assert!((found - expected(i)).abs() <= largest * 2f32.powi(-13), "{i}: {found} {}", expected(i));
    }
    let color = |i: usize| ((i * 37) % 101) as f32 / 100.0;
    // 8 and 12 bits; the transform's own rounding is as much again.
    for (i, &found) in attributes("color-8", Filter::Color, 50, 4).iter().enumerate() {
        assert!((f32::from(found) / 255.0 - color(i)).abs() < 0.012, "{i}: {found} {}", color(i));
    }
    for (i, word) in attributes("color-16", Filter::Color, 50, 8).chunks_exact(2).enumerate() {
        let found = f32::from(u16::from_le_bytes([word[0], word[1]])) / 65535.0;
        assert!((found - color(i)).abs() < 0.001, "{i}: {found} {}", color(i));
    }
}

#[test]
fn damage_is_refused_or_decodes_to_as_many_bytes() {
    let cases = [
        ("attributes-v0", Mode::Attributes, Filter::None, 300, 16),
        ("attributes-v1-level3", Mode::Attributes, Filter::None, 300, 16),
        ("octahedral-16", Mode::Attributes, Filter::Octahedral, 50, 8),
        ("octahedral-8", Mode::Attributes, Filter::Octahedral, 50, 4),
        ("quaternion", Mode::Attributes, Filter::Quaternion, 50, 8),
        ("exponential", Mode::Attributes, Filter::Exponential, 50, 12),
        ("color-8", Mode::Attributes, Filter::Color, 50, 4),
        ("color-16", Mode::Attributes, Filter::Color, 50, 8),
        ("triangles", Mode::Triangles, Filter::None, 216, 4),
        ("indices", Mode::Indices, Filter::None, 216, 4),
    ];
    for (name, mode, filter, count, stride) in cases {
        let bytes = file(name);
        let compressed = compressed(mode, filter, count, stride);
        for length in 0..bytes.len() {
            assert!(compressed.decode(&bytes[..length]).is_err(), "{name}: {length} bytes");
        }
        assert!(compressed.decode(&[&bytes[..], &[0; 40]].concat()).is_err(), "{name}: more bytes");
        let mut refused = 0;
        for at in 0..bytes.len() {
            for change in [1, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[at] ^= change;
                match compressed.decode(&damaged) {
                    Ok(decoded) => assert_eq!(decoded.len() as u64, count * stride),
                    Err(_) => refused += 1,
                }
            }
        }
        assert!(refused >= 3, "{name}: its header at least");
    }
}

#[test]
fn fields_that_contradict_the_extension_are_refused() {
    let check = |mode, filter, count, stride, length| compressed(mode, filter, count, stride).check(length);
    assert_eq!(check(Mode::Attributes, Filter::None, 10, 12, 120), Ok(()));
    for (mode, filter, count, stride, length) in [
        (Mode::Attributes, Filter::None, 10, 12, 121),
        (Mode::Attributes, Filter::None, 10, 6, 60),
        (Mode::Attributes, Filter::None, 10, 260, 2600),
        (Mode::Attributes, Filter::None, u64::MAX, 4, 4),
        (Mode::Attributes, Filter::Octahedral, 10, 12, 120),
        (Mode::Attributes, Filter::Quaternion, 10, 4, 40),
        (Mode::Triangles, Filter::None, 10, 4, 40),
        (Mode::Triangles, Filter::None, 12, 1, 12),
        (Mode::Indices, Filter::Exponential, 12, 4, 48),
    ] {
        assert!(check(mode, filter, count, stride, length).is_err(), "{mode:?} {filter:?} {count} {stride} {length}");
    }
}
