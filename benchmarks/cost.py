"""Fits what studies take to finished ones: `./run python benchmarks/cost.py STUDY ...` (working directories).

Times are of one core: what a job kept busy. Each rule has a constant and a part that grows with its brain: faces of the
surface, nodes of the mesh, nodes times steps of a folding. The error is that of studies left out: a fit to the others,
with sizes predicted from the configuration alone, against what was measured. It writes
`src/gyriflow/cli/measured.json`, which the terminal and `gyriflow check` read.
"""

import argparse
import json
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import nnls

from gyriflow.cli.cost import MEASURED, Job, Size, cubes, predict, rule_key, work_of
from gyriflow.config import load
from gyriflow.config.root import Config
from gyriflow.folding.predicted_memory import predicted_memory_mib
from gyriflow.io.files import read_json, write_json
from gyriflow.io.jobs import read_benchmarks
from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.resources import busy_seconds

MIB = 2**20
PLACES = re.compile(r"results/(?:runs/(?P<run>[^/]+)/(?P<brain>[^/]+)|brains/(?P<measured>[^/]+)|[^/]+)/.*")
SURFACE_FILES = ("surface/*", "surfaces/**/*", "metrics/**/*.gii")


@dataclass(frozen=True)
class Study:
    """A finished study: its configuration, and what its jobs, meshes and files were."""

    folder: Path
    config: Config
    jobs: pd.DataFrame
    sizes: dict[str, Size]


def configuration_of(folder: Path) -> Config:
    """Returns the configuration of a finished study, whose inputs may be gone and whose defaults may have changed."""
    path = folder / "results/report/config.yaml"
    content = read_yaml(path)
    for brain in content["brains"]:
        for key, value in brain.items():
            if isinstance(value, str) and value.startswith("/") and not Path(value).exists():
                brain[key] = str(path)
    quality = next(folder.glob("results/brains/*/mesh/quality.json"))
    content["mesh"] = content.get("mesh", {}) | {"order": read_json(quality).get("order", 1)}
    return load(content, folder)


def read_study(folder: Path) -> Study:
    """Returns a study from its working directory."""
    config = configuration_of(folder)
    sizes = {}
    for brain in config.brains:
        surface = read_json(folder / f"results/brains/{brain.id}/surface/surface.json")
        quality = folder / f"results/brains/{brain.id}/mesh/quality.json"
        mesh = read_json(quality) if quality.is_file() else {"vertices": 0, "tets": 0, "pial_faces": 0}
        sizes[brain.id] = Size(surface["faces"], mesh["vertices"], mesh["tets"], mesh["pial_faces"])
    rows = []
    for path in sorted(folder.glob("results/**/benchmarks/*.tsv")):
        name = path.relative_to(folder).as_posix()
        place = PLACES.fullmatch(name)
        rule = "register" if "/registration/" in name else path.name.split(".")[0]
        measured = read_benchmarks(folder, {rule: re.escape(name)}).iloc[0]
        row = {"rule": rule, "run": place["run"], "brain": place["brain"] or place["measured"]}
        rows.append(row | {"wall_s": measured["wall_s"], "cpu_s": measured["cpu_s"], "MiB": measured["memory_MiB"]})
    jobs = pd.DataFrame(rows).astype({"run": object, "brain": object})
    # no run is None, not NaN
    jobs = jobs.where(jobs.notna() | ~jobs.columns.isin(["run", "brain"]), None)
    jobs["busy_s"] = busy_seconds(jobs["wall_s"], jobs["cpu_s"])
    jobs["steps"] = 1.0
    for index in jobs.index[jobs["rule"] == "simulate"]:
        summary = read_json(folder / f"results/runs/{jobs['run'][index]}/{jobs['brain'][index]}/folding/summary.json")
        jobs.loc[index, ["busy_s", "MiB", "steps"]] = (
            summary["cpu_seconds"], summary["peak_memory_MiB"], summary["steps"],
        )  # fmt: skip
    start = sizes[config.start_brains[0]]
    jobs["work"] = [
        work_of(Job(row.rule, row.run, row.brain), sizes.get(row.brain, start), row.steps) for row in jobs.itertuples()
    ]
    jobs["size"] = [
        work_of(Job(row.rule, row.run, row.brain), sizes.get(row.brain, start), 1.0) for row in jobs.itertuples()
    ]
    jobs["key"] = [rule_key(rule, config) for rule in jobs["rule"]]
    return Study(folder, config, jobs.dropna(subset=["busy_s"]), sizes)


def line(work: pd.Series, taken: pd.Series, proportional: bool = False) -> tuple[float, float]:
    """Returns constant and slope, neither below 0, with the least sum of squared relative errors."""
    taken = np.maximum(taken.to_numpy(dtype=float), 0.1)
    if proportional:
        return 0.0, float(np.median(taken / work))
    matrix = np.column_stack([np.ones(len(work)), work]) / taken[:, None]
    scale = np.maximum(np.abs(matrix).max(axis=0), 1e-30)
    solution, _ = nnls(matrix / scale, np.ones(len(work)))
    return tuple(float(value) for value in solution / scale)


def only_foldings(study: Study) -> Study:
    """Returns a study without its other jobs."""
    return replace(study, jobs=study.jobs[study.jobs["rule"] == "simulate"])


