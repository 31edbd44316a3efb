#!/usr/bin/env bash
# How often clips that are judged together have a worse joint than the best of them alone, and how often a better one, by tier.
#   examples/merged_or_alone.sh [first seed] [kitchens] [TIER...]     (201 8 t1 t2 hd t3)
# A part counts by MAO (point to line), STRICT and SIM: "worse" where no clip of it is right together though one alone is
# (`ours_no_merge`), "better" where one is right together though none alone is. The clips that are right each way stand beside.
# Seeds below 1000 are for development, see examples/benchmark.sh.
#   PAWS=PROGRAM      the program [default: built, target/release/paws]
#   PAWS_MERGED=DIR   keep tables and predictions in this folder: a run that was stopped goes on where it was
# About a minute a kitchen and tier on two cores; 60 MB of disk at a time.
set -euo pipefail
first=${1:-201} count=${2:-8}
tiers=("${@:3}")
[ ${#tiers[@]} -gt 0 ] || tiers=(t1 t2 hd t3)
here=$(cd "$(dirname "$0")" && pwd)
if [ -z "${PAWS:-}" ]; then
  (cd "$here/.." && cargo build --release --quiet)
  PAWS=$here/../target/release/paws
fi
paws=$(realpath "$PAWS")
if [ -n "${PAWS_MERGED:-}" ]; then
  work=$(realpath -m "$PAWS_MERGED")
  mkdir -p "$work"
else
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
cd "$work"
for tier in "${tiers[@]}"; do
  for ((seed = first; seed < first + count; seed++)); do
    name=${tier}_$seed
    [ ! -s "$name.alone.csv" ] || continue
    rm -rf "$name"
    "$paws" synth --seed "$seed" --tier "$tier" --parts 6 --out "$name" >/dev/null
    for how in together alone; do
      config=$here/ablations/ours.toml
      [ $how = together ] || config=$here/ablations/ours_no_merge.toml
      status=0
      "$paws" infer "$name" --physics --config "$config" --out "$name.$how.json" >/dev/null 2>"$name.log" || status=$?
      # 1: no clip has an answer, which is a result.
      [ "$status" -le 1 ] || { cat "$name.log" >&2; exit "$status"; }
      "$paws" evaluate "$name.$how.json" "$name" --csv "$name.part.csv" >/dev/null
      mv "$name.part.csv" "$name.$how.csv"
    done
    rm -rf "$name"
    echo "$name" >&2
  done
done
python3 - "$first" "$count" "${tiers[@]}" <<'TABLE'
import collections, csv, sys

first, count, tiers = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
rules = [("paws_line", "MAO"), ("strict", "STRICT"), ("sim", "SIM")]


def verdicts(tier, how, rule):
    """Of each part, whether its clips are right."""
    out = collections.defaultdict(list)
    for seed in range(first, first + count):
        for row in csv.DictReader(open(f"{tier}_{seed}.{how}.csv")):
            out[seed, row["joint"]].append(row[rule] == "MAO")
    return out


print("| tier | rule | parts | worse together | better together | clips right together | alone |")
print("| --- | --- | --- | --- | --- | --- | --- |")
for tier in tiers:
    for rule, name in rules:
        together, alone = (verdicts(tier, how, rule) for how in ("together", "alone"))
        worse = sum(any(alone[part]) and not any(clips) for part, clips in together.items())
        better = sum(any(clips) and not any(alone[part]) for part, clips in together.items())
        right = [sum(map(sum, by.values())) for by in (together, alone)]
        clips = sum(map(len, together.values()))
        print(f"| `{tier}` | {name} | {len(together)} | {worse} | {better} | {right[0]} of {clips} | {right[1]} |")
TABLE
