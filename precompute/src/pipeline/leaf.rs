//! Local transport: one leaf of receivers at a time to a finished block; no type holds the rows of more.

use super::{
    Reuse,
    leaf_cache::{LeafCache, LeafKey, Why},
    near_tiles::near_tiles,
};
use crate::{
    cache::Cache,
    cells::CellGrid,
    clusters::{Cluster, RefineSettings, refine},
    error::BakeError,
    forecast::{Forecast, Room},
    memory::{peak_rss_bytes, resident_bytes},
    progress::{Progress, StageGuard},
    rays::RayCaster,
    report::CacheUse,
    scratch::{Scratch, Stowed},
    transport::{Links, RayCounts, TransportScene},
};
use glam::Vec3;
use localprt_formats::{BlockArrays, BlockRecord, ClusterRecord, TransportBlock};
use rayon::prelude::*;
use std::{
    sync::atomic::{AtomicU64, Ordering::Relaxed},
    time::Instant,
};

/// Share of all leaves from which a forecast is made, and how many times as many the others have to be.
const PILOT: f64 = 0.01;
const LEAST_OTHERS: usize = 16;
/// Bytes of a file for each receiver, but for its block: texel, place, normal, unseen share, and about one gutter texel.
const OF_RECEIVER: f64 = 40.0;

/// Work of a receiver for each probe of its leaf, and for each that supports it, over what it costs by itself. Chosen on the Cornell
/// box and two rooms, where times of leaves are off by 6 % (RMS; 12 and 14 % if all receivers cost the same); the atrium by 12 (13) and
/// Sponza by 24 (30), where rays cost by place.
const COST_OF_PROBE: f64 = 0.02;
const COST_OF_PAIR: f64 = 0.05;

/// What a leaf of receivers becomes.
pub(super) struct LeafTransport {
    /// As stored.
    pub(super) block: TransportBlock,
    /// Its receivers in stored order.
    pub(super) members: Vec<u32>,
    /// Unseen share of each.
    pub(super) unseen: Vec<f32>,
    /// Squared RMS error of each of its rows, by compression.
    pub(super) row_error_squared: Vec<f64>,
    /// Rays it cost.
    pub(super) rays: RayCounts,
}

/// A finished leaf whose block lies in the scratch.
pub(super) struct StowedLeaf {
    /// As stored, the only one of its list.
    pub(super) record: BlockRecord,
    /// Its bytes, four to a word.
    pub(super) block: Stowed<u32>,
    /// Copies of what the report wants of it.
    pub(super) clusters: Vec<ClusterRecord>,
    /// Number of links of each receiver; empty without near light.
    pub(super) links: Vec<u8>,
    /// As in the leaf.
    pub(super) members: Vec<u32>,
    pub(super) unseen: Vec<f32>,
    pub(super) row_error_squared: Vec<f64>,
    pub(super) rays: RayCounts,
}

/// Leaves of one transport stage, given by their receivers, and how they are come by.
pub(super) struct LeafWork<'a> {
    transport: &'a TransportScene<'a>,
    refining: &'a RefineSettings,
    leaves: &'a [Vec<u32>],
    cache: Option<LeafCache<'a>>,
    explains: bool,
    progress: &'a Progress,
    /// Where finished leaves lie.
    scratch: Scratch,
    /// What the bake may take; absent: nothing is forecast.
    room: Option<&'a Room>,
    /// Bytes of the file that do not depend on the receivers.
    beside_bytes: u64,
}

impl<'a> LeafWork<'a> {
    /// `transport` notes the cells that its rays cross if there is a cache. With a room, what the bake takes is forecast after a few
    /// leaves, and has to fit.
    pub(super) fn of(
        transport: &'a TransportScene<'a>,
        refining: &'a RefineSettings,
        leaves: &'a [Vec<u32>],
        Reuse { cache, room, scratch, .. }: Reuse<'a>,
        progress: &'a Progress,
    ) -> Result<Self, BakeError> {
        let _stage = cache.map(|_| progress.stage("cache", 0));
        let explains = cache.is_some_and(|cache| cache.options().explain);
        let cache = cache.map(|cache| LeafCache::of(cache, transport, refining)).transpose()?.flatten();
        let scratch = scratch.cloned().unwrap_or_default();
        Ok(Self { transport, refining, leaves, cache, explains, progress, scratch, room, beside_bytes: 0 })
    }

    /// The same, of a file that has so many bytes that do not depend on the receivers.
    pub(super) fn beside(self, beside_bytes: u64) -> Self {
        Self { beside_bytes, ..self }
    }

