"""The folding program: `mpiexec -n N python -m gyriflow.folding MESH --params
params.yaml --out DIR`."""

import argparse
import logging
import shutil
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from mpi4py import MPI

from ..errors import StorageError
from ..geometry.tetrahedra import TetrahedralMesh
from ..io.files import write_json
from ..io.locks import lock_file
from ..io.tetmeshes import read_maps, read_tetrahedral_mesh
from ..io.yaml_files import read_yaml
from ..messages import MessageHandler, error_message, write_message
from ..settings.folding import FoldingParameters, parameters_from, require_maps
from ..settings.terms import ELEMENT_FIELDS, ZONE_NAMES
from ..settings.varying import value_at
from ..step import Usage, record_usage, usage
from .checks import refuse_impossible, stiffness_warning, zone_report
from .output import print_line
from .points import IntegrationPoints
from .predicted_memory import predicted_memory_mib
from .run import run
from .zones import zones_of_run

log = logging.getLogger(__name__)


def _parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m gyriflow.folding", description=__doc__
    )
    parser.add_argument("mesh", type=Path, help="tetrahedral mesh, RAS+ mm (XDMF)")
    parser.add_argument(
        "--params",
        type=Path,
        required=True,
        help="parameters (YAML)",
    )
    parser.add_argument(
        "--maps", type=Path, help="maps of parameters at the mesh's vertices (HDF5)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        help="folder of the results",
    )
    parser.add_argument(
        "--log",
        type=Path,
        help=(
            "log of the run, beside which its messages and progress are written, one"
            " JSON object per line (.jsonl); default: folding.log in the folder of the"
            " results"
        ),
    )
    parser.add_argument(
        "--may-diverge",
        action="store_true",
        help=(
            "if the run diverges, keep the weeks it reached and end without an error;"
            " the summary gives the reason"
        ),
    )
    parsed = parser.parse_args(arguments)
    parsed.log = parsed.log or parsed.out / "folding.log"
    return parsed


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock the folder for this run; StorageError if another run has locked it or it
    cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / ".lock").open("w")
    except OSError as error:
        raise StorageError(f"cannot be written: {error}", path=folder) from None
    with file:
        if not lock_file(file):
            raise StorageError("another folding run is using this folder", path=folder)
        yield


def _require_space(
    out: Path,
    mesh: TetrahedralMesh,
    parameters: FoldingParameters,
) -> None:
    """Raise StorageError if the disk has no room for the run's frames, which exist
    twice while they are joined."""
    # positions in double precision, fields in single
    per_vertex = 24 + 12 * len(parameters.fields)
    per_element = 16 * len(set(ELEMENT_FIELDS) & set(parameters.fields))
    frame = per_vertex * len(mesh.vertices) + per_element * len(mesh.tets)
    points = len(IntegrationPoints.for_order(mesh.order).weights)
    values = 6 if parameters.stress_memory_gw > 0 else 0
    stretch = 8 * values * points * len(mesh.tets)
    # positions and two displacements
    checkpoint = 2 * (8 * 3 * 3 * len(mesh.vertices) + stretch)
    needed = 2 * len(parameters.output_weeks) * frame + checkpoint + 4 * mesh.tets.size
    free = shutil.disk_usage(out).free
    if free < needed:
        room, expected = (f"{size / 2**20:.0f} MiB" for size in (free, needed))
        raise StorageError(
            "not enough disk space for this run",
            path=out,
            found=f"{room} free",
            expected=expected,
        )


def _fold(comm: MPI.Comm, arguments: argparse.Namespace) -> None:
    """Read and check the inputs, print a summary of them, and run the simulation."""
    parameters = parameters_from(read_yaml(arguments.params))
    inputs = None
    if comm.rank == 0:
        mesh = read_tetrahedral_mesh(arguments.mesh)
        maps = read_maps(arguments.maps) if arguments.maps else {}
        inputs = mesh, zones_of_run(mesh, parameters), maps
    mesh, zones, maps = comm.bcast(inputs)
    if comm.rank == 0:
        require_maps(parameters, maps, len(mesh.vertices))
        thickness = value_at(parameters.thickness_mm, parameters.start_week, maps)
        report = zone_report(
            mesh,
            zones,
            float(np.median(thickness)),
        )
        memory = predicted_memory_mib(
            len(mesh.tets), comm.size, parameters.contact, mesh.order
        )
        print_line(
            f"{len(mesh.tets)} elements, {3 * len(mesh.vertices)} unknowns, {comm.size}"
            f" ranks, about {memory:.0f} MiB",
            "size",
            elements=len(mesh.tets),
            ranks=comm.size,
            memory_mib=round(memory),
        )
        for name in ZONE_NAMES:
            zone = report["zones"][name]
            print_line(f"  {name}: {zone['facets']} facets, {zone['area_mm2']:.0f} mm2")
        shares = ", ".join(
            f"{side} {share:.1%}" for side, share in report["clamped_share"].items()
        )
        print_line(
            f"  clamped share: {shares}; initial penetration"
            f" {report['initial_penetration_mm']:g} mm"
        )
        through = report["elements_through_cortex"]
        print_line(f"  elements through the cortex: {through:.1f}")
        locking = stiffness_warning(parameters.poisson_ratio) if mesh.order == 1 else ""
        if parameters.targets and {"stress", "strain"} & {*parameters.fields}:
            print_line(
                "growth towards shapes has no stress but in contact: no fields of"
                " stress and elastic strain"
            )
        if locking:
            log.warning(locking)
        refuse_impossible(mesh, zones)
        _require_space(arguments.out, mesh, parameters)
        write_json(arguments.out / "zones.json", report)
    comm.barrier()
    run(
        comm,
        mesh,
        zones,
        parameters,
        maps,
        arguments.out,
        may_diverge=arguments.may_diverge,
    )
    own = usage()
    # by all ranks
    cpu_s = comm.allreduce(own.cpu_s)
    memory_mib = comm.allreduce(own.memory_mib)
    if comm.rank == 0:
        record_usage(arguments.log, Usage(own.wall_s, cpu_s, memory_mib))


def _guarded(comm: MPI.Comm, arguments: argparse.Namespace) -> None:
    """Run `_fold` with the folder locked, and end every rank with the exit code of the
    first error."""
    try:
        if comm.rank == 0:
            with locked(arguments.out):
                printer = logging.StreamHandler(sys.stdout)
                printer.setLevel(logging.WARNING)
                logging.basicConfig(
                    level=logging.INFO,
                    format="warning: %(message)s",
                    handlers=[printer, MessageHandler(arguments.log)],
                )
                _fold(comm, arguments)
        else:
            _fold(comm, arguments)
    except Exception as error:
        message = error_message(error)
        if message.exit_code == 1:
            traceback.print_exc()
        # in one write, for ranks that fail at once mix theirs
        sys.stderr.write(f"gyriflow: {message.text}\n")
        # whatever happens, the other ranks are ended, too
        with suppress(OSError):
            write_message(arguments.log, message)
        sys.stdout.flush()
        if comm.size > 1:
            # mpiexec loses what it has not read yet from a rank when this is called
            time.sleep(0.2)
            # they may be waiting in a collective call
            comm.Abort(message.exit_code or 1)
        sys.exit(message.exit_code)


if __name__ == "__main__":
    _guarded(MPI.COMM_WORLD, _parse())
