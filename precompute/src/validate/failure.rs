//! The failure case of figure 12: a small bright secondary source where the file reconstructs worst.
//!
//! The receiver of the largest operator norm is looked for, and on the surfaces that it sees a place close by. A narrow
//! spot just in front of that place lights it: a source far smaller than what the probes' band limit can tell apart.

use super::{State, subject::Subject};
use crate::rays::frame;
use glam::Vec3;
use localprt_scenes::{Light, LightKind, Lighting, MaterialOverride};

/// The lit place is no nearer to the receiver than this, times the radius of support.
const LEAST_DISTANCE: f32 = 0.15;
/// Distance of the spot from the place, times the radius of support.
const SPOT_DISTANCE: f32 = 0.1;
/// Half angle of the spot, radians: the lit disc is a hundred times smaller than a support.
const CONE: f32 = 0.35;

/// The lighting that is hardest for the receivers `sample` with these operator norms; `None` if no receiver sees a
/// surface.
pub fn failure_case(subject: &Subject<'_>, sample: &[u32], norms: &[f32]) -> Option<State> {
    let mut order: Vec<usize> = (0..sample.len()).collect();
    order.sort_by(|&a, &b| norms[b].total_cmp(&norms[a]).then(a.cmp(&b)));
    order.into_iter().find_map(|index| lit_for(subject, sample[index]))
}

fn lit_for(subject: &Subject<'_>, receiver: u32) -> Option<State> {
    let point = subject.point(receiver);
    let radius = subject.radius_m(receiver);
    let caster = subject.caster;
    let origin = point.position + point.geometric_normal * caster.offset_m();
    let (tangent, bitangent) = frame(point.normal);
    let transport = subject.transport();
    let nearest = transport
        .gather
        .directions()
        .iter()
        .filter(|local| local.z > 0.3)
        .filter_map(|local| {
            caster.closest_hit(origin, tangent * local.x + bitangent * local.y + point.normal * local.z)
        })
        .filter(|hit| hit.point.is_some() && hit.t >= LEAST_DISTANCE * radius)
        .min_by(|a, b| a.t.total_cmp(&b.t))?;
    let free = caster.free_above(nearest.position, nearest.normal);
    let distance = (SPOT_DISTANCE * radius).min(0.5 * free);
    if distance < 0.1 * SPOT_DISTANCE * radius {
        return None;
    }
    let light = Light {
        name: "spot".into(),
        kind: LightKind::Spot { inner_cone: 0.8 * CONE, outer_cone: CONE },
        position: nearest.position + nearest.normal * distance,
        direction: -nearest.normal,
        color: Vec3::ONE,
        // Irradiance of 1000 in the middle of the disc, whatever the scale.
        intensity: 1000.0 * distance * distance,
        range: None,
    };
    let [x, y, z] = light.position.to_array();
    let dark = MaterialOverride { albedo: None, emission: Some(Vec3::ZERO) };
    let glowing = caster.scene().materials.iter().filter(|material| material.emission != Vec3::ZERO);
    let materials = glowing.map(|material| (material.name.clone(), dark)).collect();
    Some(State {
        name: format!("failure case: a small bright spot at {x:.2} {y:.2} {z:.2}"),
        lighting: Lighting { lights: vec![light], materials, ..Lighting::default() },
        counts: false,
    })
}
