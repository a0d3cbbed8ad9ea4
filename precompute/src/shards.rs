//! A bake in shards, for any engine that runs commands: a plan says which leaves belong to which shard, a shard keeps its leaves in
//! a cache that all share, and a merge makes the file of them. No shard needs another, and none is lost by being made twice.

use crate::{digest::Digester, error::BakeError};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Of the content of a [`ShardPlan`].
const VERSION: u32 = 1;
/// Most shards of a plan.
pub const MOST_SHARDS: u32 = 65_536;
/// What is added to the name of a plan for the folder in which its leaves are kept.
const PARTS: &str = ".parts";

/// Which leaves of a bake are baked together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardPlan {
    version: u32,
    /// Version and code of the program that made it: others have other leaves.
    program: String,
    /// The scene: `builtin:NAME`, or a path relative to the plan.
    pub scene: String,
    /// Digest of the scene's files, hexadecimal.
    pub scene_hash: String,
    /// Options of the bake, TOML.
    pub options: String,
    /// The earlier bake whose layout is kept, if any: a path relative to the plan, and the digest of what is kept of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<[String; 2]>,
    /// Where leaves are kept, if not beside the plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache: Option<String>,
    /// Shards, in their order.
    pub shards: Vec<Shard>,
}

/// Leaves that are baked together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// Predicted share of the work of all leaves, 0..=1.
    pub share: f64,
    /// Their numbers.
    pub leaves: Vec<usize>,
}

/// Version and code of this program.
fn program() -> String {
    let code = Digester::new("program").all(env!("LOCALPRT_CODE").as_bytes()).finish();
    format!("{} {}", env!("CARGO_PKG_VERSION"), &localprt_tools::hex(&code)[..16])
}

impl ShardPlan {
    /// Deals leaves of some costs to shards of about the same: each in turn, the costliest first, to the shard that has least.
    pub fn new(scene: String, scene_hash: String, options: String, costs: &[f64], n_shards: u32) -> Self {
        let mut shards = vec![Shard::default(); n_shards as usize];
        let mut order: Vec<usize> = (0..costs.len()).collect();
        order.sort_by(|&a, &b| costs[b].total_cmp(&costs[a]).then(a.cmp(&b)));
        for leaf in order {
            let least = shards.iter_mut().min_by(|a, b| a.share.total_cmp(&b.share)).expect("there are shards");
            least.share += costs[leaf];
            least.leaves.push(leaf);
        }
        let all: f64 = costs.iter().sum();
        for shard in &mut shards {
            shard.share /= all.max(f64::MIN_POSITIVE);
            shard.leaves.sort_unstable();
        }
        Self { version: VERSION, program: program(), scene, scene_hash, options, layout: None, cache: None, shards }
    }

    /// From its text.
    ///
    /// # Errors
    /// [`BakeError::Scene`] if it is damaged, [`BakeError::Option`] if another program made it.
    pub fn of_json(text: &str) -> Result<Self, BakeError> {
        let damaged = |what: String| BakeError::Scene {
            what: format!("not a plan of shards: {what}"),
            place: None,
            remedy: "make it again with `precompute plan`".into(),
        };
        let plan: Self = serde_json::from_str(text).map_err(|error| damaged(error.to_string()))?;
        if (plan.version, &plan.program) != (VERSION, &program()) {
            return Err(BakeError::Option {
                what: format!("the plan was made by precompute {}, this is {}", plan.program, program()),
                remedy: "use that program on all machines, or plan again".into(),
            });
        }
        if plan.shards.is_empty() || plan.shards.len() > MOST_SHARDS as usize {
            return Err(damaged(format!("{} shards", plan.shards.len())));
        }
        let mut leaves: Vec<usize> = plan.shards.iter().flat_map(|shard| shard.leaves.iter().copied()).collect();
        leaves.sort_unstable();
        match leaves.iter().enumerate().find(|(number, leaf)| number != *leaf) {
            Some((number, _)) => Err(damaged(format!("leaf {number} is missing or there twice"))),
            None => Ok(plan),
        }
    }

    /// As stored.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("numbers and strings");
        text.push('\n');
        text
    }

    /// The folder beside a plan in which its leaves are kept.
    pub fn parts(path: &Path) -> PathBuf {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(PARTS);
        path.with_file_name(name)
    }

    /// Number of leaves.
    pub fn n_leaves(&self) -> usize {
        self.shards.iter().map(|shard| shard.leaves.len()).sum()
    }

    /// Numbers of the shards that hold any of some leaves.
    pub fn shards_of(&self, leaves: &[usize]) -> Vec<usize> {
        let holds = |shard: &Shard| shard.leaves.iter().any(|leaf| leaves.contains(leaf));
        self.shards.iter().enumerate().filter(|(_, shard)| holds(shard)).map(|(number, _)| number).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::counter_uniform;

    fn plan(n_leaves: u64, n_shards: u32) -> ShardPlan {
        let costs: Vec<f64> = (0..n_leaves).map(|leaf| 1.0 + 9.0 * counter_uniform(5, leaf, 0)).collect();
        ShardPlan::new("a.glb".into(), "00".into(), String::new(), &costs, n_shards)
    }

    #[test]
    fn every_leaf_is_in_one_shard_and_shards_are_even() {
        let plan = plan(400, 16);
        assert_eq!(ShardPlan::of_json(&plan.to_json()).expect("is whole"), plan);
        assert_eq!(plan.n_leaves(), 400);
        assert!(plan.shards.iter().all(|shard| (shard.share * 16.0 - 1.0).abs() < 0.02), "{:?}", plan.shards[0]);
        let shard = plan.shards[3].leaves[1];
        assert_eq!(plan.shards_of(&[shard]), [3]);
    }

    #[test]
    fn more_shards_than_leaves_leave_some_without_work() {
        let plan = plan(3, 8);
        assert_eq!(plan.shards.iter().filter(|shard| shard.leaves.is_empty()).count(), 5);
        assert!(ShardPlan::of_json(&plan.to_json()).is_ok());
    }

    #[test]
    fn a_damaged_plan_and_one_of_another_program_are_refused() {
        let text = plan(3, 2).to_json();
        let code = |text: &str| ShardPlan::of_json(text).expect_err("refused").exit().code();
        assert_eq!(code(&text[1..]), 3);
        assert_eq!(code(&text.replace("\"leaves\"", "\"trees\"")), 3);
        let one = plan(3, 2).shards[0].leaves[0];
        assert_eq!(code(&text.replacen(&format!("        {one}"), "        7", 1)), 3);
        assert_eq!(code(&text.replace("\"program\": \"", "\"program\": \"9")), 2);
    }

    #[test]
    fn leaves_are_kept_beside_the_plan() {
        assert_eq!(ShardPlan::parts(Path::new("farm/hall.plan")), Path::new("farm/hall.plan.parts"));
    }
}
