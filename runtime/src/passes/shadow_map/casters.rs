//! Triangles that cast shadows, and the alpha masks that make holes in them.

use crate::error::RelightError;
use crate::surface_texels::check_values;
use glam::{Vec2, Vec3};
use localprt_scenes::{AlphaMode, Mesh, Scene, TextureRef, Wrap};
use std::collections::BTreeMap;

/// Entry of [`CasterMasks::mask`] for a triangle without holes.
pub const NO_MASK: u32 = u32::MAX;

/// A distance within rounding of a position, as a multiple of the largest coordinate plus the box diagonal: about a
/// hundred f32 roundings. The traced shadow rays leave their surfaces by the same distance.
const ROUNDING: f32 = 2e-6;

/// World-space triangles that cast shadows, from both sides: walls may be single triangles seen from one side only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowCasters {
    /// Vertices, metres.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`; the winding does not matter.
    pub triangles: Vec<[u32; 3]>,
    /// Holes; `None` if no triangle has any.
    pub masks: Option<CasterMasks>,
}

/// Alpha masks of [`ShadowCasters`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CasterMasks {
    /// `[n_positions]` texture coordinates of the mask, texture transform applied.
    pub uv: Vec<Vec2>,
    /// `[n_positions]` factor on the image's alpha.
    pub alpha: Vec<f32>,
    /// `[n_triangles]` index into `masks`, or [`NO_MASK`].
    pub mask: Vec<u32>,
    /// Masks.
    pub masks: Vec<AlphaMask>,
    /// Images that the masks read.
    pub images: Vec<AlphaImage>,
}

/// How one mask reads its image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaMask {
    /// Index into [`CasterMasks::images`].
    pub image: u32,
    /// Horizontal wrap.
    pub wrap_u: Wrap,
    /// Vertical wrap.
    pub wrap_v: Wrap,
    /// Nearest texel instead of bilinear.
    pub nearest: bool,
    /// The surface is there where alpha is not below.
    pub cutoff: f32,
}

/// The alpha of an image, 8 bits, top row first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaImage {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[height * width]`, 255 is opaque.
    pub alpha: Vec<u8>,
}

/// Box around all casters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CasterBounds {
    /// Least coordinates, metres.
    pub low: Vec3,
    /// Greatest coordinates, metres.
    pub high: Vec3,
}

impl CasterBounds {
    /// A length within the rounding of the scene's positions, metres; 0 without casters.
    pub fn rounding_m(&self) -> f32 {
        ROUNDING * (self.low.abs().max(self.high.abs()).max_element() + (self.high - self.low).length())
    }
}

