"""Which brains growth is measured on, whose surfaces match by their vertices, and which
are individuals."""

import pytest
from configurations import (
    LABELLED,
    both_kinds,
    growth_series,
    labelled,
    problems,
    resolved,
    series_for,
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
RUN = {"start": "a", "folding": {"end_week": 23}}


@pytest.fixture
def folder(tmp_path):
    def write(name, mesh):
        write_surface(tmp_path / name, mesh)
        return name

    write("a.gii", SURFACE)
    # other places, another order of the triangles and of their corners
    write("b.gii", flipped(TriangleMesh(1.1 * SURFACE.vertices, SURFACE.faces[::-1])))
    write("fine.gii", sphere(30.0, 3))
    turned = SURFACE.faces.copy()
    turned[0, 0] = next(
        corner for corner in range(len(SURFACE.vertices)) if corner not in turned[0]
    )
    write("other.gii", TriangleMesh(SURFACE.vertices, turned))
    (tmp_path / "torn.gii").write_text("")
    return tmp_path


def series(folder, *files, **changes):
    brains = [
        {
            "id": name,
            "week": 21 + number,
            **({"pial": file} if isinstance(file, str) else file),
        }
        for number, (name, file) in enumerate(zip("abcdef", files, strict=False))
    ]
    return growth_series(load(RUN | {"brains": brains} | changes, folder))


def test_equal_triangles_in_any_order_are_matched(folder):
    found = series(folder, "a.gii", "b.gii", "a.gii")
    assert found.matched == {"surface": {"a", "b", "c"}}
    assert found.unmatched == {}


@pytest.mark.parametrize(
    ("file", "facts"),
    [
        ("fine.gii", ["b", 642, 1280, "a", 162, 320]),
        ("other.gii", ["b", "a"]),
        ("torn.gii", ["torn.gii:"]),
        (
            {"hemispheres": {"left": "a.gii", "right": "b.gii"}},
            ["b", "hemispheres", "a", "pial"],
        ),
    ],
)
def test_others_are_not_and_say_why(folder, file, facts):
    found = series(folder, "a.gii", file, "b.gii")
    assert found.matched == {}
    assert found.unmatched["surface"] == Facts(*facts)


def test_hemispheres_match_side_by_side(folder):
    pair = {"hemispheres": {"left": "a.gii", "right": "fine.gii"}}
    assert series(folder, pair, pair).matched == {"surface": {"a", "b"}}
    swapped = {"hemispheres": {"left": "fine.gii", "right": "a.gii"}}
    assert series(folder, pair, swapped).unmatched["surface"] == Facts("b", 642, 162)


def test_an_atlas_is_believed_until_its_files_are_there(folder):
    named = {"name": "dhcp-surface", "weeks": [21, 22], "folder": str(folder)}
    config = {"atlas": named, "start": "first", "folding": {"end_week": 22}}
    found = growth_series(load(config, folder))
    assert list(found.matched.values()) == [{"dhcp-surface-21", "dhcp-surface-22"}]
    for week, file in ((21, "a.gii"), (22, "fine.gii")):
        for side in ("left", "right"):
            (folder / f"fetal.week{week}.{side}.pial.surf.gii").write_bytes(
                (folder / file).read_bytes()
            )
    config = {"atlas": named, "start": "first", "folding": {"end_week": 22}}
    found = growth_series(load(config, folder))
    assert found.matched == {}
    assert list(found.unmatched.values()) == [Facts("dhcp-surface-22", 642, 162)]


@pytest.mark.parametrize(
    ("growth", "brains"),
    [
        ({}, ["a", "b", "c"]),
        ({"brains": ["c", "a"]}, ["a", "c"]),
        ({"brains": None}, ["a", "b", "c"]),
    ],
)
def test_growth_is_of_all_brains_or_those_named(growth, brains):
    assert series_ids(resolved(labelled(21, 22, 22), growth=growth)) == {
        "volume": brains
    }


def test_surfaces_and_volumes_are_two_series_and_the_start_says_which_is_followed(
    tmp_path,
):
    raw = both_kinds(tmp_path, (21, 22))
    config = load(raw, tmp_path)
    found = series_ids(resolve(config))
    assert found == {"surface": ["s21", "s22"], "volume": ["v21", "v22"]}
    series = (series_for(config, "s21"), series_for(config, "v21"))
    assert series == ("surface", "volume")
    named = load(raw | {"growth": {"series": "volume"}}, tmp_path)
    assert series_for(named, "s21") == "volume"
    chosen = resolve(load(raw | {"growth": {"brains": ["v22", "v21"]}}, tmp_path))
    assert series_ids(chosen) == {"volume": ["v21", "v22"]}


def test_hemispheres_that_are_alone_share_no_growth_curve_with_brains_of_other_sides(
    tmp_path,
):
    brains = [
        {
            "id": f"{side}{week}",
            "week": week,
            "pial": "lh.surf.gii",
            "side": side,
        }
        for side in ("left", "right")
        for week in (24, 25)
    ]
    brains += [{"id": f"p{week}", "week": week, **LABELLED} for week in (24, 25)]
    config = load(
        study(brains, start="left24", folding={"end_week": 26}),
        touched(tmp_path, "lh.surf.gii"),
    )
    assert series_ids(resolve(config)) == {
        "left hemisphere, surface": ["left24", "left25"],
        "right hemisphere, surface": ["right24", "right25"],
        "volume": ["p24", "p25"],
    }
    assert series_for(config, "left24") == "left hemisphere, surface"


def test_averages_are_no_individuals():
    atlas = {"name": "spina-bifida", "series": "operated", "weeks": [25, 26]}
    brains = [
        {"id": f"s{week}", "week": week, "subject": f"s{week}", **LABELLED}
        for week in (21, 23)
    ]
    brains += [{"id": f"n{week}", "week": week, **LABELLED} for week in (21, 21.4, 23)]
    found = resolve(
        load(
            {
                "brains": brains,
                "atlas": atlas,
                "metrics": {"norm_reference": ["spina-bifida"]},
            }
        )
    )
    assert found.norm_reference == [
        "spina-bifida-operated-25",
        "spina-bifida-operated-26",
    ]
    assert not found.are_individuals(found.norm_reference)
    assert found.are_individuals(["s21", "s23"])
    assert not found.are_individuals(["n21", "n23"])
    assert found.are_individuals(["n21", "n21.4", "n23"])


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ({"subject": "a, b"}, {"subject": "a", "population": "b"}),
        ({"subject": "control"}, {"population": "control"}),
    ],
)
def test_two_series_of_one_name_are_refused(first, second):
    brains = [
        {"id": f"{name}{week}", "week": week, **source, **LABELLED}
        for name, source in (("x", first), ("y", second))
        for week in (21, 22)
    ]
    name = ", ".join(second.values())
    assert problems(study(brains, start="x21")) == [Facts("growth.brains:", 2, name)]


