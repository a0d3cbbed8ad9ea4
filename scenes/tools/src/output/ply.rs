//! Receivers as a binary point cloud.

use super::{OutputError, write_file};
use std::path::Path;

/// One receiver with its result.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReceiverVertex {
    /// World position, metres.
    pub position: [f32; 3],
    /// Unit shading normal.
    pub normal: [f32; 3],
    /// Indirect irradiance, linear RGB, W/m^2.
    pub irradiance: [f32; 3],
    /// Cosine-weighted share of directions whose surface neither a supporting probe sees nor a link reads.
    pub unseen: f32,
    /// The receiver's cluster.
    pub cluster: u32,
}

/// Writes receivers in their order as binary little-endian PLY: `x y z nx ny nz ir ig ib unseen` (f32), `cluster` (u32).
///
/// # Errors
/// [`OutputError`].
pub fn write_ply(path: &Path, vertices: &[ReceiverVertex]) -> Result<(), OutputError> {
    let mut bytes = Vec::with_capacity(512 + vertices.len() * 44);
    bytes.extend_from_slice(b"ply\nformat binary_little_endian 1.0\ncomment localprt receivers, metres and W/m^2\n");
    bytes.extend_from_slice(format!("element vertex {}\n", vertices.len()).as_bytes());
    for name in ["x", "y", "z", "nx", "ny", "nz", "ir", "ig", "ib", "unseen"] {
        bytes.extend_from_slice(format!("property float {name}\n").as_bytes());
    }
    bytes.extend_from_slice(b"property uint cluster\nend_header\n");
    for vertex in vertices {
        let floats = [vertex.position, vertex.normal, vertex.irradiance];
        for value in floats.as_flattened().iter().chain([&vertex.unseen]) {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
        bytes.extend_from_slice(&vertex.cluster.to_le_bytes());
    }
    write_file(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_follow_the_header_with_44_bytes_each() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.ply");
        let vertex = ReceiverVertex {
            position: [1.0, 2.0, 3.0],
            normal: [0.0, 1.0, 0.0],
            irradiance: [4.0, 5.0, 6.0],
            unseen: 0.25,
            cluster: 7,
        };
        write_ply(&path, &[ReceiverVertex::default(), vertex]).expect("written");
        let bytes = std::fs::read(&path).expect("read");
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|window| window == end).expect("a header") + end.len();
        let header = std::str::from_utf8(&bytes[..start]).expect("text");
        let names: Vec<&str> = header
            .lines()
            .filter(|line| line.starts_with("property"))
            .filter_map(|line| line.split(' ').nth(2))
            .collect();
        assert_eq!(names.join(" "), "x y z nx ny nz ir ig ib unseen cluster");
        assert!(header.contains("element vertex 2\n"));
        assert_eq!(bytes.len(), start + 2 * 44);
        let second: Vec<f32> = bytes[start + 44..]
            .chunks_exact(4)
            .map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]]))
            .collect();
        assert_eq!(second[..10], [1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 4.0, 5.0, 6.0, 0.25]);
        assert_eq!(second[10].to_bits(), 7);
    }
}
