//! Little-endian words of the child's pipes.

/// Appends words.
pub(super) fn push(bytes: &mut Vec<u8>, words: &[u32]) {
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
}

/// Reads words, never past the end.
pub(super) struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(super) fn next(&mut self) -> Option<u32> {
        let (word, rest) = self.0.split_first_chunk::<4>()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*word))
    }

    /// `count` groups of three words; nothing is allocated for more than there are.
    pub(super) fn triples(&mut self, count: usize) -> Option<Vec<[u32; 3]>> {
        let (taken, rest) = self.0.split_at_checked(count.checked_mul(12)?)?;
        self.0 = rest;
        let mut words = Words(taken);
        (0..count).map(|_| Some([words.next()?, words.next()?, words.next()?])).collect()
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }
}
