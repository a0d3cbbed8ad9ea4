//! Finished leaves by what they depend on, kept from bake to bake.
//!
//! What a leaf depends on is known in two steps. Before any ray is traced: the code, the options, its receivers, its probes and what
//! they see; that is its key. Which parts of the scene its rays meet is known only afterwards: the coarse cells that they crossed
//! are kept under the key, and the leaf under the key with the digest of what stood in those cells. A leaf is looked up by finding
//! the cells, and then whether it was baked when they held what they hold now.

use super::leaf::LeafTransport;
use crate::{
    cache::{Cache, Packer, Unpacker},
    cells::{CellGrid, CellSet},
    clusters::RefineSettings,
    digest::{Digest, Digester},
    output::OutputError,
    transport::{CellContents, NearField, RayCounts, TransportScene},
};
use localprt_formats::{BlockShape, NearArrays, TransportBlock};

/// Records: cells of a key, and leaves.
const CELLS: &str = "cells";
const LEAF: &str = "leaf";
/// Sets of cells that are kept for a key, at most: those of the last edits.
const MOST_SETS: usize = 8;

/// The leaves of one transport stage in a cache.
pub(super) struct LeafCache<'a> {
    cache: &'a Cache,
    contents: CellContents,
    /// Digest of the code, the options and what else all leaves share.
    shared: Digest,
    /// `[n_probes]`.
    probes: Vec<Digest>,
    /// What blocks have to fit.
    shape: BlockShape,
}

/// Where a leaf is kept.
pub(super) struct LeafKey {
    digest: Digest,
    /// Its probes, by whose places the record names them.
    probes: Vec<u32>,
}

/// Why a leaf has to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Why {
    /// It was never made with this key.
    Key,
    /// It was, but not with what stands where its rays go, or its record is gone.
    Surroundings,
}

impl Why {
    /// In words.
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::Key => "its receivers, its probes or what they see, options or code are new",
            Self::Surroundings => "what stands where its rays go is new, or its record is gone",
        }
    }
}

impl<'a> LeafCache<'a> {
    /// Of a stage whose rays note the cells that they cross.
    pub(super) fn of(
        cache: &'a Cache,
        transport: &TransportScene<'_>,
        refining: &RefineSettings,
    ) -> Result<Option<Self>, OutputError> {
        let Some(contents) = CellContents::of(transport) else { return Ok(None) };
        let RefineSettings { threshold, max_coefficients, n_sh, n_sky } = *refining;
        let mut digester = Digester::new("leaves");
        code(&mut digester);
        digester.one(transport.digest()).one(threshold).one([max_coefficients as u64, n_sh as u64, n_sky as u64]);
        let shape = BlockShape {
            n_probes: transport.probes.positions.len(),
            n_sh,
            n_sky,
            n_k: transport.gather.n_outputs(),
            // Without near light there is no map that it could be read from.
            direct_size: transport.near.map_or(0, NearField::size),
            of: "",
        };
        let probes = transport.digests_of_probes()?;
        Ok(Some(Self { cache, contents, shared: digester.finish(), probes, shape }))
    }

    /// The key of a leaf.
    pub(super) fn key(&self, transport: &TransportScene<'_>, members: &[u32]) -> LeafKey {
        let mut digester = Digester::new("leaf");
        digester.one(self.shared);
        transport.digest_of_leaf(members, &self.probes, &mut digester);
        LeafKey { digest: digester.finish(), probes: transport.union_of_support(members) }
    }

    /// The leaf as it was kept, if nothing that it depends on is new; else why it has to be made.
    pub(super) fn find(&self, key: &LeafKey, members: &[u32]) -> Result<LeafTransport, Why> {
        let sets = self.cells(key);
        if sets.is_empty() {
            return Err(Why::Key);
        }
        let record = sets.iter().find_map(|set| self.cache.get(LEAF, &self.of_leaf(key, set)));
        record.and_then(|record| unpack(&record, members, &key.probes, self.shape)).ok_or(Why::Surroundings)
    }

