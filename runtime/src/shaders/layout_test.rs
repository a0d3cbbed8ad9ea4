//! Compares structs of a shader with their records in Rust.

/// Fails unless the shader is valid and its struct has this size and exactly these members at these offsets.
#[track_caller]
pub(crate) fn assert_same_layout(shader: &str, name: &str, size: usize, members: &[(&str, usize)]) {
    let module =
        naga::front::wgsl::parse_str(shader).unwrap_or_else(|error| panic!("{}", error.emit_to_string(shader)));
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
