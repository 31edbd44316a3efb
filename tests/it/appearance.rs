//! What a twin looks like: surfaces and textures from a rendered recording.

use paws_twin::appearance;
use paws_twin::config;
use paws_twin::export::{dress, gltf, mjcf, urdf, usd};
use paws_twin::look::Look;
use paws_twin::twin::Twin;

use crate::common::{SMALL, twin_of};

fn small() -> (Twin, Look) {
    let (recording, scene, twin) = twin_of(SMALL.path());
    assert_eq!(appearance::lacking(&recording), None);
    let config = config::Appearance { triangles: 20_000, ..Default::default() };
    let look = appearance::look(&recording, &scene, &twin, &config::Hands::default(), &config).unwrap();
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
    assert!((5000..=20_000 + 10 * twin.furniture.len()).contains(&room), "{room}");
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

/// Bytes that the look adds to each file of a kitchen: meshes of the URDF and the MJCF, pictures, the four formats.
fn added(twin: &Twin, look: &Look) -> [usize; 6] {
    let files = dress::files(twin, look).unwrap();
    let of = |end: &str| -> usize {
        files.iter().filter(|(name, _)| name.ends_with(end)).map(|(_, bytes)| bytes.len()).sum()
    };
    // A look's meshes may stand for more boxes than there are names of theirs.
    let more = |write: &dyn Fn(Option<&Look>) -> usize| write(Some(look)).saturating_sub(write(None));
    [
        of(".obj"),
        of(".png"),
        more(&|look| gltf::write(twin, look, &[]).unwrap().len()),
        // The package holds the text without its pictures' names, and the pictures.
        more(&|look| usd::write(twin, look).unwrap().len()),
        more(&|look| usd::write_package(twin, look).unwrap().len()),
        more(&|look| urdf::write(twin, look).unwrap().len() + mjcf::write(twin, look).unwrap().len()),
    ]
}

#[test]
fn a_look_costs_no_more_bytes_than_its_triangles_and_texels_are_worth() {
    let (twin, look) = small();
    let meshes = || look.room.iter().chain(look.parts.values().flatten());
    let triangles: usize = meshes().map(|m| m.triangles.len()).sum();
    let vertices: usize = meshes().map(|m| m.positions.len()).sum();
    let texels: usize = look.textures.iter().map(|t| t.rgb.len() / 3).sum();
    // A closed surface has half as many vertices as triangles; rims and seams between charts have theirs twice. With a chart for
    // each speck of noise there would be as many vertices as triangles, or twice as many.
    assert!(vertices * 4 < triangles * 3, "{vertices} vertices of {triangles} triangles");
    let [obj, png, glb, usda, usdz, named] = added(&twin, &look);
    // A vertex as text is a place (23 bytes) and a texture's coordinate (17), a triangle two numbers at three corners (36).
    assert!(obj < 44 * vertices + 40 * triangles, "{obj} bytes of {vertices} vertices, {triangles} triangles");
    // A photograph's pixel is two bytes in a PNG, a filled gap next to none.
    assert!(png < 2 * texels, "{png} bytes of {texels} texels");
    // 12 bytes of a place and of a normal, 4 of a texture's coordinate, three numbers of 2 or 4 bytes a triangle; a texel half a byte.
    assert!(glb < 28 * vertices + 12 * triangles + texels / 2 + 40_000, "{glb} bytes");
    // Places (24), normals (17) and coordinates (16); three numbers and a count a triangle.
    assert!(usda < 64 * vertices + 24 * triangles + 40_000, "{usda} bytes");
    assert!(usdz < usda + texels / 2 + 40_000, "{usdz} bytes, {usda} of them text");
    // Both name one and the same set of files.
    assert!(named < 10_000, "{named} bytes");
}
