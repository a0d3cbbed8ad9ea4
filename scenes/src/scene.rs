//! The scene as the bake sees it: triangles in world space, materials, textures, lights and cameras.

use crate::light::Light;
use glam::{Affine2, Mat4, Vec2, Vec3, Vec4};

/// A whole scene. Every mesh is one primitive of one node, already in world space.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// A short name for messages and reports.
    pub name: String,
    /// Geometry; mesh order is node order (depth first), then primitive order.
    pub meshes: Vec<Mesh>,
    /// Materials; never empty once a mesh refers to one (a default one is added by the importer).
    pub materials: Vec<Material>,
    /// Textures, decoded to 8-bit RGBA as stored in the file (color textures are still sRGB encoded).
    pub textures: Vec<Texture>,
    /// Images referred to by textures.
    pub images: Vec<Image>,
    /// Punctual lights of the file.
    pub lights: Vec<Light>,
    /// Perspective cameras of the file.
    pub cameras: Vec<Camera>,
    /// Names of material variants: [`Scene::apply_variant`].
    pub variants: Vec<String>,
    /// TEXCOORD set of all meshes that lays out the direct light map, where that is not the lightmap's (TEXCOORD_1).
    pub light_map_set: Option<usize>,
    /// What the sanitiser dropped.
    pub dropped: DroppedTriangles,
    /// BLAKE3 over the bytes of the scene file and every buffer and image it names, in order of reference.
    pub hash: [u8; 32],
}

/// Triangles left out of a [`Scene`], by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DroppedTriangles {
    /// Area below 1e-12 of the squared scene extent, or repeated vertex positions.
    pub degenerate: usize,
    /// Same three positions as an earlier triangle that covers the same side (any winding if double-sided).
    pub duplicate: usize,
}

/// One drawable piece: positions in metres, one material.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Node name, or mesh name, or a made-up one.
    pub name: String,
    /// Place in the source file as a JSON pointer, such as `/meshes/3/primitives/0`.
    pub source: String,
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// World space, metres.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one per position.
    pub normals: Vec<Vec3>,
    /// Tangents with handedness in w; empty where the file has none and no normal map asks for them.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets by TEXCOORD number; each is empty or one per position.
    pub uv_sets: Vec<Vec<Vec2>>,
    /// COLOR_0 as linear RGBA; empty if absent.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Its material in some of the scene's variants: `[variant, material]`, indices into [`Scene::variants`] and [`Scene::materials`].
    pub variants: Vec<[usize; 2]>,
    /// What its author wants of the lightmap.
    pub lightmap: LightmapWish,
}

/// What the author of a mesh wants of the lightmap: `extras` of its node, `{"localprt": {"texel_scale": 2.0, "bake": true}}`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightmapWish {
    /// Texels along a metre, relative to what they would be; above 0.
    pub texel_scale: f32,
    /// Whether the mesh is to be lit by the lightmap.
    pub bake: bool,
}

impl Default for LightmapWish {
    fn default() -> Self {
        Self { texel_scale: 1.0, bake: true }
    }
}

impl Mesh {
    /// Whether its arrays agree, its vertices are there and its numbers are finite: of a mesh that was loaded they are.
    pub fn is_sound(&self) -> bool {
        let count = self.positions.len();
        let has = |length: usize| length == 0 || length == count;
        self.normals.len() == count
            && has(self.tangents.len())
            && has(self.colors.len())
            && self.uv_sets.iter().all(|set| has(set.len()))
            && self.triangles.iter().flatten().all(|&vertex| (vertex as usize) < count)
            && self.positions.iter().chain(&self.normals).all(|value| value.is_finite())
            && self.tangents.iter().chain(&self.colors).all(|value| value.is_finite())
            && self.uv_sets.iter().flatten().all(|value| value.is_finite())
            && self.lightmap.texel_scale.is_finite()
            && self.lightmap.texel_scale > 0.0
    }

