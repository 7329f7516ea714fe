"""Brains in a configuration: their sources, files, label schemes and regions, and what
is refused of them."""

import pytest
from configurations import LABELLED, keys, problems, study, touched
from facts import Facts

from gyriflow.io.yaml_files import SCHEMES
from gyriflow.study.brains import label_scheme
from gyriflow.study.loading import load

MINE = {"cerebrum": [1, 2], "cortex": [2], "known": {9: "outer CSF"}}


def one(**brain):
    return study([{"id": "a", "week": 21} | brain], folding={"end_week": 22})


@pytest.fixture
def folder(tmp_path):
    return touched(
        tmp_path,
        "a.nii.gz",
        "t2w.nii.gz",
        "l.gii",
        "r.gii",
        "lw.gii",
        "rw.gii",
        "all.stl",
        "white.stl",
    )


def test_files_are_found_beside_the_configuration(folder):
    pair = {"left": "l.gii", "right": "r.gii"}
    brains = [
        {
            "id": "a",
            "week": 21,
            "labels": "a.nii.gz",
            "scheme": "binary",
            "image": "t2w.nii.gz",
        },
        {"id": "b", "week": 21, "hemispheres": pair, "white": ["lw.gii", "rw.gii"]},
        {"id": "c", "week": 22, "pial": "all.stl", "white": "white.stl"},
        {"id": "d", "week": 22, "pial": "l.gii", "side": "left"},
        {
            "id": "e",
            "week": 22,
            "labels": "a.nii.gz",
            "side": "right",
            "scheme": "binary",
        },
        {"id": "f", "week": 22, "shape": {}},
    ]
    labels, both, whole, left, right, shape = load(study(brains), folder).brains
    assert labels.files == [labels.labels] == [str(folder / "a.nii.gz")]
    assert both.files == [str(folder / "l.gii"), str(folder / "r.gii")]
    assert both.white_files == {
        "left": str(folder / "lw.gii"),
        "right": str(folder / "rw.gii"),
    }
    assert whole.white_files == {"whole": str(folder / "white.stl")}
    assert (left.sides, left.labels) == (("left",), None)
    assert (right.sides, right.labels) == (("right",), str(folder / "a.nii.gz"))
    assert (shape.source, shape.files, shape.shape.kind) == ("shape", [], "ellipsoid")


HEMISPHERE = {"labels": "a.nii.gz", "side": "left"}
REGIONS = {"a": {"labels": "a.nii.gz", "names": {1: "frontal"}}}


@pytest.mark.parametrize(
    ("brain", "key", "facts"),
    [
        (
            {"labels": "a.nii.gz", "scheme": "binary", "pial": "all.stl"},
            "",
            ["labels", "pial", "shape"],
        ),
        ({}, "", ["labels", "hemispheres", "pial", "shape"]),
        ({"labels": "a.nii.gz"}, ".scheme", []),
        ({"labels": "a.nii.gz", "scheme": "d"}, ".scheme", ["d", "binary, crl"]),
        ({"image": "t2w.nii.gz"}, ".image", ["labels"]),
        ({"pial": "lost.stl"}, ".pial", ["lost.stl"]),
        ({"hemispheres": {"left": "l.gii"}}, ".hemispheres.right", []),
        (
            {"hemispheres": {"left": "l.gii", "right": "r.gii"}, "white": "white.stl"},
            ".white",
            [],
        ),
        (HEMISPHERE, ".scheme", []),
        (
            {"hemispheres": {"left": "l.gii", "right": "r.gii"}, "side": "left"},
            ".side",
            ["hemispheres", "labels", "pial"],
        ),
        (
            HEMISPHERE | {"scheme": "binary", "coordinates": "ras"},
            ".coordinates",
            ["pial"],
        ),
        (
            {"pial": "l.gii", "side": "left", "scheme": "binary"},
            ".scheme",
            ["labels"],
        ),
        (
            HEMISPHERE | {"side": "middle", "scheme": "binary"},
            ".side",
            ["left", "right"],
        ),
        ({"shape": {}, "coordinates": "lps"}, ".coordinates", ["shape", "pial"]),
        ({"shape": {}, "population": "sheep"}, ".population", ["shape", "pial"]),
        (
            {"shape": {"semi_axes_mm": [40, 40, 200]}},
            ".shape.semi_axes_mm[2]",
            [200, 150],
        ),
        ({"shape": {"semi_axes_mm": [10, 21, 12]}}, ".shape.semi_axes_mm", [21, 2]),
        ({"week": 50, "pial": "all.stl"}, ".week", [50, 45]),
    ],
)
def test_what_is_wrong_with_a_brain_is_said(folder, brain, key, facts):

    assert problems(one(**brain), folder) == [Facts(f"brains[0]{key}:", *facts)]


