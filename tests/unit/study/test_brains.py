"""Brains in a configuration: their sources, files, label schemes and regions, and what
is refused of them."""

import pytest
import yaml
from configurations import LABELLED, cases, keys, problems, study, touched
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
    for brain in brains:
        white = [f"{part} {file}" for part, file in brain.white_files.items()]
        files = " ".join([*brain.files, *white]).replace(f"{folder}/", "")
        found[brain.id] = (brain.source, brain.sides, files)
    both = ("left", "right")
    assert found == {
        "a": ("labels", both, "a.nii.gz"),
        "b": ("hemispheres", both, "l.gii r.gii left u.gii right v.gii"),
        "c": ("pial", both, "all.stl whole white.stl"),
        "d": ("pial", ("left",), "l.gii"),
        "e": ("labels", ("right",), "a.nii.gz"),
        "f": ("shape", both, ""),
    }
    assert brains[-1].shape.kind == "ellipsoid"


@cases(
    ("brain", "key", "facts"),
    """
    {labels: a.nii.gz, scheme: binary, pial: all.stl} | "" | [labels, pial, shape]
    {} | "" | [labels, hemispheres, pial, shape]
    {labels: a.nii.gz} | .scheme | []
    {labels: a.nii.gz, scheme: d} | .scheme | [d, "binary, crl"]
    {image: t2w.nii.gz} | .image | [labels]
    {pial: lost.stl} | .pial | [lost.stl]
    {hemispheres: {left: l.gii}} | .hemispheres.right | []
    {hemispheres: {left: l.gii, right: r.gii}, white: white.stl} | .white | []
    {hemispheres: {left: l.gii, right: r.gii}, side: left} | .side | [labels, pial]
    {labels: a.nii.gz, side: left} | .scheme | []
    {labels: a.nii.gz, scheme: binary, coordinates: ras} | .coordinates | [pial]
    {pial: l.gii, side: left, scheme: binary} | .scheme | [labels]
    {labels: a.nii.gz, side: middle, scheme: binary} | .side | [left, right]
    {shape: {}, coordinates: lps} | .coordinates | [shape, pial]
    {shape: {}, population: sheep} | .population | [shape, pial]
    {shape: {semi_axes_mm: [40, 40, 200]}} | ".shape.semi_axes_mm[2]" | [200, 150]
    {shape: {semi_axes_mm: [10, 21, 12]}} | .shape.semi_axes_mm | [21, 2]
    {week: 50, pial: all.stl} | .week | [50, 45]
    {week: 22+7, pial: all.stl} | .week | [22+7, 24+2]
    {week: 50+1, pial: all.stl} | .week | [50+1, 15, 45]
    """,
)
def test_what_is_wrong_with_a_brain_is_said(folder, brain, key, facts):
    assert problems(one(**brain), folder) == [Facts(f"brains[0]{key}:", *facts)]


# names of folders: on some disks, those that differ in case, accents or dots are one


@cases(
    ("names", "found"),
    """
    [a, Study, A, a] | [["brains:", 2, a], ["brains:", Study], ["brains:", a, A]]
    [a., a] | [["brains:", a., a]]
    [a.., A] | [["brains:", a.., A]]
    [sub-1, sub-1.] | [["brains:", sub-1, sub-1.]]
    [con] | [["brains:", con]]
    [aux.1] | [["brains:", aux.1]]
    [Lpt9] | [["brains:", Lpt9]]
    [xcon, x.nul] | []
    """,
)
def test_each_brain_has_a_folder_on_every_disk(names, found):
    brains = [{"id": name, "week": 22, **LABELLED} for name in names]
    expected = [Facts(*facts) for facts in found]
    assert problems(study(brains=brains, start="first")) == expected


