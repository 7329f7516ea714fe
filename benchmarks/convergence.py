"""How much folding depends on the mesh and on the time step: one smooth start, several resolutions, both orders.

    ./run python benchmarks/convergence.py --folder FOLDER --figure docs/images/brain-convergence.png

A smooth hemisphere of 21 GW (`smooth_hemisphere.py`) whose cortex and core grow, free, in contact with itself, is
folded on meshes with so many node distances at the surface to the cortical thickness, linear and quadratic elements
alike, so that both orders have about the same unknowns. Every run carries the same surface along, which is measured;
runs are compared at the same material points, and with the finest quadratic one. A second mesh of the same resolution,
made of the surface turned, shows what chance does.

Runs are done one at a time on one rank, coarse ones first, while the processor time that they are expected to take is
left of the budget. What is in FOLDER already is not done again. Each run prints a JSON line; the last line is one JSON
object with all of them. FOLDER holds `runs.csv`, `weeks.csv` (metrics), `differences.csv` (pairs of runs) and
`time_steps.csv`.
"""

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from smooth_hemisphere import START_WEEK, Carried, carried, mesh_of, start_surface

ROOT = Path(__file__).resolve().parents[1]
ORDERS = {1: "linear", 2: "quadratic"}
NODES_TO_CORTEX = (1.41, 2.0, 2.83, 4.0)
"""Thickness over the distance of nodes at the surface: halved, elements to the cortex of quadratic ones."""
REPEATED = 2.0
"""The resolution at which a second mesh of quadratic elements is made."""
PARAMETERS = {
    "start_week": START_WEEK,
    "fissure_x_mm": 0.0,
    # about as the atlas' areas and volumes grow from 21 to 29 GW, had nothing to be pressed together
    "growth_rate_per_s": 2.0e-7,
    "core_growth_rate_per_s": 0.8e-7,
    "support": "free",
    "no_growth": {"kind": "none"},
    "fields": ["displacement"],
}
COMPARED = (
    "area",
    "volume",
    "gyrification_index",
    "mean_sulcal_depth",
    "sulcal_depth_95",
    "mean_curvedness",
    "folding_index",
    *(f"spangy_B{band}_relative_power" for band in range(1, 6)),
)
DAY_S = 86400.0
SCHEMES = ("implicit", "adams-bashforth", "midpoint")
STEPS_DAYS = (2.0, 1.0, 0.5)
FINEST_STEP_DAYS = 0.25
STEPS_UNTIL_GW, STEPS_NODES = 23.0, 1.41


@dataclass(frozen=True)
class Case:
    """A mesh to be folded: order of its elements, node distances to the thickness, and whether it is the second one."""

    order: int
    nodes: float
    turned: bool = False

    @property
    def name(self) -> str:
        return f"{ORDERS[self.order]}-{self.nodes:g}{'-turned' if self.turned else ''}"


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, required=True, help="for meshes, runs and tables; runs there are kept")
    parser.add_argument("--parts", nargs="+", choices=("resolution", "steps"), default=["resolution", "steps"])
    parser.add_argument("--budget-min", type=float, default=50.0, help="processor minutes of solving")
    parser.add_argument("--thickness-mm", type=float, default=2.0)
    parser.add_argument("--nodes", type=float, nargs="+", default=list(NODES_TO_CORTEX), help="to the thickness")
    parser.add_argument("--orders", type=int, nargs="+", choices=(1, 2), default=[1, 2])
    parser.add_argument("--end-week", type=float, default=28.0)
    parser.add_argument("--step-days", type=float, default=1.0)
    parser.add_argument("--time-scheme", choices=SCHEMES, default="adams-bashforth")
    parser.add_argument("--figure", type=Path, help="picture to be made (PNG)")
    return parser.parse_args()


def write_mesh(folder: Path, case: Case, thickness_mm: float) -> tuple[Path, int]:
    """Returns the file of a case's mesh, made where it is not there, and the number of its nodes."""
    from gyriflow.io.tetmeshes import read_tetrahedral_mesh, write_tetrahedral_mesh

    file = folder / f"{case.name}.xdmf"
    if not file.exists():
        mesh = mesh_of(start_surface(ROOT), case.order, thickness_mm / case.nodes, case.turned)
        folder.mkdir(parents=True, exist_ok=True)
        write_tetrahedral_mesh(file, mesh)
    return file, len(read_tetrahedral_mesh(file).vertices)


