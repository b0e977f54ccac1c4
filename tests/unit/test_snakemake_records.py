"""Records of Snakemake are found by their outputs, put in order, and lose their times."""

from __future__ import annotations

import base64
import json

from keystab.provenance.snakemake_records import FOLDER, read_records, settings_behind, upstream

FIELDS = {
    "rule": "make", "input": [], "shellcmd": "make  \n it", "params": [], "input_checksums": {},
    "starttime": 100.0, "endtime": 112.34, "job_hash": 5, "external_jobid": None,
}  # fmt: skip


def write(project, output, **fields):
    name = base64.urlsafe_b64encode(output.encode()).decode()
    parts = [name[i : i + 254] for i in range(0, len(name), 254)]  # as Snakemake splits long names
    path = project.joinpath(FOLDER, *("@" + part for part in parts[:-1]), parts[-1])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(FIELDS | fields))


def test_records_are_found_by_outputs_of_any_length(tmp_path):
    long = "results/" + 30 * "a_long_name/" + "ü.csv"
    for output in ("b.csv", long, "a/~?.csv"):
        write(tmp_path, output)
    (tmp_path / FOLDER / "bm9uZQ==").write_text("{")  # cut off by a kill
    (tmp_path / FOLDER / "not base64").write_text("{}")
    assert list(read_records(tmp_path)) == sorted(["b.csv", long, "a/~?.csv"])
    assert read_records(tmp_path)["b.csv"].command == "make it"
    assert read_records(tmp_path / "elsewhere") == {}


def test_what_is_behind_a_file_comes_after_its_own_inputs(tmp_path):
    write(tmp_path, "figure", input=["table", "other"])
    write(tmp_path, "table", input=["points"], params=["detector.kappa = 1.26", "'code'"])
    write(tmp_path, "other", input=["points"], params=["detector.kappa = 1.3"])
    write(tmp_path, "points", input=["picture"], params=["still.blur = 1.1"])
    write(tmp_path, "unrelated", params=["blobs.n_spo = 3"])
    chain = upstream(read_records(tmp_path), ["figure"])
    names = [record.output for record in chain]
    assert sorted(names) == ["figure", "other", "points", "table"]
    for record in chain:
        for name in set(record.inputs) & set(names):
            assert names.index(name) < names.index(record.output)
    assert settings_behind(chain) == {"detector.kappa": "1.26 | 1.3", "still.blur": "1.1"}


def test_records_of_two_runs_that_did_the_same_in_the_same_time_are_the_same(tmp_path):
    for folder, start in (("one", 100.0), ("two", 5000.0)):
        write(tmp_path / folder, "a", starttime=start, endtime=start + 12.34, job_hash=hash(folder))
        write(tmp_path / folder, "b", starttime=start, endtime=start + 12.34, job_hash=hash(folder))
    one, two = (read_records(tmp_path / folder) for folder in ("one", "two"))
    assert one["a"].timeless() == two["a"].timeless()
    fields = [json.loads(one[name].timeless()) for name in ("a", "b")]
    assert fields[0]["endtime"] == 12.3 and fields[0]["starttime"] == 0.0
    assert fields[0]["job_hash"] == fields[1]["job_hash"]  # two outputs of one job
    assert json.loads(one["a"].timeless()) | FIELDS == FIELDS
