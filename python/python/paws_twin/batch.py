"""Many recordings: `paws batch` from Python, manifests and tables as Parquet."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ._call import AnyPath, PawsError, Progress, call, worker
from .twins import needed

#: The tables of a batch's folder.
TABLES = ("results", "joints", "predictions", "timings")

WORD, COUNT, NUMBER = "word", "count", "number"
#: Columns that are no numbers with a fraction.
COLUMNS = {
    **dict.fromkeys(("name", "recording", "status", "version", "reason"), WORD),
    **dict.fromkeys(("joint", "furniture", "type", "verdict", "clip"), WORD),
    **dict.fromkeys(("code", "clips", "answered", "joints", "pass", "fail", "undetermined"), COUNT),
}
#: Columns of a manifest.
KEYS = ("name", "recording", "recordings", "config")

#: The rows of a table, by its name.
Tables = dict[str, list[dict[str, str]]]


def run(
    manifest: AnyPath | Sequence[Mapping[str, Any]],
    out: AnyPath,
    *,
    progress: Progress | None = None,
    **options: object,
) -> Tables:
    """Makes the twins of a manifest (docs/batch.md) in `out` and answers with its tables, a list of rows each. What is
    finished already is not repeated.

    The manifest is a file (.csv, .jsonl, .parquet), or rows with `recording` (or `recordings`, of one kitchen), `name` and
    `config`; their paths count from the manifest's folder, those of rows from the current one, or from `root`. Options as of
    `paws batch`: `jobs`, `retry`, `config`, `time_limit`, `no_textures`, ... Each recording is worked on by a process of its
    own; `worker` says what starts it where this Python does not: `worker=["paws"]`. With `shard="1/4"`, for programs that run
    the parts on several machines, no table is written and the answer is empty: a last run without it writes them.
    """
    if not os.environ.get("PAWS_COMMAND"):
        options.setdefault("worker", worker())
    with _lines(manifest) as (file, root):
        if root is not None:
            options.setdefault("root", root)
        call("batch", file, progress=progress, out=Path(out), **options)
    return {} if options.get("shard") else tables(out)


def command() -> list[str]:
    """The words that start `paws` as a program of its own: this Python, or what PAWS_COMMAND says."""
    program = os.environ.get("PAWS_COMMAND")
    return [program] if program else worker()


def tables(out: AnyPath) -> Tables:
    """The tables of a batch's folder, every cell as its text."""
    return {name: _rows(Path(out) / f"{name}.csv") for name in TABLES}


def to_parquet(out: AnyPath) -> list[Path]:
    """Writes the tables of a batch's folder as Parquet beside them, for polars, DuckDB and the like. Columns of numbers are
    numbers, an empty cell is null. Needs `pip install 'paws-twin[parquet]'`.
    """
    table = needed("pyarrow.csv", "parquet")
    parquet = needed("pyarrow.parquet", "parquet")
    pyarrow = needed("pyarrow", "parquet")
    written = []
    for name in TABLES:
        file = Path(out) / f"{name}.csv"
        if not file.is_file():
            raise PawsError(f"{file}: no such file or folder; `paws batch MANIFEST --out {out}` writes it")
        with open(file, encoding="utf-8") as opened:
            columns = opened.readline().strip().split(",")
        # Said, not guessed: the same types whatever the rows are.
        kinds = {WORD: pyarrow.string(), COUNT: pyarrow.int64(), NUMBER: pyarrow.float64()}
        types = {column: kinds[COLUMNS.get(column, NUMBER)] for column in columns}
        options = table.ConvertOptions(column_types=types, strings_can_be_null=True, quoted_strings_can_be_null=False)
        rows = table.read_csv(file, convert_options=options, parse_options=table.ParseOptions(newlines_in_values=True))
        target = file.with_suffix(".parquet")
        part = target.with_suffix(".parquet.partial")
        parquet.write_table(rows, part)
        part.replace(target)
        written.append(target)
    return written


@contextlib.contextmanager
def _lines(manifest: Any) -> Iterator[tuple[Path, Path | None]]:
    """A manifest as a file that the command reads, and the folder from which its paths count where that is not the file's."""
    if isinstance(manifest, (str, os.PathLike)):
        file = Path(manifest)
        if file.suffix.lower() != ".parquet":
            yield file, None
            return
        rows, root = _parquet_rows(file), file.parent
    else:
        rows, root = list(manifest), Path()
    with tempfile.TemporaryDirectory(prefix="paws_manifest_") as folder:
        lines = Path(folder) / "manifest.jsonl"
        lines.write_text("".join(_line(row) for row in rows), encoding="utf-8")
        yield lines, root


def _parquet_rows(file: Path) -> list[dict[str, Any]]:
    parquet = needed("pyarrow.parquet", "parquet")
    try:
        there = parquet.read_schema(file).names
        return parquet.read_table(file, columns=[key for key in KEYS if key in there]).to_pylist()
    except FileNotFoundError:
        raise PawsError(f"{file}: no such file or folder") from None
    except OSError as error:
        raise PawsError(f"{file}: {error}") from error
    except ValueError as error:  # pyarrow's errors about what is in a file
        raise PawsError(f"{file}: {error}") from error


def _line(row: Mapping[str, Any]) -> str:
    """A row as a line of JSON; what is empty is left out."""
    kept = {}
    for key in KEYS:
        value = row.get(key)
        if isinstance(value, (list, tuple)):
            value = [os.fspath(one) for one in value]
        elif value is not None:
            # A `Recording` stands for its folder.
            value = os.fspath(value) if isinstance(value, os.PathLike) else str(value)
        if value:
            kept[key] = value
    return json.dumps(kept) + "\n"


def _rows(file: Path) -> list[dict[str, str]]:
    try:
        with open(file, newline="", encoding="utf-8") as opened:
            return list(csv.DictReader(opened))
    except FileNotFoundError:
        raise PawsError(f"{file}: no such file or folder; a run that was killed writes it when it is run again") from None