    /// Keeps a leaf and the cells that its rays crossed.
    pub(super) fn keep(&self, key: &LeafKey, members: &[u32], leaf: &LeafTransport, crossed: &CellSet) {
        let mut sets = self.cells(key);
        if !sets.contains(crossed) {
            sets.insert(0, crossed.clone());
            sets.truncate(MOST_SETS);
            self.cache.replace(CELLS, &key.digest, &pack_sets(&sets));
        }
        self.cache.put(LEAF, &self.of_leaf(key, crossed), &pack(leaf, members, &key.probes));
    }

    /// Sets of cells that rays of leaves of this key crossed, the latest first.
    fn cells(&self, key: &LeafKey) -> Vec<CellSet> {
        let record = self.cache.get(CELLS, &key.digest);
        record.and_then(|record| unpack_sets(&record, self.contents.grid())).unwrap_or_default()
    }

    fn of_leaf(&self, key: &LeafKey, crossed: &CellSet) -> Digest {
        Digester::new("kept leaf").one(key.digest).one(self.contents.digest(crossed)).finish()
    }
}

/// Takes in the code that makes results, and what of the machine they depend on: systems have other logarithms, and matrices are
/// multiplied with the widest instructions there are, which round in other places.
pub(super) fn code(digester: &mut Digester) {
    for name in [env!("LOCALPRT_CODE"), std::env::consts::ARCH, std::env::consts::OS] {
        digester.all(name.as_bytes());
    }
    #[cfg(target_arch = "x86_64")]
    digester.one([
        u8::from(std::arch::is_x86_feature_detected!("avx2")),
        u8::from(std::arch::is_x86_feature_detected!("fma")),
        u8::from(std::arch::is_x86_feature_detected!("avx512f")),
    ]);
}

/// Words of each set without the zeros: how many follow, and then those that are not.
pub(super) fn pack_sets(sets: &[CellSet]) -> Vec<u8> {
    let mut packer = Packer::default();
    for set in sets {
        let (mut runs, mut words): (Vec<[u32; 2]>, Vec<u64>) = Default::default();
        for run in set.words().chunk_by(|a, b| (*a == 0) == (*b == 0)) {
            match run[0] {
                0 => runs.push([run.len() as u32, 0]),
                _ => {
                    if runs.last().is_none_or(|run| run[1] > 0) {
                        runs.push([0, 0]);
                    }
                    runs.last_mut().expect("one is there")[1] = run.len() as u32;
                    words.extend(run);
                }
            }
        }
        packer.put(&runs).put(&words);
    }
    packer.finish()
}

pub(super) fn unpack_sets(record: &[u8], grid: CellGrid) -> Option<Vec<CellSet>> {
    let mut unpacker = Unpacker::new(record);
    let mut sets = Vec::new();
    while !unpacker.is_done() {
        // No more are kept, and sets may be much larger than their records.
        if sets.len() == MOST_SETS {
            return None;
        }
        let (runs, words): (Vec<[u32; 2]>, Vec<u64>) = (unpacker.take()?, unpacker.take()?);
        let mut words = words.into_iter();
        let mut all = Vec::new();
        for [zeros, others] in runs {
            if all.len() + zeros as usize + others as usize > grid.n_cells().div_ceil(64) {
                return None;
            }
            all.resize(all.len() + zeros as usize, 0);
            all.extend(words.by_ref().take(others as usize));
        }
        sets.push(CellSet::from_words(grid, all)?);
    }
    Some(sets)
}

/// Receivers and probes by their places among those of the leaf: their numbers may be others in the next bake.
pub(super) fn pack(leaf: &LeafTransport, members: &[u32], probes: &[u32]) -> Vec<u8> {
    let LeafTransport { block, members: stored, unseen, row_error_squared, rays } = leaf;
    let TransportBlock { clusters, cluster_probes, projection, reconstruction, near } = block;
    let NearArrays { tiles, nodes, counts, links, weights } = near;
    let mut by_number: Vec<(u32, u32)> = members.iter().copied().zip(0..).collect();
    by_number.sort_unstable();
    let member = |number: &u32| by_number[by_number.partition_point(|(other, _)| other < number)].1;
    let probe = |number: &u32| probes.partition_point(|other| other < number) as u32;
    let mut packer = Packer::default();
    packer
        .put(clusters)
        .put(&cluster_probes.iter().map(probe).collect::<Vec<_>>())
        .put(projection)
        .put(reconstruction)
        .put(tiles)
        .put(nodes)
        .put(counts)
        .put(links)
        .put(weights)
        .put(&stored.iter().map(member).collect::<Vec<_>>())
        .put(unseen)
        .put(row_error_squared)
        .put(&[[rays.gather, rays.visibility]]);
    packer.finish()
}

