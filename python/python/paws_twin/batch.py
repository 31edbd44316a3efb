"""Many recordings: `paws batch` from Python, and its tables as Parquet."""

from __future__ import annotations

import csv
from pathlib import Path

from .__main__ import say_program
from ._call import PawsError, Progress, call
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


def run(manifest, out, *, progress: Progress | None = None, **options) -> dict[str, list[dict[str, str]]]:
    """Makes the twins of a manifest (docs/batch.md) in `out` and answers with its tables, a list of rows each. What is
    finished already is not repeated. Options as of `paws batch`: `jobs`, `retry`, `config`.
    """
    say_program()
    call("batch", manifest, progress=progress, out=Path(out), **options)
    return tables(out)


def tables(out) -> dict[str, list[dict[str, str]]]:
    """The tables of a batch's folder, every cell as its text."""
    return {name: _rows(Path(out) / f"{name}.csv") for name in TABLES}


def to_parquet(out) -> list[Path]:
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


def _rows(file: Path) -> list[dict[str, str]]:
    try:
        with open(file, newline="", encoding="utf-8") as opened:
            return list(csv.DictReader(opened))
    except FileNotFoundError:
        raise PawsError(f"{file}: no such file or folder; a run that was killed writes it when it is run again") from None
