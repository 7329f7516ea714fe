"""Do atlases predict the sizes of other brains better at stated ages or at ages by size?

    ./run python benchmarks/atlas_sizes.py --atlas crl 'FOLDER/HarvardSTA{week}_Study1/parcellation.nii.gz' \\
        --atlas chinese 'FOLDER/Chinese{week}_Study1/parcellation.nii.gz' --weeks 21 38 --labels 1 2 5 6 8

Volumes are those of the given labels. For each pair of atlases, all starts and all later weeks up to twelve weeks on,
the start's volume times the growth of the other atlas is compared with the volume observed: mean and largest absolute
error, and mean error, as fractions. The last line is one JSON object.
"""

import argparse
import json
from itertools import permutations
from pathlib import Path

import numpy as np

from gyriflow.growth.atlas_path import ages_by_size
from gyriflow.io.volumes import read_label_volume

MAX_WEEKS = 12


def volumes(pattern: str, weeks: range, labels: list[int]) -> dict[int, float]:
    """Return the volumes in mL of some labels, by week, in the files that a pattern with {week} names."""
    found = {}
    for week in weeks:
        path = Path(pattern.format(week=week))
        if path.exists():
            volume = read_label_volume(path)
            found[week] = np.isin(volume.labels, labels).sum() * abs(np.linalg.det(volume.affine[:3, :3])) / 1000
    return found


def errors(growth: dict[str, dict[int, float]], observed: dict[int, float]) -> dict[str, dict[str, float]]:
    """Return the errors of volumes predicted by growth at ages of each kind."""
    pairs = [(a, b) for a in observed for b in observed if 0 < b - a <= MAX_WEEKS]
    result = {}
    for ages, sizes in growth.items():
        ratios = [observed[a] * sizes[b] / sizes[a] / observed[b] - 1 for a, b in pairs if a in sizes and b in sizes]
        result[ages] = {
            "pairs": len(ratios),
            "mean_absolute": round(float(np.mean(np.abs(ratios))), 3),
            "largest": round(float(np.max(np.abs(ratios))), 3),
            "mean": round(float(np.mean(ratios)), 3),
        }
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--atlas", nargs=2, action="append", required=True, metavar=("NAME", "PATTERN"))
    parser.add_argument("--weeks", type=int, nargs=2, required=True)
    parser.add_argument("--labels", type=int, nargs="+", required=True)
    arguments = parser.parse_args()
    weeks = range(arguments.weeks[0], arguments.weeks[1] + 1)
    stated = {name: volumes(pattern, weeks, arguments.labels) for name, pattern in arguments.atlas}
    by_size = {}
    for name, sizes in stated.items():
        ages = ages_by_size(list(sizes), list(sizes.values()))
        by_size[name] = {week: ages.volume(week) for week in sizes}
    rows = [
        {"growth": name, "brains": other} | errors({"stated": stated[name], "by_size": by_size[name]}, stated[other])
        for name, other in permutations(stated, 2)
        if len(set(stated[name]) & set(stated[other])) > 1
    ]
    for row in rows:
        print(row)
    print(json.dumps({"volumes_ml": stated, "rows": rows}))


if __name__ == "__main__":
    main()
