"""The workflow from a copy of the checkout, so that editing the sources meanwhile
changes nothing."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import pytest
import yaml
from facts import Facts
from processes import ran
from shapes import ellipsoid_mesh, hemisphere, phantom, save_labels

from gyriflow.geometry.poses import Pose
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import write_surface
from gyriflow.io.tetmeshes import write_tetrahedral_mesh
from gyriflow.messages import read_messages
from gyriflow.running import launch
from gyriflow.running.planning import Plan

CHECKOUT = Path(__file__).parents[2]


def labelled(week: int) -> dict:
    """Return the source of a brain whose labels `Workflow.write` makes, synthetic ones
    of a week."""
    return {"labels": f"phantom-{week}.nii.gz", "scheme": "spina-bifida-atlas"}


SMALL_STUDY = {
    "brains": [
        {"id": "a", "week": 21, **labelled(21)},
        {"id": "b", "week": 22, **labelled(22)},
    ],
    "start": "a",
    "folding": {"end_week": 22},
    "runs": {"reference": {}, "thick": {"thickness_mm": 3.0}},
}
SHAPES = [{"id": f"b{week}", "week": week, "shape": {}} for week in (21, 22)]
"""Brains without files."""
COARSE = {
    "order": 1,
    "mesher": "tetgen",
    "surface_edge_mm": 3.0,
    "core_edge_mm": 5.0,
    "max_surface_distance_mm": 1.0,
}
"""A mesh that is made in a second."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that the launcher handles."""


@contextmanager
def launching(directory: Path) -> Iterator[None]:
    """Have this process as it was, once the launcher has run in it."""
    handlers = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        with chdir(directory), patch.dict(os.environ):
            yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


@dataclass(frozen=True)
class Surfaces:
    """What the surface stage has made of all brains of a study, or said of them."""

    directory: Path
    outcome: subprocess.CompletedProcess[str]

    @property
    def results(self) -> Path:
        return self.directory / "results" / "brains"

    def report(self, brain: str) -> dict:
        """Return the report on a brain's surface."""
        return read_json(self.results / brain / "surface" / "surface.json")

    def messages(self, brain: str, level: str) -> list[str]:
        """Return the messages of a level of the step that made a brain's surface, or
        refused to."""
        messages = read_messages(self.results / brain / "logs" / "pial.log")
        return [message.text for message in messages if message.level == level]

    def require_refused(self, brain: str, *facts: object) -> None:
        """Check that a brain was refused with facts, in its messages and on the
        terminal, and that nothing is left."""
        (message,) = self.messages(brain, "error")
        assert message == Facts(*facts)
        assert message in self.outcome.stderr
        assert not [
            path
            for path in (self.results / brain / "surface").rglob("*")
            if path.is_file()
        ]

    def require_exit_code(self, code: int) -> None:
        """Check how the run ended, and that it showed no traceback."""
        assert self.outcome.returncode == code, self.outcome.stderr
        assert "Traceback" not in self.outcome.stderr


