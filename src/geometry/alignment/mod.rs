//! Where the world of one recording lies in that of others of the same place (ours).
//!
//! Up is +Z in all worlds, so a turn about it and a shift are unknown. Surfaces tell them: the headings of upright ones leave a
//! few turns, the heights of level ones a few lifts, and for each pair of the two a vote of all pairs of surface points leaves
//! a few shifts ([`search`]). Each is refined by point-to-plane ICP ([`icp`]) and judged by what the cameras of either recording
//! see where the other one has surfaces: the same ones, or through them ([`Map::meeting`]). An alignment has to be good, and
//! clearly better than every other one: a row of equal fronts fits itself in many places. Kitchens are built to the same measures,
//! so that most surfaces of another one may meet, too; where there are images, how bright the surfaces are has to go together.

mod icp;
mod map;
mod search;

pub use map::{Map, map_of};

use rayon::prelude::*;

use crate::config;
use crate::math::{Pose, Vector};
use crate::recording::videos::Placement;
use map::Meeting;

/// Where a recording lies: the world of the map from its own, and how that is known; else why it is not known, in words.
///
/// # Errors
/// In words: where no alignment is good, or none is clearly the best.
pub fn place(scene: &Map, own: &Map, config: &config::Alignment) -> std::result::Result<(Pose, Placement), String> {
    let rules = &config.judging;
    if scene.is_small(rules) || own.is_small(rules) {
        return Err(
            "too little depth shows surfaces to align by; where the worlds are the same, say --one-frame".to_owned()
        );
    }
    let nearest = icp::Index::of(scene.surfels(), &config.icp);
    let as_it_is = scene.meeting(own, &Pose::identity(), &nearest, rules);
    if is_good(&as_it_is, config) && as_it_is.score(rules) >= config.least_lead {
        let refined = nearest.refined(own.surfels(), Pose::identity());
        if is_near_identity(own, &refined, config) {
            return Ok((Pose::identity(), Placement::SameWorld(as_it_is.fit(None, rules))));
        }
    }
    let mut starts = search::candidates(scene.surfels(), own.surfels(), &config.search);
    starts.push(Pose::identity());
    let mut found: Vec<(Pose, Meeting)> = starts
        .par_iter()
        .map(|start| {
            let pose = nearest.refined(own.surfels(), *start);
            (pose, scene.meeting(own, &pose, &nearest, rules))
        })
        .collect();
    found.sort_by(|a, b| b.1.score(rules).total_cmp(&a.1.score(rules)));
    let Some((best, meeting)) = found.first() else { return Err("no alignment was found".to_owned()) };
    let rival = found.iter().find(|(pose, _)| is_another(own, best, pose, config));
    // What contradicts itself more than it agrees is no rival.
    let lead = meeting.score(rules) - rival.map_or(0.0, |(_, m)| m.score(rules)).max(0.0);
    if let Some(why) = refusal(meeting, lead, config) {
        return Err(format!("{why}: {}", meeting.fit(Some(lead), rules).words()));
    }
    if is_near_identity(own, best, config) {
        let meeting = scene.meeting(own, &Pose::identity(), &nearest, rules);
        return Ok((Pose::identity(), Placement::SameWorld(meeting.fit(Some(lead), rules))));
    }
    Ok((*best, Placement::Aligned(meeting.fit(Some(lead), rules))))
}

/// Why the best alignment is none, in words.
fn refusal(meeting: &Meeting, lead: f64, config: &config::Alignment) -> Option<String> {
    if !is_good(meeting, config) {
        let [agree, overlap] = [config.least_agreement, config.least_overlap].map(|share| 100.0 * share);
        return Some(format!(
            "not the same place, or seen too differently, even at the best alignment ({agree:.0} % have to agree, {overlap:.0} % to \
             overlap)"
        ));
    }
    if let Some(likeness) = meeting.likeness(&config.judging).filter(|likeness| *likeness < config.least_likeness) {
        let needed = config.least_likeness;
        return Some(format!(
            "not the same place, or in another light: the brightness of what both see goes together by {likeness:.2}, not by \
             {needed:.2}"
        ));
    }
    let needed = config.least_lead;
    (lead < needed).then(|| {
        format!("no alignment is clearly the best ({needed:.2} ahead are needed; where the worlds are the same, say --one-frame)")
    })
}

