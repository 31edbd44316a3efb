#!/usr/bin/env python3
"""Writes the seeds of the `import-NAME` targets: one small source of each format, packed into one file each.

fuzz/seeds.py [--paws PROGRAM] [--only NAME]

A source is the walk of three poses of a camera of 16 x 12 pixels, with two images, depth, a hand and words, as far as the format
has them, written as `tests/it/import_*.rs` writes its kitchens. HDF5 needs h5py: without it the seeds of `egodex` and `stera` stay
as they are. With a PROGRAM each source is read by `paws import` as well, and what is refused is told. Other seeds of the folders
(inputs that broke something, say) stay.
"""

import argparse
import gzip
import io
import json
import struct
import subprocess
import sys
import tempfile
import zipfile
import zlib
from pathlib import Path

HERE = Path(__file__).resolve().parent
W, H = 16, 12
FX, CX, CY = 20.0, 7.5, 5.5
FRAMES = 3
SIDE = "right"
# Joints of a hand, and what stands for them where only tips matter.
JOINTS = [[0.1 + 0.004 * i, 0.02 * (i % 5), 0.8] for i in range(21)]
TIMES = [100.0 + 0.1 * i for i in range(FRAMES)]
OPENCV = [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 1.5], [0, 0, 0, 1]]


# ---- what sources are made of ----


def rows(i, axes=OPENCV):
    """world_from_camera of a frame, 4 x 4: level, a tenth of a metre further along x each frame."""
    out = [list(map(float, row)) for row in axes]
    out[0][3] = 0.1 * i
    return out


def opengl(i):
    """The same of a camera with OpenGL axes."""
    return [[r[0], -r[1], -r[2], r[3]] for r in rows(i)[:3]] + [[0.0, 0.0, 0.0, 1.0]]


def column_major(m):
    return [m[r][c] for c in range(4) for r in range(4)]


def moved(x, y, z):
    return [[1.0, 0, 0, x], [0, 1.0, 0, y], [0, 0, 1.0, z], [0, 0, 0, 1.0]]


def png(width, height, bits, channels, data):
    """A PNG of grey (1 channel) or colour (3) with 8 or 16 bits."""
    stride = width * channels * bits // 8
    packed = zlib.compress(b"".join(b"\0" + data[y * stride : (y + 1) * stride] for y in range(height)), 9)

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, bits, 2 if channels == 3 else 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


