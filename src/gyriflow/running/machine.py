"""Cores and memory that a run may use: those of the machine, or less in a container or
a Slurm job."""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil


def available_cores() -> int:
    """Return the number of cores that affinity, a container's quota and a Slurm job
    allow."""
    from joblib import cpu_count  # takes a third of a second

    per_task = _slurm("CPUS_PER_TASK") * (_slurm("NTASKS") or 1)
    return min(
        filter(
            None,
            (cpu_count(), _slurm("CPUS_ON_NODE"), per_task),
        )
    )


def available_memory_mib(
    cgroups: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")
) -> float:
    """Return the memory (MiB) that the machine, control groups, a Slurm job and the
    shell's limit allow."""
    limits = [
        psutil.virtual_memory().total,
        *_cgroup_limits(cgroups, own),
        _shell_limit(),
    ]
    limits += [
        2**20 * _slurm("MEM_PER_NODE"),
        2**20 * _slurm("MEM_PER_CPU") * _slurm("CPUS_ON_NODE"),
    ]
    return min(filter(None, limits)) / 2**20


def _shell_limit() -> int:
    if sys.platform == "win32":
        return 0
    import resource

    process, _ = resource.getrlimit(resource.RLIMIT_AS)
    return 0 if process == resource.RLIM_INFINITY else process


def _slurm(name: str) -> int:
    value = os.environ.get(f"SLURM_{name}", "")
    return int(value) if value.isdecimal() else 0


def _cgroup_limits(cgroups: Path, own: Path) -> Iterator[int]:
    # version 2 has one tree, version 1 a tree for each kind of limit; in a container,
    # its group is the root
    groups = (
        [line.split(":", 2) for line in own.read_text(encoding="utf-8").splitlines()]
        if own.exists()
        else []
    )
    for _, controllers, name in groups:
        group = cgroups / (controllers or ".") / name.lstrip("/")
        for folder in (group, *group.parents):
            for limit in ("memory.max", "memory.limit_in_bytes"):
                # without a limit: "max" in version 2, a number larger than any memory
                # in version 1
                with suppress(OSError, ValueError):
                    yield int((folder / limit).read_text(encoding="utf-8"))