@cases(
    ("section", "first", "second"),
    """
    runs | x | x.
    runs | é | "e\\u0301"
    runs | Straße | STRASSE
    sweeps | w8 | W8
    """,
)
def test_runs_and_sweeps_that_are_one_folder_are_refused(section, first, second):
    entries = [{"end_week": 23}, {"end_week": 24}]
    if section == "sweeps":
        sweep = {"base": "reference", "compare_week": 22.5}
        entries = [sweep | {"vary": {"thickness_mm": [n, n + 1]}} for n in (1, 3)]
    raw = study(**{section: dict(zip((first, second), entries, strict=True))})
    assert problems(raw) == [Facts(f"{section}.{second}:", first)]


def test_names_of_devices_of_windows_are_refused_for_runs():
    assert problems(study(runs={"NUL": {}})) == [Facts("runs.NUL:", "NUL")]


def test_one_scan_of_a_subject_is_of_each_week():
    scans = [{"id": name, "week": 24, "subject": "one", **LABELLED} for name in "ab"]
    assert problems(study(scans, folding={"end_week": 25})) == [
        Facts("brains:", 2, "one", 24)
    ]


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
    wrong = {
        "a": ["cerebrum", "cortex", "right"],
        "b": ["cortex", "right"],
        "c": ["cerebrum[0]", "left[0]", "cortx"],
        "e": ["cerebrum"],
    }
    assert keys(study(schemes=schemes)) == [
        f"schemes.{name}.{key}"
        for name, of_scheme in wrong.items()
        for key in of_scheme
    ]
    assert keys(study(schemes={"feta-7": MINE})) == ["schemes.feta-7"]


# regions


@cases(
    ("side", "metrics", "facts"),
    """
    null | {regions: {a: {}}} | ["regions.a.labels:"]
    null | {regions: {a: {labels: a.nii.gz}}} | ["regions.a.names:"]
    null | {regions: {a: {labels: l.gii}}} | ["regions.a.labels:"]
    null | {regions: {a: {labels: [l.gii, r.gii]}}} | ["regions.a.surface:"]
    null | {regions: {a: {labels: a.nii.gz, surface: l.gii}}} | ["regions.a.surface:"]
    null | {regions: {q: {labels: a.nii.gz, names: {1: x}}}} | ["regions:", q, a]
    left | {regions: {a: {labels: a.nii.gz, names: {1: x}}}} | ["regions:", a]
    null | {norm_reference: [x]} | ["norm_reference:", x, a]
    """,
)
def test_what_is_wrong_with_regions_and_references_is_said(
    folder, side, metrics, facts
):
    (line,) = problems(one(**LABELLED, side=side) | {"metrics": metrics}, folder)
    assert line.removeprefix("metrics.") == Facts(*facts)


# ages and covariates


def test_ages_may_be_written_in_weeks_and_days():
    curve = {"weeks": {"22w2d": 1.5, "30+0": 2.0}}
    folding = {"end_week": "24+3", "thickness_mm": curve}
    config = load(study([{"id": "a", "week": "22+3", **LABELLED}], folding=folding))
    assert (config.brains[0].week, config.folding.end_week) == (22.43, 24.43)
    assert list(config.folding.thickness_mm.weeks) == pytest.approx([22.29, 30])


@pytest.mark.parametrize(
    "name",
    [
        "run",
        "brain_of_input",
        "whole_area_cm2",
        "left_frontal_gyrification_index",
    ],
)
def test_covariates_named_like_columns_of_results_are_refused_once(name):
    brains = [
        {"id": text, "week": 21, "covariates": {"site": "run", name: "x"}, **LABELLED}
        for text in "ab"
    ]
    assert problems(study(brains)) == [
        Facts(f"brains[0].covariates.{name}:", "metrics_wide.csv")
    ]


def test_other_covariates_may_have_names_that_begin_like_those_columns():
    names = ["runs", "weekday", "left_handed", "whole_area", "area_cm2", "region"]
    config = load(one(**LABELLED, covariates=dict.fromkeys(names, "1")))
    assert list(config.brains[0].covariates) == names
