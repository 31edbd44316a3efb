//! The `paws` command.
use paws_twin::*;
use std::path::PathBuf;
fn main() -> anyhow::Result<()> {
    let mut preds = vec![];
    let mut truths = vec![];
    for a in std::env::args().skip(1) {
        let t0 = std::time::Instant::now();
        let p = PathBuf::from(a);
        let r = recording::Recording::open(&p)?;
        let c = config::Config::default();
        let re = reasoning::heuristic::Geometric { reasoning: c.reasoning.clone(), inference: c.inference.clone() };
        let s = pipeline::infer(&r, &c, &geometry::segments::Lsd, &re, &|_, _, _| {})?;
        let tw = fitting::fit(&s, &r.up(), &c.fitting);
        println!("== {} {:?} room {:?}", r.name, t0.elapsed(), s.manhattan);
        for c in &s.clips {
            println!(
                "{} {:30} {}",
                c.clip.clip,
                c.clip.narration,
                match &c.joint {
                    articulation::Outcome::Found(j) => format!(
                        "{:?} axis {:.2?} src {:?} pt {:.2} pa {:.2} res {:.3} inl {:.2} r {:?} range {:.2} part {:?} face {:?} lines {} vox {} view {}",
                        j.joint.kind,
                        j.joint.axis.as_slice(),
                        j.source,
                        j.type_probability,
                        j.axis_probability,
                        j.residual_m,
                        j.inliers,
                        j.radius_m.map(|x| (x * 100.).round()),
                        j.observed_range,
                        c.part.map(|p| p.bounds.map(|b| b.map(|x| (x * 100.).round()))),
                        c.face.map(|f| (f.support * 100.).round()),
                        c.lines.len(),
                        c.region.as_ref().map_or(0, |r| r.voxels.len()),
                        c.views.len()
                    ),
                    articulation::Outcome::Abstained(r) => r.clone(),
                }
            );
        }
        for j in &s.joints {
            println!("{} {:?} {:?}", j.id, j.joint.kind, j.clips);
        }
        preds.extend(report::files::predictions(&s, &tw).predictions);
        truths.push(evaluation::Truth::read(&p)?);
    }
    let rep = evaluation::evaluate(&evaluation::Predictions { predictions: preds }, &truths);
    for c in &rep.per_clip {
        println!(
            "{} {} {} {}",
            c.recording,
            c.clip,
            c.joint,
            match &c.measured {
                Some(m) => format!(
                    "{} axis {:.1} signed {:.1} p2p {:.2} piv {:.2} o2l {:.3} t2l {:.3} range {:?} iou {:.2}",
                    m.type_right,
                    m.axis_rad.to_degrees(),
                    m.signed_axis_rad.to_degrees(),
                    m.point_to_point_m.unwrap_or(9.),
                    m.pivot_to_pivot_m.unwrap_or(9.),
                    m.origin_to_line_m.unwrap_or(9.),
                    m.truth_to_line_m.unwrap_or(9.),
                    m.range_error,
                    m.box_iou.unwrap_or(0.)
                ),
                None => format!("- {:?}", c.reason),
            }
        );
    }
    println!("match {:.2} distractors {} fp {}", rep.match_share, rep.distractors, rep.false_positives);
    for r in &rep.rules {
        println!("{:?} {:?} cond {:?}", r.rule, r.micro, r.micro_conditional);
    }
    Ok(())
}
