#!/usr/bin/env bash
# The benchmark: kitchens of a tier with a known answer, 12 clips each, one table.
#   examples/benchmark.sh TIER [first seed] [kitchens] [ours|paper|paper_s|NAME|FILE.toml]
# TIER: t0 t1 t2 hd t3 short nonm (clean realistic hard: the other kitchens). Seeds below 1000 are for development; seeds from
# 1000 on are for reports only, and no value may be chosen by what comes out on them. 20 kitchens are 240 clips.
# paper: the paper's PAWS, every clip for itself; paper_s: its PAWS-s, clips of one part together; NAME: one of
# examples/ablations, as ours_no_names.
#   PAWS_SYNTH="--few-hands 3"  more options of `paws synth`: --hand-noise, --depth-bias, --word-error, --clips-per-part, ...
#   PAWS_REPORT=FILE            the whole report as JSON, too
#   PAWS_EVALUATE="--details"   more options of `paws evaluate`: groups, errors, part boxes, calibration
# Inference asks physics about joints in doubt, as `paws twin` does (not under `paper` and `paper_s`).
# Images are deleted as soon as a kitchen is done: about 60 MB of disk at a time.
set -euo pipefail
tier=${1:?"a tier: t0 t1 t2 hd t3 short nonm"} first=${2:-1} count=${3:-20} config=${4:-ours}
report=${PAWS_REPORT:+$(realpath -m "$PAWS_REPORT")}
read -r -a extra <<<"${PAWS_SYNTH:-}"
read -r -a asked <<<"${PAWS_EVALUATE:-}"
here=$(cd "$(dirname "$0")" && pwd)
method=()
if [ -f "$config" ]; then
  method=(--config "$(realpath "$config")")
elif [ "$config" != ours ] && [ -f "$here/ablations/$config.toml" ]; then
  method=(--config "$here/ablations/$config.toml")
elif [ "$config" != ours ]; then
  method=(--config "$config")
fi
cd "$here/.."
cargo build --release --quiet
paws=$PWD/target/release/paws
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
recordings=()
for ((i = 0; i < count; i++)); do
  name=kitchen_$((first + i))
  "$paws" synth --seed $((first + i)) --tier "$tier" --parts 6 "${extra[@]}" --out "$name" >/dev/null
  status=0
  "$paws" infer "$name" --physics "${method[@]}" --out "$name.json" >/dev/null || status=$?
  # 1: no clip has an answer, which is a result.
  [ "$status" -le 1 ] || exit "$status"
  rm -rf "$name"/{frames,depth,masks,normals}
  recordings+=("$name")
done
python3 - "${recordings[@]}" >predictions.json <<'MERGE'
import json, sys
rows = [row for name in sys.argv[1:] for row in json.load(open(name + ".json"))["predictions"]]
json.dump({"predictions": rows}, sys.stdout)
MERGE
"$paws" evaluate predictions.json "${recordings[@]}" "${asked[@]}" ${report:+--json "$report"}
