"""The definition of simulation-ready, for twins, in every simulator that is installed.

    DIR/python/bin/python tests/simulators/matrix.py TWIN... [--markdown FILE] [--json FILE] [--paws FILE] [--require]

DIR is where install.py put the simulators. Prints a matrix of points and simulators over all twins, the worst of what
was measured, and every failure with its reason. Exit code 1 if a point fails, or, with --require, if a simulator
that is not optional cannot run.
"""

import argparse
import collections
import concurrent.futures
import functools
import importlib
import json
import multiprocessing
import os
import pathlib
import sys
import time

import definition

# In the order of the columns.
DRIVERS = (
    "text",
    "check_urdf",
    "mujoco",
    "bullet",
    "drake",
    "sapien",
    "pinocchio",
    "yourdfpy",
    "gltf",
    "usd",
)
FORMATS = ("URDF", "MJCF", "glTF", "USD")
# Names of the readers of a driver that cannot be imported.
ABSENT = {
    "mujoco": "MuJoCo",
    "bullet": "PyBullet",
    "drake": "Drake",
    "sapien": "SAPIEN",
    "pinocchio": "Pinocchio",
    "yourdfpy": "yourdfpy",
    "usd": "usd-core",
}
# Simulators whose absence is told and is no failure.
OPTIONAL = {"SAPIEN"}


@functools.lru_cache
def readers(tools, paws):
    """Readers of all drivers, and {simulator: why it cannot run}."""
    found, absent = [], {}
    folders = {"check_urdf": "debian", "gltf": "node", "usd": "usd"}
    for name in DRIVERS:
        try:
            driver = importlib.import_module(f"drivers.{name}")
        except ImportError as error:
            absent[ABSENT.get(name, name)] = str(error)
            continue
        reason = driver.missing(tools / folders[name] if tools else None) if name in folders else None
        if reason:
            absent[name] = reason
        else:
            found += driver.READERS
        if name == "text":
            driver.PAWS = paws
    return sorted(found, key=lambda r: FORMATS.index(r.format)), absent


def answers(reader, twin, numbers=None):
    """What a reader answers to all points or some, and the simulator's version."""
    points = [p for p in definition.POINTS if p.concerns(reader)]
    try:
        made = reader(twin)
    except definition.Unanswered as why:
        return [(p, "n.a.", [str(why)], []) for p in points], ""
    except Exception as error:
        reason = f"{type(error).__name__}: {str(error).strip()[:200]}"
        rows = [(p, *(("FAIL", [reason]) if p.number == 1 else ("n.a.", ["does not load"])), []) for p in points]
        return rows, ""
    return definition.evaluate(twin, made, numbers), str(getattr(made, "version", ""))


def examine(folder, tools, paws):
    """One twin through all readers: rows for the report."""
    twin = definition.Twin(folder)
    rows = []
    for reader in readers(tools, paws)[0]:
        began = time.perf_counter()
        found, version = answers(reader, twin)
        seconds = round(time.perf_counter() - began, 3)
        where = {"twin": twin.name, "format": reader.format, "simulator": reader.simulator}
        for point, status, why, measured in found:
            said = {"point": point.number, "status": status, "reasons": why, "measured": [vars(m) for m in measured]}
            rows.append(where | said | {"version": version, "seconds": seconds})
    return rows


def table(rows):
    """Header and cells: a point a line, a reader a column; a failed cell counts the twins."""
    columns = list(dict.fromkeys((r["format"], r["simulator"]) for r in rows))
    cells = collections.defaultdict(list)
    for r in rows:
        cells[r["point"], r["format"], r["simulator"]].append(r["status"])
    lines = []
    for p in definition.POINTS:
        line = []
        for column in columns:
            found = cells[p.number, *column]
            failed = found.count("FAIL")
            line.append(f"FAIL {failed}/{len(found)}" if failed else "ok" if "ok" in found else "-" if found else "")
        lines.append((p, line))
    return columns, lines


def worst(rows):
    """The largest of every measured number over all twins, a line each."""
    found = collections.defaultdict(dict)
    for r in rows:
        for m in r["measured"]:
            by_reader, reader = found[r["point"], m["what"], m["unit"]], f"{r['format']} {r['simulator']}"
            by_reader[reader] = max(by_reader.get(reader, 0.0), m["value"])
    return [
        f"{n}. {what} ({unit}): " + ", ".join(f"{reader} {value:.2g}" for reader, value in by_reader.items())
        for (n, what, unit), by_reader in sorted(found.items())
    ]


