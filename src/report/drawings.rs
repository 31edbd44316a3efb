//! A joint's proof as a picture: the recorded hand, the part that it moved in simulation, the best rival beside it.

use std::fmt::Write;

use super::phrases;
use super::table::wrapped;
use crate::articulation::JointKind;
use crate::inference::openings;
use crate::math::{Point, Vector, any_orthogonal, reject, unit};
use crate::twin::{Furniture, OrientedBox, Part, Role};
use crate::validation::{ClipCheck, JointCheck, Verdict};

/// Size of the picture, px.
const SIZE: [f64; 2] = [900.0, 420.0];
/// Left, top, width and height of the drawing and of the two plots.
const SCENE: [f64; 4] = [12.0, 76.0, 440.0, 300.0];
const OPENING: [f64; 4] = [520.0, 84.0, 364.0, 134.0];
const FORCE: [f64; 4] = [520.0, 254.0, 364.0, 122.0];

// Colours that stay apart for eyes that miss one of the three (Okabe and Ito's set); dashes and dots tell them apart too.
const HAND: &str = "#000000";
const PART: &str = "#0072b2";
const RIVAL: &str = "#d55e00";
const LIMIT: &str = "#767676";

/// The picture of a joint as SVG without references to anything outside it. The same check gives the same bytes.
#[must_use]
pub fn proof(furniture: &Furniture, check: &JointCheck) -> String {
    let part = &furniture.part;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w:.0} {h:.0}\" width=\"{w:.0}\" height=\"{h:.0}\" \
         font-family=\"system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif\" font-size=\"12\" fill=\"#1f2937\" \
         role=\"img\" aria-label=\"{label}\">\n<rect width=\"{w:.0}\" height=\"{h:.0}\" fill=\"#ffffff\"/>\n",
        w = SIZE[0],
        h = SIZE[1],
        label = escaped(&format!("{}: {}", check.id, check.verdict.word()))
    );
    head(&mut svg, part, check);
    // The clip that shows most; the others stand behind it.
    let main = check.clips.iter().reduce(|a, b| if b.observed_range > a.observed_range { b } else { a });
    if let Some(clip) = main {
        scene(&mut svg, furniture, check, clip);
        plots(&mut svg, part, clip);
        legend(&mut svg, check, clip);
    } else {
        text(&mut svg, [0.5 * SIZE[0], 0.5 * SIZE[1]], "middle", "#5b6472", "no recorded hand to replay");
    }
    svg += "</svg>\n";
    svg
}

/// Verdict, name and reason.
fn head(svg: &mut String, part: &Part, check: &JointCheck) {
    // Words as on the badges of the page, and a mark that needs no colour.
    let (mark, ink) = match check.verdict {
        Verdict::Pass => ("✓", "#166534"),
        Verdict::Fail => ("✗", "#991b1b"),
        Verdict::Undetermined => ("?", "#92400e"),
    };
    let title = format!("{mark} {}: {} ({}), {}", check.verdict.word(), part.label, check.id, kind_words(part));
    let _ = writeln!(
        svg,
        "<text x=\"12\" y=\"24\" font-size=\"16\" font-weight=\"600\" fill=\"{ink}\">{}</text>",
        escaped(&title)
    );
    for (i, line) in wrapped(&check.reason, 138).iter().take(2).enumerate() {
        text(svg, [12.0, 44.0 + 16.0 * i as f64], "start", "#374151", line);
    }
}

fn kind_words(part: &Part) -> String {
    let joint = &part.joint;
    format!("{} to {}", joint.articulation.kind.word(), phrases::amount(joint.articulation.kind, joint.upper))
}

