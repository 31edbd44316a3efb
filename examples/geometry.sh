#!/usr/bin/env bash
# The steps before the joint inference, ours and the paper's, and the boxes of the room, on synthetic kitchens with a known answer.
#   examples/geometry.sh [first seed] [kitchens]
# About five minutes on two cores, most of it for rendering.
set -euo pipefail
cd "$(dirname "$0")/.."
first=${1:-1001} count=${2:-3}
cargo build --release --quiet
paws=$PWD/target/release/paws
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
for tier in clean realistic hard; do
  recordings=()
  for ((i = 0; i < count; i++)); do
    seed=$((first + i))
    "$paws" synth --seed "$seed" --tier "$tier" --parts 6 --width 640 --out "${tier}_$seed" >/dev/null
    recordings+=("${tier}_$seed")
  done
  for method in ours paper; do
    echo "== $tier, $method"
    if [ "$method" = paper ]; then "$paws" measure --config paper "${recordings[@]}"; else "$paws" measure "${recordings[@]}"; fi
  done
done