impl ShadowCasters {
    /// The triangles of a scene; those that a mask hides wholly are left out, those that it leaves whole have no mask.
    ///
    /// Blended surfaces are masks at 0.5. Alpha is that of [`Scene::base_color`]: factor, texture and vertex color.
    pub fn of_scene(scene: &Scene) -> Self {
        let mut casters = Self::default();
        let mut masks = CasterMasks::default();
        let mut image_ids = BTreeMap::new();
        for mesh in &scene.meshes {
            let first = casters.positions.len() as u32;
            let presence = presence(scene, mesh);
            if matches!(presence, Presence::Nowhere) {
                continue;
            }
            casters.positions.extend(&mesh.positions);
            casters.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)));
            let id = match presence {
                Presence::Masked { cutoff } => {
                    push_mask_vertices(scene, mesh, &mut masks);
                    let mask = mask(scene, mesh, cutoff, &mut masks.images, &mut image_ids);
                    let known = masks.masks.iter().position(|known| *known == mask);
                    known.unwrap_or_else(|| {
                        masks.masks.push(mask);
                        masks.masks.len() - 1
                    }) as u32
                }
                _ => {
                    masks.uv.resize(casters.positions.len(), Vec2::ZERO);
                    masks.alpha.resize(casters.positions.len(), 1.0);
                    NO_MASK
                }
            };
            masks.mask.resize(casters.triangles.len(), id);
        }
        casters.masks = (!masks.masks.is_empty()).then_some(masks);
        casters
    }

    /// Checks lengths, indices and values.
    ///
    /// # Errors
    /// [`RelightError::Casters`], [`RelightError::Length`], [`RelightError::NotFinite`].
    pub fn check(&self) -> Result<(), RelightError> {
        let bad = |place: String, problem: String| Err(RelightError::Casters { place, problem });
        check_values(self.positions.len(), &[("caster position", &self.positions)])?;
        let n_positions = self.positions.len();
        let outside = |triangle: &[u32; 3]| triangle.iter().any(|&vertex| vertex as usize >= n_positions);
        if let Some(index) = self.triangles.iter().position(outside) {
            let problem = format!("vertices {:?} of {n_positions}", self.triangles[index]);
            return bad(format!("triangle {index}"), problem);
        }
        let Some(masks) = &self.masks else { return Ok(()) };
        for (what, expected, found) in [
            ("mask coordinates", n_positions, masks.uv.len()),
            ("mask alpha", n_positions, masks.alpha.len()),
            ("mask of triangle", self.triangles.len(), masks.mask.len()),
        ] {
            if expected != found {
                return Err(RelightError::Length { what, expected, found });
            }
        }
        if let Some(index) = masks.uv.iter().position(|uv| !uv.is_finite()) {
            return Err(RelightError::NotFinite { what: "mask coordinates", index });
        }
        if let Some(index) = masks.alpha.iter().position(|alpha| !alpha.is_finite()) {
            return Err(RelightError::NotFinite { what: "mask alpha", index });
        }
        let unknown = |&mask: &u32| mask != NO_MASK && mask as usize >= masks.masks.len();
        if let Some(index) = masks.mask.iter().position(unknown) {
            let problem = format!("mask {} of {}", masks.mask[index], masks.masks.len());
            return bad(format!("triangle {index}"), problem);
        }
        for (index, mask) in masks.masks.iter().enumerate() {
            if mask.image as usize >= masks.images.len() {
                return bad(format!("mask {index}"), format!("image {} of {}", mask.image, masks.images.len()));
            }
        }
        for (index, image) in masks.images.iter().enumerate() {
            let n_texels = u64::from(image.width) * u64::from(image.height);
            if n_texels == 0 || n_texels != image.alpha.len() as u64 {
                let problem = format!("{} bytes for {} x {}", image.alpha.len(), image.width, image.height);
                return bad(format!("mask image {index}"), problem);
            }
        }
        Ok(())
    }

    /// Box around all triangles; a point at the origin if there are none.
    pub fn bounds(&self) -> CasterBounds {
        let mut points = self.triangles.iter().flatten().map(|&vertex| self.positions[vertex as usize]);
        let Some(first) = points.next() else { return CasterBounds::default() };
        let grow =
            |bounds: CasterBounds, point| CasterBounds { low: bounds.low.min(point), high: bounds.high.max(point) };
        points.fold(CasterBounds { low: first, high: first }, grow)
    }
}

impl CasterMasks {
    /// Whether a triangle with this mask is there at `uv`, where its own factor on alpha is `alpha`.
    pub fn is_present(&self, mask: u32, uv: Vec2, alpha: f32) -> bool {
        let mask = &self.masks[mask as usize];
        alpha * mask.sample(&self.images[mask.image as usize], uv) >= mask.cutoff
    }
}

