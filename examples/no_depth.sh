#!/usr/bin/env bash
# What depth, sparse points, lines of images and the hands alone are worth: kitchens of a tier, stripped, one table.
#   examples/no_depth.sh TIER [first seed] [kitchens]
# TIER: t0 t1 t2 hd t3 short nonm. Seeds below 1000 are for development, see examples/benchmark.sh.
#   PAWS=PROGRAM       the program [default: built, target/release/paws]
#   PAWS_POINTS=N      sparse points of the room [default: 8000]
#   PAWS_WIDTH=PIXELS  width of the images [default: 320]
# About a minute a kitchen on two cores, most of it with depth.
set -euo pipefail
tier=${1:?"a tier: t0 t1 t2 hd t3 short nonm"} first=${2:-201} count=${3:-4}
here=$(cd "$(dirname "$0")" && pwd)
cd "$here/.."
if [ -z "${PAWS:-}" ]; then
  cargo build --release --quiet
  PAWS=$PWD/target/release/paws
fi
paws=$(realpath "$PAWS")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir points lines hands depth
recordings=()
for ((i = 0; i < count; i++)); do
  name=kitchen_$((first + i))
  "$paws" synth --seed $((first + i)) --tier "$tier" --parts 6 --width "${PAWS_WIDTH:-320}" --out "depth/$name" >/dev/null
  python3 "$here/without.py" "depth/$name" "points/$name" --depth --masks --images --points "${PAWS_POINTS:-8000}"
  python3 "$here/without.py" "depth/$name" "lines/$name" --depth --masks
  python3 "$here/without.py" "depth/$name" "hands/$name" --depth --masks --images
  for case in depth points lines hands; do
    status=0
    "$paws" infer "$case/$name" --follow-links --as-is --physics --out "$case/$name.json" >/dev/null 2>"$case/$name.log" || status=$?
    # 1: no clip has an answer, which is a result.
    [ "$status" -le 1 ] || { cat "$case/$name.log" >&2; exit "$status"; }
  done
  rm -rf "depth/$name"/{frames,depth,masks,normals}
  recordings+=("depth/$name")
done
echo "| tier | there is | M MA MAO STRICT | abstained | within 1 σ | within 2 σ | joint confidence: mean, right |"
echo "| --- | --- | --- | --- | --- | --- | --- |"
for case in depth points lines hands; do
  python3 - "$case"/*.json >"$case.json" <<'MERGE'
import json, sys
rows = [row for name in sys.argv[1:] for row in json.load(open(name))["predictions"]]
json.dump({"predictions": rows}, sys.stdout)
MERGE
  "$paws" evaluate "$case.json" "${recordings[@]}" --json "$case.report" >/dev/null
  python3 - "$tier" "$case" "$case.report" "$case.json" <<'ROW'
import json, sys
tier, case, report, predicted = sys.argv[1], sys.argv[2], json.load(open(sys.argv[3])), json.load(open(sys.argv[4]))
rules = {r["rule"]: r["micro"] for r in report["rules"]}
line, strict = rules["paws_line"], rules["strict"]
shares = " ".join(f"{100 * s:.0f}" for s in (line["m"], line["ma"], line["mao"], strict["mao"]))
cover = {c["of"]: c for c in report["coverage"]}
within = lambda key: " / ".join(f"{100 * cover[of][key]:.0f}" if of in cover else "-" for of in ("axis", "hinge", "range"))
said = [p["joint_confidence"] for p in predicted["predictions"] if p.get("joint_confidence") is not None]
right = line["mao"] * report["clips"] / max(1, report["answered"])
sure = f"{sum(said) / max(1, len(said)):.2f}, {right:.2f}"
name = {"hands": "hands alone"}.get(case, case)
print(f"| `{tier}` | {name} | {shares} | {report['clips'] - report['answered']} | {within('within_one')} | {within('within_two')} | {sure} |")
ROW
done
