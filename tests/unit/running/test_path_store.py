"""The names of kept paths: another one for everything that a path is made from, the
same for everything else."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from configurations import touched, write_atlas

from gyriflow.code_hash import code_hash
from gyriflow.io.origins import origin_key
from gyriflow.io.registrations import WeeklyShapes, stored_name, write_weekly_shapes
from gyriflow.running import path_store
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.paths import ATLAS_PATH

WEEKS = (21, 22, 23)
FILES = (
    "w{week}.nii.gz",
    "t2-{week}.nii.gz",
    "pial-{week}.surf.gii",
    "white-{week}.surf.gii",
)
LABELS = {
    "files": {"labels": FILES[0], "image": FILES[1]},
    "weeks": [*WEEKS],
    "scheme": "spina-bifida-atlas",
}
SURFACES = {
    "files": {"pial": FILES[2], "white": FILES[3]},
    "weeks": [*WEEKS],
    "scheme": None,
}
START = {"id": "start", "week": 21, "population": "b", "scheme": "spina-bifida-atlas"}
SHAPES = WeeklyShapes(np.array([21.0, 22.0]), np.zeros((2, 4, 3)), made_from="key")
SCHEME = {"cerebrum": [1, 2, 5], "cortex": [5], "white_matter": [1]}


@pytest.fixture
def paths(tmp_path):
    """Return a function: a study and its atlas' path, after changes of the atlas'
    series, the study and its files."""
    touched(
        tmp_path,
        "mine.nii.gz",
        *(name.format(week=week) for week in WEEKS for name in FILES),
    )

    def path(series=LABELS, start=None, atlas=None, **settings):
        write_atlas(tmp_path, series)
        config = {
            "brains": [
                START | {"labels": str(tmp_path / "mine.nii.gz")} | (start or {})
            ],
            "atlas": (
                {"name": str(tmp_path / "atlas.yaml"), "folder": str(tmp_path)}
                | (atlas or {})
            ),
            "start": "start",
            "folding": {"preset": "expected", "end_week": 22},
        }
        study = resolve(load(config | settings, tmp_path))
        return study, study.paths[study.chains["start", "atlas"].path]

    return path


@pytest.fixture
def keys(paths, tmp_path):
    """Return a function: the key of the path of an atlas, after changes; some files are
    changed or missing."""

    def key(*series, changed=None, missing=(), **changes):
        study, path = paths(*series, **changes)
        contents = {
            str(file): file.name
            for file in tmp_path.iterdir()
            if file.name not in missing
        }
        contents |= {str(tmp_path / name): "other" for name in changed or ()}
        return origin_key(path_store.path_origin(study, path), contents)

    return key


def test_a_path_is_kept_next_to_its_atlas_until_its_key_or_its_file_is_another(
    paths, tmp_path
):
    study, path = paths()
    folder = path_store.store_folder(study, path)
    assert folder == tmp_path / "paths"
    store = folder / stored_name(path.brain, "key")
    assert path_store.kept_path(study, path, "key") is None
    folder.mkdir()
    write_weekly_shapes(store, SHAPES)
    assert path_store.kept_path(study, path, "key") == store
    assert path_store.kept_path(study, path, None) is None
    # another path under this name, and a damaged file
    write_weekly_shapes(store, replace(SHAPES, made_from="other"))
    assert path_store.kept_path(study, path, "key") is None
    store.write_bytes(b"torn")
    assert path_store.kept_path(study, path, "key") is None


@pytest.mark.parametrize(
    ("key", "expected"), [("key", True), ("other", False), (None, False)]
)
def test_a_study_has_the_path_that_was_made_from_the_same(
    paths, tmp_path, monkeypatch, key, expected
):
    _, path = paths()
    monkeypatch.chdir(tmp_path)
    file = tmp_path / ATLAS_PATH.format(brain=path.brain)
    assert not path_store.has_path(path, key)
    file.parent.mkdir(parents=True)
    write_weekly_shapes(file, SHAPES)
    assert path_store.has_path(path, key) == expected


def test_a_path_has_another_key_where_anything_differs_that_it_is_made_from(keys):
    own = {"schemes": {"own": SCHEME}}
    labels = [
        keys(),
        # files
        keys(changed=["w22.nii.gz"]),
        keys(atlas={"images": True}),
        keys(atlas={"images": True}, changed=["t2-22.nii.gz"]),
        keys(atlas={"weeks": [21, 22]}),
        # what they mean
        keys(LABELS | {"scheme": "own"}, **own),
        keys(LABELS | {"scheme": "own"}, schemes={"own": SCHEME | {"cortex": [2]}}),
        keys(LABELS | {"scheme": "feta-7"}),
        # settings
        keys(surface={"edge_length_mm": 1.1}),
        keys(surface={"open_sulci": False}),
        keys(surface={"asymmetric": True}),
    ]
    pial_only = SURFACES | {"files": {"pial": FILES[2]}}
    unmatched = {"growth": {"matched_surfaces": False}}
    surfaces = [
        keys(pial_only, **unmatched),
        keys(SURFACES, **unmatched),
        keys(SURFACES, changed=["white-21.surf.gii"], **unmatched),
        # the thickness of the only brain with labels fills the surfaces
        keys(pial_only, changed=["mine.nii.gz"], **unmatched),
        keys(pial_only, start={"affine_from": "qform"}, **unmatched),
    ]
    found = labels + surfaces
    assert None not in found
    assert len(set(found)) == len(found)


def test_a_path_has_the_same_key_where_nothing_differs_that_it_is_made_from(keys):
    equal = [
        keys(),
        keys(),
        # another start brain and another end, as in another study
        keys(changed=["mine.nii.gz"]),
        keys(
            start={"week": 22, "affine_from": "qform"},
            folding={"preset": "expected", "end_week": 23},
        ),
        keys(start={"scheme": "feta-7"}),
        keys(metrics={"spangy_modes": 50}),
    ]
    assert len(set(equal)) == 1


def test_a_path_has_no_key_until_all_files_of_its_brains_are_there(keys):
    assert keys(missing=["w22.nii.gz"]) is None
    # those of other brains need not be there
    assert keys(missing=["mine.nii.gz"]) == keys()


@pytest.mark.parametrize(
    "changed",
    ["rules/registration.smk", "scripts/filled_labels.py", "scripts/register.py"],
)
def test_a_path_has_another_key_after_a_change_of_its_rules_and_scripts(
    keys, changed, tmp_path, monkeypatch
):
    before = keys()
    copy = tmp_path / "copy" / "workflow"
    for name in ("rules", "scripts"):
        shutil.copytree(path_store.SHIPPED / "workflow" / name, copy / name)
    monkeypatch.setattr(path_store, "SHIPPED", tmp_path / "copy")
    assert keys() == before
    (copy / changed).write_text((copy / changed).read_text() + "# changed\n")
    assert keys() != before


def test_a_path_has_another_key_after_a_change_of_the_code_behind_a_script(
    keys, monkeypatch
):
    before = keys()

    def changed(script):
        return "code 2" if script.name == "register.py" else code_hash(script)

    monkeypatch.setattr(path_store, "code_hash", changed)
    assert keys() != before
