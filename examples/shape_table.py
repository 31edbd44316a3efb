#!/usr/bin/env python3
"""One table of comparisons with kitchens that are known.

    examples/shape_table.py COMPARISON.json...

COMPARISON.json: what `paws compare TWIN RECORDING --kitchen KITCHEN --json FILE` wrote. A line a kitchen: F-score, precision and
recall of the room that does not move, coverage and SSIM of the frames in which everything is closed, edges of the fronts (median
and worst, cm), intersection over union of the parts' boxes (median), and how many of the opened parts have a box. Then all of
them together: room and looks as means over kitchens, edges and boxes over all parts; 95 % intervals of kitchens drawn again with
replacement, always the same draws. The worst edge has no interval: it is one edge.
"""

import json
import random
import statistics
import sys

# Kitchens are drawn so many times; more changes no digit that is printed by more than one.
DRAWS = 2000
# Seed of the draws.
SEED = 0


def read(path):
    """What is told of one kitchen."""
    with open(path, encoding="utf-8") as file:
        told = json.load(file)
    shape = next((score for name, score in told.get("shape", []) if name == "twin"), None)
    fronts = told.get("fronts")
    if shape is None or fronts is None:
        sys.exit(f"{path}: has no shape or no fronts: compare with --kitchen, and a recording with its ground_truth.json")
    look = next((r for r in told["summary"] if r["name"] == "twin" and r["over"] == "closed"), {})
    return {
        "name": path.rsplit("/", 1)[-1].removesuffix(".json"),
        "within_cm": 100.0 * shape["within_m"],
        "f": shape["f_score"],
        "precision": shape["precision"],
        "recall": shape["recall"],
        "coverage": look.get("coverage"),
        "ssim": look.get("ssim"),
        "edges": [100.0 * abs(edge) for front in fronts["fronts"] for edge in front["edges_m"]],
        "ious": [front["iou"] for front in fronts["fronts"]],
        "parts": fronts["parts"],
    }


def mean_of(key):
    """The mean over kitchens that have the number."""

    def of(kitchens):
        values = [k[key] for k in kitchens if k[key] is not None]
        return statistics.fmean(values) if values else None

    return of


def median_of(key):
    """The median over all parts of all kitchens."""

    def of(kitchens):
        values = [value for k in kitchens for value in k[key]]
        return statistics.median(values) if values else None

    return of


def share_of_parts(kitchens):
    """Parts with a box, of all that somebody opened."""
    parts = sum(k["parts"] for k in kitchens)
    return sum(len(k["ious"]) for k in kitchens) / parts if parts else None


def worst_edge(kitchens):
    return max((edge for k in kitchens for edge in k["edges"]), default=None)


# Head, digits, what it is of some kitchens, and whether it has an interval.
COLUMNS = (
    ("F-score", 3, mean_of("f"), True),
    ("precision", 3, mean_of("precision"), True),
    ("recall", 3, mean_of("recall"), True),
    ("coverage", 3, mean_of("coverage"), True),
    ("SSIM", 3, mean_of("ssim"), True),
    ("edges, cm", 1, median_of("edges"), True),
    ("worst, cm", 1, worst_edge, False),
    ("IoU", 3, median_of("ious"), True),
    ("with a box", 2, share_of_parts, True),
)


def interval(kitchens, value_of):
    """The middle 95 % of a number over kitchens drawn with replacement."""
    draws = random.Random(SEED)
    found = (value_of(draws.choices(kitchens, k=len(kitchens))) for _ in range(DRAWS))
    values = sorted(value for value in found if value is not None)
    return (values[int(0.025 * len(values))], values[int(0.975 * len(values))]) if values else None


def cell(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__.strip())
    kitchens = [read(path) for path in sys.argv[1:]]
    print("| kitchen | " + " | ".join(head for head, *_ in COLUMNS) + " |")
    print("| --- |" + " --- |" * len(COLUMNS))
    for kitchen in kitchens:
        print(f"| {kitchen['name']} | " + " | ".join(cell(of([kitchen]), digits) for _, digits, of, _ in COLUMNS) + " |")
    together = []
    for _, digits, of, has_interval in COLUMNS:
        text, around = cell(of(kitchens), digits), interval(kitchens, of) if has_interval else None
        together.append(text if around is None else f"{text} ({cell(around[0], digits)} to {cell(around[1], digits)})")
    print("| all | " + " | ".join(together) + " |")
    within = kitchens[0]["within_cm"]
    print(f"\nThe room: points within {within:g} cm. Worst edge: of all parts of all kitchens.")


if __name__ == "__main__":
    main()
