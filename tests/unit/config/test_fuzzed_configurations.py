"""Configurations with random damage: they are valid, or all that is wrong is said; nothing else is raised."""

import copy
from contextlib import suppress

import pytest
import yaml
from configurations import LABELLED
from fuzzing import BOUNDED, damaged, outcome
from hypothesis import example, given
from hypothesis import strategies as st

from gyriflow.config.loading import load
from gyriflow.config.root import Config
from gyriflow.errors import InputError
from gyriflow.io.yaml_files import read_yaml
from gyriflow.study import resolve

pytestmark = pytest.mark.fault(28, 62)

STUDY = {
    "brains": [{"id": "a", "week": 21, **LABELLED}, {"id": "b", "week": 22.5, "shape": {"semi_axes_mm": [23, 23, 23]}}],
    "start": "a",
    "surface": {"edge_length_mm": 2.0},
    "mesh": {"order": 2},
    "folding": {"end_week": 23, "growth_rate_per_s": 2e-7, "thickness_mm": {"weeks": {21: 1.5, 23: 2.0}}},
    "runs": {"reference": {}, "thick": {"thickness_mm": 3.0}},
    "metrics": {"norm_reference": ["a"]},
    "studies": {"s": {"base": "thick", "compare_week": 22.5, "vary": {"step_s": [3600, 7200]}}},
}
VALUES = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(10**20), 10**20),
        st.floats(),
        st.text(max_size=6),
        st.sampled_from(
            ["", "a", "estimated", "auto", "ras", "../x", "nan", "1e5", "$(touch x)", "\n", "{week}", "-1"]
        ),
        st.sampled_from(sorted(Config.model_fields)),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4) | st.integers(), inner, max_size=3),
    max_leaves=6,
)


def places(value, path=()):
    """Yield the paths of all values in nested dictionaries and lists."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


PLACES = [path for path in places(STUDY) if path]


@st.composite
def changed(draw):
    """Draw the study with one to three of its values replaced, dropped or added to."""
    study = copy.deepcopy(STUDY)
    for path in draw(st.lists(st.sampled_from(PLACES), min_size=1, max_size=3)):
        holder = study
        try:
            for key in path[:-1]:
                holder = holder[key]
            kind = draw(st.sampled_from(["replace", "replace", "drop", "add"]))
            if kind == "drop":
                del holder[path[-1]]
            elif kind == "add" and isinstance(holder, dict):
                holder[draw(st.sampled_from([*Config.model_fields, "endweek", "folder", "labels", "-x"]))] = draw(
                    VALUES
                )
            else:
                holder[path[-1]] = draw(VALUES)
        except (LookupError, TypeError):
            pass  # an earlier change has taken the place away
    return study


def loaded(raw, folder):
    with suppress(InputError):
        return load(raw, folder)
    return None


def test_the_study_is_valid_as_it_is(tmp_path):
    assert loaded(STUDY, tmp_path) is not None


@BOUNDED
@given(raw=changed())
def test_changed_values(tmp_path, raw):
    config = loaded(raw, tmp_path)
    if config is not None:
        # what is valid serves, but for brains that shapes to grow towards are missing for
        with suppress(InputError):
            assert all(one.weeks for one in resolve(config).folded)
    assert not list(tmp_path.iterdir())


@BOUNDED
@given(content=damaged(yaml.safe_dump(STUDY).encode()))
@example(content=b"a: &x [*x]\n")
@example(content=b"- brains\n")
@example(content=b"")
def test_damaged_text(tmp_path, content):
    path = tmp_path / "study.yaml"
    path.write_bytes(content)
    raw = outcome(read_yaml, path)
    if isinstance(raw, dict):
        loaded(raw, tmp_path)


@BOUNDED
@given(
    content=st.one_of(
        damaged(b"participant_id\tgestational_age\tfiles\tscheme\nsub-01\t24.5\ta.nii.gz\tfeta-7\nsub-02\tn/a\tb\tx\n"),
        st.text("\t\n\r\"' ;abid.0159/-$()éü\u2028", max_size=60).map(lambda text: f"id\tweek\tpial\n{text}".encode()),
    )
)
def test_damaged_tables_of_participants(tmp_path, content):
    (tmp_path / "participants.tsv").write_bytes(content)
    loaded({"participants": "participants.tsv", "folding": {"end_week": 26}}, tmp_path)
