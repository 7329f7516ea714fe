"""Sweeps and calibrations in a configuration: the runs that they make, and what is
refused."""

import re
from pathlib import Path

import pytest
from configurations import LABELLED
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.settings.runs import PRESETS, Run
from gyriflow.study import paths, resolve
from gyriflow.study.loading import load
from gyriflow.study.paths import STUDY, log_of
from gyriflow.study.resolve import _equality_key

ROOT = Path(__file__).parents[3]

BRAINS = [{"id": "a", "week": 21, **LABELLED}, {"id": "b", "week": 25, **LABELLED}]
RUNS = {"reference": {"preset": "fetalfoldsim"}, "short": {"end_week": 22}}
THICKNESS = {
    "base": "reference",
    "vary": {"thickness_mm": [0.8, 1.5]},
    "fixed": {"shear_modulus_cortex_pa": 3000},
    "compare_week": 25,
}
STIFFNESS = {
    "base": "reference",
    "vary": {"shear_modulus_cortex_pa": [300, 1500, 3000]},
    "compare_week": 25,
}
CALIBRATION = {
    "base": "reference",
    "parameters": {"thickness_mm": [1, 3]},
    "score": {"size": 1},
    "compare_week": 25,
}


def config(**sections):
    return load(
        {
            "brains": BRAINS,
            "start": "first",
            "folding": {"end_week": 26},
            "runs": RUNS,
            **sections,
        }
    )


def resolved(**sections):
    return resolve(config(**sections))


def members(study, name):
    return [row.run for row in study.by_sweep[name]]


def refusal(**sections):
    with pytest.raises(InputError) as error:
        config(**sections)
    return str(error.value)


def test_a_study_of_a_run_with_two_start_brains_has_its_members_from_both():
    vary = {"thickness_mm": [1, 2]}
    runs = {"reference": {"preset": "fetalfoldsim", "start": ["a", "b"]}}
    study = {"base": "reference", "vary": vary, "compare_week": 26}
    brains = [*BRAINS, {"id": "c", "week": 26, **LABELLED}]
    found = resolved(brains=brains, runs=runs, sweeps={"both": study})
    starts = [(row.run, row.brain) for row in found.by_sweep["both"]]
    assert sorted(starts) == [
        ("both-1", "a"),
        ("both-1", "b"),
        ("both-2", "a"),
        ("both-2", "b"),
    ]


def test_a_study_makes_a_run_of_each_combination():
    vary = {"thickness_mm": [1, 2], "max_halvings": [2, 3]}
    found = resolved(sweeps={"both": THICKNESS | {"vary": vary}})
    runs = {}
    for row in found.by_sweep["both"]:
        runs[row.run] = found.simulations[row.run, row.brain].settings
    assert list(runs) == ["both-1-2", "both-1-3", "both-2-2", "both-2-3"]
    values = [(run.thickness_mm, run.max_halvings) for run in runs.values()]
    assert values == [(1, 2), (1, 3), (2, 2), (2, 3)]
    assert {run.shear_modulus_cortex_pa for run in runs.values()} == {3000}
    assert {run.end_week for run in runs.values()} == {25}
    # they are no runs that everything is made of
    assert found.pairs == [("reference", "a"), ("short", "a")]


def test_equal_runs_are_solved_once():
    found = resolved(
        sweeps={"thickness": THICKNESS | {"compare_week": 25}, "stiffness": STIFFNESS}
    )
    # 1500 Pa is the reference, 3000 Pa stands in the other study too
    assert members(found, "stiffness") == [
        "stiffness-300",
        "reference",
        "thickness-1.5",
    ]
    assert found.may_diverge == ["thickness-0.8", "thickness-1.5", "stiffness-300"]


VALUES = {
    "step_s": [21600, 86400],
    "thickness_mm": [1.2, 1.5],
    "shear_modulus_cortex_pa": [1000, 1500],
    "shear_modulus_core_pa": [300, 400],
    "material": ["neo-hookean", "compressible-neo-hookean"],
    "poisson_ratio": [0.4, 0.45],
    "growth_rate_per_s": [1e-7, 2e-7],
    "core_growth_rate_per_s": [0.0, 1e-8],
    "growth": [
        "rates",
        {
            "model": "sizes",
            "area_cm2": {21: 90, 30: 200},
            "volume_ml": {21: 40, 30: 150},
        },
    ],
    "stress_memory_gw": [0.0, 1.0],
    "support": ["ellipsoid", "free"],
    "contact": ["planes", "none"],
    "output_every_gw": [0.5, 1.0],
    "newton_tolerance": [1e-4, 1e-5],
    "max_halvings": [5, 6],
    "start": ["a", "b"],
}
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


