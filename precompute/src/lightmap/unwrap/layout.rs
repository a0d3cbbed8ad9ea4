//! How fine charts are and where they go: as many texels as were asked for, dealt by the local scale.
//!
//! The edge of a chart's texels goes with the local scale; the factor is found by packing and counting. Charts of less
//! than a texel share one with small neighbors that face the same way and that they see: a leaf, a chain
//! link and a bolt would otherwise fill the map with their borders.

use super::{
    LayoutSize, MAX_SIZE, MIN_SIZE, PADDING, Piece, Progress, UnwrapError, Unwrapped,
    beside::{FreeTexels, pack_beside},
    islands::{self, Island, Wanted},
    pieces,
    uv_unwrap::{FlatChart, Packed, pack},
};
use crate::{
    rays::RayCaster,
    scale::{RANGE, weighted_quantile},
};
use glam::{IVec3, Vec2};
use localprt_scenes::{Mesh, Scene};
use localprt_surfaces::atlas::{LIGHTMAP_SET, raster::Footprint};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Charts of fewer texels than this are joined.
const LEAST_TEXELS: f64 = 1.0;
/// Edge of the cells within which they are, in texels.
const JOINED_TEXELS: f32 = 1.5;
/// The triangle in the plane, in texels, that stands for charts that are joined: within a texel.
const JOINED: [Vec2; 3] = [Vec2::new(0.05, 0.05), Vec2::new(0.95, 0.05), Vec2::new(0.05, 0.95)];
/// How far off the surface charts that are joined must see each other, in cells.
const JOINED_ABOVE: f32 = 0.25;
/// Share of all texels that may be finer than wanted.
const FINEST_SHARE: f64 = 0.02;
/// The number of texels is met this closely, or until nothing changes.
const CLOSE_ENOUGH: f64 = 0.01;
/// Share of a direct light map that charts take, about: before they are scaled to fill it.
const LIGHT_MAP_USED: f64 = 0.6;
/// Packs while the number of texels is looked for.
const MOST_PACKS: usize = 9;
/// Up to so many charts are packed tightly whenever they are packed.
const FEW_CHARTS: usize = 1000;
/// Coarser joining, where charts are too many for a map.
const COARSER: f64 = 4.0;
/// Charts of more texels than this are never joined.
const MOST_JOINED: f64 = 1e9;
/// A map grows by this share where charts beside others do not fit...
const GROWTH: f64 = 0.03;
/// ...or, where it may not, they are this much coarser, so many times.
const COARSER_BESIDE: f64 = 0.7;
const MOST_COARSER: u32 = 6;

/// How fine the charts of a layout are: enough to make others that are as fine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fineness {
    /// What the edge of a texel is in proportion to (S1), where it is finest.
    pub finest: f32,
    /// Texels per metre there, in the receiver map.
    pub receivers: f32,
    /// The same in the light map.
    pub light_map: f32,
}

/// Charts of a scene, ready to be packed at any density: by rays against one scene.
pub struct Charts {
    pieces: Vec<Piece>,
    /// Triangle of its mesh of each triangle of a piece.
    kept: Vec<Vec<u32>>,
    islands: Vec<Island>,
    finest: f32,
    joined: Mutex<BTreeMap<SmallOnes, Groups>>,
}

/// Where charts go beside others.
#[derive(Clone, Copy)]
pub struct Beside<'a> {
    /// Meshes that have charts.
    pub others: &'a [Mesh],
    /// TEXCOORD set of the map.
    pub set: usize,
    /// Texels per side.
    pub size: u32,
    /// Texels per metre where they are finest.
    pub density: f64,
    /// Edge of the finest texel, metres, if it was given.
    pub finest_m: Option<f32>,
    /// The map may grow.
    pub may_grow: bool,
}

/// A layout of the charts, in texels.
struct Plan {
    /// `[pieces][triangles]`.
    corners: Vec<Vec<Option<[Vec2; 3]>>>,
    /// Map size, texels per side.
    size: u32,
    /// Texels per metre where they are finest.
    density: f64,
}

/// What charts become at one density.
struct Dealt {
    charts: Vec<FlatChart>,
    /// What each chart stands for.
    of: Vec<Holder>,
}

/// Where small charts may be joined: binary logarithm of a cell's edge, the cell, and axis and sign of the way they face.
type Cell = (i32, [i32; 3], usize);

/// A cell and the small islands in it.
type SmallOnes = (Cell, Vec<usize>);

