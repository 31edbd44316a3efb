#!/usr/bin/env bash
# The shape of twins against synthetic kitchens that are known: the room, the edges of fronts, the boxes of parts.
#   examples/shape.sh TIER [first seed] [kitchens]
# TIER: t0 t1 t2 hd t3 short nonm, clean realistic hard. Seeds below 1000 are for development, from 1000 on for reports only.
# Each kitchen is rendered, its twin made and compared with it (`paws compare --kitchen`, docs/compare.md). A line a kitchen, then
# the mean over kitchens and its 95 % interval: kitchens drawn again with replacement (examples/shape_table.py).
#   PAWS=FILE           the binary; it is built otherwise
#   PAWS_SHAPE=DIR      keep twins and comparisons in this folder
#   PAWS_PARTS=6        parts that are opened
#   PAWS_SYNTH="..."    more options of `paws synth`: --materials, --width, ...
# Two or three minutes a kitchen on two cores; recordings are deleted as soon as they are compared.
set -euo pipefail
tier=${1:?"a tier: t0 t1 t2 hd t3 short nonm clean realistic hard"} first=${2:-201} count=${3:-8}
read -r -a extra <<<"${PAWS_SYNTH:-}"
here=$(cd "$(dirname "$0")" && pwd)
paws=${PAWS:-}
if [ -z "$paws" ]; then
  (cd "$here/.." && cargo build --release --quiet)
  paws=$here/../target/release/paws
fi
paws=$(realpath "$paws")
work=${PAWS_SHAPE:-}
if [ -z "$work" ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
mkdir -p "$work"
cd "$work"
compared=()
for ((i = 0; i < count; i++)); do
  name=${tier}_$((first + i))
  "$paws" synth --seed $((first + i)) --tier "$tier" --parts "${PAWS_PARTS:-6}" "${extra[@]}" --out "$name" \
    --kitchen "${name}_kitchen" >/dev/null
  status=0
  "$paws" twin "$name" --out "${name}_twin" >/dev/null || status=$?
  # 1: a joint is refuted or missing, which the table counts.
  [ "$status" -le 1 ] || exit "$status"
  "$paws" compare "${name}_twin" "$name" --kitchen "${name}_kitchen" --json "$name.json" >/dev/null
  rm -rf "$name" "${name}_kitchen"
  compared+=("$name.json")
done
python3 "$here/shape_table.py" "${compared[@]}"
