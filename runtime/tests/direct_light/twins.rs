//! The twins against traced shadows.

use crate::scenes::{TestScene, box_below_a_screen, box_on_a_floor, light, lights};
use glam::Vec3;
use localprt_runtime::passes::direct_irradiance::direct_irradiance;
use localprt_runtime::{SceneTexels, SurfacePoint, TexelSample};
use localprt_scenes::{Light, LightKind};

/// Irradiance without shadows.
fn unshadowed(scene: &TestScene, light: &Light, texel: usize) -> Vec3 {
    let texels = &scene.texels;
    let Some(incident) = light.incident(texels.position[texel]) else { return Vec3::ZERO };
    let cosine = texels.normal[texel].dot(incident.dir_to_light);
    let is_above = cosine > 0.0 && texels.geometric_normal[texel].dot(incident.dir_to_light) > 0.0;
    if is_above { incident.irradiance * cosine } else { Vec3::ZERO }
}

/// Share of the light that arrives in each texel, `None` where there is none to arrive.
fn visibilities(scene: &TestScene, light: &Light, map_size: u32) -> Vec<Option<f32>> {
    let lit = direct_irradiance(&scene.texels, &scene.casters, std::slice::from_ref(light), map_size);
    let share = |texel: usize| {
        let whole = unshadowed(scene, light, texel);
        if whole == Vec3::ZERO {
            assert_eq!(lit[texel], Vec3::ZERO, "light where there is none");
        }
        (whole != Vec3::ZERO).then(|| lit[texel].x / whole.x)
    };
    (0..scene.texels.len()).map(share).collect()
}

/// The traced shadow, if it is the same at all points of the surface within `radius` metres.
fn steady_shadow(scene: &TestScene, light: &Light, texel: usize, radius: f32) -> Option<bool> {
    let (position, normal) = (scene.texels.position[texel], scene.texels.geometric_normal[texel]);
    let (x, y) = normal.any_orthonormal_pair();
    let at = |point| scene.traced(light, point, normal);
    let center = at(position);
    let n_around = 16;
    let is_same = |ring: f32| {
        (0..n_around).all(|step| {
            let (sin, cos) = (std::f32::consts::TAU * step as f32 / n_around as f32).sin_cos();
            at(position + (x * cos + y * sin) * ring) == center
        })
    };
    (is_same(radius) && is_same(radius / 2.0)).then_some(center)
}

/// Metres of one texel of a light's map on the surface of a texel.
fn footprint_m(scene: &TestScene, light: &Light, texel: usize, map_size: u32) -> f32 {
    let position = scene.texels.position[texel];
    let incident = light.incident(position).unwrap();
    let cosine = scene.texels.geometric_normal[texel].dot(incident.dir_to_light);
    let width = match light.kind {
        // The scene's diagonal is no longer than that.
        LightKind::Directional => 6.0,
        // sqrt(3) in the corners of a face.
        LightKind::Point => 2.0 * incident.distance,
        LightKind::Spot { outer_cone, .. } if outer_cone > 1.2 => 2.0 * incident.distance,
        LightKind::Spot { outer_cone, .. } => 2.0 * outer_cone.tan() * incident.distance,
    };
    width / (map_size - 8) as f32 / cosine
}

