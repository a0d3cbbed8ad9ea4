//! Overlays alone, over a black picture.

use super::*;
use crate::OffscreenTarget;
use glam::{Mat4, camera::rh::proj::directx::perspective_infinite_reverse, camera::rh::view::look_at_mat4};
use localprt_formats::sh::{Basis, function_count};
use localprt_runtime::gpu::headless;

/// An odd size, so that a pixel's center is the picture's.
const SIZE: u32 = 65;
const MIDDLE: usize = 32;

/// A device, or `None` with a line that says so; a failure if `REQUIRE_GPU` is set.
fn device(test: &str) -> Option<(wgpu::Device, wgpu::Queue)> {
    match pollster::block_on(headless()) {
        Ok(found) => Some(found),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some() => panic!("{test}: {error}"),
        Err(error) => {
            eprintln!("SKIPPED {test}: {error}");
            None
        }
    }
}

fn overlays(device: &wgpu::Device, degree: u32, coefficients: &[Vec3]) -> Overlays {
    let padded: Vec<[f32; 4]> = coefficients.iter().map(|color| color.extend(0.0).to_array()).collect();
    let radiance = device.create_buffer_init(&BufferInitDescriptor {
        label: Some("test.radiance"),
        contents: bytemuck::cast_slice(&padded),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let probes = vec![Probe { position: [0.0; 3], support_radius_m: 1.0 }; padded.len() / function_count(degree)];
    Overlays::of_probes(device, &probes, degree, &radiance)
}

/// From `eye` at the origin, at 90 degrees.
fn picture(
    (device, queue): &(wgpu::Device, wgpu::Queue),
    overlays: &Overlays,
    eye: Vec3,
    scale: f32,
) -> OffscreenTarget {
    let target = OffscreenTarget::new(device, SIZE, SIZE);
    let up = if eye.x.abs() + eye.z.abs() > 0.0 { Vec3::Y } else { Vec3::Z };
    let to_view: Mat4 = look_at_mat4(eye, Vec3::ZERO, up);
    let projection = perspective_infinite_reverse(std::f32::consts::FRAC_PI_2, 1.0, 0.01);
    let world_to_clip = (projection * to_view).to_cols_array_2d();
    let view = OverlayView { world_to_clip, eye: eye.to_array(), size_px: [SIZE as f32; 2] };
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.samples,
                depth_slice: None,
                resolve_target: Some(&target.radiance_view),
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Discard },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        overlays.encode(queue, &mut pass, &view);
    }
    target.tone_map(queue, &mut encoder, scale, crate::tone::ToneMap::default());
    queue.submit([encoder.finish()]);
    target
}

fn srgb((device, queue): &(wgpu::Device, wgpu::Queue), target: &OffscreenTarget, row: usize, column: usize) -> [u8; 3] {
    let bytes = target.read_srgb(device, queue).expect("a picture");
    let first = 3 * (row * SIZE as usize + column);
    [bytes[first], bytes[first + 1], bytes[first + 2]]
}

fn horizontal(z: f32, on_top: bool) -> OverlayLine {
    let (from, to) = (Vec3::new(-9.0, 0.0, z), Vec3::new(9.0, 0.0, z));
    OverlayLine { from, to, color: COLOR_OF_LINE, width_px: 5.0, on_top }
}

const COLOR_OF_LINE: [f32; 4] = [0.8, 0.05, 0.3, 1.0];

#[test]
fn lines_have_their_color_at_any_exposure() {
    let Some(gpu) = device("lines_have_their_color_at_any_exposure") else { return };
    let mut overlays = overlays(&gpu.0, 0, &[Vec3::ONE]);
    overlays.set_lines(&gpu.0, &gpu.1, &[horizontal(0.0, false)]);
    let encoded = |linear: f32| 255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055);
    for scale in [0.01, 1.0, 300.0] {
        overlays.set_exposure(scale);
        let target = picture(&gpu, &overlays, Vec3::Z, scale);
        for column in [0, MIDDLE, 64] {
            for (found, expected) in srgb(&gpu, &target, MIDDLE + 1, column).into_iter().zip(COLOR_OF_LINE) {
                // f16 keeps 2^-11, less than a third of a step; half a step of rounding, and hardware's encoding.
                assert!((f32::from(found) - encoded(expected)).abs() <= 1.1, "{found}, not {}", encoded(expected));
            }
            // Five pixels wide: two to either side.
            assert_eq!(srgb(&gpu, &target, MIDDLE - 3, column), [0; 3]);
            assert_eq!(srgb(&gpu, &target, MIDDLE + 3, column), [0; 3]);
        }
    }
}

#[test]
fn lines_from_behind_the_eye_are_cut_at_the_near_plane() {
    let Some(gpu) = device("lines_from_behind_the_eye_are_cut_at_the_near_plane") else { return };
    let mut overlays = overlays(&gpu.0, 0, &[Vec3::ONE]);
    // A metre below the eye, straight ahead: from the lower edge to the horizon.
    let ends = [Vec3::new(0.0, -1.0, 50.0), Vec3::new(0.0, -1.0, -1e5)];
    for [from, to] in [ends, [ends[1], ends[0]]] {
        let line = OverlayLine { from, to, ..horizontal(0.0, true) };
        let behind = OverlayLine { to: Vec3::new(1.0, 2.0, 9.0), from: Vec3::new(-3.0, 1.0, 5.0), ..line };
        overlays.set_lines(&gpu.0, &gpu.1, &[line, behind]);
        let radiance = picture(&gpu, &overlays, Vec3::Z, 1.0).read_radiance(&gpu.0, &gpu.1).expect("radiance");
        for (index, value) in radiance.iter().enumerate() {
            let (row, column) = (index / SIZE as usize, index % SIZE as usize);
            let is_line = row > MIDDLE + 2 && column.abs_diff(MIDDLE) <= 1;
            let is_dark = row + 4 < MIDDLE || column.abs_diff(MIDDLE) > 3;
            assert!(!is_line || value.x > 0.0, "row {row} column {column} is dark");
            assert!(!is_dark || *value == Vec3::ZERO, "row {row} column {column}: {value}");
        }
    }
}

