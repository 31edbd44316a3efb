"""The colour images of a Project Aria VRS file, named by the glasses' time in nanoseconds, and the camera's calibration.

    pip install projectaria-tools pillow
    python aria_vrs.py recording.vrs FOLDER/rgb [EVERY]

Then `paws import FOLDER --rotate 90 --out DIR`, FOLDER also holding what MPS wrote. EVERY keeps each so many-th image.
"""

import json
import sys
from pathlib import Path

from PIL import Image
from projectaria_tools.core import data_provider
from projectaria_tools.core.sensor_data import TimeDomain

LABEL = "camera-rgb"


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    provider = data_provider.create_vrs_data_provider(sys.argv[1])
    if provider is None:
        sys.exit(f"{sys.argv[1]} cannot be read as a VRS file")
    out = Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    every = int(sys.argv[3]) if len(sys.argv) == 4 else 1
    stream = provider.get_stream_id_from_label(LABEL)
    times = provider.get_timestamps_ns(stream, TimeDomain.DEVICE_TIME)
    for index in range(0, len(times), every):
        image = provider.get_image_data_by_index(stream, index)[0].to_numpy_array()
        Image.fromarray(image).save(out / f"{times[index]}.jpg", quality=95)
    camera = provider.get_device_calibration().get_camera_calib(LABEL)
    width, height = (int(n) for n in camera.get_image_size())
    calibration = {
        "model_name.name": camera.get_model_name().name if hasattr(camera, "get_model_name") else camera.model_name().name,
        "projection_params": [float(p) for p in camera.get_projection_params()],
        "T_Device_Camera.mat3x4": camera.get_transform_device_camera().to_matrix3x4().tolist(),
        "image_width": width,
        "image_height": height,
    }
    (out / "rgb_camera_calibration.json").write_text(json.dumps(calibration, indent=1))
    print(f"{len(range(0, len(times), every))} images and rgb_camera_calibration.json in {out}")


if __name__ == "__main__":
    main()
