"""The form compiler's cache: one for each kind of processor, one compilation at a time, no torn entries."""

import fcntl
import hashlib
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cffi
from mpi4py import MPI

# sums may be taken in any order, a fifth faster; all of -ffast-math would break the checks for numbers that are none
REORDERED_SUMS = ["-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math", "-fno-math-errno"]
COMPILER_ARGUMENTS = ["-O3", "-march=native", *REORDERED_SUMS]


def processor() -> str:
    """Return a text that differs between processors for which -march=native means different things."""
    described = Path("/proc/cpuinfo")
    lines = described.read_text().splitlines() if described.exists() else []
    return next((line for line in lines if line.startswith(("flags", "Features"))), platform.processor())


@contextmanager
def form_compiler(comm: MPI.Comm) -> Iterator[dict]:
    """Yield the options of the form compiler; forms are to be made inside the block, by all ranks.

    Rank 0 holds the cache for the block, since concurrent runs share it and a compilation that was killed leaves a
    source file for which everyone would wait.
    """
    kind = hashlib.sha256(processor().encode()).hexdigest()[:8]
    base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    cache = base / "gyriflow" / f"forms-{kind}-{sys.version_info.major}.{sys.version_info.minor}"
    options = {"cffi_extra_compile_args": COMPILER_ARGUMENTS, "cache_dir": str(cache)}
    with ExitStack() as held:
        if comm.rank == 0:
            cache.mkdir(parents=True, exist_ok=True)
            fcntl.flock(held.enter_context((cache / "lock").open("w")), fcntl.LOCK_EX)
            drop_torn_entries(cache)
        comm.barrier()
        yield options
        comm.barrier()


def compiled(comm: MPI.Comm, declarations: str, code: str) -> tuple[cffi.FFI, Any]:
    """Return functions in C, compiled unless the cache has them, and the interface to their arguments."""
    name = f"gyriflow_{hashlib.sha256(repr((code, COMPILER_ARGUMENTS)).encode()).hexdigest()[:16]}"
    interface = cffi.FFI()
    interface.cdef(declarations)
    with form_compiler(comm) as options:
        library = Path(options["cache_dir"]) / f"{name}.so"
        if comm.rank == 0 and not library.exists():
            interface.set_source(name, code, extra_compile_args=COMPILER_ARGUMENTS)
            with TemporaryDirectory(dir=library.parent) as folder:
                Path(interface.compile(tmpdir=folder)).rename(library)
    return interface, interface.dlopen(str(library))


def drop_torn_entries(cache: Path) -> None:
    """Remove the files of every form that lacks its source, its library, or the mark that both are whole."""
    names = {path.name.split(".")[0] for path in cache.glob("libffcx_*")}
    for name in names:
        whole = (cache / f"{name}.c").exists() and (cache / f"{name}.c.cached").exists()
        if not (whole and any(cache.glob(f"{name}.*.so"))):
            for path in cache.glob(f"{name}.*"):
                path.unlink(missing_ok=True)
