//! Which systems are compared, by name.

use super::super::methods::{ARIKAN, COMPRESSED, Method, PAPER, SPATIAL, UNCOMPRESSED};
use localprt_systems::{KINDS, Kind};

/// Every system, for `--systems all`.
const ALL: &str = "all";

/// A way of ours to the light of the file's probes.
#[derive(Debug)]
pub struct Ours {
    /// Its key in `metrics.json`.
    pub name: &'static str,
    /// Its row of the table.
    pub title: &'static str,
    pub(super) method: &'static Method,
    /// The file itself, and not rows that it was made from.
    pub(super) is_file: bool,
}

static OURS: &[&Ours] = &[
    &Ours { name: "file", title: "localprt, the file", method: &COMPRESSED, is_file: true },
    &Ours { name: "fitted", title: "localprt, rows uncompressed", method: &UNCOMPRESSED, is_file: false },
    &Ours { name: "paper", title: "rows as in SL17, uncompressed", method: &PAPER, is_file: false },
    &Ours { name: "spatial", title: "spatial interpolation, Eq. (1)", method: &SPATIAL, is_file: false },
    &Ours { name: "arikan", title: "Arikan et al., their final gather", method: &ARIKAN, is_file: false },
];

/// A system that is asked for.
#[derive(Clone, Copy)]
pub enum Wanted {
    /// One of ours.
    Ours(&'static Ours),
    /// One of the others.
    Other(&'static Kind),
}

/// How many probes systems get that choose them themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Budget {
    /// As many as the file has.
    #[default]
    Probes,
    /// As many as fit into the bytes of the file.
    Bytes,
}

/// Systems to compare.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// In the order of the table.
    pub systems: Vec<Wanted>,
    /// What the others may spend.
    pub budget: Budget,
    /// Whether they also follow a lamp.
    pub moving_lamp: bool,
}

impl Wanted {
    /// Its key in `metrics.json`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ours(ours) => ours.name,
            Self::Other(kind) => kind.name,
        }
    }

    /// All that there are, in the order of the table.
    pub fn all() -> impl Iterator<Item = Self> {
        OURS.iter().map(|ours| Self::Ours(ours)).chain(KINDS.iter().map(|kind| Self::Other(kind)))
    }

    /// Those of a list of names with commas, or `all`.
    ///
    /// # Errors
    /// A name that there is none of, with the nearest that there is.
    pub fn listed(text: &str) -> Result<Vec<Self>, String> {
        if text == ALL {
            return Ok(Self::all().collect());
        }
        let asked: Vec<&str> = text.split(',').map(str::trim).collect();
        for name in &asked {
            if !Self::all().any(|system| system.name() == *name) {
                let near = Self::all()
                    .map(|system| system.name())
                    .max_by(|a, b| strsim::jaro_winkler(a, name).total_cmp(&strsim::jaro_winkler(b, name)));
                let names: Vec<&str> = Self::all().map(|system| system.name()).collect();
                let near = near.unwrap_or(ALL);
                return Err(format!(
                    "no system is called {name:?}; did you mean {near}? There are all, {}",
                    names.join(", ")
                ));
            }
        }
        Ok(Self::all().filter(|system| asked.contains(&system.name())).collect())
    }
}

impl std::fmt::Debug for Wanted {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_chosen_by_name_in_the_order_of_the_table() {
        let names = |text: &str| Wanted::listed(text).map(|found| found.iter().map(Wanted::name).collect::<Vec<_>>());
        assert_eq!(names("paper, file"), Ok(vec!["file", "paper"]));
        assert_eq!(names("all").expect("all").len(), OURS.len() + KINDS.len());
        let error = names("file,spatail").expect_err("no such system");
        assert!(error.contains("did you mean spatial?"), "{error}");
    }
}