/// Whether two recordings show the same surfaces.
fn is_good(meeting: &Meeting, config: &config::Alignment) -> bool {
    meeting.agreement() >= config.least_agreement && meeting.overlap() >= config.least_overlap
}

/// How two alignments of one recording differ: by its middle's place, metres, and by their turn, radians.
fn difference(own: &Map, a: &Pose, b: &Pose) -> [f64; 2] {
    let middle = own.middle();
    [(a * middle - b * middle).norm(), a.rotation.angle_to(&b.rotation)]
}

/// Whether worlds are the same to within what surfaces tell.
fn is_near_identity(own: &Map, pose: &Pose, config: &config::Alignment) -> bool {
    let [shift, turn] = difference(own, pose, &Pose::identity());
    shift <= config.same_world_m && turn <= config.same_world_deg.to_radians()
}

/// Whether two alignments are two answers, not one with an error.
fn is_another(own: &Map, a: &Pose, b: &Pose, config: &config::Alignment) -> bool {
    let [shift, turn] = difference(own, a, b);
    shift > config.rival_m || turn > config.rival_deg.to_radians()
}

/// A turn about the vertical through `about`, then a shift.
fn turned(about: &Vector, angle: f64, shift: &Vector) -> Pose {
    let turn = crate::math::rotation(&Vector::z(), angle);
    Pose::from_parts((about + shift - turn * about).into(), turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point, rotation};
    use crate::recording::sketch::Sketch;
    use crate::recording::{Camera, Grid};

    const CAMERA: Camera = Camera { width: 160, height: 120, fx: 90.0, fy: 90.0, cx: 79.5, cy: 59.5 };

    /// Low and high corner of an upright box.
    type Block = [[f64; 3]; 2];

    /// A row of base units with a fridge at its end, an island, and a shelf on another wall; the first box is the room.
    const KITCHEN: [Block; 5] = [
        [[0.0, 0.0, 0.0], [4.0, 3.0, 2.5]],
        [[0.5, 0.0, 0.0], [1.9, 0.6, 0.9]],
        [[1.9, 0.0, 0.0], [2.5, 0.65, 1.9]],
        [[2.8, 1.8, 0.0], [3.6, 2.4, 0.9]],
        [[0.0, 1.2, 1.4], [0.35, 2.2, 2.0]],
    ];

    /// Another kitchen, as much furniture of the same heights.
    const OTHER: [Block; 5] = [
        [[0.0, 0.0, 0.0], [3.3, 3.6, 2.4]],
        [[0.0, 0.0, 0.0], [0.6, 2.2, 0.9]],
        [[0.0, 2.6, 0.0], [0.65, 3.2, 1.9]],
        [[1.2, 0.0, 0.0], [2.6, 0.6, 0.9]],
        [[2.9, 1.0, 1.3], [3.3, 2.4, 1.9]],
    ];

    /// Depth at which a ray with a direction per metre of depth enters a box, or leaves it.
    fn hit(block: &Block, eye: &Point, ray: &Vector, leaves: bool) -> Option<f64> {
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            let [a, b] = [0, 1].map(|end| (block[end][k] - eye[k]) / ray[k]);
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        }
        let at = if leaves { leave } else { enter };
        (enter < leave && at > 0.0).then_some(at)
    }

    fn looking(eye: Point, at: Point) -> Pose {
        let forward = (at - eye).normalize();
        let right = forward.cross(&Vector::z()).normalize();
        let axes = nalgebra::Matrix3::from_columns(&[right, forward.cross(&right), forward]);
        let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(axes));
        Pose::from_parts(eye.coords.into(), turn)
    }

    /// What is seen of a kitchen from ten places, in a world of its own.
    fn seen(blocks: &[Block], own_from_kitchen: &Pose, shift: f64) -> Map {
        let views = (0..10).map(|i| {
            let along = f64::from(i) / 9.0;
            let eye = Point::new(1.0 + 1.6 * along + shift, 1.1 + 0.5 * along - shift, 1.6);
            let about = 0.7 * f64::from(i);
            let pose = looking(eye, eye + Vector::new(about.cos(), about.sin(), -0.35));
            let mut depth = Grid::filled(CAMERA.width, CAMERA.height, 0.0f32);
            for (i, z) in depth.data.iter_mut().enumerate() {
                let (u, v) = ((i % CAMERA.width) as f64, (i / CAMERA.width) as f64);
                let ray = pose.rotation * CAMERA.unproject(u, v, 1.0).coords;
                let hits = blocks.iter().enumerate().filter_map(|(b, block)| hit(block, &eye, &ray, b == 0));
                *z = hits.fold(f64::INFINITY, f64::min) as f32;
            }
            (Sketch::of(0, &depth, None), CAMERA, own_from_kitchen * pose)
        });
        Map::of_views(views.collect(), config::Alignment::default().voxel_m)
    }

    #[test]
    fn a_turned_and_moved_world_is_found_to_a_centimetre_and_another_kitchen_in_none() {
        let config = config::Alignment::default();
        let scene = seen(&KITCHEN, &Pose::identity(), 0.0);
        for (turn, shift) in [(2.0, [1.3, -2.1, 0.4]), (-0.4, [30.0, 5.0, -1.0])] {
            let own_from_kitchen = Pose::from_parts(Vector::from(shift).into(), rotation(&Vector::z(), turn));
            let own = seen(&KITCHEN, &own_from_kitchen, 0.15);
            let (pose, placement) = place(&scene, &own, &config).unwrap();
            let off = own_from_kitchen * pose;
            assert!(off.rotation.angle().to_degrees() < 0.5, "{}", off.rotation.angle().to_degrees());
            let middle = Point::new(2.0, 1.5, 1.0);
            let from = own_from_kitchen * middle;
            assert!((pose * from - middle).norm() < 0.015, "{}", (pose * from - middle).norm());
            assert!(matches!(placement, Placement::Aligned(fit) if fit.agreement > 0.9), "{placement:?}");
            let other = place(&scene, &seen(&OTHER, &own_from_kitchen, 0.15), &config);
            assert!(other.is_err(), "{other:?}");
        }
    }

    #[test]
    fn one_world_stays_as_it_is() {
        let [a, b] = [0.0, 0.2].map(|shift| seen(&KITCHEN, &Pose::identity(), shift));
        let (pose, placement) = place(&a, &b, &config::Alignment::default()).unwrap();
        assert_eq!(pose, Pose::identity());
        assert!(matches!(placement, Placement::SameWorld(_)), "{placement:?}");
    }

    #[test]
    fn without_surfaces_nothing_is_aligned_and_the_way_out_is_told() {
        let scene = seen(&KITCHEN, &Pose::identity(), 0.0);
        let told = place(&scene, &Map::default(), &config::Alignment::default()).unwrap_err();
        assert!(told.contains("--one-frame"), "{told}");
    }

    #[test]
    fn a_map_that_takes_others_in_keeps_its_size() {
        let config = config::Alignment { most_views: 12, ..config::Alignment::default() };
        let mut scene = seen(&KITCHEN, &Pose::identity(), 0.0);
        let before = scene.surfels().len();
        for shift in [0.05, 0.1, 0.15] {
            scene.take_in(&seen(&KITCHEN, &Pose::identity(), shift), &Pose::identity(), &config);
        }
        assert!(scene.surfels().len() < 2 * before);
        assert_eq!(scene.views(), 12);
    }
}
