//! A file's values over others, and what a value can be.

use super::Row;

/// Puts a file's values over others, table by table.
pub(super) fn overlay(under: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (under.get_mut(&key), value) {
            (Some(toml::Value::Table(under)), toml::Value::Table(over)) => overlay(under, over),
            (_, value) => {
                under.insert(key, value);
            }
        }
    }
}

/// What is wrong with a value that no step could work with, in words. Of a list each number is looked at; words, switches and
/// tables have checks of their own.
pub(super) fn wrong(row: &Row) -> Option<String> {
    let value = toml::from_str::<toml::Table>(&format!("value = {}", row.value)).ok()?.remove("value")?;
    let numbers: Vec<f64> = match &value {
        toml::Value::Array(all) => all.iter().filter_map(number).collect(),
        one => number(one).into_iter().collect(),
    };
    numbers.into_iter().find_map(|value| {
        if !value.is_finite() || value < 0.0 || (value == 0.0 && !may_be_zero(row)) {
            return Some(format!("{} = {} must be a positive finite number ({})", row.key, row.value, row.unit));
        }
        let [low, high] = sensible(row);
        (value != 0.0 && !(low..=high).contains(&value))
            .then(|| format!("{} = {} must lie between {low} and {high} ({})", row.key, row.value, row.unit))
    })
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

fn may_be_zero(row: &Row) -> bool {
    let keys = [
        "hands.restart_after",
        "hands.widen_secs",
        "hands.found.enough_nats",
        "localization.min_visible_share",
        "reasoning.vlm_temperature",
        "validation.grip_slack_m",
    ];
    keys.contains(&row.key.as_str()) || (row.key.starts_with("priors.") && ["share", "weight"].contains(&row.unit))
}

/// Bounds beyond which a value is a slip of the hand, and would cost memory or time without end.
fn sensible(row: &Row) -> [f64; 2] {
    match (row.key.as_str(), row.unit) {
        ("priors.boards.gap_m" | "priors.boards.thickness_m" | "priors.boards.tray_thickness_m", _) => [1e-4, 0.1],
        ("fitting.cell_m" | "localization.voxel_m", _) => [2e-3, 1.0],
        ("priors.boards.carcass_depth_m", _) => [0.15, 5.0],
        ("fitting.room_voxel_m", _) => [0.02, 1.0],
        ("fitting.room_solid_m", _) => [0.1, 5.0],
        ("fitting.room_box_thin_m" | "fitting.room_box_side_m", _) => [1e-3, 0.5],
        // Depth is kept in 16-bit millimetres.
        ("appearance.depth_max_m", _) => [0.5, 65.0],
        ("appearance.voxel_m" | "appearance.texel_m", _) => [1e-3, 0.5],
        // Exposures are balanced between all of them at once.
        ("appearance.frames", _) => [1.0, 1000.0],
        // Squares of them are asked about every joint.
        ("part.points.grid" | "part.leaf.points", _) => [1.0, 100.0],
        // Openings are tried step by step.
        ("part.openings.widest", _) => [0.1, 10.0],
        // Images are drawn larger by that much.
        ("comparison.rays", _) => [1.0, 8.0],
        ("comparison.page_mb", _) => [0.05, 20.0],
        (_, "triangles") => [100.0, 1e7],
        (_, "texels") => [1e4, 1e8],
        (_, "MB") => [16.0, 1e5],
        ("validation.step_secs", _) => [1e-4, 0.02],
        // Less would take the evidence for better than independent.
        ("reasoning.evidence_temperature" | "inference.shared_errors", _) => [1.0, 100.0],
        // More is a veto.
        ("validation.refuted_nats", _) => [1e-3, 20.0],
        // What one part is told of, no other one is.
        ("inference.same_part.told_of" | "inference.same_part.joins", _) => [0.5, 1.0],
        (_, "weight") => [0.0, 1.0],
        (_, "share") => [1e-9, 1.0 - 1e-9],
        (_, "m") => [1e-4, 100.0],
        (_, "s") => [1e-3, 100.0],
        (_, "deg") => [1e-2, 180.0],
        ("reasoning.vlm_lines_per_view", _) => [1.0, 9.0],
        (_, "px" | "frames" | "views" | "samples" | "lines" | "boxes") => [1.0, 1e4],
        (_, "tokens") => [1.0, 1e5],
        ("geometry.normals_per_frame", _) => [100.0, 1e6],
        (_, "-") => [1e-3, 1e4],
        _ => [1e-6, 1e6],
    }
}
