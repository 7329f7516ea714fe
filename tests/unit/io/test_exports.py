"""Exports hold what was measured, under names of their own or of BIDS derivatives."""

import numpy as np
import pandas as pd
import pytest
from shapes import hemisphere

from gyriflow.errors import InputError
from gyriflow.io.exports import ExportedBrain, export_bids, export_plain
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_labels,
    read_vertex_maps,
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)

TABLES = {"metrics_wide": pd.DataFrame({"subject": ["case_1"], "area": [3.5], "depth": [np.nan]})}


@pytest.fixture
def brain(tmp_path):
    paths = {"surfaces": {}, "maps": {}, "regions": {}}
    for side, sign in (("left", -1), ("right", 1)):
        mesh = hemisphere(sign)
        files = {
            kind: str(tmp_path / f"{side}.{end}")
            for kind, end in (("surfaces", "pial.surf.gii"), ("maps", "shape.gii"), ("regions", "regions.label.gii"))
        }
        write_surface(files["surfaces"], mesh)
        number = np.arange(len(mesh.vertices))
        write_vertex_maps(files["maps"], {"sulcal_depth_mm": number / 7, "thickness_mm": number / 9})
        write_vertex_labels(files["regions"], number % 2, {1: "frontal"})
        for kind, path in files.items():
            paths[kind][side] = path
    return ExportedBrain("case_1", "real", 22.43, "case_1", **paths)


def test_bids_derivatives(tmp_path, brain):
    folder = tmp_path / "bids"
    simulated = ExportedBrain("case_1", "run-a", 22.43, "case_1", brain.surfaces, brain.maps, {})
    export_bids(folder, [brain, simulated], TABLES, "1.2.3")
    described = read_json(folder / "dataset_description.json")
    assert described["DatasetType"] == "derivative"
    assert described["GeneratedBy"] == [{"Name": "gyriflow", "Version": "1.2.3"}]
    place = folder / "sub-case1" / "ses-2243w" / "anat"
    names = {path.name for path in place.iterdir()}
    assert "sub-case1_ses-2243w_hemi-L_pial.surf.gii" in names
    assert "sub-case1_ses-2243w_acq-runa_hemi-R_thickness.shape.gii" in names
    assert len(names) == 2 * (1 + 2 + 1) + 2 * (1 + 2)
    np.testing.assert_allclose(
        read_surface(place / "sub-case1_ses-2243w_hemi-R_pial.surf.gii").vertices, hemisphere(1).vertices, atol=1e-5
    )
    depth = read_vertex_maps(place / "sub-case1_ses-2243w_hemi-L_sulc.shape.gii")
    assert list(depth) == ["sulcal_depth_mm"]
    np.testing.assert_allclose(depth["sulcal_depth_mm"][:3], [0, 1 / 7, 2 / 7], rtol=1e-6)
    _, regions = read_vertex_labels(place / "sub-case1_ses-2243w_hemi-L_desc-regions_dseg.label.gii")
    assert regions == {1: "frontal"}
    assert (folder / "metrics_wide.tsv").read_text() == "subject\tarea\tdepth\ncase_1\t3.5\tn/a\n"
    assert (folder / "participants.tsv").read_text() == "participant_id\nsub-case1\n"


def test_brains_of_one_bids_name_are_refused(tmp_path, brain):
    same = ExportedBrain("case-1", "real", 22.43, "case-1", brain.surfaces, brain.maps, {})
    with pytest.raises(InputError, match="case_1 and case-1"):
        export_bids(tmp_path / "bids", [brain, same], {}, "1")


def test_plain_names_are_those_of_the_results(tmp_path, brain):
    folder = tmp_path / "plain"
    export_plain(folder, [brain], TABLES)
    place = folder / "case_1" / "real" / "week-22.43"
    assert {path.name for path in place.iterdir()} == {
        f"{side}.{end}" for side in ("left", "right") for end in ("pial.surf.gii", "shape.gii", "regions.label.gii")
    }
    assert (folder / "metrics_wide.csv").exists()


def test_a_hemisphere_that_is_alone_and_maps_of_any_name_are_exported(tmp_path, brain):
    left, maps = {"left": brain.surfaces["left"]}, {"left": str(tmp_path / "own.shape.gii")}
    write_vertex_maps(maps["left"], {"distance_to_pial_mm": np.zeros(3)})
    export_bids(tmp_path / "bids", [ExportedBrain("case_1", "real", 22.43, "case_1", left, maps, {})], {}, "1")
    names = {path.name.removeprefix("sub-case1_ses-2243w_") for path in (tmp_path / "bids").glob("sub-*/*/anat/*")}
    assert names == {"hemi-L_pial.surf.gii", "hemi-L_desc-DistanceToPialMm_shape.shape.gii"}
