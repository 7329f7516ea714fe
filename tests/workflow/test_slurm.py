"""The workflow through `profiles/slurm` on a real Slurm, with what happens on clusters: cancelled jobs, lost nodes."""

import shutil
import subprocess
import time
from importlib.util import find_spec

import numpy as np
import pandas as pd
import pytest

from gyriflow.io.files import read_json
from gyriflow.io.frames import read_positions

from .conftest import SMALL_STUDY
from .slurm_cluster import cluster, missing

PLUGIN = "snakemake_executor_plugin_slurm"
LACKING = [*missing(), *([] if find_spec(PLUGIN) else [PLUGIN.replace("_", "-")])]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(LACKING), reason=f"not installed here: {', '.join(LACKING)} (docs/how-to/cluster.md)"),
]

STUDY = SMALL_STUDY | {
    "brains": SMALL_STUDY["brains"][:1],
    # so many steps that both runs are under way together
    "folding": {
        "end_week": 21.5,
        "output_every_gw": 0.5,
        "thickness_mm": 3.0,
        "growth_rate_per_s": 1e-6,
        "step_s": 1000.0,
        "contact": {"kind": "none"},
        "solver": {"newton_tolerance": 1e-12, "krylov_tolerance": 1e-10},
    },
    "runs": {
        "soft": {"ranks": 2},
        "stiff": {"ranks": 2, "shear_modulus_cortex_pa": 3000},
        # of one rank and few steps
        "single": {"ranks": 1, "step_s": 43200.0},
    },
}
RUNS = tuple(STUDY["runs"])
PARALLEL = ("soft", "stiff")
FOLDER = "results/runs/{run}/a/folding"
SUMMARIES = [f"{FOLDER.format(run=run)}/summary.json" for run in RUNS]
BEFORE = [f"{FOLDER.format(run=run)}/regions.xdmf" for run in RUNS]
OPTIONS = (
    *("--configfile", "study.yaml", "--keep-going", "--latency-wait", "10"),
    # looked at more often than real clusters bear
    *("--slurm-init-seconds-before-status-checks", "2", "--slurm-status-command", "squeue"),
)


class Submitted:
    """A study that runs on a cluster from a folder."""

    def __init__(self, workflow, slurm, folder):
        self.slurm, self.folder = slurm, folder
        profile = workflow.checkout / "profiles" / "slurm"
        self.command = workflow.command(*SUMMARIES, "--profile", str(profile), *OPTIONS)
        self.environment = workflow.environment | slurm.environment
        self.process = None

    def start(self):
        """Starts the command of a user on the login node."""
        self.process = subprocess.Popen(
            self.command, cwd=self.folder, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, start_new_session=True,
        )  # fmt: skip

    def end(self):
        """Waits for its end; returns its exit code and what it printed."""
        printed, _ = self.process.communicate(timeout=900)
        return self.process.returncode, printed

    def jobs(self):
        """Returns the id, state and number of processors of each job, by its run."""
        lines = self.slurm.ask("squeue", "--states=all", "-h", "-o", "%k %i %T %C %r").splitlines()
        found = {}
        for name, number, state, processors, *reason in sorted(map(str.split, lines), key=lambda words: int(words[1])):
            run = next(run for run in RUNS if f"_{run}_" in name)
            found[run] = (number, state, int(processors), " ".join(reason))
        return found

    def wait(self, until, timeout_s=600):
        """Waits until a function of the jobs and of the logs holds, and returns the jobs of that moment."""
        deadline = time.monotonic() + timeout_s
        while True:
            jobs = self.jobs()
            logs = {run: self.log(run) for run in RUNS}
            if until(jobs, logs):
                return jobs
            assert self.process.poll() is None, f"{self.process.communicate()[0]}\n{self.slurm.logs()}"
            assert time.monotonic() < deadline, f"{jobs}\n{logs}\n{self.slurm.logs()}"
            time.sleep(0.3)

    def log(self, run):
        """Returns the log of a run."""
        path = self.folder / f"results/runs/{run}/a/logs/simulate.log"
        return path.read_text() if path.exists() else ""


@pytest.fixture
def slurm(tmp_path_factory):
    with cluster(tmp_path_factory.mktemp("slurm")) as running:
        yield running


@pytest.fixture
def meshed(workflow):
    """A study up to its folding, in two folders; in the first one it is finished on this machine, undisturbed.

    Its surface and mesh, an ellipsoid, count as made.
    """
    workflow.count_ellipsoid_as_meshed(STUDY, cells=8)
    made = workflow.run(*BEFORE, "--cores", "2", "--configfile", "study.yaml", timeout_s=900)
    assert made.returncode == 0, made.stdout + made.stderr
    disturbed = workflow.directory.with_name("disturbed")
    shutil.copytree(workflow.directory, disturbed)
    finished = workflow.run(*SUMMARIES, "--cores", "2", "--configfile", "study.yaml", timeout_s=900)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return workflow, disturbed


@pytest.mark.fault(63)
def test_cancelled_jobs_and_lost_nodes_change_nothing_in_the_result(meshed, slurm):
    workflow, folder = meshed
    study = Submitted(workflow, slurm, folder)
    study.start()

    # two runs side by side, each of two ranks on a processor of their own
    jobs = study.wait(lambda jobs, logs: all("step    5" in logs[run] for run in PARALLEL))
    assert [jobs[run][1:3] for run in PARALLEL] == [("RUNNING", 2)] * 2
    assert all(" 2 ranks," in study.log(run) for run in PARALLEL)

    slurm.ask("scancel", jobs["stiff"][0])
    study.wait(lambda jobs, logs: jobs["stiff"][1] == "CANCELLED")
    slurm.lose_node()
    study.wait(lambda jobs, logs: jobs["soft"][1] == "PENDING")
    slurm.return_node()

    # what was cancelled has failed, what had lost its node went on by itself
    code, printed = study.end()
    assert code != 0, printed
    print(printed)
    assert "failed  folding, run stiff, brain a: Slurm job" in printed
    assert "it was cancelled" in printed
    assert study.jobs()["soft"][1] == study.jobs()["single"][1] == "COMPLETED"
    assert not (folder / SUMMARIES[1]).exists()

    study.start()
    code, printed = study.end()
    assert code == 0, printed + slurm.logs()
    print(printed)
    for run in RUNS:
        one, other = (root / FOLDER.format(run=run) for root in (workflow.directory, folder))
        if run in PARALLEL:
            assert "going on from the checkpoint after step" in study.log(run)
            assert read_json(other / "summary.json")["resumed_after_step"] >= 5
        before, after = (read_positions(root / "frames.h5", week) for root, week in ((one, 21.0), (one, 21.5)))
        largest = np.linalg.norm(after - before, axis=1).max()
        assert largest > 0.1
        moved = np.linalg.norm(read_positions(other / "frames.h5", 21.5) - after, axis=1).max()
        print(f"{run}: largest displacement {largest:.3g} mm, differs by {moved:.2g} mm")
        assert moved <= 1e-8 * largest
        tables = [pd.read_csv(root / "steps.csv") for root in (one, other)]
        for column in ("step", "week", "max_u_mm", "min_J"):
            np.testing.assert_allclose(tables[1][column], tables[0][column], rtol=1e-7, err_msg=column)
