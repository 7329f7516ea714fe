"""Atlases: what an atlas.yaml may say, the brains that a section stands for, and what
is said of files and weeks."""

from pathlib import Path

import pytest
from configurations import (
    LABELLED,
    problems,
    series_ids,
    touched,
    write_atlas,
)
from facts import Facts

from gyriflow.errors import InputError
from gyriflow.io.downloads import require_checksums, sha256_of
from gyriflow.io.yaml_files import read_yaml
from gyriflow.settings.atlas import Atlas
from gyriflow.shipped import ATLASES, shipped_atlases
from gyriflow.study import resolve
from gyriflow.study.atlases import known_checksums, retrieval_note, used_atlases
from gyriflow.study.loading import load
from gyriflow.study.records import observed_name

UNOPERATED = "spina bifida aperta, unoperated"
OPERATED = "spina bifida aperta, operated"
SURFACES = "atlas/fetal.week{}.{}.pial.surf.gii"


def surfaces(*weeks, inside=""):
    return [
        inside + SURFACES.format(week, side)
        for week in weeks
        for side in ("left", "right")
    ]


def study(atlas, start, **changes):
    return {"atlas": atlas, "start": start, "folding": {"end_week": 26}} | changes


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


# what comes with gyriflow


@pytest.mark.parametrize("name", shipped_atlases())
def test_shipped_atlases_are_valid_and_named_after_their_folder(name):
    atlas = Atlas(**read_yaml(ATLASES / name / "atlas.yaml"))
    assert atlas.name == name
    assert atlas.reference is not None
    assert atlas.url.startswith("https://")


def test_labels_of_spina_bifida_lie_in_the_checkout_as_published(tmp_path):
    config = load(study("spina-bifida", "spina-bifida-unoperated-21"), tmp_path)
    weeks = {"unoperated": range(21, 26), "operated": range(25, 35)}
    assert [brain.id for brain in config.brains] == [
        f"spina-bifida-{series}-{week}" for series, of in weeks.items() for week in of
    ]
    (used,) = used_atlases(config)
    assert used.missing == []
    assert all(sha256_of(file.path) == file.sha256 for file in used.files)
    assert all(
        brain.image is None and Path(brain.labels).is_relative_to(ATLASES)
        for brain in config.brains
    )
    assert (ATLASES / "spina-bifida" / "LICENSE.txt").is_file()


# the brains and their populations


def test_populations_are_named_and_never_share_a_curve(tmp_path):
    found = resolve(load(study("spina-bifida", "spina-bifida-unoperated-21"), tmp_path))
    unoperated = [f"spina-bifida-unoperated-{week}" for week in range(21, 26)]
    operated = [f"spina-bifida-operated-{week}" for week in range(25, 35)]
    assert observed_name(found.brains[brain] for brain in unoperated) == UNOPERATED
    assert observed_name([found.brains[operated[0]]]) == OPERATED
    both = observed_name(found.brains[brain] for brain in [*unoperated, operated[0]])
    assert both == Facts(f"{UNOPERATED} (21-25 GW)", f"{OPERATED} (25 GW)")
    assert series_ids(found) == {UNOPERATED: unoperated, OPERATED: operated}
    (simulation,) = found.run_simulations
    assert simulation.series == UNOPERATED
    assert found.norm_reference == unoperated


def test_a_growth_curve_across_populations_is_refused(tmp_path):
    mixed = ["spina-bifida-unoperated-21", "spina-bifida-operated-34"]
    found = problems(
        study("spina-bifida", mixed[0], growth={"brains": {"mixed": mixed}}), tmp_path
    )
    assert found == [Facts("growth.brains.mixed:", OPERATED, UNOPERATED)]
    # without a name the two are series of one week each, which is none
    found = resolve(
        load(study("spina-bifida", mixed[0], growth={"brains": mixed}), tmp_path)
    )
    assert series_ids(found) == {}


def test_explicit_brains_stand_beside_those_of_atlases_and_may_be_the_start(tmp_path):
    own = [{"id": "own", "week": 21, **LABELLED}]
    atlas = [
        {"name": "spina-bifida", "series": "unoperated", "weeks": [22, 21]},
        "dhcp-surface",
    ]
    config = load(study(atlas, "own", brains=own), tmp_path)
    dhcp = [f"dhcp-surface-{week}" for week in range(21, 37)]
    assert [brain.id for brain in config.brains] == [
        "own",
        "spina-bifida-unoperated-21",
        "spina-bifida-unoperated-22",
        *dhcp,
    ]
    twice = problems(study([*atlas, "dhcp-surface"], "own", brains=own), tmp_path)
    assert twice == [
        *(Facts("brains:", 2, name) for name in dhcp[:3]),
        Facts(len(dhcp) - 3),
    ]


# files in a folder