def test_ids_are_unique_and_no_folder_of_the_results():
    brains = [{"id": name, "week": 22, **LABELLED} for name in ("a", "Study", "A", "a")]
    assert problems(study(brains=brains)) == [
        Facts("brains:", 2, "a"),
        Facts("brains:", "Study"),
        Facts("brains:", "a", "A"),
    ]


@pytest.mark.parametrize(
    ("first", "second"), [("a.", "a"), ("a..", "A"), ("sub-1", "sub-1.")]
)
def test_ids_that_are_one_folder_on_some_disks_are_refused(first, second):
    brains = [{"id": name, "week": 22, **LABELLED} for name in (first, second)]
    found = problems(study(brains=brains, start=first))
    assert found == [Facts("brains:", first, second)]


@pytest.mark.parametrize(
    ("first", "second"), [("x", "x."), ("é", "e\u0301"), ("Straße", "STRASSE")]
)
def test_runs_that_are_one_folder_on_some_disks_are_refused(first, second):
    runs = {first: {"end_week": 23}, second: {"end_week": 24}}
    assert problems(study(runs=runs)) == [Facts(f"runs.{second}:", first)]


@pytest.mark.parametrize("name", ["con", "NUL", "aux.1", "Lpt9"])
def test_names_of_devices_of_windows_are_refused(name):
    brains = [{"id": name, "week": 22, **LABELLED}]
    assert problems(study(brains=brains, start=name, runs={name: {}})) == [
        Facts("brains:", name),
        Facts(f"runs.{name}:", name),
    ]
    allowed = [{"id": f"x{name}", "week": 22, **LABELLED}]
    assert problems(study(brains=allowed, start=f"x{name}")) == []


@pytest.mark.parametrize("pair", [("s", "S"), ("w8", "W8")])
def test_studies_that_differ_only_in_case_are_refused(pair):
    sweep = {
        "base": "reference",
        "compare_week": 22.5,
        "vary": {"thickness_mm": [1, 2]},
    }
    first, second = pair
    text = problems(
        study(sweeps={first: sweep, second: sweep | {"vary": {"thickness_mm": [3, 4]}}})
    )
    assert text == [Facts(f"sweeps.{second}:", first)]


def test_one_scan_of_a_subject_is_of_each_week():
    scans = [{"id": name, "week": 24, "subject": "one", **LABELLED} for name in "ab"]
    assert problems(study(scans, folding={"end_week": 25})) == [
        Facts("brains:", 2, "one", 24)
    ]


def test_a_week_that_an_atlas_lacks_is_refused_with_those_present(tmp_path):
    touched(
        tmp_path, "week21_labels.nii.gz", "week22.5_labels.nii.gz", "week21_t2w.nii.gz"
    )
    assert problems(one(labels="week30_labels.nii.gz", scheme="binary"), tmp_path) == [
        Facts(
            "brains[0].labels:",
            tmp_path / "week30_labels.nii.gz",
            "week21_labels.nii.gz, week22.5_labels.nii.gz",
        )
    ]


# schemes


