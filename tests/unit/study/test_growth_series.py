"""Which brains growth is measured on, whose surfaces match by their vertices, and which
are individuals."""

import pytest
from configurations import (
    LABELLED,
    brain,
    cases,
    labelled,
    problems,
    resolved,
    series_ids,
    study,
    touched,
)
from facts import Facts
from shapes import sphere

from gyriflow.geometry.triangles import TriangleMesh, flipped
from gyriflow.io.surfaces import write_surface
from gyriflow.study import resolve
from gyriflow.study.loading import load

SURFACE = sphere(30.0, 2)

# surfaces with the same vertices


@pytest.fixture
def folder(tmp_path):
    # other places, another order of the triangles and of their corners
    alike = flipped(TriangleMesh(1.1 * SURFACE.vertices, SURFACE.faces[::-1]))
    turned = SURFACE.faces.copy()
    turned[0, 0] = len(SURFACE.vertices) - 1
    meshes = {
        "a": SURFACE,
        "b": alike,
        "fine": sphere(30.0, 3),
        "other": TriangleMesh(SURFACE.vertices, turned),
    }
    for name, mesh in meshes.items():
        write_surface(tmp_path / f"{name}.gii", mesh)
    (tmp_path / "torn.gii").write_text("")
    return tmp_path


def surface(files):
    """Return the source of a brain: one file, or hemispheres with + between them."""
    left, *right = [f"{name}.gii" for name in files.split("+")]
    return (
        {"hemispheres": {"left": left, "right": right[0]}} if right else {"pial": left}
    )


@cases(
    ("files", "facts"),
    """
    a b a | null
    a+fine b+fine | null
    a fine b | [b, 642, 1280, a, 162, 320]
    a other b | [b, a]
    a torn b | ["torn.gii:"]
    a a+b b | [b, hemispheres, a, pial]
    a+fine fine+a | [b, 642, 162]
    """,
)
def test_surfaces_match_by_equal_triangles_or_it_is_said_why_not(folder, files, facts):
    brains = [
        {"id": name, "week": 21 + number, **surface(text)}
        for number, (name, text) in enumerate(zip("abc", files.split(), strict=False))
    ]
    (series,) = resolve(load(study(brains), folder)).series.values()
    assert series.unmatched == (facts and Facts(*facts))


def test_an_atlas_is_believed_until_its_files_are_there(folder):
    named = {"name": "dhcp-surface", "weeks": [21, 22], "folder": str(folder)}
    config = {"atlas": named, "start": "first", "folding": {"end_week": 22}}
    (series,) = resolve(load(config, folder)).series.values()
    assert series.unmatched is None
    for week, file in ((21, "a.gii"), (22, "fine.gii")):
        for side in ("left", "right"):
            path = folder / f"fetal.week{week}.{side}.pial.surf.gii"
            path.write_bytes((folder / file).read_bytes())
    (series,) = resolve(load(config, folder)).series.values()
    assert series.unmatched == Facts("dhcp-surface-22", 642, 162)


# series of a study

SOURCES = {
    "v": LABELLED,
    "s": {"pial": "pial.surf.gii"},
    "l": {"pial": "pial.surf.gii", "side": "left"},
    "r": {"pial": "pial.surf.gii", "side": "right"},
}


def sources(names):
    """Return brains whose names are their source and week."""
    return [
        {"id": name, "week": int(name[1:3]), **SOURCES[name[0]]}
        for name in names.split()
    ]


@cases(
    ("names", "growth", "series"),
    """
    v21 v22 v22b | {} | {volume: [v21, v22, v22b]}
    v21 v22 v22b | {brains: null} | {volume: [v21, v22, v22b]}
    v21 v22 v22b | {brains: [v22b, v21]} | {volume: [v21, v22b]}
    v21 v22 s21 s22 | {} | {surface: [s21, s22], volume: [v21, v22]}
    v21 v22 s21 s22 | {brains: [v22, v21]} | {volume: [v21, v22]}
    v21 v22 l21 l22 | {} | {volume: [v21, v22], "left hemisphere, surface": [l21, l22]}
    r21 r22 | {} | {surface: [r21, r22]}
    """,
)
def test_a_series_is_of_brains_of_one_kind_or_of_those_named(
    tmp_path, names, growth, series
):
    raw = study(sources(names), start="first", growth=growth)
    found = resolve(load(raw, touched(tmp_path, "pial.surf.gii")))
    assert series_ids(found) == series


@cases(
    ("start", "growth", "series"),
    """
    s21 | {} | surface
    v21 | {} | volume
    l21 | {} | left hemisphere, surface
    s21 | {series: volume} | volume
    """,
)
def test_a_run_follows_the_series_of_its_start_or_the_one_named(
    tmp_path, start, growth, series
):
    raw = study(sources("s21 s22 v21 v22 l21 l22"), start=start, growth=growth)
    found = resolve(load(raw, touched(tmp_path, "pial.surf.gii")))
    assert found.run_simulations[0].series == series


@cases(
    ("first", "second"),
    """
    {subject: "a, b"} | {subject: a, population: b}
    {subject: control} | {population: control}
    """,
)
def test_two_series_of_one_name_are_refused(first, second):
    brains = [
        brain(f"{name}{week}", week, **source)
        for name, source in (("x", first), ("y", second))
        for week in (21, 22)
    ]
    name = ", ".join(second.values())
    assert problems(study(brains, start="x21")) == [Facts("growth.brains:", 2, name)]


# differences between weeks that are growth


def test_averages_are_no_individuals():
    brains = [brain(f"s{week}", week, subject=f"s{week}") for week in (21, 23)]
    brains += [brain(f"n{week}", week) for week in (21, 21.4, 23)]
    atlas = {"name": "spina-bifida", "series": "operated", "weeks": [25, 26]}
    reference = {"norm_reference": ["spina-bifida"]}
    found = resolve(load({"brains": brains, "atlas": atlas, "metrics": reference}))
    averages = [f"spina-bifida-operated-{week}" for week in (25, 26)]
    assert found.norm_reference == averages
    assert not found.are_individuals(averages)
    assert found.are_individuals(["s21", "s23"])
    assert not found.are_individuals(["n21", "n23"])
    assert found.are_individuals(["n21", "n21.4", "n23"])


@cases(
    ("subjects", "changes", "names"),
    """
    null | {start: null, folding: null} | []
    null | {} | [volume]
    sss | {start: null, folding: null} | [volume]
    xyz | {start: null, folding: null, growth: {brains: {cohort: [all]}}} | []
    xyz | {runs: {r: {}}, growth: {brains: {cohort: [all]}}} | []
    xyz | {runs: {r: {growth: sizes}}, growth: {brains: {cohort: [all]}}} | [cohort]
    """,
)
def test_only_brains_whose_differences_are_growth_have_rates(subjects, changes, names):
    brains = labelled(21, 22, 23)
    for entry, subject in zip(brains, subjects or (), strict=False):
        entry["subject"] = subject
    found = resolved(brains, **changes)
    assert len(found.growth_brains) == 3
    assert [
        series.name for series in found.series.values() if series.has_rates
    ] == names


def test_an_atlas_has_rates_without_runs():
    named = {"name": "spina-bifida", "weeks": [21, 22]}
    found = resolved(labelled(23, 24), atlas=named, start=None, folding=None)
    with_rates = [series.name for series in found.series.values() if series.has_rates]
    assert with_rates == ["spina bifida aperta, unoperated"]