/// A leaf that can be stored; whoever can write into a cache can write other records than a bake does.
pub(super) fn unpack(record: &[u8], members: &[u32], probes: &[u32], shape: BlockShape) -> Option<LeafTransport> {
    let mut record = Unpacker::new(record);
    let numbers = |places: Vec<u32>, of: &[u32]| -> Option<Vec<u32>> {
        places.into_iter().map(|place| of.get(place as usize).copied()).collect()
    };
    let leaf = LeafTransport {
        block: TransportBlock {
            clusters: record.take()?,
            cluster_probes: numbers(record.take()?, probes)?,
            projection: record.take()?,
            reconstruction: record.take()?,
            near: NearArrays {
                tiles: record.take()?,
                nodes: record.take()?,
                counts: record.take()?,
                links: record.take()?,
                weights: record.take()?,
            },
        },
        members: numbers(record.take()?, members)?,
        unseen: record.take()?,
        row_error_squared: record.take()?,
        rays: record.one::<[u64; 2]>().map(|[gather, visibility]| RayCounts { gather, visibility })?,
    };
    (record.is_done() && is_sound(&leaf, members, shape)).then_some(leaf)
}

fn is_sound(leaf: &LeafTransport, members: &[u32], shape: BlockShape) -> bool {
    let LeafTransport { block, members: stored, unseen, row_error_squared, rays: _ } = leaf;
    let [mut stored, mut expected] = [stored.to_vec(), members.to_vec()];
    stored.sort_unstable();
    expected.sort_unstable();
    stored == expected
        && unseen.len() == members.len()
        && unseen.iter().all(|share| (0.0..=1.0).contains(share))
        && row_error_squared.len() == members.len() * shape.n_k
        && row_error_squared.iter().all(|error| error.is_finite())
        && (shape.direct_size > 0 || block.near.tiles.is_empty())
        && block.check(members.len(), shape).is_ok()
}

#[cfg(test)]
mod tests {
    use super::super::{Reuse, bake, bake_with};
    use super::*;
    use crate::{
        cache::CacheOptions,
        plan::Previous,
        progress::Progress,
        report::CacheUse,
        settings::{BakeSettings, Density, Transport},
    };
    use glam::{Vec3, Vec4};
    use half::f16;
    use localprt_formats::{BakedArrays, ClusterRecord, NearTile, directions::counter_hash};
    use localprt_scenes::{AlphaMode, Scene, builtin};

    fn small() -> BakeSettings {
        BakeSettings {
            probes: Some(24),
            receivers: 1500,
            direct_map: 64,
            gather_rays: 32,
            relight_rays: 64,
            leaf: 64,
            ..BakeSettings::default()
        }
    }

    /// Two closed rooms so far from each other that they share no probes.
    fn rooms() -> Scene {
        let mut scene = builtin::scene("two-rooms").expect("a scene");
        for mesh in scene.meshes.iter_mut().filter(|mesh| mesh.name.starts_with("right")) {
            mesh.positions.iter_mut().for_each(|position| position.x += 40.0);
        }
        scene
    }