def reasons(rows, status):
    """(reader, reason, points) of a status."""
    found = collections.defaultdict(set)
    for r in rows:
        if r["status"] == status:
            for reason in r["reasons"]:
                twin = "" if status == "n.a." else f"{r['twin']}: "
                found[f"{r['format']} {r['simulator']}", twin + reason].add(r["point"])
    return [(reader, reason, ", ".join(map(str, sorted(points)))) for (reader, reason), points in found.items()]


def as_text(rows, absent):
    columns, lines = table(rows)
    width = max(len(p.title) for p, _ in lines) + 4
    sizes = [max(len(c[0]), len(c[1]), *(len(row[i]) for _, row in lines)) for i, c in enumerate(columns)]
    line = lambda head, cells: head.ljust(width) + "  ".join(c.ljust(s) for c, s in zip(cells, sizes)).rstrip()
    out = [line("", [c[k] for c in columns]) for k in (0, 1)]
    out += [line(f"{p.number:2d} {p.title}", cells) for p, cells in lines]
    out += ["", *worst(rows)]
    out += [f"cannot run: {simulator}: {reason}" for simulator, reason in absent.items()]
    failed = reasons(rows, "FAIL")
    if failed:
        out += ["", "failures:"]
        out += [f"  {points:>5} {reader}: {reason}" for reader, reason, points in failed]
    return "\n".join(out)


def as_markdown(rows, absent):
    columns, lines = table(rows)
    twins = list(dict.fromkeys(r["twin"] for r in rows))
    versions = {r["simulator"]: r["version"] for r in rows if r["version"]}
    out = [f"{len(twins)} twins: {', '.join(twins)}.", ""]
    out += ["| | " + " | ".join(f"{f}<br>{s}" for f, s in columns) + " |", "| --- |" + " --- |" * len(columns)]
    out += [f"| {p.number}. {p.title} | " + " | ".join(cells) + " |" for p, cells in lines]
    out += [
        "",
        "Versions: " + ", ".join(f"{k} {v}" for k, v in versions.items()) + ".",
        "",
        "The worst that was measured:",
        "",
    ]
    out += [f"- {w}" for w in worst(rows)]
    out += ["", "`-`: not asked of that simulator.", ""]
    out += [f"- {reader}, {points}: {reason}" for reader, reason, points in reasons(rows, "n.a.")]
    out += [f"- cannot run: {simulator}: {reason}" for simulator, reason in absent.items()]
    failed = reasons(rows, "FAIL")
    if failed:
        out += ["", "Failures:", ""]
        out += [f"- point {points}, {reader}: {reason}" for reader, reason, points in failed]
    return "\n".join(out) + "\n"


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument(
        "twins", nargs="+", type=pathlib.Path, metavar="TWIN_DIR", help="folders that `paws twin` wrote"
    )
    arguments.add_argument("--tools", type=pathlib.Path, help="folder of install.py (default: the one of this Python)")
    arguments.add_argument(
        "--paws", type=lambda p: str(pathlib.Path(p).resolve()), help="the binary, to write the files again"
    )
    arguments.add_argument("--markdown", type=pathlib.Path, metavar="FILE")
    arguments.add_argument("--json", type=pathlib.Path, metavar="FILE")
    arguments.add_argument(
        "--require", action="store_true", help="a simulator that is not optional and cannot run is a failure"
    )
    arguments.add_argument("--jobs", type=int, default=os.cpu_count(), help="twins at a time")
    args = arguments.parse_args()
    # install.py makes DIR/python for this interpreter and puts the rest beside it.
    tools = (args.tools or pathlib.Path(sys.prefix).parent).resolve()
    definition.self_check()

    absent = readers(tools, args.paws)[1]
    jobs = max(1, min(args.jobs or 1, len(args.twins)))
    # The largest first, so that no process is left with one at the end.
    order = sorted(args.twins, key=lambda twin: -(twin / "twin.json").stat().st_size)
    # Not forked: native libraries do not survive it.
    with concurrent.futures.ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        found = dict(zip(order, pool.map(examine, order, *([x] * len(order) for x in (tools, args.paws)))))
    rows = [row for twin in args.twins for row in found[twin]]
    print(as_text(rows, absent))
    if args.markdown:
        args.markdown.write_text(as_markdown(rows, absent), encoding="utf-8")
    if args.json:
        args.json.write_text(json.dumps({"rows": rows, "cannot_run": absent}, indent=1), encoding="utf-8")
    failed = any(r["status"] == "FAIL" for r in rows)
    return 1 if failed or (args.require and set(absent) - OPTIONAL) else 0


if __name__ == "__main__":
    sys.exit(main())
