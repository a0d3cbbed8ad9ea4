use super::*;
use crate::object_light::ObjectLightRecord;
use crate::other_light::OtherRecord;
use std::mem::offset_of;

fn assert_same_layout(name: &str, size: usize, members: &[(&str, usize)]) {
    let source = source();
    let module =
        naga::front::wgsl::parse_str(&source).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)));
    let (flags, capabilities) = (naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    naga::valid::Validator::new(flags, capabilities).validate(&module).expect("a valid shader");
    let found = module.types.iter().find(|(_, declared)| declared.name.as_deref() == Some(name));
    let naga::TypeInner::Struct { members: found, span } = &found.expect("the struct").1.inner else {
        panic!("{name} is not a struct");
    };
    let found: Vec<_> =
        found.iter().map(|member| (member.name.as_deref().unwrap_or_default(), member.offset as usize)).collect();
    assert_eq!(found, members);
    assert_eq!(*span as usize, size);
}

#[test]
fn records_lie_as_the_shader_has_them() {
    let frame = [
        ("world_to_clip", offset_of!(FrameRecord, world_to_clip)),
        ("eye", offset_of!(FrameRecord, eye)),
        ("flags", offset_of!(FrameRecord, flags)),
        ("right", offset_of!(FrameRecord, right)),
        ("sky_kind", offset_of!(FrameRecord, sky_kind)),
        ("up", offset_of!(FrameRecord, up)),
        ("sky_turns", offset_of!(FrameRecord, sky_turns)),
        ("forward", offset_of!(FrameRecord, forward)),
        ("f0", offset_of!(FrameRecord, f0)),
        ("zenith", offset_of!(FrameRecord, zenith)),
        ("roughness", offset_of!(FrameRecord, roughness)),
        ("horizon", offset_of!(FrameRecord, horizon)),
        ("ground", offset_of!(FrameRecord, ground)),
        ("view", offset_of!(FrameRecord, view)),
        ("split_px", offset_of!(FrameRecord, split_px)),
    ];
    assert_same_layout("Frame", size_of::<FrameRecord>(), &frame);
    let material = [
        ("base_color", offset_of!(MaterialRecord, base_color)),
        ("emission", offset_of!(MaterialRecord, emission)),
        ("cutoff", offset_of!(MaterialRecord, cutoff)),
        ("albedo", offset_of!(MaterialRecord, albedo)),
        ("own_emission", offset_of!(MaterialRecord, own_emission)),
        ("normal_scale", offset_of!(MaterialRecord, normal_scale)),
        ("roughness", offset_of!(MaterialRecord, roughness)),
        ("has_normal_map", offset_of!(MaterialRecord, has_normal_map)),
        ("is_double_sided", offset_of!(MaterialRecord, is_double_sided)),
    ];
    assert_same_layout("Material", size_of::<MaterialRecord>(), &material);
    let object = [("to_world", 0), ("albedo", 64), ("emission", 80)];
    assert_same_layout("Object", size_of::<ObjectRecord>(), &object);
    let object_light = [
        ("origin", offset_of!(ObjectLightRecord, origin)),
        ("spacing_m", offset_of!(ObjectLightRecord, spacing_m)),
        ("size", offset_of!(ObjectLightRecord, size)),
        ("n_probes", offset_of!(ObjectLightRecord, n_probes)),
        ("n_sh", offset_of!(ObjectLightRecord, n_sh)),
    ];
    let other = [
        ("low", offset_of!(OtherRecord, low)),
        ("kind", offset_of!(OtherRecord, kind)),
        ("spacing", offset_of!(OtherRecord, spacing)),
        ("irradiance_side", offset_of!(OtherRecord, irradiance_side)),
        ("size", offset_of!(OtherRecord, size)),
        ("distance_side", offset_of!(OtherRecord, distance_side)),
        ("normal_bias_m", offset_of!(OtherRecord, normal_bias_m)),
        ("eye_bias_m", offset_of!(OtherRecord, eye_bias_m)),
        ("is_cage_biased", offset_of!(OtherRecord, is_cage_biased)),
        ("stored_power", offset_of!(OtherRecord, stored_power)),
        ("mean_power", offset_of!(OtherRecord, mean_power)),
        ("n_grids", offset_of!(OtherRecord, n_grids)),
        ("texels", size_of::<OtherRecord>()),
    ];
    // The record and a texel.
    assert_same_layout("Other", size_of::<OtherRecord>() + 16, &other);
    assert_same_layout("ObjectLight", size_of::<ObjectLightRecord>(), &object_light);
}
