//! The validator on scenes with known answers.

use localprt_formats::{BakedArrays, sh};
use localprt_precompute::{
    metrics::MethodError,
    pipeline::BakeOutput,
    progress::Progress,
    rays::RayCaster,
    settings::{BakeSettings, Transport},
    validate::{
        self, Findings, MeasureSettings, State, StateFindings, Subject, Sweep,
        methods::{ARIKAN, COMPRESSED, Method, PAPER, SPATIAL, UNCOMPRESSED, WITHOUT_LINKS},
        path_tracer::PathBudget,
        report::Metrics,
        seen,
        selection::sample,
        systems::Selection,
        viewpoints::viewpoints,
    },
};
use localprt_scenes::Lighting;
use localprt_tests::{bake, scene, small_settings};

/// A few hundred receivers, tiny pictures.
fn few() -> MeasureSettings {
    MeasureSettings {
        receivers: 300,
        bounces: 1,
        budget: PathBudget { error: 0.01, most_paths: 4096 },
        picture_width: 16,
        picture_paths: 8,
        flip_paths: 16,
        points: 200,
        picture_receivers: 64,
        pairs: 50,
        ..MeasureSettings::default()
    }
}

fn state(baked: &BakeOutput) -> State {
    State { name: "own".into(), lighting: Lighting::of_scene(&baked.scene), counts: true }
}

/// Validates a bake under its scene's own light, with sweeps of an option.
fn findings(baked: &BakeOutput, settings: &MeasureSettings, sweeps: &[(&str, &[&str])]) -> Findings {
    let caster = RayCaster::new(&baked.scene).expect("a tree");
    let progress = Progress::silent();
    let subject = Subject::new(baked.arrays.checked().expect("consistent arrays"), &caster, &progress)
        .expect("the scene fits the file");
    let sweeps: Vec<Sweep> = sweeps
        .iter()
        .map(|(option, values)| {
            let values: Vec<String> = values.iter().map(|&value| value.to_owned()).collect();
            let lightmap = baked.arrays.metadata.lightmap_size;
            Sweep::new(option, &values, &subject.settings, lightmap).expect("valid values")
        })
        .collect();
    let cameras = &baked.scene.cameras[..1];
    validate::validate(&subject, &[state(baked)], false, &sweeps, &Selection::default(), cameras, settings, &progress)
        .expect("findings")
}

fn error(state: &StateFindings, method: &Method) -> MethodError {
    state.methods.of(method).error
}

#[test]
fn every_method_is_right_in_a_furnace() {
    for (receiver_degree, probe_degree) in [(0, 7), (1, 4)] {
        let settings = BakeSettings { receiver_degree, probe_degree, ..small_settings() };
        let found = findings(&bake(scene("furnace"), &settings), &few(), &[]);
        let state = &found.states[0];
        // Radiance is the same everywhere, so blending is exact. The reference has the noise of emitter sampling: four
        // standard errors of the mean over independent receivers.
        let of_mean = state.parts.reference_noise / (found.sample.len() as f64).sqrt();
        assert!((state.mean / std::f64::consts::PI - 1.0).abs() < 4.0 * of_mean, "{} +- {of_mean}", state.mean);
        for (method, found) in state.methods.iter() {
            let (method, error) = (method.name, found.error);
            // The Gram error of 2000 relight rays (2e-3), the compression threshold of 0.005 on rows of norm 1.5 and, at
            // degree 1, 256 uniform directions: below 2 % together.
            assert!(error.nrmse < 0.02 && error.bias.abs() < 0.01, "{method} at degree {receiver_degree}: {error:?}");
        }
        assert!(state.parts.unseen < 1e-3 && state.parts.input < 1e-3, "{:?}", state.parts);
        // The same light everywhere, so reads between texels and across gutters cost nothing; the reference's noise is new.
        for seen in [state.views[0].error, state.area] {
            assert_eq!(seen.points, 200);
            assert!(seen.standard_error > 0.0 && seen.standard_error <= 0.02, "{seen:?}");
            assert!(seen.nrmse < 0.02 + seen.standard_error && seen.bias.abs() < 0.01, "{seen:?}");
            assert!(seen.nrmse_99 <= seen.nrmse && seen.unseen < 1e-3, "{seen:?}");
        }
    }
}

