"""What comes from others: names stay names and lead into no other folder; random damage
is refused with the cause."""

import copy
import os
from contextlib import suppress

import pytest
from configurations import LABELLED, labelled, refusal, study, touched, write_atlas
from facts import Facts
from fuzzing import BOUNDED, damaged
from hypothesis import given
from hypothesis import strategies as st

from gyriflow.errors import InputError
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.root import Config
from gyriflow.study import resolve
from gyriflow.study.loading import load

PRINTABLE = r"""a'b a"b a;b $(x) `x` -rf --all .hidden .. ../x a/b /etc/passwd a\b"""
PRINTABLE += " a|b a&b a* a? ~root {brain}"
NAMES = [*PRINTABLE.split(), "a b", "a\nb", "a\n", "a\0b", "a\u202eb", "", " "]
NAMES.append("a" * 101)


@pytest.mark.parametrize("name", NAMES)
def test_names_that_a_shell_or_a_path_could_take_apart_are_refused(name):
    brain = {"id": name, "week": 21, **LABELLED}
    assert refusal(study(brains=[brain], start=name)) == Facts("brains[0].id:")
    vary = {"base": "reference", "compare_week": 22, "vary": {"step_s": [3600, 7200]}}
    later = labelled(21, 22)
    both = study(runs={"reference": {}, name: {}}, sweeps={name: vary}, brains=later)
    found = refusal(both)
    assert f"runs.{name}: " in found
    assert f"sweeps.{name}: " in found


@pytest.mark.parametrize("name", ["../x", "a\nb", "a" * 101])
def test_rows_of_a_table_have_such_names_neither(tmp_path, name):
    touched(tmp_path, "a.gii")
    table = f'participant_id\tweek\tpial\n"{name}"\t24\ta.gii\n'
    (tmp_path / "participants.tsv").write_text(table)
    raw = {"participants": "participants.tsv", "folding": {"end_week": 25}}
    # other characters than text are refused with the table
    place = "id" if name.isprintable() else "participants.file:"
    assert refusal(raw | {"start": "first"}, tmp_path) == Facts(place)


def test_a_file_between_braces_is_refused_instead_of_another_one(tmp_path):
    touched(tmp_path, "a/l.nii.gz", "{brain}/l.nii.gz")
    brain = {"id": "a", "week": 21, "labels": "{brain}/l.nii.gz", "scheme": "binary"}
    assert refusal(study(brains=[brain]), tmp_path) == Facts(
        "brains[0].labels:", tmp_path / brain["labels"]
    )


# atlases


def with_atlas(folder, **changes):
    write_atlas(folder, **{"url": "https://example.org/atlas"} | changes)
    return {"atlas": "atlas.yaml", "start": "mine-21", "folding": {"end_week": 22}}


PATTERNS = [
    "a/../../{week}.nii.gz",
    "/etc/{week}.nii.gz",
    "a\\..\\{week}.nii.gz",
    # fill characters that make a path of a number
    "{week:/>9}.nii.gz",
    "{week:.>7}/{week:.>5}/x.nii.gz",
    "{week:>999999999}.nii.gz",
    "{week.__class__}.nii.gz",
    "{week!r:/>9}.nii.gz",
    "{week[0]}.nii.gz",
]
URLS = "file:///etc", "ftp://x", "javascript:x", "--out=x"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("series.all.files", pattern) for pattern in PATTERNS),
        *(("name", name) for name in ("../x", "/tmp/x", ".", "a/b", "-x")),
        *(("url", url) for url in URLS),
    ],
)
def test_an_atlas_has_a_plain_name_is_on_the_web_and_stays_in_its_folder(
    tmp_path, key, value
):
    changes = {key: value}
    if key == "series.all.files":
        changes = {"series": {"files": {"labels": value}}}
    found = refusal(with_atlas(tmp_path, **changes), tmp_path)
    assert found == Facts(f"{tmp_path}/atlas.yaml: {key}:", repr(value))


