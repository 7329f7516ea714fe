"""Paths of all results. Names in braces are the wildcards of the rules."""

import re
from collections.abc import Iterable
from pathlib import PurePath

from ..settings.terms import SIDES, Side
from ..shipped import SHIPPED
from ..units import week_tag

BRAIN = "results/brains/{brain}"
SURFACE = f"{BRAIN}/surface"
METRICS_FOLDER = f"{BRAIN}/metrics"
RUN = "results/runs/{run}/{brain}"
STUDY = "results/study"
PLAN = "results/plan"
REPORT = "results/report"
SWEEP = f"{STUDY}/{{sweep}}"
CALIBRATION = f"{STUDY}/calibration"
WEEK = "week-{week}"
PLACE = "results/{where}"
"""The metrics of a brain, measured or simulated."""
PUBLISHED = str(SHIPPED / "workflow" / "published" / "fetalfoldsim.yaml")
"""Values reported by the paper."""
PREDICTION_TESTS = str(SHIPPED / "norms" / "predictions.yaml")
"""Accuracy of predictions of brains with a later scan."""
NORMAL_VOLUMES = str(SHIPPED / "norms" / "volumes.yaml")
"""Volumes of normal atlases by week, by which the ages of an atlas' brains are set."""


def file_of(pattern: str, **names: str | float) -> str:
    """Return the file of a pattern; weeks have two decimals, such as "21.50"."""
    texts = {}
    for key, name in names.items():
        texts[key] = name if isinstance(name, str) else week_tag(name)
    return pattern.format(**texts)


def surfaces_in(folder: str, sides: tuple[Side, ...] = SIDES) -> dict[str, str]:
    """Return the surface files of a brain in a folder, by part: the whole and its
    hemispheres."""
    files = {"whole": f"{folder}/pial.surf.gii"}
    for side in sides:
        files[side] = f"{folder}/{side}.pial.surf.gii"
    return files


def pial_of(*sides: Side) -> dict[str, str]:
    """Return the surface files of a brain with some hemispheres, for any source."""
    return {
        **surfaces_in(SURFACE, sides),
        "stl": f"{SURFACE}/pial.stl",
        "report": f"{SURFACE}/surface.json",
    }


def folded_of(*sides: Side) -> dict[str, str]:
    """Return the surfaces of a simulated brain at a week with some hemispheres, and its
    thickness."""
    folder = f"{RUN}/surfaces/{WEEK}"
    return {
        **surfaces_in(folder, sides),
        "thickness": f"{folder}/thickness.shape.gii",
    }


def fine_of(*sides: Side) -> dict[str, str]:
    """Return the surfaces of a predicted brain at a week with the resolution of
    observed brains."""
    return surfaces_in(f"{RUN}/surfaces/{WEEK}/fine", sides)


def measures_in(folder: str, *sides: Side) -> dict[str, str]:
    """Return the tables of a measured or simulated brain in a folder, and the maps on
    its hemispheres."""
    files = {}
    for name in ("metrics", "spectra", "coefficients"):
        files[name] = f"{folder}/{name}.csv"
    for side in sides:
        files[f"{side}_maps"] = f"{folder}/{side}.shape.gii"
    return files


TEMPLATE_MAPS = f"{PLACE}/{{side}}.template.shape.gii"
"""Maps at the vertices of the study's template."""


def white_of(*sides: Side) -> dict[str, str]:
    """Return the files of white surfaces of hemispheres, of the maps on them, and of
    their metrics."""
    files = {}
    for side in sides:
        files[f"{side}_surface"] = f"{SURFACE}/{side}.white.surf.gii"
    for side in sides:
        files[f"{side}_maps"] = f"{METRICS_FOLDER}/{side}.white.shape.gii"
    return files | {"metrics": f"{METRICS_FOLDER}/white.csv"}


def region_files(folder: str) -> dict[str, str]:
    """Return the files with the regions of both hemispheres in a folder."""
    return {f"{side}_regions": f"{folder}/{side}.regions.label.gii" for side in SIDES}