/// Islands that share a texel.
type Groups = Vec<Vec<usize>>;

enum Holder {
    /// An island as it is.
    Island(usize),
    /// Islands that share the texel of the first.
    Joined(Vec<usize>),
}

impl Charts {
    /// Charts of the pieces as they are flattened.
    pub(super) fn new(
        scene: &Scene,
        pieces: Vec<Piece>,
        kept: Vec<Vec<u32>>,
        flat: &Unwrapped,
        wanted: Wanted<'_>,
    ) -> Self {
        let mut islands = islands::islands(scene, &pieces, &kept, flat, wanted);
        let finest = wanted.finest.unwrap_or_else(|| finest(&islands));
        for island in &mut islands {
            island.texel = (island.texel / finest).clamp(1.0, RANGE);
        }
        for island in &mut islands {
            let wish = scene.meshes[island.mesh].lightmap;
            island.texel /= wish.texel_scale;
            if !wish.bake || island.is_hidden {
                // Light that bounces off the mesh needs to be known somewhere; and that nothing sees a chart is no proof.
                island.texel *= RANGE;
            }
        }
        Self { pieces, kept, islands, finest, joined: Mutex::default() }
    }

    /// What the edge of a texel is in proportion to (S1), where it is finest.
    pub fn finest(&self) -> f32 {
        self.finest
    }

    /// Number of charts before small ones are joined.
    pub fn len(&self) -> usize {
        self.islands.len()
    }

    /// True without charts.
    pub fn is_empty(&self) -> bool {
        self.islands.is_empty()
    }

    /// `scene`, whose charts these are, with lightmap coordinates, the size of its map in texels per side, and texels per metre where
    /// they are finest. `caster` tells which small charts see each other: it holds the same surfaces, cut into faces as finely or not.
    ///
    /// # Errors
    /// [`UnwrapError::TooManyCharts`] where not even joined charts fit the map, or [`UnwrapError::Cancelled`].
    pub fn lay_out(
        &self,
        scene: Scene,
        caster: &RayCaster<'_>,
        size: LayoutSize,
        progress: Progress,
    ) -> Result<(Scene, u32, f64), UnwrapError> {
        if self.islands.is_empty() {
            let texels = size.lightmap.unwrap_or(MIN_SIZE);
            let scene = pieces::apply(scene, &self.nothing(), &self.kept, texels, LIGHTMAP_SET);
            return Ok((scene, texels, 1.0));
        }
        let plan = self.joined_until_they_fit(|least_texels| self.plan(caster, size, least_texels, progress))?;
        let unwrapped = Unwrapped { corners: plan.corners };
        Ok((pieces::apply(scene, &unwrapped, &self.kept, plan.size, LIGHTMAP_SET), plan.size, plan.density))
    }

    /// `scene` with coordinates for a direct light map of its own: the charts as large as they fit a map of `texels` per side.
    ///
    /// # Errors
    /// As [`Charts::lay_out`].
    pub fn lay_out_light_map(
        &self,
        mut scene: Scene,
        caster: &RayCaster<'_>,
        texels: u32,
        progress: Progress,
    ) -> Result<(Scene, f64), UnwrapError> {
        if self.islands.is_empty() || !(MIN_SIZE..=MAX_SIZE).contains(&texels) {
            return Ok((scene, 1.0));
        }
        let used = scene.meshes.iter().map(|mesh| mesh.uv_sets.len()).max().unwrap_or_default();
        let set = scene.light_map_set.unwrap_or(used.max(LIGHTMAP_SET + 1));
        let plan = self.joined_until_they_fit(|least_texels| self.plan_full(caster, texels, least_texels, progress))?;
        scene.light_map_set = Some(set);
        let scene = pieces::apply(scene, &Unwrapped { corners: plan.corners }, &self.kept, plan.size, set);
        Ok((scene, plan.density))
    }

