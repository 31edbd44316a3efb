use paws_twin::*;
fn main() {
    for dir in std::env::args().skip(1) {
    let r = recording::Recording::open(std::path::Path::new(&dir)).unwrap();
    let config = config::Config::default();
    let reasoner = reasoning::heuristic::Geometric { reasoning: config.reasoning.clone(), inference: config.inference.clone() };
    let scene = pipeline::infer(&r, &config, &geometry::segments::Lsd, &reasoner, &|_, _, _| {}).unwrap();
    let t = evaluation::Truth::read(std::path::Path::new(&dir)).unwrap();
    for c in &scene.clips {
        let Some(Some(tc)) = t.clips.get(&c.clip.clip) else { continue };
        if tc.kind == articulation::JointKind::Prismatic { continue }
        let Some(face) = c.face else { println!("{} no face", c.clip.clip); continue };
        let o = face.coordinates(&tc.origin);
        println!("{} {} views {} true hinge at right {:.3} up {:.3} out {:.3}; lines {}", dir, c.clip.clip, c.views.len(), o[0], o[1], o[2], c.lines.len());
        let mut m = r.clone(); m.depth_factors = scene.depth_factors.clone();
        let mut all = Vec::new();
        for v in scene.clips.iter().flat_map(|c| c.views.iter().copied()).collect::<std::collections::BTreeSet<_>>() { all.extend(geometry::segments::lift_view(&m, v, &geometry::segments::Lsd, &config.geometry, 0).unwrap().segments); }
        let near: Vec<_> = all.iter().filter(|s| math::unsigned_angle(&s.segment.line.direction, &tc.axis) < 0.15 && s.segment.line.distance(&tc.origin) < 0.1 && (s.segment.line.project(&tc.origin) - s.segment.middle()).norm() < 1.0).collect();
        println!("  segments {} near {}", all.len(), near.len());
        for s in near.iter().take(12) { let q = face.coordinates(&s.segment.line.project(&tc.origin)); println!("      v{} d right {:+.3} out {:+.3} ang {:.1} len {:.2} plane {:+.3}", s.view, q[0]-o[0], q[2]-o[2], math::unsigned_angle(&s.segment.line.direction, &tc.axis).to_degrees(), s.segment.length(), s.plane.dot(&(tc.origin - s.eye))); }
        let fl: Vec<_> = near.iter().copied().collect();
        for t in geometry::tracks::triangulated(&m, &fl, &config.geometry, 0) { let q = face.coordinates(&t.segment.line.project(&tc.origin)); println!("      track d right {:+.3} out {:+.3} views {} len {:.2}", q[0]-o[0], q[2]-o[2], t.views.len(), t.segment.length()); }
        let mut l: Vec<_> = c.lines.iter().filter(|l| math::unsigned_angle(&l.segment.line.direction, &tc.axis) < 0.1).map(|l| { let p = l.segment.line.project(&tc.origin); let q = face.coordinates(&p); ([q[0]-o[0], q[1]-o[1], q[2]-o[2]], l) }).collect();
        l.sort_by(|a, b| (a.0[0].hypot(a.0[1]).hypot(a.0[2])).total_cmp(&b.0[0].hypot(b.0[1]).hypot(b.0[2])));
        for (q, l) in l.iter().take(4) { println!("    d right {:+.3} up {:+.3} out {:+.3} views {} len {:.2} rms {:.4} std {:.4} ang {:.2}", q[0], q[1], q[2], l.views.len(), l.segment.length(), l.rms_m, l.position_std_m(), math::unsigned_angle(&l.segment.line.direction, &tc.axis).to_degrees()); }
    }
    }
}
