"""Brains in a configuration: their sources, files, label schemes and regions, and what
is refused of them."""

import pytest
import yaml
from configurations import LABELLED, brain, cases, keys, problems, study, touched
from facts import Facts

from gyriflow.io.yaml_files import SCHEMES
from gyriflow.study.brains import label_scheme
from gyriflow.study.loading import load

MINE = {"cerebrum": [1, 2], "cortex": [2], "known": {9: "outer CSF"}}
FILES = "a.nii.gz t2w.nii.gz l.gii r.gii u.gii v.gii all.stl white.stl"


def one(**brain):
    return study([{"id": "a", "week": 21} | brain], folding={"end_week": 22})


@pytest.fixture
def folder(tmp_path):
    return touched(tmp_path, *FILES.split())


def test_files_are_found_beside_the_configuration(folder):
    text = """
    - {id: a, week: 21, labels: a.nii.gz, scheme: binary, image: t2w.nii.gz}
    - {id: b, week: 21, hemispheres: {left: l.gii, right: r.gii}, white: [u.gii, v.gii]}
    - {id: c, week: 22, pial: all.stl, white: white.stl}
    - {id: d, week: 22, pial: l.gii, side: left}
    - {id: e, week: 22, labels: a.nii.gz, side: right, scheme: binary}
    - {id: f, week: 22, shape: {}}
    """
    brains = load(study(yaml.safe_load(text)), folder).brains
    found = {}
    for entry in brains:
        white = [f"{part} {file}" for part, file in entry.white_files.items()]
        files = " ".join([*entry.files, *white]).replace(f"{folder}/", "")
        found[entry.id] = (entry.source, entry.sides, files)
    both = ("left", "right")
    assert found == {
        "a": ("labels", both, "a.nii.gz"),
        "b": ("hemispheres", both, "l.gii r.gii left u.gii right v.gii"),
        "c": ("pial", both, "all.stl whole white.stl"),
        "d": ("pial", ("left",), "l.gii"),
        "e": ("labels", ("right",), "a.nii.gz"),
        "f": ("shape", both, ""),
    }


# names of folders: on some disks, those that differ in case, accents or dots are one


@cases(
    ("names", "found"),
    """
    [a, Study, A, a] | [["brains:", 2, a], ["brains:", Study], ["brains:", a, A]]
    [a., a] | [["brains:", a., a]]
    [a.., A] | [["brains:", a.., A]]
    [sub-1, sub-1.] | [["brains:", sub-1, sub-1.]]
    """,
)
def test_each_brain_has_a_folder_on_every_disk(names, found):
    brains = [brain(name, 22) for name in names]
    expected = [Facts(*facts) for facts in found]
    assert problems(study(brains, start="first")) == expected


@cases(
    ("section", "names"),
    """
    runs | [x, x.]
    runs | [é, "e\\u0301"]
    runs | [Straße, STRASSE]
    sweeps | [w8, W8]
    """,
)
def test_runs_and_sweeps_that_are_one_folder_are_refused(section, names):
    sweep = {"base": "reference", "compare_week": 22.5}
    entries = {}
    for end, name in enumerate(names, start=1):
        vary = {"thickness_mm": [end, end + 2]}
        entries[name] = sweep | {"vary": vary} if section == "sweeps" else {}
    first, second = names
    assert problems(study(**{section: entries})) == [
        Facts(f"{section}.{second}:", first)
    ]


def test_one_scan_of_a_subject_is_of_each_week():
    scans = [brain(name, 22, subject="one") for name in "ab"]
    assert problems(study(scans)) == [Facts("brains:", 2, "one", 22)]


# schemes


def test_a_user_s_scheme_is_used_by_its_name(folder):
    raw = one(labels="a.nii.gz", scheme="mine") | {"schemes": {"mine": MINE}}
    scheme = label_scheme(load(raw, folder), "mine")
    assert (scheme.name, scheme.cerebrum, scheme.cortex) == ("mine", (1, 2), (2,))
    assert scheme.known == {9: "outer CSF"}
    assert label_scheme(load(one(**LABELLED)), "crl") == SCHEMES["crl"]


def test_all_mistakes_in_schemes_are_named_at_once():
    schemes = {
        "a": {"cerebrum": [1, 2, 2], "cortex": [3], "left": [1], "right": [1]},
        "b": {"cerebrum": [1], "cortex": [1], "left": [1]},
        "c": {"cerebrum": [0], "left": ["x"], "cortx": []},
        "e": {"cerebrum": []},
    }
    wrong = "a.cerebrum a.cortex a.right b.cortex b.right c.cerebrum[0] c.left[0]"
    expected = [f"schemes.{key}" for key in f"{wrong} c.cortx e.cerebrum".split()]
    assert keys(study(schemes=schemes)) == expected
    assert keys(study(schemes={"feta-7": MINE})) == ["schemes.feta-7"]


# ages and covariates


def test_ages_may_be_written_in_weeks_and_days():
    curve = {"weeks": {"22w2d": 1.5, "30+0": 2.0}}
    folding = {"end_week": "24+3", "thickness_mm": curve}
    config = load(study([brain("a", "22+3")], folding=folding))
    assert (config.brains[0].week, config.folding.end_week) == (22.43, 24.43)
    assert list(config.folding.thickness_mm.weeks) == pytest.approx([22.29, 30])


@pytest.mark.parametrize(
    "name",
    ["run", "brain_of_input", "whole_area_cm2", "left_frontal_gyrification_index"],
)
def test_covariates_named_like_columns_of_results_are_refused_once(name):
    covariates = {"site": "run", name: "x"}
    brains = [brain(text, 21, covariates=covariates) for text in "ab"]
    assert problems(study(brains)) == [
        Facts(f"brains[0].covariates.{name}:", "metrics_wide.csv")
    ]


def test_other_covariates_may_have_names_that_begin_like_those_columns():
    names = ["runs", "weekday", "left_handed", "whole_area", "area_cm2", "region"]
    assert problems(one(**LABELLED, covariates=dict.fromkeys(names, "1"))) == []
