//! What an entry of the table of options is, and what is made of all of them.

use super::{BakeSettings, OutOfRange, Values};

/// An option of a bake, as a configuration file and the command line have it.
#[derive(Debug)]
pub struct BakeOption {
    /// Key in a configuration file; with dashes, the flag of `precompute bake`.
    pub key: &'static str,
    /// How it is given.
    pub values: Values,
    /// What stands for a value in `--help`.
    pub value_name: &'static str,
    /// Heading of `--help` under which it stands.
    pub heading: &'static str,
    /// Key of the option that it follows there, where that is not the one before it.
    pub after: Option<&'static str>,
    /// Text of `--help` without the default.
    pub(super) text: &'static str,
    /// Default in words.
    pub(super) absent: Option<&'static str>,
    /// Its value in these settings, if there is one.
    pub(super) shown: fn(&BakeSettings) -> Option<String>,
    /// Whether its value in these settings is in its range.
    pub(super) check: fn(&BakeSettings) -> Result<(), OutOfRange>,
}

impl BakeOption {
    /// Its flag, without the dashes in front.
    pub fn flag(&self) -> String {
        self.key.replace('_', "-")
    }

    /// Its text in `--help`.
    pub fn help(&self) -> String {
        match self.absent.map(str::to_owned).or_else(|| (self.shown)(&BakeSettings::default())) {
            Some(default) => format!("{} [default: {default}]", self.text),
            None => self.text.into(),
        }
    }
}

/// Makes [`BakeSettings`], its defaults and presets, and the list of options from the entries of the table.
macro_rules! bake_options {
    ($(
        #[doc = $help:literal] $(#[doc = $more:literal])*
        $key:ident: $type:ty = $default:expr
            $(, preview: $preview:expr, medium: $medium:expr)? $(, absent: $absent:literal)?
            => $rule:expr, $value_name:literal in $heading:literal $(after $after:literal)? $(, source: $source:literal)?;
    )+) => {
        use $crate::settings::{BakeOption, OutOfRange, values::OptionValue};

        /// All options of a bake; the keys of a `--config` file and, with dashes, the flags of `precompute bake`.
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct BakeSettings {$(
            #[doc = $help]
            $(#[doc = $more])*
            #[doc = concat!("\n\nDefault `", stringify!($default), "`, range `", stringify!($rule), "`."
                $(, " Source: ", $source, ".")?)]
            #[serde(skip_serializing_if = "OptionValue::is_absent")]
            pub $key: $type,
        )+}

        /// In the order of the fields of [`BakeSettings`].
        pub const OPTIONS: &[BakeOption] = &[$(BakeOption {
            key: stringify!($key),
            values: <$type>::VALUES,
            value_name: $value_name,
            heading: $heading,
            after: [$(Some($after),)? None][0],
            text: $help.trim_ascii(),
            absent: [$(Some($absent),)? None][0],
            shown: |settings| settings.$key.shown(),
            check: |settings| ($rule)(&settings.$key, settings)
                .map_err(|[value, allowed]| OutOfRange { key: stringify!($key), value, allowed }),
        }),+];

        impl Default for BakeSettings {
            fn default() -> Self {
                Self { $($key: $default),+ }
            }
        }

        impl Preset {
            /// The settings this preset stands for.
            pub fn settings(self) -> BakeSettings {
                let production = BakeSettings::default();
                match self {
                    Self::Preview => BakeSettings { $($($key: $preview,)?)+ ..production },
                    Self::Medium => BakeSettings { $($($key: $medium,)?)+ ..production },
                    Self::Production => production,
                }
            }
        }
    };
}

pub(super) use bake_options;
