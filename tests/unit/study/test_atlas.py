"""Atlases: what an atlas.yaml may say, the brains that a section stands for, and what
is said of files and weeks."""

from pathlib import Path

import pytest
from configurations import (
    LABELLED,
    cases,
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
EARLY = [f"spina-bifida-unoperated-{week}" for week in range(21, 26)]
LATE = [f"spina-bifida-operated-{week}" for week in range(25, 35)]
SURFACES = "atlas/fetal.week{}.{}.pial.surf.gii"


def surfaces(*weeks, inside=""):
    return [
        inside + SURFACES.format(week, side)
        for week in weeks
        for side in ("left", "right")
    ]


def study(atlas, start="first", **changes):
    return {"atlas": atlas, "start": start, "folding": {"end_week": 26}} | changes


def dhcp(*weeks, folder="mine"):
    """Return a study of the dHCP atlas, whose files are in a folder."""
    return study({"name": "dhcp-surface", "folder": folder, "weeks": [*weeks]})


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
    config = load(study("spina-bifida"), tmp_path)
    assert [brain.id for brain in config.brains] == EARLY + LATE
    (used,) = used_atlases(config)
    assert used.missing == []
    assert all(sha256_of(file.path) == file.sha256 for file in used.files)
    assert all(Path(brain.labels).is_relative_to(ATLASES) for brain in config.brains)
    assert {brain.image for brain in config.brains} == {None}
    assert (ATLASES / "spina-bifida" / "LICENSE.txt").is_file()


# the brains and their populations


def test_populations_are_named_and_never_share_a_curve(tmp_path):
    found = resolve(load(study("spina-bifida"), tmp_path))
    assert observed_name(found.brains[brain] for brain in EARLY) == UNOPERATED
    both = observed_name(found.brains[brain] for brain in [*EARLY, LATE[0]])
    assert both == Facts(f"{UNOPERATED} (21-25 GW)", f"{OPERATED} (25 GW)")
    assert series_ids(found) == {UNOPERATED: EARLY, OPERATED: LATE}
    assert found.run_simulations[0].series == UNOPERATED
    assert found.norm_reference == EARLY


def test_a_growth_curve_across_populations_is_refused(tmp_path):
    mixed = [EARLY[0], LATE[-1]]
    named = study("spina-bifida", growth={"brains": {"mixed": mixed}})
    assert problems(named, tmp_path) == [
        Facts("growth.brains.mixed:", OPERATED, UNOPERATED)
    ]
    # without a name the two are series of one week each, which is none
    raw = study("spina-bifida", growth={"brains": mixed})
    assert series_ids(resolve(load(raw, tmp_path))) == {}


def test_explicit_brains_stand_beside_those_of_atlases_and_may_be_the_start(tmp_path):
    own = [{"id": "own", "week": 21, **LABELLED}]
    some = {"name": "spina-bifida", "series": "unoperated", "weeks": [22, 21]}
    config = load(study([some, "dhcp-surface"], "own", brains=own), tmp_path)
    dhcp = [f"dhcp-surface-{week}" for week in range(21, 37)]
    assert [brain.id for brain in config.brains] == ["own", *EARLY[:2], *dhcp]
    twice = study(["dhcp-surface", "dhcp-surface"], "own", brains=own)
    assert problems(twice, tmp_path) == [
        *(Facts("brains:", 2, name) for name in dhcp[:3]),
        Facts(len(dhcp) - 3),
    ]


# files in a folder


def test_files_are_found_by_name_wherever_they_lie_and_others_are_put_beside(tmp_path):
    left = "clone/atlas/fetal.week22.left.pial.surf.gii"
    touched(tmp_path / "mine", *surfaces(21, inside="some/where/"), left)
    config = load(dhcp(21, 22), tmp_path)
    assert [brain.hemispheres.left for brain in config.brains] == [
        f"{tmp_path}/mine/some/where/{SURFACES.format(21, 'left')}",
        f"{tmp_path}/mine/{left}",
    ]
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
    found = load(dhcp(21, 22), tmp_path).brains
    assert [brain.hemispheres.left for brain in found] == [
        f"{tmp_path}/store/{SURFACES.format(21, 'left')}",
        f"{tmp_path}/far/{SURFACES.format(22, 'left')}",
    ]


def test_a_file_is_known_by_the_part_of_its_path_with_the_week(tmp_path):
    known = read_yaml(ATLASES / "crl" / "atlas.yaml")["series"]["normative"]["weeks"]
    name = "x/HarvardSTA22_Study1/parcellation.nii.gz"
    touched(tmp_path / "mine", "Other21_Study1/parcellation.nii.gz", name)
    section = {"name": "crl", "folder": "mine", "accept_licence": True}
    config = load(study(section | {"weeks": [21, 22]}), tmp_path)
    file = f"{tmp_path}/mine/{name}"
    assert config.brains[1].labels == file
    # which is looked at by the stage that reads it
    found = {file: known_checksums(used_atlases(config))[file]}
    assert found == {file: ("crl", known[22]["labels"])}
    with pytest.raises(InputError, check=Facts(f"{file}:", "crl", known[22]["labels"])):
        require_checksums(found)


def test_two_files_of_one_name_or_a_file_in_place_of_the_folder_are_refused(tmp_path):
    copies = [f"mine/{copy}/{SURFACES.format(21, 'left')}" for copy in "ab"]
    touched(tmp_path, *copies, "file")
    both = [tmp_path / copy for copy in copies]
    assert problems(dhcp(21), tmp_path) == [Facts("atlas.folder:", *both)]
    found = problems(dhcp(21, folder="file"), tmp_path)
    assert found == [Facts("atlas.folder:", tmp_path / "file")]


def test_a_week_between_is_used_where_it_is_and_never_rounded(tmp_path):
    touched(tmp_path / "mine", *surfaces("21.5"))
    brains = load(dhcp(21, 21.5), tmp_path).brains
    assert [brain.id for brain in brains] == ["dhcp-surface-21", "dhcp-surface-21.5"]
    assert brains[1].week == 21.5
    assert brains[1].hemispheres.left.endswith("week21.5.left.pial.surf.gii")
    listed = "21, 21.5, " + ", ".join(map(str, range(22, 37)))
    for week in (21.004, 37):
        assert problems(dhcp(week), tmp_path) == [
            Facts("atlas.weeks:", "dhcp-surface", week, listed)
        ]


# an atlas of one's own


@pytest.mark.parametrize(
    "atlas",
    [
        "mine/atlas.yaml",
        "{}/mine/atlas.yaml",
        {"name": "mine/atlas.yaml", "series": ["all"]},
    ],
)
def test_a_user_s_atlas_is_one_file(tmp_path, atlas):
    touched(tmp_path / "mine", "w21.nii.gz", "w22.nii.gz")
    write_atlas(tmp_path / "mine")
    section = atlas.format(tmp_path) if isinstance(atlas, str) else atlas
    brains = load(study(section, folding={"end_week": 22}), tmp_path).brains
    assert [brain.id for brain in brains] == ["mine-21", "mine-22"]
    assert brains[1].population == "sheep"
    assert brains[1].labels == str(tmp_path / "mine" / "w22.nii.gz")


@cases(
    ("names", "white"),
    """
    left right white_left white_right | {left: white_left, right: white_right}
    pial white | {whole: white}
    """,
)
def test_an_atlas_may_have_white_surfaces(tmp_path, names, white):
    files = {name: f"{{week}}.{name}.gii" for name in names.split()}
    for week in (21, 22):
        touched(tmp_path, *(file.format(week=week) for file in files.values()))
    write_atlas(tmp_path, series={"scheme": None, "files": files})
    brain, _ = load(study("atlas.yaml", folding={"end_week": 22}), tmp_path).brains
    found = {part: Path(file).name for part, file in brain.white_files.items()}
    assert found == {part: f"21.{name}.gii" for part, name in white.items()}


@cases(
    ("changes", "key", "facts"),
    """
    {nam: x} | nam | [name]
    {licence: {name: x}} | licence.terms | []
    {series: {scheme: null}} | series.all.scheme | [labels]
    {series: {weeks: []}} | series.all.weeks | [[]]
    {series: {weeks: [21, 21]}} | series.all.weeks | [[21, 21]]
    {series: {files: {labels: a.nii.gz}}} | series.all.files | ["{week}", a.nii.gz]
    {series: {files: {left: "{week}.gii"}}} | series.all.files | [left, right, pial]
    {series: {files: {pial: "{week}.gii", white_left: w}}} | series.all.files | []
    {series: {weeks: {21: {labels: abc}}}} | "series.all.weeks[21].labels" | [abc, 64]
    """,
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


def test_a_narrow_licence_is_accepted_and_reported_and_whether_checksums_lack(
    tmp_path,
):
    crl = {"name": "crl", "weeks": [21, 22]}
    licence = Atlas(**read_yaml(ATLASES / "crl" / "atlas.yaml")).licence
    assert problems(study(crl), tmp_path) == [
        Facts("atlas.accept_licence:", "true", "crl", licence.name, licence.terms)
    ]
    (used,) = used_atlases(load(study(crl | {"accept_licence": True}), tmp_path))
    note = retrieval_note(used)
    folder = tmp_path / "resources" / "atlases" / "crl"
    assert note == Facts("crl", 2, folder, "Gholipour", licence.terms)
    assert "checksum" not in note
    write_atlas(tmp_path, url="https://example.org/atlas")
    raw = study("atlas.yaml", folding={"end_week": 22})
    (without,) = used_atlases(load(raw, tmp_path))
    assert "checksum" in retrieval_note(without)


@cases(
    ("atlas", "found"),
    """
    {name: crl, sources: x} | [["atlas.sources:", series]]
    {name: crl, weeks: [], images: all} | [["atlas.weeks:", []], ["atlas.images:", all]]
    [spina-bifda] | [["atlas[0].name:", spina-bifda, spina-bifida]]
    [{name: spina-bifida, series: oprated}] | [["atlas[0].series:", oprated, operated]]
    {name: spina-bifida, series: operated, weeks: [24]} | [["atlas.weeks:", 24, 25, 34]]
    {weeks: [21]} | [["atlas.name:"]]
    none.yaml | [["atlas.name:", none.yaml]]
    7 | [["atlas:", 7]]
    """,
)
def test_mistakes_in_a_section_are_named_at_once(tmp_path, atlas, found):
    named = problems(study(atlas, "x", folding={"end_weak": 23}), tmp_path)
    assert named == [
        *(Facts(*facts) for facts in found),
        Facts("folding.end_week:"),
        Facts("folding.end_weak:", "end_week"),
    ]
