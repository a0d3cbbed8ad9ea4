//! Primitives to triangles, in the mesh's own space and placed in the world.

use super::accessors::Accessor;
use super::document::{Document, remedy_for};
use super::error::{LoadError, Source};
use super::resources::Limits;
use crate::scene::Mesh;
use crate::unit::unit_or_keep;
use glam::{DMat3, DMat4, Vec2, Vec3, Vec4};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

/// Texture coordinate sets beyond this number are refused: the specification numbers them without gaps.
const MAX_UV_SETS: u32 = 32;

const REPAIR: &str = "export the mesh again or repair it (npx gltf-validator names every fault)";

/// A primitive's triangles with the vertices that they use.
pub(super) struct Triangles {
    positions: Vec<Vec3>,
    /// Zero where the file has none, or none that can be used.
    normals: Vec<Vec3>,
    tangents: Vec<Vec4>,
    uv_sets: Vec<Vec<Vec2>>,
    colors: Vec<Vec4>,
    triangles: Vec<[u32; 3]>,
}

/// What reading primitives needs.
pub(super) struct Geometry<'a> {
    pub source: &'a Source,
    pub limits: &'a Limits,
    pub document: &'a Document,
    pub accessors: &'a [Accessor<'a>],
}

impl Geometry<'_> {
    /// Number of triangles of a primitive, from its counts alone; `None` for points and lines.
    pub fn triangle_count(&self, mesh: usize, primitive: usize) -> Result<Option<u64>, LoadError> {
        let data = &self.document.meshes[mesh].primitives[primitive];
        let place = place_of(mesh, primitive);
        let (Some(mode), Some(positions)) = (surface_mode(data), self.attribute(data, Semantic::Positions)) else {
            return Ok(None);
        };
        let count = data.indices.map_or(positions.count, |index| self.accessors[index.value()].count) as u64;
        let what = if data.indices.is_some() { "indices" } else { "vertices" };
        match mode {
            Surface::List if count.is_multiple_of(3) => Ok(Some(count / 3)),
            Surface::List => {
                let found = format!("{count} {what} for triangles, must be a multiple of 3");
                Err(self.source.invalid(place, found, REPAIR))
            }
            _ if count >= 3 => Ok(Some(count - 2)),
            _ => {
                let found = format!("{count} {what} for a strip or fan, must be at least 3");
                Err(self.source.invalid(place, found, REPAIR))
            }
        }
    }

    /// Reads a primitive; `None` for points and lines, and for a primitive that draws nothing because it has no
    /// positions.
    pub fn read(&self, mesh: usize, primitive: usize) -> Result<Option<Triangles>, LoadError> {
        let data = &self.document.meshes[mesh].primitives[primitive];
        let place = place_of(mesh, primitive);
        let (Some(mode), Some(positions)) = (surface_mode(data), self.attribute(data, Semantic::Positions)) else {
            return Ok(None);
        };
        let others = data.extensions.as_ref().map(|extensions| &extensions.others);
        let draco = others.is_some_and(|others| others.contains_key("KHR_draco_mesh_compression"));
        positions.expect_data(self.source, "positions", draco)?;
        positions.expect(self.source, "POSITION", &[Type::Vec3], false)?;

        let corners = self.corners(data, positions.count, draco)?;
        let listed = triangle_list(mode, &corners);
        let normals = self.attribute(data, Semantic::Normals);
        let (vertices, triangles) = match normals {
            Some(_) => shared_vertices(&listed),
            // Without normals the surface is flat (section 3.7.2.1), so no vertex is shared.
            None => {
                (listed.clone(), (0..listed.len() as u32 / 3).map(|each| [0, 1, 2].map(|k| 3 * each + k)).collect())
            }
        };

        let values = |accessor: &Accessor<'_>, fault_of: Fault| self.gather(accessor, &vertices, positions, fault_of);
        let truncated = |values: Vec<Vec4>| values.into_iter().map(Vec4::truncate).collect();
        let mut result = Triangles {
            positions: truncated(values(positions, Fault::Refuse)?),
            normals: vec![Vec3::ZERO; vertices.len()],
            tangents: Vec::new(),
            uv_sets: Vec::new(),
            colors: Vec::new(),
            triangles,
        };
        if let Some(normals) = normals {
            normals.expect(self.source, "NORMAL", &[Type::Vec3], false)?;
            result.normals = truncated(values(normals, Fault::Zero)?);
            if let Some(tangents) = self.attribute(data, Semantic::Tangents) {
                tangents.expect(self.source, "TANGENT", &[Type::Vec4], false)?;
                result.tangents = values(tangents, Fault::Zero)?;
            }
        }
        if let Some(colors) = self.attribute(data, Semantic::Colors(0)) {
            colors.expect(self.source, "COLOR_0", &[Type::Vec3, Type::Vec4], false)?;
            colors.expect_scaled(self.source, "COLOR_0")?;
            result.colors = values(colors, Fault::Refuse)?;
            if colors.components() == 3 {
                result.colors.iter_mut().for_each(|color| color.w = 1.0);
            }
        }
        for (semantic, accessor) in &data.attributes {
            let Checked::Valid(Semantic::TexCoords(set)) = semantic else { continue };
            if *set >= MAX_UV_SETS {
                let found = format!("TEXCOORD_{set}, numbers must be below {MAX_UV_SETS}");
                return Err(self.source.invalid(place, found, REPAIR));
            }
            let accessor = &self.accessors[accessor.value()];
            accessor.expect(self.source, "TEXCOORD", &[Type::Vec2], false)?;
            // (0, 0) everywhere is how an absent set is read too.
            if accessor.says_something() {
                let set = *set as usize;
                result.uv_sets.resize(result.uv_sets.len().max(set + 1), Vec::new());
                result.uv_sets[set] =
                    values(accessor, Fault::Refuse)?.into_iter().map(|value| value.truncate().truncate()).collect();
            }
        }
        Ok(Some(result))
    }

    fn attribute(&self, data: &Primitive, semantic: Semantic) -> Option<&Accessor<'_>> {
        data.attributes.get(&Checked::Valid(semantic)).map(|index| &self.accessors[index.value()])
    }

    /// The vertices in drawing order, each below `count`.
    fn corners(&self, data: &Primitive, count: usize, draco: bool) -> Result<Vec<u32>, LoadError> {
        let Some(index) = data.indices else {
            return Ok((0..count as u32).collect());
        };
        let indices = &self.accessors[index.value()];
        indices.expect_indices(self.source)?;
        indices.expect_data(self.source, "indices", draco)?;
        let corners: Vec<u32> = (0..indices.count).map(|at| indices.index(at)).collect();
        match corners.iter().position(|&corner| corner as usize >= count) {
            Some(at) => {
                let found = format!("index {} (number {at}) into {count} vertices", corners[at]);
                Err(self.source.invalid(&indices.place, found, REPAIR))
            }
            None => Ok(corners),
        }
    }

    /// Values of the given vertices.
    fn gather(
        &self,
        accessor: &Accessor<'_>,
        vertices: &[u32],
        positions: &Accessor<'_>,
        fault: Fault,
    ) -> Result<Vec<Vec4>, LoadError> {
        if accessor.count != positions.count {
            let found =
                format!("{} elements, must be as many as {} has, {}", accessor.count, positions.place, positions.count);
            return Err(self.source.invalid(&accessor.place, found, REPAIR));
        }
        let read = |&vertex: &u32| {
            let value = Vec4::from_array(accessor.floats(vertex as usize));
            match (value.is_finite(), fault) {
                (true, _) => Ok(value),
                (false, Fault::Zero) => Ok(Vec4::ZERO),
                (false, Fault::Refuse) => {
                    let found = format!("element {vertex} is {value}, must be finite");
                    Err(self.source.invalid(&accessor.place, found, REPAIR))
                }
            }
        };
        vertices.iter().map(read).collect()
    }

    /// A primitive in world space.
    pub fn place(&self, shape: &Triangles, to_world: DMat4, node: usize) -> Result<Mesh, LoadError> {
        let linear = DMat3::from_mat4(to_world);
        let determinant = linear.determinant();
        let (is_mirrored, is_unchanged) = (determinant < 0.0, linear == DMat3::IDENTITY);
        let place = |&point: &Vec3| to_world.transform_point3(point.as_dvec3()).as_vec3();
        let positions: Vec<Vec3> = shape.positions.iter().map(place).collect();
        if !positions.iter().all(|position| position.is_finite()) {
            let found = "a transform that takes positions out of the range of 32-bit floats";
            return Err(self.source.invalid(format!("/nodes/{node}"), found, "scale the scene down"));
        }
        // The inverse transpose without the division: cofactors keep their accuracy and exist for flattened shapes.
        let cofactors = DMat3::from_cols(
            linear.y_axis.cross(linear.z_axis),
            linear.z_axis.cross(linear.x_axis),
            linear.x_axis.cross(linear.y_axis),
        ) * determinant.signum();
        let turn = |matrix: DMat3, vector: Vec3| {
            let turned = if is_unchanged { vector.as_dvec3() } else { matrix * vector.as_dvec3() };
            unit_or_keep(turned)
        };
        let handedness = if is_mirrored { -1.0 } else { 1.0 };
        let tangent = |tangent: &Vec4| turn(linear, tangent.truncate()).extend(tangent.w * handedness);
        let winding = |&[a, b, c]: &[u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
        Ok(Mesh {
            positions,
            normals: shape.normals.iter().map(|&normal| turn(cofactors, normal)).collect(),
            tangents: shape.tangents.iter().map(tangent).collect(),
            uv_sets: shape.uv_sets.clone(),
            colors: shape.colors.clone(),
            triangles: shape.triangles.iter().map(winding).collect(),
            ..Mesh::default()
        })
    }

    /// Refuses geometry beyond the limit; `total` counts every instance.
    pub fn check_total(&self, total: u64, node: usize) -> Result<(), LoadError> {
        if total > self.limits.triangles {
            let found = format!("{total} triangles up to this node");
            let remedy = "split the scene or simplify it";
            return Err(self.source.too_large(format!("/nodes/{node}"), found, self.limits.triangles, remedy));
        }
        Ok(())
    }
}

