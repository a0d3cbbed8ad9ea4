// One shadow map's view, as ShadowView in views.rs; used where maps are drawn and where they are read.
struct ShadowView {
    origin: vec3f,
    scale_x: f32,
    right: vec3f,
    scale_y: f32,
    up: vec3f,
    // Clip z is depth_0 + depth_z z, clip w is w_0 + w_z z; 1 is at the light, 0 where nothing is.
    depth_0: f32,
    forward: vec3f,
    depth_z: f32,
    w_0: f32,
    w_z: f32,
}

// Twin: ShadowView::clip().
fn clip_position(view: ShadowView, position: vec3f) -> vec4f {
    let from_origin = position - view.origin;
    let z = dot(from_origin, view.forward);
    return vec4f(
        dot(from_origin, view.right) * view.scale_x,
        dot(from_origin, view.up) * view.scale_y,
        view.depth_0 + view.depth_z * z,
        view.w_0 + view.w_z * z,
    );
}
