"""Label schemes of one's own, images and their segmentation in the configuration."""

import configurations
import pytest
from configurations import LABELLED, problems, touched

from gyriflow.config import load
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.parameters.schemes import LabelScheme

MINE = {"cerebrum": [1, 2], "cortex": [2], "known": {9: "outer CSF"}}


def study(brain, **changes):
    return configurations.study([{"id": "a", "week": 21} | brain], folding={"end_week": 22}) | changes


@pytest.fixture
def folder(tmp_path):
    return touched(tmp_path, "labels.nii.gz", "t2w.nii.gz")


def test_a_scheme_of_ones_own_is_used_by_its_name(folder):
    config = load(study({"labels": "labels.nii.gz", "scheme": "mine"}, schemes={"mine": MINE}), folder)
    assert config.scheme(config.brains[0]) == {
        "name": "mine",
        "cerebrum": (1, 2),
        "cortex": (2,),
        "left": (),
        "right": (),
        "white_matter": (),
        "ventricles": (),
        "cerebellum": (),
        "brainstem": (),
        "known": {9: "outer CSF"},
    }
    plain = load(study(LABELLED))
    assert LabelScheme(**plain.scheme(plain.brains[0])) == SCHEMES["spina-bifida-atlas"]


def test_all_mistakes_in_schemes_are_named_at_once(folder):
    schemes = {
        "feta-7": MINE,
        "a": {"cerebrum": [1, 2, 2], "cortex": [3], "left": [1], "right": [1]},
        "b": {"cerebrum": [1], "cortex": [1], "left": [1]},
        "c": {"cerebrum": [0], "left": ["x"], "cortx": []},
        "e": {"cerebrum": []},
    }
    assert problems(study({"labels": "labels.nii.gz", "scheme": "d"}, schemes=schemes), folder) == [
        "schemes.a.cerebrum: found 2 more than once",
        "schemes.a.cortex: found 3; it should have labels of the cerebrum only",
        "schemes.a.right: found 1, which are in left too",
        "schemes.b.cortex: found all of the cerebrum; the tissue inside the cortex is missing",
        "schemes.b.right: is missing; the hemispheres are separated by both left and right",
        "schemes.c.cerebrum[0]: Input should be greater than or equal to 1; found 0",
        "schemes.c.left[0]: Input should be a valid integer, unable to parse string as an integer; found 'x'",
        "schemes.c.cortx: unknown key; did you mean cortex?",
        "schemes.e.cerebrum: found no labels; it should have one or more",
    ]
    right = {"feta-7": MINE, "a": MINE}
    assert problems(study({"labels": "labels.nii.gz", "scheme": "d"}, schemes=right), folder) == [
        "schemes.feta-7: the name is taken; choose another",
        "brains[0].scheme: found 'd'; expected one of binary, crl, dhcp-19, drawem-9, feta-7, freesurfer, "
        "multi-bounti-43, spina-bifida-atlas, a, or a name of schemes",
    ]


def test_an_image_alone_is_refused_since_gyriflow_does_not_segment(folder):
    (line,) = problems(study({"image": "t2w.nii.gz"}), folder)
    assert line.startswith("brains[0].image: gyriflow does not segment images; give a label volume under labels")


def test_an_image_with_labels_is_a_brain(folder):
    shown = load(study({"image": "t2w.nii.gz", "scheme": "feta-7", "labels": "labels.nii.gz"}), folder).brains[0]
    assert (shown.source, shown.files) == ("labels", [str(folder / "labels.nii.gz")])


@pytest.mark.fault(15)
def test_a_week_that_an_atlas_lacks_is_refused_with_those_present(tmp_path):
    touched(tmp_path, "week21_labels.nii.gz", "week22.5_labels.nii.gz", "week21_t2w.nii.gz")
    (line,) = problems(study({"labels": "week30_labels.nii.gz", "scheme": "binary"}), tmp_path)
    assert line == (
        f"brains[0].labels: no such file: {tmp_path / 'week30_labels.nii.gz'}; "
        "there are week21_labels.nii.gz, week22.5_labels.nii.gz"
    )
