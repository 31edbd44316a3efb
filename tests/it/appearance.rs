//! What a twin looks like: surfaces and textures from a rendered recording.

use paws_twin::appearance;
use paws_twin::config;
use paws_twin::look::Look;

use crate::common::{SMALL, twin_of};

fn small() -> (paws_twin::twin::Twin, Look) {
    let (recording, scene, twin) = twin_of(SMALL.path());
    assert_eq!(appearance::lacking(&recording), None);
    let config = config::Appearance { triangles: 20_000, ..Default::default() };
    let look = appearance::look(&recording, &scene, &twin, &config).unwrap();
    (twin, look)
}

#[test]
fn a_look_has_the_room_and_every_part_and_only_what_can_be_drawn() {
    let (twin, look) = small();
    assert!(!twin.furniture.is_empty());
    for piece in &twin.furniture {
        let part = look.parts.get(&piece.part.id).unwrap_or_else(|| panic!("no mesh of {}", piece.part.id));
        // A front of which nothing was seen would be of one colour.
        assert!(part.iter().any(|mesh| mesh.seen > 0.03), "{}", piece.part.id);
        let boxes = piece.part.solids.len();
        assert_eq!(part.iter().map(|m| m.triangles.len()).sum::<usize>(), 12 * boxes);
    }
    let room: usize = look.room.iter().map(|m| m.triangles.len()).sum();
    // Frayed rims stay, so that the budget is an aim; the fused surface has several hundred thousand.
    assert!((5000..=80_000).contains(&room), "{room}");
    for mesh in look.room.iter().chain(look.parts.values().flatten()) {
        let vertices = mesh.positions.len();
        assert!(mesh.normals.len() == vertices && mesh.uv.len() == vertices);
        assert!(mesh.uv.iter().flatten().all(|c| (0.0..=1.0).contains(c)));
        assert!(mesh.triangles.iter().flatten().all(|v| (*v as usize) < vertices));
        assert!((0.0..=1.0).contains(&mesh.seen) && mesh.texture < look.textures.len());
    }
    for texture in &look.textures {
        assert!(texture.width <= 4096 && texture.height <= 4096);
        assert_eq!(texture.rgb.len(), 3 * texture.width as usize * texture.height as usize);
    }
}

#[test]
fn behind_a_front_there_is_no_second_front_of_the_room() {
    let (twin, look) = small();
    for piece in &twin.furniture {
        let front = &piece.part.solids[0].shape;
        let thin = front.half.imin();
        let within = |p: &paws_twin::math::Point| {
            let local = front.rotation.transpose() * (p - front.center);
            (0..3).all(|k| local[k].abs() < if k == thin { 0.03 } else { front.half[k] - 0.05 })
        };
        // Of a board of the size of this front there are thousands of vertices before simplification, some after.
        let seen = look.room.iter().filter(|m| m.seen > 0.0).flat_map(|m| &m.positions).filter(|p| within(p)).count();
        assert!(seen < 5, "{seen} vertices of the room in the front of {}", piece.part.id);
    }
}
