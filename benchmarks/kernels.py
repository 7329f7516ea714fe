"""Measure how the demo's metrics depend on the processor: run it with the kernels of
OpenBLAS for two processors, and compare all metrics with the noise of measuring.

    ./run python benchmarks/kernels.py FOLDER [--kernels Haswell Prescott] [--cores 2]

Each kernel has a working directory in FOLDER; finished results are not computed again.
For measured and simulated brains and each metric the table has the largest difference
of a hemisphere or a whole brain at any week, relative to the value but for
metrics that may be negative, and the largest ratio of a difference to its noise: one
standard deviation of the difference between two measurements of one brain
(`norms/repeatability.yaml`). The last line is one JSON object.
"""

import argparse
import os
from pathlib import Path

import pandas as pd
from common import ROOT, print_rows, run_workflow

from gyriflow.io.yaml_files import read_keys
from gyriflow.metrics.repeatability import difference_noise
from gyriflow.quantities import METRICS
from gyriflow.settings.terms import OBSERVED
from gyriflow.shipped import SHIPPED

KEYS = ["subject", "run", "week", "hemisphere", "metric"]
"""Columns of `metrics.csv` that say whose value a row has."""


def metrics_with(kernel: str, folder: Path, cores: int) -> pd.Series:
    """Run the demo up to its metrics with a kernel; return the values by `KEYS`."""
    os.environ["OPENBLAS_CORETYPE"] = kernel
    run_workflow(folder, read_keys(ROOT / "config" / "config.yaml"), cores, "metrics")
    table = pd.read_csv(folder / "results" / "study" / "metrics.csv")
    return table.set_index(KEYS)["value"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kernels", nargs=2, default=["Haswell", "Prescott"])
    parser.add_argument("--cores", type=int, default=2)
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    first, second = (
        metrics_with(kernel, folder / kernel, arguments.cores)
        for kernel in arguments.kernels
    )
    if not first.index.equals(second.index):
        raise ValueError("the two kernels have other brains, weeks or metrics")
    noise = read_keys(SHIPPED / "norms" / "repeatability.yaml")
    table = pd.DataFrame({"value": first, "difference": (second - first).abs()})
    table = table.reset_index()
    table["brains"] = table["run"].map(
        lambda run: "measured" if run == OBSERVED else "simulated"
    )
    rows = []
    for (brains, metric), values in table.groupby(["brains", "metric"], sort=False):
        difference = values["difference"]
        is_signed = METRICS[metric].is_signed
        shown = difference if is_signed else difference / values["value"].abs()
        ratios = []
        for _, row in values.iterrows():
            sd = difference_noise(metric, row["value"], noise)
            ratios.append(row["difference"] / sd)
        rows.append(
            {
                "brains": brains,
                "metric": metric,
                "largest_difference": shown.max(),
                "of_its_noise": max(ratios),
            }
        )
    print_rows(rows, kernels=arguments.kernels)


if __name__ == "__main__":
    main()