    /// Number of leaves.
    pub(super) fn len(&self) -> usize {
        self.leaves.len()
    }

    /// Transport of all leaves, in their order: kept ones from the cache, if there is one. The rows of a leaf are made, compressed and
    /// dropped.
    pub(super) fn all(&self, stage: &str) -> Result<(Vec<StowedLeaf>, CacheUse), BakeError> {
        let (pilot, others) = self.pilot();
        let mut run = self.run(stage, self.leaves.iter());
        let keep = |number, leaf| Ok((number, self.stow(leaf)?));
        let started = Instant::now();
        let mut made = run.each(pilot, keep)?;
        if run.used().reused == 0 && !made.is_empty() {
            let forecast = self.forecast(&made, started.elapsed().as_secs_f64());
            self.progress.note(&format!(
                "about {:.0} s for the leaves, {:.1} GB of memory, {:.0} MB for the file (from {} of {} leaves)",
                forecast.seconds,
                forecast.memory_bytes / 1e9,
                forecast.file_bytes / 1e6,
                made.len(),
                self.leaves.len()
            ));
            self.room.map_or(Ok(()), |room| room.check(&forecast))?;
        }
        made.extend(run.each(others, keep)?);
        made.sort_unstable_by_key(|(number, _)| *number);
        Ok((made.into_iter().map(|(_, leaf)| leaf).collect(), run.used()))
    }

    /// Makes some of the leaves, by number, that the cache does not hold yet, and keeps them there.
    pub(super) fn keep(&self, stage: &str, numbers: Vec<usize>) -> Result<CacheUse, BakeError> {
        let mut run = self.run(stage, numbers.iter().map(|&number| &self.leaves[number]));
        run.each(numbers, |_, _| Ok(()))?;
        Ok(run.used())
    }