@dataclass(frozen=True)
class Workflow:
    """A copy of the checkout, and a working directory for its results."""

    checkout: Path
    directory: Path

    def command(self, *arguments: str) -> list[str]:
        """Return the command that `./run snakemake` runs."""
        return [sys.executable, "-P", "-m", "gyriflow.running.launch", *arguments]

    @property
    def environment(self) -> dict[str, str]:
        # what the caller has put on the path comes after, such as another Snakemake
        paths = [str(self.checkout / "src"), os.environ.get("PYTHONPATH", "")]
        return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}

    def run(
        self, *arguments: str, timeout_s: float = 300
    ) -> subprocess.CompletedProcess[str]:
        """Run the launcher in the working directory."""
        return ran(
            *self.command(*arguments),
            timeout_s=timeout_s,
            cwd=self.directory,
            env=self.environment,
        )

    def call(self, *arguments: str) -> int:
        """Run the launcher of this checkout in this process; return its exit code."""
        with launching(self.directory):
            return launch.main(arguments)

    def plan(self, *arguments: str) -> Plan:
        """Return what a dry run plans, in this process and by this checkout's code."""
        plans: list[Plan] = []
        with launching(self.directory):
            code = launch.main(["-n", *arguments], plans.append, is_shown=False)
        assert code == 0
        (plan,) = plans
        return plan

    def jobs(self, *arguments: str) -> dict[str, int]:
        """Return the number of jobs per rule that a dry run plans."""
        plan = self.plan(*arguments)
        return Counter(job.rule for job, _ in plan.reasoned_jobs)

    def reasons(self, *arguments: str) -> dict[str, str]:
        """Return why a dry run plans the jobs of each rule."""
        plan = self.plan(*arguments)
        return {job.rule: reason for job, reason in plan.reasoned_jobs}

    def write(self, name: str, config: dict) -> str:
        """Write a configuration, and labels that it calls `labelled`, and return its
        name."""
        for brain in config.get("brains", []):
            given = re.fullmatch(r"phantom-(\d+)\.nii\.gz", brain.get("labels", ""))
            # a newer file would have its surface made again
            if given and not (self.directory / given[0]).exists():
                save_labels(self.directory / given[0], *phantom(float(given[1]), 2.0))
        (self.directory / name).write_text(yaml.safe_dump(config))
        return name

    def lay_out(self, *arguments: str) -> list[str]:
        """Make all files that a call would make, empty, and return their names."""
        files = []
        for job in self.plan(*arguments, "--forceall").jobs:
            files += job.outputs
        for file in files:
            path = self.directory / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        return files

    def count_as_made(self, *arguments: str) -> None:
        """Have Snakemake take the files of a call that are there for made."""
        assert self.call("--touch", "--cores", "1", *arguments) == 0

    def count_ellipsoid_as_meshed(self, config: dict, cells: int) -> None:
        """Write a configuration of one brain, `a`, as study.yaml, with an ellipsoid's
        surface and mesh taken for made.

        `cells` is the number of the mesh's cells along an axis.
        """
        arguments = ("mesh", "--configfile", self.write("study.yaml", config))
        self.lay_out(*arguments)
        brain = self.directory / "results" / "brains" / "a"
        write_json(
            brain / "surface" / "surface.json",
            {"fissure_x_mm": 0.0, "pose": Pose().plain()},
        )
        for side, sign in (("left", -1), ("right", 1)):
            write_surface(brain / "surface" / f"{side}.pial.surf.gii", hemisphere(sign))
        write_tetrahedral_mesh(
            brain / "mesh" / "brain.xdmf", ellipsoid_mesh(cells, (20.0, 26.0, 18.0))
        )
        self.count_as_made(*arguments)

    def surfaces(self, config: dict, *more: str) -> Surfaces:
        """Make the pial surfaces of all brains of a configuration, and more targets, as
        far as that goes."""
        name = self.write("study.yaml", config)
        targets = [
            f"results/brains/{brain['id']}/surface/pial.surf.gii"
            for brain in config["brains"]
        ]
        outcome = self.run(
            *more,
            *targets,
            "--cores",
            "2",
            "--keep-going",
            "--configfile",
            name,
            timeout_s=900,
        )
        return Surfaces(self.directory, outcome)


@pytest.fixture(scope="session")
def checkout_copy(tmp_path_factory):
    copy = tmp_path_factory.mktemp("checkout")
    for name in (
        "src",
        "workflow",
        "config",
        "profiles",
        "envs",
        "atlases",
        "schemes",
        "norms",
    ):
        shutil.copytree(
            CHECKOUT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(CHECKOUT / "Snakefile", copy)
    return copy


@pytest.fixture
def workflow(checkout_copy, tmp_path):
    return Workflow(checkout_copy, tmp_path)


@pytest.fixture(scope="session")
def finished(checkout_copy, tmp_path_factory):
    """A small study whose results count as made: empty files with the records that
    Snakemake keeps of real ones."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("finished"))
    workflow.write("study.yaml", SMALL_STUDY)
    files = workflow.lay_out("--configfile", "study.yaml")
    assert "results/report/report.html" in files
    workflow.count_as_made("--forceall", "--configfile", "study.yaml")
    return workflow
