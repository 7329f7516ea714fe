"""Maps of parameters: what files say per vertex or voxel, or a refusal that names the file."""

import nibabel as nib
import numpy as np
import pytest
from nibabel.gifti import GiftiDataArray, GiftiImage
from shapes import moved, rigid, sphere

from gyriflow.errors import InputError
from gyriflow.io.surfaces import read_surface_map, read_surface_maps, write_surface, write_vertex_maps
from gyriflow.io.tetmeshes import read_maps, write_maps
from gyriflow.io.volumes import read_volume_map


@pytest.fixture
def ball(tmp_path):
    ball = sphere(10.0, 2)
    for name in ("ball.surf.gii", "ball.ply", "ball.obj", "ball.stl"):
        write_surface(tmp_path / name, ball)
    return ball


def gifti(path, *arrays, intent="NIFTI_INTENT_SHAPE"):
    nib.save(GiftiImage(darrays=[GiftiDataArray(array, intent=intent) for array in arrays]), path)
    return path


@pytest.mark.parametrize("name", ["ball.surf.gii", "ball.ply", "ball.obj"])
def test_a_maps_values_stay_at_their_vertices(tmp_path, ball, name):
    write_vertex_maps(tmp_path / "x.shape.gii", {"x": ball.vertices[:, 0]})
    surface, values = read_surface_map(tmp_path / "x.shape.gii", tmp_path / name)
    assert values == pytest.approx(ball.vertices[:, 0], abs=1e-5)
    assert surface.vertices[:, 0] == pytest.approx(values, abs=1e-5)
    assert np.array_equal(surface.faces, ball.faces)


def test_maps_of_two_hemispheres_stand_side_by_side(tmp_path, ball):
    write_surface(tmp_path / "other.surf.gii", moved(ball, 50.0))
    paths = [tmp_path / "a.shape.gii", tmp_path / "b.shape.gii"]
    for path, value in zip(paths, (1.0, 2.0), strict=True):
        write_vertex_maps(path, {"x": np.full(len(ball.vertices), value)})
    surface, values = read_surface_maps(paths, [tmp_path / "ball.surf.gii", tmp_path / "other.surf.gii"])
    assert len(surface.faces) == 2 * len(ball.faces)
    assert (values == np.where(surface.vertices[:, 0] < 25, 1.0, 2.0)).all()


def saved(path, values, affine=None, unit="mm"):
    image = nib.Nifti1Image(values, np.diag([0.8, 0.9, 1.0, 1.0]) if affine is None else affine)
    image.header.set_xyzt_units(unit)
    nib.save(image, path)
    return path


def test_a_volume_keeps_fractions_nan_and_its_oblique_affine(tmp_path):
    values = np.random.default_rng(0).normal(size=(4, 5, 6)).astype(np.float32)
    values[0, 0, 0] = np.nan
    oblique = rigid(20, -30, 40) @ np.diag([0.8, 0.8, 0.8, 1.0])
    metres = np.diag([1e-3, 1e-3, 1e-3, 1.0]) @ oblique
    volume = read_volume_map(saved(tmp_path / "a.nii.gz", values[..., None], metres, "meter"))
    np.testing.assert_array_equal(volume.values, values)
    assert volume.affine == pytest.approx(oblique, abs=1e-5)


def test_maps_on_a_mesh_come_back_exactly(tmp_path):
    maps = {"thickness_mm": np.random.default_rng(0).normal(size=50), "growth_rate_per_s": np.full(50, 2e-7)}
    write_maps(tmp_path / "maps.h5", maps)
    back = read_maps(tmp_path / "maps.h5")
    assert set(back) == set(maps)
    for name, values in maps.items():
        np.testing.assert_array_equal(back[name], values)
        assert back[name].dtype == np.float64


@pytest.mark.parametrize(
    ("name", "counts", "surface", "said"),
    [
        ("a.shape.gii", [100], "ball.surf.gii", r"a\.shape\.gii.*100 values.*162.*ball\.surf\.gii"),
        ("a.func.gii", [], "ball.surf.gii", r"a\.func\.gii.*one array"),
        ("a.func.gii", [162, 162], "ball.surf.gii", r"a\.func\.gii.*one array"),
        ("a.shape.gii", [162], "ball.stl", r"ball\.stl.*GIFTI"),
        ("ball.surf.gii", None, "ball.surf.gii", r"POINTSET \(162, 3\), NIFTI_INTENT_TRIANGLE \(320, 3\)"),
    ],
)
def test_what_is_no_map_of_a_surface_is_refused(tmp_path, ball, name, counts, surface, said):
    if counts is not None:
        gifti(tmp_path / name, *[np.ones(count, np.float32) for count in counts])
    with pytest.raises(InputError, match=said):
        read_surface_map(tmp_path / name, tmp_path / surface)
