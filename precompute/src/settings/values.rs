//! Types that options have: how each is given and shown.

use toml::Value;

/// How the values of an option are given on the command line.
#[derive(Clone, Copy, Debug)]
pub enum Values {
    /// One, as text that this reads.
    One(fn(&str) -> Result<Value, String>),
    /// Any number of them, each as text that this reads.
    Many(fn(&str) -> Result<Value, String>),
    /// One of some words.
    Words(&'static [Word]),
}

/// A word that is the value of an option, and its text in `--help`.
pub type Word = (&'static str, &'static str);

/// A type that options have.
pub(super) trait OptionValue {
    const VALUES: Values;

    /// As `--help` shows it; `None` where nothing is given.
    fn shown(&self) -> Option<String>;

    fn is_absent(&self) -> bool {
        self.shown().is_none()
    }
}

macro_rules! numbers {
    ($($number:ty: $read:expr;)+) => {$(
        impl OptionValue for $number {
            const VALUES: Values = Values::One($read);

            fn shown(&self) -> Option<String> {
                Some(self.to_string())
            }
        }
    )+};
}

numbers! {
    f32: |text| text.parse::<f32>().map(Value::from).map_err(|error| error.to_string());
    u32: |text| text.parse::<u32>().map(Value::from).map_err(|_| "expected a whole number, such as 512".into());
    u64: |text| {
        let number: u64 = text.parse().map_err(|error: std::num::ParseIntError| error.to_string())?;
        // A TOML integer is an i64.
        i64::try_from(number).map(Value::from).map_err(|_| format!("{number} is not in 0..={}", i64::MAX))
    };
}

impl<T: OptionValue> OptionValue for Option<T> {
    const VALUES: Values = T::VALUES;

    fn shown(&self) -> Option<String> {
        self.as_ref().and_then(T::shown)
    }
}

/// Places and balls: exactly `N` numbers with commas between them.
impl<const N: usize> OptionValue for Vec<[f32; N]> {
    const VALUES: Values = Values::Many(|text| {
        let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
        numbers.filter(|numbers| numbers.len() == N).map(Value::from).ok_or_else(|| match N {
            3 => "expected three numbers in metres, such as 0,1.5,-2".into(),
            _ => "expected a place and a radius in metres, such as 0,1.5,-2,3".into(),
        })
    });

    fn shown(&self) -> Option<String> {
        (!self.is_empty()).then(|| format!("{self:?}"))
    }
}

/// Enumerations with a word for each variant. The first line of a variant's documentation is its text in `--help`.
macro_rules! words {
    ($(
        $(#[doc = $about:literal])+
        $words:ident { $(#[doc = $help:literal] $(#[doc = $more:literal])* $variant:ident = $name:literal,)+ }
    )+) => {$(
        $(#[doc = $about])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        pub enum $words {$(
            #[doc = $help]
            $(#[doc = $more])*
            #[serde(rename = $name)]
            $variant,
        )+}

        impl $words {
            /// All there are, in the order of the variants.
            pub const WORDS: &[$crate::settings::Word] = &[$(($name, $help.trim_ascii())),+];

            /// In a configuration file and on the command line.
            pub fn name(self) -> &'static str {
                Self::WORDS[self as usize].0
            }
        }

        impl $crate::settings::values::OptionValue for $words {
            const VALUES: $crate::settings::Values = $crate::settings::Values::Words(Self::WORDS);

            fn shown(&self) -> Option<String> {
                Some(self.name().into())
            }
        }
    )+};
}

pub(super) use words;

#[cfg(test)]
mod tests {
    use super::*;

    fn read<T: OptionValue>(text: &str) -> Result<Value, String> {
        match T::VALUES {
            Values::One(read) | Values::Many(read) => read(text),
            Values::Words(_) => unreachable!("no words here"),
        }
    }

    #[test]
    fn places_are_three_numbers_and_balls_four() {
        assert_eq!(read::<Vec<[f32; 3]>>("1, 2,3"), Ok(Value::from(vec![1.0, 2.0, 3.0])));
        for text in ["1,2", "1,2,3,4", "1,2,x", "", "1,2,3,"] {
            assert!(read::<Vec<[f32; 3]>>(text).is_err(), "{text}");
        }
        assert_eq!(read::<Vec<[f32; 4]>>("1,2,3,0.5"), Ok(Value::from(vec![1.0, 2.0, 3.0, 0.5])));
        assert!(read::<Vec<[f32; 4]>>("1,2,3").is_err());
    }

    #[test]
    fn whole_numbers_are_no_larger_than_toml_has_them() {
        assert_eq!(read::<u64>("9223372036854775807"), Ok(Value::from(i64::MAX)));
        assert!(read::<u64>("9223372036854775808").is_err());
        assert!(read::<u32>("4294967296").is_err());
    }
}