    /// `scene`, whose charts these are, with coordinates in a map of `size` texels per side that other meshes have charts in: at a
    /// density of so many texels per metre where they are finest. The map grows where it `may_grow`, else the charts are coarser.
    /// With the size of the map.
    ///
    /// # Errors
    /// [`UnwrapError::TooManyCharts`] where they fit no map, or [`UnwrapError::Cancelled`].
    pub fn lay_out_beside(
        &self,
        scene: Scene,
        caster: &RayCaster<'_>,
        beside: Beside<'_>,
        progress: Progress,
    ) -> Result<(Scene, u32), UnwrapError> {
        let Beside { others, set, mut size, mut density, finest_m, may_grow } = beside;
        let corners = || {
            others.iter().flat_map(|mesh| {
                let uv = mesh.uv_set(set).unwrap_or_default();
                mesh.triangles.iter().filter_map(|triangle| {
                    let [a, b, c] = triangle.map(|vertex| uv.get(vertex as usize).copied());
                    Some([a?, b?, c?])
                })
            })
        };
        let first = size;
        let mut tries = 0;
        loop {
            let dealt = self.deal(caster, density, finest_m, LEAST_TEXELS);
            let zoom = first as f32 / size as f32;
            let free = FreeTexels::of(size, corners().map(|uv| uv.map(|uv| uv * zoom)), PADDING);
            if let Some(packed) = pack_beside(&dealt.charts, free, PADDING, progress)? {
                let unwrapped = Unwrapped { corners: self.spread(&dealt, &packed) };
                return Ok((pieces::apply(scene, &unwrapped, &self.kept, size, set), size));
            }
            if may_grow && size < MAX_SIZE {
                size = ((f64::from(size) * (1.0 + GROWTH)) as u32 + 1).div_ceil(4).saturating_mul(4).min(MAX_SIZE);
            } else if tries < MOST_COARSER {
                tries += 1;
                density *= COARSER_BESIDE;
            } else {
                return Err(UnwrapError::TooManyCharts { charts: dealt.charts.len() as u32, texels: size });
            }
        }
    }

    fn nothing(&self) -> Unwrapped {
        Unwrapped { corners: self.pieces.iter().map(|piece| vec![None; piece.triangles.len()]).collect() }
    }

    /// A plan, with charts joined more coarsely where they are too many for the map.
    fn joined_until_they_fit(&self, plan: impl Fn(f64) -> Result<Plan, UnwrapError>) -> Result<Plan, UnwrapError> {
        let mut least_texels = LEAST_TEXELS;
        loop {
            match plan(least_texels) {
                Err(UnwrapError::TooManyCharts { .. }) if least_texels < MOST_JOINED => least_texels *= COARSER,
                plan => return plan,
            }
        }
    }

    /// All charts, as large as they fit a map of that many texels per side.
    fn plan_full(
        &self,
        caster: &RayCaster<'_>,
        texels: u32,
        least_texels: f64,
        progress: Progress,
    ) -> Result<Plan, UnwrapError> {
        let density = (LIGHT_MAP_USED * f64::from(texels).powi(2) / self.demand().max(f64::MIN_POSITIVE)).sqrt();
        let dealt = self.deal(caster, density, None, least_texels);
        let packed = pack(&dealt.charts, Some(texels), true, progress)?;
        let density = density * zoom(&dealt.charts, &packed);
        Ok(Plan { corners: self.spread(&dealt, &packed), size: texels, density })
    }

    /// Texels where there is one per metre where they are finest.
    fn demand(&self) -> f64 {
        self.islands.iter().map(|island| island.area_m2 / f64::from(island.texel).powi(2)).sum()
    }

    fn plan(
        &self,
        caster: &RayCaster<'_>,
        size: LayoutSize,
        least_texels: f64,
        progress: Progress,
    ) -> Result<Plan, UnwrapError> {
        let most = f64::from(size.lightmap.unwrap_or(MAX_SIZE)).powi(2);
        let wanted = f64::from(size.texels).min(most);
        // Few charts are packed as they will be in the end.
        let tight = self.islands.len() < FEW_CHARTS;
        let mut density = (wanted / self.demand().max(f64::MIN_POSITIVE)).sqrt();
        let mut tried: Vec<(f64, f64)> = Vec::new();
        for _ in 0..MOST_PACKS {
            let dealt = self.deal(caster, density, size.finest_m, least_texels);
            let packed = pack(&dealt.charts, None, tight, progress)?;
            let covered = count(&packed) as f64;
            let side = f64::from(packed.extent[0].max(packed.extent[1]));
            tried.push((density, covered));
            let fits = side * side <= most;
            if (covered / wanted - 1.0).abs() < CLOSE_ENOUGH && fits {
                break;
            }
            // The map is full, or the texels are as many as wanted.
            let target = if fits { wanted } else { wanted.min(covered * most / (side * side)) };
            let next = next_density(&tried, target);
            if (next / density - 1.0).abs() < 1e-3 {
                break;
            }
            density = next;
        }
        let closest = |pair: &&(f64, f64)| (pair.1 / wanted).ln().abs();
        if let Some(best) = tried.iter().min_by(|a, b| closest(a).total_cmp(&closest(b))) {
            density = best.0;
        }
        let dealt = self.deal(caster, density, size.finest_m, least_texels);
        let cap = size.lightmap.unwrap_or(MAX_SIZE);
        let mut packed = pack(&dealt.charts, None, true, progress)?;
        if packed.extent[0].max(packed.extent[1]) > cap {
            packed = pack(&dealt.charts, Some(cap), true, progress)?;
        }
        let needed = packed.extent[0].max(packed.extent[1]).max(MIN_SIZE).div_ceil(4) * 4;
        let density = density * zoom(&dealt.charts, &packed);
        Ok(Plan { corners: self.spread(&dealt, &packed), size: size.lightmap.unwrap_or(needed.min(cap)), density })
    }

