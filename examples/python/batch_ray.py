"""A batch on Ray: python batch_ray.py MANIFEST OUT [SHARDS] (pip install ray; RAY_ADDRESS names a cluster, else this machine)

Manifest and output have to be seen by all nodes; paws has to be installed there.
"""

import subprocess
import sys
from pathlib import Path

import paws_twin.batch

try:
    import ray
except ImportError as error:
    sys.exit(f"ray is not installed: {error}")

manifest, out = (str(Path(path).resolve()) for path in sys.argv[1:3])
shards = int(sys.argv[3]) if len(sys.argv) > 3 else 2
ray.init()


# A worker that dies is started again: the journal of its shard says where it was.
@ray.remote(num_cpus=1, max_retries=3)
def shard(number):
    command = ["paws", "batch", manifest, "--out", out, "--shard", f"{number}/{shards}", "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr)
    return number


for number in ray.get([shard.remote(number) for number in range(1, shards + 1)]):
    print(f"shard {number} of {shards} is done")
for row in paws_twin.batch.run(manifest, out)["results"]:
    print(row["name"], row["status"], row["reason"])