def bytes_of(folder: Path, *patterns: str) -> int:
    return sum(path.stat().st_size for pattern in patterns for path in folder.glob(pattern) if path.is_file())


def fit(studies: list[Study]) -> dict:
    """Returns the coefficients of the rules, of the sizes of meshes, and of the disk."""
    jobs = pd.concat([study.jobs for study in studies], ignore_index=True)
    rules = {}
    for key, rows in jobs.groupby("key"):
        # those that grow most, and of which few were measured, grow in proportion
        proportional = rows["rule"].iloc[0] in ("simulate", "tetrahedralise")
        seconds = line(rows["work"], rows["busy_s"], proportional)
        known = rows.dropna(subset=["MiB"])
        memory = line(known["size"], known["MiB"]) if len(known) else (0.0, 0.0)
        typical = float(rows["busy_s"].median())
        rules[str(key)] = {
            "rule": rows["rule"].iloc[0], "jobs": len(rows), "typical_s": typical,
            "s": seconds[0], "s_per_work": seconds[1], "MiB": memory[0], "MiB_per_work": memory[1],
        }  # fmt: skip
    factors: dict[str, list[float]] = {}
    per_node = []
    for study in studies:
        for brain, size in study.sizes.items():
            if not size.nodes:
                continue
            folder, mesh = study.folder / "results/brains" / brain, study.config.mesh
            quality = read_json(folder / "mesh/quality.json")
            edge = quality["pial_edge_mm"] if mesh.pial_faces else mesh.surface_edge_mm
            wanted = cubes(quality["pial_area_mm2"], quality["volume_mm3"], mesh, edge)
            factors.setdefault(mesh.mesher, []).append(size.nodes / wanted)
            per_node.append(size.tets * (8 if mesh.order == 2 else 1) / size.nodes)
    faces = sum(
        len(list((study.folder / f"results/brains/{brain}").glob("surface/pial.surf.gii"))) * size.faces
        for study in studies for brain, size in study.sizes.items()
    )  # fmt: skip
    faces += sum(
        study.sizes[brain].pial_faces * len(study.config.weeks(run, brain))
        for study in studies for run, brain in study.config.folded
    )  # fmt: skip
    results = [study.folder / "results" for study in studies]
    on_surfaces = sum(bytes_of(folder, *(f"**/{pattern}" for pattern in SURFACE_FILES)) for folder in results)
    in_meshes = sum(bytes_of(folder, "brains/*/mesh/*") for folder in results)
    rest = sum(
        bytes_of(folder, "**/*") - bytes_of(folder, "runs/*/*/folding/*") for folder in results
    ) - on_surfaces - in_meshes  # fmt: skip
    nodes = sum(size.nodes for study in studies for size in study.sizes.values())
    return {
        "mesh": {
            "nodes_factor": {mesher: float(np.median(found)) for mesher, found in factors.items()},
            "tets_per_node": float(np.median(per_node)),
        },
        "disk": {
            "MiB_per_face": on_surfaces / MIB / (2 * faces),  # a folded or measured surface has two such jobs
            "MiB_per_node": in_meshes / MIB / nodes,
            "MiB_per_job": max(rest, 0) / MIB / len(jobs),
        },
        "other": {"s": float(jobs["busy_s"].median()), "s_per_work": 0.0, "MiB": 400.0, "MiB_per_work": 0.0},
        "rules": rules,
        "error": {"time": 1.0, "memory": 1.0, "disk": 1.0},
    }


def compare(study: Study, coefficients: dict) -> dict[str, float]:
    """Returns measured over predicted time, memory and disk of a study."""
    jobs = [
        Job(row.rule, row.run, row.brain, study.config.run(row.run).ranks if row.rule == "simulate" else 1)
        for row in study.jobs.itertuples()
    ]
    predicted = predict(jobs, study.config, coefficients, 1, predicted_memory_mib)
    return {
        "time": study.jobs["busy_s"].sum() / predicted.core_seconds,
        "memory": study.jobs["MiB"].max() / predicted.memory_mib,
        "disk": bytes_of(study.folder / "results", "**/*") / MIB / predicted.disk_mib,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="+", type=Path, help="working directories of finished studies")
    parser.add_argument(
        "--loaded", nargs="+", type=Path, default=[],
        help="studies made beside other load: only their foldings count, whose CPU time the solver measures itself",
    )  # fmt: skip
    arguments = parser.parse_args()
    studies = [read_study(folder) for folder in arguments.studies]
    loaded = [only_foldings(read_study(folder)) for folder in arguments.loaded]
    errors = {
        str(study.folder): compare(study, fit([other for other in [*studies, *loaded] if other is not study]))
        for study in studies
    }  # fmt: skip
    coefficients = fit([*studies, *loaded])
    coefficients["studies"] = len(studies) + len(loaded)
    coefficients["error"] = {
        kind: max(max(error[kind], 1 / error[kind]) for error in errors.values()) for kind in ("time", "memory", "disk")
    }
    write_json(MEASURED, coefficients)
    shown = {study: {kind: round(value, 2) for kind, value in error.items()} for study, error in errors.items()}
    print(json.dumps({"jobs": sum(len(study.jobs) for study in studies), "measured_over_predicted": shown}))


if __name__ == "__main__":
    main()