/// Page right and page up in the world: a hinge is seen along its axis, a slide from its side.
fn view(part: &Part) -> [Vector; 2] {
    let [right, up, out] = [0, 1, 2].map(|i| part.bounds.rotation.column(i).into_owned());
    let joint = part.joint.articulation;
    let most = |d: &Vector| joint.axis.dot(d).abs();
    let hinge = joint.kind == JointKind::Revolute;
    let [x, y] = match (hinge, most(&up) >= most(&right), most(&out) > 0.7) {
        // About an axis that leaves the front: from in front.
        (true, _, true) => [right, up],
        // Upright hinges from above, the person below; level ones from the side.
        (true, true, false) => [right, -out],
        (true, false, false) => [out, up],
        // Drawers from the side, sliding doors from above, what is lifted from the side.
        (false, _, true) | (false, true, false) => [out, up],
        (false, false, false) => [right, -out],
    };
    if !hinge {
        return [x, y];
    }
    // Square to the axis: the hand's circle is one.
    let x = unit(&reject(&x, &joint.axis)).unwrap_or_else(|| any_orthogonal(&joint.axis));
    let side = joint.axis.cross(&x);
    [x, if side.dot(&y) >= 0.0 { side } else { -side }]
}

/// World to page.
struct Projection {
    axes: [Vector; 2],
    origin: Point,
    scale: f64,
    shift: [f64; 2],
}

impl Projection {
    /// That brings all points into a frame.
    fn fit(axes: [Vector; 2], points: &[Point], frame: [f64; 4]) -> Self {
        let origin = points.first().copied().unwrap_or_else(Point::origin);
        let bounds = axes.map(|axis| {
            points
                .iter()
                .map(|p| axis.dot(&(p - origin)))
                .fold((0f64, 0f64), |(low, high), x| (low.min(x), high.max(x)))
        });
        const RIM_PX: f64 = 8.0;
        let [width, height] = bounds.map(|(low, high)| (high - low).max(1e-3));
        let scale = ((frame[2] - 2.0 * RIM_PX) / width).min((frame[3] - 2.0 * RIM_PX) / height);
        let [x, y] = bounds.map(|(low, high)| 0.5 * scale * (low + high));
        let shift = [frame[0] + 0.5 * frame[2] - x, frame[1] + 0.5 * frame[3] + y];
        Self { axes, origin, scale, shift }
    }

    fn page(&self, p: &Point) -> [f64; 2] {
        let [x, y] = self.axes.map(|axis| axis.dot(&(p - self.origin)));
        [self.shift[0] + self.scale * x, self.shift[1] - self.scale * y]
    }

    fn path(&self, points: &[Point]) -> Vec<[f64; 2]> {
        points.iter().map(|p| self.page(p)).collect()
    }

    /// Outline of a box.
    fn outline(&self, shape: &OrientedBox) -> Vec<[f64; 2]> {
        hull(self.path(&shape.corners()))
    }
}

