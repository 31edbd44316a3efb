"""A recording, its evidence and its replay as a rerun log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ._call import AnyPath
from .recording import Recording, rotation
from .twins import Twin, needed

#: Pixels of depth a metre: the files hold millimetres.
DEPTH_PER_METRE = 1000.0
GREEN, RED, GREY, BLUE = [60, 180, 75], [220, 50, 50], [150, 150, 150], [70, 110, 220]
COLOURS = {"pass": GREEN, "fail": RED, "undetermined": [230, 160, 30]}


def rerun_log(recording: AnyPath, twin: AnyPath, file: AnyPath) -> Path:
    """Writes what was recorded (images, depth, poses, hands), the twin and the replay of every clip to `file` (.rrd), which
    `rerun FILE` shows. Needs `pip install 'paws-twin[rerun]'`.

    Timelines: `time` (seconds of the recording). Entities: `world/camera` (`image`, `depth`), `world/hands`, `world/scene` (the
    twin), `world/joints/ID` (axis, box, verdict), `world/replay/ID/CLIP` (the hand, and the handle in simulation), `clips` (what
    was said, when it begins).
    """
    rr = needed("rerun", "rerun")
    recording = recording if isinstance(recording, Recording) else Recording(recording)
    twin = twin if isinstance(twin, Twin) else Twin(twin)
    file = Path(file)
    with rr.RecordingStream("paws_twin", recording_id=recording.name) as stream:
        stream.save(str(file))
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        _frames(rr, stream, recording)
        _hands(rr, stream, recording)
        _twin(rr, stream, twin)
        _replays(rr, stream, twin)
        stream.flush()
    return file


def _frames(rr: Any, stream: Any, recording: Recording) -> None:
    cameras = recording.table("cameras.json")
    size = [cameras["width"], cameras["height"]]
    stream.log("world/camera", rr.Pinhole(image_from_camera=recording.intrinsics, resolution=size), static=True)
    clips = {clip["start_frame"]: clip for clip in recording.clips}
    for frame in cameras["frames"]:
        number = frame["frame"]
        stream.set_time("time", duration=frame["timestamp"])
        turned = rr.Transform3D(translation=frame["position"], mat3x3=rotation(frame["rotation_wxyz"]))
        stream.log("world/camera", turned)
        image = recording.path / (frame.get("file") or f"frames/{number:06}.jpg")
        if image.is_file():
            stream.log("world/camera/image", rr.EncodedImage(path=image))
        depth = recording.path / f"depth/{number:06}.png"
        if depth.is_file() and hasattr(rr, "EncodedDepthImage"):
            stream.log("world/camera/depth", _depth(rr, depth))
        if number in clips:
            clip = clips[number]
            stream.log("clips", rr.TextLog(f"{clip['clip']}: {clip.get('narration', '')}"))


def _depth(rr: Any, file: Path) -> Any:
    return rr.EncodedDepthImage(blob=file.read_bytes(), media_type="image/png", meter=DEPTH_PER_METRE)


def _hands(rr: Any, stream: Any, recording: Recording) -> None:
    times = recording.times
    for number, points, held in recording.hand_points():
        stream.set_time("time", duration=float(times[number]))
        colours = [RED if contact else BLUE for contact in held]
        stream.log("world/hands", rr.Points3D(points, colors=colours, radii=0.005))


def _twin(rr: Any, stream: Any, twin: Twin) -> None:
    scene = twin.path / "scene.glb"
    if scene.is_file():
        stream.log("world/scene", rr.Asset3D(path=scene), static=True)
    for joint in twin.joints:
        verdict = twin.validation.joint(joint.id) if twin.validation else None
        colour = COLOURS.get(verdict.verdict if verdict else "", GREY)
        at = f"world/joints/{joint.id}"
        ends = np.array([joint.origin - 0.3 * joint.axis, joint.origin + 0.3 * joint.axis])
        stream.log(f"{at}/axis", rr.LineStrips3D([ends], colors=[colour], radii=0.006), static=True)
        box = rr.Transform3D(translation=joint.bounds.center, mat3x3=joint.bounds.rotation)
        stream.log(f"{at}/box", box, static=True)
        label = f"{joint.id}: {joint.label}"
        if verdict:
            label += f": {verdict.verdict}"
            stream.log(f"{at}/verdict", rr.TextDocument(f"{verdict.verdict}: {verdict.reason}"), static=True)
        shape = rr.Boxes3D(half_sizes=[joint.bounds.half], colors=[colour], labels=[label])
        stream.log(f"{at}/box", shape, static=True)


def _replays(rr: Any, stream: Any, twin: Twin) -> None:
    for verdict in twin.validation.joints if twin.validation else ():
        starts = {clip: times for clip, times, _ in twin.hands(verdict.id)}
        for replay in verdict.clips:
            at = f"world/replay/{verdict.id}/{replay.clip}"
            stream.log(f"{at}/hand_path", rr.LineStrips3D([replay.hand], colors=[RED], radii=0.003), static=True)
            times = starts.get(replay.clip)
            if times is None or not len(times) or not len(replay.hand):
                continue
            for moment, hand, handle in zip(np.linspace(times[0], times[-1], len(replay.hand)), replay.hand, replay.handle):
                stream.set_time("time", duration=float(moment))
                stream.log(f"{at}/hand", rr.Points3D([hand], colors=[RED], radii=0.015))
                stream.log(f"{at}/handle", rr.Points3D([handle], colors=[GREEN], radii=0.015))