def test_an_atlas_with_plain_names_is_fetched_into_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = {"labels": "sub folder/$(x) {week:05.2f}.nii.gz"}
    config = load(with_atlas(tmp_path, series={"files": files}), tmp_path)
    folder = tmp_path / "resources" / "atlases" / "mine" / "sub folder"
    assert [brain.labels for brain in config.brains] == [
        str(folder / f"$(x) {week}.00.nii.gz") for week in (21, 22)
    ]


# YAML

TENFOLD = "".join(
    f"a{n + 1}: &a{n + 1} [{', '.join([f'*a{n}'] * 9)}]\n" for n in range(12)
)
ODD_YAML = {
    "apply": "!!python/object/apply:os.system ['touch pwned']",
    "new": "a: !!python/object/new:os.system ['touch pwned']",
    "name": "!!python/name:os.system ''",
    "module": "!!python/module:antigravity ''",
    "tag": "a: !custom {b: 1}",
    "cycle": "a: &x [*x]",
    "cycle of keys": "a: &x {b: *x}",
    "deep": "[" * 5000,
    "laughs": f"a0: &a0 [x, x]\n{TENFOLD}",
}


@pytest.mark.parametrize("name", ODD_YAML)
def test_yaml_makes_no_objects_cycles_or_masses(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(ODD_YAML[name])
    with pytest.raises(InputError, check=Facts(tmp_path / "study.yaml")):
        read_yaml(tmp_path / "study.yaml")
    assert os.listdir(tmp_path) == ["study.yaml"]  # noqa: PTH208


# random damage

STUDY = {
    "brains": [
        {"id": "a", "week": 21, **LABELLED},
        {"id": "b", "week": 22.5, "shape": {"semi_axes_mm": [23, 23, 23]}},
    ],
    "start": "a",
    "surface": {"edge_length_mm": 2.0},
    "mesh": {"order": 2},
    "folding": {"end_week": 23, "thickness_mm": {"weeks": {21: 1.5, 23: 2.0}}},
    "runs": {"reference": {}, "thick": {"thickness_mm": 3.0}},
    "metrics": {"norm_reference": ["a"]},
    "sweeps": {
        "s": {"base": "thick", "compare_week": 22.5, "vary": {"step_s": [3600, 7200]}}
    },
}
ODD_TEXTS = ["", "a", "all", "auto", "../x", "nan", "1e5", "$(touch x)", "\n", "-1"]
ODD_TEXTS += ["{week}", *Config.model_fields]
NUMBERS = st.integers(-(10**20), 10**20) | st.floats()
TEXTS = st.sampled_from(ODD_TEXTS) | st.text(max_size=6)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXTS,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(TEXTS | st.integers(), inner, max_size=3)
    ),
    max_leaves=6,
)


def holders(value):
    """Yield all dictionaries and lists in a value that are not empty."""
    if isinstance(value, dict | list) and value:
        yield value
        for item in value.values() if isinstance(value, dict) else value:
            yield from holders(item)


@st.composite
def changed(draw):
    """Draw the study with one to three of its values replaced or dropped."""
    study = copy.deepcopy(STUDY)
    for _ in range(draw(st.integers(1, 3))):
        holder = draw(st.sampled_from(list(holders(study))))
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        key = draw(st.sampled_from(keys))
        if draw(st.integers(0, 3)):
            holder[key] = draw(VALUES)
        else:
            del holder[key]
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
        # what is valid serves, but for brains that shapes to grow towards are missing
        # for
        with suppress(InputError):
            assert all(one.weeks for one in resolve(config).run_simulations)
    assert not list(tmp_path.iterdir())


ROWS = (
    b"participant_id\tgestational_age\tfiles\tscheme\n"
    b"sub-01\t24.5\ta.nii.gz\tfeta-7\nsub-02\tn/a\tb\tx\n"
)
CELLS = st.text("\t\n\r\"' ;abid.0159/-$()éü\u2028", max_size=60)


@BOUNDED
@given(content=damaged(ROWS) | CELLS.map(lambda text: f"id\tweek\n{text}".encode()))
def test_damaged_tables_of_participants(tmp_path, content):
    (tmp_path / "participants.tsv").write_bytes(content)
    loaded({"participants": "participants.tsv", "folding": {"end_week": 26}}, tmp_path)