/// Furniture, paths and hinge.
fn scene(svg: &mut String, furniture: &Furniture, check: &JointCheck, clip: &ClipCheck) {
    let part = &furniture.part;
    let joint = part.joint.articulation;
    let opened = joint.motion(clip.replay.reached[1]);
    let rival = clip.rival.as_ref();
    let mut points: Vec<Point> = part.solids.iter().flat_map(|s| s.shape.corners()).collect();
    let open: Vec<OrientedBox> = part.solids.iter().map(|s| s.shape.moved(&opened)).collect();
    points.extend(open.iter().flat_map(OrientedBox::corners));
    points.extend(furniture.carcass.iter().flat_map(|s| s.shape.corners()));
    points.extend(&clip.replay.hand);
    points.extend(&clip.replay.handle);
    if joint.kind == JointKind::Revolute {
        points.push(joint.origin);
    }
    let to = Projection::fit(view(part), &points, SCENE);
    for solid in &furniture.carcass {
        shape(svg, &to.outline(&solid.shape), "fill=\"#d4d7dc\" stroke=\"#b6bbc3\" stroke-width=\"0.6\"");
    }
    // The handle on top of the front.
    let order = |role: Role| u8::from(role == Role::Handle);
    let mut solids: Vec<usize> = (0..part.solids.len()).collect();
    solids.sort_by_key(|&i| order(part.solids[i].role));
    for &i in &solids {
        let style = format!(
            "fill=\"{PART}\" fill-opacity=\"0.10\" stroke=\"{PART}\" stroke-width=\"0.8\" \
                             stroke-opacity=\"0.45\""
        );
        shape(svg, &to.outline(&open[i]), &style);
    }
    for &i in &solids {
        let style = format!("fill=\"#ffffff\" fill-opacity=\"0.6\" stroke=\"{PART}\" stroke-width=\"1.4\"");
        shape(svg, &to.outline(&part.solids[i].shape), &style);
    }
    for other in check.clips.iter().filter(|c| c.clip != clip.clip) {
        dots(svg, &to.path(&other.replay.hand), "#9aa1ab", 1.6);
    }
    if let Some(rival) = rival {
        line(svg, &to.path(&rival.handle), RIVAL, "stroke-width=\"2\" stroke-dasharray=\"7 4\"");
    }
    line(svg, &to.path(&clip.replay.handle), PART, "stroke-width=\"2.6\"");
    dots(svg, &to.path(&clip.replay.hand), HAND, 2.2);
    if joint.kind == JointKind::Revolute {
        let [x, y] = to.page(&joint.origin);
        let _ = writeln!(
            svg,
            "<circle cx=\"{}\" cy=\"{}\" r=\"5.5\" fill=\"{PART}\" stroke=\"#ffffff\" stroke-width=\"1.6\"/>",
            px(x),
            px(y)
        );
    }
    // Ten centimetres to measure with.
    let length = 0.1 * to.scale;
    let [x, y] = [SCENE[0] + SCENE[2] - 10.0, SCENE[1] + SCENE[3] - 4.0];
    line(svg, &[[x - length, y], [x, y]], LIMIT, "stroke-width=\"2\"");
    text(svg, [x, y - 5.0], "end", "#5b6472", "10 cm");
}

/// Opening and force over time.
fn plots(svg: &mut String, part: &Part, clip: &ClipCheck) {
    let replay = &clip.replay;
    let joint = part.joint.articulation;
    let (unit_word, factor) = match joint.kind {
        JointKind::Revolute => ("°", 180.0 / std::f64::consts::PI),
        JointKind::Prismatic => ("cm", 100.0),
    };
    let seconds = replay.trace.last().map_or(1.0, |t| t[0]).max(0.1);
    let times: Vec<f64> = replay.trace.iter().map(|t| t[0]).collect();
    let hand: Vec<f64> = openings(&joint, &replay.grip, &replay.hand).into_iter().map(|q| q * factor).collect();
    let moved: Vec<f64> = replay.trace.iter().map(|t| t[1] * factor).collect();
    let upper = part.joint.upper * factor;
    let low = hand.iter().chain(&moved).copied().fold(0.0, f64::min);
    let high = hand.iter().chain(&moved).copied().fold(upper, f64::max);
    let plot = Plot::new(OPENING, seconds, [low, high]);
    plot.frame(svg, &format!("opening ({unit_word})"), false);
    for (limit, name) in [(0.0, "closed"), (upper, "limit")] {
        let y = plot.y(limit);
        let ends = [[OPENING[0], y], [OPENING[0] + OPENING[2], y]];
        line(svg, &ends, LIMIT, "stroke-width=\"1\" stroke-dasharray=\"2 3\"");
        let baseline = if limit == 0.0 { y - 4.0 } else { y + 12.0 };
        text(svg, [OPENING[0] + OPENING[2] - 4.0, baseline], "end", LIMIT, name);
    }
    dots(svg, &plot.path(&times, &hand), HAND, 1.8);
    line(svg, &plot.path(&times, &moved), PART, "stroke-width=\"2.2\"");
    let force: Vec<f64> = replay.trace.iter().map(|t| t[2]).collect();
    let plot = Plot::new(FORCE, seconds, [0.0, force.iter().copied().fold(10.0, f64::max)]);
    plot.frame(svg, "force of the hand (N)", true);
    line(svg, &plot.path(&times, &force), PART, "stroke-width=\"2\"");
}

