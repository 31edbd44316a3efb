//! A file's values over others, and the bounds of what a value can be.

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

/// Bounds beyond which a value is a slip of the hand, and would cost memory or time without end.
pub(super) fn sensible(row: &Row) -> [f64; 2] {
    match (row.key.as_str(), row.unit) {
        ("fitting.clearance_m" | "fitting.board_m", _) => [1e-4, 0.1],
        ("fitting.cell_m" | "localization.voxel_m", _) => [2e-3, 1.0],
        ("fitting.carcass_depth_m", _) => [0.15, 5.0],
        ("fitting.room_voxel_m", _) => [0.02, 1.0],
        // Depth is kept in 16-bit millimetres.
        ("appearance.depth_max_m", _) => [0.5, 65.0],
        ("appearance.voxel_m" | "appearance.texel_m", _) => [1e-3, 0.5],
        // Exposures are balanced between all of them at once.
        ("appearance.frames", _) => [1.0, 1000.0],
        (_, "triangles") => [100.0, 1e7],
        (_, "texels") => [1e4, 1e8],
        (_, "MB") => [16.0, 1e5],
        ("validation.step_secs", _) => [1e-4, 0.02],
        // Less would take the evidence for better than independent.
        ("reasoning.evidence_temperature" | "inference.shared_errors", _) => [1.0, 100.0],
        // More is a veto.
        ("validation.refuted_nats", _) => [1e-3, 20.0],
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
