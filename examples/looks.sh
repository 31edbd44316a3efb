#!/usr/bin/env bash
# How twins look beside the recordings that they are made of; where asked, beside Open3D's fusion of the same frames.
#   examples/looks.sh [--peer PYTHON] RECORDING...
# RECORDING: a folder; or TIER:SEED, a synthetic kitchen with the surfaces of wood, tiles, stone and steel (`paws synth --materials`)
# that is rendered, and with which the shape is compared, too.
# PYTHON: a Python with open3d (pip install open3d). It fuses frames in which everything is closed into voxels of 1 cm, with colours
# at the vertices (examples/looks_open3d.py); both are drawn by one rasteriser and compared with the same frames and pixels.
#   PAWS_LOOKS=DIR   keep twins, tables and pictures in this folder
# A minute or two a recording on two cores.
set -euo pipefail
peer=
if [ "${1:-}" = --peer ]; then
  peer=$(command -v "${2:?"a Python that has open3d"}")
  shift 2
fi
[ $# -gt 0 ] || { echo "usage: examples/looks.sh [--peer PYTHON] RECORDING|TIER:SEED..." >&2; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
paws=${PAWS:-}
if [ -z "$paws" ]; then
  (cd "$here/.." && cargo build --release --quiet)
  paws=$here/../target/release/paws
fi
work=${PAWS_LOOKS:-}
if [ -z "$work" ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
mkdir -p "$work"
for recording in "$@"; do
  kitchen=()
  if [[ ! -e $recording && $recording =~ ^[a-z0-9]+:[0-9]+$ ]]; then
    name=${recording/:/_}
    # The twin lies in the folder of the recording's name.
    recording=$work/recordings/$name
    mkdir -p "$work/recordings"
    kitchen=(--kitchen "$work/${name}_kitchen")
    "$paws" synth --tier "${name%_*}" --seed "${name##*_}" --parts 6 --width 480 --materials --out "$recording" "${kitchen[@]}" >/dev/null
  fi
  name=$(basename "$(realpath "$recording")")
  status=0
  "$paws" twin "$recording" --out "$work/$name" >/dev/null || status=$?
  # 1: a joint is refuted or missing, which changes nothing here.
  [ "$status" -le 1 ] || exit "$status"
  against=()
  if [ -n "$peer" ]; then
    "$paws" compare "$work/$name" "$recording" --json "$work/$name.json" >/dev/null
    "$peer" "$here/looks_open3d.py" "$recording" "$work/$name.json" "$work/${name}_open3d.ply"
    against=(--against "$work/${name}_open3d.ply")
  fi
  "$paws" compare "$work/$name" "$recording" "${against[@]}" "${kitchen[@]}" --json "$work/$name.json" --out "$work/${name}_pictures"
  python3 - "$work/$name.json" <<'GOALS'
import json, sys
rows = json.load(open(sys.argv[1]))["summary"]
def of(name, over, key):
    return next((r[key] for r in rows if r["name"] == name and r["over"] == over), None)
def goal(words, value, least):
    if value is not None:
        print(f"{words}: {value:.3f}, wanted {least}: {'reached' if value >= least else 'missed'}")
print()
goal("coverage", of("twin", "closed", "coverage"), 0.9)
goal("SSIM", of("twin", "closed", "ssim"), 0.75)
others = {r["name"] for r in rows} - {"twin"}
for other in sorted(others):
    pair = [of(name, "closed_common", "psnr_db") for name in ("twin", other)]
    if None not in pair:
        goal(f"PSNR above {other}'s, dB", pair[0] - pair[1], 2.0)
GOALS
  echo
done
