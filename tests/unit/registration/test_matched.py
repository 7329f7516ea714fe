import numpy as np
import pytest
import trimesh
from shapes import ellipsoid_mesh

from gyriflow.errors import InputError
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.io.registrations import CarriedMesh, read_carried_mesh, write_carried_mesh
from gyriflow.registration.growth import local_growth
from gyriflow.registration.matched_surfaces import follow_inside, follow_surfaces, positions_by_week

ATLAS = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
FACES = np.asarray(ATLAS.faces)
STRETCH = np.array([1.2, 1.1, 1.0])
WEEKS = np.stack([ATLAS.vertices, ATLAS.vertices * STRETCH])


def test_matched_surfaces_are_ordered_by_week():
    surfaces = {23.0: TriangleMesh(WEEKS[1], FACES), 21.0: TriangleMesh(WEEKS[0], FACES)}
    weeks, positions = positions_by_week(surfaces)
    assert weeks == [21.0, 23.0]
    assert np.array_equal(positions, WEEKS)
    surfaces[22.0] = TriangleMesh(WEEKS[0], FACES[::-1])
    with pytest.raises(InputError, match="week 22 has other vertices or faces than that of week 21"):
        positions_by_week(surfaces)


def test_another_mesh_of_the_brain_goes_along():
    own = trimesh.creation.icosphere(subdivisions=3, radius=10.1)
    turned = own.vertices @ np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1.0]])
    found = follow_surfaces(TriangleMesh(turned, own.faces), WEEKS, FACES)
    assert found[0] == pytest.approx(turned)
    assert found[1] == pytest.approx(turned * STRETCH, abs=0.05)
    with pytest.raises(InputError, match="is not that of the matched surfaces' first week"):
        follow_surfaces(TriangleMesh(turned * 1.5, own.faces), WEEKS, FACES)


def test_the_inside_goes_along_smoothly():
    solid = ellipsoid_mesh(8, (10.0, 10.0, 10.0))
    found = follow_inside(solid, WEEKS, FACES)
    # a linear displacement is harmonic
    assert found[1] == pytest.approx(solid.vertices * STRETCH, abs=0.05)
    rates = local_growth(found, solid.tets, [21, 23], 3.0)
    assert rates[0] == pytest.approx(np.full(len(solid.vertices), np.log(1.32) / 2), abs=0.02)


def test_carried_meshes_are_read_as_written(tmp_path):
    solid = ellipsoid_mesh(4, (10.0, 10.0, 10.0))
    _, used = boundary_surface(solid)
    area = np.full((1, len(solid.vertices)), np.nan)
    area[:, used] = 0.1
    carried = CarriedMesh(
        np.array([21.0, 22.5]),
        np.stack([solid.vertices, 1.1 * solid.vertices]),
        {6.0: {"area": area, "volume": np.full_like(area, 0.2)}, 2.5: {"area": area}},
    )
    write_carried_mesh(tmp_path / "carried.h5", carried)
    read = read_carried_mesh(tmp_path / "carried.h5")
    assert read.weeks.tolist() == [21.0, 22.5]
    assert read.positions == pytest.approx(carried.positions, abs=1e-5)
    assert set(read.growth) == {2.5, 6.0}
    assert np.array_equal(read.growth[6.0]["area"], area, equal_nan=True)
    (tmp_path / "torn.h5").write_bytes(b"torn")
    with pytest.raises(InputError, match=r"torn\.h5: cannot be read as a carried mesh"):
        read_carried_mesh(tmp_path / "torn.h5")
