//! The node hierarchy: who is drawn, where, and the lights and cameras on the way.

use super::document::{Document, pointer};
use super::error::{LoadError, Source};
use super::resources::Limits;
use crate::light::{Light, LightKind};
use crate::scene::{Camera, LightmapWish};
use crate::unit::unit_or_keep;
use glam::{DMat4, DQuat, DVec3, Mat4, Vec3};
use gltf::json;
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::Checked;

const REPAIR: &str = "correct the node and export again";

/// Values of `texel_scale`.
const TEXEL_SCALES: std::ops::RangeInclusive<f64> = 1.0 / 64.0..=64.0;

/// A node of the scene with its transform to world space.
pub(super) struct Placed {
    pub node: usize,
    pub to_world: DMat4,
    /// Its own, or that of the nearest ancestor with one.
    pub lightmap: LightmapWish,
}

/// The nodes of the default scene (else the first, else all roots), depth first, parents before children.
pub(super) fn place(source: &Source, limits: &Limits, document: &Document) -> Result<Vec<Placed>, LoadError> {
    let parents = check_tree(source, document)?;
    let roots: Vec<usize> = match document.scene.or((!document.scenes.is_empty()).then_some(0)) {
        Some(scene) => {
            let roots = document.scenes[scene].clone();
            let mut listed = vec![false; document.nodes.len()];
            for (index, &node) in roots.iter().enumerate() {
                if parents[node].is_some() || std::mem::replace(&mut listed[node], true) {
                    let found = format!("node {node}, which is another node's child or listed twice");
                    return Err(source.invalid(format!("/scenes/{scene}/nodes/{index}"), found, REPAIR));
                }
            }
            roots
        }
        None => (0..document.nodes.len()).filter(|&node| parents[node].is_none()).collect(),
    };
    let mut placed = Vec::new();
    let at_rest = (DMat4::IDENTITY, LightmapWish::default());
    let mut pending: Vec<_> = roots.iter().rev().map(|&root| (root, at_rest, 0)).collect();
    while let Some((node, (parent, inherited), depth)) = pending.pop() {
        if depth > limits.depth {
            let (place, limit) = (pointer("nodes", node), limits.depth as u64);
            return Err(source.too_large(place, format!("{depth} levels of nodes"), limit, "flatten the hierarchy"));
        }
        let to_world = parent * local_transform(source, &document.nodes[node], node)?;
        let lightmap = lightmap_wish(source, document, node, inherited)?;
        for child in document.nodes[node].children.iter().flatten().rev() {
            pending.push((child.value(), (to_world, lightmap), depth + 1));
        }
        placed.push(Placed { node, to_world, lightmap });
    }
    Ok(placed)
}

/// What the node's extras say about the lightmap.
fn lightmap_wish(
    source: &Source,
    document: &Document,
    node: usize,
    inherited: LightmapWish,
) -> Result<LightmapWish, LoadError> {
    let Some(extras) = document.nodes[node].extras.as_ref() else { return Ok(inherited) };
    // Extras are anybody's: those of others may be anything.
    let Ok(serde_json::Value::Object(extras)) = serde_json::from_str(extras.get()) else { return Ok(inherited) };
    let Some(ours) = extras.get("localprt") else { return Ok(inherited) };
    let place = format!("{}/extras/localprt", pointer("nodes", node));
    let remedy = "write an object such as {\"texel_scale\": 2.0, \"bake\": true}";
    let Some(ours) = ours.as_object() else { return Err(source.invalid(place, ours.to_string(), remedy)) };
    let mut wish = inherited;
    for (key, value) in ours {
        let wrong = |remedy| Err(source.invalid(format!("{place}/{key}"), value.to_string(), remedy));
        match key.as_str() {
            "texel_scale" => match value.as_f64() {
                Some(scale) if TEXEL_SCALES.contains(&scale) => wish.texel_scale = scale as f32,
                _ => return wrong("give a number from 1/64 to 64: 2.0 makes texels half as large"),
            },
            // Custom properties of some modellers are numbers.
            "bake" => match (value.as_bool(), value.as_f64()) {
                (Some(bake), _) => wish.bake = bake,
                (None, Some(number)) => wish.bake = number != 0.0,
                (None, None) => return wrong("write true or false"),
            },
            _ => return wrong("remove it: only texel_scale and bake are known"),
        }
    }
    Ok(wish)
}