/// JSON pointer of a primitive.
pub(super) fn place_of(mesh: usize, primitive: usize) -> String {
    format!("/meshes/{mesh}/primitives/{primitive}")
}

/// What happens to values that are not finite.
#[derive(Clone, Copy)]
enum Fault {
    Refuse,
    /// Replaced later.
    Zero,
}

#[derive(Clone, Copy)]
enum Surface {
    List,
    Strip,
    Fan,
}

fn surface_mode(data: &Primitive) -> Option<Surface> {
    match data.mode {
        Checked::Valid(Mode::Triangles) => Some(Surface::List),
        Checked::Valid(Mode::TriangleStrip) => Some(Surface::Strip),
        Checked::Valid(Mode::TriangleFan) => Some(Surface::Fan),
        _ => None,
    }
}

/// Three corners per triangle, in the order that section 3.7.2.1 of the specification gives.
fn triangle_list(mode: Surface, corners: &[u32]) -> Vec<u32> {
    let triangles = 0..corners.len().saturating_sub(2);
    match mode {
        Surface::List => corners.to_vec(),
        Surface::Strip => triangles.flat_map(|i| [i, i + 1 + i % 2, i + 2 - i % 2].map(|at| corners[at])).collect(),
        Surface::Fan => triangles.flat_map(|i| [i + 1, i + 2, 0].map(|at| corners[at])).collect(),
    }
}