def fold(mesh: Path, out: Path, parameters: dict[str, Any]) -> dict[str, Any]:
    """Returns the summary of a run on one rank, done where it has not been; an interrupted one goes on."""
    from gyriflow.io.files import read_json, read_table
    from gyriflow.io.yaml_files import write_yaml

    if not (out / "summary.json").exists():
        out.mkdir(parents=True, exist_ok=True)
        write_yaml(out / "params.yaml", parameters)
        program = [sys.executable, "-m", "gyriflow.folding", str(mesh), "--params", str(out / "params.yaml")]
        with (out / "log").open("w") as log:
            done = subprocess.run([*program, "--out", str(out)], stdout=log, stderr=log, check=False)
        if done.returncode != 0:
            return {"failed": (out / "log").read_text().strip().splitlines()[-1]}
    steps = read_table(out / "steps.csv")
    through = steps["elements_through_cortex"]
    return read_json(out / "summary.json") | {
        "elements_through_at_start": float(through.iloc[0]),
        "elements_through_at_end": float(through.iloc[-1]),
        "pairs_at_end": float(steps["contact_pairs"].iloc[-1]) if "contact_pairs" in steps else 0.0,
    }


def parameters_of(arguments: argparse.Namespace, **own: Any) -> dict[str, Any]:
    end = own.get("end_week", arguments.end_week)
    return PARAMETERS | {
        "thickness_mm": arguments.thickness_mm,
        "step_s": arguments.step_days * DAY_S,
        "time_scheme": arguments.time_scheme,
        "contact": {"kind": "global", "gap_mm": 0.02},
        "end_week": end,
        "output_weeks": [float(week) for week in np.append(np.arange(START_WEEK, end - 1e-6), end)],
        **own,
    }


def resolution_runs(arguments: argparse.Namespace) -> list[tuple[Case, dict[str, Any]]]:
    """Returns the cases with what their runs took, coarse ones first, as far as the budget goes."""
    cases = [
        Case(order, nodes) for nodes in sorted(arguments.nodes) for order in sorted(arguments.orders, reverse=True)
    ]
    if 2 in arguments.orders and REPEATED in arguments.nodes:
        cases.insert(cases.index(Case(2, REPEATED)) + 1, Case(2, REPEATED, turned=True))
    done, left_s, seconds_per_node = [], 60 * arguments.budget_min, dict.fromkeys(ORDERS, 0.0)
    for case in cases:
        mesh, nodes = write_mesh(arguments.folder / "meshes", case, arguments.thickness_mm)
        out = arguments.folder / "runs" / case.name
        expected = seconds_per_node[case.order] * nodes
        if expected > left_s and not (out / "summary.json").exists():
            print(json.dumps({"run": case.name, "skipped_since_s": expected, "left_s": left_s}), flush=True)
            continue
        found = fold(mesh, out, parameters_of(arguments))
        took = found.get("cpu_seconds", 0.0)
        left_s, seconds_per_node[case.order] = left_s - took, took / nodes
        row = {"run": case.name, "order": case.order, "nodes_to_cortex": case.nodes, "turned": case.turned, **found}
        row |= {"nodes": nodes, "elements_to_cortex": case.nodes / case.order}
        print(json.dumps({name: value for name, value in row.items() if name != "weeks"}), flush=True)
        done.append((case, row))
    return done


def measured(arguments: argparse.Namespace, case: Case, week: float) -> Carried:
    """Returns the measured surface of a run; kept in its folder, since measuring takes seconds."""
    import pickle

    file = arguments.folder / "runs" / case.name / f"measured-{week:g}.pickle"
    if not file.exists():
        found = carried(ROOT, file.parent / "frames.h5", week)
        file.write_bytes(
            pickle.dumps((found.surface.vertices, found.surface.faces, found.mean_curvature, found.values))
        )
    from gyriflow.geometry.triangles import TriangleMesh

    vertices, faces, mean, values = pickle.loads(file.read_bytes())
    return Carried(TriangleMesh(vertices, faces), mean, values)


