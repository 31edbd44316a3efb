#!/usr/bin/env python3
"""How well interactions are found: examples/found_clips.py PAWS RECORDING...

Each RECORDING (with ground_truth.json) is copied by links without its clips, `paws twin` finds them, and they are held against
the true ones. A found clip is right where it covers four tenths of a true hold (or of itself); each true one counts once. Bounds
are the larger error of the two ends of the hold, in seconds. Then the answers: each true clip has that of the found clip that shows
it, or none, and `paws evaluate` counts the right ones of all, as a row beside those of `paws ablate`. PAWS is the program.
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


def matched(spans: list[tuple[float, float]], truth: list[tuple[float, float]]) -> dict[int, int]:
    """The true hold that each found span shows, in the order of the spans."""
    free, out = set(range(len(truth))), {}
    for i, (a, b) in enumerate(spans):
        for k in sorted(free):
            begin, end = truth[k]
            if min(b, end) - max(a, begin) > 0.4 * min(b - a, end - begin):
                free.discard(k)
                out[i] = k
                break
    return out


def found(paws: str, name: Path) -> tuple[list[dict], list[dict]]:
    """What `paws twin` finds in a recording without its clips: clips with their frames, and predictions."""
    with tempfile.TemporaryDirectory() as scratch:
        bare, out = Path(scratch) / name.name, Path(scratch) / "twin"
        subprocess.run([sys.executable, Path(__file__).parent / "without.py", name, bare, "--clips"], check=True)
        command = [paws, "twin", bare, "--follow-links", "--as-is", "--no-textures", "--out", out]
        subprocess.run(command, check=False, capture_output=True)
        clips = json.loads((out / "articulations.json").read_text())["clips"]
        return clips, json.loads((out / "predictions.json").read_text())["predictions"]


def shares(paws: str, predictions: list[dict], recordings: list[Path]) -> str:
    """Right clips of all, by `paws evaluate`: a row of the table of ablations."""
    with tempfile.TemporaryDirectory() as scratch:
        given, report = Path(scratch) / "predictions.json", Path(scratch) / "report.json"
        given.write_text(json.dumps({"predictions": predictions}))
        command = [paws, "evaluate", given, *recordings, "--json", report]
        subprocess.run(command, check=True, capture_output=True)
        rules = {rule["rule"]: rule["micro"] for rule in json.loads(report.read_text())["rules"]}
    line = rules["paws_line"]
    row = [line["m"], line["ma"], line["mao"], rules["strict"]["mao"], rules["sim"]["mao"]]
    return "| `ours`, clips found | " + " | ".join(f"{share:.2f}" for share in row) + " |"


def main() -> None:
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    paws, total = sys.argv[1], {"true": 0, "found": 0, "right": 0}
    recordings = [Path(name).resolve() for name in sys.argv[2:]]
    errors: list[float] = []
    answers: list[dict] = []
    for name in recordings:
        clips, predictions = found(paws, name)
        times = [f["timestamp"] for f in json.loads((name / "cameras.json").read_text())["frames"]]
        told = json.loads((name / "ground_truth.json").read_text())
        truth = true_holds(told, times)
        spans = [(times[c["frames"][0]] + AROUND, times[c["frames"][1]] - AROUND) for c in clips]
        pairs = matched(spans, truth)
        errors += [max(abs(a - b) for a, b in zip(spans[i], truth[k])) for i, k in pairs.items()]
        true_names = {clips[i]["clip"]: told["clips"][k]["clip"] for i, k in pairs.items()}
        answers += [p | {"clip": true_names[p["clip"]]} for p in predictions if p["clip"] in true_names]
        print(f"{name.name}: {len(truth)} true, {len(spans)} found, {len(pairs)} right")
        for key, value in (("true", len(truth)), ("found", len(spans)), ("right", len(pairs))):
            total[key] += value
    print(
        f"recall {total['right'] / max(1, total['true']):.3f}, precision {total['right'] / max(1, total['found']):.3f}, "
        f"bounds {statistics.median(errors) if errors else float('nan'):.2f} s in the median"
    )
    print("\n| config | M | MA | MAO, point to line | STRICT | SIM |\n| --- | --- | --- | --- | --- | --- |")
    print(shares(paws, answers, recordings))


if __name__ == "__main__":
    main()
