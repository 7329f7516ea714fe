"""What comes from others: names stay names and lead into no other folder; random damage
is refused with the cause."""

import copy
import os
from contextlib import suppress

import pytest
import yaml
from configurations import LABELLED, labelled, refusal, study, write_atlas
from facts import Facts
from fuzzing import BOUNDED, damaged, outcome
from hypothesis import example, given
from hypothesis import strategies as st

from gyriflow.errors import InputError
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.root import Config
from gyriflow.study import resolve
from gyriflow.study.loading import load

NAMES = [
    "a b",
    "a'b",
    'a"b',
    "a;b",
    "$(touch x)",
    "`x`",
    "a\nb",
    "a\n",
    "a\0b",
    "-rf",
    "--all",
    ".hidden",
    "..",
    "../x",
    "a/b",
    "/etc/passwd",
    "a\\b",
    "a|b",
    "a&b",
    "a*",
    "a?",
    "~root",
    "{brain}",
    "a\u202eb",
    "",
    " ",
    "a" * 5000,
]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_a_shell_or_a_path_could_take_apart_are_refused(name):
    brain = {"id": name, "week": 21, **LABELLED}
    assert refusal(study(brains=[brain], start=name)) == Facts("brains[0].id:")
    assert f"runs.{name}: " in refusal(study(runs={name: {}}))
    vary = {"base": "reference", "compare_week": 22, "vary": {"step_s": [3600, 7200]}}
    later = labelled(21, 22)
    assert f"sweeps.{name}: " in refusal(study(sweeps={name: vary}, brains=later))


@pytest.mark.parametrize("name", [name for name in NAMES if name != "a\n"])
def test_rows_of_a_table_have_such_names_neither(tmp_path, name):
    (tmp_path / "a.gii").touch()
    lines = [["participant_id", "week", "pial"], [name, "24", "a.gii"]]
    table = "\n".join(
        "\t".join(f'"{cell.replace(chr(34), chr(34) * 2)}"' for cell in row)
        for row in lines
    )
    (tmp_path / "participants.tsv").write_text(table + "\n")
    raw = {
        "participants": "participants.tsv",
        "folding": {"end_week": 25},
        "start": "first",
    }
    # other characters than text are refused with the table
    place = "id" if name.isprintable() else "participants.file:"
    assert refusal(raw, tmp_path) == Facts(place)


def test_a_file_between_braces_is_refused_instead_of_another_one(tmp_path):
    for folder in ("a", "{brain}"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "l.nii.gz").touch()
    brain = {"id": "a", "week": 21, "labels": "{brain}/l.nii.gz", "scheme": "binary"}
    assert refusal(study(brains=[brain]), tmp_path) == Facts(
        "brains[0].labels:", tmp_path / brain["labels"]
    )


def with_atlas(folder, **changes):
    write_atlas(folder, **{"url": "https://example.org/atlas"} | changes)
    return {"atlas": "atlas.yaml", "start": "mine-21", "folding": {"end_week": 22}}


@pytest.mark.parametrize(
    "pattern",
    [
        "../../{week}.nii.gz",
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
    ],
)
def test_files_of_an_atlas_stay_in_its_folder(tmp_path, pattern):
    refused = refusal(
        with_atlas(tmp_path, series={"files": {"labels": pattern}}), tmp_path
    )
    assert refused == Facts(f"{tmp_path}/atlas.yaml: series.all.files:", repr(pattern))


def test_an_atlas_with_plain_names_is_fetched_into_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config = load(
        with_atlas(
            tmp_path,
            series={"files": {"labels": "sub folder/$(x) {week:05.2f}.nii.gz"}},
        ),
        tmp_path,
    )
    folder = tmp_path / "resources" / "atlases" / "mine"
    assert [brain.labels for brain in config.brains] == [
        str(folder / "sub folder" / f"$(x) {week}.00.nii.gz") for week in (21, 22)
    ]