    /// Lightmap coordinates (TEXCOORD_1), if the mesh has them.
    pub fn lightmap_uv(&self) -> Option<&[Vec2]> {
        self.uv_set(1)
    }

    /// A set of texture coordinates, if the mesh has it.
    pub fn uv_set(&self, number: usize) -> Option<&[Vec2]> {
        self.uv_sets.get(number).filter(|set| !set.is_empty() || self.positions.is_empty()).map(Vec::as_slice)
    }
}

/// How alpha is used. Blended surfaces are treated as masks at 0.5 by the bake.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Present where alpha >= cutoff.
    Mask {
        /// The threshold.
        cutoff: f32,
    },
    /// Blended in the source; a mask at 0.5 here.
    Blend,
}

/// A diffuse, possibly emissive surface. Metals are treated as diffuse with their base color.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name, unique within the scene where the file allows; lighting files refer to it.
    pub name: String,
    /// Linear base color factor; alpha in w.
    pub base_color: Vec4,
    /// sRGB texture times the factor.
    pub base_color_texture: Option<TextureRef>,
    /// Radiance in W sr^-1 m^-2: emissive factor times KHR_materials_emissive_strength.
    pub emission: Vec3,
    /// sRGB texture times the emission.
    pub emission_texture: Option<TextureRef>,
    /// Tangent-space normal map, kept for the runtime.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal map.
    pub normal_scale: f32,
    /// Metallic factor, kept for the runtime.
    pub metallic: f32,
    /// Roughness factor, kept for the runtime.
    pub roughness: f32,
    /// Alpha mode.
    pub alpha: AlphaMode,
    /// Visible, and reflecting, from both sides.
    pub double_sided: bool,
    /// Share of light that passes through, KHR_materials_transmission: light transport takes such surfaces as opaque, or leaves them out
    /// ([`Scene::leave_out_clear`]).
    pub transmission: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: "default".into(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            metallic: 1.0,
            roughness: 1.0,
            alpha: AlphaMode::Opaque,
            double_sided: false,
            transmission: 0.0,
        }
    }
}

/// A texture as a material uses it.
#[derive(Clone, Copy, Debug)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: usize,
    /// Texture coordinate set (after KHR_texture_transform's override).
    pub uv_set: usize,
    /// KHR_texture_transform.
    pub transform: Affine2,
}

/// How coordinates outside 0..1 are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Tile.
    #[default]
    Repeat,
    /// Tile, every other one mirrored.
    MirroredRepeat,
    /// Clamp.
    ClampToEdge,
}

/// An image with its sampler.
#[derive(Clone, Copy, Debug)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: usize,
    /// Horizontal wrap.
    pub wrap_u: Wrap,
    /// Vertical wrap.
    pub wrap_v: Wrap,
    /// Magnification filter: nearest instead of linear.
    pub nearest: bool,
}

