#!/usr/bin/env python3
"""A recording without what few devices give, to see what it costs:

    examples/without.py RECORDING OUT [--contact] [--clips] [--masks] [--depth [--points N]] [--images]

OUT holds links to RECORDING's files (read it with --follow-links). --contact takes every contact flag away, --clips the narrated
clips, --masks the masks, --depth depth and the normals that are made with it, --images the images and what is made of them. With
--points N the depth of a few frames leaves N points, as structure from motion finds them: most at edges and corners, the others where
surfaces may have texture, off by a centimetre and a hundredth of the distance along the ray. Without --images and with --masks --depth
what is left is images and hands; with all of them the hands alone. ground_truth.json stays, so that `paws evaluate` finds it.
"""

import argparse
import json
import random
import struct
import zlib
from pathlib import Path

FRAMES = 16  # frames whose depth leaves points
AT_EDGES = 0.7  # share of the points at edges
EDGE = 0.02  # an edge bends inverse depth by this share of it
FARTHEST_M = 4.0  # beyond it structure from motion keeps little
NOISE_M, NOISE_SHARE = 0.01, 0.01


def png(path: Path) -> tuple[int, int, list[list[int]]]:
    """Rows of an 8-bit or 16-bit grey PNG without interlacing."""
    data, at, packed = path.read_bytes(), 8, b""
    width = height = depth = 0
    while at < len(data):
        (size,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            if colour != 0 or depth not in (8, 16) or body[12] != 0:
                raise SystemExit(f"{path}: is no plain grey PNG")
        elif kind == b"IDAT":
            packed += body
        at += 12 + size
    raw, step = zlib.decompress(packed), depth // 8
    stride = width * step
    rows, before = [], bytearray(stride)
    for y in range(height):
        begin = y * (stride + 1)
        how, line = raw[begin], bytearray(raw[begin + 1 : begin + 1 + stride])
        for i in range(stride) if how else ():
            left = line[i - step] if i >= step else 0
            above, corner = before[i], before[i - step] if i >= step else 0
            if how == 4:
                guess = left + above - corner
                pick = min((abs(guess - left), 0, left), (abs(guess - above), 1, above), (abs(guess - corner), 2, corner))[2]
            else:
                pick = (0, left, above, (left + above) // 2)[how]
            line[i] = (line[i] + pick) & 255
        before = line
        rows.append(list(struct.unpack(f">{width}H", bytes(line))) if step == 2 else list(line))
    return width, height, rows


def turned(q: list[float], v: tuple[float, float, float]) -> list[float]:
    """v turned by the unit quaternion q (w x y z)."""
    w, x, y, z = q
    t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])]
    return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]]


def edges(depth: list[list[int]], mask: list[list[int]] | None, width: int, height: int) -> tuple[list, list]:
    """Pixels at edges of depth or of masks, and all others that have depth, hands left out."""
    at_edges, others = [], []
    for y in range(3, height - 3):
        for x in range(3, width - 3):
            if not depth[y][x] or (mask and mask[y][x] == 255):
                continue
            is_edge = mask is not None and (mask[y][x] != mask[y][x + 1] or mask[y][x] != mask[y + 1][x])
            for dx, dy in ((3, 0), (0, 3)):
                a, b = depth[y - dy][x - dx], depth[y + dy][x + dx]
                is_edge |= a > 0 and b > 0 and abs(0.5 / a + 0.5 / b - 1 / depth[y][x]) * depth[y][x] > EDGE
            (at_edges if is_edge else others).append((x, y))
    return at_edges, others


def points(recording: Path, count: int, draw: random.Random) -> list[list[float]]:
    """World points, metres, from the depth of frames without hands, spread over the recording."""
    cameras = json.loads((recording / "cameras.json").read_text())
    busy = {f["frame"] for f in json.loads((recording / "hands.json").read_text())["frames"] if f["hands"]}
    frames = [f for f in cameras["frames"] if f["frame"] not in busy and (recording / f"depth/{f['frame']:06}.png").exists()]
    frames = frames[:: max(1, len(frames) // FRAMES)][:FRAMES]
    out = []
    for frame in frames:
        name = f"{frame['frame']:06}.png"
        width, height, depth = png(recording / "depth" / name)
        mask = png(recording / "masks" / name)[2] if (recording / "masks" / name).exists() else None
        near = [row[:] for row in depth]
        for row in near:
            row[:] = [z if z < 1000 * FARTHEST_M else 0 for z in row]
        at_edges, others = edges(near, mask, width, height)
        share = count // len(frames) + 1
        chosen = draw.sample(at_edges, min(len(at_edges), round(AT_EDGES * share)))
        chosen += draw.sample(others, min(len(others), share - len(chosen)))
        for x, y in chosen:
            # An edge is the nearer surface's.
            z = 1e-3 * min(depth[v][u] for u in (x - 1, x, x + 1) for v in (y - 1, y, y + 1) if depth[v][u])
            z += draw.gauss(0, NOISE_M) + z * draw.gauss(0, NOISE_SHARE)
            ray = ((x - cameras["cx"]) / cameras["fx"] * z, (y - cameras["cy"]) / cameras["fy"] * z, z)
            out.append([a + b for a, b in zip(turned(frame["rotation_wxyz"], ray), frame["position"])])
    draw.shuffle(out)
    return out[:count]


def ply(cloud: list[list[float]]) -> str:
    head = ["ply", "format ascii 1.0", f"element vertex {len(cloud)}", *(f"property float {c}" for c in "xyz"), "end_header"]
    return "\n".join(head + [" ".join(f"{c:.4f}" for c in p) for p in cloud]) + "\n"


def without_flags(text: str) -> str:
    hands = json.loads(text)
    for frame in hands["frames"]:
        for hand in frame["hands"]:
            hand.pop("contact", None)
    return json.dumps(hands)


def without_files(text: str) -> str:
    cameras = json.loads(text)
    for frame in cameras["frames"]:
        frame.pop("file", None)
    return json.dumps(cameras)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    for name in ("contact", "clips", "masks", "depth", "images"):
        parser.add_argument(f"--{name}", action="store_true")
    parser.add_argument("--points", type=int, metavar="N", help="with --depth: points that are left of it (2000 to 20000)")
    parser.add_argument("--seed", type=int, default=0, help="of the points")
    args = parser.parse_args()
    if args.points and not args.depth:
        parser.error("--points are left of depth that is taken away: add --depth")
    left_out = {"clips.json"} if args.clips else set()
    left_out |= {"masks", "labels.json"} if args.masks else set()
    left_out |= {"depth", "normals", "reconstruction.ply", "reconstruction.obj"} if args.depth else set()
    left_out |= {"frames", "segments"} if args.images else set()
    changed = {"hands.json": without_flags} if args.contact else {}
    changed |= {"cameras.json": without_files} if args.images else {}
    args.out.mkdir(parents=True)
    source = args.recording.resolve()
    for path in sorted(source.iterdir()):
        if path.name in left_out:
            continue
        if path.name in changed:
            (args.out / path.name).write_text(changed[path.name](path.read_text()))
        else:
            (args.out / path.name).symlink_to(path)
    if args.points:
        (args.out / "reconstruction.ply").write_text(ply(points(source, args.points, random.Random(args.seed))))


if __name__ == "__main__":
    main()