/// Lights of the placed nodes, in their order.
pub(super) fn lights(source: &Source, document: &Document, placed: &[Placed]) -> Result<Vec<Light>, LoadError> {
    let mut lights = Vec::new();
    for Placed { node, to_world, .. } in placed {
        let extensions = document.nodes[*node].extensions.as_ref();
        let Some(reference) = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else {
            continue;
        };
        let index = reference.light.value();
        let place = format!("/extensions/KHR_lights_punctual/lights/{index}");
        let light = &document.lights[index];
        let kind = match light.type_ {
            Checked::Valid(LightType::Point) => LightKind::Point,
            Checked::Valid(LightType::Directional) => LightKind::Directional,
            Checked::Valid(LightType::Spot) => {
                let spot = light.spot.as_ref();
                // Defaults of the extension.
                let inner_cone = spot.map_or(0.0, |spot| spot.inner_cone_angle);
                let outer_cone = spot.map_or(std::f32::consts::FRAC_PI_4, |spot| spot.outer_cone_angle);
                // 1e-6 lets writers round pi / 2 up.
                let widest = std::f32::consts::FRAC_PI_2 + 1e-6;
                if !(0.0 <= inner_cone && inner_cone <= outer_cone && 0.0 < outer_cone && outer_cone <= widest) {
                    let found = format!("cone half angles {inner_cone} and {outer_cone}");
                    return Err(source.invalid(place, found, "choose angles with 0 <= inner <= outer <= pi / 2"));
                }
                LightKind::Spot { inner_cone, outer_cone }
            }
            Checked::Invalid => {
                return Err(source.invalid(place, "an unknown light type", "use point, spot or directional"));
            }
        };
        let color = Vec3::from_array(light.color);
        let sound = |value: f32| value.is_finite() && value >= 0.0;
        if !color.to_array().into_iter().all(sound) || !sound(light.intensity) || !light.range.is_none_or(|r| r > 0.0) {
            let found = format!("color {color}, intensity {}, range {:?}", light.intensity, light.range);
            return Err(source.invalid(place, found, "make all finite and not negative, and the range larger than 0"));
        }
        let position = to_world.w_axis.truncate().as_vec3();
        let direction = unit_or_keep(-to_world.z_axis.truncate());
        if !position.is_finite() || !direction.is_finite() {
            return Err(source.invalid(pointer("nodes", *node), "a light at a place that is not finite", REPAIR));
        }
        lights.push(Light {
            name: name_of([&document.nodes[*node].name, &light.name], "light", lights.len()),
            kind,
            position,
            direction,
            color,
            intensity: light.intensity,
            range: light.range,
        });
    }
    Ok(lights)
}

/// Perspective cameras of the placed nodes, in their order; orthographic ones are left out.
pub(super) fn cameras(source: &Source, document: &Document, placed: &[Placed]) -> Result<Vec<Camera>, LoadError> {
    let mut cameras = Vec::new();
    for Placed { node, to_world, .. } in placed {
        let Some(index) = document.nodes[*node].camera else { continue };
        let camera = &document.cameras[index.value()];
        let Some(perspective) = &camera.perspective else { continue };
        let place = pointer("cameras", index.value());
        let fov_y = perspective.yfov;
        if !(fov_y > 0.0 && fov_y < std::f32::consts::PI) {
            return Err(source.invalid(place, format!("yfov {fov_y}, must be between 0 and pi"), REPAIR));
        }
        if perspective.aspect_ratio.is_some_and(|aspect| !(aspect > 0.0 && aspect.is_finite())) {
            return Err(source.invalid(place, "an aspectRatio that is not positive", REPAIR));
        }
        let to_world = without_scale(*to_world);
        if !to_world.is_finite() {
            return Err(source.invalid(pointer("nodes", *node), "a camera at a place that is not finite", REPAIR));
        }
        let name = name_of([&document.nodes[*node].name, &camera.name], "camera", cameras.len());
        cameras.push(Camera { name, to_world, fov_y, aspect: perspective.aspect_ratio });
    }
    Ok(cameras)
}

