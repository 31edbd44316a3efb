"""A batch on Ray: python batch_ray.py MANIFEST OUT [SHARDS] (pip install ray; RAY_ADDRESS names a cluster, else this machine)

Manifest, recordings and output have to be seen by all nodes, and the package has to be installed there. More shards than cores
keep all cores busy to the end; each shard has a journal, so that whatever dies goes on where it was.
"""

import os
import sys
from pathlib import Path

import paws_twin.batch

try:
    import ray
except ImportError as error:
    sys.exit(f"ray is not installed: {error}")

manifest, out = (str(Path(path).resolve()) for path in sys.argv[1:3])
address = os.environ.get("RAY_ADDRESS")
ray.init(address, include_dashboard=False, log_to_driver=False)
shards = int(sys.argv[3]) if len(sys.argv) > 3 else 4 * int(ray.cluster_resources()["CPU"])
options = {"no_textures": True} if os.environ.get("PAWS_NO_TEXTURES") else {}


# One core is one recording at a time. A worker that dies is started again.
@ray.remote(num_cpus=1, max_retries=3)
def part(number):
    os.environ["RAYON_NUM_THREADS"] = "1"
    paws_twin.batch.run(manifest, out, shard=f"{number}/{shards}", jobs=1, **options)
    return number


left = [part.remote(number) for number in range(1, shards + 1)]
while left:
    done, left = ray.wait(left)
    for number in ray.get(done):
        print(f"shard {number} of {shards} is done")
# What is missing, and the tables.
for row in paws_twin.batch.run(manifest, out, **options)["results"]:
    print(row["name"], row["status"], row["reason"])
