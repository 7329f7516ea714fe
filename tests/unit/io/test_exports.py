"""Exports hold what was measured, under names of their own or of BIDS derivatives."""

import json
import shutil
from dataclasses import replace

import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from facts import Facts
from processes import ran
from shapes import hemisphere, scaling, sphere

from gyriflow.errors import InputError
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import transformed
from gyriflow.io.exports import ExportedBrain, export_bids, publish_derivatives
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_labels,
    read_vertex_maps,
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)
from gyriflow.io.volumes import (
    LabelSource,
    LabelVolume,
    read_label_volume,
    write_label_volume,
)
from gyriflow.io.yaml_files import SCHEMES

VALIDATOR = shutil.which("bids-validator-deno")
TABLES = {
    "metrics_wide": pd.DataFrame(
        {"subject": ["case_1"], "area": [3.5], "depth": [np.nan]}
    )
}
POSE = np.array([[0.0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
"""A quarter turn and 5 mm."""


@pytest.fixture
def brain(tmp_path):
    ends = {
        "surfaces": "pial.surf.gii",
        "maps": "shape.gii",
        "regions": "regions.label.gii",
    }
    paths = {
        kind: {side: str(tmp_path / f"{side}.{end}") for side in ("left", "right")}
        for kind, end in ends.items()
    }
    for side, sign in (("left", -1), ("right", 1)):
        mesh = hemisphere(sign)
        number = np.arange(len(mesh.vertices))
        write_surface(paths["surfaces"][side], mesh)
        write_vertex_maps(
            paths["maps"][side],
            {"sulcal_depth_mm": number / 7, "thickness_mm": number / 9},
        )
        write_vertex_labels(paths["regions"][side], number % 2, {1: "frontal"})
    write_json(tmp_path / "surface.json", {"pose": Pose(POSE).plain()})
    return ExportedBrain(
        "case_1",
        "observed",
        22.43,
        "case_1",
        **paths,
        report=str(tmp_path / "surface.json"),
        covariates={},
    )


def test_bids_derivatives(tmp_path, brain):
    folder = tmp_path / "bids"
    simulated = brain._replace(run="run-a", week=24.0)
    export_bids(
        folder,
        [brain, simulated],
        TABLES,
        "1.2.3",
        {"area": ("pial area, both hemispheres", "cm2")},
    )
    described = read_json(folder / "dataset_description.json")
    assert described["DatasetType"] == "derivative"
    assert described["GeneratedBy"][0]["Version"] == "1.2.3"
    place = folder / "sub-case1" / "anat"
    names = {path.name for path in place.iterdir()}
    assert "sub-case1_hemi-L_pial.surf.gii" in names
    assert "sub-case1_hemi-R_desc-runagw2400_thickness.shape.gii" in names
    assert len(names) == 2 * 2 * (1 + 2 + 1)
    # in the world of the volumes
    turned = hemisphere(1).vertices @ POSE[:3, :3].T + POSE[:3, 3]
    write_surface(brain.surfaces["right"], replace(hemisphere(1), vertices=turned))
    export_bids(
        folder,
        [brain],
        TABLES,
        "1.2.3",
        {"area": ("pial area, both hemispheres", "cm2")},
    )
    np.testing.assert_allclose(
        read_surface(place / "sub-case1_hemi-R_pial.surf.gii").vertices,
        hemisphere(1).vertices,
        atol=1e-5,
    )
    depth = read_vertex_maps(place / "sub-case1_hemi-L_sulc.shape.gii")
    assert list(depth) == ["sulc"]
    np.testing.assert_allclose(depth["sulc"][:3], [0, -1 / 7, -2 / 7], rtol=1e-6)
    wide = read_json(folder / "metrics_wide.json")
    assert wide["area"] == {
        "Description": "pial area, both hemispheres",
        "Units": "cm^2",
    }
    assert set(wide) == {"brain", "run", "week", "area", "depth"}
    assert read_json(folder / "sulc.json")["Units"] == "mm"
    # what has no value, and how much of it
    assert read_json(folder / "thickness.json")["Description"] == Facts(
        "NaN", "thickness_measured_share"
    )
    write_vertex_maps(brain.maps["left"], {"unheard_of": depth["sulc"]})
    with pytest.raises(KeyError, match="unheard_of"):
        export_bids(folder, [brain], TABLES, "1.2.3", {})
    _, regions = read_vertex_labels(
        place / "sub-case1_hemi-L_desc-regions_dseg.label.gii"
    )
    assert regions == {1: "frontal"}
    wide = (folder / "metrics_wide.tsv").read_text()
    assert wide.splitlines() == [
        "participant_id\tsession_id\tbrain\tarea\tdepth",
        "sub-case1\tn/a\tcase_1\t3.5\tn/a",
    ]
    assert (folder / "descriptions.tsv").read_text().splitlines()[1] == Facts(
        "desc-runagw2400\t", "run-a", 24
    )


# as the HCP and smriprep's inverted maps have them: larger on gyri, thickness positive,
# lengths in mm
OTHER_TOOLS = {
    "curv": (1, "1/mm"),
    "sulc": (1, "mm"),
    "thickness": (1, "mm"),
    "shapeIndex": (1, "arbitrary"),
}


def test_maps_under_names_of_other_tools_have_their_signs_and_units(tmp_path, brain):
    on_gyri = np.where(np.arange(len(hemisphere(-1).vertices)) % 3 == 0, 1.0, -1.0)
    ours = {
        "mean_curvature": 0.3 * on_gyri,
        "sulcal_depth_mm": 4 - 4 * on_gyri,
        "thickness_mm": 2 + 0.5 * on_gyri,
    }
    for path in brain.maps.values():
        write_vertex_maps(path, ours | {"shape_index": 0.5 * on_gyri})
    white = brain._replace(white=brain.surfaces, white_maps=brain.maps)
    export_bids(tmp_path / "bids", [white], {}, "1", {})
    for name, (sign, unit) in OTHER_TOOLS.items():
        described = read_json(tmp_path / "bids" / f"{name}.json")
        assert described["Units"] == unit
        for side, structure in (("L", "CortexLeft"), ("R", "CortexRight")):
            path = (
                tmp_path
                / "bids"
                / "sub-case1"
                / "anat"
                / f"sub-case1_hemi-{side}_{name}.shape.gii"
            )
            (values,) = read_vertex_maps(path).values()
            assert (np.sign(values - values.mean()) == sign * on_gyri).all()
            assert nib.load(path).meta["AnatomicalStructurePrimary"] == structure
        assert name == "thickness" or any(
            word in described["Description"] for word in ("gyri", "sulci")
        )
    for layer, secondary in (("pial", "Pial"), ("white", "GrayWhite")):
        points, _ = nib.load(
            tmp_path / "bids/sub-case1/anat" / f"sub-case1_hemi-L_{layer}.surf.gii"
        ).darrays
        assert points.meta["AnatomicalStructureSecondary"] == secondary


def scans_of_two(brain):
    scans = (
        ("1", "1", 21.0, "F", "1.5"),
        ("1", "2", 24.43, "F", "3"),
        ("2", "1", 22.0, "M", "3"),
    )
    return [
        brain._replace(
            brain=f"sub-0{subject}_ses-{session}",
            subject=f"sub-0{subject}",
            week=week,
            covariates=more,
        )
        for subject, session, week, sex, tesla in scans
        for more in [{"sex": sex, "tesla": tesla}]
    ]


def test_subjects_and_sessions_keep_their_names(tmp_path, brain):
    folder = tmp_path / "bids"
    export_bids(folder, scans_of_two(brain), {}, "1", {})
    assert (
        folder / "sub-01" / "ses-2" / "anat" / "sub-01_ses-2_hemi-L_sulc.shape.gii"
    ).exists()
    assert (
        folder / "participants.tsv"
    ).read_text() == "participant_id\tsex\nsub-01\tF\nsub-02\tM\n"
    assert (folder / "sub-01" / "sub-01_sessions.tsv").read_text().splitlines() == [
        "session_id\tgestational_age\tbrain\ttesla",
        "ses-1\t21\tsub-01_ses-1\t1.5",
        "ses-2\t24.43\tsub-01_ses-2\t3",
    ]
    # scans of a subject that have no names of sessions have their weeks'
    unnamed = [
        one._replace(brain=f"scan{number}")
        for number, one in enumerate(scans_of_two(brain))
    ]
    export_bids(folder, unnamed, {}, "1", {})
    assert (folder / "sub-01" / "ses-2443w" / "anat").is_dir()


def test_brains_of_one_bids_name_are_refused(tmp_path, brain):
    again = brain._replace(brain="scan-2")
    with pytest.raises(
        InputError, check=Facts("sub-case1_ses-2243w", "case_1", "scan-2")
    ):
        export_bids(tmp_path / "bids", [brain, again], {}, "1", {})


@pytest.mark.parametrize(
    ("first", "second", "label"),
    [
        ("1-12", "11-2", "sub-112"),
        ("case_1", "case-1", "sub-case1"),
        ("sub-01", "01", "sub-01"),
        ("müller", "möller", "sub-mller"),
        # a disk that ignores case has one folder for both
        ("sub-a", "sub-A", "sub-a"),
    ],
)
def test_subjects_of_one_bids_label_are_refused_at_any_weeks(
    tmp_path, brain, first, second, label
):
    scans = [
        brain._replace(brain="a", subject=first, week=22.0),
        brain._replace(brain="b", subject=second, week=23.0),
        brain._replace(brain="c", subject=first, week=24.0),
    ]
    with pytest.raises(InputError, check=Facts(label, first, second)):
        export_bids(tmp_path / "bids", scans, {}, "1", {})
    assert not (tmp_path / "bids").exists()


def test_runs_of_one_bids_label_are_refused_at_any_brains_and_weeks(tmp_path, brain):
    other = brain._replace(brain="case_2", subject="case_2")
    folded = [
        brain._replace(run="stiff-1", week=24.0),
        other._replace(run="stiff.1", week=25.0),
    ]
    with pytest.raises(InputError, check=Facts("stiff1", "stiff-1", "stiff.1")):
        export_bids(tmp_path / "bids", [brain, other, *folded], {}, "1", {})


def test_covariates_named_as_columns_of_the_export_stand_beside_these(tmp_path, brain):
    # a table often has the age at birth beside that at the scan
    covariates = {"gestational_age": "39.1", "brain": "left", "session_id": "b"}
    wide = pd.DataFrame(
        {
            "subject": ["case_1"],
            "week": [22.43],
            **{key: [text] for key, text in covariates.items()},
        }
    )
    export_bids(
        tmp_path,
        [brain._replace(covariates=covariates)],
        {"metrics_wide": wide},
        "1",
        {},
    )
    (row,) = pd.read_csv(tmp_path / "participants.tsv", sep="\t", dtype=str).to_dict(
        "records"
    )
    assert row == {
        "participant_id": "sub-case1",
        "gestational_age": "22.43",
        "brain": "case_1",
    } | {f"{key}_of_input": text for key, text in covariates.items()}
    (row,) = pd.read_csv(tmp_path / "metrics_wide.tsv", sep="\t").to_dict("records")
    assert (row["brain"], row["brain_of_input"], row["gestational_age_of_input"]) == (
        "case_1",
        "left",
        39.1,
    )


@pytest.mark.parametrize("kind", ["subject", "run"])
def test_a_name_without_letters_and_digits_has_no_label(tmp_path, brain, kind):
    with pytest.raises(InputError, check=Facts(kind, "--")):
        export_bids(
            tmp_path / "bids",
            [brain._replace(**{kind: "--"}, week=23.0), brain],
            {},
            "1",
            {},
        )


def test_subjects_are_handed_over_beside_others(tmp_path, brain):
    exported, folder, source = (
        tmp_path / name for name in ("exported", "out", "source")
    )
    export_bids(
        exported,
        scans_of_two(brain),
        TABLES_OF_TWO,
        "1",
        {"area": ("pial area", "cm2")},
    )
    page = tmp_path / "brains" / "sub-01_ses-1" / "figures" / "quality.png"
    page.parent.mkdir(parents=True)
    page.touch()
    (folder / "sub-07").mkdir(parents=True)
    (folder / "sub-01" / "anat").mkdir(parents=True)
    (folder / "sub-01" / "anat" / "of_another_program.nii").touch()
    source.mkdir()
    publish_derivatives(exported, folder, source, ["sub-01_ses-1"], whole=False)
    assert {path.name for path in folder.iterdir()} >= {
        "sub-07",
        "sub-01",
        "sub-02",
        ".bidsignore",
    }
    assert (folder / "sub-01" / "anat" / "of_another_program.nii").exists()
    assert (folder / "sub-01" / "figures" / "sub-01_ses-1_quality.png").exists()
    assert not (folder / "participants.tsv").exists()
    write_json(source / "dataset_description.json", {"DatasetDOI": "10.1/x"})
    (exported.parent / "report" / "brains").mkdir(parents=True)
    for name in ("sub-01_ses-1", "crl-22"):
        (exported.parent / "report" / "brains" / f"{name}.html").touch()
    # a session that is no more, of which a user has kept a note
    for path in (exported / "sub-01" / "ses-2").rglob("*.gii"):
        path.unlink()
    (folder / "sub-01" / "ses-2" / "note.txt").touch()
    # again and again: the note does not become one of the files that may be removed
    for _ in range(2):
        publish_derivatives(exported, folder, source, ["sub-01_ses-1"], whole=True)
    left = [
        path.name for path in (folder / "sub-01" / "ses-2").rglob("*") if path.is_file()
    ]
    assert left == ["note.txt"]
    assert (folder / "participants.tsv").exists()
    # the report leads to brains of an atlas, too
    assert {path.name for path in (folder / "brains").iterdir()} == {
        "sub-01_ses-1.html",
        "crl-22.html",
    }
    assert read_json(folder / "dataset_description.json")["SourceDatasets"] == [
        {"URL": "doi:10.1/x"}
    ]


def test_a_data_set_of_another_program_is_left(tmp_path, brain):
    exported, folder = tmp_path / "exported", tmp_path / "out"
    export_bids(exported, scans_of_two(brain), TABLES_OF_TWO, "1", {})
    write_json(
        folder / "dataset_description.json", {"GeneratedBy": [{"Name": "fMRIPrep"}]}
    )
    with pytest.raises(
        InputError, check=Facts(folder / "dataset_description.json", "OUT")
    ):
        publish_derivatives(exported, folder, tmp_path, [], whole=True)
    assert [path.name for path in folder.iterdir()] == ["dataset_description.json"]


TABLES_OF_TWO = {
    "metrics_wide": pd.DataFrame(
        {
            "subject": ["sub-01_ses-1"],
            "run": ["observed"],
            "week": [21.0],
            "area": [3.5],
        }
    ),
}


def labels_of(folder):
    """Return a volume of labels, and the sphere and its thickness that those of a
    simulated brain are made of."""
    files = {
        "labels": "labels.nii.gz",
        "surface": "whole.surf.gii",
        "thickness": "thickness.shape.gii",
    }
    files = {kind: str(folder / name) for kind, name in files.items()}
    write_label_volume(
        files["labels"],
        LabelVolume(np.ones((40, 40, 20), np.int32), scaling((1, 1, 2), -20)),
    )
    ball = sphere(10.0)
    write_surface(files["surface"], transformed(ball, POSE))
    write_vertex_maps(
        files["thickness"], {"thickness_mm": np.full(len(ball.vertices), 3.0)}
    )
    return files | {"labels": LabelSource(files["labels"], "auto", SCHEMES["binary"])}


def test_white_surfaces_lie_below_the_pial_ones(tmp_path, brain):
    """Both were posed by a quarter turn and a shift."""
    small = transformed(hemisphere(-1), np.diag([0.5, 0.5, 0.5, 1]))
    write_surface(tmp_path / "white.surf.gii", transformed(small, POSE))
    files = {
        "white": {"left": str(tmp_path / "white.surf.gii")},
        "white_maps": {"left": brain.maps["left"]},
    }
    export_bids(tmp_path / "bids", [brain._replace(**files)], {}, "1", {})
    place = tmp_path / "bids" / "sub-case1" / "anat"
    found = read_surface(place / "sub-case1_hemi-L_white.surf.gii")
    np.testing.assert_allclose(found.vertices, small.vertices, atol=1e-5)
    assert list(
        read_vertex_maps(place / "sub-case1_hemi-L_desc-white_sulc.shape.gii")
    ) == ["sulc"]
    assert "desc-white" in (tmp_path / "bids" / "descriptions.tsv").read_text()


def test_maps_at_the_vertices_of_a_template_say_whose_they_are(tmp_path, brain):
    folder, path = tmp_path / "bids", str(tmp_path / "left.template.shape.gii")
    write_vertex_maps(path, {"sulcal_depth_mm": np.arange(5.0)})
    scans = [
        one._replace(template="sub-01_ses-1", template_maps={"left": path})
        for one in scans_of_two(brain)
    ]
    export_bids(folder, [*scans, scans[1]._replace(run="a", week=25.0)], {}, "1", {})
    place = (
        folder
        / "sub-01"
        / "ses-2"
        / "anat"
        / "sub-01_ses-2_hemi-L_space-sub01ses1_den-5_sulc.shape.gii"
    )
    assert read_vertex_maps(place)["sulc"] == pytest.approx(-np.arange(5))
    assert place.with_name(place.name.replace("_sulc", "_desc-agw2500_sulc")).exists()
    assert read_json(folder / "space-sub01ses1_sulc.json") == {
        "Description": read_json(folder / "sulc.json")["Description"],
        "Units": "mm",
        "SpatialReference": {
            side: f"bids::sub-01/ses-1/anat/sub-01_ses-1_hemi-{side}_pial.surf.gii"
            for side in ("L", "R")
        },
    }


def test_labels_of_simulated_brains_are_in_the_grid_of_the_start(tmp_path, brain):
    folder, volume = tmp_path / "bids", labels_of(tmp_path)
    export_bids(
        folder, [brain, brain._replace(run="a", week=24.0, volume=volume)], {}, "1", {}
    )
    found = read_label_volume(
        folder / "sub-case1" / "anat" / "sub-case1_desc-agw2400_dseg.nii.gz"
    )
    start = volume["labels"].read()
    np.testing.assert_array_equal(found.affine, start.affine)
    assert found.labels.shape == start.labels.shape
    assert found.labels[20, 20, 10] == 1
    assert found.labels[28, 20, 10] == 2
    volumes = np.bincount(found.labels.ravel())[1:] * 2
    assert volumes == pytest.approx(
        [4 / 3 * np.pi * 7**3, 4 / 3 * np.pi * (10**3 - 7**3)], rel=0.05
    )


@pytest.mark.skipif(
    not VALIDATOR,
    reason="no bids-validator-deno on PATH: pip install bids-validator-deno",
)
def test_the_bids_validator_finds_no_error(tmp_path, brain):
    folder = tmp_path / "bids"
    more = {
        "white": brain.surfaces,
        "white_maps": brain.maps,
        "template": "sub-01_ses-1",
        "template_maps": brain.maps,
    }
    scans = [one._replace(**more) for one in scans_of_two(brain)]
    simulated = scans[0]._replace(
        white={}, white_maps={}, run="run-a", week=23.5, volume=labels_of(tmp_path)
    )
    export_bids(
        folder, [*scans, simulated], TABLES_OF_TWO, "1", {"area": ("pial area", "cm2")}
    )
    done = ran(VALIDATOR, folder, "--format", "json")
    found = json.loads(done.stdout)["issues"]["issues"]
    assert [issue for issue in found if issue["severity"] == "error"] == []
