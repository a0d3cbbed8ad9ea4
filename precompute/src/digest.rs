//! Digests of inputs: two results whose inputs have the same digest are the same.

use bytemuck::{NoUninit, bytes_of, cast_slice};

/// BLAKE3 of some inputs.
pub type Digest = [u8; 32];

/// Takes in one input after the other. Lengths count, so that no two sequences of inputs read alike.
#[derive(Clone, Default)]
pub struct Digester(blake3::Hasher);

impl Digester {
    /// For inputs of one kind, which has a name of its own.
    pub fn new(kind: &str) -> Self {
        let mut digester = Self::default();
        digester.all(kind.as_bytes());
        digester
    }

    /// One value.
    pub fn one<T: NoUninit>(&mut self, value: T) -> &mut Self {
        self.0.update(bytes_of(&value));
        self
    }

    /// A list of values, with its length.
    pub fn all<T: NoUninit>(&mut self, values: &[T]) -> &mut Self {
        self.one(values.len() as u64);
        self.0.update(cast_slice(values));
        self
    }

    /// Of all inputs so far.
    pub fn finish(&self) -> Digest {
        *self.0.finalize().as_bytes()
    }
}
