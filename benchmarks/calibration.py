"""Whether a calibration recovers the parameters of a simulated brain.

    ./run python benchmarks/calibration.py [FOLDER] [--cores 2] [--runs 10] [--rounds 2] [--edge 2.0]

A brain of the shipped atlas is folded from 21 to 22 GW with known thickness and growth rate, on a coarse mesh. Its
surface then takes the place of a real brain of 22 GW, and the target `calibrate` looks for the two. The last line is
one JSON object: by parameter `truth`, `value`, `error_of_range` (|value − truth| over the width of the bounds); `runs`,
`diverged`, `best_score`, `seconds`.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from gyriflow.errors import GyriflowError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.files import read_table
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.yaml_files import write_yaml

ROOT = Path(__file__).resolve().parents[1]
START = "spina-bifida-unoperated-21"
TRUTH = {"thickness_mm": 2.2, "growth_rate_per_s": 2.3e-7}
BOUNDS = {"thickness_mm": [1.2, 4.0], "growth_rate_per_s": [1.0e-7, 4.0e-7]}


def study(edge_mm: float) -> dict[str, Any]:
    """Return what both configurations share: the start brain, a coarse mesh, the paper's model in steps of a day."""
    return {
        "atlas": {"name": "spina-bifida", "series": "unoperated", "weeks": [21]},
        "start": START,
        "surface": {"edge_length_mm": edge_mm / 2},
        "mesh": {
            "order": 1,
            "mesher": "tetgen",
            "surface_edge_mm": edge_mm,
            "core_edge_mm": 2 * edge_mm,
            "max_surface_distance_mm": 0.5,
            # a coarse mesh of a detailed surface has flat elements
            "min_radius_ratio": 0.005,
        },
        "folding": {"preset": "fetalfoldsim", "end_week": 22, "step_s": 86400, "ranks": 1},
    }


def call(folder: Path, config: dict[str, Any], cores: int, *targets: str) -> None:
    """Run targets in a folder; GyriflowError where one fails."""
    write_yaml(folder / "study.yaml", config)
    command = [sys.executable, "-m", "gyriflow.cli.launch", "--cores", str(cores), *targets, "--snakefile"]
    command += [str(ROOT / "Snakefile"), "--configfile", str(folder / "study.yaml"), "--directory", str(folder)]
    path = os.pathsep.join(filter(None, [str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]))
    outcome = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    if outcome.returncode:
        raise GyriflowError(f"{targets[0]} failed", path=folder, found="\n".join(outcome.stderr.splitlines()[-15:]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("calibration-benchmark"))
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--runs", type=int, default=10, help="of the first round")
    parser.add_argument("--rounds", type=int, default=2, help="of four runs each")
    parser.add_argument("--edge", type=float, default=2.0, help="edges of the mesh (mm)")
    arguments = parser.parse_args()
    folder, began = arguments.folder.resolve(), time.monotonic()
    known = study(arguments.edge) | {"runs": {"truth": TRUTH}}
    surface = f"results/runs/truth/{START}/surfaces/week-22.00/pial.surf.gii"
    call(folder / "truth", known, arguments.cores, surface)
    # on triangles a quarter as long, smoothing leaves the shape as it is
    mesh = read_surface(folder / "truth" / surface)
    fine = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).subdivide().subdivide()
    write_surface(folder / "simulated.surf.gii", TriangleMesh(fine.vertices, fine.faces.astype(np.int32)))
    search = study(arguments.edge) | {
        "brains": [{"id": "simulated", "week": 22, "pial": str(folder / "simulated.surf.gii")}],
        "runs": {"reference": {}},
        "calibrate": {
            "base": "reference",
            "parameters": BOUNDS,
            "score": {"size": 1.0, "shape_index": 1.0},
            "compare_week": 22,
            "rounds": [arguments.runs, *[4] * arguments.rounds],
        },
    }
    call(folder / "search", search, arguments.cores, "calibrate")
    found = folder / "search" / "results" / "study" / "calibration"
    optimum, runs = read_table(found / "optimum.csv").set_index("parameter"), read_table(found / "runs.csv")
    result: dict[str, Any] = {}
    for name, truth in TRUTH.items():
        row, (low, high) = optimum.loc[name], BOUNDS[name]
        result[name] = {
            "truth": truth,
            "value": float(row["value"]),
            "error_of_range": round(abs(row["value"] - truth) / (high - low), 4),
        }
    result |= {
        "runs": len(runs),
        "diverged": int((runs["outcome"] == "diverged").sum()),
        "best_score": float(runs["score"].min()),
        "seconds": round(time.monotonic() - began, 1),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
