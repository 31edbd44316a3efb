"""Hands by MediaPipe's Tasks API with the two models that its wheel ships. Runs on a CPU."""

import io
import pathlib
import zipfile

from . import About, package, weights_of

DETECTOR = "modules/palm_detection/palm_detection_full.tflite"
LANDMARKS = "modules/hand_landmark/hand_landmark_full.tflite"
# The names that the Tasks API looks for in its bundle.
BUNDLE = {DETECTOR: "hand_detector.tflite", LANDMARKS: "hand_landmarks_detector.tflite"}
# Low, as depth, size and time leave out what is no hand.
CONFIDENCE = 0.3

ABOUT = About(
    name="mediapipe-hands",
    stream="hands",
    package="mediapipe==0.10.21",
    extra="hands",
    licence="Apache-2.0",
    needs="colour images",
    gives="21 joints in MANO's order: pixels of the image; a shape about the hand's middle, camera axes (x right, y down, z forward), "
    "roughly metres",
    devices=("cpu",),
    # Four views of each frame, 0.03 s each, and a few more where a hand is missed.
    secs_per_frame=0.15,
    memory_mb=600,
    version=1,
    weights={
        DETECTOR: "1b14e9422c6ad006cde6581a46c8b90dd573c07ab7f3934b5589e7cea3f89a54",
        LANDMARKS: "11c272b891e1a99ab034208e23937a8008388cf11ed2a9d776ed3d01d0ba00e3",
    },
    weights_from="the wheel of mediapipe 0.10.21 (PyPI) holds both, below mediapipe/modules",
)


class Network:
    """A loaded detector."""

    def __init__(self, landmarker, mediapipe):
        self._landmarker, self._mediapipe = landmarker, mediapipe

    def run(self, image):
        """Hands in a square RGB image: `right` (how likely it is a right hand), `score`, `pixels` (21 x 2), `shape` (21 x 3)."""
        import numpy as np  # Not needed to say what this is.

        rows, columns = image.shape[:2]
        held = self._mediapipe.Image(image_format=self._mediapipe.ImageFormat.SRGB, data=np.ascontiguousarray(image))
        found = self._landmarker.detect(held)
        out = []
        for side, at, shape in zip(found.handedness, found.hand_landmarks, found.hand_world_landmarks):
            score = float(side[0].score)
            # MediaPipe counts from the pixel's corner.
            pixels = np.array([[p.x * columns - 0.5, p.y * rows - 0.5] for p in at])
            out.append(
                {
                    "right": score if side[0].category_name == "Right" else 1 - score,
                    "score": score,
                    "pixels": pixels,
                    "shape": np.array([[p.x, p.y, p.z] for p in shape]),
                }
            )
        return out


def load(device="cpu", weights=None):
    """The detector. `weights`: a folder that may hold the two models, else those of the package."""
    mediapipe = package("mediapipe", ABOUT)
    tasks = package("mediapipe.tasks.python", ABOUT)
    folders = [*([weights] if weights else []), pathlib.Path(mediapipe.__file__).parent]
    bundle = io.BytesIO()
    with zipfile.ZipFile(bundle, "w", zipfile.ZIP_STORED) as packed:
        for name, data in weights_of(ABOUT, folders).items():
            packed.writestr(BUNDLE[name], data)
    options = tasks.vision.HandLandmarkerOptions(
        base_options=tasks.BaseOptions(model_asset_buffer=bundle.getvalue()),
        num_hands=2,
        min_hand_detection_confidence=CONFIDENCE,
        min_hand_presence_confidence=CONFIDENCE,
    )
    return Network(tasks.vision.HandLandmarker.create_from_options(options), mediapipe)
