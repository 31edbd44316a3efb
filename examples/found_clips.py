#!/usr/bin/env python3
"""How well interactions are found: examples/found_clips.py PAWS RECORDING...

Each RECORDING (with ground_truth.json) is copied by links without its clips, `paws twin` finds them, and they are held against
the true ones. A found clip is right where it covers four tenths of a true hold (or of itself); each true one counts once. Bounds
are the larger error of the two ends of the hold, in seconds. PAWS is the program.
"""

import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

AROUND = 0.5  # seconds that a found clip has beside its hold


def true_holds(truth: dict, times: list[float]) -> list[tuple[float, float]]:
    holds = []
    for clip in truth["clips"]:
        first, count = clip["true_start_frame"], len(clip["x"])
        # Recordings of `paws synth` have eight frames of reaching and of withdrawing.
        begin, end = clip.get("contact_frames") or [first + 8, first + count - 9]
        holds.append((times[begin], times[min(end, len(times) - 1)]))
    return holds


def main() -> None:
    paws, total = sys.argv[1], {"true": 0, "found": 0, "right": 0}
    errors: list[float] = []
    for name in map(Path, sys.argv[2:]):
        with tempfile.TemporaryDirectory() as scratch:
            bare, out = Path(scratch) / name.name, Path(scratch) / "twin"
            subprocess.run([sys.executable, Path(__file__).parent / "without.py", name, bare, "--clips"], check=True)
            command = [paws, "twin", bare, "--follow-links", "--as-is", "--no-textures", "--out", out]
            subprocess.run(command, check=False, capture_output=True)
            clips = json.loads((out / "articulations.json").read_text())["clips"]
        times = [f["timestamp"] for f in json.loads((name / "cameras.json").read_text())["frames"]]
        truth = true_holds(json.loads((name / "ground_truth.json").read_text()), times)
        spans = [(times[c["frames"][0]] + AROUND, times[c["frames"][1]] - AROUND) for c in clips]
        free = set(range(len(truth)))
        right = 0
        for a, b in spans:
            for k in sorted(free):
                begin, end = truth[k]
                if min(b, end) - max(a, begin) > 0.4 * min(b - a, end - begin):
                    free.discard(k)
                    right += 1
                    errors.append(max(abs(a - begin), abs(b - end)))
                    break
        print(f"{name.name}: {len(truth)} true, {len(spans)} found, {right} right")
        for key, value in (("true", len(truth)), ("found", len(spans)), ("right", right)):
            total[key] += value
    print(
        f"recall {total['right'] / max(1, total['true']):.3f}, precision {total['right'] / max(1, total['found']):.3f}, "
        f"bounds {statistics.median(errors) if errors else float('nan'):.2f} s in the median"
    )


if __name__ == "__main__":
    main()
