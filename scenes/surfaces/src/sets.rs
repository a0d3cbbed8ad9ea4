//! Disjoint sets of numbered things.

/// Disjoint sets of faces, named by their lowest member.
pub struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    /// Every face on its own.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// Lowest face of a face's set.
    pub fn lowest(&mut self, face: u32) -> u32 {
        let mut face = face;
        while self.parent[face as usize] != face {
            // Halving the path keeps later walks short.
            self.parent[face as usize] = self.parent[self.parent[face as usize] as usize];
            face = self.parent[face as usize];
        }
        face
    }

    /// Makes one set of two.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.lowest(a), self.lowest(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
