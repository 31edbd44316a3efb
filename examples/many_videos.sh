#!/usr/bin/env bash
# One kitchen from many videos: each alone, one long video, and all together, on a synthetic kitchen with a known answer.
#   examples/many_videos.sh [TIER] [seed] [videos] [parts]
# TIER: t0 t1 t2 hd t3 short nonm. Every video opens each part once; the long one opens or closes each part as often as there are
# videos. "together": the videos have one world, which is found out; "own worlds": each has one of its own, and is aligned.
# Seeds below 1000 are for development, seeds from 1000 on for reports. Defaults: t2, seed 1, five videos, six parts; a few minutes
# on two cores.
#   PAWS_KEEP=DIR               keeps recordings, predictions and reports there
# Time and memory of many videos: examples/many_videos.sh t2 1 50 (what is printed before the table; without GNU time only time).
set -euo pipefail
tier=${1:-t2} seed=${2:-1} count=${3:-5} parts=${4:-6}
cd "$(dirname "$0")/.."
cargo build --release --quiet
paws=$PWD/target/release/paws
if [ -n "${PAWS_KEEP:-}" ]; then
  mkdir -p "$PAWS_KEEP"
  work=$(realpath "$PAWS_KEEP")
else
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
cd "$work"
synth=("$paws" synth --seed "$seed" --tier "$tier" --parts "$parts" --width 320)
shared=() own=()
for ((i = 0; i < count; i++)); do
  "${synth[@]}" --clips-per-part 1 --take "$i" --out "video_$i" >/dev/null
  "${synth[@]}" --clips-per-part 1 --take "$i" --own-frame --out "own_$i" >/dev/null
  shared+=("video_$i") own+=("own_$i")
done
"${synth[@]}" --clips-per-part "$((count < 20 ? count : 20))" --out long >/dev/null

# Exit code 1: a clip without an answer or a video that was left out, which is a result.
infer() {
  local name=$1 status=0
  shift
  local timed=()
  if /usr/bin/time -f '' true 2>/dev/null; then timed=(/usr/bin/time -f "$name: %e s, %M KB" -o "$name.time"); fi
  local from=$SECONDS
  "${timed[@]}" "$paws" infer "$@" --physics --out "$name.json" >"$name.txt" 2>"$name.log" || status=$?
  [ "$status" -le 1 ] || { cat "$name.log" >&2; exit "$status"; }
  if [ -s "$name.time" ]; then tail -n 1 "$name.time"; else echo "$name: $((SECONDS - from)) s"; fi
  grep -E 'aligned|same world|left out' "$name.log" | sed 's/^/  /' || true
}
infer alone "${shared[@]}"
infer long long
infer together "${shared[@]}" --together
infer own "${own[@]}" --together
evaluate() {
  local name=$1
  shift
  "$paws" evaluate "$name.json" "$@" --json "$name.report.json" >"$name.report.txt"
}
evaluate alone "${shared[@]}"
evaluate long long
evaluate together "${shared[@]}"
evaluate own "${own[@]}"
python3 - <<'TABLE'
import json

NAMES = {"alone": "each alone", "long": "one long video", "together": "all together", "own": "all, own worlds"}
print(f"\n{'':<16}{'clips':>6}{'MA':>8}{'MAO':>8}{'STRICT':>8}{'SIM':>8}{'pairs said':>12}{'true':>7}{'both':>7}")
for name, words in NAMES.items():
    report = json.load(open(name + ".report.json"))
    rules = {rule["rule"]: rule["micro"] for rule in report["rules"]}
    shares = [rules["paws"]["ma"], rules["paws_line"]["mao"], rules["strict"]["mao"], rules["sim"]["mao"]]
    pairs = report["pairs"] or {"predicted_pairs": 0, "true_pairs": 0, "both": 0}
    counts = [pairs["predicted_pairs"], pairs["true_pairs"], pairs["both"]]
    row = "".join(f"{share:8.3f}" for share in shares)
    print(f"{words:<16}{report['clips']:>6}{row}{counts[0]:>12}{counts[1]:>7}{counts[2]:>7}")
TABLE