/// The vertices in use, in file order, and the triangles over them. Cost depends on the triangles only: many primitives
/// may share one large vertex buffer.
fn shared_vertices(listed: &[u32]) -> (Vec<u32>, Vec<[u32; 3]>) {
    let mut vertices = listed.to_vec();
    vertices.sort_unstable();
    vertices.dedup();
    let renumbered = |vertex: u32| vertices.partition_point(|&each| each < vertex) as u32;
    let triangles =
        listed.chunks_exact(3).map(|corners| [corners[0], corners[1], corners[2]].map(renumbered)).collect();
    (vertices, triangles)
}

/// Refuses a primitive without positions whose geometry is only in an extension.
pub(super) fn check_primitive(
    source: &Source,
    document: &Document,
    mesh: usize,
    primitive: usize,
) -> Result<(), LoadError> {
    let data = &document.meshes[mesh].primitives[primitive];
    if surface_mode(data).is_none() || data.attributes.contains_key(&Checked::Valid(Semantic::Positions)) {
        return Ok(());
    }
    let others = data.extensions.as_ref().map(|extensions| &extensions.others);
    match others.and_then(|others| others.keys().next()) {
        Some(name) => {
            let feature = format!("geometry stored only with {name}");
            Err(source.unsupported(place_of(mesh, primitive), feature, remedy_for(name)))
        }
        None => Err(source.invalid(place_of(mesh, primitive), "a primitive without POSITION", REPAIR)),
    }
}
