"""Times the Laplace-Beltrami modes of a surface against a single call of ARPACK: one JSON line.

    ./run python benchmarks/spectra.py SURFACE --modes 2000

`seconds` is the wall time of `lowest_modes`, `cpu_seconds` its CPU time, `peak_memory_MiB` the most memory of the
process up to its end. `missing` is the number of eigenvalues below the middle of the largest gap among
the last ten found, by the inertia of K − λM there, less the number found there.

`arpack_seconds` is the time of one shift-invert call for the same modes, which `--no-arpack` leaves out; for
2000 modes it takes many minutes. `largest_difference` is that of the eigenvalues, relative to each.
"""

import argparse
import json
import resource
import time

import numpy as np
from scipy.sparse.linalg import eigsh

from gyriflow.io.surfaces import read_surface
from gyriflow.metrics.laplace_beltrami import count_below, laplacian, lowest_modes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("surface", help="a closed surface in mm (.surf.gii, .stl, .ply, .obj)")
    parser.add_argument("--modes", type=int, default=2000)
    parser.add_argument("--no-arpack", action="store_true", help="leave the single call of ARPACK out")
    options = parser.parse_args()

    stiffness, mass = laplacian(read_surface(options.surface))
    clock, cpu = time.perf_counter(), time.process_time()
    values = lowest_modes(stiffness, mass, options.modes).eigenvalues
    seconds, cpu_seconds = time.perf_counter() - clock, time.process_time() - cpu
    memory_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    tail = values[-10:]
    gap = np.diff(tail).argmax()
    cut = 0.5 * (tail[gap] + tail[gap + 1])
    result = {
        "vertices": stiffness.shape[0],
        "modes": len(values),
        "seconds": round(seconds, 2),
        "cpu_seconds": round(cpu_seconds, 2),
        "arpack_seconds": None,
        "ratio": None,
        "peak_memory_MiB": round(memory_kib / 1024),
        "missing": int(count_below(stiffness, mass, cut) - np.count_nonzero(values < cut)),
    }
    if not options.no_arpack:
        clock, cpu = time.perf_counter(), time.process_time()
        below = -4.0 * np.pi / mass.sum()
        single = np.sort(eigsh(stiffness, k=options.modes, M=mass, sigma=below, return_eigenvectors=False))
        result["arpack_seconds"] = round(time.perf_counter() - clock, 2)
        result["arpack_cpu_seconds"] = round(time.process_time() - cpu, 2)
        result["ratio"] = round(result["arpack_seconds"] / seconds, 2)
        # of the first, which is 0, there is no relative difference
        result["largest_difference"] = float(np.max(np.abs(values[1:] / single[1:] - 1.0)))
    print(json.dumps(result))


if __name__ == "__main__":
    main()
