"""The forecast for a cluster, of scans that are written into a folder."""

import json
import runpy
import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


def test_the_folder_may_be_relative_to_the_current_one(tmp_path, monkeypatch, capsys):
    program = str(BENCHMARKS / "cluster.py")
    counts = ["--measured", "2", "--folded", "1"]
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(BENCHMARKS)
    monkeypatch.setattr(sys, "argv", [program, "cohort", *counts])
    runpy.run_path(program, run_name="__main__")
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert rows["measured"]["scans"] == 2
    assert len(rows["folded"]["simulation_MiB"]) == 1
