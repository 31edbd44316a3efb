"""A log for the rerun viewer: python log_to_rerun.py [RECORDING [FILE.rrd]]; then rerun FILE.rrd"""

import sys

import paws_twin

if len(sys.argv) > 1:
    recording = paws_twin.Recording(sys.argv[1])
else:
    recording = paws_twin.synth(seed=3, tier="clean", width=160, parts=1)
twin = paws_twin.twin(recording)
file = paws_twin.rerun_log(recording, twin, sys.argv[2] if len(sys.argv) > 2 else "recording.rrd")
print(f"{file}: {file.stat().st_size / 1e6:.1f} MB; look: rerun {file}")