#[test]
fn local_reconstruction_beats_interpolation_and_its_parts_add_up() {
    let settings = BakeSettings { transport: Transport::Fitted, ..small_settings() };
    let baked = bake(scene("cornell"), &settings);
    // Bytes of links are an aim: one of 50 receivers is looked at, a link's share of its tile's nodes is taken as 0.55 and is 0 to
    // 1, which is 2 to 6 bytes instead of 4.2; links of next to no weight are not made however many bytes are left.
    let near = baked.report.bytes.near_light as f32 / baked.report.receivers as f32 / settings.near_bytes as f32;
    assert!((0.4..1.3).contains(&near), "{near} of the bytes asked for");
    // All receivers: what links bring is on the few that are close to something.
    let found = findings(&baked, &MeasureSettings { receivers: 10_000, ..few() }, &[]);
    let state = &found.states[0];
    eprintln!("{} receivers: {:?}", found.sample.len(), state.methods.map(|found| found.error.nrmse));
    let of = |method: &Method| error(state, method);
    let [compressed, uncompressed, without_links] = [of(&COMPRESSED), of(&UNCOMPRESSED), of(&WITHOUT_LINKS)];
    let [paper, spatial, arikan] = [of(&PAPER), of(&SPATIAL), of(&ARIKAN)];
    assert!(uncompressed.nrmse < 0.9 * without_links.nrmse, "{uncompressed:?} {without_links:?}");
    // An order, with room for a bake of 16 probes and 300 receivers: full bakes are asked for 0.45.
    assert!(compressed.nrmse < 0.6 * spatial.nrmse, "{compressed:?} {spatial:?}");
    assert!(compressed.nrmse < arikan.nrmse, "{compressed:?} {arikan:?}");
    // Compression may change a row by 0.005 RMS, a few thousandths of its norm, and errors here are a few percent.
    assert!((compressed.nrmse / uncompressed.nrmse - 1.0).abs() < 0.05, "{compressed:?} {uncompressed:?}");
    assert!(compressed.flip < spatial.flip && compressed.flip > 0.0);
    // Parts of one receiver add up to its error, so RMS errors obey the triangle inequality both ways.
    let parts = state.parts;
    let others = parts.unseen + parts.gather_rays + parts.compression + parts.input;
    assert!(compressed.nrmse <= parts.band_limit + others + 1e-6, "{parts:?}");
    assert!(parts.band_limit <= compressed.nrmse + others + 1e-6, "{parts:?}");
    assert!(parts.reference_noise > 0.0 && parts.reference_noise < 0.02, "{parts:?}");
    let worst = state.worst;
    let shares = worst.unseen + worst.band_limit + worst.gather_rays + worst.input + worst.compression;
    assert!((shares - 1.0).abs() < 1e-9 && worst.receivers >= 3, "{worst:?}");
    assert_eq!(state.steps.clusters.pairs, 50);
    // Fitted rows beat the paper's, and the fit predicts where it is wrong.
    assert!(uncompressed.nrmse < 0.5 * paper.nrmse, "{uncompressed:?} {paper:?}");
    // Of rows without near light: the prediction knows nothing of what the light map resolves.
    let rows = findings(&bake(scene("cornell"), &BakeSettings { near_bytes: 0, ..settings.clone() }), &few(), &[]);
    let nrmse = |method: &Method| error(&rows.states[0], method).nrmse;
    assert_eq!(nrmse(&UNCOMPRESSED), nrmse(&WITHOUT_LINKS), "no links, no difference");
    assert!(rows.norm_figures().rank_correlation.expect("varied") > 0.0);
    let predicted = rows.predicted_figures().expect("fitted");
    // Ranks that have nothing to do with each other correlate by 1 / sqrt(n - 1), one standard deviation.
    let by_chance = 1.0 / (rows.sample.len() as f64 - 1.0).sqrt();
    assert!(predicted.rank_correlation.expect("varied") > 4.0 * by_chance, "{predicted:?}");
    assert!(predicted.error_where_high > 2.0 * predicted.error_elsewhere, "{predicted:?}");
}

#[test]
fn viewpoints_stand_in_the_open_and_differ() {
    let mut room = scene("two-rooms");
    room.cameras.clear();
    let settings = BakeSettings { probes: Some(24), lightmap: Some(64), ..small_settings() };
    let baked = bake(room, &settings);
    let caster = RayCaster::new(&baked.scene).expect("a tree");
    let subject = Subject::new(baked.arrays.checked().expect("consistent arrays"), &caster, &Progress::silent())
        .expect("the scene fits the file");
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let cameras = viewpoints(&subject, 3);
            let seen: Vec<_> = cameras.iter().map(|camera| seen::of_view(&subject, camera, 300, 1)).collect();
            (cameras, seen, seen::by_area(&subject, 300, 1))
        })
    };
    let (cameras, seen, area) = on(1);
    let (cameras_on_three, seen_on_three, area_on_three) = on(3);
    let eyes: Vec<_> = cameras.iter().map(|camera| camera.to_world).collect();
    assert_eq!(eyes, cameras_on_three.iter().map(|camera| camera.to_world).collect::<Vec<_>>());
    assert_eq!((&seen, &area), (&seen_on_three, &area_on_three));
    assert!(cameras.len() >= 2, "two rooms take two views: {cameras:?}");
    for (camera, points) in cameras.iter().zip(&seen) {
        let eye = camera.to_world.w_axis.truncate();
        // A matrix was inverted in f32: some roundings of metres.
        assert!(subject.probe_positions().iter().any(|probe| probe.distance(eye) < 1e-5), "{eye}");
        assert!(points.len() > 250, "walls on all sides: {}", points.len());
        // What a camera sees, it sees from the front.
        assert!(points.iter().all(|seen| (eye - seen.point.position).dot(seen.point.geometric_normal) > 0.0));
    }
    // Nothing of one room is seen from the other, so the first two views share no receiver.
    let receivers = |points: &[seen::SeenPoint]| -> Vec<_> {
        points.iter().filter_map(|seen| subject.receiver_at(seen.uv)).collect()
    };
    let (first, second) = (receivers(&seen[0]), receivers(&seen[1]));
    assert!(!first.is_empty() && first.iter().all(|receiver| !second.contains(receiver)));
    assert_eq!(area.len(), 300);
}