    /// The charts at a density: texels per metre where they are finest.
    fn deal(&self, caster: &RayCaster<'_>, density: f64, finest_m: Option<f32>, least_texels: f64) -> Dealt {
        let texel_m = |island: &Island| {
            let wanted_m = island.texel / density as f32;
            finest_m.map_or(wanted_m, |finest_m| wanted_m.clamp(finest_m, RANGE * finest_m))
        };
        let mut dealt = Dealt { charts: Vec::new(), of: Vec::new() };
        let mut small: BTreeMap<Cell, Vec<usize>> = BTreeMap::new();
        for (index, island) in self.islands.iter().enumerate() {
            let texel_m = texel_m(island);
            if island.area_m2 >= least_texels * f64::from(texel_m).powi(2) {
                dealt.charts.push(FlatChart { corners: island.corners.clone(), density: 1.0 / texel_m });
                dealt.of.push(Holder::Island(index));
                continue;
            }
            // Cells come in sizes of powers of two, so that neighbors agree. Hidden parts are many, and see few others.
            let of_cell_m = if island.is_hidden { texel_m / RANGE } else { texel_m };
            let octave = (JOINED_TEXELS * (least_texels / LEAST_TEXELS).sqrt() as f32 * of_cell_m).log2().ceil() as i32;
            let cell: IVec3 = (island.middle / 2.0f32.powi(octave)).floor().as_ivec3();
            let axis = island.normal.abs().max_position();
            let facing = 2 * axis + usize::from(island.normal[axis] > 0.0);
            small.entry((octave, cell.to_array(), facing)).or_default().push(index);
        }
        for members in self.joined(caster, small.into_iter().collect()) {
            dealt.charts.push(FlatChart { corners: vec![JOINED], density: 1.0 });
            dealt.of.push(Holder::Joined(members));
        }
        dealt
    }

    /// Small islands in groups, cell by cell. Most cells hold at one density what they hold at the next: those are not looked at again.
    fn joined(&self, caster: &RayCaster<'_>, cells: Vec<SmallOnes>) -> Groups {
        let mut known = self.joined.lock().unwrap_or_else(PoisonError::into_inner);
        let unknown: Vec<&SmallOnes> = cells.iter().filter(|cell| !known.contains_key(cell)).collect();
        let join = |&cell: &&SmallOnes| {
            let ((octave, ..), members) = cell;
            (cell.clone(), self.join(caster, JOINED_ABOVE * 2.0f32.powi(*octave), members))
        };
        let found: Vec<(SmallOnes, Groups)> = unknown.par_iter().map(join).collect();
        known.extend(found);
        cells.iter().flat_map(|cell| known[cell].iter().cloned()).collect()
    }

    /// Small islands of a cell in groups that see their first, largest, member from a little above.
    fn join(&self, caster: &RayCaster<'_>, above_m: f32, members: &[usize]) -> Groups {
        let mut order = members.to_vec();
        order.sort_by(|&a, &b| self.islands[b].area_m2.total_cmp(&self.islands[a].area_m2).then(a.cmp(&b)));
        let mut groups = Groups::new();
        for index in order {
            let own = groups.iter().position(|group| self.see_each_other(caster, above_m, group[0], index));
            match own {
                Some(group) => groups[group].push(index),
                None => groups.push(vec![index]),
            }
        }
        groups
    }