/// A plot over time.
struct Plot {
    frame: [f64; 4],
    seconds: f64,
    range: [f64; 2],
}

impl Plot {
    fn new(frame: [f64; 4], seconds: f64, range: [f64; 2]) -> Self {
        let span = (range[1] - range[0]).max(1e-6);
        Self { frame, seconds, range: [range[0] - 0.06 * span, range[1] + 0.06 * span] }
    }

    fn x(&self, t: f64) -> f64 {
        self.frame[0] + self.frame[2] * t / self.seconds
    }

    fn y(&self, value: f64) -> f64 {
        self.frame[1] + self.frame[3] * (self.range[1] - value) / (self.range[1] - self.range[0])
    }

    fn path(&self, times: &[f64], values: &[f64]) -> Vec<[f64; 2]> {
        times.iter().zip(values).map(|(t, v)| [self.x(*t), self.y(*v)]).collect()
    }

    /// Border, name, and round numbers on both axes.
    fn frame(&self, svg: &mut String, name: &str, with_time: bool) {
        let [x, y, w, h] = self.frame;
        let _ = writeln!(
            svg,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#d1d5db\"/>",
            px(x),
            px(y),
            px(w),
            px(h)
        );
        text(svg, [x, y - 6.0], "start", "#374151", name);
        let step = round_step((self.range[1] - self.range[0]) / 3.0);
        let mut value = (self.range[0] / step).ceil() * step;
        while value <= self.range[1] {
            let at = self.y(value);
            line(svg, &[[x - 4.0, at], [x, at]], "#9aa1ab", "stroke-width=\"1\"");
            text(svg, [x - 7.0, at + 4.0], "end", "#5b6472", &number(value, step));
            value += step;
        }
        if with_time {
            let step = round_step(self.seconds / 4.0);
            let mut t = 0.0;
            while t <= self.seconds + 1e-9 {
                text(svg, [self.x(t), y + h + 14.0], "middle", "#5b6472", &format!("{} s", number(t, step)));
                t += step;
            }
        }
    }
}

/// What the lines are.
fn legend(svg: &mut String, check: &JointCheck, clip: &ClipCheck) {
    let others = check.clips.len() - 1;
    let more = if others > 0 { format!(" (and {others} more, grey)") } else { String::new() };
    // Names of clips may be long.
    let name: String = match clip.clip.char_indices().nth(20) {
        Some((end, _)) => format!("{}…", &clip.clip[..end]),
        None => clip.clip.clone(),
    };
    let off = |rms_m: f64| format!("off by {}", phrases::centimetres(rms_m));
    let dotted = format!("stroke=\"{HAND}\" stroke-width=\"4.4\" stroke-linecap=\"round\" stroke-dasharray=\"0.1 8\"");
    let solid = format!("stroke=\"{PART}\" stroke-width=\"2.6\"");
    let mut entries = vec![
        (dotted, format!("recorded hand, {name}{more}")),
        (solid, format!("this joint, {}", off(clip.replay.rms_m))),
    ];
    if let Some(rival) = &clip.rival {
        let dashed = format!("stroke=\"{RIVAL}\" stroke-width=\"2\" stroke-dasharray=\"7 4\"");
        entries.push((dashed, format!("{}, {}", rival.name, off(rival.rms_m))));
    }
    let y = SIZE[1] - 14.0;
    let mut x = 14.0;
    for (style, entry) in entries {
        let _ = writeln!(svg, "<path d=\"M{} {} h24\" fill=\"none\" {style}/>", px(x), px(y - 4.0));
        text(svg, [x + 30.0, y], "start", "#374151", &entry);
        // A character of this size is about 6.3 px wide.
        x += 30.0 + 6.3 * entry.chars().count() as f64 + 20.0;
    }
}

/// 1, 2 or 5 times a power of ten, not below `x`.
fn round_step(x: f64) -> f64 {
    let power = 10f64.powf(x.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0].map(|m| m * power).into_iter().find(|s| *s >= x).unwrap_or(10.0 * power)
}

