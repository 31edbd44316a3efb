#!/usr/bin/env bash
# Accuracy on synthetic kitchens with a known answer: 12 kitchens, 6 parts each, opened and closed.
#   examples/accuracy.sh [clean|realistic|hard] [first seed] [kitchens]
# About a minute on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
tier=${1:-realistic} first=${2:-1001} count=${3:-12}
cargo build --release --quiet
paws=$PWD/target/release/paws
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
recordings=()
for ((i = 0; i < count; i++)); do
  seed=$((first + i))
  "$paws" synth --seed "$seed" --tier "$tier" --parts 6 --out "kitchen_$seed" >/dev/null
  recordings+=("kitchen_$seed")
done
"$paws" infer "${recordings[@]}" --out predictions.json >/dev/null
"$paws" evaluate predictions.json "${recordings[@]}"