    fn see_each_other(&self, caster: &RayCaster<'_>, above_m: f32, a: usize, b: usize) -> bool {
        let feet = [a, b].map(|index| {
            let island = &self.islands[index];
            island.middle + island.normal * caster.offset_m()
        });
        let heads = [a, b].map(|index| self.islands[index].middle + self.islands[index].normal * above_m);
        caster.visible(heads[0], heads[1]) && caster.visible(feet[0], heads[0]) && caster.visible(feet[1], heads[1])
    }

    /// Corners of all faces from those of the charts. Joined islands lie in one corner of what stands for them, but for the
    /// face that stands for the first, which lies there whole.
    fn spread(&self, dealt: &Dealt, packed: &Packed) -> Vec<Vec<Option<[Vec2; 3]>>> {
        let mut corners: Vec<Vec<Option<[Vec2; 3]>>> =
            self.pieces.iter().map(|piece| vec![None; piece.triangles.len()]).collect();
        for (holder, chart) in dealt.of.iter().zip(&packed.corners) {
            match holder {
                Holder::Island(index) => {
                    let island = &self.islands[*index];
                    for (&face, &uv) in island.faces.iter().zip(chart) {
                        corners[island.mesh][face as usize] = uv;
                    }
                }
                Holder::Joined(members) => {
                    let Some(uv) = chart.first().copied().flatten() else { continue };
                    // Off the borders of the texel: what is stored is rounded.
                    let middle = (uv[0] + uv[1] + uv[2]) / 3.0;
                    let uv = uv.map(|corner| corner.lerp(middle, 0.1));
                    for &index in members {
                        let island = &self.islands[index];
                        for &face in &island.faces {
                            corners[island.mesh][face as usize] = Some([uv[0]; 3]);
                        }
                    }
                    let first = &self.islands[members[0]];
                    corners[first.mesh][first.faces[first.shown] as usize] = Some(uv);
                }
            }
        }
        corners
    }
}

/// Texels come within [`RANGE`] of the finest: that of the fiftieth of all texels that are finest.
fn finest(islands: &[Island]) -> f32 {
    let texels = islands.iter().map(|island| (island.texel, island.area_m2 / f64::from(island.texel).powi(2)));
    weighted_quantile(texels, FINEST_SHARE).unwrap_or(1.0)
}

/// How much finer charts were packed than at their densities.
fn zoom(charts: &[FlatChart], packed: &Packed) -> f64 {
    let area = |[a, b, c]: [Vec2; 3]| f64::from((b - a).perp_dot(c - a).abs());
    let flat: f64 = charts
        .iter()
        .map(|chart| chart.corners.iter().map(|corners| area(*corners)).sum::<f64>() * f64::from(chart.density).powi(2))
        .sum();
    let placed: f64 = packed.corners.iter().flatten().flatten().map(|corners| area(*corners)).sum();
    if flat > 0.0 && placed > 0.0 { (placed / flat).sqrt() } else { 1.0 }
}

/// The next density to try for a number of texels: along the line, in logarithms, through the two tries around it.
fn next_density(tried: &[(f64, f64)], target: f64) -> f64 {
    let below = tried.iter().filter(|pair| pair.1 <= target).max_by(|a, b| a.0.total_cmp(&b.0));
    let above = tried.iter().filter(|pair| pair.1 > target).min_by(|a, b| a.0.total_cmp(&b.0));
    match (below, above) {
        (Some(low), Some(high)) if high.1 > low.1 && high.0 > low.0 => {
            let along = ((target / low.1).ln() / (high.1 / low.1).ln()).clamp(0.05, 0.95);
            (low.0.ln() + along * (high.0 / low.0).ln()).exp()
        }
        (Some(only), _) | (_, Some(only)) => only.0 * (target / only.1).sqrt().clamp(0.25, 4.0),
        (None, None) => 1.0,
    }
}

/// Texels that charts touch.
fn count(packed: &Packed) -> u64 {
    let size = packed.extent[0].max(packed.extent[1]).max(1);
    packed
        .corners
        .par_iter()
        .map(|chart| {
            let mut touched: Vec<u32> = Vec::new();
            for uv in chart.iter().flatten() {
                let Some(footprint) = Footprint::new(uv.map(|uv| uv / size as f32), size) else { continue };
                for y in footprint.rows(size) {
                    touched.extend(footprint.columns(y, size).map(|x| y * size + x));
                }
            }
            touched.sort_unstable();
            touched.dedup();
            touched.len() as u64
        })
        .sum()
}
