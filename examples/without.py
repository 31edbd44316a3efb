#!/usr/bin/env python3
"""A recording without what few devices give, to see what it costs: examples/without.py RECORDING OUT [--contact] [--clips] [--masks]

OUT holds links to RECORDING's files (read it with --follow-links); --contact takes every contact flag away, --clips the narrated
clips, --masks the masks. ground_truth.json stays, so that `paws evaluate` finds it.
"""

import argparse
import json
from pathlib import Path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    for name in ("contact", "clips", "masks"):
        parser.add_argument(f"--{name}", action="store_true")
    args = parser.parse_args()
    left_out = {"clips.json"} if args.clips else set()
    left_out |= {"masks", "labels.json"} if args.masks else set()
    args.out.mkdir(parents=True)
    for path in sorted(args.recording.resolve().iterdir()):
        if path.name in left_out:
            continue
        if args.contact and path.name == "hands.json":
            hands = json.loads(path.read_text())
            for frame in hands["frames"]:
                for hand in frame["hands"]:
                    hand.pop("contact", None)
            (args.out / path.name).write_text(json.dumps(hands))
        else:
            (args.out / path.name).symlink_to(path)


if __name__ == "__main__":
    main()
