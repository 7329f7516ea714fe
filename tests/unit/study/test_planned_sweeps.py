"""Sweeps and calibrations in a configuration: the runs that they make, and what is
refused."""

import re
from itertools import product
from pathlib import Path

import pytest
from configurations import cases, from_yaml, labelled, refusal, resolved
from configurations import study as study_of
from facts import Facts

from gyriflow.settings.runs import PRESETS, Run
from gyriflow.study import paths
from gyriflow.study.paths import STUDY, log_of
from gyriflow.study.resolve import _equality_key

ROOT = Path(__file__).parents[3]
RUNS = {"reference": {"preset": "fetalfoldsim"}, "short": {"end_week": 22}}
BASE = {"base": "reference", "compare_week": 25}
THICKNESS = BASE | {
    "vary": {"thickness_mm": [0.8, 1.5]},
    "fixed": {"shear_modulus_cortex_pa": 3000},
}
CALIBRATION = BASE | {"parameters": {"thickness_mm": [1, 3]}, "score": {"size": 1}}


def study(**sections):
    return study_of(labelled(21, 25), runs=RUNS) | sections


# the runs of sweeps


VALUES = from_yaml("""
step_s: [21600, 86400]
thickness_mm: [1.2, 1.5]
shear_modulus_cortex_pa: [1000, 1500]
shear_modulus_core_pa: [300, 400]
material: [neo-hookean, compressible-neo-hookean]
poisson_ratio: [0.4, 0.45]
growth_rate_per_s: [1.0e-7, 2.0e-7]
core_growth_rate_per_s: [0.0, 1.0e-8]
growth: [rates, {model: sizes, area_cm2: {21: 90, 30: 200}, volume_ml: {21: 40}}]
stress_memory_gw: [0.0, 1.0]
support: [ellipsoid, free]
contact: [planes, none]
output_every_gw: [0.5, 1.0]
newton_tolerance: [1.0e-4, 1.0e-5]
max_halvings: [5, 6]
start: [a, b]
""")
"""Two values of each key that changes the shapes of a run."""
ALIKE = {"end_week", "preset", "fields", "ensemble", "ranks"}
"""Keys that change no shape of a week that both runs have."""


def test_runs_are_equal_only_where_no_key_that_changes_shapes_differs():
    assert VALUES.keys() | ALIKE == Run.model_fields.keys()
    run = RUNS["short"] | PRESETS["fetalfoldsim"]
    for key, values in VALUES.items():
        keys = {_equality_key(Run(**run | {key: value})) for value in values}
        assert len(keys) == 2, key
    alike = {"end_week": 23, "preset": "fetalfoldsim", "fields": [], "ranks": 4}
    assert _equality_key(Run(**run | alike)) == _equality_key(Run(**run))


def test_the_run_of_a_single_value_may_differ_further():
    steps = {"fixed": {"step_s": 86400}, "fixed_at": {0.8: {"step_s": 3600}}}
    found = resolved(labelled(21, 25), runs=RUNS, sweeps={"s": THICKNESS | steps})
    step_of = {}
    for row in found.by_sweep["s"]:
        step_of[row.run] = found.simulations[row.run, row.brain].settings.step_s
    assert step_of == {"s-0.8": 3600, "s-1.5": 86400}


# what is refused


POISSON = THICKNESS | {"vary": {"poisson_ratio": [0.3, 0.4]}}
BOTH = THICKNESS | {"vary": {"thickness_mm": [1, 2], "poisson_ratio": [0.3]}}


@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        (
            {"sweeps": {"s": THICKNESS}, "runs": RUNS | {"S-0.8": {}}},
            ["sweeps.s:", "s-0.8", "S-0.8", "runs"],
        ),
        (
            {"sweeps": {"s": BOTH, "s-1": POISSON}},
            ["sweeps.s-1:", "s-1-0.3", "sweep s", "sweep s-1"],
        ),
        (
            {"calibrate": CALIBRATION, "runs": RUNS | {"Calibration-01": {}}},
            ["runs.Calibration-01:", "calibration-01"],
        ),
    ],
)
def test_runs_of_all_sections_have_folders_of_their_own(changes, facts):
    assert refusal(study(**changes)) == Facts(1, *facts)


def test_folders_of_results_are_no_names_of_sweeps():
    rules = ROOT.glob("workflow/rules/*.smk")
    modules = ROOT.glob("src/gyriflow/study/*.py")
    texts = [path.read_text() for path in (*rules, *modules)]
    texts.append(log_of("rule", f"{STUDY}/metrics.png"))
    folders = set()
    for text in texts:
        folders |= set(re.findall(r'(?:{STUDY}|results/study)/([a-z_]+)[/"]', text))
    assert folders > {"logs", "figures", "calibration", "registration"}
    sweeps = {folder.upper(): THICKNESS for folder in folders}
    assert refusal(study(sweeps=sweeps)) == Facts(len(folders))


# files


@cases(
    ("pattern", "log"),
    """
    brains/{brain}/mesh/targets.{origin}.h5 | brains/{brain}/logs/rule.{origin}.log
    study/{sweep}/members/{run}.csv | study/{sweep}/logs/rule.{run}.log
    study/matched/{earlier}/{later}.h5 | study/logs/rule.{earlier},{later}.log
    "{where}/regions.csv" | "{where}/logs/rule.log"
    """,
)
def test_a_log_is_in_the_folder_of_what_was_made_and_has_all_other_wildcards(
    pattern, log
):
    assert log_of("rule", f"results/{pattern}") == f"results/{log}"


@pytest.mark.parametrize(
    "patterns",
    [
        (paths.COMPARED_MEMBER, paths.MEMBER_COEFFICIENTS),
        (paths.REGISTERED, paths.VARIED_REGISTRATION),
        (log_of("rule", paths.MATCHED),),
    ],
)
def test_ids_with_the_marks_of_file_names_have_files_of_their_own(patterns):
    names = ("a", "a.b", "b", "b.c", "c", "a.coefficients", "b.smoothing-1.seed-2")
    files = []
    for first, second in product(names, names):
        values = {"run": first, "brain": second, "earlier": first, "later": second}
        values |= {"sweep": "s", "smoothing": "1", "seed": "2"}
        files += [pattern.format(**values) for pattern in patterns]
    assert len(set(files)) == len(files)