@pytest.mark.parametrize(
    ("key", "value"),
    [("name", name) for name in ("../x", "/tmp/x", ".", "a/b", "-x")]
    + [
        ("url", url) for url in ("file:///etc", "ftp://x", "javascript:x", "--output=x")
    ],
)
def test_an_atlas_has_a_plain_name_and_is_on_the_web(tmp_path, key, value):
    assert f"atlas.yaml: {key}: " in refusal(
        with_atlas(tmp_path, **{key: value}), tmp_path
    )


@pytest.mark.parametrize(
    "text",
    [
        "!!python/object/apply:os.system ['touch pwned']",
        "a: !!python/object/new:os.system ['touch pwned']",
        "!!python/name:os.system ''",
        "!!python/module:antigravity ''",
        "a: !custom {b: 1}",
        "a: &x [*x]",
        "a: &x {b: *x}",
        "[" * 5000,
        "a: &a [x, x]\n"
        + "".join(
            f"a{n}: &a{n} [{', '.join([f'*a{n - 1}' if n else '*a'] * 9)}]\n"
            for n in range(12)
        ),
    ],
    ids=[
        "apply",
        "new",
        "name",
        "module",
        "tag",
        "cycle",
        "cycle-of-keys",
        "deep",
        "laughs",
    ],
)
def test_yaml_makes_no_objects_cycles_or_masses(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.yaml").write_text(text)
    with pytest.raises(InputError, check=Facts(tmp_path / "study.yaml")):
        read_yaml(tmp_path / "study.yaml")
    assert os.listdir(tmp_path) == ["study.yaml"]  # noqa: PTH208


STUDY = {
    "brains": [
        {"id": "a", "week": 21, **LABELLED},
        {"id": "b", "week": 22.5, "shape": {"semi_axes_mm": [23, 23, 23]}},
    ],
    "start": "a",
    "surface": {"edge_length_mm": 2.0},
    "mesh": {"order": 2},
    "folding": {
        "end_week": 23,
        "growth_rate_per_s": 2e-7,
        "thickness_mm": {"weeks": {21: 1.5, 23: 2.0}},
    },
    "runs": {"reference": {}, "thick": {"thickness_mm": 3.0}},
    "metrics": {"norm_reference": ["a"]},
    "sweeps": {
        "s": {"base": "thick", "compare_week": 22.5, "vary": {"step_s": [3600, 7200]}}
    },
}
VALUES = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(10**20), 10**20),
        st.floats(),
        st.text(max_size=6),
        st.sampled_from(
            [
                "",
                "a",
                "estimated",
                "auto",
                "ras",
                "../x",
                "nan",
                "1e5",
                "$(touch x)",
                "\n",
                "{week}",
                "-1",
            ]
        ),
        st.sampled_from(sorted(Config.model_fields)),
    ),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=4) | st.integers(), inner, max_size=3)
    ),
    max_leaves=6,
)


def places(value, path=()):
    """Yield the paths of all values in nested dictionaries and lists."""
    yield path
    items = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
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
                holder[
                    draw(
                        st.sampled_from(
                            [*Config.model_fields, "endweek", "folder", "labels", "-x"]
                        )
                    )
                ] = draw(VALUES)
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
        # what is valid serves, but for brains that shapes to grow towards are missing
        # for
        with suppress(InputError):
            assert all(one.weeks for one in resolve(config).run_simulations)
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
        damaged(
            b"participant_id\tgestational_age\tfiles\tscheme\nsub-01\t24.5\ta.nii.gz\tfeta-7\nsub-02\tn/a\tb\tx\n"
        ),
        st.text("\t\n\r\"' ;abid.0159/-$()éü\u2028", max_size=60).map(
            lambda text: f"id\tweek\tpial\n{text}".encode()
        ),
    )
)
def test_damaged_tables_of_participants(tmp_path, content):
    (tmp_path / "participants.tsv").write_bytes(content)
    loaded({"participants": "participants.tsv", "folding": {"end_week": 26}}, tmp_path)
