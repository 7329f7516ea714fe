"""Brains in a configuration: their sources, files, label schemes and regions, and what is refused of them."""

import pytest
from configurations import LABELLED, keys, problems, study, touched

from gyriflow.io.yaml_files import SCHEMES
from gyriflow.study.loading import load
from gyriflow.study.resolve import label_scheme

MINE = {"cerebrum": [1, 2], "cortex": [2], "known": {9: "outer CSF"}}


def one(**brain):
    return study([{"id": "a", "week": 21} | brain], folding={"end_week": 22})


@pytest.fixture
def folder(tmp_path):
    return touched(tmp_path, "a.nii.gz", "t2w.nii.gz", "l.gii", "r.gii", "lw.gii", "rw.gii", "all.stl", "white.stl")


def test_files_are_found_beside_the_configuration(folder):
    pair = {"left": "l.gii", "right": "r.gii"}
    brains = [
        {"id": "a", "week": 21, "labels": "a.nii.gz", "scheme": "binary", "image": "t2w.nii.gz"},
        {"id": "b", "week": 21, "hemispheres": pair, "white": ["lw.gii", "rw.gii"]},
        {"id": "c", "week": 22, "pial": "all.stl", "white": "white.stl"},
        {"id": "d", "week": 22, "hemisphere": {"file": "l.gii", "side": "left"}},
        {"id": "e", "week": 22, "hemisphere": {"file": "a.nii.gz", "side": "right"}, "scheme": "binary"},
        {"id": "f", "week": 22, "shape": {}},
    ]
    labels, both, whole, left, right, shape = load(study(brains), folder).brains
    assert labels.files == [labels.label_volume] == [str(folder / "a.nii.gz")]
    assert both.files == [str(folder / "l.gii"), str(folder / "r.gii")]
    assert both.white_files == {"left": str(folder / "lw.gii"), "right": str(folder / "rw.gii")}
    assert whole.white_files == {"whole": str(folder / "white.stl")}
    assert (left.sides, left.has_vertices, left.label_volume) == (("left",), True, None)
    assert (right.sides, right.has_vertices, right.label_volume) == (("right",), False, str(folder / "a.nii.gz"))
    assert (shape.source, shape.files, shape.shape.kind) == ("shape", [], "ellipsoid")


HEMISPHERE = {"file": "a.nii.gz", "side": "left"}
REGIONS = {"a": {"volume": "a.nii.gz", "names": {1: "frontal"}}}


@pytest.mark.parametrize(
    ("brain", "wrong"),
    [
        ({"labels": "a.nii.gz", "scheme": "binary", "pial": "all.stl"}, "brains[0]: found labels and pial"),
        ({}, "brains[0]: found none as its source"),
        ({"labels": "a.nii.gz"}, "brains[0].scheme: is missing"),
        ({"labels": "a.nii.gz", "scheme": "d"}, "brains[0].scheme: found 'd'; expected one of binary, crl,"),
        ({"image": "t2w.nii.gz"}, "brains[0].image: gyriflow does not segment images"),
        ({"pial": "lost.stl"}, "brains[0].pial: no such file: {folder}/lost.stl"),
        ({"hemispheres": {"left": "l.gii"}}, "brains[0].hemispheres.right: Field required"),
        ({"hemispheres": {"left": "l.gii", "right": "r.gii"}, "white": "white.stl"}, "brains[0].white: should have as"),
        ({"hemisphere": HEMISPHERE}, "brains[0].scheme: is missing"),
        ({"hemisphere": HEMISPHERE, "scheme": "binary", "coordinates": "ras"}, "brains[0].coordinates: has no meaning"),
        ({"hemisphere": HEMISPHERE | {"file": "l.gii"}, "scheme": "binary"}, "brains[0].scheme: has no meaning"),
        ({"hemisphere": HEMISPHERE | {"side": "middle"}, "scheme": "binary"}, "brains[0].hemisphere.side: Input"),
        ({"shape": {}, "coordinates": "lps"}, "brains[0].coordinates: has no meaning with shape"),
        ({"shape": {}, "population": "sheep"}, "brains[0].population: has no meaning with shape"),
        ({"shape": {"semi_axes_mm": [40, 40, 200]}}, "brains[0].shape.semi_axes_mm[2]: Input should be less than"),
        ({"shape": {"semi_axes_mm": [10, 21, 12]}}, "brains[0].shape.semi_axes_mm: found 21 as the longest"),
        ({"shape": {"noise_mm": 0.45}}, "brains[0].shape.noise_mm: found 0.45; expected at most 0.42"),
        ({"week": 50, "pial": "all.stl"}, "brains[0].week: Input should be less than or equal to 45; found 50"),
    ],
)
def test_what_is_wrong_with_a_brain_is_said(folder, brain, wrong):
    (line,) = problems(one(**brain), folder)
    assert line.startswith(wrong.format(folder=folder))


