"""Cores and memory within the limits of a container, of a Slurm job and of the shell."""

import resource

import joblib
import pytest

from gyriflow.running.machine import available_cores, available_memory_mib

pytestmark = pytest.mark.fault(77)


@pytest.fixture(autouse=True)
def no_job(monkeypatch):
    for name in ("CPUS_ON_NODE", "CPUS_PER_TASK", "NTASKS", "MEM_PER_NODE", "MEM_PER_CPU"):
        monkeypatch.delenv(f"SLURM_{name}", raising=False)


@pytest.mark.parametrize(
    ("job", "cores"),
    [
        ({}, 8),
        ({"CPUS_ON_NODE": "4"}, 4),
        ({"CPUS_ON_NODE": "16"}, 8),
        ({"CPUS_ON_NODE": "64", "CPUS_PER_TASK": "2"}, 2),
        # as many MPI ranks
        ({"CPUS_ON_NODE": "6", "CPUS_PER_TASK": "1", "NTASKS": "6"}, 6),
    ],
)
def test_cores_are_those_of_the_job(monkeypatch, job, cores):
    monkeypatch.setattr(joblib, "cpu_count", lambda: 8)
    for name, value in job.items():
        monkeypatch.setenv(f"SLURM_{name}", value)
    assert available_cores() == cores


@pytest.mark.parametrize(
    ("own", "limits", "job", "mib"),
    [
        ("0::/\n", {"memory.max": 300}, {}, 300),
        ("0::/job/step\n", {"job/memory.max": 200, "job/step/memory.max": "max"}, {}, 200),
        ("4:memory:/docker/1\n", {"memory/memory.limit_in_bytes": 100}, {}, 100),
        ("0::/\n", {"memory.max": "max"}, {"MEM_PER_NODE": "70"}, 70),
        ("0::/\n", {"memory.max": 300}, {"MEM_PER_CPU": "30", "CPUS_ON_NODE": "2"}, 60),
    ],
)
def test_memory_is_the_smallest_limit(tmp_path, monkeypatch, own, limits, job, mib):
    (tmp_path / "own").write_text(own)
    for name, limit in limits.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{limit}\n" if limit == "max" else f"{limit * 2**20}\n")
    for name, value in job.items():
        monkeypatch.setenv(f"SLURM_{name}", value)
    assert available_memory_mib(tmp_path, tmp_path / "own") == mib


def test_memory_of_a_process_may_be_limited(tmp_path, monkeypatch):
    assert available_memory_mib(tmp_path, tmp_path / "none") > 50
    monkeypatch.setattr(resource, "getrlimit", lambda _: (50 * 2**20, -1))
    assert available_memory_mib(tmp_path, tmp_path / "none") == 50
