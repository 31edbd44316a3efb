"""HD-EPIC's narrations, a pickle of a pandas table, as JSON lines that `paws import` reads.

    pip install pandas
    python hdepic_narrations.py HD_EPIC_Narrations.pkl STORAGE/HD_EPIC_Narrations.jsonl

A pickle runs code when it is opened: take it from the data set's own page only.
"""

import json
import sys

import pandas as pd

KEPT = ["unique_narration_id", "video_id", "narration", "start_timestamp", "end_timestamp", "verbs", "nouns"]


def plain(value):
    """A value that JSON has: lists of texts, texts, numbers."""
    if isinstance(value, (list, tuple)) or hasattr(value, "tolist") and getattr(value, "ndim", 0) > 0:
        return [str(v) for v in value]
    if hasattr(value, "item"):
        return value.item()
    return value


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    table = pd.read_pickle(sys.argv[1])
    lacking = [c for c in KEPT if c not in table.columns]
    if lacking:
        sys.exit(f"{sys.argv[1]}: no columns {', '.join(lacking)}; found: {', '.join(map(str, table.columns))}")
    with open(sys.argv[2], "w", encoding="utf-8") as out:
        for _, row in table[KEPT].iterrows():
            out.write(json.dumps({c: plain(row[c]) for c in KEPT}, ensure_ascii=False, allow_nan=False) + "\n")
    print(f"{len(table)} narrations in {sys.argv[2]}")


if __name__ == "__main__":
    main()