impl AlphaMask {
    /// Alpha 0..=1 of an image at a coordinate, filtered.
    fn sample(&self, image: &AlphaImage, uv: Vec2) -> f32 {
        let size = Vec2::new(image.width as f32, image.height as f32);
        let texel = |x: i32, y: i32| {
            let x = wrapped(self.wrap_u, x, image.width as i32);
            let y = wrapped(self.wrap_v, y, image.height as i32);
            f32::from(image.alpha[y as usize * image.width as usize + x as usize]) / 255.0
        };
        // Reduced first, so that far-out coordinates keep their fraction and all integers stay small.
        let at = Vec2::new(reduced(self.wrap_u, uv.x), reduced(self.wrap_v, uv.y)) * size;
        if self.nearest {
            return texel(at.x.floor() as i32, at.y.floor() as i32);
        }
        let base = (at - 0.5).floor();
        let fraction = at - 0.5 - base;
        let (x, y) = (base.x as i32, base.y as i32);
        let top = mix(texel(x, y), texel(x + 1, y), fraction.x);
        let bottom = mix(texel(x, y + 1), texel(x + 1, y + 1), fraction.x);
        mix(top, bottom, fraction.y)
    }
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

fn reduced(wrap: Wrap, coordinate: f32) -> f32 {
    match wrap {
        Wrap::Repeat => coordinate - coordinate.floor(),
        Wrap::MirroredRepeat => coordinate - 2.0 * (coordinate * 0.5).floor(),
        Wrap::ClampToEdge => coordinate.clamp(0.0, 1.0),
    }
}

fn wrapped(wrap: Wrap, texel: i32, size: i32) -> i32 {
    // Within -1..=2 * size here, so that no remainder of a negative number is taken in the shader.
    match wrap {
        Wrap::Repeat => (texel + size) % size,
        Wrap::MirroredRepeat => {
            let folded = (texel + 2 * size) % (2 * size);
            folded.min(2 * size - 1 - folded)
        }
        Wrap::ClampToEdge => texel.clamp(0, size - 1),
    }
}

/// Where a mesh is, judged from the extremes of its alpha.
enum Presence {
    Everywhere,
    Masked { cutoff: f32 },
    Nowhere,
}

fn presence(scene: &Scene, mesh: &Mesh) -> Presence {
    let material = &scene.materials[mesh.material];
    let cutoff = match material.alpha {
        AlphaMode::Opaque => return Presence::Everywhere,
        AlphaMode::Mask { cutoff } => cutoff,
        AlphaMode::Blend => 0.5,
    };
    let range = |values: &mut dyn Iterator<Item = f32>| {
        values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    let texture = match material.base_color_texture.and_then(|reference| image_of(scene, reference)) {
        Some(image) => range(&mut scene.images[image].rgba.chunks_exact(4).map(|rgba| f32::from(rgba[3]) / 255.0)),
        None => (1.0, 1.0),
    };
    let color = if mesh.colors.is_empty() { (1.0, 1.0) } else { range(&mut mesh.colors.iter().map(|color| color.w)) };
    let alpha = |texture: f32, color: f32| material.base_color.w * texture * color;
    if alpha(texture.0, color.0) >= cutoff {
        Presence::Everywhere
    } else if alpha(texture.1, color.1) < cutoff {
        Presence::Nowhere
    } else {
        Presence::Masked { cutoff }
    }
}

fn image_of(scene: &Scene, reference: TextureRef) -> Option<usize> {
    let image = scene.textures[reference.texture].image;
    (scene.images[image].width > 0 && scene.images[image].height > 0).then_some(image)
}

fn push_mask_vertices(scene: &Scene, mesh: &Mesh, masks: &mut CasterMasks) {
    let material = &scene.materials[mesh.material];
    let uv = |vertex: usize| {
        let Some(reference) = &material.base_color_texture else { return Vec2::ZERO };
        match mesh.uv_sets.get(reference.uv_set).filter(|set| !set.is_empty()) {
            Some(set) => reference.transform.transform_point2(set[vertex]),
            None => reference.transform.translation,
        }
    };
    masks.uv.extend((0..mesh.positions.len()).map(uv));
    let alpha = |vertex: usize| material.base_color.w * mesh.colors.get(vertex).map_or(1.0, |color| color.w);
    masks.alpha.extend((0..mesh.positions.len()).map(alpha));
}

fn mask(
    scene: &Scene,
    mesh: &Mesh,
    cutoff: f32,
    images: &mut Vec<AlphaImage>,
    image_ids: &mut BTreeMap<Option<usize>, u32>,
) -> AlphaMask {
    let reference = scene.materials[mesh.material].base_color_texture;
    let source = reference.and_then(|reference| image_of(scene, reference));
    let image = *image_ids.entry(source).or_insert_with(|| {
        images.push(match source.map(|image| &scene.images[image]) {
            Some(image) => AlphaImage {
                width: image.width,
                height: image.height,
                alpha: image.rgba.chunks_exact(4).map(|rgba| rgba[3]).collect(),
            },
            None => AlphaImage { width: 1, height: 1, alpha: vec![255] },
        });
        images.len() as u32 - 1
    });
    let sampler = reference.map(|reference| scene.textures[reference.texture]);
    AlphaMask {
        image,
        wrap_u: sampler.map_or(Wrap::Repeat, |texture| texture.wrap_u),
        wrap_v: sampler.map_or(Wrap::Repeat, |texture| texture.wrap_v),
        nearest: sampler.is_some_and(|texture| texture.nearest),
        cutoff,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine2, Vec4};
    use localprt_formats::directions::counter_uniform;
    use localprt_scenes::{Image, Material, Texture};

    /// One triangle with a 3 x 2 texture of alpha 0, 50, ..., and everything that may scale or move it.
    fn scene(texture: Texture) -> Scene {
        let rgba = (0..6).flat_map(|texel| [9, 9, 9, texel * 50]).collect();
        Scene {
            meshes: vec![Mesh {
                positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
                normals: vec![Vec3::Z; 3],
                uv_sets: vec![vec![Vec2::new(-2.0, -1.0), Vec2::new(3.0, 0.5), Vec2::new(0.5, 2.0)]],
                colors: vec![Vec4::ONE, Vec4::splat(0.75), Vec4::splat(0.875)],
                triangles: vec![[0, 1, 2]],
                ..Mesh::default()
            }],
            materials: vec![Material {
                base_color: Vec4::new(1.0, 1.0, 1.0, 0.875),
                base_color_texture: Some(TextureRef {
                    texture: 0,
                    uv_set: 0,
                    transform: Affine2::from_scale_angle_translation(Vec2::new(0.5, 2.0), 0.3, Vec2::new(0.1, 0.2)),
                }),
                alpha: AlphaMode::Mask { cutoff: 0.4 },
                ..Material::default()
            }],
            textures: vec![texture],
            images: vec![Image { name: String::new(), width: 3, height: 2, rgba, encoded: None }],
            ..Scene::default()
        }
    }

    #[test]
    fn masks_agree_with_the_scene() {
        for (wrap_u, wrap_v) in [
            (Wrap::Repeat, Wrap::MirroredRepeat),
            (Wrap::MirroredRepeat, Wrap::ClampToEdge),
            (Wrap::ClampToEdge, Wrap::Repeat),
        ] {
            for nearest in [false, true] {
                let scene = scene(Texture { image: 0, wrap_u, wrap_v, nearest });
                let casters = ShadowCasters::of_scene(&scene);
                assert_eq!(casters.check(), Ok(()));
                let masks = casters.masks.unwrap();
                let n_points = 4000;
                let mut n_present = 0;
                let mut n_wrong = 0;
                for point in 0..n_points {
                    let (a, b) = (counter_uniform(5, point, 0) as f32, counter_uniform(5, point, 1) as f32);
                    let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
                    let weights = [1.0 - a - b, a, b];
                    let uv = masks.uv[0] * weights[0] + masks.uv[1] * weights[1] + masks.uv[2] * weights[2];
                    let alpha = masks.alpha[0] * weights[0] + masks.alpha[1] * weights[1] + masks.alpha[2] * weights[2];
                    let expected = scene.is_present(0, 0, Vec3::from(weights));
                    n_present += usize::from(expected);
                    n_wrong += usize::from(masks.is_present(0, uv, alpha) != expected);
                }
                assert!((400..3600).contains(&n_present), "{n_present}");
                // Coordinates up to 10 are rounded to 1e-6: about that share of the points changes texel or side.
                assert!(n_wrong <= 1, "{wrap_u:?} {wrap_v:?} nearest {nearest}: {n_wrong} of {n_points}");
            }
        }
    }

    #[test]
    fn only_triangles_with_holes_have_masks() {
        let texture = Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: false };
        let casters = |alpha, texel: Option<u8>| {
            let mut scene = scene(texture);
            scene.materials[0].alpha = alpha;
            if let Some(alpha) = texel {
                scene.images[0].rgba.chunks_exact_mut(4).for_each(|rgba| rgba[3] = alpha);
            }
            ShadowCasters::of_scene(&scene)
        };
        let mask = |cutoff| AlphaMode::Mask { cutoff };
        let counts = |casters: ShadowCasters| (casters.triangles.len(), casters.masks.is_some());
        assert_eq!(counts(casters(AlphaMode::Opaque, None)), (1, false));
        assert_eq!(counts(casters(AlphaMode::Blend, None)), (1, true));
        assert_eq!(counts(casters(mask(0.4), None)), (1, true));
        // The least alpha is 0.75 * 0.875 = 0.66 of the texture's.
        assert_eq!(counts(casters(mask(0.65), Some(255))), (1, false));
        assert_eq!(counts(casters(mask(0.67), Some(255))), (1, true));
        assert_eq!(counts(casters(mask(0.9), Some(255))), (0, false));
    }

    #[test]
    fn wrong_casters_are_refused() {
        let texture = Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: false };
        let good = ShadowCasters::of_scene(&scene(texture));
        let refused = |spoil: &dyn Fn(&mut ShadowCasters)| {
            let mut casters = good.clone();
            spoil(&mut casters);
            casters.check().unwrap_err().to_string()
        };
        let masks = |casters: &mut ShadowCasters, spoil: &dyn Fn(&mut CasterMasks)| {
            spoil(casters.masks.as_mut().unwrap());
        };
        for (message, spoil) in [
            (
                "triangle 0: vertices [0, 3, 2] of 3",
                &(|c: &mut ShadowCasters| c.triangles[0][1] = 3) as &dyn Fn(&mut _),
            ),
            ("caster position 1 is not finite", &|c: &mut ShadowCasters| c.positions[1].y = f32::NAN),
            ("mask alpha has 2 entries, needs 3", &|c| masks(c, &|m| m.alpha.truncate(2))),
            ("mask coordinates 2 is not finite", &|c| masks(c, &|m| m.uv[2].x = f32::INFINITY)),
            ("triangle 0: mask 1 of 1", &|c| masks(c, &|m| m.mask[0] = 1)),
            ("mask 0: image 1 of 1", &|c| masks(c, &|m| m.masks[0].image = 1)),
            ("mask image 0: 5 bytes for 3 x 2", &|c| masks(c, &|m| m.images[0].alpha.truncate(5))),
        ] {
            let found = refused(spoil);
            assert!(found.contains(message), "{found}");
        }
    }

    #[test]
    fn bounds_hold_what_triangles_use() {
        let casters = ShadowCasters {
            positions: vec![Vec3::splat(-9.0), Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[1, 2, 3]],
            masks: None,
        };
        assert_eq!(casters.bounds(), CasterBounds { low: Vec3::ZERO, high: Vec3::new(1.0, 1.0, 0.0) });
        assert_eq!(ShadowCasters::default().bounds().rounding_m(), 0.0);
    }
}
