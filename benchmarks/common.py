"""Steps that several benchmarks share: run the workflow, compare shapes, print
results."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gyriflow.compare.accuracy import log_value
from gyriflow.compare.placement import correlation
from gyriflow.compare.shapes import (
    PreparedSurface,
    interpolate_measures,
    prepare_for_comparison,
)
from gyriflow.errors import GyriflowError
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.yaml_files import write_yaml

ROOT = Path(__file__).resolve().parents[1]


def run_workflow(
    folder: Path, config: dict[str, Any], cores: int, *targets: str
) -> None:
    """Run targets in a folder, which is made if necessary; GyriflowError if one
    fails."""
    folder.mkdir(parents=True, exist_ok=True)
    write_yaml(folder / "study.yaml", config)
    command = [
        sys.executable,
        "-m",
        "gyriflow.running.launch",
        "--cores",
        str(cores),
        *targets,
        "--snakefile",
    ]
    command += [
        str(ROOT / "Snakefile"),
        "--configfile",
        str(folder / "study.yaml"),
        "--directory",
        str(folder),
    ]
    path = os.pathsep.join(
        filter(None, [str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    )
    environment = os.environ | {"PYTHONPATH": path}
    outcome = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False
    )
    if outcome.returncode:
        raise GyriflowError(
            f"{targets[0]} failed",
            path=folder,
            found="\n".join(outcome.stderr.splitlines()[-15:]),
        )


def r_shape_index(
    surface: TriangleMesh, observed: TriangleMesh, folds: PreparedSurface
) -> float:
    """Return the correlation of the shape index of a surface, scaled and aligned, with
    that of an observed one.

    `folds` is the observed surface as `prepare_for_comparison` returns it.
    """
    values, _ = interpolate_measures(prepare_for_comparison(surface, observed), folds)
    return correlation(folds.shape_index, values["shape_index"], folds.areas)


def relative_difference(metric: str, found: float, observed: float) -> float:
    """Return the difference of a metric from an observed brain's as a fraction of it;
    that of the gyrification index is of the folding."""
    difference = log_value(metric, found) - log_value(metric, observed)
    return float(np.expm1(difference))


def print_rows(rows: list[dict[str, Any]], **more: Any) -> None:
    """Print rows as a table, and as the last line one JSON object with `rows` and more
    entries."""
    print(pd.DataFrame(rows).to_string(index=False, float_format="%.4g"))
    print(json.dumps({"rows": rows, **more}))