def test_a_shared_run_goes_on_to_the_later_comparison_and_passes_the_earlier():
    brains = [*BRAINS, {"id": "c", "week": 24.5, **LABELLED}]
    sweeps = {"thickness": THICKNESS | {"compare_week": 24.5}, "stiffness": STIFFNESS}
    simulations = resolved(brains=brains, sweeps=sweeps).simulations
    assert simulations["thickness-1.5", "a"].settings.end_week == 25
    assert simulations["thickness-1.5", "a"].weeks == (21, 22, 23, 24, 24.5, 25)
    assert simulations["thickness-0.8", "a"].weeks[-1] == 24.5
    # the reference itself has no surface of that week, so that it cannot stand in
    other = resolved(
        brains=brains, sweeps={"stiffness": STIFFNESS | {"compare_week": 24.5}}
    )
    assert members(other, "stiffness")[1] == "stiffness-1500"


def test_comparison_prefers_the_starts_population(tmp_path):
    brains = []
    for name, week, population in (
        ("a", 21, "one"),
        ("b", 25, "two"),
        ("c", 25, "one"),
    ):
        (tmp_path / f"{name}.stl").touch()
        brains.append(
            {
                "id": name,
                "week": week,
                "pial": str(tmp_path / f"{name}.stl"),
                "population": population,
            }
        )
    for known, asked, real in (
        (brains, {}, "c"),
        (brains[:2], {}, "b"),
        (brains, {"compare_with": ["b"]}, "b"),
    ):
        found = resolved(brains=known, sweeps={"thickness": THICKNESS | asked})
        assert found.by_sweep["thickness"][0].observed == (real,)


def test_the_run_of_a_single_value_may_differ_further():
    study = THICKNESS | {
        "fixed": {"shear_modulus_cortex_pa": 3000, "step_s": 86400},
        "fixed_at": {1.5: {"step_s": 43200}},
    }
    found = resolved(sweeps={"s": study})
    rows = []
    for row in found.by_sweep["s"]:
        settings = found.simulations[row.run, row.brain].settings
        rows.append((row.run, settings.step_s, row.values))
    assert rows == [
        ("s-0.8", 86400, {"thickness_mm": 0.8}),
        ("s-1.5", 43200, {"thickness_mm": 1.5}),
    ]


@pytest.mark.parametrize(
    ("change", "key", "facts"),
    [
        ({"vary": {"thicknes_mm": [1]}}, "vary.thicknes_mm", []),
        ({"vary": {"thickness_mm": [-1]}}, "vary.thickness_mm", [0, -1]),
        ({"vary": {"thickness_mm": [1, 1]}}, "vary.thickness_mm", [[1.0, 1.0]]),
        ({"vary": {"preset": ["measured"]}}, "vary.preset", ["base"]),
        ({"fixed": {"preset": "measured"}}, "fixed.preset", ["base"]),
        ({"vary": {}}, "vary", ["folding"]),
        ({"fixed": {"contact.gap": 2}}, "fixed.contact.gap", []),
        ({"fixed_at": {1.2: {"step_s": 43200}}}, "fixed_at", [1.2]),
        ({"fixed_at": {1.5: {"steps": 1}}}, "fixed_at.steps", []),
        ({"base": "ref"}, "base", ["ref", "reference, short"]),
        ({"compare_week": 24}, "compare_week", [24, 21, 25]),
        ({"compare_with": ["a"]}, "compare_with", ["a", 21, 25]),
    ],
)
def test_what_is_wrong_with_a_study_is_said(change, key, facts):
    assert refusal(sweeps={"s": THICKNESS | change}) == Facts(
        1, f"sweeps.s.{key}:", *facts
    )


def test_values_that_agree_in_six_digits_are_runs_of_their_own():
    study = THICKNESS | {"vary": {"thickness_mm": [1.0, 1.0000001, 1.0000002]}}
    found = resolved(sweeps={"s": study}).by_sweep["s"]
    assert [(row.run, row.values["thickness_mm"]) for row in found] == [
        ("s-1", 1.0),
        ("s-1.0000001", 1.0000001),
        ("s-1.0000002", 1.0000002),
    ]


