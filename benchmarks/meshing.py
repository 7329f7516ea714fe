"""Meshing of one pial surface: time, size, quality, and how well the surface was kept, as one line of JSON.

SURFACE is a closed surface in mm (GIFTI, STL, PLY), such as results/brains/{brain}/surface/pial.surf.gii.
"""

import argparse
import json
import resource
import time
from pathlib import Path
from typing import Any

from gyriflow.config.mesh import MeshSettings
from gyriflow.io.surfaces import read_surface
from gyriflow.mesh.meshers import MESHERS
from gyriflow.mesh.quality import elements_through, quality_summary
from gyriflow.mesh.tetrahedralisation import tetrahedralise

DEFAULTS = MeshSettings()
SETTINGS = ("surface_edge_mm", "core_edge_mm", "fine_depth_edges", "edge_growth", "envelope_mm", "time_limit_s")
COPIED = ("pial_faces", "tets", "vertices", "pial_edge_mm", "min_radius_ratio", "median_radius_ratio")
ANGLES = (
    "min_dihedral_deg",
    "max_dihedral_deg",
    "min_volume_mm3",
    "volume_mm3",
    "volume_change",
    "crossing_faces",
    "gap_mm",
    "gap_kept",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("surface", type=Path)
    parser.add_argument("--mesher", choices=list(MESHERS), default=DEFAULTS.mesher)
    parser.add_argument("--pial-faces", type=int, help="about how many faces the mesh's surface is to have")
    parser.add_argument("--thickness-mm", type=float, default=1.5, help="of the cortex (1.5)")
    for name in SETTINGS:
        default = getattr(DEFAULTS, name)
        parser.add_argument(f"--{name.replace('_', '-')}", type=float, default=default, help=f"mesh.{name} ({default})")
    print(json.dumps(measured(**vars(parser.parse_args()))))


def measured(surface: Path, mesher: str, thickness_mm: float, **settings: Any) -> dict[str, Any]:
    """Returns what the meshing of a surface took and gave: reading and measuring are not in the times."""
    given = read_surface(surface)
    began, used = time.perf_counter(), cpu_seconds()
    mesh = tetrahedralise(given, mesher=mesher, **settings)
    seconds, cpu = time.perf_counter() - began, cpu_seconds() - used
    quality = quality_summary(mesh, given)
    distance = quality["surface_distance_mm"]
    return {
        "mesher": mesher,
        "seconds": round(seconds, 1),
        "cpu_seconds": round(cpu, 1),
        **{name: shown(quality[name]) for name in COPIED + ANGLES},
        "hausdorff99_mm": shown(distance["hausdorff99"]),
        "hausdorff_mm": shown(distance["hausdorff"]),
        "elements_through_cortex": shown(elements_through(mesh, thickness_mm)),
    }


def cpu_seconds() -> float:
    """Returns the CPU time of this process and of those it has waited for."""
    usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def shown(value: Any) -> Any:
    """Returns a value with four significant digits, inside tables too."""
    if isinstance(value, dict):
        return {name: shown(inner) for name, inner in value.items()}
    return float(f"{value:.4g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main()
