//! Results by method.

use super::{METHODS, Method};
use serde::{Serialize, Serializer};

/// A result of each of [`METHODS`], in that order.
#[derive(Clone, Debug)]
pub struct ByMethod<T>(Vec<T>);

impl<T> ByMethod<T> {
    /// Takes the results of [`METHODS`].
    ///
    /// # Panics
    /// Unless there is one of each.
    pub fn new(results: Vec<T>) -> Self {
        assert_eq!(results.len(), METHODS.len(), "a result of each method");
        Self(results)
    }

    /// All results.
    pub fn iter(&self) -> impl Iterator<Item = (&'static Method, &T)> {
        METHODS.iter().copied().zip(&self.0)
    }

    /// The result of one method.
    ///
    /// # Panics
    /// If it is not among [`METHODS`].
    pub fn of(&self, method: &Method) -> &T {
        let found = self.iter().find(|(other, _)| other.name == method.name);
        found.unwrap_or_else(|| panic!("{} is among the methods", method.name)).1
    }

    /// Makes others of them.
    pub fn map<R>(&self, of: impl FnMut(&T) -> R) -> ByMethod<R> {
        ByMethod(self.0.iter().map(of).collect())
    }
}

impl<T: Serialize> Serialize for ByMethod<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.iter().map(|(method, result)| (method.name, result)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{COMPRESSED, PAPER};
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn results_are_found_by_name_and_written_in_order() {
        let lengths = ByMethod::new(METHODS.iter().map(|method| method.name.len()).collect());
        assert_eq!((*lengths.of(&COMPRESSED), *lengths.map(|length| 2 * length).of(&PAPER)), (10, 10));
        let expected = r#"{"compressed":10,"uncompressed":12,"without_links":13,"spatial":7,"arikan":6,"paper":5}"#;
        assert_eq!(serde_json::to_string(&lengths).expect("JSON"), expected);
    }

    #[test]
    fn no_two_methods_share_a_name_or_a_picture() {
        for of in [|method: &Method| method.name, |method: &Method| method.label] {
            assert_eq!(METHODS.iter().map(|method| of(method)).collect::<HashSet<_>>().len(), METHODS.len());
        }
    }
}
