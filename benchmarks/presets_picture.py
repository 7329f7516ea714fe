"""The picture of runs of a finished study, week by week above the real brains.

    ./run python benchmarks/presets_picture.py STUDY_FOLDER PICTURE.png --runs reference measured --weeks 21 23 25

STUDY_FOLDER is where the study ran, with `results/` in it; `--brain` is the folded one of several.
"""

import argparse
from pathlib import Path

from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.surfaces import read_surface
from gyriflow.report.renders import runs_by_week


def surfaces(folder: Path, pattern: str, weeks: list[float]) -> dict[float, TriangleMesh]:
    """Returns the surfaces there are, by week."""
    found = {week: next(folder.glob(pattern.format(week=week)), None) for week in weeks}
    return {week: read_surface(path) for week, path in found.items() if path}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--runs", nargs="+", default=["reference", "measured"])
    parser.add_argument("--weeks", nargs="+", type=float, default=[21, 22, 23, 24, 25])
    parser.add_argument("--brain", default="*", help="that was folded")
    parser.add_argument("--real", default="spina-bifida-unoperated-{week:.0f}", help="names of the real brains")
    parser.add_argument("--measured", default="spina bifida aperta, unoperated", help="what the real brains are called")
    arguments = parser.parse_args()
    results = arguments.study / "results"
    runs = {
        run: surfaces(
            results / "runs" / run, arguments.brain + "/surfaces/week-{week:.2f}/pial.surf.gii", arguments.weeks
        )
        for run in arguments.runs
    }
    real = surfaces(results / "brains", arguments.real + "/surface/pial.surf.gii", arguments.weeks)
    figure = runs_by_week(runs, real, measured=arguments.measured)
    arguments.picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(arguments.picture, dpi=200)


if __name__ == "__main__":
    main()