/// Pixels as stored: RGBA, 8 bits, top row first.
#[derive(Clone, Debug)]
pub struct Image {
    /// Name or file name.
    pub name: String,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height * 4` bytes.
    pub rgba: Vec<u8>,
    /// The encoded bytes with their MIME type, kept so that an exported scene carries the same image.
    pub encoded: Option<(String, Vec<u8>)>,
}

/// A perspective camera; looks along -Z of its transform, +Y up.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name.
    pub name: String,
    /// Camera to world, no scale.
    pub to_world: Mat4,
    /// Vertical field of view in radians.
    pub fov_y: f32,
    /// Width over height; `None` takes the picture's.
    pub aspect: Option<f32>,
}

/// A triangle of the scene: index over all meshes in order, then over triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FaceId(pub u32);

/// A point of the scene's surface, on one of its sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// World space, metres.
    pub position: Vec3,
    /// Unit shading normal, on the side of the geometric normal.
    pub normal: Vec3,
    /// Unit normal of the triangle: directions below its horizon bring nothing.
    pub geometric_normal: Vec3,
}

impl Scene {
    /// Number of triangles over all meshes.
    pub fn face_count(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.triangles.len()).sum()
    }

    /// `(mesh, triangle)` of every face in [`FaceId`] order.
    pub fn faces(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.meshes
            .iter()
            .enumerate()
            .flat_map(|(mesh_index, mesh)| (0..mesh.triangles.len()).map(move |triangle| (mesh_index, triangle)))
    }

    /// Smallest box around all positions, `None` for a scene without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut points = self
            .meshes
            .iter()
            .flat_map(|mesh| mesh.triangles.iter().flatten().map(|&vertex| mesh.positions[vertex as usize]));
        let first = points.next()?;
        Some(points.fold((first, first), |(low, high), point| (low.min(point), high.max(point))))
    }

    /// Length of the box's diagonal in metres; 0 for an empty scene.
    pub fn extent(&self) -> f32 {
        self.bounds().map_or(0.0, |(low, high)| (high - low).length())
    }

    /// Corner positions of a triangle.
    pub fn corners(&self, mesh: usize, triangle: usize) -> [Vec3; 3] {
        let mesh = &self.meshes[mesh];
        mesh.triangles[triangle].map(|vertex| mesh.positions[vertex as usize])
    }

    /// A point of a triangle, world space, metres.
    pub fn position(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> Vec3 {
        let [a, b, c] = self.corners(mesh, triangle);
        a * barycentrics.x + b * barycentrics.y + c * barycentrics.z
    }

    /// Area of a triangle, square metres.
    pub fn area_m2(&self, mesh: usize, triangle: usize) -> f64 {
        let [a, b, c] = self.corners(mesh, triangle).map(Vec3::as_dvec3);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Linear base color with alpha at a point of a triangle: factor x texture x vertex color.
    pub fn base_color(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> Vec4 {
        let mesh = &self.meshes[mesh];
        let material = &self.materials[mesh.material];
        let mut color = material.base_color;
        if let Some(reference) = &material.base_color_texture {
            color *= self.sample_srgb(reference, mesh, triangle, barycentrics);
        }
        if !mesh.colors.is_empty() {
            color *= interpolate(&mesh.triangles[triangle], barycentrics, |vertex| mesh.colors[vertex]);
        }
        color
    }

    /// Emitted radiance at a point of a triangle.
    pub fn emission(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> Vec3 {
        let mesh = &self.meshes[mesh];
        let material = &self.materials[mesh.material];
        match &material.emission_texture {
            Some(reference) if material.emission != Vec3::ZERO => {
                material.emission * self.sample_srgb(reference, mesh, triangle, barycentrics).truncate()
            }
            _ => material.emission,
        }
    }

    /// Whether the surface is there at this point: false in the holes of an alpha mask, and where a blended surface's
    /// alpha is below 0.5.
    pub fn is_present(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> bool {
        match self.materials[self.meshes[mesh].material].alpha {
            AlphaMode::Opaque => true,
            AlphaMode::Mask { cutoff } => self.alpha(mesh, triangle, barycentrics) >= cutoff,
            AlphaMode::Blend => self.alpha(mesh, triangle, barycentrics) >= 0.5,
        }
    }

    /// Alpha of [`Scene::base_color`], to the last bit: rays ask for it often.
    fn alpha(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> f32 {
        let mesh = &self.meshes[mesh];
        let material = &self.materials[mesh.material];
        let mut alpha = material.base_color.w;
        if let Some(reference) = &material.base_color_texture {
            let uv = reference.coordinate(mesh, triangle, barycentrics);
            alpha *= self.textures[reference.texture].sample_alpha(&self.images, uv);
        }
        if !mesh.colors.is_empty() {
            alpha *= interpolate(&mesh.triangles[triangle], barycentrics, |vertex| mesh.colors[vertex].w);
        }
        alpha
    }

    /// Unit shading normal at a point of a triangle, on the front side; falls back to the geometric normal.
    pub fn shading_normal(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> Vec3 {
        let data = &self.meshes[mesh];
        let normal = interpolate(&data.triangles[triangle], barycentrics, |vertex| data.normals[vertex]);
        let geometric = self.geometric_normal(mesh, triangle);
        let normal = normal.normalize_or(geometric);
        if normal.dot(geometric) > 0.0 { normal } else { geometric }
    }

    /// Unit geometric normal of a triangle (right-hand rule over its winding).
    pub fn geometric_normal(&self, mesh: usize, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners(mesh, triangle).map(Vec3::as_dvec3);
        (b - a).cross(c - a).normalize_or_zero().as_vec3()
    }

    /// A point of a triangle as a point of the surface.
    pub fn surface_point(&self, mesh: usize, triangle: usize, barycentrics: Vec3) -> SurfacePoint {
        SurfacePoint {
            position: self.position(mesh, triangle, barycentrics),
            normal: self.shading_normal(mesh, triangle, barycentrics),
            geometric_normal: self.geometric_normal(mesh, triangle),
        }
    }

    fn sample_srgb(&self, reference: &TextureRef, mesh: &Mesh, triangle: usize, barycentrics: Vec3) -> Vec4 {
        let uv = reference.coordinate(mesh, triangle, barycentrics);
        self.textures[reference.texture].sample_srgb(&self.images, uv)
    }
}

impl TextureRef {
    /// Where a texture is read at a point of a triangle, after its transform; a mesh without the set reads it at 0.
    pub(crate) fn coordinate(&self, mesh: &Mesh, triangle: usize, barycentrics: Vec3) -> Vec2 {
        let Some(set) = mesh.uv_sets.get(self.uv_set).filter(|set| !set.is_empty()) else {
            return self.transform.translation;
        };
        let uv = interpolate(&mesh.triangles[triangle], barycentrics, |vertex| set[vertex]);
        self.transform.transform_point2(uv)
    }
}

pub(crate) fn interpolate<T>(triangle: &[u32; 3], barycentrics: Vec3, value: impl Fn(usize) -> T) -> T
where
    T: std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    value(triangle[0] as usize) * barycentrics.x
        + value(triangle[1] as usize) * barycentrics.y
        + value(triangle[2] as usize) * barycentrics.z
}

impl Texture {
    /// Linear RGBA at a coordinate: sRGB decoded first, then filtered. Alpha is linear as stored.
    pub fn sample_srgb(&self, images: &[Image], uv: Vec2) -> Vec4 {
        self.sample(images, uv, srgb_to_linear)
    }

    /// RGBA at a coordinate, filtered as stored: normal maps and other data.
    pub fn sample_linear(&self, images: &[Image], uv: Vec2) -> Vec4 {
        self.sample(images, uv, |byte| f32::from(byte) / 255.0)
    }

    /// Alpha alone of either.
    pub fn sample_alpha(&self, images: &[Image], uv: Vec2) -> f32 {
        self.filtered(images, uv, |rgba| f32::from(rgba[3]) / 255.0).unwrap_or(1.0)
    }

    /// `decoded` turns a stored byte of a color into what is filtered.
    fn sample(&self, images: &[Image], uv: Vec2, decoded: impl Fn(u8) -> f32) -> Vec4 {
        let texel = |[r, g, b, a]: [u8; 4]| Vec4::new(decoded(r), decoded(g), decoded(b), f32::from(a) / 255.0);
        self.filtered(images, uv, texel).unwrap_or(Vec4::ONE)
    }

    /// What `texel` makes of the texels around a coordinate, filtered; `None` without a texel there.
    fn filtered<T>(&self, images: &[Image], uv: Vec2, texel: impl Fn([u8; 4]) -> T) -> Option<T>
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        let image = &images[self.image];
        if image.width == 0 || image.height == 0 || !uv.is_finite() {
            return None;
        }
        let size = Vec2::new(image.width as f32, image.height as f32);
        let texel = |x: i64, y: i64| {
            let x = self.wrap_u.apply(x, i64::from(image.width));
            let y = self.wrap_v.apply(y, i64::from(image.height));
            let at = ((y * i64::from(image.width) + x) * 4) as usize;
            let rgba = image.rgba[at..at + 4].try_into().unwrap_or_default();
            texel(rgba)
        };
        // Reduce first, so that far-out coordinates keep their fraction.
        let uv = Vec2::new(self.wrap_u.reduce(uv.x), self.wrap_v.reduce(uv.y));
        if self.nearest {
            let at = (uv * size).floor();
            return Some(texel(at.x as i64, at.y as i64));
        }
        let at = uv * size - 0.5;
        let base = at.floor();
        let fraction = at - base;
        let (x, y) = (base.x as i64, base.y as i64);
        let lerp = |from: T, to: T, share: f32| from * (1.0 - share) + to * share;
        let top = lerp(texel(x, y), texel(x + 1, y), fraction.x);
        let bottom = lerp(texel(x, y + 1), texel(x + 1, y + 1), fraction.x);
        Some(lerp(top, bottom, fraction.y))
    }
}

impl Wrap {
    fn reduce(self, coordinate: f32) -> f32 {
        match self {
            Self::Repeat => coordinate.rem_euclid(1.0),
            Self::MirroredRepeat => coordinate.rem_euclid(2.0),
            Self::ClampToEdge => coordinate.clamp(0.0, 1.0),
        }
    }

    fn apply(self, texel: i64, size: i64) -> i64 {
        // Nearly all of them; a division takes longer than the rest.
        if (0..size).contains(&texel) {
            return texel;
        }
        match self {
            Self::Repeat => texel.rem_euclid(size),
            Self::MirroredRepeat => {
                let folded = texel.rem_euclid(2 * size);
                if folded < size { folded } else { 2 * size - 1 - folded }
            }
            Self::ClampToEdge => texel.clamp(0, size - 1),
        }
    }
}

/// Encodes a linear value, 0 to 1 and held to that, as an sRGB byte (IEC 61966-2-1).
pub fn linear_to_srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

/// Decodes one sRGB byte to a linear value (IEC 61966-2-1).
pub fn srgb_to_linear(byte: u8) -> f32 {
    static TABLE: std::sync::LazyLock<[f32; 256]> = std::sync::LazyLock::new(|| {
        std::array::from_fn(|byte| {
            let value = byte as f64 / 255.0;
            let linear = if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
            linear as f32
        })
    });
    TABLE[usize::from(byte)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alpha_alone_is_that_of_the_color() {
        let rgba: Vec<u8> = (0..3 * 5 * 4).map(|byte| (byte * 37 % 256) as u8).collect();
        let images = [Image { name: String::new(), width: 3, height: 5, rgba, encoded: None }];
        for wrap in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge] {
            for nearest in [false, true] {
                let texture = Texture { image: 0, wrap_u: wrap, wrap_v: wrap, nearest };
                for step in -40..40 {
                    let uv = Vec2::new(step as f32 * 0.13, 1.7 - step as f32 * 0.07);
                    let alpha = texture.sample_alpha(&images, uv);
                    assert_eq!(alpha, texture.sample_srgb(&images, uv).w, "{wrap:?} {uv}");
                    assert_eq!(alpha, texture.sample_linear(&images, uv).w);
                    // A map that repeats is the same one turn on, and one that is mirrored two.
                    if wrap != Wrap::ClampToEdge {
                        let next = texture.sample_alpha(&images, uv + if wrap == Wrap::Repeat { 1.0 } else { 2.0 });
                        assert!((alpha - next).abs() < 1e-4 || nearest, "{wrap:?} {uv}: {alpha} {next}");
                    }
                }
            }
        }
    }
}
