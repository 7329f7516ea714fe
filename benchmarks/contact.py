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
import yaml

KINDS = ("global", "planes", "none")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=["global", "planes"])
    parser.add_argument("--start", type=int, default=21)
    parser.add_argument("--end", type=int, default=36)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--params", type=Path, help="parameters (YAML) that replace reference values")
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs")
    return parser.parse_args()


def fold(arguments: argparse.Namespace, kind: str) -> Path:
    """Returns the folder of a run, made or gone on with."""
    from gyriflow.io.tetmeshes import read_tetrahedral_mesh

    x = read_tetrahedral_mesh(arguments.mesh).vertices[:, 0]
    weeks = [float(week) for week in range(arguments.start, arguments.end + 1)]
    values = {"start_week": weeks[0], "end_week": weeks[-1], "output_weeks": weeks}
    values["fissure_x_mm"] = float(x.min() + x.max()) / 2
    values |= yaml.safe_load(arguments.params.read_text()) if arguments.params else {}
    out = arguments.out / kind
    out.mkdir(parents=True, exist_ok=True)
    params = arguments.out / f"{kind}.yaml"
    params.write_text(yaml.safe_dump(values | {"contact": values.get("contact", {}) | {"kind": kind}}))
    if not (out / "summary.json").exists():
        program = [sys.executable, "-m", "gyriflow.folding", str(arguments.mesh), "--params", str(params)]
        command = ["mpiexec", "-n", str(arguments.ranks), *program, "--out", str(out)]
        environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        with (arguments.out / f"{kind}.log").open("w") as log:
            code = subprocess.run(command, env=environment, stdout=log, stderr=log, check=False).returncode
        if code:
            raise SystemExit(f"the run with contact {kind} ended in {code}: see {arguments.out / kind}.log")
    return out


def weekly(out: Path):
    """Returns what there is to say of a run, a row a week."""
    from gyriflow.geometry.matching import crossing_faces
    from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface, signed_volumes
    from gyriflow.geometry.triangles import area, convex_hull, signed_volume
    from gyriflow.io.frames import read_positions, read_tets, read_weeks
    from gyriflow.metrics.gyrification import envelope, gyrification_index, pieces_over

    tets, steps = read_tets(out / "frames.h5"), pd.read_csv(out / "steps.csv")
    rows = []
    for before, week in zip([0.0, *read_weeks(out / "frames.h5")], read_weeks(out / "frames.h5"), strict=False):
        brain = TetrahedralMesh(read_positions(out / "frames.h5", week), tets)
        surface, _ = boundary_surface(brain)
        during = steps[(steps["week"] > before + 1e-6) & (steps["week"] <= week + 1e-6)]
        row = {
            "week": week,
            "area_cm2": area(surface) / 100,
            "volume_mL": signed_volume(surface) / 1000,
            "gi_hull": gyrification_index([surface], [pieces_over(convex_hull(surface), surface)]),
            "gi_envelope": gyrification_index([surface], [pieces_over(envelope(surface), surface)]),
            "crossing_faces": crossing_faces(surface),
            "inverted": int((signed_volumes(brain) <= 0).sum()),
            "seconds": during["seconds"].sum(),
            "newton": during["newton"].mean(),
            "krylov": during["krylov"].sum() / max(during["newton"].sum(), 1),
        }
        if "min_distance_mm" in during:
            row |= {"min_distance_mm": during["min_distance_mm"].min(), "pairs": during["contact_pairs"].max()}
        rows.append(row)
    return pd.DataFrame(rows)


def main() -> None:
    from gyriflow.io.files import read_json

    arguments, found = parse(), {}
    for kind in arguments.kinds:
        out = fold(arguments, kind)
        table = weekly(out)
        print(f"contact {kind}\n{table.to_string(index=False, float_format='%.3g')}", flush=True)
        summary = read_json(out / "summary.json")
        crossing = table.loc[table["crossing_faces"] > 0, "week"]
        found[kind] = {
            "tets": summary["tets"],
            "pial_faces": summary["pial_faces"],
            "ranks": summary["ranks"],
            "steps": summary["steps"],
            "minutes": round(table["seconds"].sum() / 60, 1),
            "seconds_per_step": round(summary["seconds_per_step"], 2),
            "peak_memory_MiB": round(summary["peak_memory_MiB"]),
            "first_week_with_crossing": None if crossing.empty else float(crossing.iloc[0]),
            "crossing_faces_at_end": int(table["crossing_faces"].iloc[-1]),
            "inverted": int(table["inverted"].sum()),
            "min_J": round(summary["min_J"], 3),
        }
        if "min_distance_mm" in table:
            found[kind]["min_distance_mm"] = float(np.round(table["min_distance_mm"].min(), 4))
    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
