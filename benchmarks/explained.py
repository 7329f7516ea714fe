"""Compare the targets and the run of a brain with its observed later surfaces.

    ./run python benchmarks/explained.py FOLDER RUN BRAIN OBSERVED [--weeks 26 28 30]

FOLDER is that of a study in which the brain BRAIN has been folded in the run RUN by its own growth; OBSERVED is the
pattern of the ids of observed brains, such as crl-{week:g}: one for each week that is compared, and for the one before.
For each week and each of the observed brain, that of the week before, target and run: area (cm²), gyrification index by
hulls, mean distance of the observed surface from this one after rigid alignment (mm), r of the shape index (scaled to
the observed volume), and crossing faces. The last line is one JSON object.
"""

import argparse
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from gyriflow.anatomy.fissure import cut_sides, nearer_left
from gyriflow.compare.placement import correlation, interpolate_measures
from gyriflow.compare.shapes import align, prepare_for_comparison
from gyriflow.geometry.matching import crossing_faces, nearest_on
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh, area_cm2, convex_hull, vertex_areas
from gyriflow.io.frames import read_positions, read_weeks
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.metrics.gyrification import gyrification_index, pieces_over
from gyriflow.settings.terms import SIDES
from gyriflow.study.paths import FOLDING, MESH, PIAL, TARGETS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("run")
    parser.add_argument("brain")
    parser.add_argument("observed", metavar="OBSERVED", help="for example crl-{week:g}")
    parser.add_argument("--weeks", type=float, nargs="+", help="weeks of the table [default: all of the run]")
    arguments = parser.parse_args()
    folder, brain = arguments.folder, arguments.brain

    def surfaces(name: str) -> list[TriangleMesh]:
        return [read_surface(folder / PIAL[part].format(brain=name)) for part in ("whole", *SIDES)]

    boundary, used = boundary_surface(read_tetrahedral_mesh(folder / MESH["mesh"].format(brain=brain)))
    left = nearer_left(boundary, *surfaces(brain)[1:])
    shapes = read_weekly_shapes(folder / TARGETS.format(brain=brain, origin="self"))
    targets = dict(zip(map(float, shapes.weeks), shapes.positions, strict=True))
    frames = folder / FOLDING["frames"].format(run=arguments.run, brain=brain)
    weeks = read_weeks(frames)
    rows: list[dict[str, Any]] = []
    for before, week in pairwise(weeks):
        if arguments.weeks and week not in arguments.weeks:
            continue
        observed, *sides = surfaces(arguments.observed.format(week=week))
        folds = prepare_for_comparison(observed, observed)
        places = {"target": targets[week], "run": read_positions(frames, week)}
        models = {name: TriangleMesh(at[used], boundary.faces) for name, at in places.items()}
        compared: dict[str, tuple[TriangleMesh, list[TriangleMesh]]] = {"observed": (observed, sides)}
        earlier, *earlier_sides = surfaces(arguments.observed.format(week=before))
        compared["week_before"] = earlier, earlier_sides
        compared |= {name: (surface, list(cut_sides(surface, left))) for name, surface in models.items()}
        for name, (surface, halves) in compared.items():
            values, _ = interpolate_measures(prepare_for_comparison(surface, observed), folds)
            distance, _, _ = nearest_on(observed.vertices, align(surface, observed))
            row: dict[str, Any] = {"week": week, "shape": name, "area_cm2": area_cm2(surface)}
            row["gyrification_index"] = gyrification_index(
                halves, [pieces_over(convex_hull(half), half) for half in halves]
            )
            row["distance_mm"] = float(np.average(distance, weights=vertex_areas(observed)))
            row["r_shape_index"] = correlation(folds.shape_index, values["shape_index"], folds.areas)
            rows.append(row | {"crossing_faces": crossing_faces(surface)})
    print(pd.DataFrame(rows).to_string(index=False, float_format="%.3f"))
    print(json.dumps({"rows": rows}))


if __name__ == "__main__":
    main()
