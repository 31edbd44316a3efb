"""Writes the samples beside this file with the projects' own writers: pip install h5py mcap-ros2-support pillow."""

import h5py, numpy as np, io, json, os
from PIL import Image

root = os.path.dirname(os.path.abspath(__file__))
N, H, W = 4, 12, 16
K = np.array([[20.0, 0, 7.5], [0, 20.0, 5.5], [0, 0, 1]])
R = np.eye(3)
depth = np.stack([np.full((H, W), 1000 + n, np.uint16) for n in range(N)])
ts = 1700000000.0 + np.arange(N) * 0.1
with h5py.File(root + "/episode/annotation.hdf5", "w") as f:
    g = f.create_group("depth")
    d = g.create_dataset(
        "frames", shape=(N, H, W), dtype=np.uint16, chunks=(1, H, W), compression="gzip", compression_opts=4
    )
    t = g.create_dataset("timestamps", shape=(N,), dtype=np.float64)
    v = g.create_dataset("valid", shape=(N,), dtype=bool)
    for i in range(N):
        d[i] = depth[i]
        t[i] = ts[i]
        v[i] = True
    g.attrs["units"] = "mm"
    g.attrs["height"] = H
    g.attrs["width"] = W
    c = f.create_group("cam-pose")
    c.create_dataset("timestamps", data=ts)
    c.create_dataset("translations", data=np.array([[0.1 * i, 0, 0] for i in range(N)], np.float32))
    c.create_dataset("rotations", data=np.array([np.eye(3)] * N, np.float32))
    h = f.create_group("hand-pose")
    h.create_dataset("timestamps", data=ts)
    for s in ("left", "right"):
        h.create_dataset(s + "_joints", data=np.full((N, 21, 3), np.nan, np.float32))
        h.create_dataset(s + "_valid", data=np.zeros(N, bool))
        h.create_dataset(s + "_confidence", data=np.zeros(N, np.float32))
    h.attrs["coord_frame"] = "camera_3d"
c = root + "/episode/calibrations/"
np.save(c + "rgb_K.npy", K)
np.save(c + "depth_K.npy", K)
np.save(c + "R_optical_to_link.npy", np.array([[0, 0, 1.0], [0, -1, 0], [1, 0, 0]]))
json.dump(
    {"rgb": {"width": W, "height": H, "distortion_model": "plumb_bob"}, "depth": {"width": W, "height": H}},
    open(c + "meta.json", "w"),
)
names = "Hand ThumbKnuckle ThumbIntermediateBase ThumbIntermediateTip ThumbTip".split()
for fi in "IndexFinger MiddleFinger RingFinger LittleFinger".split():
    names += [fi + x for x in "Metacarpal Knuckle IntermediateBase IntermediateTip Tip".split()]
with h5py.File(root + "/egodex/0.hdf5", "w") as f:
    f.attrs["llm_description"] = "open a drawer"
    f.attrs["which_llm_description"] = "1"

    def tr(p):
        m = np.eye(4)
        m[:3, 3] = p
        return m

    f["transforms/camera"] = np.array([tr([0.1 * i, 0, 0]) for i in range(N)], np.float32)
    rng = np.random.default_rng(0)
    for s in ("left", "right"):
        for k, n in enumerate(names):
            p = np.array([0.2, 0, 0.4]) + np.array([0, 0, 0.0])
            if n == "Hand":
                p = p
            elif n == "MiddleFingerKnuckle":
                p = p + [0, 0, 0.09]
            else:
                p = p + [0.005 * k, 0, 0.1]
            f[f"transforms/{s}{n}"] = np.array([tr(p)] * N, np.float32)
            f[f"confidences/{s}{n}"] = np.full(N, 0.9 if s == "right" else 0.0, np.float32)
    f["camera/intrinsic"] = np.array([[20.0, 0, 8], [0, 20.0, 6], [0, 0, 1]], np.float32)
from mcap_ros2.writer import Writer
from mcap.writer import CompressionType

HEAD = "std_msgs/Header header\n"
SEP = "=" * 80 + "\n"
HDR = (
    SEP
    + "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    + SEP
    + "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
POSE = (
    SEP
    + "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
    + SEP
    + "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    + SEP
    + "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
)
for comp, name in ((CompressionType.ZSTD, "zstd"), (CompressionType.LZ4, "lz4")):
    with open(f"{root}/{name}.mcap", "wb") as out:
        w = Writer(out, compression=comp, chunk_size=1500)
        ci = w.register_msgdef("sensor_msgs/msg/CompressedImage", HEAD + "string format\nuint8[] data\n" + HDR)
        im = w.register_msgdef(
            "sensor_msgs/msg/Image",
            HEAD
            + "uint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n"
            + HDR,
        )
        ps = w.register_msgdef("geometry_msgs/msg/PoseStamped", HEAD + "geometry_msgs/Pose pose\n" + HDR + POSE)
        ca = w.register_msgdef(
            "sensor_msgs/msg/CameraInfo",
            HEAD
            + "uint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
            + HDR,
        )
        for n in range(N):
            t = ts[n]
            sec = int(t)
            ns = int(round((t - sec) * 1e9))
            log = int(sec * 10**9 + ns)
            head = {"stamp": {"sec": sec, "nanosec": ns}, "frame_id": "camera_optical_frame"}
            buf = io.BytesIO()
            Image.fromarray(np.full((H, W, 3), 60 * n, np.uint8)).save(buf, "JPEG")
            w.write_message(
                "/camera/rgb/compressed", ci, {"header": head, "format": "jpeg", "data": buf.getvalue()}, log, log, n
            )
            w.write_message(
                "/camera/depth",
                im,
                {
                    "header": head,
                    "height": H,
                    "width": W,
                    "encoding": "16UC1",
                    "is_bigendian": 0,
                    "step": 2 * W,
                    "data": depth[n].tobytes(),
                },
                log,
                log,
                n,
            )
            w.write_message(
                "/camera/camera_info",
                ca,
                {
                    "header": head,
                    "height": H,
                    "width": W,
                    "distortion_model": "plumb_bob",
                    "d": [0.0] * 5,
                    "k": list(K.ravel()),
                    "r": list(np.eye(3).ravel()),
                    "p": [20.0, 0, 7.5, 0, 0, 20.0, 5.5, 0, 0, 0, 1, 0],
                    "binning_x": 0,
                    "binning_y": 0,
                },
                log,
                log,
                n,
            )
            w.write_message(
                "/camera/pose",
                ps,
                {
                    "header": {**head, "frame_id": "world"},
                    "pose": {
                        "position": {"x": 0.1 * n, "y": 0.0, "z": 0.0},
                        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
                    },
                },
                log,
                log,
                n,
            )
        w.finish()
