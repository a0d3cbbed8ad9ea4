//! Flags over a configuration file over a preset: how the settings of a bake come together.

use super::{BakeSettings, OPTIONS, OutOfRange, Preset};
use toml::{Table, Value};

/// Name under which errors report the layer of the flags.
pub const FLAG_LAYER: &str = "command line";

/// What to use instead of an option that there was.
pub const FILL_IS_GONE: &str = "`fill` is gone: give the number of receivers with `receivers`; the map's size follows";

/// Why a set of options is refused. `layer` is a configuration file's name, or [`FLAG_LAYER`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// Not TOML.
    #[error("{layer}: not valid TOML: {what} (line {line}, column {column})")]
    Syntax {
        /// Where it was given.
        layer: String,
        /// What the parser met.
        what: String,
        /// First is 1.
        line: usize,
        /// First is 1.
        column: usize,
    },
    /// No such option.
    #[error("{layer}: unknown option `{key}`")]
    UnknownKey {
        /// Where it was given.
        layer: String,
        /// As written.
        key: String,
        /// The nearest option there is.
        nearest: Option<&'static str>,
    },
    /// A value of another type.
    #[error("{layer}: option `{key}`: {what}")]
    WrongType {
        /// Where it was given.
        layer: String,
        /// The option.
        key: String,
        /// What is expected.
        what: String,
    },
    /// A value that is not allowed.
    #[error("{}", range_text(layer, error))]
    Range {
        /// Where it was given.
        layer: String,
        /// Which, and what is allowed.
        error: OutOfRange,
    },
}

/// Names the flag, or the file and its key.
fn range_text(layer: &str, error: &OutOfRange) -> String {
    if layer != FLAG_LAYER {
        return format!("{layer}: {error}");
    }
    let OutOfRange { key, value, allowed } = error;
    format!("--{} {value} is out of range; allowed: {allowed}", key.replace('_', "-"))
}

impl SettingsError {
    /// What to do about it.
    pub fn help(&self) -> String {
        match self {
            Self::Syntax { .. } | Self::WrongType { .. } => {
                "`precompute bake --print-config` prints a file with all options to start from".into()
            }
            Self::UnknownKey { key, .. } if key == "fill" => FILL_IS_GONE.into(),
            Self::UnknownKey { nearest: Some(nearest), .. } => format!("did you mean `{nearest}`?"),
            Self::UnknownKey { nearest: None, .. } => {
                "`precompute bake --print-config` prints all options there are".into()
            }
            Self::Range { layer, .. } if layer == FLAG_LAYER => "`precompute bake --help` tells what it is for".into(),
            Self::Range { error, .. } => format!("correct `{}` there, or override it on the command line", error.key),
        }
    }
}

impl BakeSettings {
    /// Flags over configuration over preset over defaults. `config` is the file's name and text; `flags` holds the
    /// options given on the command line, by key.
    ///
    /// # Errors
    /// [`SettingsError`] with the layer that is to blame.
    pub fn resolve(preset: Preset, config: Option<(&str, &str)>, flags: &Table) -> Result<Self, SettingsError> {
        let (name, text) = config.unwrap_or_default();
        let layers = [(name, &parse(name, text)?), (FLAG_LAYER, flags)];
        let mut table = Table::try_from(preset.settings()).unwrap_or_default();
        for (layer, given) in layers {
            check_types(layer, given)?;
            table.extend(given.clone());
        }
        let settings: Self = Value::Table(table).try_into().map_err(|error: toml::de::Error| {
            // The values of each layer were tried one by one before, so no key is at fault here.
            SettingsError::WrongType { layer: FLAG_LAYER.into(), key: String::new(), what: error.message().into() }
        })?;
        settings.check().map_err(|error| {
            let given = layers.iter().rev().find(|(_, given)| given.contains_key(error.key));
            let layer = given.map_or_else(|| format!("preset {}", preset.name()), |(layer, _)| (*layer).into());
            SettingsError::Range { layer, error }
        })?;
        Ok(settings)
    }

    /// The options that a baked file was made with, from the text in its metadata. Files from before rows were fitted do not
    /// name their transport: it is the paper's. Those from before budgets do not name their density: it is even. Those from
    /// before near light have none.
    ///
    /// # Errors
    /// [`SettingsError`], its layer the options of the bake.
    pub fn of_file(options: &str) -> Result<Self, SettingsError> {
        let layer = "options of the bake";
        let mut options = parse(layer, options)?;
        for (key, before) in [("transport", "paper"), ("density", "uniform")] {
            options.entry(key).or_insert_with(|| Value::String(before.into()));
        }
        options.entry("near_bytes").or_insert(Value::Integer(0));
        options.remove("fill");
        Self::resolve(Preset::Production, Some((layer, &options.to_string())), &Table::new())
    }

    /// The text of a configuration file with these settings: [`BakeSettings::resolve`] reads it back to the same.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }
}

/// TOML of a layer.
///
/// # Errors
/// [`SettingsError::Syntax`], with line and column.
pub fn parse(layer: &str, text: &str) -> Result<Table, SettingsError> {
    text.parse::<Table>().map_err(|error| {
        let before = &text[..error.span().map_or(0, |span| text.floor_char_boundary(span.start))];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|&letter| letter != '\n').count() + 1;
        SettingsError::Syntax { layer: layer.into(), what: one_line(error.message()), line, column }
    })
}

