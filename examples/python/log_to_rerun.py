"""A log for the rerun viewer: python log_to_rerun.py [RECORDING] [--rerun FILE.rrd]; then rerun FILE.rrd"""

import argparse
from pathlib import Path

import paws_twin

parser = argparse.ArgumentParser()
parser.add_argument("recording", nargs="?", help="a folder; else a small kitchen is rendered")
parser.add_argument("--rerun", default="recording.rrd", metavar="FILE.rrd", help="the log [default: recording.rrd]")
args = parser.parse_args()

recording = args.recording or paws_twin.synth(seed=3, tier="clean", width=160, parts=1)
# The twin's own log, written beside it as soon as it is made; paws_twin.rerun_log(recording, twin, file) is the same afterwards.
twin = paws_twin.twin(recording, rerun=args.rerun)
file = Path(args.rerun)
print(f"{file}: {file.stat().st_size / 1e6:.1f} MB; look: rerun {file}")