def difference(one: Carried, other: Carried, start: Carried) -> dict[str, float]:
    """Returns how two runs differ at a week: places in mm at the same material points, surfaces, curvature, metrics."""
    from gyriflow.geometry.motion import rigid_fit, without_rigid_motion
    from gyriflow.geometry.triangles import transformed, vertex_areas
    from gyriflow.metrics.similarity import distances
    from gyriflow.validation.placement import correlation

    areas = vertex_areas(other.surface)
    apart = without_rigid_motion(other.surface.vertices, one.surface.vertices, areas)
    moved = without_rigid_motion(start.surface.vertices, other.surface.vertices, areas)
    laid = transformed(one.surface, rigid_fit(one.surface.vertices, other.surface.vertices, areas))
    ways = np.concatenate([distances(laid, other.surface), distances(other.surface, laid)])
    both = np.concatenate([vertex_areas(laid), areas])

    def rms(vectors: np.ndarray) -> float:
        return float(np.sqrt(np.average((vectors**2).sum(axis=1), weights=areas)))

    return {
        "displacement_rms_mm": rms(apart),
        "displacement_share": rms(apart) / rms(moved),
        "surface_distance_mm": float(np.average(ways, weights=both)),
        "surface_distance_95_mm": float(np.quantile(ways, 0.95, weights=both, method="inverted_cdf")),
        "r_mean_curvature": correlation(one.mean_curvature, other.mean_curvature, areas),
        **{name: one.values[name] - other.values[name] for name in COMPARED},
    }


def compare(arguments: argparse.Namespace, cases: list[Case]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Returns the metrics of all runs by week, and the differences of all pairs of runs by week."""
    weeks = [week for week in parameters_of(arguments)["output_weeks"] if week > START_WEEK]
    rows, pairs = [], []
    start = measured(arguments, cases[0], START_WEEK)
    for week in weeks:
        found = {case: measured(arguments, case, week) for case in cases}
        rows += [{"run": case.name, "week": week, **one.values} for case, one in found.items()]
        for a, b in combinations(cases, 2):
            pairs.append({"run": a.name, "other": b.name, "week": week} | difference(found[a], found[b], start))
    return pd.DataFrame(rows), pd.DataFrame(pairs)


def time_steps(arguments: argparse.Namespace) -> pd.DataFrame:
    """Returns the error of each scheme and step against the smallest midpoint steps, on one coarse mesh."""
    from gyriflow.io.frames import read_positions

    mesh, _ = write_mesh(arguments.folder / "meshes", Case(2, STEPS_NODES), arguments.thickness_mm)
    plans = [("midpoint", FINEST_STEP_DAYS), *((scheme, days) for scheme in SCHEMES for days in STEPS_DAYS)]
    rows, exact = [], None
    for scheme, days in plans:
        out = arguments.folder / "steps" / f"{scheme}-{days:g}"
        own = {"step_s": days * DAY_S, "time_scheme": scheme, "contact": {"kind": "none"}, "end_week": STEPS_UNTIL_GW}
        found = fold(mesh, out, parameters_of(arguments, **own))
        if "failed" in found:
            rows.append({"scheme": scheme, "step_days": days, **found})
            continue
        before, after = (read_positions(out / "frames.h5", week) for week in (START_WEEK, STEPS_UNTIL_GW))
        exact = after if exact is None else exact
        apart, moved = np.linalg.norm(after - exact, axis=1), np.linalg.norm(exact - before, axis=1)
        row = {"scheme": scheme, "step_days": days, "cpu_seconds": found["cpu_seconds"]}
        row |= {"rms_mm": float(np.sqrt((apart**2).mean())), "largest_mm": float(apart.max())}
        rows.append(row | {"share": row["rms_mm"] / float(np.sqrt((moved**2).mean()))})
        print(json.dumps(rows[-1]), flush=True)
    return pd.DataFrame(rows)


def main(arguments: argparse.Namespace) -> None:
    from gyriflow.io.files import write_table

    result: dict[str, Any] = {}
    if arguments.figure:
        arguments.figure.parent.mkdir(parents=True, exist_ok=True)  # rather than fail after all the work
    if "steps" in arguments.parts:
        steps = time_steps(arguments)
        write_table(arguments.folder / "time_steps.csv", steps)
        result["time_steps"] = steps.to_dict("records")
    if "resolution" in arguments.parts:
        runs = [(case, row) for case, row in resolution_runs(arguments)]
        folded = [case for case, row in runs if "failed" not in row]
        table = pd.DataFrame([row for _, row in runs]).drop(columns="weeks", errors="ignore")
        weeks, pairs = compare(arguments, folded)
        for name, content in (("runs", table), ("weeks", weeks), ("differences", pairs)):
            write_table(arguments.folder / f"{name}.csv", content)
        result["runs"] = table.to_dict("records")
        end = weeks["week"].max()
        finest = max((case for case in folded if not case.turned), key=lambda case: (case.nodes, case.order)).name
        result["finest"] = finest
        if len(folded) > 1:
            result["against_finest"] = pairs[(pairs["other"] == finest) & (pairs["week"] == end)].to_dict("records")
        if arguments.figure and len(folded) > 1:
            from convergence_figure import draw

            draw(table, weeks, pairs, finest, arguments.figure)
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main(parse())