#[test]
fn a_sealed_room_shows_no_leak() {
    let settings = BakeSettings { probes: Some(24), lightmap: Some(64), ..small_settings() };
    let found = findings(&bake(scene("two-rooms"), &settings), &few(), &[]);
    let leak = found.states[0].leak;
    assert!(leak.receivers > 100, "half of the receivers are in the dark: {leak:?}");
    assert!(leak.max <= 1e-6, "{leak:?}");
    // Steps across seams are measured where there are any.
    assert!(found.states[0].steps.within.pairs > 0);
}

#[test]
fn the_operator_norm_of_a_blind_receiver_is_that_of_the_cosine() {
    // One probe, so one of the two rooms has none.
    let settings = BakeSettings { probes: Some(1), lightmap: Some(64), near_bytes: 0, ..small_settings() };
    let baked = bake(scene("two-rooms"), &settings);
    let found = findings(&baked, &few(), &[]);
    // Norm of the clamped cosine up to degree 9: A_l^2 (2l + 1) / 4 pi for l = 0, 1, 2, 4, 6, 8, a little below that of the
    // whole lobe, sqrt(2 pi / 3) = 1.4472.
    let pi = std::f64::consts::PI;
    let lobe: [(f64, f64); 6] = [
        (0.0, pi),
        (1.0, 2.0 * pi / 3.0),
        (2.0, pi / 4.0),
        (4.0, pi / 24.0),
        (6.0, pi / 64.0),
        (8.0, 7.0 * pi / 768.0),
    ];
    let cosine = lobe.iter().map(|(l, a)| a * a * (2.0 * l + 1.0) / (4.0 * pi)).sum::<f64>().sqrt();
    assert!((1.44..1.4472).contains(&cosine), "{cosine}");
    let mut blind = 0;
    for (&receiver, &norm) in found.sample.iter().zip(&found.operator_norm) {
        if baked.arrays.receiver_unseen[receiver as usize] >= 0.999 {
            blind += 1;
            assert!((f64::from(norm) / cosine - 1.0).abs() < 1e-3, "{norm} {cosine}");
        }
    }
    assert!(blind > 50, "{blind}");
    // What no probe sees is read from the light map, as far as there are bytes for it.
    let near = bake(scene("two-rooms"), &BakeSettings { near_bytes: 100, ..settings });
    let mean = |arrays: &BakedArrays| arrays.receiver_unseen.iter().sum::<f32>() / arrays.receiver_unseen.len() as f32;
    let (without, with) = (mean(&baked.arrays), mean(&near.arrays));
    assert!(with < 0.2 * without, "{with} instead of {without}");
}

#[test]
fn more_functions_lower_the_error_and_the_operator_norm() {
    let baked = bake(scene("cornell"), &BakeSettings { probes: Some(24), ..small_settings() });
    let found = findings(&baked, &few(), &[("degree", &["1", "7"]), ("probes", &["4", "24"])]);
    for sweep in &found.sweeps {
        let [first, second] = &sweep.points[..] else { panic!("two points") };
        assert!(second.error.nrmse < first.error.nrmse, "{}: {first:?} {second:?}", sweep.option);
        assert!(second.operator_norm < first.operator_norm, "{}: {first:?} {second:?}", sweep.option);
        assert!(second.bytes > 0 && second.seconds > 0.0);
    }
    // A bake with the file's own options is the file.
    let own = &found.sweeps[0].points[1];
    assert_eq!(own.error.nrmse, error(&found.states[0], &COMPRESSED).nrmse);
}

#[test]
fn figures_do_not_depend_on_the_number_of_threads() {
    let baked = bake(scene("cornell"), &small_settings());
    let settings = MeasureSettings { receivers: 60, bounces: 2, ..few() };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let metrics = Metrics::of(&findings(&baked, &settings, &[]), &settings);
            serde_json::to_string(&metrics).expect("JSON")
        })
    };
    let one = run(1);
    assert_eq!(one, run(3));
    assert!(!one.contains("null"), "{one}");
}

#[test]
fn a_file_of_another_scene_is_refused() {
    let baked = bake(scene("furnace"), &small_settings());
    let mut moved = baked.scene.clone();
    for position in moved.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions) {
        *position *= 1.25;
    }
    let caster = RayCaster::new(&moved).expect("a tree");
    let refused = Subject::new(baked.arrays.checked().expect("consistent arrays"), &caster, &Progress::silent())
        .err()
        .expect("another scene");
    assert!(refused.to_string().contains("does not fit its scene"), "{refused}");
    // All receivers are measured where there are no more than asked for.
    assert_eq!(sample(5, 300, 1).len(), 5);
    assert_eq!(sh::function_count(validate::operator_norm::FIELD_DEGREE), 100);
}
