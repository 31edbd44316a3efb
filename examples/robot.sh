#!/usr/bin/env bash
# A gripper opens the doors of synthetic kitchens: on their twins, and on the true kitchens by the recording's primitives.
#   PYTHON=venv/bin/python examples/robot.sh TIER [first seed] [kitchens] [arm]
# TIER: realistic, t2, ... (`paws synth --help`). PYTHON needs mujoco and numpy; with `arm` also mink and gymnasium-robotics.
# A line a kitchen for each of: twin, truth, truth with the handle seen (look), the Panda on the twin (arm).
set -euo pipefail
tier=${1:?"a tier: realistic t2 ..."} first=${2:-301} count=${3:-20} arm=${4:-}
python=$(command -v "${PYTHON:-python3}")
[[ $python = /* ]] || python=$PWD/$python
cd "$(dirname "$0")/.."
cargo build --release --quiet
paws=$PWD/target/release/paws
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
run() {
  # A joint that stays shut is an answer, not an error; the last line counts.
  local name=$1
  shift
  printf '%s %-5s ' "$seed" "$name"
  "$python" "$@" 2>"$work/errors" | tail -n 1 || [ "${PIPESTATUS[0]}" = 1 ] || { cat "$work/errors" >&2; return 2; }
}
for seed in $(seq "$first" $((first + count - 1))); do
  "$paws" synth --seed "$seed" --tier "$tier" --out "$work/rec" --kitchen "$work/truth" >/dev/null
  # 1: a joint was refuted, the twin is there.
  "$paws" twin "$work/rec" --out "$work/twin" >/dev/null 2>&1 || [ $? = 1 ]
  run twin examples/python/open_doors.py "$work/twin"
  run truth examples/python/open_doors.py "$work/twin" --truth "$work/truth"
  run look examples/python/open_doors.py "$work/twin" --truth "$work/truth" --look
  if [ -n "$arm" ]; then run arm examples/python/open_doors_arm.py "$work/twin"; fi
done