#[test]
fn shadows_differ_from_traced_ones_at_their_edges_only() {
    let map_size = 512;
    let scene = box_on_a_floor(32);
    for light in lights() {
        let shares = visibilities(&scene, &light, map_size);
        let (mut n_lit, mut n_dark, mut n_edge, mut n_mixed) = (0, 0, 0, 0);
        for (texel, share) in shares.iter().enumerate() {
            let Some(share) = *share else { continue };
            // A moved receiver's taps reach 2.7 texels in each axis, the diagonal of which is 3.8.
            let radius = 3.8 * footprint_m(&scene, &light, texel, map_size);
            let place = scene.texels.position[texel];
            match steady_shadow(&scene, &light, texel, radius) {
                // Weights of the taps sum to 1 within 3 roundings, and x / y * y to x within 2.
                Some(true) => assert!((share - 1.0).abs() < 1e-6, "{:?} lit {place}: {share}", light.kind),
                Some(false) => assert_eq!(share, 0.0, "{:?} dark {place}", light.kind),
                None => n_edge += 1,
            }
            n_lit += usize::from(share == 1.0);
            n_dark += usize::from(share == 0.0);
            n_mixed += usize::from(share > 0.0 && share < 0.999999);
        }
        let n_reached = shares.iter().flatten().count();
        println!(
            "{:?}: {n_reached} reached, {n_lit} lit, {n_dark} dark, {n_edge} near edges, {n_mixed} mixed",
            light.kind
        );
        assert!(n_lit > 1000 && n_dark > 100, "{:?}: {n_lit} lit, {n_dark} dark", light.kind);
        assert!(n_mixed < n_edge && n_edge * 5 < n_reached, "{:?}: {n_edge} of {n_reached}", light.kind);
    }
}

#[test]
fn a_flat_surface_never_shades_itself() {
    let mut scene = TestScene::default();
    let p = Vec3::new;
    scene.quad([p(-2.0, 0.1, 2.0), p(2.0, 0.0, 2.0), p(2.0, -0.1, -2.0), p(-2.0, 0.0, -2.0)], 64);
    for map_size in [64, 1024] {
        for kind in lights().map(|light| light.kind) {
            // From overhead to grazing.
            for height in [3.0, 0.5, 0.1f32] {
                let light = Light {
                    direction: Vec3::new(0.4, -height, -0.2).normalize(),
                    position: Vec3::new(-0.9, height, 0.3),
                    ..light(kind)
                };
                for (texel, share) in visibilities(&scene, &light, map_size).into_iter().enumerate() {
                    let Some(share) = share else { continue };
                    assert!((share - 1.0).abs() < 1e-6, "{kind:?} {height} {map_size} {texel}: {share}");
                }
            }
        }
    }
}

#[test]
fn single_sided_walls_keep_light_out() {
    let map_size = 512;
    // A room whose walls face inwards, and lights outside.
    let (low, high) = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let mut scene = TestScene::default();
    scene.block(low, high, 64, true);
    for light in lights() {
        let light = Light { position: Vec3::new(-2.6, 2.9, 1.8), ..light };
        let mut n_leaks = 0;
        let shares = visibilities(&scene, &light, map_size);
        for (texel, share) in shares.iter().enumerate() {
            let Some(share) = *share else { continue };
            let position = scene.texels.position[texel];
            // Distance to the nearest wall other than the texel's own.
            let normal = scene.texels.geometric_normal[texel].abs();
            let to_walls = (position - low).min(high - position) + normal * 9.0;
            if to_walls.min_element() > 3.8 * footprint_m(&scene, &light, texel, map_size) {
                assert_eq!(share, 0.0, "{:?} at {position}", light.kind);
            }
            n_leaks += usize::from(share > 0.0);
        }
        let n_reached = shares.iter().flatten().count();
        println!("{:?}: light in {n_leaks} of {n_reached} texels", light.kind);
        assert!(n_leaks * 100 < n_reached, "{:?}: {n_leaks} of {n_reached}", light.kind);
    }
}

#[test]
fn light_falls_through_holes_and_no_more() {
    let holed = box_below_a_screen(32);
    let mut solid = box_below_a_screen(32);
    solid.casters.masks = None;
    let free = box_on_a_floor(32);
    for light in lights() {
        let sum = |scene: &TestScene| -> f32 { visibilities(scene, &light, 512).into_iter().flatten().sum() };
        let (free, holed, solid) = (sum(&free), sum(&holed), sum(&solid));
        // Half of the screen is holes; bilinear reads round their corners, the rows that mirror do not.
        let open = (holed - solid) / (free - solid);
        println!("{:?}: {open} of the screen's shadow is light", light.kind);
        assert!(free - solid > 200.0, "{:?}: {free} {solid}", light.kind);
        assert!((open - 0.5).abs() < 0.05, "{:?}: {open}", light.kind);
    }
}