SHAPE = f"{SURFACE}/shape.surf.gii"
PIAL = pial_of(*SIDES)
THICKNESS = {
    "thickness": f"{SURFACE}/thickness.shape.gii",
    # NaN where it could not be measured
    "measured": f"{SURFACE}/measured_thickness.shape.gii",
    "summary": f"{SURFACE}/thickness.json",
}
FILLED_LABELS = f"{SURFACE}/filled.nii.gz"
MATCHED = f"{STUDY}/matched/{{earlier}}/{{later}}.h5"
REGISTRATION = f"{STUDY}/registration/{{earlier}}/{{later}}"
REGISTERED = f"{REGISTRATION}.h5"
VARIED_REGISTRATION = f"{REGISTRATION}/smoothing-{{smoothing}}.seed-{{seed}}.h5"
"""A registration with a factor of its smoothing, and labels perturbed with a seed (0:
unchanged)."""
MESH = {
    "mesh": f"{BRAIN}/mesh/brain.xdmf",
    "data": f"{BRAIN}/mesh/brain.h5",
    "surface": f"{BRAIN}/mesh/pial.stl",
    "quality": f"{BRAIN}/mesh/quality.json",
}
TARGETS = f"{BRAIN}/mesh/targets.{{origin}}.h5"
PATH_MESH = {name: f"{BRAIN}/path/{PurePath(file).name}" for name, file in MESH.items()}
ATLAS_PATH = f"{BRAIN}/path/shapes.h5"
"""Shapes of the mesh of an atlas' first brain through all its weeks, on which other
brains are carried."""

GROWTH = {name: f"{STUDY}/growth/{name}.csv" for name in ("areas", "rates")}
CURVES = {
    "curves": f"{STUDY}/growth/curves.csv",
    "errors": f"{STUDY}/growth/curve_errors.csv",
}

PARAMETERS = f"{RUN}/params.yaml"
MAPS = f"{RUN}/folding/maps.h5"
GROWTH_MAPS = f"{RUN}/surfaces/growth.shape.gii"
MESH_REGIONS = {
    "mesh": f"{RUN}/folding/regions.xdmf",
    "data": f"{RUN}/folding/regions.h5",
}
"""Zones, layers and hemispheres of a run's start mesh; `region_files` are the regions
of the cortex."""
FOLDING = {
    "steps": f"{RUN}/folding/steps.csv",
    "frames": f"{RUN}/folding/frames.h5",
    "series": f"{RUN}/folding/frames.xdmf",
    "zones": f"{RUN}/folding/zones.json",
    "summary": f"{RUN}/folding/summary.json",
}

_COMPARED_IN_WEEK = f"{STUDY}/validation/{{brain}}/{WEEK}"
PREPARED = {
    "observed": f"{_COMPARED_IN_WEEK}/observed.surf.gii",
    "observed_maps": f"{_COMPARED_IN_WEEK}/observed.shape.gii",
    "start_maps": f"{_COMPARED_IN_WEEK}/start.shape.gii",
    "adjacent_maps": f"{_COMPARED_IN_WEEK}/adjacent.shape.gii",
}
"""The observed surface that all runs from a start brain are compared with in a week,
prepared for comparison, with its curvature and those of the start brain and the brain
of the week before, at its vertices."""
PREDICTION = f"{RUN}/metrics/prediction.csv"
ATLAS_BRAIN = f"{RUN}/surfaces/{WEEK}/atlas.pial.surf.gii"
"""The atlas' own brain for comparison with a prediction: aligned with it, with its
volume."""
ENSEMBLE_MAPS = f"{RUN}/metrics/{WEEK}/{{side}}.ensemble.shape.gii"
"""Maps of the spread of an ensemble on a hemisphere."""
GROWTH_SD = f"{RUN}/surfaces/growth_sd.shape.gii"
"""Standard deviation of the growth maps of an ensemble."""
ENSEMBLE = f"{RUN}/metrics/ensemble.csv"
"""Intervals of a run with an ensemble."""
DEVIATION = {
    "table": f"{RUN}/metrics/{WEEK}/deviation.csv",
    "maps": f"{RUN}/metrics/{WEEK}/deviation.shape.gii",
}
DESIGN = f"{CALIBRATION}/round-{{round}}.csv"
SCORE = f"{CALIBRATION}/scores/{{run}}.csv"
VALIDATION = f"{RUN}/metrics/validation.csv"
COMPARED_MEMBER = f"{SWEEP}/members/{{run}}/{{brain}}/comparison.csv"
MEMBER_COEFFICIENTS = f"{SWEEP}/members/{{run}}/{{brain}}/coefficients.csv"


def one_of(names: Iterable[str]) -> str:
    """Return a pattern that matches exactly these names, or nothing if there are
    none."""
    return "|".join(map(re.escape, names)) or r"(?!)"


def log_of(rule: str, pattern: str) -> str:
    """Return the log of a rule that makes a file: named by the rule and the wildcards
    that are not in the folder.

    Commas part the values of the wildcards, since ids of brains may contain dots.
    """
    folders = (BRAIN, RUN, SWEEP, CALIBRATION, STUDY, REPORT, PLACE)
    folder = next(place for place in folders if pattern.startswith(f"{place}/"))
    wildcards = []
    for name in re.findall(r"{\w+}", pattern):
        if name not in folder:
            wildcards.append(name)
    name = f"{rule}.{','.join(wildcards)}" if wildcards else rule
    return f"{folder}/logs/{name}.log"
