#!/usr/bin/env bash
# Accuracy on synthetic kitchens with a known answer: 12 kitchens, 6 parts each, opened and closed.
#   examples/accuracy.sh [clean|realistic|hard] [first seed] [kitchens]
# About a minute on two cores. The benchmark's tiers: examples/benchmark.sh.
set -euo pipefail
exec "$(dirname "$0")/benchmark.sh" "${1:-realistic}" "${2:-1001}" "${3:-12}"
