#!/usr/bin/env python3
"""Open3D's fusion of a recording's frames: voxels of 1 cm, colours at the vertices.

    looks_open3d.py RECORDING COMPARISON.json OUT.ply

COMPARISON.json is of `paws compare --json`: it names the frames in which everything is closed and nobody works. Of these as many
are fused as a twin is made of, evenly. Hands are left out by their masks. Needs open3d.
"""
import json
import sys
from pathlib import Path

import numpy as np
import open3d as o3d

FRAMES = 150  # as `appearance.frames`
VOXEL_M = 0.01  # as `appearance.voxel_m`
TRUNCATION_M = 0.04  # as `appearance.truncation_m`
DEPTH_MAX_M = 5.0  # as `appearance.depth_max_m`
HAND = 255  # the class of hands in masks


def rotation(w, x, y, z):
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def main(recording, comparison, out):
    recording = Path(recording)
    cameras = json.loads((recording / "cameras.json").read_text())
    lens = [cameras[key] for key in ("width", "height", "fx", "fy", "cx", "cy")]
    intrinsic = np.array([[lens[2], 0, lens[4]], [0, lens[3], lens[5]], [0, 0, 1]], dtype=np.float64)
    matrix, image = o3d.core.Tensor, o3d.t.geometry.Image
    closed = json.loads(Path(comparison).read_text())["closed_frames"]
    count = min(FRAMES, len(closed))
    chosen = [closed[(2 * i + 1) * len(closed) // (2 * count)] for i in range(count)]
    volume = o3d.t.geometry.VoxelBlockGrid(
        attr_names=("tsdf", "weight", "color"),
        attr_dtypes=(o3d.core.float32, o3d.core.float32, o3d.core.float32),
        attr_channels=((1), (1), (3)),
        voxel_size=VOXEL_M,
        block_count=40_000,
    )
    # Its truncation is a multiple of the voxel.
    truncation = TRUNCATION_M / VOXEL_M
    fused = 0
    for number in chosen:
        frame = cameras["frames"][number]
        depth_file = recording / "depth" / f"{number:06}.png"
        if not depth_file.is_file():
            continue
        color = np.asarray(o3d.io.read_image(str(recording / frame["file"]))).astype(np.float32) / 255.0
        depth = np.asarray(o3d.io.read_image(str(depth_file))).astype(np.float32)
        mask_file = recording / "masks" / f"{number:06}.png"
        if mask_file.is_file():
            depth[np.asarray(o3d.io.read_image(str(mask_file))) == HAND] = 0
        world_from_camera = np.eye(4)
        world_from_camera[:3, :3] = rotation(*frame["rotation_wxyz"])
        world_from_camera[:3, 3] = frame["position"]
        pose = matrix(np.ascontiguousarray(np.linalg.inv(world_from_camera)))
        lens_matrix, depth, color = matrix(intrinsic), image(matrix(depth)), image(matrix(np.ascontiguousarray(color)))
        blocks = volume.compute_unique_block_coordinates(depth, lens_matrix, pose, 1000.0, DEPTH_MAX_M, truncation)
        volume.integrate(blocks, depth, color, lens_matrix, pose, 1000.0, DEPTH_MAX_M, truncation)
        fused += 1
    mesh = volume.extract_triangle_mesh().to_legacy()
    o3d.io.write_triangle_mesh(str(out), mesh)
    print(f"Open3D: {fused} frames, {len(mesh.triangles)} triangles", file=sys.stderr)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
