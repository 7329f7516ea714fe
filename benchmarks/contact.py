"""Folding with and without contact: what crosses what, week by week, and what it costs.

    ./run python benchmarks/contact.py results/brains/week21/mesh/brain.xdmf --out contact

Each kind of contact folds the mesh with the reference parameters from `--start` to `--end`, on `--ranks` ranks, into a
folder of its own; a run that is there already, complete or not, is gone on with. For each week the crossing faces of
the pial surface are counted with exact predicates, and inverted elements. The last line is one JSON object.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from gyriflow.geometry.matching import crossing_faces
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface, signed_volumes
from gyriflow.geometry.triangles import area, convex_hull, signed_volume
from gyriflow.io.files import read_json, read_table
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml, write_yaml
from gyriflow.metrics.gyrification import gyrification_index, pieces_over

KINDS = ("global", "planes", "none")


def fold(arguments: argparse.Namespace, kind: str) -> Path:
    """Fold with a kind of contact, or go on with it; the folder of the run."""
    x = read_tetrahedral_mesh(arguments.mesh).vertices[:, 0]
    weeks = [float(week) for week in range(arguments.start, arguments.end + 1)]
    values = {"start_week": weeks[0], "end_week": weeks[-1], "output_weeks": weeks}
    values |= {"fissure_x_mm": float(x.min() + x.max()) / 2, "contact": {"kind": kind}}
    values = (read_yaml(arguments.params) if arguments.params else {}) | values
    out, params = arguments.out / kind, arguments.out / f"{kind}.yaml"
    out.mkdir(parents=True, exist_ok=True)
    write_yaml(params, values)
    if not (out / "summary.json").exists():
        program = [sys.executable, "-m", "gyriflow.folding", str(arguments.mesh), "--params", str(params)]
        command = ["mpiexec", "-n", str(arguments.ranks), *program, "--out", str(out)]
        environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        subprocess.run(command, env=environment, check=True)
    return out


def weekly(out: Path) -> pd.DataFrame:
    """Tabulate what there is to say of a run, a row a week."""
    frames, steps, rows = out / "frames.h5", read_table(out / "steps.csv"), []
    tets, before = read_tets(frames), 0.0
    for week in read_weeks(frames):
        brain = TetrahedralMesh(read_positions(frames, week), tets)
        surface, _ = boundary_surface(brain)
        during = steps[steps["week"].between(before + 1e-6, week + 1e-6)]
        row = {
            "week": week,
            "area_cm2": area(surface) / 100,
            "volume_mL": signed_volume(surface) / 1000,
            "gi_hull": gyrification_index([surface], [pieces_over(convex_hull(surface), surface)]),
            "crossing_faces": crossing_faces(surface),
            "inverted": int((signed_volumes(brain) <= 0).sum()),
            "seconds": during["seconds"].sum(),
            "newton": during["newton"].mean(),
            "krylov": during["krylov"].sum() / max(during["newton"].sum(), 1),
        }
        if "min_distance_mm" in during:
            row |= {"min_distance_mm": during["min_distance_mm"].min(), "pairs": during["contact_pairs"].max()}
        rows.append(row)
        before = week
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=["global", "planes"])
    parser.add_argument("--start", type=int, default=21)
    parser.add_argument("--end", type=int, default=36)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--params", type=Path, help="parameters (YAML) that replace reference values")
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs")
    arguments, found = parser.parse_args(), {}
    for kind in arguments.kinds:
        out = fold(arguments, kind)
        table, summary = weekly(out), read_json(out / "summary.json")
        print(f"contact {kind}\n{table.to_string(index=False, float_format='%.3g')}", flush=True)
        crossing = table.loc[table["crossing_faces"] > 0, "week"]
        found[kind] = {name: summary[name] for name in ("tets", "pial_faces", "ranks", "steps", "seconds_per_step")}
        found[kind] |= {
            "peak_memory_MiB": round(summary["peak_memory_MiB"]),
            "min_J": round(summary["min_J"], 3),
            "first_week_with_crossing": None if crossing.empty else float(crossing.iloc[0]),
            "crossing_faces_at_end": int(table["crossing_faces"].iloc[-1]),
            "inverted": int(table["inverted"].sum()),
        }
        if "min_distance_mm" in table:
            found[kind]["min_distance_mm"] = float(np.round(table["min_distance_mm"].min(), 4))
    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
