"""A batch of recordings: python many_recordings.py [DIR]"""

import csv
import sys
import tempfile
from pathlib import Path

import paws_twin
import paws_twin.batch

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="paws_batch_"))

# 1. Recordings, and a manifest that names them. The last one is not there: that costs its row only.
with open(folder / "manifest.csv", "w", newline="") as file:
    rows = csv.writer(file)
    rows.writerow(["name", "recording"])
    for seed in (3, 4):
        paws_twin.synth(folder / f"kitchen_{seed}", seed=seed, tier="clean", width=96, parts=1)
        rows.writerow([f"kitchen_{seed}", f"kitchen_{seed}"])
    rows.writerow(["lost", "nowhere"])

# 2. The batch. It may be killed at any moment: what is finished is not repeated when it runs again.
tables = paws_twin.batch.run(folder / "manifest.csv", folder / "out", jobs=2, no_textures=True)
for row in tables["results"]:
    print(row["name"], row["status"], row["reason"])

# 3. Its tables for polars, DuckDB and the like.
for file in paws_twin.batch.to_parquet(folder / "out"):
    print(file)
