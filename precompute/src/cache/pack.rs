//! Arrays to the bytes of a record and back.

use bytemuck::{NoUninit, Pod, cast_slice};

/// Arrays as bytes, one after the other, each with its length.
#[derive(Default)]
pub struct Packer(Vec<u8>);

/// Arrays from bytes, in the order in which they were packed. A record that ends too early has nothing more.
pub struct Unpacker<'a>(&'a [u8]);

impl Packer {
    /// One array more.
    pub fn put<T: NoUninit>(&mut self, values: &[T]) -> &mut Self {
        self.0.extend((values.len() as u64).to_le_bytes());
        self.0.extend_from_slice(cast_slice(values));
        self
    }

    /// All of them.
    pub fn finish(self) -> Vec<u8> {
        self.0
    }
}

impl<'a> Unpacker<'a> {
    /// Of a record.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// The next array.
    pub fn take<T: Pod>(&mut self) -> Option<Vec<T>> {
        let (count, rest) = self.0.split_first_chunk()?;
        let bytes = usize::try_from(u64::from_le_bytes(*count)).ok()?.checked_mul(size_of::<T>())?;
        let (values, rest) = rest.split_at_checked(bytes)?;
        self.0 = rest;
        Some(bytemuck::pod_collect_to_vec(values))
    }

    /// The next array, which holds one value.
    pub fn one<T: Pod>(&mut self) -> Option<T> {
        self.take().filter(|values| values.len() == 1)?.pop()
    }

    /// Whether nothing is left.
    pub fn is_done(&self) -> bool {
        self.0.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_in_order_and_cut_records_end() {
        let mut packer = Packer::default();
        packer.put(&[1u32, 2, 3]).put::<f64>(&[]).put(&[[0.5f32, 1.5]]).put(&[7u8]);
        let bytes = packer.finish();
        let read = |bytes: &[u8]| {
            let mut unpacker = Unpacker::new(bytes);
            let all =
                (unpacker.take::<u32>()?, unpacker.take::<f64>()?, unpacker.one::<[f32; 2]>()?, unpacker.one::<u8>()?);
            unpacker.is_done().then_some(all)
        };
        assert_eq!(read(&bytes), Some((vec![1, 2, 3], vec![], [0.5, 1.5], 7)));
        assert!((0..bytes.len()).all(|length| read(&bytes[..length]).is_none()));
        let mut huge = bytes;
        huge[..8].fill(255);
        assert_eq!(read(&huge), None);
    }
}