/// One key after the other, so that errors can name it.
fn check_types(layer: &str, given: &Table) -> Result<(), SettingsError> {
    for (key, value) in given {
        if !OPTIONS.iter().any(|option| option.key == key) {
            return Err(SettingsError::UnknownKey {
                layer: layer.into(),
                key: key.clone(),
                nearest: nearest_option(key),
            });
        }
        let alone = Table::from_iter([(key.clone(), value.clone())]);
        Value::Table(alone).try_into::<BakeSettings>().map_err(|error| SettingsError::WrongType {
            layer: layer.into(),
            key: key.clone(),
            what: one_line(error.message()),
        })?;
    }
    Ok(())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn nearest_option(key: &str) -> Option<&'static str> {
    nearest(key, OPTIONS.iter().map(|option| option.key))
}

/// The name that needs the fewest edits, if that is at most a third of its letters; dashes count as underscores.
pub fn nearest<'a>(key: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let key = key.to_lowercase().replace('-', "_");
    let (edits, name) = names.map(|name| (strsim::levenshtein(&key, name), name)).min()?;
    (edits <= name.len().div_ceil(3)).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Density, Transport, UnwrapBackend};

    fn full() -> BakeSettings {
        BakeSettings {
            spacing: Some(0.1),
            probes: Some(150),
            voxel: Some(0.01),
            interior: vec![[0.1, 1.0, -2.5], [0.0, 0.0, 0.0]],
            focus: vec![[0.0, 1.0, 2.0, 3.0]],
            lightmap: Some(512),
            texel: Some(0.05),
            volume: Some(0.5),
            unwrap: UnwrapBackend::Xatlas,
            max_unseen: Some(0.25),
            ..BakeSettings::default()
        }
    }

    #[test]
    fn keys_are_the_fields_of_the_settings_in_their_order() {
        let json = serde_json::to_value(full()).expect("settings are plain data");
        let fields: Vec<&str> = json.as_object().expect("a struct").keys().map(String::as_str).collect();
        assert_eq!(fields, OPTIONS.iter().map(|option| option.key).collect::<Vec<_>>());
    }

    #[test]
    fn text_reads_back_to_the_same_settings() {
        for settings in [full(), BakeSettings::default(), Preset::Preview.settings()] {
            let text = settings.to_toml();
            // A preset that differs everywhere possible must be overruled by the file.
            let read = BakeSettings::resolve(Preset::Medium, Some(("c.toml", &text)), &Table::new());
            assert_eq!(read.expect("valid"), settings, "{text}");
        }
        assert!(BakeSettings::default().to_toml().contains("threshold = 0.005\n"));
    }

    #[test]
    fn files_of_earlier_versions_have_the_papers_transport_and_an_even_density() {
        let settings = BakeSettings::of_file("probe_degree = 4").expect("valid");
        assert_eq!((settings.transport, settings.probe_degree), (Transport::Paper, 4));
        assert_eq!((settings.density, settings.near_bytes), (Density::Uniform, 0));
        BakeSettings::of_file("lightmap = 256\nfill = 0.13").expect("options of an earlier version");
        let settings = BakeSettings::of_file(&BakeSettings::default().to_toml()).expect("valid");
        assert_eq!(settings, BakeSettings::default());
    }

    #[test]
    fn flags_win_over_the_file_and_the_file_over_the_preset() {
        let flags: Table = "gather_rays = 7".parse().expect("TOML");
        let config = "gather_rays = 8\nrelight_rays = 9\n";
        let settings = BakeSettings::resolve(Preset::Preview, Some(("c.toml", config)), &flags).expect("valid");
        assert_eq!((settings.gather_rays, settings.relight_rays, settings.receivers), (7, 9, 60_000));
    }

    #[test]
    fn errors_name_layer_key_and_remedy() {
        let refused = |config: &str, flags: &str| {
            let flags: Table = flags.parse().expect("TOML");
            let error = BakeSettings::resolve(Preset::Production, Some(("c.toml", config)), &flags);
            let error = error.expect_err("to be refused");
            format!("{error} / {}", error.help())
        };
        let text = refused("gather_ray = 3", "");
        assert_eq!(text, "c.toml: unknown option `gather_ray` / did you mean `gather_rays`?");
        assert!(refused("gather-rays = 3", "").ends_with("did you mean `gather_rays`?"));
        assert!(refused("quality = 3", "").contains("--print-config"));
        assert!(refused("gather_rays = 'many'", "").starts_with("c.toml: option `gather_rays`: invalid type"));
        assert!(refused("fill = 0.1", "").contains("receivers"));
        let text = refused("leaf = 0", "");
        assert!(text.starts_with("c.toml: leaf = 0 is out of range; allowed: 2 to 8192 /"), "{text}");
        let text = refused("", "leaf = 1");
        assert!(text.starts_with("--leaf 1 is out of range; allowed: 2 to 8192"), "{text}");
        assert!(refused("seed = 1\nleaf = = 2", "").contains("(line 2, column 8)"));
    }
}