#[test]
fn spheres_show_the_radiance_from_where_they_face() {
    let Some(gpu) = device("spheres_show_the_radiance_from_where_they_face") else { return };
    for degree in [0, 1, 2, 5, 10] {
        let n_sh = function_count(degree);
        // Two probes at one place; the second is drawn over by the first.
        let coefficients: Vec<Vec3> = (0..2 * n_sh)
            .map(|index| Vec3::new((index as f32 * 1.7).sin(), (index as f32 * 0.6).cos(), 0.2) / (1 + index) as f32)
            .map(|color| color + 0.01)
            .collect();
        let mut overlays = overlays(&gpu.0, degree, &coefficients);
        overlays.set_probes(&gpu.1, Some(ProbeSpheres { radius_m: 0.5, highlighted: vec![(7, 1.0)] }));
        let sphere = objects::sphere(SEGMENTS);
        for vertex in [37, 160, 205, 311, 402] {
            // There, facets and sphere are one.
            let dir = sphere.positions[vertex];
            let mut values = vec![0.0; n_sh];
            Basis::new(degree).evaluate(dir.to_array(), &mut values);
            let expected: Vec3 = values.iter().zip(&coefficients).map(|(value, color)| *value * *color).sum();
            let radiance = picture(&gpu, &overlays, dir, 1.0).read_radiance(&gpu.0, &gpu.1).expect("radiance");
            let found = radiance[MIDDLE * SIZE as usize + MIDDLE];
            // f16 keeps 2^-11 of numbers about 1; directions of the tenth degree multiply their rounding.
            let difference = (found - expected.max(Vec3::ZERO)).abs().max_element();
            assert!(difference < 2e-3, "degree {degree}, vertex {vertex}: {found}, not {expected}");
        }
    }
}

#[test]
fn highlighted_probes_have_a_rim_and_hide_what_is_behind() {
    let Some(gpu) = device("highlighted_probes_have_a_rim_and_hide_what_is_behind") else { return };
    let bright = 2.0 * Vec3::ONE;
    let mut overlays = overlays(&gpu.0, 0, &[bright * (4.0 * std::f32::consts::PI).sqrt()]);
    let shown = |overlays: &Overlays| {
        let radiance = picture(&gpu, overlays, 2.0 * Vec3::Z, 1.0).read_radiance(&gpu.0, &gpu.1).expect("radiance");
        // The disk of 0.5 m at 2 m is 8.4 pixels in radius.
        [0, 7].map(|offset| radiance[MIDDLE * SIZE as usize + MIDDLE + offset])
    };
    overlays.set_lines(&gpu.0, &gpu.1, &[horizontal(-3.0, false)]);
    assert!(shown(&overlays)[0].x > 0.0, "the line");
    overlays.set_probes(&gpu.1, Some(ProbeSpheres { radius_m: 0.5, highlighted: vec![(0, 1.0)] }));
    let [middle, rim] = shown(&overlays);
    assert!((middle - bright).abs().max_element() < 2e-3, "{middle}");
    assert!(rim.x > 5.0 * rim.z, "{rim}");
    overlays.set_probes(&gpu.1, Some(ProbeSpheres { radius_m: 0.5, highlighted: vec![] }));
    assert!((shown(&overlays)[1] - bright).abs().max_element() < 2e-3, "no rim");
    overlays.set_lines(&gpu.0, &gpu.1, &[horizontal(-3.0, true)]);
    let through = shown(&overlays)[0];
    assert!(through.y < 0.8 * bright.y && through.y > 0.2 * bright.y, "{through}");
    overlays.set_probes(&gpu.1, None);
    assert!(shown(&overlays)[0].y < 0.2, "no probe");
}

#[test]
fn the_record_lies_as_the_shader_has_it() {
    let source = include_str!("../overlays.wgsl");
    let module =
        naga::front::wgsl::parse_str(source).unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)));
    let (flags, capabilities) = (naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    naga::valid::Validator::new(flags, capabilities).validate(&module).expect("a valid shader");
    let found = module.types.iter().find(|(_, declared)| declared.name.as_deref() == Some("Overlay"));
    let naga::TypeInner::Struct { members, span } = &found.expect("the struct").1.inner else { panic!("no struct") };
    let offsets: Vec<usize> = members.iter().map(|member| member.offset as usize).collect();
    use std::mem::offset_of;
    let expected = [
        offset_of!(OverlayRecord, world_to_clip),
        offset_of!(OverlayRecord, eye),
        offset_of!(OverlayRecord, scale),
        offset_of!(OverlayRecord, size_px),
        offset_of!(OverlayRecord, white),
        offset_of!(OverlayRecord, radius_m),
        offset_of!(OverlayRecord, probe_degree),
    ];
    assert_eq!((offsets.as_slice(), *span as usize), (expected.as_slice(), size_of::<OverlayRecord>()));
}