@pytest.mark.parametrize(
    ("changes", "key", "facts"),
    [
        (
            {"sweeps": {"s": THICKNESS}, "runs": RUNS | {"S-0.8": {}}},
            "sweeps.s",
            ["s-0.8", "S-0.8", "runs"],
        ),
        (
            {
                "sweeps": {
                    "s": (
                        THICKNESS
                        | {"vary": {"thickness_mm": [1, 2], "poisson_ratio": [0.3]}}
                    ),
                    "s-1": THICKNESS | {"vary": {"poisson_ratio": [0.3, 0.4]}},
                }
            },
            "sweeps.s-1",
            ["s-1-0.3", "sweep s", "sweep s-1"],
        ),
        (
            {"calibrate": CALIBRATION, "runs": RUNS | {"Calibration-01": {}}},
            "runs.Calibration-01",
            ["calibration-01"],
        ),
    ],
)
def test_runs_of_all_sections_have_folders_of_their_own(changes, key, facts):
    assert refusal(**changes) == Facts(1, f"{key}:", *facts)


def test_folders_of_results_are_no_names_of_sweeps():
    sources = [
        *ROOT.glob("workflow/rules/*.smk"),
        *ROOT.glob("src/gyriflow/study/*.py"),
    ]
    paths = [
        *(path.read_text() for path in sources),
        log_of("rule", f"{STUDY}/metrics.png"),
    ]
    folders = {
        name
        for text in paths
        for name in re.findall(r'(?:{STUDY}|results/study)/([a-z_]+)[/"]', text)
    }
    assert folders > {"logs", "figures", "calibration", "registration"}
    for folder in folders:
        assert refusal(sweeps={folder: THICKNESS}) == Facts(f"sweeps.{folder}:")
        assert refusal(sweeps={folder.upper(): THICKNESS}) == Facts(
            f"sweeps.{folder.upper()}:"
        )
    assert refusal(sweeps={"s": THICKNESS}, runs=RUNS | {"s-0.8": {}}) == Facts(
        "sweeps.s:", "s-0.8"
    )


@pytest.mark.parametrize(
    ("change", "key", "facts"),
    [
        (
            {"parameters": {"thickness_mm": [3, 1]}},
            "parameters.thickness_mm",
            [[3.0, 1.0]],
        ),
        ({"parameters": {"thickness_mm": [-1, 1]}}, "parameters.thickness_mm", [0, -1]),
        ({"parameters": {"poisson": [0, 0.4]}}, "parameters.poisson", []),
        ({"parameters": {}}, "parameters", [0, 1]),
        ({"rounds": [30, 11]}, "rounds", [[30, 11], 3, 40]),
        ({"score": {}}, "score", ["shape_index", "surface_distance"]),
        (
            {"score": {"beauty": 1}},
            "score.beauty",
            ["beauty", "shape_index", "surface_distance"],
        ),
        ({"compare_week": 24}, "compare_week", [24, 21, 25]),
        ({"base": "ref"}, "base", ["ref", "reference, short"]),
    ],
)
def test_what_is_wrong_with_a_calibration_is_said(change, key, facts):
    assert refusal(calibrate=CALIBRATION | change) == Facts(
        1, f"calibrate.{key}:", *facts
    )


@pytest.mark.parametrize(
    ("pattern", "log"),
    [
        (
            "results/brains/{brain}/mesh/targets.{origin}.h5",
            "results/brains/{brain}/logs/rule.{origin}.log",
        ),
        (
            "results/study/{sweep}/members/{run}.csv",
            "results/study/{sweep}/logs/rule.{run}.log",
        ),
        (
            "results/study/matched/{earlier}/{later}.h5",
            "results/study/logs/rule.{earlier},{later}.log",
        ),
        ("results/{where}/regions.csv", "results/{where}/logs/rule.log"),
    ],
)
def test_a_log_is_in_the_folder_of_what_was_made_and_has_all_other_wildcards(
    pattern, log
):
    assert log_of("rule", pattern) == log


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
    for first in names:
        for second in names:
            values = {
                "sweep": "s",
                "run": first,
                "brain": second,
                "earlier": first,
                "later": second,
            }
            files += [
                pattern.format(**values, smoothing="1", seed="2")
                for pattern in patterns
            ]
    assert len(set(files)) == len(files)