#[test]
fn a_texel_half_in_shadow_has_the_share_of_its_samples_that_is_lit() {
    // A sheet over the floor ends at x = 0.3; light comes from straight above.
    let mut scene = TestScene::default();
    let p = Vec3::new;
    scene.quad([p(-2.0, 0.0, 2.0), p(2.0, 0.0, 2.0), p(2.0, 0.0, -2.0), p(-2.0, 0.0, -2.0)], 2);
    scene.quad([p(-2.0, 1.0, 2.0), p(0.3, 1.0, 2.0), p(0.3, 1.0, -2.0), p(-2.0, 1.0, -2.0)], 0);
    scene.texels.normal.fill(Vec3::Y);
    let sun = Light { direction: Vec3::NEG_Y, color: Vec3::ONE, ..light(LightKind::Directional) };
    let lit = |texels: &SceneTexels| direct_irradiance(texels, &scene.casters, std::slice::from_ref(&sun), 512);
    let own = lit(&scene.texels);
    assert_eq!([own[0].x, own[1].x], [0.0, sun.intensity]);
    // One sample in each texel's own place changes nothing; 64 over the 2 m of a texel find 1.7 m of it lit.
    let mut texels = scene.texels.clone();
    let sampled = |texels: &mut SceneTexels, places: &[f32]| {
        texels.samples.clear();
        for &position in &scene.texels.position {
            let point =
                |x: f32| SurfacePoint { position: position + x * Vec3::X, normal: Vec3::Y, geometric_normal: Vec3::Y };
            texels.samples.extend(places.iter().map(|&x| TexelSample::new(&point(x), position)));
        }
        texels.sample_end = (1..=scene.texels.len() as u32).map(|texel| texel * places.len() as u32).collect();
    };
    sampled(&mut texels, &[0.0]);
    assert_eq!(lit(&texels), own);
    sampled(&mut texels, &std::array::from_fn::<f32, 64, _>(|sample| (sample as f32 + 0.5) / 32.0 - 1.0));
    let shares = lit(&texels);
    // One sample of 64.
    assert!(shares[0].x == 0.0 && (shares[1].x / sun.intensity - 0.85).abs() < 1.0 / 64.0, "{shares:?}");
}

#[test]
fn lights_add_up_and_dark_ones_do_nothing() {
    let scene = box_on_a_floor(16);
    let all = direct_irradiance(&scene.texels, &scene.casters, &lights(), 128);
    let mut sums = vec![Vec3::ZERO; all.len()];
    for light in lights() {
        let dark = Light { intensity: 0.0, ..light.clone() };
        assert!(direct_irradiance(&scene.texels, &scene.casters, &[dark], 128).iter().all(|e| *e == Vec3::ZERO));
        let one = direct_irradiance(&scene.texels, &scene.casters, &[light], 128);
        sums.iter_mut().zip(one).for_each(|(sum, one)| *sum += one);
    }
    // Added in the same order.
    assert_eq!(all, sums);
}

#[test]
fn light_below_either_horizon_gives_nothing() {
    let mut scene = TestScene::default();
    scene.quad([Vec3::Z, Vec3::X + Vec3::Z, Vec3::X, Vec3::ZERO], 8);
    // Nothing casts, so that only the horizons count.
    scene.casters = Default::default();
    for (height, kind) in [(0.1, "above"), (-0.1, "below")] {
        let light = Light { direction: Vec3::new(1.0, -height, 0.0).normalize(), ..light(LightKind::Directional) };
        let lit = direct_irradiance(&scene.texels, &scene.casters, std::slice::from_ref(&light), 64);
        let faces = |texel: &usize| scene.texels.normal[*texel].dot(-light.direction) > 0.0;
        let n_facing = (0..lit.len()).filter(faces).count();
        // Both kinds of shading normals on either side.
        assert!((10..60).contains(&n_facing), "{kind}: {n_facing}");
        let n_lit = lit.iter().filter(|e| **e != Vec3::ZERO).count();
        assert_eq!(n_lit, if height > 0.0 { n_facing } else { 0 }, "{kind}");
    }
}