    /// A stage in which these leaves are come by.
    fn run<'l>(&self, stage: &str, leaves: impl Iterator<Item = &'l Vec<u32>>) -> Run<'_> {
        let n_receivers: usize = leaves.map(Vec::len).sum();
        Run { work: self, stage: self.progress.stage(stage, n_receivers as u64), counts: CacheUse::default() }
    }

    /// Numbers of some leaves from which the others can be told, evenly over what they cost; and of the others. None of a bake of
    /// few leaves.
    fn pilot(&self) -> (Vec<usize>, Vec<usize>) {
        let count = (self.leaves.len() as f64 * PILOT).ceil() as usize;
        let count = count.next_multiple_of(rayon::current_num_threads().max(1));
        let mut order: Vec<usize> = (0..self.leaves.len()).collect();
        if self.room.is_none() || count * LEAST_OTHERS > order.len() {
            return (Vec::new(), order);
        }
        let costs = self.costs();
        order.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]).then(a.cmp(&b)));
        let is_pilot = |rank: usize| (0..count).any(|place| (2 * place + 1) * order.len() / (2 * count) == rank);
        let (pilot, mut others): (Vec<(usize, usize)>, Vec<_>) =
            order.iter().copied().enumerate().partition(|(rank, _)| is_pilot(*rank));
        others.sort_unstable_by_key(|(_, number)| *number);
        let numbers = |pairs: Vec<(usize, usize)>| pairs.into_iter().map(|(_, number)| number).collect();
        (numbers(pilot), numbers(others))
    }

    /// What the bake takes, by what some of its leaves took.
    fn forecast(&self, made: &[(usize, StowedLeaf)], seconds: f64) -> Forecast {
        let costs = self.costs();
        let of_made: f64 = made.iter().map(|(number, _)| costs[*number]).sum();
        let share = costs.iter().sum::<f64>() / of_made.max(f64::MIN_POSITIVE);
        let receivers: usize = made.iter().map(|(_, leaf)| leaf.members.len()).sum();
        let all: usize = self.leaves.iter().map(Vec::len).sum();
        let blocks: usize = made.iter().map(|(_, leaf)| 4 * leaf.block.len()).sum();
        let blocks = blocks as f64 * all as f64 / receivers.max(1) as f64;
        let peak = peak_rss_bytes("self").unwrap_or(0) as f64;
        let file_bytes = blocks + OF_RECEIVER * all as f64 + self.beside_bytes as f64;
        // Without a disk the leaves are in memory beside the arrays of the file.
        let put_away = self.scratch.disk_bytes() as f64;
        let copies = if put_away > 0.0 { 1.0 } else { 2.0 };
        let now = resident_bytes().unwrap_or(0) as f64;
        let memory_bytes = peak.max(now + copies * file_bytes);
        let disk_bytes = file_bytes + if put_away > 0.0 { put_away + blocks } else { 0.0 };
        Forecast { seconds: seconds * share, memory_bytes, file_bytes, disk_bytes }
    }

    /// Numbers of the leaves that the cache does not hold.
    pub(super) fn missing(&self) -> Vec<usize> {
        let is_missing = |members: &Vec<u32>| self.find(members).is_none_or(|(_, _, found)| found.is_err());
        let missing = self.leaves.par_iter().enumerate().filter(|(_, members)| is_missing(members));
        missing.map(|(number, _)| number).collect()
    }

    /// About how much work each leaf is, in no unit: its rows are as many as its receivers, and each is fitted to the probes around.
    pub(super) fn costs(&self) -> Vec<f64> {
        let cost = |members: &Vec<u32>| {
            let pairs: usize = members.iter().map(|&member| self.transport.support.of(member as usize).len()).sum();
            let probes = self.transport.union_of_support(members).len();
            members.len() as f64 * (1.0 + COST_OF_PROBE * probes as f64) + COST_OF_PAIR * pairs as f64
        };
        self.leaves.par_iter().map(cost).collect()
    }

    fn find(&self, members: &[u32]) -> Option<(&LeafCache<'a>, LeafKey, Result<LeafTransport, Why>)> {
        let cache = self.cache.as_ref()?;
        let key = cache.key(self.transport, members);
        let found = cache.find(&key, members);
        Some((cache, key, found))
    }

    /// Puts a leaf away until the file is written.
    fn stow(&self, leaf: LeafTransport) -> Result<StowedLeaf, BakeError> {
        let LeafTransport { block, members, unseen, row_error_squared, rays } = leaf;
        let places = self.transport.receivers.positions();
        let positions: Vec<_> = members.iter().map(|&member| places[member as usize].to_array()).collect();
        let BlockArrays { records, data } = BlockArrays::of_one(&block, &positions, self.transport.gather.n_outputs());
        Ok(StowedLeaf {
            record: records[0],
            block: self.scratch.stow(data)?,
            clusters: block.clusters,
            links: block.near.counts,
            members,
            unseen,
            row_error_squared,
            rays,
        })
    }

    /// A leaf, and whether the cache held it.
    fn one(&self, members: &[u32]) -> Result<(LeafTransport, bool), BakeError> {
        let positions = self.transport.receivers.positions();
        let key = match self.find(members) {
            Some((_, _, Ok(leaf))) => return Ok((leaf, true)),
            Some((cache, key, Err(why))) => {
                if self.explains {
                    self.progress.note(&explanation(members, positions, why));
                }
                Some((cache, key))
            }
            None => None,
        };
        let mut rows = self.transport.rows(&self.transport.leaf(members)?, members);
        let (rays, links, crossed) = (rows.rays, std::mem::take(&mut rows.links), rows.crossed.take());
        let mut leaf = LeafTransport::of(refine(members, positions, rows, self.refining), rays);
        if self.transport.near.is_some() {
            let mut of_member: Vec<(u32, &Links)> = members.iter().copied().zip(&links).collect();
            of_member.sort_unstable_by_key(|(member, _)| *member);
            let at = |member: u32| of_member.partition_point(|(other, _)| *other < member);
            let stored: Vec<&Links> = leaf.members.iter().map(|&member| of_member[at(member)].1).collect();
            leaf.block.near = near_tiles(&stored, self.transport.gather.n_outputs());
        }
        if let (Some((cache, key)), Some(crossed)) = (key, crossed) {
            cache.keep(&key, members, &leaf, &crossed);
        }
        Ok((leaf, false))
    }
}

/// Leaves that are come by in one stage.
struct Run<'a> {
    work: &'a LeafWork<'a>,
    stage: StageGuard<'a>,
    counts: CacheUse,
}

impl Run<'_> {
    /// What `take` makes of some leaves, given by number.
    fn each<T: Send>(
        &mut self,
        numbers: Vec<usize>,
        take: impl Fn(usize, LeafTransport) -> Result<T, BakeError> + Sync,
    ) -> Result<Vec<T>, BakeError> {
        let (work, stage) = (self.work, &self.stage);
        let reused = AtomicU64::new(0);
        let leaf = |number: usize| {
            work.progress.check()?;
            let members = &work.leaves[number];
            let (leaf, is_kept) = work.one(members)?;
            reused.fetch_add(u64::from(is_kept), Relaxed);
            stage.inc(members.len() as u64);
            take(number, leaf)
        };
        let taken = numbers.into_par_iter().map(leaf).collect::<Result<Vec<T>, BakeError>>()?;
        let reused = reused.into_inner();
        self.counts += CacheUse { reused, baked: taken.len() as u64 - reused };
        Ok(taken)
    }

    /// Where they came from.
    fn used(&self) -> CacheUse {
        self.counts
    }
}

