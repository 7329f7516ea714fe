"""Compilation of forms and C code. Each kind of processor has a cache, where one
process compiles at a time."""

import hashlib
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cffi
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..io.locks import lock_file
from .compiler import set_compiler

# lets the compiler reorder sums, a fifth faster; all of -ffast-math would break checks
# for NaN
REORDERED_SUMS = [
    "-fassociative-math",
    "-fno-signed-zeros",
    "-fno-trapping-math",
    "-fno-math-errno",
]
NATIVE = "-march=native"
COMPILER_ARGUMENTS = ["-O3", NATIVE, *REORDERED_SUMS]


def _processor() -> str:
    """Return a text that differs between processors for which -march=native gives
    different code."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith(("flags", "Features")):
                return line
    return platform.processor()


@contextmanager
def form_compiler(comm: MPI.Comm) -> Iterator[dict]:
    """Yield the options of the form compiler, for all ranks to compile forms within the
    block.

    Rank 0 locks the cache during the block, since concurrent runs share it, and removes
    what a killed compilation has left there: later ones would wait for it to finish.
    Ranks on different processors share code without `NATIVE`.
    """
    set_compiler()
    processors = set(comm.allgather(_processor()))
    arguments = list(COMPILER_ARGUMENTS)
    if len(processors) == 1:
        kind = hashlib.sha256(processors.pop().encode()).hexdigest()[:8]
    else:
        kind = platform.machine()
        arguments = [argument for argument in arguments if argument != NATIVE]
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    folder = base / "gyriflow" / f"forms-{kind}-{python}"
    options = {"cffi_extra_compile_args": arguments, "cache_dir": str(folder)}
    with ExitStack() as stack:
        if comm.rank == 0:
            folder.mkdir(parents=True, exist_ok=True)
            lock_file(
                stack.enter_context((folder / "lock").open("w")),
                wait=True,
            )
            _remove_incomplete_entries(folder)
        comm.barrier()
        yield options
        comm.barrier()


def compiled(
    comm: MPI.Comm,
    declarations: str,
    code: str,
) -> tuple[cffi.FFI, Any]:
    """Return the cffi interface and the library of C code, compiled unless cached;
    collective over the ranks."""
    content = repr((code, COMPILER_ARGUMENTS)).encode()
    name = f"gyriflow_{hashlib.sha256(content).hexdigest()[:16]}"
    interface = cffi.FFI()
    interface.cdef(declarations)
    with form_compiler(comm) as options:
        library = Path(options["cache_dir"]) / f"{name}.so"
        if comm.rank == 0 and not library.exists():
            arguments = options["cffi_extra_compile_args"]
            interface.set_source(name, code, extra_compile_args=arguments)
            with TemporaryDirectory(dir=library.parent) as folder:
                Path(interface.compile(tmpdir=folder)).rename(library)
    return interface, interface.dlopen(str(library))


@cache
def library_of(module: str, declarations: str) -> tuple[cffi.FFI, Any]:
    """Return what `compiled` does for the C file beside a Python file, on this rank."""
    code = Path(module).with_suffix(".c").read_text(encoding="utf-8")
    return compiled(MPI.COMM_SELF, declarations, code)


def pointer(
    interface: cffi.FFI,
    array: NDArray,
    dtype: type,
    size: int,
    *,
    is_written: bool = False,
) -> Any:
    """Return the pointer to an array for C code, which reads it as at least `size`
    numbers of a type.

    TypeError for another type, ValueError for fewer numbers, an order that is not C's,
    or an array that `is_written` although it is read-only: C code would read something
    else, or beyond the end, without a word.
    """
    if array.dtype != dtype:
        raise TypeError(
            f"C code needs an array of {np.dtype(dtype)}, and this one has"
            f" {array.dtype}"
        )
    if array.size < size:
        raise ValueError(
            f"C code needs {size} numbers, and the array has the shape {array.shape}"
        )
    return interface.from_buffer(array, require_writable=is_written)


def _remove_incomplete_entries(cache: Path) -> None:
    """Remove the files of each form that has no source, no library, or no mark that
    both are complete."""
    paths = cache.glob("libffcx_*")
    for name in {path.name.split(".")[0] for path in paths}:
        source = cache / f"{name}.c"
        mark = cache / f"{name}.c.cached"
        libraries = cache.glob(f"{name}.*.so")
        if source.exists() and mark.exists() and any(libraries):
            continue
        for path in cache.glob(f"{name}.*"):
            path.unlink(missing_ok=True)
