"""Many recordings, and their tables as Parquet."""

import os

import pytest

import paws_twin
import paws_twin.batch

HEADERS = {
    "results": "name,recording,status,code,clips,answered,joints,pass,fail,undetermined,version,reason",
    "joints": "name,joint,furniture,type,range,verdict,reason",
    "predictions": "name,recording,clip,type,range,joint,reason",
    "timings": "name,secs",
}


def test_tables_become_parquet_with_the_same_types_whatever_they_hold(tmp_path):
    pytest.importorskip("pyarrow")
    from pyarrow import parquet

    rows = {
        "results": '007,a/b,failed,2,,,,,,,0.1.0,"two\nlines, and a comma"\n',
        "joints": "",
        "predictions": "007,b,1,,,,no hand\n",
        "timings": "007,1.5\n",
    }
    for name, header in HEADERS.items():
        (tmp_path / f"{name}.csv").write_text(f"{header}\n{rows[name]}")
    files = paws_twin.batch.to_parquet(tmp_path)
    assert [file.name for file in files] == [f"{name}.parquet" for name in paws_twin.batch.TABLES]
    (result,) = parquet.read_table(files[0]).to_pylist()
    assert (result["name"], result["code"], result["clips"]) == ("007", 2, None)
    assert result["reason"] == "two\nlines, and a comma"
    assert str(parquet.read_schema(files[1]).field("range").type) == "double"
    (prediction,) = parquet.read_table(files[2]).to_pylist()
    assert (prediction["clip"], prediction["type"], prediction["range"]) == ("1", None, None)


def test_a_folder_without_tables_says_what_writes_them(tmp_path):
    pytest.importorskip("pyarrow")
    with pytest.raises(paws_twin.PawsError, match=r"results.csv: no such file or folder; `paws batch"):
        paws_twin.batch.to_parquet(tmp_path)


@pytest.mark.skipif(bool(os.environ.get("PAWS_COMMAND")), reason="the command may be an older one")
def test_a_batch_runs_and_repeats_nothing(recording, tmp_path):
    (tmp_path / "m.jsonl").write_text(f'{{"name": "k", "recording": "{recording.path}"}}\n')
    heard = []
    tables = paws_twin.batch.run(tmp_path / "m.jsonl", tmp_path / "out", progress=lambda *step: heard.append(step))
    assert [row["status"] for row in tables["results"]] == ["done"] and heard[-1] == ("twins", 1, 1)
    assert len(tables["joints"]) == 2 and paws_twin.Twin(tmp_path / "out/twins/k").validation.passed
    journal = (tmp_path / "out/journal.jsonl").read_text()
    assert paws_twin.batch.run(tmp_path / "m.jsonl", tmp_path / "out") == tables
    assert (tmp_path / "out/journal.jsonl").read_text() == journal