/// The first name that is not empty, or a numbered one.
pub(super) fn name_of(names: [&Option<String>; 2], kind: &str, number: usize) -> String {
    let given = names.into_iter().flatten().find(|name| !name.is_empty());
    given.cloned().unwrap_or_else(|| format!("{kind}_{number}"))
}

/// The parent of every node, once it is sure that the hierarchy is a forest.
fn check_tree(source: &Source, document: &Document) -> Result<Vec<Option<usize>>, LoadError> {
    let mut parents: Vec<Option<usize>> = vec![None; document.nodes.len()];
    for (node, value) in document.nodes.iter().enumerate() {
        for (position, child) in value.children.iter().flatten().enumerate() {
            let child = child.value();
            if let Some(other) = parents[child].replace(node) {
                let found = format!("node {child}, which is a child of node {other} already");
                return Err(source.invalid(format!("/nodes/{node}/children/{position}"), found, REPAIR));
            }
        }
    }
    // With at most one parent each, what is not below a root lies on or below a cycle.
    let mut reached = vec![false; document.nodes.len()];
    let mut pending: Vec<usize> = (0..document.nodes.len()).filter(|&node| parents[node].is_none()).collect();
    while let Some(node) = pending.pop() {
        reached[node] = true;
        pending.extend(document.nodes[node].children.iter().flatten().map(|child| child.value()));
    }
    match reached.iter().position(|reached| !reached) {
        Some(node) => {
            Err(source.invalid(pointer("nodes", node), "a node that is its own ancestor (a cycle)", "break the cycle"))
        }
        None => Ok(parents),
    }
}

fn local_transform(source: &Source, node: &json::Node, index: usize) -> Result<DMat4, LoadError> {
    let invalid = |key: &str, found: String| source.invalid(format!("/nodes/{index}/{key}"), found, REPAIR);
    if let Some(matrix) = node.matrix {
        let matrix = Mat4::from_cols_array(&matrix).as_dmat4();
        if !matrix.is_finite() || matrix.row(3) != glam::DVec4::W {
            return Err(invalid("matrix", "a matrix that is not finite and affine (last row 0 0 0 1)".into()));
        }
        return Ok(matrix);
    }
    let vector = |key: &str, value: Option<[f32; 3]>, default: DVec3| {
        let value = value.map_or(default, |value| Vec3::from_array(value).as_dvec3());
        if value.is_finite() { Ok(value) } else { Err(invalid(key, format!("{value}, must be finite"))) }
    };
    let translation = vector("translation", node.translation, DVec3::ZERO)?;
    let scale = vector("scale", node.scale, DVec3::ONE)?;
    let rotation = match node.rotation {
        None => DQuat::IDENTITY,
        Some(rotation) => {
            let rotation = DQuat::from_array(rotation.0.map(f64::from));
            if !(rotation.is_finite() && rotation.length_squared() > 0.0) {
                return Err(invalid("rotation", format!("{rotation}, must be a unit quaternion")));
            }
            rotation.normalize()
        }
    };
    Ok(DMat4::from_scale_rotation_translation(scale, rotation, translation))
}

/// The same place and view direction with orthonormal axes.
fn without_scale(to_world: DMat4) -> Mat4 {
    let back = to_world.z_axis.truncate().normalize_or(DVec3::Z);
    let right = to_world.y_axis.truncate().cross(back).normalize_or(back.any_orthonormal_vector());
    let up = back.cross(right);
    let axis = |axis: DVec3| axis.as_vec3().extend(0.0);
    Mat4::from_cols(axis(right), axis(up), axis(back), to_world.w_axis.truncate().as_vec3().extend(1.0))
}
