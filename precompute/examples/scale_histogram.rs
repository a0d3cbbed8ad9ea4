use localprt_precompute::{rays::RayCaster, scale::{self, LocalScale}};
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let most: usize = std::env::args().nth(2).map_or(15000, |s| s.parse().unwrap());
    let scene = if let Some(n) = path.strip_prefix("builtin:") { localprt_scenes::builtin::scene(n).unwrap() } else { localprt_scenes::load(path).unwrap() };
    let caster = RayCaster::new(&scene).unwrap();
    let samples = scale::measure(&caster, most);
    println!("samples {}", samples.len());
    let s = LocalScale::of(samples, scene.extent(), Vec::new());
    println!("finest {}", s.finest_m());
    let mut bins = vec![(0.0f64, 0.0f64, 0u32); 24];
    let bin = |r: f32| ((r.log2() + 8.0).floor().clamp(0.0, 23.0)) as usize;
    for x in s.samples() { bins[bin(s.at(x.position))].2 += 1; }
    for (mesh, triangle) in scene.faces() {
        let [a, b, c] = scene.corners(mesh, triangle);
        let area = f64::from(0.5 * (b - a).cross(c - a).length());
        let n = 32;
        for i in 0..n { for j in 0..n - i {
            let (u, v) = ((i as f32 + 0.33) / n as f32, (j as f32 + 0.33) / n as f32);
            let p = a * (1.0 - u - v) + b * u + c * v;
            let r = s.at(p);
            let w = area / f64::from(n * (n + 1) / 2);
            let e = &mut bins[bin(r)];
            e.0 += w; e.1 += w / f64::from(r).powi(2);
        } }
    }
    let t: (f64, f64) = bins.iter().fold((0.0, 0.0), |t, b| (t.0 + b.0, t.1 + b.1));
    for (i, b) in bins.iter().enumerate() { if b.0 > 0.0 || b.2 > 0 { println!("R {:8.3}  area {:5.1} %  demand {:5.1} %  samples {}", 2f64.powi(i as i32 - 8), 100.0 * b.0 / t.0, 100.0 * b.1 / t.1, b.2); } }
}