def test_files_are_found_by_name_wherever_they_lie_and_others_are_put_beside(tmp_path):
    touched(
        tmp_path / "mine",
        *surfaces(21, inside="some/where/"),
        "clone/atlas/fetal.week22.left.pial.surf.gii",
    )
    section = {"name": "dhcp-surface", "folder": "mine", "weeks": [21, 22]}
    config = load(study(section, "dhcp-surface-21"), tmp_path)
    assert (
        config.brains[0].hemispheres.left
        == f"{tmp_path}/mine/some/where/{SURFACES.format(21, 'left')}"
    )
    assert (
        config.brains[1].hemispheres.left
        == f"{tmp_path}/mine/clone/atlas/fetal.week22.left.pial.surf.gii"
    )
    (missing,) = used_atlases(config)[0].missing
    assert missing.path == tmp_path / "mine" / SURFACES.format(22, "right")
    assert missing.url.endswith("/" + SURFACES.format(22, "right"))


def test_an_atlas_folder_and_what_is_in_it_may_be_links(tmp_path):
    touched(tmp_path / "store", *surfaces(21))
    touched(tmp_path / "far", *surfaces(22))
    (tmp_path / "store" / "more").symlink_to(tmp_path / "far")
    # a link upwards, by which each file would be found over and over
    (tmp_path / "far" / "up").symlink_to(tmp_path / "store")
    (tmp_path / "mine").symlink_to(tmp_path / "store")
    section = {"name": "dhcp-surface", "folder": "mine", "weeks": [21, 22]}
    config = load(study(section, "dhcp-surface-21"), tmp_path)
    assert [brain.hemispheres.left for brain in config.brains] == [
        f"{tmp_path}/store/{SURFACES.format(21, 'left')}",
        f"{tmp_path}/far/{SURFACES.format(22, 'left')}",
    ]


def test_a_file_is_known_by_the_part_of_its_path_with_the_week(tmp_path):
    known = read_yaml(ATLASES / "crl" / "atlas.yaml")["series"]["normative"]["weeks"]
    section = {
        "name": "crl",
        "folder": "mine",
        "weeks": [21, 22],
        "accept_licence": True,
    }
    touched(
        tmp_path / "mine",
        "Other21_Study1/parcellation.nii.gz",
        "x/HarvardSTA22_Study1/parcellation.nii.gz",
    )
    config = load(study(section, "crl-21"), tmp_path)
    file = f"{tmp_path}/mine/x/HarvardSTA22_Study1/parcellation.nii.gz"
    assert [brain.labels for brain in config.brains][1] == file
    # which is looked at by the stage that reads it
    found = {file: known_checksums(used_atlases(config))[file]}
    assert found == {file: ("crl", known[22]["labels"])}
    with pytest.raises(InputError, check=Facts(f"{file}:", "crl", known[22]["labels"])):
        require_checksums(found)


def test_two_files_of_one_name_and_a_file_in_the_place_of_the_folder_are_refused(
    tmp_path,
):
    touched(tmp_path / "mine", *surfaces(21), surfaces(21, inside="copy/")[0])
    section = {"name": "dhcp-surface", "folder": "mine", "weeks": [21]}
    both = [
        tmp_path / "mine" / inside / SURFACES.format(21, "left")
        for inside in ("", "copy")
    ]
    assert problems(study(section, "dhcp-surface-21"), tmp_path) == [
        Facts("atlas.folder:", *both)
    ]
    touched(tmp_path, "file")
    found = problems(study(section | {"folder": "file"}, "dhcp-surface-21"), tmp_path)
    assert found == [Facts("atlas.folder:", tmp_path / "file")]


def test_a_week_between_is_used_where_it_is_and_never_rounded(tmp_path):
    touched(tmp_path / "mine", *surfaces("21.5"))
    section = {"name": "dhcp-surface", "folder": "mine", "weeks": [21, 21.5]}
    config = load(study(section, "dhcp-surface-21.5"), tmp_path)
    assert [(brain.id, brain.week) for brain in config.brains] == [
        ("dhcp-surface-21", 21),
        ("dhcp-surface-21.5", 21.5),
    ]
    assert config.brains[1].hemispheres.left.endswith(
        "fetal.week21.5.left.pial.surf.gii"
    )
    later = ", ".join(map(str, range(22, 37)))
    for week in (21.004, 37):
        found = problems(study(section | {"weeks": [week]}, "a"), tmp_path)
        assert found == [
            Facts("atlas.weeks:", "dhcp-surface", week, f"21, 21.5, {later}")
        ]


# an atlas of one's own


def test_a_user_s_atlas_is_one_file(tmp_path):
    touched(tmp_path / "mine", "w21.nii.gz", "w22.nii.gz")
    file = write_atlas(tmp_path / "mine")
    for given in (
        "mine/atlas.yaml",
        str(file),
        {"name": "mine/atlas.yaml", "series": ["all"]},
    ):
        config = load(study(given, "mine-21", folding={"end_week": 22}), tmp_path)
        assert [(brain.id, brain.population) for brain in config.brains] == [
            ("mine-21", "sheep"),
            ("mine-22", "sheep"),
        ]
        assert config.brains[1].labels == str(tmp_path / "mine" / "w22.nii.gz")


