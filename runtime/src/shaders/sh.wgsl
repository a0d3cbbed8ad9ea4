// Spherical harmonics of degree 0 and 1 in the order and with the signs of formats::sh; tested against it.

const SH_0: f32 = 0.28209479;
const SH_1: f32 = 0.48860251;

// l = 0 and 1 in a direction: 1, y, z, x.
fn sh_degree_1(dir: vec3f) -> vec4f {
    return vec4f(SH_0, SH_1 * dir.y, SH_1 * dir.z, SH_1 * dir.x);
}

// Weights that turn SH radiance of degree 1 into irradiance about a normal: A_0 = pi, A_1 = 2 pi / 3
// (Ramamoorthi and Hanrahan 2001).
fn irradiance_weights_degree_1(normal: vec3f) -> vec4f {
    return sh_degree_1(normal) * vec4f(3.14159265, vec3f(2.0943951));
}
