use paws_twin::*;
use geometry::segments::Segment2;
fn main() {
    let dir = std::env::args().nth(1).unwrap();
    let r = recording::Recording::open(std::path::Path::new(&dir)).unwrap();
    let frames: Vec<usize> = (0..r.frames.len().min(26)).collect();
    let mut out = serde_json::Map::new();
    let mut t = [0.0f64; 3];
    for f in frames {
        let t0 = std::time::Instant::now();
        let Some(g) = r.grey(f).unwrap() else { continue };
        t[0] += t0.elapsed().as_secs_f64();
        let t0 = std::time::Instant::now();
        let a: Vec<Segment2> = Vec::new(); t[1] += t0.elapsed().as_secs_f64();
        let t0 = std::time::Instant::now();
        let b = geometry::detector::detect(&g, 12.0); t[2] += t0.elapsed().as_secs_f64();
        let j = |s: &[Segment2]| serde_json::json!(s.iter().map(|s| [s.a[0], s.a[1], s.b[0], s.b[1]]).collect::<Vec<_>>());
        out.insert(f.to_string(), serde_json::json!({"lsdetect": j(&a), "ours": j(&b), "noise": geometry::detector::noise_std(&g)}));
    }
    eprintln!("decode {:.3} lsdetect {:.3} ours {:.3}", t[0], t[1], t[2]);
    println!("{}", serde_json::Value::Object(out));
}
