//! Which systems are compared, by name.

use super::super::methods::{ARIKAN, COMPRESSED, Method, PAPER, SPATIAL, UNCOMPRESSED};
use localprt_systems::{KINDS, Kind, hybrid};
use std::str::FromStr;

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
    pub(super) keeps: Keeps,
}

/// What one of ours keeps from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keeps {
    /// The file.
    File,
    /// The file, and traced probes around what moves: none where nothing does.
    Hybrid,
    /// Uncompressed rows.
    Rows,
}

static OURS: &[&Ours] = &[
    &Ours { name: "file", title: "localprt, the file", method: &COMPRESSED, keeps: Keeps::File },
    &Ours { name: hybrid::NAME, title: hybrid::TITLE, method: &COMPRESSED, keeps: Keeps::Hybrid },
    &Ours { name: "fitted", title: "localprt, rows uncompressed", method: &UNCOMPRESSED, keeps: Keeps::Rows },
    &Ours { name: "paper", title: "rows as in SL17, uncompressed", method: &PAPER, keeps: Keeps::Rows },
    &Ours { name: "spatial", title: "spatial interpolation, Eq. (1)", method: &SPATIAL, keeps: Keeps::Rows },
    &Ours { name: "arikan", title: "Arikan et al., their final gather", method: &ARIKAN, keeps: Keeps::Rows },
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

/// Systems by name, in the order of the table.
#[derive(Clone, Debug, Default)]
pub struct Systems(pub Vec<Wanted>);

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
}

impl FromStr for Systems {
    type Err = String;

    /// Those of a list of names with commas, or `all`. Of a name that there is none of, the error has the nearest that there is.
    fn from_str(text: &str) -> Result<Self, String> {
        let all = || Wanted::all().map(|system| system.name());
        if text == ALL {
            return Ok(Self(Wanted::all().collect()));
        }
        let asked: Vec<&str> = text.split(',').map(str::trim).collect();
        if let Some(name) = asked.iter().find(|name| !all().any(|other| other == **name)) {
            let likeness = |other: &str| strsim::jaro_winkler(other, name);
            let near = all().max_by(|a, b| likeness(a).total_cmp(&likeness(b))).unwrap_or(ALL);
            let names: Vec<&str> = all().collect();
            return Err(format!(
                "no system is called {name:?}; did you mean {near}? There are all, {}",
                names.join(", ")
            ));
        }
        Ok(Self(Wanted::all().filter(|system| asked.contains(&system.name())).collect()))
    }
}

impl FromStr for Budget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "probes" => Ok(Self::Probes),
            "bytes" => Ok(Self::Bytes),
            _ => Err("expected probes or bytes".into()),
        }
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
        let names = |text: &str| {
            text.parse::<Systems>().map(|Systems(found)| found.iter().map(Wanted::name).collect::<Vec<_>>())
        };
        assert_eq!(names("paper, file"), Ok(vec!["file", "paper"]));
        assert_eq!(names("all").expect("all").len(), OURS.len() + KINDS.len());
        let error = names("file,spatail").expect_err("no such system");
        assert!(error.contains("did you mean spatial?"), "{error}");
    }
}