def test_charts_are_coloured_by_a_covariate_that_groups_subjects():
    covariates = [
        {"site": "x", "mother": str(number), "sex": "FM"[number % 2]}
        for number in range(3)
    ]
    brains = [
        {"id": f"b{n}", "week": 21, "covariates": values, **LABELLED}
        for n, values in enumerate(covariates)
    ]
    found = resolve(load({"brains": brains})).brains
    groups = {name: brain.group for name, brain in found.items()}
    # all are of one site, and each has its own mother
    assert groups == {"b0": "sex: F", "b1": "sex: M", "b2": "sex: F"}


MEASURED: dict = {"start": None, "folding": None}
CROSS_SECTION, ONE_SUBJECT = [{}, {}, {}], [{"subject": "s"}] * 3
COHORT = {"growth": {"brains": {"cohort": ["all"]}}}


@pytest.mark.parametrize(
    ("keys", "changes", "names"),
    [
        (CROSS_SECTION, MEASURED, []),
        (CROSS_SECTION, {}, ["volume"]),
        (ONE_SUBJECT, MEASURED, ["volume"]),
        ([{"subject": name} for name in "xyz"], MEASURED | COHORT, []),
        ([{"subject": name} for name in "xyz"], {"runs": {"r": {}}, **COHORT}, []),
        (
            [{"subject": name} for name in "xyz"],
            {"runs": {"r": {"growth": "sizes"}}, **COHORT},
            ["cohort"],
        ),
    ],
)
def test_only_brains_whose_differences_are_growth_have_rates(keys, changes, names):
    brains = [
        {**brain, **key} for brain, key in zip(labelled(21, 22, 23), keys, strict=True)
    ]
    found = resolved(brains, **changes)
    assert len(found.growth_brains) == 3
    with_rates = [series.name for series in found.series.values() if series.has_rates]
    assert with_rates == names


def test_an_atlas_has_rates_without_runs(folder):
    named = {"name": "spina-bifida", "weeks": [21, 22]}
    found = resolve(load(study(labelled(23, 24), atlas=named, **MEASURED), folder))
    with_rates = [series.name for series in found.series.values() if series.has_rates]
    assert with_rates == ["spina bifida aperta, unoperated"]
