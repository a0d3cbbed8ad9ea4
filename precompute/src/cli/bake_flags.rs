//! One flag per option of a bake, made from the table of options.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use localprt_precompute::settings::{BakeOption, FILL_IS_GONE, OPTIONS, Preset, Values, Word};
use toml::{Table, Value};

/// Options of a bake as given on the command line.
#[derive(Debug)]
pub struct BakeFlags {
    /// Those that were given, by the keys of a configuration file.
    pub given: Table,
}

impl Args for BakeFlags {
    fn augment_args(command: Command) -> Command {
        let fill = Arg::new("fill").long("fill").value_name("SHARE").hide(true);
        command.args(in_help_order().into_iter().map(flag)).arg(fill.value_parser(gone).allow_negative_numbers(true))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for BakeFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut flags = Self { given: Table::new() };
        flags.update_from_arg_matches(matches)?;
        Ok(flags)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for option in OPTIONS {
            let value = match option.values {
                Values::Many(_) => matches.get_many(option.key).map(|values| Value::Array(values.cloned().collect())),
                Values::One(_) | Values::Words(_) => matches.get_one(option.key).cloned(),
            };
            self.given.extend(value.map(|value| (option.key.to_owned(), value)));
        }
        Ok(())
    }
}

/// What `--preset` takes.
pub fn preset() -> impl TypedValueParser<Value = Preset> {
    one_of(Preset::WORDS).try_map(|name| Value::String(name).try_into::<Preset>())
}

fn in_help_order() -> Vec<&'static BakeOption> {
    let place = |key: &str| OPTIONS.iter().position(|option| option.key == key);
    let mut options: Vec<&BakeOption> = OPTIONS.iter().collect();
    options.sort_by_key(|option| (place(option.after.unwrap_or(option.key)), option.after.is_some()));
    options
}

fn flag(option: &BakeOption) -> Arg {
    let flag = Arg::new(option.key).long(option.flag()).value_name(option.value_name);
    let flag = flag.help(option.help()).help_heading(option.heading);
    match option.values {
        Values::One(read) => flag.value_parser(read).allow_negative_numbers(true),
        Values::Many(read) => flag.value_parser(read).action(ArgAction::Append).allow_hyphen_values(true),
        Values::Words(words) => flag.value_parser(one_of(words).map(Value::String)),
    }
}

fn one_of(words: &[Word]) -> PossibleValuesParser {
    words.iter().map(|&(name, help)| PossibleValue::new(name).help(help)).collect::<Vec<_>>().into()
}

fn gone(_: &str) -> Result<Value, String> {
    Err(FILL_IS_GONE.replace('`', "").replace("receivers;", "--receivers;"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_precompute::settings::{BakeSettings, UnwrapBackend};

    fn read(words: &[&str]) -> Table {
        let command = BakeFlags::augment_args(Command::new("bake").no_binary_name(true));
        let matches = command.try_get_matches_from(words).expect("valid flags");
        BakeFlags::from_arg_matches(&matches).expect("valid flags").given
    }

    #[test]
    fn every_option_has_a_flag_and_a_key_of_its_name() {
        let command = BakeFlags::augment_args(Command::new("bake"));
        let shown = command.get_arguments().filter(|flag| !flag.is_hide_set());
        let flags: Vec<(&str, String)> =
            shown.map(|flag| (flag.get_id().as_str(), flag.get_long().unwrap_or_default().to_owned())).collect();
        assert_eq!(flags.len(), OPTIONS.len());
        for option in OPTIONS {
            assert!(flags.contains(&(option.key, option.key.replace('_', "-"))), "{}", option.key);
            let value = match option.values {
                Values::One(_) => "1",
                Values::Many(_) => option.value_name,
                Values::Words(words) => words[0].0,
            };
            let value = ["X", "Y", "Z", "RADIUS"].iter().fold(value.to_owned(), |value, name| value.replace(name, "1"));
            let given = read(&[&format!("--{}", option.flag()), &value]);
            // Settings of the right type take it, be it in their range or not.
            let settings = Value::Table(given.clone()).try_into::<BakeSettings>();
            let read_back = settings.map(|settings| settings.to_toml().parse::<Table>().expect("TOML"));
            assert_eq!(read_back.expect("a key of this type")[option.key], given[option.key]);
        }
    }

    #[test]
    fn options_follow_those_that_they_name() {
        let order: Vec<&str> = in_help_order().iter().map(|option| option.key).collect();
        for option in OPTIONS.iter().filter(|option| option.after.is_some()) {
            let group = order.split(|&key| Some(key) == option.after).nth(1).expect("the option that it names");
            assert!(group.contains(&option.key), "{}", option.key);
        }
    }

    #[test]
    fn given_flags_reach_the_settings_and_no_others() {
        assert!(read(&[]).is_empty());
        let words = ["--interior", "-1,2,0.5", "--interior=0,0,0", "--unwrap", "xatlas", "--threshold", "0.01"];
        let flags = read(&words);
        assert_eq!(flags.len(), 3);
        let settings = BakeSettings::resolve(Preset::Production, None, &flags).expect("valid");
        assert_eq!(settings.interior, [[-1.0, 2.0, 0.5], [0.0; 3]]);
        assert_eq!((settings.unwrap, settings.threshold), (UnwrapBackend::Xatlas, 0.01));
    }
}
