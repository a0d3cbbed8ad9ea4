//! Points sorted into the cells of a regular grid, for all points within a distance.

use glam::{DVec3, Vec3};

/// Distances are f32 with errors of a few roundings; the box searched is larger by this share, so none is missed.
const MARGIN: f64 = 1e-6;

/// Points by cell. Results come in cell order, then by rising id.
pub(crate) struct PointGrid {
    low: DVec3,
    cell_m: f64,
    size: [usize; 3],
    /// `[n_cells + 1]`
    start: Vec<u32>,
    /// Id and position in cell order.
    points: Vec<(u32, Vec3)>,
}

impl PointGrid {
    /// Cells of about `cell_m` metres, larger where they would outnumber the points by far.
    pub(crate) fn new(points: &[Vec3], cell_m: f32) -> Self {
        let first = points.first().copied().unwrap_or_default();
        let (low, high) = points.iter().fold((first, first), |(low, high), &point| (low.min(point), high.max(point)));
        let (low, extent) = (low.as_dvec3(), high.as_dvec3() - low.as_dvec3());
        let most = 2.0 * points.len() as f64 + 64.0;
        let mut cell_m = f64::from(cell_m).max(extent.max_element() / most).max(f64::MIN_POSITIVE);
        let cells = |cell_m: f64| (extent / cell_m).floor() + 1.0;
        while cells(cell_m).element_product() > most {
            cell_m *= 1.25;
        }
        let size = cells(cell_m).to_array().map(|count| count as usize);
        let mut grid =
            Self { low, cell_m, size, start: vec![0; size.iter().product::<usize>() + 1], points: Vec::new() };
        let keys: Vec<usize> = points.iter().map(|&point| grid.index(grid.cell(point.as_dvec3()))).collect();
        for &key in &keys {
            grid.start[key + 1] += 1;
        }
        for cell in 1..grid.start.len() {
            grid.start[cell] += grid.start[cell - 1];
        }
        let mut next = grid.start.clone();
        grid.points = vec![(0, Vec3::ZERO); points.len()];
        for (id, (&point, &key)) in points.iter().zip(&keys).enumerate() {
            grid.points[next[key] as usize] = (id as u32, point);
            next[key] += 1;
        }
        grid
    }

    /// Calls `visit(id, distance)` for every point nearer than `radius_m`.
    pub(crate) fn for_each_within(&self, center: Vec3, radius_m: f32, mut visit: impl FnMut(u32, f32)) {
        let reach = f64::from(radius_m) * (1.0 + MARGIN);
        let low = self.cell(center.as_dvec3() - reach);
        let high = self.cell(center.as_dvec3() + reach);
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                // Cells of a row lie side by side.
                let first = self.start[self.index([low[0], y, z])] as usize;
                let end = self.start[self.index([high[0], y, z]) + 1] as usize;
                for &(id, point) in &self.points[first..end] {
                    let distance = point.distance(center);
                    if distance < radius_m {
                        visit(id, distance);
                    }
                }
            }
        }
    }

    /// The `count` smallest distances to points (all, if there are fewer), rising, into `distances`.
    pub(crate) fn nearest(&self, center: Vec3, count: usize, distances: &mut Vec<f32>) {
        let count = count.min(self.points.len());
        let mut radius_m = self.cell_m as f32;
        loop {
            distances.clear();
            self.for_each_within(center, radius_m, |_, distance| distances.push(distance));
            if distances.len() >= count {
                distances.sort_unstable_by(f32::total_cmp);
                distances.truncate(count);
                return;
            }
            if !radius_m.is_finite() {
                return;
            }
            radius_m *= 1.5;
        }
    }

    /// The cell of a position, clamped to the grid.
    fn cell(&self, position: DVec3) -> [usize; 3] {
        let cell = ((position - self.low) / self.cell_m).to_array();
        std::array::from_fn(|axis| (cell[axis].max(0.0) as usize).min(self.size[axis] - 1))
    }

    fn index(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.size[1] + cell[1]) * self.size[0] + cell[0]
    }
}