/// Cells in which a bake with a cache notes where its rays went.
pub(super) fn cells(cache: Option<&Cache>, caster: &RayCaster<'_>) -> Option<CellGrid> {
    cache.map(|_| CellGrid::of(caster.scene().bounds().unwrap_or_default()))
}

/// Which leaf is made, and why.
fn explanation(members: &[u32], positions: &[Vec3], why: Why) -> String {
    let sum: Vec3 = members.iter().map(|&member| positions[member as usize]).sum();
    let [x, y, z] = (sum / members.len() as f32).to_array();
    format!("making a leaf of {} receivers about {x:.2}, {y:.2}, {z:.2}: {}", members.len(), why.text())
}

impl LeafTransport {
    fn of(clusters: Vec<Cluster>, rays: RayCounts) -> Self {
        let mut leaf = Self {
            block: TransportBlock::default(),
            members: Vec::new(),
            unseen: Vec::new(),
            row_error_squared: Vec::new(),
            rays,
        };
        for cluster in clusters {
            let record = ClusterRecord {
                n_receivers: cluster.members.len() as u32,
                n_probes: cluster.probes.len() as u32,
                n_sky: cluster.n_sky as u32,
                n_coefficients: cluster.rows.n_coefficients as u32,
            };
            leaf.block.push(record, &cluster.probes, &cluster.rows.projection, &cluster.rows.reconstruction);
            leaf.members.extend(cluster.members);
            leaf.unseen.extend(cluster.unseen);
            leaf.row_error_squared.extend(cluster.rows.row_error_squared);
        }
        leaf
    }
}

/// Receivers of all leaves in stored order.
pub(super) fn stored_members(leaves: &[StowedLeaf]) -> Vec<u32> {
    leaves.iter().flat_map(|leaf| leaf.members.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Reuse, bake_with};
    use crate::{error::BakeError, forecast::Room, progress::Progress, scratch::Scratch, settings::BakeSettings};
    use localprt_scenes::builtin;

    #[test]
    fn what_lay_on_disk_comes_back_the_same() {
        let folder = tempfile::tempdir().expect("folder");
        let settings = BakeSettings {
            probes: Some(12),
            receivers: 600,
            direct_map: 64,
            gather_rays: 16,
            relight_rays: 64,
            leaf: 64,
            volume: Some(0.5),
            ..BakeSettings::default()
        };
        let bake = |scratch: Option<&Scratch>| {
            let reuse = Reuse { scratch, ..Reuse::default() };
            bake_with(builtin::scene("cornell").expect("a scene"), &settings, reuse, &Progress::silent())
                .expect("bakes")
        };
        let scratch = Scratch::in_folder(folder.path()).expect("opens");
        assert!(bake(Some(&scratch)).arrays == bake(None).arrays);
    }

    #[test]
    fn a_bake_that_cannot_fit_is_refused_before_most_of_its_leaves_are_made() {
        let settings = BakeSettings {
            probes: Some(12),
            receivers: 3000,
            direct_map: 64,
            gather_rays: 16,
            relight_rays: 64,
            leaf: 16,
            ..BakeSettings::default()
        };
        let bake = |room: &Room| {
            let reuse = Reuse { room: Some(room), ..Reuse::default() };
            bake_with(builtin::scene("cornell").expect("a scene"), &settings, reuse, &Progress::silent())
        };
        let roomy = Room { memory_bytes: Some(u64::MAX), disk: Some(("a.lprt".into(), u64::MAX)) };
        let baked = bake(&roomy).expect("fits");
        // The order of leaves is not that in which they are made.
        let without = Reuse::default();
        let scene = builtin::scene("cornell").expect("a scene");
        assert!(baked.arrays == bake_with(scene, &settings, without, &Progress::silent()).expect("bakes").arrays);
        let full = bake(&Room { memory_bytes: None, disk: Some(("a.lprt".into(), 1000)) });
        assert!(matches!(full, Err(BakeError::Output(_))));
        let small = bake(&Room { memory_bytes: Some(1000), disk: None });
        assert!(matches!(small, Err(BakeError::Limit { .. })));
    }
}
