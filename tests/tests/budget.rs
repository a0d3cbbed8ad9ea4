//! A bake of an unknown scene spends itself where people are, or says why not.

use glam::Vec3;
use localprt_precompute::pipeline::BakeOutput;
use localprt_precompute::settings::{BakeSettings, Density};
use localprt_tests::{bake, scene, small_settings};

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
