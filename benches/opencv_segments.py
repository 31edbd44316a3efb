"""OpenCV's LSD as a recording's own detector: writes segments/000000.txt ... (LIMAP's form) beside frames/.

    python3 benches/opencv_segments.py RECORDING      # needs opencv-python-headless; then `paws measure RECORDING`

Run it on a copy: a recording that has segments/ is read with them.
"""

import pathlib
import sys

import cv2

recording = pathlib.Path(sys.argv[1])
out = recording / "segments"
out.mkdir(exist_ok=True)
detector = cv2.createLineSegmentDetector()
for image in sorted((recording / "frames").glob("*.jpg")):
    found = detector.detect(cv2.imread(str(image), cv2.IMREAD_GRAYSCALE))[0]
    rows = [] if found is None else found.reshape(-1, 4).tolist()
    (out / f"{image.stem}.txt").write_text(f"{len(rows)}\n" + "".join(f"{a} {b} {c} {d}\n" for a, b, c, d in rows))
