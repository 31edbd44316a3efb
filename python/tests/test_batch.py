"""Many recordings, and their tables as Parquet."""

import json
import os
import subprocess
import sys

import pytest

import paws_twin
import paws_twin.batch
from paws_twin import _call, storage
from paws_twin.__main__ import with_worker

native = pytest.mark.skipif(bool(os.environ.get("PAWS_COMMAND")), reason="the command may be an older one")

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


def test_polars_and_duckdb_read_the_tables(tmp_path):
    pytest.importorskip("pyarrow")
    polars, duckdb = pytest.importorskip("polars"), pytest.importorskip("duckdb")
    for name, header in HEADERS.items():
        (tmp_path / f"{name}.csv").write_text(f"{header}\n")
    (tmp_path / "joints.csv").write_text(HEADERS["joints"] + "\nk,joint_0,drawer,prismatic,0.4,pass,\nk,joint_1,door,revolute,1.5,fail,no\n")
    _, joints, *_ = paws_twin.batch.to_parquet(tmp_path)
    assert polars.read_parquet(joints).filter(polars.col("verdict") == "fail")["range"].to_list() == [1.5]
    assert duckdb.sql(f"select joint from '{joints}' where range < 1").fetchall() == [("joint_0",)]


def test_a_manifest_is_rows_or_parquet_too(tmp_path):
    pytest.importorskip("pyarrow")
    import pyarrow
    from pyarrow import parquet

    rows = [{"name": "007", "recordings": ["a", "b"], "note": 1}, {"name": "k", "recordings": None, "recording": "c", "note": 2}]
    parquet.write_table(pyarrow.Table.from_pylist(rows, schema=pyarrow.schema(
        [("name", "string"), ("recordings", pyarrow.list_(pyarrow.string())), ("recording", "string"), ("note", "int64")]
    )), tmp_path / "m.parquet")
    for manifest, root in ((tmp_path / "m.parquet", tmp_path), (rows, paws_twin.batch.Path())):
        with paws_twin.batch._lines(manifest) as (file, found):
            told = [json.loads(line) for line in file.read_text().splitlines()]
        assert told == [{"name": "007", "recordings": ["a", "b"]}, {"name": "k", "recording": "c"}] and found == root
    (tmp_path / "not.parquet").write_text("no")
    for name, words in (("not.parquet", "not.parquet: "), ("absent.parquet", "no such file or folder")):
        with pytest.raises(paws_twin.PawsError, match=words):
            paws_twin.batch.run(tmp_path / name, tmp_path / "out")


def test_what_a_batch_starts_is_this_python_and_no_script_that_lies_about():
    assert _call.worker()[0] == sys.executable and _call.worker()[-2:] == ["-m", "paws_twin"]
    words = with_worker(["batch", "m.csv", "--", "-x"])
    assert words[0] == "batch" and words[1] == f"--worker={sys.executable}" and words[-3:] == ["m.csv", "--", "-x"]
    assert with_worker(["batch", "m.csv", "--worker=paws"]) == ["batch", "m.csv", "--worker=paws"]
    assert with_worker(["twin", "batch"]) == ["twin", "batch"]


def test_a_twin_is_delivered_and_fetched(twin, tmp_path):
    pytest.importorskip("fsspec")
    names = sorted(one.relative_to(twin.path).as_posix() for one in twin.path.rglob("*") if one.is_file())
    for target in (tmp_path / "copy", "memory://bucket/twins/k"):
        assert not storage.is_delivered(target)
        storage.deliver(twin, target)
        assert storage.is_delivered(target)
        with storage.local(target) as folder:
            assert sorted(one.relative_to(folder).as_posix() for one in folder.rglob("*") if one.is_file()) == names
            assert len(paws_twin.Twin(folder).joints) == 2
    with pytest.raises(paws_twin.PawsError, match="no such folder"), storage.local("memory://bucket/nowhere"):
        pass


@native
def test_a_process_of_another_program_does_not_start_itself(recording, tmp_path):
    (tmp_path / "m.csv").write_text(f"recording\n{recording.path}\n")
    with pytest.raises(paws_twin.PawsError, match="say what starts it"):
        _call.call("batch", tmp_path / "m.csv", out=tmp_path / "out")


@native
def test_the_command_of_the_wheel_starts_twins(recording, tmp_path):
    (tmp_path / "m.csv").write_text(f"recording\n{recording.path}\n")
    words = [sys.executable, "-m", "paws_twin", "batch", "m.csv", "--out", "out", "--no-textures"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "out/twins" / recording.name / "twin.json").is_file()


@native
def test_a_worker_that_does_not_end_costs_its_row(recording, tmp_path):
    sleeper = [sys.executable, "-c", "import time; time.sleep(100)"]
    rows = [{"name": "k", "recording": recording}]
    tables = paws_twin.batch.run(rows, tmp_path / "out", worker=sleeper, time_limit=1)
    assert [row["status"] for row in tables["results"]] == ["failed"]
    assert "--time-limit" in tables["results"][0]["reason"]


@native
def test_a_batch_runs_and_repeats_nothing(recording, tmp_path):
    (tmp_path / "m.jsonl").write_text(f'{{"name": "k", "recording": "{recording.path}"}}\n')
    heard = []

    def run(**more):
        return paws_twin.batch.run(tmp_path / "m.jsonl", tmp_path / "out", no_textures=True, **more)

    tables = run(progress=lambda *step: heard.append(step))
    assert [row["status"] for row in tables["results"]] == ["done"] and heard[-1] == ("twins", 1, 1)
    assert len(tables["joints"]) == 2 and paws_twin.Twin(tmp_path / "out/twins/k").validation.passed
    journal = (tmp_path / "out/journal.jsonl").read_text()
    assert run() == tables and run(shard="1/2") == {}
    assert (tmp_path / "out/journal.jsonl").read_text() == journal
