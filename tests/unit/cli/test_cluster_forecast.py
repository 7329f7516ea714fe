"""The forecast for a cluster, of scans that are written into a folder."""

import json
import sys
from pathlib import Path

from processes import ran

PROGRAM = Path(__file__).parents[3] / "benchmarks" / "cluster.py"


def test_the_folder_may_be_relative_to_the_current_one(tmp_path):
    counts = ("--measured", "2", "--folded", "1")
    done = ran(sys.executable, str(PROGRAM), "cohort", *counts, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout.splitlines()[-1])
    assert rows["measured"]["scans"] == 2
    assert len(rows["folded"]["simulation_MiB"]) == 1
