"""Cores and memory within the limits of a container, of a Slurm job and of the
shell."""

import os
import resource

import joblib
import pytest

from gyriflow.running.machine import available_cores, available_memory_mib


@pytest.fixture
def in_job(monkeypatch):
    for name in [name for name in os.environ if name.startswith("SLURM_")]:
        monkeypatch.delenv(name)
    return lambda job: [
        monkeypatch.setenv(f"SLURM_{name}", str(value)) for name, value in job.items()
    ]


@pytest.mark.parametrize(
    ("job", "cores"),
    [
        ({}, 8),
        ({"CPUS_ON_NODE": 4}, 4),
        ({"CPUS_ON_NODE": 16}, 8),
        ({"CPUS_ON_NODE": 64, "CPUS_PER_TASK": 2}, 2),
        # as many MPI ranks
        ({"CPUS_ON_NODE": 6, "CPUS_PER_TASK": 1, "NTASKS": 6}, 6),
    ],
)
def test_cores_are_those_of_the_job(monkeypatch, in_job, job, cores):
    monkeypatch.setattr(joblib, "cpu_count", lambda: 8)
    in_job(job)
    assert available_cores() == cores


@pytest.mark.parametrize(
    ("own", "limits", "job", "mib"),
    [
        ("0::/", {"memory.max": 300 << 20}, {}, 300),
        (
            "0::/job/step",
            {"job/memory.max": 200 << 20, "job/step/memory.max": "max"},
            {},
            200,
        ),
        ("4:memory:/docker/1", {"memory/memory.limit_in_bytes": 100 << 20}, {}, 100),
        ("0::/", {"memory.max": "max"}, {"MEM_PER_NODE": 70}, 70),
        ("0::/", {"memory.max": 300 << 20}, {"MEM_PER_CPU": 30, "CPUS_ON_NODE": 2}, 60),
    ],
)
def test_memory_is_the_smallest_limit(
    tmp_path, monkeypatch, in_job, own, limits, job, mib
):
    for name, text in {"own": own, **limits}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{text}\n")
    in_job(job)
    assert available_memory_mib(tmp_path, tmp_path / "own") == mib
    monkeypatch.setattr(resource, "getrlimit", lambda _: (50 << 20, -1))
    assert available_memory_mib(tmp_path, tmp_path / "none") == 50