    fn reuse(cache: &Cache) -> Reuse<'_> {
        Reuse { cache: Some(cache), ..Reuse::default() }
    }

    fn cached(scene: &Scene, settings: &BakeSettings, cache: &Cache) -> (BakedArrays, CacheUse) {
        let baked = bake_with(scene.clone(), settings, reuse(cache), &Progress::silent()).expect("bakes");
        (baked.arrays, baked.report.cache.expect("a cache is used"))
    }

    fn clean(scene: &Scene, settings: &BakeSettings) -> BakedArrays {
        bake(scene.clone(), settings, &Progress::silent()).expect("bakes").arrays
    }

    fn open(folder: &tempfile::TempDir) -> Cache {
        Cache::open(folder.path(), CacheOptions::default()).expect("opens")
    }

    #[test]
    fn a_second_bake_makes_nothing_and_gives_the_same() {
        let folder = tempfile::tempdir().expect("folder");
        let scene = rooms();
        let paper = BakeSettings { transport: Transport::Paper, receiver_degree: 1, ..small() };
        for settings in [BakeSettings { volume: Some(1.0), ..small() }, paper] {
            let expected = clean(&scene, &settings);
            let (first, of_first) = cached(&scene, &settings, &open(&folder));
            let (second, of_second) = cached(&scene, &settings, &open(&folder));
            assert!(first == expected && second == expected);
            assert!(of_first.reused == 0 && of_first.baked > 20, "{of_first:?}");
            assert_eq!(of_second, CacheUse { reused: of_first.baked, baked: 0 });
        }
    }

    /// Two receivers in two clusters, one of them with a link.
    fn leaf() -> LeafTransport {
        let mut block = TransportBlock::default();
        for probes in [&[4][..], &[4, 9]] {
            let n_probes = probes.len() as u32;
            let record = ClusterRecord { n_receivers: 1, n_probes, n_sky: 0, n_coefficients: 1 };
            block.push(record, probes, &vec![f16::ONE; probes.len()], &[f16::ONE]);
        }
        block.near = NearArrays {
            tiles: vec![NearTile { n_receivers: 2, n_nodes: 1, n_links: 1, scale: 0.5 }],
            nodes: vec![3],
            counts: vec![0, 1],
            links: vec![0],
            weights: vec![7],
        };
        let rays = RayCounts { gather: 3, visibility: 4 };
        LeafTransport { block, members: vec![11, 5], unseen: vec![0.0, 1.0], row_error_squared: vec![0.0, 1e-6], rays }
    }

    #[test]
    fn records_that_no_bake_would_write_are_no_leaves() {
        let (members, probes) = ([5, 11], [4, 9]);
        let shape = BlockShape { n_probes: 10, n_sh: 1, n_sky: 0, n_k: 1, direct_size: 2, of: "" };
        let read = |leaf: &LeafTransport| unpack(&pack(leaf, &members, &probes), &members, &probes, shape);
        let found = read(&leaf()).expect("a leaf");
        assert_eq!((found.block, found.members), (leaf().block, leaf().members));
        let changes: [fn(&mut LeafTransport); 10] = [
            |leaf| leaf.members[0] = 5,
            |leaf| leaf.unseen[1] = f32::NAN,
            |leaf| leaf.unseen.truncate(1),
            |leaf| leaf.row_error_squared.push(0.0),
            |leaf| leaf.block.clusters.truncate(1),
            |leaf| leaf.block.cluster_probes.swap(1, 2),
            |leaf| leaf.block.projection.truncate(1),
            |leaf| leaf.block.near.counts.clear(),
            |leaf| leaf.block.near.weights.clear(),
            |leaf| leaf.block.near.nodes[0] = 4,
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut broken = leaf();
            change(&mut broken);
            assert!(read(&broken).is_none(), "change {number}");
        }
        let of_volume = BlockShape { direct_size: 0, ..shape };
        assert!(unpack(&pack(&leaf(), &members, &probes), &members, &probes, of_volume).is_none());
    }

    #[test]
    fn more_sets_of_cells_than_are_kept_are_none() {
        let grid = CellGrid::of((Vec3::ZERO, Vec3::ONE));
        let sets =
            |count: usize| unpack_sets(&pack_sets(&vec![CellSet::new(grid); count]), grid).map(|sets| sets.len());
        assert_eq!((sets(MOST_SETS), sets(MOST_SETS + 1)), (Some(MOST_SETS), None));
    }

    #[test]
    fn damaged_and_missing_records_are_made_anew() {
        let folder = tempfile::tempdir().expect("folder");
        let (scene, settings) = (builtin::scene("cornell").expect("a scene"), small());
        let (expected, of_first) = cached(&scene, &settings, &open(&folder));
        let records = || {
            let folders = std::fs::read_dir(folder.path()).expect("there").flatten().map(|entry| entry.path());
            let mut files: Vec<_> = folders
                .filter(|path| path.is_dir())
                .flat_map(|path| std::fs::read_dir(path).expect("there").flatten().map(|entry| entry.path()))
                .collect();
            files.sort();
            files
        };
        for (number, path) in records().into_iter().enumerate() {
            let mut bytes = std::fs::read(&path).expect("there");
            match counter_hash(3, 0, number as u64) % 4 {
                0 => std::fs::remove_file(&path).expect("removed"),
                1 => std::fs::write(&path, &bytes[..bytes.len() / 2]).expect("written"),
                2 => {
                    let place = counter_hash(3, 1, number as u64) as usize % bytes.len();
                    bytes[place] ^= 1;
                    std::fs::write(&path, &bytes).expect("written");
                }
                _ => {}
            }
        }
        let (mended, of_second) = cached(&scene, &settings, &open(&folder));
        assert!(mended == expected);
        assert!(of_second.reused > 0 && of_second.baked > 0, "{of_second:?} after {of_first:?}");
        assert_eq!(cached(&scene, &settings, &open(&folder)).1.baked, 0);
    }

    /// What is done to a scene, and its name.
    type Edit = (&'static str, fn(&mut Scene));

    /// Each changes something in one of the rooms.
    fn edits() -> [Edit; 8] {
        fn of_room(scene: &mut Scene) -> usize {
            // A mesh of the right one gets a material of its own.
            let mesh = scene.meshes.iter_mut().find(|mesh| mesh.name == "right floor").expect("a floor");
            scene.materials.push(scene.materials[mesh.material].clone());
            mesh.material = scene.materials.len() - 1;
            scene.materials.len() - 1
        }
        [
            ("albedo", |scene| {
                let material = of_room(scene);
                scene.materials[material].base_color = Vec4::new(0.5, 0.36, 0.3, 1.0);
            }),
            ("mask", |scene| {
                let material = of_room(scene);
                scene.materials[material].alpha = AlphaMode::Mask { cutoff: 0.5 };
            }),
            ("name", |scene| {
                let material = of_room(scene);
                scene.materials[material].name = "another".into();
            }),
            ("emission", |scene| {
                let material = of_room(scene);
                scene.materials[material].emission = Vec3::ONE;
            }),
            ("move", |scene| {
                let ceiling = scene.meshes.iter_mut().find(|mesh| mesh.name == "right ceiling").expect("a ceiling");
                ceiling.positions.iter_mut().for_each(|position| position.y -= 0.5);
            }),
            ("addition", |scene| {
                let mut lid = scene.meshes.iter().find(|mesh| mesh.name == "right ceiling").expect("a ceiling").clone();
                let middle = lid.positions.iter().sum::<Vec3>() / lid.positions.len() as f32;
                lid.positions.iter_mut().for_each(|at| *at = middle + 0.3 * (*at - middle) - 0.7 * Vec3::Y);
                lid.name = "lid".into();
                scene.meshes.insert(1, lid);
            }),
            ("removal", |scene| scene.meshes.retain(|mesh| mesh.name != "right ceiling")),
            ("roughness", |scene| {
                let material = of_room(scene);
                scene.materials[material].roughness = 0.1;
            }),
        ]
    }

    #[test]
    fn after_an_edit_the_file_is_that_of_a_clean_bake() {
        let folder = tempfile::tempdir().expect("folder");
        let (scene, settings) = (rooms(), small());
        let all = cached(&scene, &settings, &open(&folder)).1.baked;
        for (name, edit) in edits() {
            let mut edited = scene.clone();
            edit(&mut edited);
            let expected = bake(edited.clone(), &settings, &Progress::silent()).expect("bakes");
            let found =
                bake_with(edited.clone(), &settings, reuse(&open(&folder)), &Progress::silent()).expect("bakes");
            assert!(found.arrays == expected.arrays, "{name}");
            assert_eq!(format!("{:?}", found.scene), format!("{:?}", expected.scene), "{name}");
            let leaves = found.report.cache.expect("a cache is used");
            match name {
                "name" | "roughness" => assert_eq!(leaves.baked, 0, "{name}"),
                "albedo" | "mask" => {
                    assert!(
                        leaves.baked > 0 && leaves.reused > all / 4,
                        "{name}: {leaves:?}: the other room is as it was"
                    );
                }
                "emission" => assert_eq!(leaves.reused, 0, "{name}: emitters belong to all leaves"),
                // The layout is another.
                _ => assert!(leaves.baked > 0, "{name}: {leaves:?}"),
            }
        }
        // Nothing is lost by it.
        assert_eq!(cached(&scene, &settings, &open(&folder)).1, CacheUse { reused: all, baked: 0 });
    }

    #[test]
    fn with_the_layout_kept_an_edit_leaves_the_other_room_alone_and_the_file_is_that_of_a_clean_bake() {
        // In so small a light map near light depends on all charts: neighbors share its coarse texels.
        for near_bytes in [0, 32] {
            after_edits(&BakeSettings { near_bytes, direct_map: 128, ..small() });
        }
    }

    fn after_edits(settings: &BakeSettings) {
        let folder = tempfile::tempdir().expect("folder");
        let scene = rooms();
        let cache = open(&folder);
        let baked = bake_with(scene.clone(), settings, reuse(&cache), &Progress::silent()).expect("bakes");
        let all = baked.report.cache.expect("a cache is used").baked;
        let path = folder.path().join("first.lprt");
        let charts = |scene: &Scene, size: u32| {
            let mesh = scene.meshes.iter().find(|mesh| mesh.name == "left floor").expect("a floor");
            (mesh.positions.clone(), mesh.uv_sets[1].iter().map(|uv| *uv * size as f32).collect::<Vec<_>>())
        };
        let then = charts(&baked.scene, baked.arrays.metadata.lightmap_size);
        baked.write(&path, &path.with_extension("glb"), None, &Progress::silent()).expect("writes");
        let previous = Previous::open(&path.with_extension("glb")).expect("has a plan");
        let unchanged = bake_with(
            scene.clone(),
            settings,
            Reuse { cache: Some(&cache), previous: Some(&previous), ..Reuse::default() },
            &Progress::silent(),
        );
        assert_eq!(unchanged.expect("bakes").report.cache, Some(CacheUse { reused: all, baked: 0 }));
        for (name, edit) in edits() {
            let mut edited = scene.clone();
            edit(&mut edited);
            let bake = |cache| {
                let reuse = Reuse { cache, previous: Some(&previous), ..Reuse::default() };
                bake_with(edited.clone(), settings, reuse, &Progress::silent()).expect("bakes")
            };
            let (expected, found) = (bake(None), bake(Some(&cache)));
            assert!(found.arrays == expected.arrays, "{name}");
            assert_eq!(format!("{:?}", found.scene), format!("{:?}", expected.scene), "{name}");
            let leaves = found.report.cache.expect("a cache is used");
            match name {
                "name" | "roughness" => assert_eq!(leaves.baked, 0, "{name}"),
                "emission" => assert_eq!(leaves.reused, 0, "{name}"),
                _ if settings.near_bytes > 0 => assert!(leaves.baked > 0, "{name}"),
                _ => assert!(leaves.baked > 0 && leaves.reused > all / 4, "{name}: {leaves:?} of {all}"),
            }
            // Charts of what is as it was are where they were.
            let now = charts(&found.scene, found.arrays.metadata.lightmap_size);
            assert!(then.0 == now.0 && then.1.iter().zip(&now.1).all(|(a, b)| a.abs_diff_eq(*b, 1e-3)), "{name}");
        }
    }

    #[test]
    fn numbers_of_meshes_do_not_matter_where_the_scene_brings_its_layout() {
        let folder = tempfile::tempdir().expect("folder");
        let settings = BakeSettings { density: Density::Uniform, ..small() };
        let laid_out = bake(rooms(), &settings, &Progress::silent()).expect("bakes").scene;
        let all = cached(&laid_out, &settings, &open(&folder)).1.baked;
        // The room that came second comes first, in the same order of its own.
        let mut turned = laid_out.clone();
        let second = turned.meshes.iter().position(|mesh| mesh.name.starts_with("right")).expect("a second room");
        turned.meshes.rotate_left(second);
        let expected = clean(&turned, &settings);
        let (found, leaves) = cached(&turned, &settings, &open(&folder));
        assert!(found == expected);
        assert_eq!(leaves, CacheUse { reused: all, baked: 0 });
    }
}
