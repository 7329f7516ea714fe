"""Times all metrics of real brains and prints them by week: one JSON line.

    ./run python benchmarks/brain_metrics.py LABELS.nii.gz:WEEK ... [--threads 2] [--edge 0.75] [--last-band B5]

The surfaces are made from label volumes of the scheme `spina-bifida-atlas`, with `--edge` mm edges. Per week: vertices
of the whole, modes of the left hemisphere, `seconds` (wall), `cpu_seconds` (of all processes), and the metrics of the
whole; powers of bands are those of the left hemisphere.
"""

import argparse
import json
import os
import time

import numpy as np

from gyriflow.io.volumes import read_label_volume
from gyriflow.metrics.measure import measure_brain
from gyriflow.parameters.schemes import SCHEMES
from gyriflow.surface.from_labels import from_labels, thickness_from_labels


def cpu_seconds() -> float:
    """Returns the CPU time of this process and its ended children."""
    return sum(os.times()[:4])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("brains", nargs="+", metavar="LABELS:WEEK")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--edge", type=float, default=0.75)
    parser.add_argument("--last-band", default="B5", choices=["B4", "B5", "B6"])
    options = parser.parse_args()
    result = {}
    for brain in options.brains:
        path, week = brain.rsplit(":", 1)
        volume = read_label_volume(path)
        scheme = SCHEMES["spina-bifida-atlas"]
        surface = from_labels(volume.labels, volume.affine, scheme, week=float(week), edge_length_mm=options.edge)
        pose = np.array(surface.report["pose"])
        thickness = thickness_from_labels(volume.labels, volume.affine, scheme, surface.whole, pose)
        clock, cpu = time.perf_counter(), cpu_seconds()
        found = measure_brain(
            surface.whole,
            surface.left,
            surface.right,
            thickness_mm=thickness.measured_mm,
            spangy_modes=options.last_band,
            threads=options.threads,
        )
        seconds, cpu = time.perf_counter() - clock, cpu_seconds() - cpu
        values = found.table.set_index(["hemisphere", "metric"])["value"]
        left = values["left"]
        result[week] = {
            "vertices": len(surface.whole.vertices),
            "modes": int(left["spangy_modes"]),
            "seconds": round(seconds, 1),
            "cpu_seconds": round(cpu, 1),
            **{name: round(float(value), 4) for name, value in values["whole"].items()},
            **{name: round(float(left[name]), 4) for name in left.index if name.endswith("power")},
        }
        print(week, result[week], flush=True)
    print(json.dumps(result))


if __name__ == "__main__":
    main()