/// A number with the decimals of its step.
fn number(value: f64, step: f64) -> String {
    let decimals = if step >= 1.0 { 0 } else { (-step.log10()).ceil().max(0.0) as usize };
    unsigned_zero(format!("{value:.decimals$}"))
}

/// A length on the page.
fn px(x: f64) -> String {
    unsigned_zero(format!("{x:.1}"))
}

fn unsigned_zero(text: String) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        _ => text,
    }
}

fn pairs(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{},{}", px(*x), px(*y))).collect::<Vec<_>>().join(" ")
}

fn line(svg: &mut String, points: &[[f64; 2]], colour: &str, style: &str) {
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-linejoin=\"round\" {style}/>",
        pairs(points)
    );
}

fn shape(svg: &mut String, points: &[[f64; 2]], style: &str) {
    let _ = writeln!(svg, "<polygon points=\"{}\" {style}/>", pairs(points));
}

/// Dots as one path of round points: a fifth of the bytes of circles.
fn dots(svg: &mut String, points: &[[f64; 2]], colour: &str, radius: f64) {
    let moves: Vec<String> = points.iter().map(|[x, y]| format!("M{} {}h0", px(*x), px(*y))).collect();
    let _ = writeln!(
        svg,
        "<path d=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{}\" stroke-linecap=\"round\"/>",
        moves.concat(),
        px(2.0 * radius)
    );
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, colour: &str, words: &str) {
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" fill=\"{colour}\">{}</text>",
        px(x),
        px(y),
        escaped(words)
    );
}

/// Text that XML takes for text.
fn escaped(text: &str) -> String {
    text.chars()
        .filter(|c| !c.is_control())
        .map(|c| match c {
            '&' => "&amp;".to_owned(),
            '<' => "&lt;".to_owned(),
            '>' => "&gt;".to_owned(),
            '"' => "&quot;".to_owned(),
            other => other.to_string(),
        })
        .collect()
}

/// Convex hull, counter-clockwise in a frame with y up.
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut all = half_hull(points.iter().copied());
    all.extend(half_hull(points.iter().rev().copied()));
    all
}

/// The side of a convex hull that points in order pass on their left, without its last point.
fn half_hull(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut chain: Vec<[f64; 2]> = Vec::new();
    for p in points {
        while let [.., o, a] = chain.as_slice() {
            if (a[0] - o[0]) * (p[1] - o[1]) - (a[1] - o[1]) * (p[0] - o[0]) > 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(p);
    }
    chain.pop();
    chain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_seen_along_an_edge_is_a_rectangle_and_askew_a_hexagon() {
        let shape = OrientedBox {
            center: Point::origin(),
            half: Vector::new(0.3, 0.2, 0.1),
            rotation: nalgebra::Matrix3::identity(),
        };
        let seen = |x: Vector, y: Vector| {
            Projection { axes: [x, y], origin: Point::origin(), scale: 100.0, shift: [0.0; 2] }.outline(&shape)
        };
        let flat = seen(Vector::x(), Vector::y());
        assert_eq!(flat.len(), 4, "{flat:?}");
        let turn = nalgebra::Rotation3::from_euler_angles(0.5, 0.6, 0.7);
        assert_eq!(seen(turn * Vector::x(), turn * Vector::y()).len(), 6);
    }

    #[test]
    fn numbers_and_names_cannot_break_the_picture() {
        assert_eq!((px(-0.04), px(-1.26), number(0.0, 0.05)), ("0.0".to_owned(), "-1.3".to_owned(), "0.00".to_owned()));
        assert_eq!(escaped("<a \"b\"> & c\u{7}"), "&lt;a &quot;b&quot;&gt; &amp; c");
        assert_eq!([0.3, 1.0, 1.1, 7.0, 40.0].map(round_step), [0.5, 1.0, 2.0, 10.0, 50.0]);
        assert_eq!(wrapped("aa bb cc", 5), ["aa bb", "cc"]);
    }
}
