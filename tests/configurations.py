"""Configurations to change in tests, and the messages with which they are refused."""

import pytest
import yaml
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.study import resolve
from gyriflow.study.loading import load
from gyriflow.study.study import Study

LABELLED = {"labels": __file__, "scheme": "spina-bifida-atlas"}
"""The source of a brain whose file is there, and not read."""


def labelled(*weeks, names="abcdefgh"):
    """Return brains of labels, of some weeks, that are called a, b, ..."""
    return [
        {"id": name, "week": week, **LABELLED}
        for name, week in zip(names, weeks, strict=False)
    ]


def brain(name, week, side=None, **more):
    """Return a brain of labels, or of the surface of one hemisphere."""
    half = {"pial": __file__, "side": side}
    return {"id": name, "week": week, **(half if side else LABELLED), **more}


def study(brains=None, **changes):
    """Return a valid configuration, of two brains if no brains are given, with changes
    on its top level."""
    return {
        "brains": brains or labelled(21, 22.5),
        "start": "a",
        "folding": {"end_week": 24},
    } | changes


def resolved(brains=None, refused=(), **changes):
    """Return the study of such a configuration, without some refused brains."""
    return resolve(load(study(brains, **changes)), dict.fromkeys(refused, "refused"))


def from_yaml(text):
    """Return the content of YAML; libyaml is ten times as fast."""
    return yaml.load(text, yaml.CSafeLoader)


def cases(names, table):
    """Parametrise a test with a table: a case a line, its cells in YAML between |."""
    rows = []
    for line in table.strip().splitlines():
        rows.append([from_yaml(cell) for cell in line.split(" | ")])
    return pytest.mark.parametrize(names, rows)


def ids(brains):
    return [brain.id for brain in brains]


def touched(folder, *names):
    """Make empty files in a folder and below, and return it."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return folder


def both_kinds(folder, weeks):
    """Return a configuration with labels and a closed surface of each of some weeks,
    the labels first."""
    touched(folder, "pial.surf.gii")
    made = [{"id": f"v{week}", "week": week, **LABELLED} for week in weeks]
    given = [
        {"id": f"s{week}", "week": week, "pial": "pial.surf.gii"} for week in weeks
    ]
    return study([*made, *given], start="s21")


def write_atlas(folder, /, series=None, **changes):
    """Write the description of an atlas of two weeks, with changes on its top level or
    in its series."""
    one = {
        "population": "sheep",
        "scheme": "binary",
        "files": {"labels": "w{week}.nii.gz"},
        "weeks": [21, 22],
    }
    licence = {"name": "CC0", "terms": "Do what you like."}
    atlas = {
        "name": "mine",
        "title": "An atlas",
        "licence": licence,
        "series": {"all": one | (series or {})},
    }
    (folder / "atlas.yaml").write_text(yaml.safe_dump(atlas | changes))
    return folder / "atlas.yaml"


def refusal(raw, folder="."):
    """Return the message with which a configuration is refused."""
    with pytest.raises(InputError) as caught:
        load(raw, folder)
    return str(caught.value)


def problems(raw, folder="."):
    """Return the lines of that message, a problem each; none where the configuration is
    valid."""
    try:
        load(raw, folder)
    except InputError as error:
        message = str(error)
    else:
        return []
    first, *lines, _ = message.splitlines()
    lines = [line.strip() for line in lines]
    # of one kind three are listed
    others = [int(line.split()[2]) - 1 for line in lines if line.startswith("… and")]
    assert first == Facts(len(lines) + sum(others))
    return lines


def keys(raw, folder="."):
    """Return the keys of these problems."""
    return [line.partition(": ")[0] for line in problems(raw, folder)]


def series_ids(study: Study) -> dict[str, list[str]]:
    """Return the ids of the brains of each growth series."""
    return {name: list(series.brains) for name, series in study.series.items()}