@pytest.mark.fault(31)
def test_ids_are_unique_and_no_folder_of_the_results():
    brains = [{"id": name, "week": 22, **LABELLED} for name in ("a", "study", "A", "a")]
    assert problems(study(brains=brains)) == [
        "brains: 2 brains have the id a; ids are unique",
        "brains: the id study is reserved; choose another",
        "brains: the ids a and A are the same folder on some disks; rename one",
    ]


def test_one_scan_of_a_subject_is_of_each_week():
    scans = [{"id": name, "week": 24, "subject": "one", **LABELLED} for name in "ab"]
    assert problems(study(scans, folding={"end_week": 25})) == [
        "brains: 2 scans of the subject one are of week 24; expected one"
    ]


@pytest.mark.fault(15)
def test_a_week_that_an_atlas_lacks_is_refused_with_those_present(tmp_path):
    touched(tmp_path, "week21_labels.nii.gz", "week22.5_labels.nii.gz", "week21_t2w.nii.gz")
    (line,) = problems(one(labels="week30_labels.nii.gz", scheme="binary"), tmp_path)
    assert line.endswith("week30_labels.nii.gz; there are week21_labels.nii.gz, week22.5_labels.nii.gz")


# schemes


def test_a_scheme_of_ones_own_is_used_by_its_name(folder):
    config = load(one(labels="a.nii.gz", scheme="mine") | {"schemes": {"mine": MINE}}, folder)
    scheme = label_scheme(config, config.brains[0])
    assert (scheme.name, scheme.cerebrum, scheme.cortex, scheme.known) == ("mine", (1, 2), (2,), {9: "outer CSF"})
    plain = load(one(**LABELLED))
    assert label_scheme(plain, plain.brains[0]) == SCHEMES["spina-bifida-atlas"]


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
    assert problems(study(schemes={"feta-7": MINE})) == ["schemes.feta-7: the name is taken; choose another"]


# regions


@pytest.mark.parametrize(
    ("metrics", "wrong"),
    [
        ({"regions": {"a": {}}}, "metrics.regions.a: found neither; expected volume, or left and right"),
        ({"regions": {"a": {"volume": "a.nii.gz"}}}, "metrics.regions.a.names: is missing"),
        ({"regions": {"a": {"left": {"labels": "l.gii", "surface": "l.gii"}}}}, "metrics.regions.a.right: is missing"),
        ({"regions": {"q": REGIONS["a"]}}, "metrics.regions: found 'q', which is no brain; known are a"),
        ({"norm_reference": ["x"]}, "metrics.norm_reference: found 'x', which is no brain"),
    ],
)
def test_what_is_wrong_with_regions_and_references_is_said(folder, metrics, wrong):
    (line,) = problems(one(**LABELLED) | {"metrics": metrics}, folder)
    assert line.startswith(wrong)


def test_regions_need_both_hemispheres(folder):
    raw = one(hemisphere=HEMISPHERE, scheme="binary") | {"metrics": {"regions": REGIONS}}
    assert problems(raw, folder) == ["metrics.regions: found a, of one hemisphere; regions need both"]