def test_a_user_s_scheme_is_used_by_its_name(folder):
    config = load(
        one(labels="a.nii.gz", scheme="mine") | {"schemes": {"mine": MINE}}, folder
    )
    scheme = label_scheme(config, config.brains[0].scheme)
    assert (scheme.name, scheme.cerebrum, scheme.cortex, scheme.known) == (
        "mine",
        (1, 2),
        (2,),
        {9: "outer CSF"},
    )
    plain = load(one(**LABELLED))
    assert label_scheme(plain, plain.brains[0].scheme) == SCHEMES["spina-bifida-atlas"]


def test_all_mistakes_in_schemes_are_named_at_once():
    schemes = {
        "a": {"cerebrum": [1, 2, 2], "cortex": [3], "left": [1], "right": [1]},
        "b": {"cerebrum": [1], "cortex": [1], "left": [1]},
        "c": {"cerebrum": [0], "left": ["x"], "cortx": []},
        "e": {"cerebrum": []},
    }
    assert keys(study(schemes=schemes)) == [
        "schemes.a.cerebrum",
        "schemes.a.cortex",
        "schemes.a.right",
        "schemes.b.cortex",
        "schemes.b.right",
        "schemes.c.cerebrum[0]",
        "schemes.c.left[0]",
        "schemes.c.cortx",
        "schemes.e.cerebrum",
    ]
    assert keys(study(schemes={"feta-7": MINE})) == ["schemes.feta-7"]


# regions


@pytest.mark.parametrize(
    ("metrics", "facts"),
    [
        ({"regions": {"a": {}}}, Facts("regions.a.labels:")),
        ({"regions": {"a": {"labels": "a.nii.gz"}}}, Facts("regions.a.names:")),
        ({"regions": {"a": {"labels": "l.gii"}}}, Facts("regions.a.labels:")),
        (
            {"regions": {"a": {"labels": ["l.gii", "r.gii"]}}},
            Facts("regions.a.surface:"),
        ),
        (
            {"regions": {"a": REGIONS["a"] | {"surface": ["l.gii", "r.gii"]}}},
            Facts("regions.a.surface:"),
        ),
        ({"regions": {"q": REGIONS["a"]}}, Facts("regions:", "q", "a")),
        ({"norm_reference": ["x"]}, Facts("norm_reference:", "x", "a")),
    ],
)
def test_what_is_wrong_with_regions_and_references_is_said(folder, metrics, facts):
    (line,) = problems(one(**LABELLED) | {"metrics": metrics}, folder)
    assert line.removeprefix("metrics.") == facts


def test_regions_need_both_hemispheres(folder):
    raw = one(**HEMISPHERE, scheme="binary") | {"metrics": {"regions": REGIONS}}
    assert problems(raw, folder) == [Facts("metrics.regions:", "a")]


# ages and covariates


@pytest.mark.parametrize(
    ("text", "week"),
    [
        ("22+3", 22.43),
        ("22 wks 1 day", 22.14),
        ("22 weeks and 6 days", 22.86),
        ("22w2d", 22.29),
        ("22.4", 22.4),
    ],
)
def test_ages_may_be_written_in_weeks_and_days(text, week):
    curve = {"weeks": {text: 1.5, "30+0": 2.0}}
    settings = {
        "brains": [{"id": "a", "week": text, **LABELLED}],
        "folding": {"end_week": "24+3", "thickness_mm": curve},
    }
    config = load(settings | {"start": "a"})
    assert (config.brains[0].week, config.folding.end_week) == (week, 24.43)
    assert list(config.folding.thickness_mm.weeks) == pytest.approx([week, 30])


@pytest.mark.parametrize(
    ("text", "facts"),
    [("22+7", ["24+2"]), ("2+3", ["24+2"]), ("50+1", [15, 45]), ("young", ["24+2"])],
)
def test_what_is_no_age_is_refused(text, facts):
    assert problems(one(**LABELLED, week=text)) == [
        Facts("brains[0].week:", text, *facts)
    ]


@pytest.mark.parametrize(
    "name",
    [
        "run",
        "week",
        "subject",
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
