"""The atlas section: which brains it stands for, and what is said of weeks that its folder lacks."""

import pytest

from gyriflow.config import load
from gyriflow.config.atlas import LAYOUTS, AtlasSettings, atlas_files
from gyriflow.errors import InputError

SURFACE = "dhcp_fetal_brain_surface_atlas/atlas"
VOLUME = "fetal_brain_mri_atlas"


def put(folder, *names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


def surfaces(*weeks, inside=SURFACE):
    return [f"{inside}/fetal.week{week}.{side}.pial.surf.gii" for week in weeks for side in ("left", "right")]


def labels(*weeks, inside=f"{VOLUME}/parcellations"):
    return [f"{inside}/tissue-t{week}_dhcp-19.nii.gz" for week in weeks]


def study(atlas, **changes):
    return {"atlas": {"folder": "atlas"} | atlas, "start": "surface-week21", "folding": {"end_week": 23}} | changes


def problems(raw, base_dir, **options):
    with pytest.raises(InputError) as caught:
        load(raw, base_dir, **options)
    return [line.strip() for line in str(caught.value).splitlines()[1:-1]]


def test_each_week_of_a_source_is_a_brain(tmp_path):
    put(tmp_path / "atlas", *surfaces(21, 22), *labels("21.00", "22.00"), f"{VOLUME}/structural/t2-t22.00.nii.gz")
    config = load(study({"weeks": [22, 21]}), tmp_path)
    folder = tmp_path / "atlas"
    assert [(brain.id, brain.week) for brain in config.brains] == [
        *(("surface-week21", 21), ("surface-week22", 22)),
        *(("volume-week21", 21), ("volume-week22", 22)),
    ]
    surface, volume = config.brain("surface-week21"), config.brain("volume-week22")
    assert (surface.source, surface.coordinates) == ("hemispheres", "auto")
    assert surface.files == [str(folder / name) for name in surfaces(21)]
    assert (volume.source, volume.scheme) == ("labels", "dhcp-19")
    assert volume.files == [str(folder / name) for name in labels("22.00")]
    assert volume.image == str(folder / VOLUME / "structural/t2-t22.00.nii.gz")
    # the image is for a figure only
    assert config.brain("volume-week21").image is None


def test_explicit_brains_stand_beside_those_of_the_atlas_and_may_be_the_start(tmp_path):
    put(tmp_path / "atlas", *surfaces(21, 22))
    own = [{"id": "own", "week": 21, "phantom": {}}]
    config = load(study({"source": "surface", "weeks": [21, 22]}, brains=own, start="own"), tmp_path)
    assert [brain.id for brain in config.brains] == ["own", "surface-week21", "surface-week22"]
    twice = [{"id": "surface-week21", "week": 21, "phantom": {}}]
    found = problems(study({"source": "surface", "weeks": [21, 22]}, brains=twice), tmp_path)
    assert found == ["brains: 2 brains have the id surface-week21; ids are unique"]


def test_files_are_found_by_name_wherever_they_lie(tmp_path):
    put(tmp_path / "atlas", *surfaces(21, inside="some/where"), *labels("21.00", inside="."))
    config = load(study({"weeks": [21]}), tmp_path)
    assert config.brain("surface-week21").hemispheres.left == str(
        tmp_path / "atlas/some/where/fetal.week21.left.pial.surf.gii"
    )
    assert config.brain("volume-week21").labels == str(tmp_path / "atlas/tissue-t21.00_dhcp-19.nii.gz")


def test_two_files_of_one_name_are_refused(tmp_path):
    put(tmp_path / "atlas", *surfaces(21), surfaces(21, inside="copy")[0])
    (found,) = problems(study({"source": "surface", "weeks": [21]}), tmp_path)
    name = "fetal.week21.left.pial.surf.gii"
    assert (
        found
        == f"atlas.folder: found {tmp_path}/atlas/copy/{name} and {tmp_path}/atlas/{SURFACE}/{name}; keep one of them"
    )


def test_weeks_that_the_folder_lacks_are_named_with_those_present(tmp_path):
    put(tmp_path / "atlas", *surfaces(*range(21, 30), 32), surfaces(31)[0], *labels("21.00", "22.00", "25.00"))
    found = problems(study({"weeks": list(range(21, 33))}), tmp_path)
    remedy = "`./run snakemake --cores 1 download` with this configuration fetches them; or take the weeks out"
    lacks = f"atlas.weeks: {tmp_path}/atlas lacks"
    assert found == [
        f"{lacks} the surface files of weeks 30, 31, such as fetal.week30.left.pial.surf.gii; present: 21-29, 32. "
        + remedy,
        f"{lacks} the volume files of weeks 23, 24, 26-32, such as tissue-t23.00_dhcp-19.nii.gz; present: 21, 22, 25. "
        + remedy,
    ]


def test_a_folder_that_is_not_there_is_named_with_the_way_to_fill_it(tmp_path):
    (found,) = problems(study({"source": "surface", "weeks": [21, 22]}), tmp_path)
    assert found.startswith(f"atlas.weeks: {tmp_path}/atlas lacks the surface files of weeks 21, 22")
    assert "none is there. `./run snakemake --cores 1 download`" in found
    put(tmp_path, "atlas")
    assert problems(study({"weeks": [21]}), tmp_path) == [
        f"atlas.folder: {tmp_path}/atlas is a file; it should be a folder"
    ]


@pytest.mark.parametrize("downloading", [False, True])
def test_a_week_between_is_used_where_it_is_and_never_rounded(tmp_path, downloading):
    put(tmp_path / "atlas", *surfaces(21, 22), *labels("21.00", "21.50", "22.00"))
    volumes = study({"source": "volume", "weeks": [21.5]}, start="volume-week21.5")
    config = load(volumes, tmp_path, downloading=downloading)
    assert config.brain("volume-week21.5").week == 21.5
    assert config.brain("volume-week21.5").labels.endswith("tissue-t21.50_dhcp-19.nii.gz")
    for week in (21.5, 21.004, 37):
        source = {"source": "surface" if week == 21.5 else "volume", "weeks": [week]}
        (found,) = problems(study(source, start=f"{source['source']}-week{week:g}", folding={"end_week": 40}), tmp_path)
        assert f"atlas has no {source['source']} files of week {week:g}; present: 21" in found
        assert "whole weeks 21 to 36; a week is never rounded" in found


def test_what_is_to_be_downloaded_need_not_be_there(tmp_path):
    put(tmp_path / "atlas", *surfaces(21, inside="own"))
    config = load(study({"weeks": [21, 22], "url": "http://mirror/"}), tmp_path, downloading=True)
    root = "http://mirror/kcl_cdb"
    assert config.downloads == {
        name: f"{root}/dhcp_fetal_brain_surface_atlas/raw/master/atlas/{name.rpartition('/')[2]}"
        for name in [*surfaces(21, inside="own"), *surfaces(22)]
    } | {
        f"{VOLUME}/{name}": f"{root}/{VOLUME}/raw/master/{name}"
        for week in (21, 22)
        for name in (f"parcellations/tissue-t{week}.00_dhcp-19.nii.gz", f"structural/t2-t{week}.00.nii.gz")
    }


def test_a_dump_has_the_brains_in_the_place_of_the_atlas(tmp_path):
    put(tmp_path / "atlas", *surfaces(21, 22), *labels("21.00", "22.00"))
    config = load(study({"weeks": [21, 22]}, growth={"estimated_from": "volume"}), tmp_path)
    again = load(config.model_dump(mode="json", exclude_defaults=True, exclude={"atlas"}))
    assert (again.brains, again.growth_series) == (config.brains, config.growth_series)
    assert (again.atlas, again.estimated_from("volume-week21")) == (None, "volume")


def test_all_published_weeks_are_the_default(tmp_path):
    atlas = AtlasSettings(folder=str(tmp_path))
    assert len(atlas_files(atlas)) == 16 * sum(len(layout.paths) for layout in LAYOUTS.values()) == 64


@pytest.mark.parametrize(
    ("atlas", "found"),
    [
        ({"sources": "surface"}, ["atlas.sources: unknown key; did you mean source?"]),
        (
            {"source": "surfaces", "weeks": [], "url": "gin.g-node.org"},
            [
                "atlas.source: found 'surfaces'; it should be 'surface', 'volume' or 'both'",
                "atlas.weeks: found []; it should have one week or more",
                "atlas.url: found 'gin.g-node.org'; it should begin with https:// or http://",
            ],
        ),
        ({"folder": None}, ["atlas.folder: found None; it should be a valid string"]),
    ],
)
def test_mistakes_in_the_section_are_named_at_once(tmp_path, atlas, found):
    named = problems(study(atlas, folding={"end_weak": 23}), tmp_path)
    assert named == [*found, "folding.end_week: is missing", "folding.end_weak: unknown key; did you mean end_week?"]


def test_a_week_twice_and_an_unknown_start_are_named(tmp_path):
    put(tmp_path / "atlas", *surfaces(21))
    found = problems(study({"source": "surface", "weeks": [21, 21]}, start="week21"), tmp_path)
    assert found == [
        "atlas.weeks: found 21 more than once",
        "start: found 'week21'; expected the id of a brain: surface-week21",
    ]
