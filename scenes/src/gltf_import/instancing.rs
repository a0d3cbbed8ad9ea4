//! EXT_mesh_gpu_instancing: one node that draws its mesh many times.

use super::accessors::Accessor;
use super::error::LoadError;
use super::geometry::Geometry;
use glam::{DMat4, DQuat, DVec3};
use gltf::json::accessor::Type;
use serde_json::Value;

const NAME: &str = "EXT_mesh_gpu_instancing";
const REPAIR: &str = "export the instances again, for example with `npx @gltf-transform/cli instance`";

/// Number of instances of a node, from its counts alone; `None` without the extension.
pub(super) fn count(geometry: &Geometry<'_>, node: usize) -> Result<Option<u64>, LoadError> {
    let Some(attributes) = attributes(geometry, node) else { return Ok(None) };
    let counts = attributes.iter().map(|(_, accessor)| accessor.count as u64);
    let Some(count) = counts.clone().max() else {
        return Err(geometry.source.invalid(place(node), "instances without an attribute", REPAIR));
    };
    if counts.min() != Some(count) {
        return Err(geometry.source.invalid(place(node), "attributes of different counts", REPAIR));
    }
    if count > geometry.limits.instances {
        let (found, limit) = (format!("{count} instances"), geometry.limits.instances);
        return Err(geometry.source.too_large(place(node), found, limit, "split the scene or simplify it"));
    }
    Ok(Some(count))
}

/// From each instance to its node; `None` without the extension.
pub(super) fn transforms(geometry: &Geometry<'_>, node: usize) -> Result<Option<Vec<DMat4>>, LoadError> {
    let Some(count) = count(geometry, node)? else { return Ok(None) };
    let mut transforms = vec![(DVec3::ONE, DQuat::IDENTITY, DVec3::ZERO); count as usize];
    for (name, accessor) in attributes(geometry, node).into_iter().flatten() {
        let shape = if name == "ROTATION" { Type::Vec4 } else { Type::Vec3 };
        if !["TRANSLATION", "ROTATION", "SCALE"].contains(&name) {
            continue;
        }
        accessor.expect(geometry.source, name, &[shape], false)?;
        for (index, (scale, rotation, translation)) in transforms.iter_mut().enumerate() {
            let values = accessor.floats(index).map(f64::from);
            let vector = DVec3::new(values[0], values[1], values[2]);
            let is_sound = match name {
                "ROTATION" => {
                    let turn = DQuat::from_array(values);
                    *rotation = turn.normalize();
                    turn.is_finite() && turn.length_squared() > 0.0
                }
                "SCALE" => {
                    *scale = vector;
                    vector.is_finite()
                }
                _ => {
                    *translation = vector;
                    vector.is_finite()
                }
            };
            if !is_sound {
                let found =
                    format!("{name} {values:?} of instance {index}, must be finite, rotations unit quaternions");
                return Err(geometry.source.invalid(&accessor.place, found, REPAIR));
            }
        }
    }
    let matrix = |(scale, rotation, translation)| DMat4::from_scale_rotation_translation(scale, rotation, translation);
    Ok(Some(transforms.into_iter().map(matrix).collect()))
}

/// The accessors of a node's instances, by their names.
fn attributes<'a>(geometry: &Geometry<'a>, node: usize) -> Option<Vec<(&'a str, &'a Accessor<'a>)>> {
    let others = &geometry.document.nodes[node].extensions.as_ref()?.others;
    let attributes = others.get(NAME)?.get("attributes")?.as_object()?;
    let of =
        |(name, index): (&'a String, &'a Value)| Some((name.as_str(), &geometry.accessors[index.as_u64()? as usize]));
    Some(attributes.iter().filter_map(of).collect())
}

fn place(node: usize) -> String {
    format!("/nodes/{node}/extensions/{NAME}")
}