DEPTH = png(W, H, 16, 1, struct.pack(">H", 1500) * (W * H))
SURE = png(W, H, 8, 1, b"\x02" * (W * H))
COLOR = png(W, H, 8, 3, bytes(range(48)) * (W * H // 16))
JPG = (HERE / "corpus/picture/rgb.jpg").read_bytes()
# The first byte says how the target `depth` reads it.
EXR = (HERE / "corpus/depth/exr_zip.bin").read_bytes()[1:]
METRES = struct.pack("<f", 1.5) * (W * H)


def text(*lines):
    return ("\n".join(lines) + "\n").encode()


def csv(*cells):
    return ",".join(map(str, cells))


def packed(value):
    return json.dumps(value, separators=(",", ":")).encode()


# ---- a function a format: names and bytes of its files; several seeds by name ----


def record3d():
    poses = [[0, 0, 0, 1, 0.1 * i, 0, 1.5] for i in range(FRAMES)]
    k = [FX, 0, 0, 0, FX, 0, CX, CY, 1]
    about = {"w": W, "h": H, "dw": W, "dh": H, "fps": 30, "K": k, "poses": poses, "initPose": poses[0],
             "frameTimestamps": TIMES, "perFrameIntrinsicCoeffs": [[FX, FX, CX, CY]] * FRAMES}  # fmt: skip
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as out:
        for i in range(2):
            # LZFSE's block of bytes as they are.
            stored = {"depth": METRES, "conf": b"\x02" * (W * H)}
            out.writestr(zipfile.ZipInfo(f"rgbd/{i}.jpg"), JPG)
            for ending, raw in stored.items():
                body = b"bvx-" + struct.pack("<I", len(raw)) + raw + b"bvx$"
                out.writestr(zipfile.ZipInfo(f"rgbd/{i}.{ending}"), body)
        out.writestr(zipfile.ZipInfo("metadata"), packed(about))
    folder = {"metadata.json": packed(about)}
    for i in range(2):
        folder |= {f"rgb/{i}.jpg": JPG, f"depth/{i}.exr": EXR}
    return {"archive": {"scan.r3d": archive.getvalue()}, "folder": folder}


def polycam():
    out = {}
    for i, secs in enumerate(TIMES):
        m = opengl(i)
        camera = {"fx": FX, "fy": FX, "cx": CX, "cy": CY, "width": W, "height": H, "blur_score": 71.5}
        camera |= {f"t_{r}{c}": m[r][c] for r in range(3) for c in range(4)}
        name = f"{1e6 * secs:.0f}"
        out |= {f"keyframes/corrected_cameras/{name}.json": packed(camera)}
        if i < 2:
            out |= {f"keyframes/corrected_images/{name}.jpg": JPG, f"keyframes/depth/{name}.png": DEPTH}
            out |= {f"keyframes/confidence/{name}.png": SURE}
    return {"folder": out}


def stera_hdf5(h5py, np, target):
    with h5py.File(target, "w", libver="latest") as f:
        g = f.create_group("depth")
        g.create_dataset("frames", data=np.full((FRAMES, H, W), 1500, np.uint16), chunks=(1, H, W), compression="gzip")
        g["timestamps"], g["valid"] = np.array(TIMES), np.ones(FRAMES, bool)
        c = f.create_group("cam-pose")
        c["timestamps"] = np.array(TIMES)
        c["translations"] = np.array([[0.1 * i, 0, 0] for i in range(FRAMES)], np.float32)
        c["rotations"] = np.array([np.eye(3)] * FRAMES, np.float32)
        h = f.create_group("hand-pose")
        h.attrs["coord_frame"] = "camera_3d"
        h["timestamps"] = np.array(TIMES)
        for side in ("left", "right"):
            h[f"{side}_joints"] = np.array([JOINTS] * FRAMES, np.float32)
            h[f"{side}_valid"], h[f"{side}_confidence"] = np.ones(FRAMES, bool), np.ones(FRAMES, np.float32)


def npy(shape, values):
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
    head = head.ljust((10 + len(head) + 1 + 63) // 64 * 64 - 11) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + struct.pack(f"<{len(values)}d", *values)


def hdf5(write):
    """An HDF5 file, or None without h5py."""
    try:
        import h5py
        import numpy as np
    except ImportError:
        return None
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "a.hdf5"
        write(h5py, np, target)
        return target.read_bytes()


def stera():
    annotation = hdf5(stera_hdf5)
    if annotation is None:
        return {}
    k = npy("(3, 3)", [FX, 0, CX, 0, FX, CY, 0, 0, 1])
    size = {"width": W, "height": H, "distortion_model": "plumb_bob"}
    return {"episode": {
        "annotation.hdf5": annotation, "calibrations/meta.json": packed({"rgb": size, "depth": size}),
        "calibrations/rgb_K.npy": k, "calibrations/depth_K.npy": k,
    }}  # fmt: skip


def egodex_hdf5(h5py, np, target):
    """One hand: the other one is not tracked. Each joint is a data set, so one file has many small ones."""
    names = ["Hand", *(f"Thumb{part}" for part in ("Knuckle", "IntermediateBase", "IntermediateTip", "Tip"))]
    for finger in ("Index", "Middle", "Ring", "Little"):
        names += [f"{finger}Finger{part}" for part in ("Knuckle", "IntermediateBase", "IntermediateTip", "Tip")]
    with h5py.File(target, "w", libver="latest") as f:
        f.attrs["llm_description"] = "open a drawer"
        f["transforms/camera"] = np.array([rows(0), rows(1)], np.float32)
        f["camera/intrinsic"] = np.array([[FX, 0, 0.5 * W], [0, FX, 0.5 * H], [0, 0, 1]], np.float32)
        for side in ("left", "right"):
            for name, joint in zip(names, JOINTS):
                f[f"transforms/{side}{name}"] = np.array([moved(*joint)] * 2, np.float32)
            f[f"confidences/{side}Hand"] = np.full(2, 0.9, np.float32)


def egodex():
    data = hdf5(egodex_hdf5)
    return {} if data is None else {"hdf5": {"7.hdf5": data}}


def ego_vision():
    hand = {"joints_world": [JOINTS] * FRAMES, "confidence": [0.8] * FRAMES, "infilled": [False] * FRAMES}
    k = [[FX, 0, CX], [0, FX, CY], [0, 0, 1]]
    file = {"episode_id": "NaN", "fps": 30.0, "camera_trajectory": [rows(i) for i in range(FRAMES)], "intrinsics": [k],
            "hands_world": {SIDE: hand}, "metadata": {"seq": float("inf")}}  # fmt: skip
    return {"result": {"result.json": packed(file).replace(b"0.8,", b"NaN,", 1)}}


CLOSED = (
    "graph_uid,tracking_timestamp_us,utc_timestamp_ns,tx_world_device,ty_world_device,tz_world_device,qx_world_device,"
    "qy_world_device,qz_world_device,qw_world_device,gravity_x_world,gravity_y_world,gravity_z_world,quality_score,geo_available"
)
FISHEYE = [9.0, 7.5, 5.5, 0.02, -0.01, 0, 0, 0, 0, 0.0003, -0.0002, 0.001, -0.0001, -0.0004, 0.0001]


def closed_loop():
    poses = [csv("g", int(1e6 * t), 0, 0.1 * i, 0, 1.5, 0, 0, 0, 1, 0, 0, -9.81, 1, 0) for i, t in enumerate(TIMES)]
    return text(CLOSED, *poses)


def semidense():
    points = text("uid,graph_uid,px_world,py_world,pz_world,inv_dist_std,dist_std", "0,g,1,2,3,0.001,0.002")
    return gzip.compress(points, mtime=0)


def aria_hands():
    head, cells = ["tracking_timestamp_us"], [int(1e6 * TIMES[0])]
    for side in ("left", "right"):
        head.append(f"{side}_tracking_confidence")
        cells.append(0.9)
        for i, joint in enumerate(JOINTS):
            head += [f"t{axis}_{side}_landmark_{i}_device" for axis in "xyz"]
            cells += [f"{v:.3f}" for v in joint]
    return text(csv(*head), csv(*cells))


def aria():
    camera = {"Label": "camera-rgb", "Projection": {"Name": "FisheyeRadTanThinPrism", "Params": FISHEYE},
              "T_Device_Camera": {"Translation": [0.02, -0.01, 0.05], "UnitQuaternion": [1, [0, 0, 0]]}}  # fmt: skip
    line = {"tracking_timestamp_us": int(1e6 * TIMES[0]), "utc_timestamp_ns": 0, "ImageSizes": [[W, H]],
            "CameraCalibrations": [camera]}  # fmt: skip
    walk = {"slam/closed_loop_trajectory.csv": closed_loop()}
    mps = walk | {"slam/semidense_points.csv.gz": semidense(), "slam/online_calibration.jsonl": packed(line) + b"\n"}
    images = {f"rgb/{int(1e9 * t)}.png": COLOR for t in TIMES[:2]}
    pilot = []
    for i, t in enumerate(TIMES[:2]):
        pose = {"QuaternionXYZW": [0, 0, 0, 1], "Translation": [0.1 * i, 0, 1.5]}
        lens = {"ModelName": "Linear:fu,fv,u0,v0", "Parameters": [FX, FX, CX, CY]}
        pilot.append({"index": i, "frameTimestampNs": int(1e9 * t), "T_world_camera": pose, "camera": lens})
    depth = {"depth/pinhole_camera_parameters.json": packed(pilot)}
    for i in range(2):
        depth |= {f"depth/depth/depth_{i:08}.png": DEPTH, f"depth/rectified_images/image_{i:08}.png": SURE}
    hands = {"hand_tracking/hand_tracking_results.csv": aria_hands()}
    return {"walk": mps | images, "hands": walk | hands | depth, "pilot": walk | depth}


def hdepic():
    video = "P01-20240202-161948"
    times = [csv(f"{1e9 * i / 30:.1f}", 0, int(1e9 * t)) for i, t in enumerate(TIMES)]
    calibration = {"label": "camera-rgb", "model_name.name": "FISHEYE624", "projection_params": FISHEYE,
                   "T_Device_Camera.mat3x4": rows(0)[:3], "image_width": W, "image_height": H}  # fmt: skip
    told = csv("a", video, '"open the door"', 0.01, 0.06, "\"['open', 'x']\"", "\"['door']\"")
    head = "unique_narration_id,video_id,narration,start_timestamp,end_timestamp,verbs,nouns"
    return {"storage": {
        f"intermediate_data/mp4_trajectory/{video}.csv": closed_loop(),
        f"intermediate_data/rgb_camera_calibration/{video}.json": packed(calibration),
        f"Videos/P01/{video}_mp4_to_vrs_time_ns.csv": text("mp4_time_ns,relative_vrs_device_time_ns,vrs_device_time_ns", *times),
        "HD_EPIC_Narrations.csv": text(head, told),
        "SLAM-and-Gaze/P01/SLAM/multi/vrs_to_multi_slam.json": packed({f"P01/{video}.vrs": "0"}),
    }}  # fmt: skip


def hololens():
    out, pv, rigs, eyes = {}, [csv(CX + 0.5, CY + 0.5, W, H)], [], []
    flat = lambda m: [v for row in m for v in row]
    for i in range(2):
        t = 132_870_000_000_000_000 + int(1e7 * TIMES[i])
        pv.append(csv(t, FX, FX, *flat(opengl(i))))
        rigs.append(csv(t, *flat(rows(i))))
        out[f"PV/{t}.jpg" if i else f"PV/{t}.bytes"] = JPG if i else bytes([9, 8, 7, 255]) * (W * H)
        out[f"Depth Long Throw/{t}.pgm"] = f"P5\n{W} {H}\n65535\n".encode() + struct.pack(">H", 1500) * (W * H)
        joints = [v for j in range(26) for v in flat(moved(*JOINTS[min(j, 20)]))] if i else None
        sides = [1, *joints, 0, *[0] * 26 * 16] if joints else None
        if sides:
            eyes.append(csv(t, *flat(moved(0, 0, 0)), *(f"{v:g}" for v in sides), *[0] * 10))
    rays = [((x - CX) / FX, (y - CY) / FX, 1.0) for y in range(H) for x in range(W)]
    lut = b"".join(struct.pack("<3f", *(v / sum(u * u for u in r) ** 0.5 for v in r)) for r in rays)
    out |= {
        "20240101_pv.txt": text(*pv), "Depth Long Throw_rig2world.txt": text(*rigs), "Depth Long Throw_lut.bin": lut,
        "Depth Long Throw_extrinsics.txt": csv(*flat(moved(0.1, 0.02, -0.03))).encode(),
    }  # fmt: skip
    hands = {k: v for k, v in out.items() if "Depth" not in k and ".bytes" not in k}
    return {"depth": out, "hands": hands | {"20240101_head_hand_eye.csv": text(*eyes)}}


def quest():
    head = "unix_time,ovr_timestamp,pos_x,pos_y,pos_z,rot_x,rot_y,rot_z,rot_w"
    place = [f"{part}_{axis}" for part, axes in (("pose_pos", "xyz"), ("pose_rot", "xyzw")) for axis in axes]
    listed = csv("frame_index,file_name,unix_time_ms,timestamp_us_realtime,width,height", *place, "pose_ok")
    of_depth = csv(
        "timestamp_ms,ovr_timestamp", *(f"create_pose_location_{a}" for a in "xyz"),
        *(f"create_pose_rotation_{a}" for a in "xyzw"), *(f"fov_{s}_angle_tangent" for s in ("left", "right", "top", "down")),
        "near_z,far_z,width,height",
    )  # fmt: skip
    heads, frames, depths, mruk, plain, raw = [head], [listed], [of_depth], {}, {}, {}
    for i in range(2):
        ms, running = 1_700_000_000_000 + 100 * i, 300 + 0.1 * i
        pose = [0.1 * i, 1.5, 0, 0, 0, 0, 1]
        heads.append(csv(ms, running, *pose))
        frames.append(csv(i, f"{ms}000.rgba", ms, f"{ms}000", W, H, *pose, "true"))
        depths.append(csv(ms, running, *pose, 0.4, 0.4, 0.3, 0.3, 0.1, "Infinity", W, H))
        mruk[f"left_camera_mruk_rgba/{ms}000.rgba"] = bytes([1, 2, 3, 255]) * (W * H)
        plain[f"left_camera_rgb/{ms}.png"] = COLOR
        raw[f"left_depth/{ms}.raw"] = struct.pack("<f", 1 - 0.1 / 1.5) * (W * H)
    both = {"hmd_poses.csv": text(*heads), "left_depth_descriptors.csv": text(*depths)} | raw
    pair = lambda x, y: {"x": x, "y": y}
    intrinsics = {"backend": "MRUK", "imageFormat": "RGBA32", "focalLength": pair(FX, FX), "principalPoint": pair(8, 6),
                  "resolution": {"width": W, "height": H}}  # fmt: skip
    mruk |= {"left_camera_mruk_frame_metadata.csv": text(*frames), "left_camera_mruk_intrinsics.json": packed(intrinsics)}
    array = {"left": 0, "top": 0, "right": W, "bottom": H}
    camera = {"pose": {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0]}, "sensor": {"activeArraySize": array},
              "intrinsics": {"fx": FX, "fy": FX, "cx": 8, "cy": 6, "skew": 0}}  # fmt: skip
    plain["left_camera_characteristics.json"] = packed(camera)
    return {"mruk": both | mruk, "camera2": both | plain}


def quest_hands():
    lines = []
    for i in range(FRAMES):
        ns = int(1e9 * (300 + 0.1 * i))
        local = csv(*(f"{v:.3f}" for joint in JOINTS for v in joint))
        lines += [f"Head pose | f = {i} | t = {ns}:, 0, 1.5, 0, 0, 0, 0, 1", f"Right wrist | f = {i} | t = {ns}:, 0, 1, 0, 0, 0, 0, 1"]
        lines.append(f"Right landmarks | f = {i} | t = {ns}:, {local}")
    return {"stream": {"hands.txt": text(*lines)}}


def visionpro():
    lines = []
    for i, secs in enumerate(TIMES):
        # Only the second hand is tracked.
        hand = {"wrist": column_major(moved(0.1, 1, 0) if i == 1 else moved(0, 0, 0))}
        parts = ("Metacarpal", "Knuckle", "IntermediateBase", "IntermediateTip", "Tip")
        if i == 1:
            names = [f"{finger}{part}" for finger in ("thumb", "index", "middle", "ring", "little") for part in parts]
            hand |= {name: column_major(moved(0.01 * k, 0.1, 0)) for k, name in enumerate(names)}
        line = {"timestamp": secs, "systemTime": 1.7e9 + secs, "headMatrix": column_major(moved(0.1 * i, 1.5, 0)),
                "videoFrameIndex": i, "videoWidth": W, "videoHeight": H, "rightHand": hand}  # fmt: skip
        lines.append(json.dumps(line))
    camera = {"fx": FX, "fy": FX, "cx": CX, "cy": CY, "distortionCoeffs": [0] * 5, "imageWidth": W, "imageHeight": H}
    camera = {"isStereo": False, "leftIntrinsics": camera}
    place = {"leftHeadToCamera": column_major([[1, 0, 0, 0], [0, -1, 0, 0.04], [0, 0, -1, 0], [0, 0, 0, 1]])}
    about = {"version": "1.0", "hasVideo": False, "intrinsicCalibration": json.dumps(camera),
             "extrinsicCalibration": json.dumps(place)}  # fmt: skip
    return {"tracking": {"tracking.jsonl": text(*lines), "metadata.json": packed(about)}}


def arkitscenes():
    out, walk = {}, []
    for i, secs in enumerate(TIMES[:2]):
        name = f"41069021_{secs:.3f}.png"
        walk.append(f"{secs:.3f} 1.2 0.3 0 {0.1 * i:.1f} 0 1.5")
        out |= {f"lowres_wide/{name}": COLOR, f"lowres_depth/{name}": DEPTH, f"confidence/{name}": SURE}
        out[f"lowres_wide_intrinsics/41069021_{secs + 0.001:.3f}.pincam"] = text(f"{W} {H} {FX} {FX} {CX} {CY}")
    return {"scan": out | {"lowres_wide.traj": text(*walk)}}


def arti4d():
    info = f"header: \n  seq: 1\nheight: {H}\nwidth: {W}\nD: (0.0, 0.0, 0.0, 0.0, 0.0)\nK: ({FX}, 0.0, {CX}, 0.0, {FX}, {CY}, 0.0, 0.0, 1.0)\n"
    walk, out = ["timestamp, x, y, z, qx, qy, qz, qw"], {}
    for i in range(FRAMES):
        walk.append(f"{1_729_084_123 + 0.1 * i}, {0.1 * i}, 0, 1.5, 0.7, 0.7, 0, 0")
        out[f"rgb/rgb_{1_729_084_123_000_000_000 + 100_000_000 * i}.jpg"] = JPG
        out[f"depth/depth_{1_729_084_123_000_000_000 + 100_000_000 * i}.png"] = DEPTH
    still = {"rotation": {"x": 0, "y": 0, "z": 0, "w": 1}, "translation": {"x": 0.02, "y": 0, "z": 0}}
    return {"sequence": out | {
        "rgb/camera_info.txt": info.encode(), "depth/camera_info.txt": info.encode(), "odom/scene_1.csv": text(*walk),
        "matched_cues.csv": text("CUE_START,CUE_END,VERIFICATION", "0,1,VERIFIED", "1,2,REJECTED"),
        "azure_tf.json": packed({"base_T_depth": still, "depth_T_rgb": still}),
    }}  # fmt: skip


def nerfstudio():
    frames, out = [], {}
    for i in range(FRAMES):
        image, depth = f"images/frame_{i:05}.jpg", f"depth/frame_{i:05}.png"
        out |= {image: JPG, depth: DEPTH} if i < 2 else {}
        frames.append({"file_path": image, "depth_file_path": depth, "transform_matrix": opengl(i)})
    head = {"camera_model": "OPENCV", "w": W, "h": H, "fl_x": FX, "fl_y": FX, "cx": 8, "cy": 6, "k1": 0.1}
    ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n2 2 3\n"
    about = head | {"frames": frames, "ply_file_path": "sparse_pc.ply"}
    return {"scene": out | {"transforms.json": packed(about), "sparse_pc.ply": ply.encode()}}


def epic_fields():
    images = {f"frame_{i:010}.jpg": [0.7, -0.7, 0, 0, -0.1 * i, 0, 1.5] for i in range(FRAMES)}
    camera = {"id": 1, "model": "OPENCV", "width": W, "height": H, "params": [FX, FX, 8, 6, 0, 0, 0, 0]}
    file = {"camera": camera, "images": images, "points": [[1, 2, 3, 1, 2, 3], [2, 2, 3, 1, 2, 3]]}
    return {"fields": {"P01_01.json": packed(file)}}


def mapanything():
    lines = [f"{i + 1} 0.7 -0.7 0 0 {-0.1 * i} 0 1.5 1 {i:06}.jpg\n" for i in range(FRAMES)]
    model = {
        "sparse/0/cameras.txt": text(f"1 PINHOLE {W} {H} {FX} {FX} 8 6"), "sparse/0/images.txt": text(*lines),
        "sparse/0/points3D.txt": text("1 1 2 3 1 2 3 0.5 1 0", "2 2 2 3 1 2 3 0.5 1 0"),
    }  # fmt: skip
    return {"model": model | {f"images/{i:06}.jpg": JPG for i in range(2)}}


def moge():
    out = {}
    for i in range(2):
        folder = f"maps/frame_{i:010}"
        normal = png(4, 3, 8, 3, bytes([127, 127, 255]) * 12)
        out |= {f"{folder}/depth.exr": EXR, f"{folder}/normal.png": normal, f"{folder}/fov.json": b'{"fov_x": 20.0, "fov_y": 15.0}'}
    return {"maps": out | {"maps/frame_0000000000/image.jpg": JPG}}


def wilor():
    points = [(0.0, 0.0, -9.0)] * 778
    mesh = [*(f"v {x:g} {y:g} {z:g}" for x, y, z in points), "f 93 39 235"]
    return {"meshes": {"000004_0.obj": text(*mesh), "000004.jpg": JPG}}


def hands():
    said = [{"format": "paws-hands", "space": "camera", "fps": 30, "up": [0, -1, 0], "focal_per_width": 1.2}]
    said.append({"image": "frame_0", "side": SIDE, "joints": JOINTS, "score": 0.9, "contact": True})
    said += [{"frame": i, "time": 0.1 * i, "camera": [0.1 * i, 0, 1.5, 0, 0, 0, 1]} for i in range(FRAMES)]
    said.append({"frame": 1, "side": "left", "joints": [None if i == 3 else joint for i, joint in enumerate(JOINTS)]})
    world = [said[0] | {"space": "world"}, *said[1:]]
    return {kind: {"hands.jsonl": text(*map(json.dumps, rows))} for kind, rows in (("camera", said), ("world", world))}


def hands23():
    found = {"hand_id": 0, "hand_bbox": ["1.0", "2.0", "3.0", "4.0"], "contact_state": "object_contact", "hand_side": "right_hand",
             "obj_bbox": None, "obj_touch": "None", "hand_pred_score": "1.0", "obj_pred_score": "None"}  # fmt: skip
    other = found | {"contact_state": "no_contact", "hand_side": "left_hand"}
    images = [{"file_name": f"P01_01/frame_{i:010}.jpg", "predictions": [found, other]} for i in range(2)]
    return {"result": {"result.json": packed({"save_dir": "results", "images": images})}}


def grounded_sam():
    def of(counts, size, name):
        mask = {"class_name": name, "bbox": [0, 0, 1, 1], "score": [0.8], "segmentation": {"size": size, "counts": counts}}
        return {"image_path": "images/000004.jpg", "annotations": [mask], "box_format": "xyxy", "img_width": size[1], "img_height": size[0]}

    return {"runs": {
        "000004_results.json": packed(of([0, 4 * H, (W - 4) * H], [H, W], "drawer.")),
        "000005_results.json": packed(of("7383JK1", [6, 5], "left hand")),
    }}  # fmt: skip


def deeplsd():
    return {"lines": {
        "a_deeplsd.npz": (HERE / "corpus/npz/f4.npz").read_bytes(), "b_deeplsd_ext.npz": (HERE / "corpus/npz/f8.npz").read_bytes(),
    }}  # fmt: skip


def limap():
    listed = text("number of images, 1", "7, images/000004.jpg")
    return {"lines": {"segments/segments_7.txt": text("2", "10 2 3 4", "5.5 6.5 7.5 8.5"), "image_list.txt": listed}}


def narrations():
    head = "narration_id,participant_id,video_id,narration_timestamp,start_timestamp,stop_timestamp,start_frame,stop_frame,narration,verb,noun,all_nouns"
    line = csv("P01_01_0,P01,P01_01,00:00:01.0,00:00:01.00,00:00:02.00,3,9", '"open the drawer"', "open,drawer", "\"['drawer', 'x']\"")
    other = csv("P01_02_0,P01,P01_02,00:00:01.0,00:00:01.00,00:00:02.00,3,9", "turn on tap", "turn-on,tap", "\"['tap']\"")
    told = {"video_id": "P01-1", "narration": "open the door", "start_timestamp": 1.5, "end_timestamp": 2, "verbs": ["open"], "nouns": ["door"]}
    return {
        "epic": {"EPIC_100_train.csv": text(head, line, other)}, "jsonl": {"said.jsonl": text(json.dumps(told))},
        "seconds": {"said.csv": text("start,end,text", "1.0,2.5,open the door", "00:00:03,4,close it")},
    }  # fmt: skip


def subtitles():
    srt = text("1", "00:00:01,500 --> 00:00:03,000", "<i>open</i>", "the door", "", "2", "00:00:04,000 --> 00:00:05,000", "close {it}", "")
    vtt = text("WEBVTT", "", "NOTE a", "", "00:01.000 --> 00:02.000 align:start", "close it", "")
    return {"srt": {"said.srt": srt}, "vtt": {"said.vtt": vtt}}


def cloud():
    of = lambda kind, name: (HERE / "corpus" / kind / name).read_bytes()
    return {
        "csv": {"scan.csv": text("x,y,z", "1,2,3", "2,2,3")}, "aria": {"points.csv": text("px_world,py_world,pz_world", "1,2,3")},
        "ply": {"scan.ply": of("ply", "little.ply")}, "obj": {"scan.obj": of("surface_obj", "coloured.obj")},
        "gltf": {"scan.gltf": of("surface_glb", "coloured.gltf")},
    }  # fmt: skip


# ---- ROS 2 in MCAP ----


class Cdr:
    """A message, field by field, little end first."""

    def __init__(self):
        self.bytes = bytearray([0, 1, 0, 0])

    def add(self, kind, *values):
        size = struct.calcsize(kind)
        for value in values:
            self.bytes += b"\0" * (-(len(self.bytes) - 4) % size) + struct.pack("<" + kind, value)
        return self

    def data(self, data):
        self.add("I", len(data))
        self.bytes += data
        return self

    def text(self, text):
        return self.data(text.encode() + b"\0")

    def header(self, secs, frame):
        return self.add("i", int(secs)).add("I", int(round(1e9 * (secs % 1)))).text(frame)

    def image(self, encoding, channel_bytes, data):
        return self.add("I", H, W).text(encoding).add("B", 0).add("I", W * channel_bytes).data(data)

    def camera(self):
        self.add("I", H, W).text("plumb_bob").add("I", 5).add("d", *[0] * 5)
        k = [FX, 0, CX, 0, FX, CY, 0, 0, 1]
        p = [FX, 0, CX, 0, 0, FX, CY, 0, 0, 0, 1, 0]
        return self.add("d", *k).add("d", 1, 0, 0, 0, 1, 0, 0, 0, 1).add("d", *p).add("I", 0, 0)


def record(code, body):
    return bytes([code]) + struct.pack("<Q", len(body)) + body


def bag(channels, messages):
    """`channels`: topic and type, numbered from 1; `messages`: channel, seconds, message."""
    say = lambda s: struct.pack("<I", len(s)) + s.encode()
    out = b"\x89MCAP0\r\n" + record(1, say("ros2") + say("seed"))
    for number, (topic, kind) in enumerate(channels, 1):
        out += record(3, struct.pack("<H", number) + say(kind) + say("ros2msg") + say(""))
        out += record(4, struct.pack("<HH", number, number) + say(topic) + say("cdr") + struct.pack("<I", 0))
    for number, secs, message in messages:
        ns = int(1e9 * secs)
        out += record(5, struct.pack("<HIQQ", number, 0, ns, ns) + bytes(message.bytes))
    return out + record(15, bytes(4)) + record(2, bytes(20)) + b"\x89MCAP0\r\n"


def robot():
    channels = [
        ("/camera/color/image_raw", "sensor_msgs/msg/Image"), ("/camera/color/camera_info", "sensor_msgs/msg/CameraInfo"),
        ("/camera/depth/image_raw", "sensor_msgs/msg/Image"), ("/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo"),
        ("/odom", "nav_msgs/msg/Odometry"), ("/tf_static", "tf2_msgs/msg/TFMessage"), ("/tf", "tf2_msgs/msg/TFMessage"),
    ]  # fmt: skip
    turned = [0.5, -0.5, 0.5, -0.5]
    fixed = Cdr().add("I", 2).header(0, "base").text("link").add("d", 0.1, 0.02, 1.2, 0, 0, 0, 1)
    fixed.header(0, "link").text("optical").add("d", 0.05, 0, 0, *turned)
    messages = [(6, TIMES[0], fixed)]
    for i, t in enumerate(TIMES[:2]):
        base = [0.1 * i, 0, 0, 0, 0, 0, 1]
        messages += [
            (1, t, Cdr().header(t, "optical").image("bgr8", 3, bytes([1, 2, 3]) * (W * H))), (2, t, Cdr().header(t, "optical").camera()),
            (3, t, Cdr().header(t, "optical").image("32FC1", 4, METRES)), (4, t, Cdr().header(t, "optical").camera()),
            (5, t, Cdr().header(t, "odom").text("base").add("d", *base).add("d", *[0] * 78)),
            (7, t, Cdr().add("I", 1).header(t, "odom").text("base").add("d", *base)),
        ]  # fmt: skip
    return bag(channels, messages)


def mcap():
    channels = [("/camera/rgb/compressed", "sensor_msgs/msg/CompressedImage"), ("/camera/depth", "sensor_msgs/msg/Image"),
                ("/camera/pose", "geometry_msgs/msg/PoseStamped"), ("/camera/camera_info", "sensor_msgs/msg/CameraInfo")]  # fmt: skip
    messages = []
    for i, t in enumerate(TIMES[:2]):
        head = lambda: Cdr().header(t, "camera_optical_frame")
        messages += [(1, t, head().text("jpeg").data(JPG)), (2, t, head().image("16UC1", 2, struct.pack("<H", 1500) * (W * H)))]
        messages += [(3, t, Cdr().header(t, "world").add("d", 0.1 * i, 0, 1.5, 0, 0, 0, 1)), (4, t, head().camera())]
    samples = HERE.parent / "tests/data/import"
    yaml = b"rosbag2_bagfile_information:\n"
    return {
        "robot": {"metadata.yaml": yaml, "bag_0.mcap": robot()}, "phone": {"take.mcap": bag(channels, messages)},
        "lz4": {"take.mcap": (samples / "lz4.mcap").read_bytes()}, "zstd": {"take.mcap": (samples / "zstd.mcap").read_bytes()},
    }  # fmt: skip


FORMATS = {
    "stera": stera, "mcap": mcap, "record3d": record3d, "polycam": polycam, "egodex": egodex, "ego-vision": ego_vision,
    "aria": aria, "hdepic": hdepic, "hololens": hololens, "quest": quest, "quest-hands": quest_hands, "visionpro": visionpro,
    "arkitscenes": arkitscenes, "arti4d": arti4d, "nerfstudio": nerfstudio, "epic-fields": epic_fields, "mapanything": mapanything,
    "moge": moge, "wilor": wilor, "hands": hands, "hands23": hands23, "grounded-sam": grounded_sam, "deeplsd": deeplsd,
    "limap": limap, "narrations": narrations, "subtitles": subtitles, "cloud": cloud,
}  # fmt: skip


def sections(files):
    """As tests/it/readers/imports.rs reads them."""
    return b"\n".join(b"=== " + name.encode() + b"\n" + files[name] for name in sorted(files))


def refusal(paws, kind, files):
    """What `paws import` says of a source, or None where it is read."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "source"
        for name, data in files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(data)
        source = root / next(iter(files)) if len(files) == 1 else root
        camera = f"{W},{H},{FX},{FX},{CX},{CY}"
        options = ["--fps", "0", "--scale", "1", "--up", "z", "--ffmpeg", "/nowhere/ffmpeg", "--camera", camera]
        command = [paws, "import", f"{kind}={source}", *options, "--out", Path(folder) / "out"]
        done = subprocess.run(command, capture_output=True, text=True)
        # What has no poses or nothing with a time is read before that is missed.
        is_read = done.returncode in (0, 1) or "no source has" in done.stderr
        return None if is_read else done.stderr.strip()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--paws", metavar="PROGRAM")
    parser.add_argument("--only", metavar="NAME", choices=FORMATS)
    wanted = parser.parse_args()
    refused = 0
    for name, write in FORMATS.items():
        if wanted.only not in (None, name):
            continue
        sources = write()
        if not sources:
            print(f"{name}: no h5py here, the seeds stay as they are", file=sys.stderr)
        folder = HERE / "corpus" / f"import-{name}"
        folder.mkdir(exist_ok=True)
        for kind, files in sources.items():
            (folder / f"{kind}.bin").write_bytes(sections(files))
            why = refusal(wanted.paws, name, files) if wanted.paws else None
            refused += why is not None
            size = len(sections(files))
            print(f"{name}/{kind}: {len(files)} files, {size} bytes" + (f", refused: {why}" if why else ""))
    sys.exit(1 if refused else 0)


if __name__ == "__main__":
    main()