@pytest.mark.parametrize(
    ("names", "white"),
    [
        (
            ["left", "right", "white_left", "white_right"],
            {"left": "21.white_left.gii", "right": "21.white_right.gii"},
        ),
        (["pial", "white"], {"whole": "21.white.gii"}),
    ],
)
def test_an_atlas_may_have_white_surfaces(tmp_path, names, white):
    touched(tmp_path, *(f"{week}.{name}.gii" for week in (21, 22) for name in names))
    files = {name: f"{{week}}.{name}.gii" for name in names}
    write_atlas(tmp_path, series={"scheme": None, "files": files})
    brain, _ = load(
        study("atlas.yaml", "mine-21", folding={"end_week": 22}), tmp_path
    ).brains
    assert {side: Path(path).name for side, path in brain.white_files.items()} == white


@pytest.mark.parametrize(
    ("changes", "key", "facts"),
    [
        ({"nam": "x"}, "nam", ["name"]),
        ({"licence": {"name": "x"}}, "licence.terms", []),
        ({"series": {"scheme": None}}, "series.all.scheme", ["labels"]),
        ({"series": {"weeks": []}}, "series.all.weeks", [[]]),
        ({"series": {"weeks": [21, 21]}}, "series.all.weeks", [[21, 21]]),
        (
            {"series": {"files": {"labels": "a.nii.gz"}}},
            "series.all.files",
            ["{week}", "a.nii.gz"],
        ),
        (
            {"series": {"files": {"left": "{week}.gii"}}},
            "series.all.files",
            ["left", "right", "pial", "{week}.gii"],
        ),
        (
            {"series": {"files": {"pial": "{week}.gii", "white_left": "{week}.w"}}},
            "series.all.files",
            ["white_left"],
        ),
        (
            {"series": {"weeks": {21: {"labels": "abc"}}}},
            "series.all.weeks[21].labels",
            ["abc", 64],
        ),
    ],
)
def test_mistakes_in_a_description_are_named_with_its_file(
    tmp_path, changes, key, facts
):
    touched(tmp_path, "w21.nii.gz", "w22.nii.gz")
    file = write_atlas(tmp_path, **changes)
    assert problems(study("atlas.yaml", "mine-21"), tmp_path) == [
        Facts(f"{file}: {key}:", *facts)
    ]


# licences and mistakes


def test_a_narrow_licence_has_to_be_accepted_and_is_reported(tmp_path):
    (found,) = problems(study({"name": "crl", "weeks": [21]}, "crl-21"), tmp_path)
    licence = Atlas(**read_yaml(ATLASES / "crl" / "atlas.yaml")).licence
    assert found == Facts(
        "atlas.accept_licence:", "true", "crl", licence.name, licence.terms
    )
    config = load(
        study({"name": "crl", "weeks": [21, 22], "accept_licence": True}, "crl-21"),
        tmp_path,
    )
    note = retrieval_note(used_atlases(config)[0])
    folder = tmp_path / "resources" / "atlases" / "crl"
    assert note == Facts("crl", 2, folder, "Gholipour", licence.terms)
    write_atlas(tmp_path, url="https://example.org/atlas")
    (unchecked,) = used_atlases(
        load(study("atlas.yaml", "mine-21", folding={"end_week": 22}), tmp_path)
    )
    assert ("checksum" in note, "checksum" in retrieval_note(unchecked)) == (
        False,
        True,
    )


@pytest.mark.parametrize(
    ("atlas", "found"),
    [
        ({"name": "crl", "sources": "x"}, [Facts("atlas.sources:", "series")]),
        (
            {"name": "spina-bifida", "weeks": [], "images": "all"},
            [Facts("atlas.weeks:", []), Facts("atlas.images:", "all")],
        ),
        (
            ["spina-bifda", {"name": "spina-bifida", "series": "operatd"}],
            [
                Facts("atlas[0].name:", "spina-bifda", "spina-bifida"),
                Facts(
                    "atlas[1].series:",
                    "operatd",
                    "spina-bifida",
                    "unoperated, operated",
                ),
            ],
        ),
        (
            {"name": "spina-bifida", "series": "operated", "weeks": [24]},
            [
                Facts(
                    "atlas.weeks:",
                    24,
                    "spina-bifida",
                    "operated",
                    "25, 26, 27, 28, 29, 30, 31, 32, 33, 34",
                )
            ],
        ),
        ({"weeks": [21]}, [Facts("atlas.name:")]),
        ("none.yaml", [Facts("atlas.name:", "none.yaml")]),
        (7, [Facts("atlas:", 7)]),
    ],
)
def test_mistakes_in_a_section_are_named_at_once(tmp_path, atlas, found):
    named = problems(study(atlas, "x", folding={"end_weak": 23}), tmp_path)
    assert named == [
        *found,
        Facts("folding.end_week:"),
        Facts("folding.end_weak:", "end_week"),
    ]
