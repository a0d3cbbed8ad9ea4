//! A bake of an unknown scene spends itself where people are, or says why not.

use glam::{Mat2, Vec2, Vec3};
use localprt_precompute::pipeline::BakeOutput;
use localprt_precompute::settings::{BakeSettings, Density};
use localprt_scenes::{Light, LightKind, Lighting, Material, Mesh, Scene};
use localprt_tests::{bake, relit, scene, small_settings};

#[test]
fn a_room_on_a_wide_plain_gets_most_of_the_budget() {
    let settings = |density| BakeSettings {
        probes: Some(60),
        lightmap: None,
        receivers: 5000,
        gather_rays: 16,
        relight_rays: 100,
        density,
        ..small_settings()
    };
    let [scale, uniform] =
        [Density::Scale, Density::Uniform].map(|density| bake(scene("room-on-plain"), &settings(density)));
    // The room is a thousandth of the plain by area.
    let [in_room, in_room_uniform] = [&scale, &uniform].map(|baked| {
        let is_inside = |[x, y, z]: [f32; 3]| x.abs() < 4.2 && z.abs() < 5.2 && y < 3.2 && y > -0.1;
        let probes = baked.arrays.probes.iter().filter(|probe| is_inside(probe.position)).count();
        let positions = &baked.arrays.receiver_position;
        let receivers = positions.iter().filter(|position| is_inside(**position)).count();
        (probes, receivers as f64 / positions.len() as f64)
    });
    assert!(in_room.0 >= 10 && in_room.1 > 0.5, "{in_room:?}");
    assert!(in_room_uniform.0 < 10 && in_room_uniform.1 < 0.2, "{in_room_uniform:?}");
    let budgets = [&scale, &uniform].map(|baked| &baked.report.budget);
    for budget in budgets {
        assert_eq!(budget.receivers_asked, 5000);
        assert!(budget.texel.finest <= budget.texel.median && budget.texel.median <= budget.texel.coarsest);
        assert_eq!(budget.views.len(), 1);
    }
    assert!((scale.report.receivers as f64 / 5000.0 - 1.0).abs() < 0.03, "{}", scale.report.receivers);
    assert!(budgets[0].views[0].texel_median < 0.2 * budgets[1].views[0].texel_median);
    let reach = budgets.map(|budget| budget.views[0].reach);
    assert!(reach[0] > 0.5 && reach[1] < 0.2, "{reach:?}");
    let warned = |baked: &BakeOutput| baked.report.warnings.iter().any(|warning| warning.contains("within the reach"));
    assert!(!warned(&scale) && warned(&uniform), "{:?} {:?}", scale.report.warnings, uniform.report.warnings);
}

#[test]
fn a_focus_takes_texels_and_probes_to_it() {
    let settings = |focus| BakeSettings {
        probes: Some(40),
        lightmap: None,
        receivers: 3000,
        gather_rays: 16,
        relight_rays: 100,
        focus,
        ..small_settings()
    };
    let [plain, focused] = [vec![], vec![[-0.5, 0.4, -0.4, 0.4]]].map(|focus| bake(scene("cornell"), &settings(focus)));
    let [plain, focused] = [&plain, &focused].map(|baked| {
        let place = Vec3::new(-0.5, 0.4, -0.4);
        let positions = &baked.arrays.receiver_position;
        let near = positions.iter().filter(|position| Vec3::from(**position).distance(place) < 0.8).count();
        near as f64 / positions.len() as f64
    });
    assert!(focused > 1.1 * plain, "{focused} {plain}");
}

/// A closed room of 4 x 2.4 x 4 m whose floor is four strips, each with its own wish; a lamp under the ceiling.
fn room_with_strips(texel_scales: [f32; 4]) -> Scene {
    let quad = |name: &str, corner: Vec3, u: Vec3, v: Vec3| Mesh {
        name: name.into(),
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        normals: vec![u.cross(v).normalize(); 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let (x, y, z) = (4.0 * Vec3::X, 2.4 * Vec3::Y, 4.0 * Vec3::Z);
    let mut meshes = vec![
        quad("ceiling", y, x, z),
        quad("back", Vec3::ZERO, x, y),
        quad("front", z, y, x),
        quad("left", Vec3::ZERO, y, z),
        quad("right", x, z, y),
    ];
    for (strip, texel_scale) in texel_scales.into_iter().enumerate() {
        let mut floor = quad(&format!("floor {strip}"), strip as f32 * Vec3::X, z, Vec3::X);
        floor.lightmap.texel_scale = texel_scale;
        meshes.push(floor);
    }
    let lamp = Light {
        name: "lamp".into(),
        kind: LightKind::Point,
        position: Vec3::new(1.7, 1.9, 1.2),
        direction: Vec3::NEG_Y,
        color: Vec3::ONE,
        intensity: 10.0,
        range: None,
    };
    Scene { meshes, materials: vec![Material::default()], lights: vec![lamp], ..Scene::default() }
}

#[test]
fn steps_of_density_are_no_steps_of_light() {
    let settings =
        BakeSettings { lightmap: None, receivers: 6000, probes: Some(40), gather_rays: 1024, ..small_settings() };
    // Mean and largest step across the borders of the strips, over the mean irradiance.
    let steps = |texel_scales| {
        let baked = bake(room_with_strips(texel_scales), &settings);
        let lighting = Lighting::of_scene(&baked.scene);
        let map = relit(&baked, &lighting, 1, |relighter| relighter.relit().maps.irradiance.clone());
        // The floor's coordinates are affine in each strip.
        let read = |strip: usize, x: f32, z: f32| {
            let mesh = baked.scene.meshes.iter().find(|mesh| mesh.name == format!("floor {strip}")).expect("strip");
            let uv = mesh.lightmap_uv().expect("laid out");
            let [a, b, c] = mesh.triangles[0].map(|vertex| vertex as usize);
            let local = |at: Vec3| Vec2::new(at.x, at.z);
            let [p, q, r] = [a, b, c].map(|vertex| local(mesh.positions[vertex]));
            let solve = Mat2::from_cols(q - p, r - p).inverse() * (Vec2::new(x, z) - p);
            map.sample(uv[a] + (uv[b] - uv[a]) * solve.x + (uv[c] - uv[a]) * solve.y).expect("covered").y
        };
        let (mut sum, mut largest, mut light) = (0.0f32, 0.0f32, 0.0f32);
        for border in 1..4 {
            for step in 0..38 {
                let (x, z) = (border as f32, 0.15 + 0.1 * step as f32);
                let [left, right] = [read(border - 1, x - 1e-3, z), read(border, x + 1e-3, z)];
                sum += (left - right).abs();
                largest = largest.max((left - right).abs());
                light += 0.5 * (left + right);
            }
        }
        [sum / light, largest * 3.0 * 38.0 / light]
    };
    let [even, uneven] = [steps([1.0; 4]), steps([1.0, 2.0, 4.0, 8.0])];
    // Not derived: measured are 1.04 and 1.65 times, and 2.1 %.
    assert!(uneven[0] < 1.2 * even[0] && uneven[1] < 2.0 * even[1], "{uneven:?} {even:?}");
    assert!(uneven[0] < 0.03, "{uneven:?}");
}
