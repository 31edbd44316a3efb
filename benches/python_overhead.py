#!/usr/bin/env python3
"""What Python costs: the same twin by the command and by paws_twin.twin in this process, in turns.

    python3 benches/python_overhead.py RECORDING --paws target/release/paws [--rounds 9] [-- --no-textures]

Needs the wheel in this Python, built of the same source. Tells the median of the differences of neighbours as a share of the
command's median, and that of the processor's seconds; the goal is below 2 %. Ends with 1 where the twins' models differ.
"""

import argparse
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import paws_twin

MODELS = ("twin.json", "validation.json", "predictions.json", "scene.xml", "scene.urdf", "scene.usda")


def measured(action):
    """Wall-clock seconds, and the processor's of this process and its children."""
    before, begun = used(), time.monotonic()
    action()
    return time.monotonic() - begun, used() - before


def used():
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


def main():
    parser = argparse.ArgumentParser(description="Overhead of the Python module.")
    parser.add_argument("recording", type=pathlib.Path)
    parser.add_argument("--paws", required=True, help="the program")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--no-textures", action="store_true")
    args = parser.parse_args()
    os.environ.pop("PAWS_COMMAND", None)
    options = ["--no-textures"] if args.no_textures else []
    with tempfile.TemporaryDirectory() as work:
        by_command, by_python = pathlib.Path(work) / "command", pathlib.Path(work) / "python"

        def command():
            words = [args.paws, "twin", str(args.recording), "--out", str(by_command), *options]
            done = subprocess.run(words, capture_output=True)
            if done.returncode not in (0, 1):
                sys.exit(done.stderr.decode(errors="replace"))

        def module():
            paws_twin.twin(args.recording, by_python, no_textures=args.no_textures)

        # What is done once in a process: importing, threads.
        first, _ = measured(module)
        rows = []
        for number in range(args.rounds):
            pair = {}
            for action in (command, module) if number % 2 == 0 else (module, command):
                pair[action.__name__] = measured(action)
            rows.append(pair)
        same = all((by_command / name).read_bytes() == (by_python / name).read_bytes() for name in MODELS)
    for at, name in ((0, "wall-clock"), (1, "processor")):
        usual = statistics.median(pair["command"][at] for pair in rows)
        more = statistics.median(pair["module"][at] - pair["command"][at] for pair in rows)
        print(f"{name}: command {usual:.3f} s, module {100 * more / usual:+.2f} % of that")
    print(f"the first call in a process: {first:.3f} s; the same models: {'yes' if same else 'NO'}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
