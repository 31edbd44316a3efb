"""A batch as a step of a Daft pipeline, recordings and twins in an object store: python batch_daft.py MANIFEST OUT (pip install daft)

    python batch_daft.py s3://bucket/manifest.parquet s3://bucket/twins       # fsspec's protocols: pip install s3fs

The manifest (.parquet or .csv) has the columns name and recording, each recording a path or a URL. Of each a twin is delivered to
OUT/twins/NAME; OUT/results has a row each, as Parquet. A twin that is there, whole, is not made again.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import paws_twin
from paws_twin import batch, storage

try:
    import daft
except ImportError as error:
    sys.exit(f"daft is not installed: {error}")

manifest, out = sys.argv[1:3]
# From where a recording's path counts.
home = manifest.rpartition("/")[0] or "."
options = ["--no-textures"] if os.environ.get("PAWS_NO_TEXTURES") else []
word, count = daft.DataType.string(), daft.DataType.int64()
answer = {"status": word, "joints": count, "passed": count, "reason": word}


def result(twin):
    """The answer about a twin that was made."""
    verdicts = [joint.verdict for joint in twin.validation.joints]
    status = "no" if not verdicts or "fail" in verdicts else "done"
    return {"status": status, "joints": len(verdicts), "passed": verdicts.count("pass"), "reason": None}


@daft.func(return_dtype=daft.DataType.struct(answer), use_process=False, cpus=1)
def made(name: str, recording: str):
    target = f"{out}/twins/{name}"
    if "://" not in recording and not recording.startswith("/"):
        recording = f"{home}/{recording}"
    if storage.is_delivered(target):
        with storage.local(target) as folder:
            return result(paws_twin.Twin(folder))
    try:
        with storage.local(recording) as folder, tempfile.TemporaryDirectory() as work:
            # In a process of its own: a crash costs this row.
            command = [*batch.command(), "twin", str(folder), "--out", f"{work}/twin", *options]
            one_core = {**os.environ, "RAYON_NUM_THREADS": "1"}
            done = subprocess.run(command, capture_output=True, text=True, env=one_core, timeout=24 * 3600)
            if done.returncode not in (0, 1):
                return {"status": "failed", "joints": None, "passed": None, "reason": done.stderr[-500:]}
            storage.deliver(f"{work}/twin", target)
            return result(paws_twin.Twin(f"{work}/twin"))
    except (paws_twin.PawsError, OSError, subprocess.TimeoutExpired) as error:
        return {"status": "failed", "joints": None, "passed": None, "reason": str(error)}


if manifest.endswith(".parquet"):
    rows = daft.read_parquet(manifest)
else:
    # Names are words, whatever they look like.
    rows = daft.read_csv(manifest, schema={"name": word, "recording": word})
rows = rows.select("name", "recording").with_column("made", made(daft.col("name"), daft.col("recording")))
columns = [daft.col("made").get(key).alias(key) for key in answer]
results = rows.select("name", "recording", *columns).sort("name").collect()
if "://" not in out:
    Path(out).mkdir(parents=True, exist_ok=True)
results.write_parquet(f"{out}/results", write_mode="overwrite")
for row in results.to_pylist():
    print(row["name"], row["status"], row["reason"] or "")
