#!/usr/bin/env bash
# All comparisons with other programs, one after the other, on this machine.
#   benches/beside.sh [RECORDING...]
# - stages beside the peers of PAWS_PEERS, else of ../shared/peers: skipped where there is no such folder, which is said
# - readers of large files beside polars, pycolmap, Open3D, numpy
# - twins of 500 joints beside scene_synthesizer, loaded by MuJoCo and PyBullet
# - replays of the recorded hands of two kitchens beside MuJoCo and PyBullet, where the tests have installed these
# - of each RECORDING (`paws synth`, say) the look beside Open3D's fusion
# What they need is installed from PyPI once (target/tmp/beside/python, 3 GB); Open3D also needs libusb-1.0-0 libgl1 libegl1 libgomp1.
# Each comparison's table stays in target/tmp/beside: a run that was stopped goes on with what is missing; delete one to have it again.
# About an hour on two cores that do nothing else, most of it for the stages; times on a busy machine say nothing.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
recordings=()
for recording in "$@"; do recordings+=("$(realpath "$recording")"); done
cd "$root"
target=${CARGO_TARGET_DIR:-$root/target}
out=$target/tmp/beside
peers=${PAWS_PEERS:-$root/../shared/peers}
mkdir -p "$out"
cargo build --release --quiet
paws=$target/release/paws
wanted=(numpy polars pycolmap open3d scene_synthesizer usd-core mujoco pybullet)
[ ! -f "$peers/requirements.txt" ] || wanted=(-r "$peers/requirements.txt" pycolmap usd-core)
python=$out/python/bin/python
if [ ! -f "$out/python.installed" ]; then
  python3 -m venv --clear "$out/python"
  "$python" -m pip install --quiet "${wanted[@]}"
  touch "$out/python.installed"
fi
failed=0
# A comparison whose output is the table; what it says beside goes to NAME.log.
compare() {
  local name=$1
  shift
  if [ -s "$out/$name.md" ]; then
    echo "$name: done before" >&2
    return
  fi
  echo "$name ..." >&2
  if "$@" >"$out/$name.part" 2>"$out/$name.log"; then
    mv "$out/$name.part" "$out/$name.md"
  else
    failed=1
    echo "$name: failed: $(tail -n 1 "$out/$name.log")" >&2
  fi
}
if [ -d "$peers" ]; then
  compare stages python3 benches/side_by_side.py "$peers" --python "$python"
else
  echo "stages: skipped: there is no folder of peers at $peers (PAWS_PEERS names another)" >&2
fi
compare readers python3 benches/import_side_by_side.py --python "$python" --paws "$paws"
compare twins python3 benches/export_side_by_side.py --python "$python" --paws "$paws"
simulators=$target/tmp/simulators/python/bin/python
if [ -x "$simulators" ]; then
  twins=()
  for kitchen in t2:1 hd:3; do
    name=$out/kitchen_${kitchen%:*}_${kitchen#*:}
    [ -d "$name" ] || "$paws" synth --seed "${kitchen#*:}" --tier "${kitchen%:*}" --parts 6 --out "$name" >/dev/null
    # 1: a joint is refuted or missing, which changes nothing here.
    [ -d "$name.twin" ] || "$paws" twin "$name" --no-textures --out "$name.twin" >/dev/null || [ $? -eq 1 ]
    twins+=("$name.twin")
  done
  compare replays "$simulators" benches/replay_side_by_side.py "${twins[@]}"
else
  echo "replays: skipped: $simulators is not there, \`cargo test --release --test it simulators\` installs it" >&2
fi
for recording in "${recordings[@]}"; do
  compare "look_$(basename "$recording")" env PAWS="$paws" examples/looks.sh --peer "$python" "$recording"
done
for table in "$out"/*.md; do
  [ -f "$table" ] || continue
  printf '\n== %s\n\n' "$(basename "$table" .md)"
  cat "$table"
done
exit $failed
