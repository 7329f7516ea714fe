"""Compare how well atlases predict the sizes of other brains at stated ages, at ages by
size, and with a growth that is fitted to several atlases.

    ./run python benchmarks/atlas_sizes.py --weeks 21 38 --labels 1 2 5 6 8 \\
        --atlas crl 'FOLDER/HarvardSTA{week}_Study1/parcellation.nii.gz' \\
        --atlas chinese 'FOLDER/Chinese{week}_Study1/parcellation.nii.gz' \\
        [--volumes xu 23:62.8 25:84 27:113 29:142 31:171 33:201]

Volumes are those of the given labels, or numbers in mL (`--volumes`). For each pair of
atlases, all starts and all later weeks up to twelve weeks on, the start's volume times
the growth of the other atlas is compared with the volume observed: mean and largest
absolute error, and mean error, as fractions. The growth of `mixed` is fitted to all
atlases but the predicted one, each with a level of its own. The last line is one JSON
object.
"""

import argparse
from itertools import permutations
from pathlib import Path

import numpy as np
from common import print_rows

from gyriflow.growth.atlas_path import ages_by_size
from gyriflow.growth.curves import value
from gyriflow.io.volumes import read_label_volume

MAX_WEEKS = 12


def volumes(pattern: str, weeks: range, labels: list[int]) -> dict[int, float]:
    """Return the volumes in mL of some labels, by week, in the files that a pattern
    with {week} names."""
    found = {}
    for week in weeks:
        path = Path(pattern.format(week=week))
        if path.exists():
            volume = read_label_volume(path)
            found[week] = (
                np.isin(volume.labels, labels).sum()
                * abs(np.linalg.det(volume.affine[:3, :3]))
                / 1000
            )
    return found


def errors(sizes: dict[int, float], observed: dict[int, float]) -> dict[str, float]:
    """Return the errors of volumes predicted by the growth of an atlas' sizes."""
    pairs = [
        (a, b)
        for a in observed
        for b in observed
        if 0 < b - a <= MAX_WEEKS and {a, b} <= set(sizes)
    ]
    ratios = np.array(
        [observed[a] * sizes[b] / sizes[a] / observed[b] - 1 for a, b in pairs]
    )
    values = {
        "mean_absolute": np.abs(ratios).mean(),
        "largest": np.abs(ratios).max(),
        "mean": ratios.mean(),
    }
    return {"pairs": len(pairs)} | {
        name: round(float(value), 3) for name, value in values.items()
    }


def on_curve(
    sizes: dict[int, float], others: list[dict[int, float]]
) -> dict[int, float]:
    """Return the volumes at its weeks of the curve of an atlas, whose growth is also
    that of others."""
    ages = ages_by_size(list(sizes), list(sizes.values()), others)
    return {week: float(value(ages.curve, week)) for week in sizes}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--atlas", nargs=2, action="append", required=True, metavar=("NAME", "PATTERN")
    )
    parser.add_argument(
        "--volumes", nargs="+", action="append", default=[], metavar="NAME WEEK:ML"
    )
    parser.add_argument("--weeks", type=int, nargs=2, required=True)
    parser.add_argument("--labels", type=int, nargs="+", required=True)
    arguments = parser.parse_args()
    weeks = range(arguments.weeks[0], arguments.weeks[1] + 1)
    stated = {
        name: volumes(pattern, weeks, arguments.labels)
        for name, pattern in arguments.atlas
    }
    for name, *numbers in arguments.volumes:
        pairs = [number.split(":") for number in numbers]
        stated[name] = {int(week): float(volume) for week, volume in pairs}
    rows = []
    for grown_by, brains in permutations(stated, 2):
        sizes = stated[grown_by]
        if len(set(sizes) & set(stated[brains])) < 2:
            continue
        others = [stated[name] for name in stated if name not in (grown_by, brains)]
        curves = {"stated": sizes, "by_size": on_curve(sizes, [])}
        if others:
            curves["mixed"] = on_curve(sizes, others)
        for ages, curve in curves.items():
            row = {"growth": grown_by, "brains": brains, "ages": ages}
            rows.append(row | errors(curve, stated[brains]))
    print_rows(rows, volumes_ml=stated)


if __name__ == "__main__":
    main()
