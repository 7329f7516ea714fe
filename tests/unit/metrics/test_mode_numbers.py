"""Numbers of modes: Weyl's, the common one, and what completes B6."""

import numpy as np
import pandas as pd
import pytest
import trimesh

from gyriflow.geometry.triangles import TriangleMesh, area
from gyriflow.metrics.laplace_beltrami import Modes, laplacian
from gyriflow.metrics.mode_numbers import common_modes, modes_of, weyl_numbers
from gyriflow.metrics.spangy import bands_of_modes, first_eigenvalue, spectrum, weyl_number


def ball(radius_mm: float, stretch: float = 1.0, subdivisions: int = 4) -> TriangleMesh:
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius_mm)
    return TriangleMesh(shape.vertices * [1.0, stretch, 1.0], shape.faces)


def test_weyl_numbers_of_spheres() -> None:
    found = weyl_numbers({"left": ball(20.0), "right": ball(30.0)}, "textbook").set_index("hemisphere")
    np.testing.assert_allclose(found["area_mm2"], 4 * np.pi * np.array([20.0, 30.0]) ** 2, rtol=5e-3)
    np.testing.assert_allclose(found["first_eigenvalue_per_mm2"], 2 / np.array([20.0, 30.0]) ** 2, rtol=5e-3)
    # the number does not know the size
    np.testing.assert_allclose(found["weyl_number"], 8192, rtol=5e-3)
    assert found["vertices"].tolist() == [2562, 2562]


def test_the_common_number_is_the_largest_of_each_side() -> None:
    numbers = pd.DataFrame({"hemisphere": ["left", "right"] * 2, "weyl_number": [700, 810, 790, 640]})
    assert common_modes(numbers) == {"left": 790, "right": 810}


def found(choice, mesh: TriangleMesh) -> tuple[Modes, float]:
    stiffness, mass = laplacian(mesh)
    return modes_of(choice, "left", mesh, stiffness, mass, first_eigenvalue(stiffness, mass), "paper")


def wanted(choice, mesh: TriangleMesh) -> int:
    return len(found(choice, mesh)[0].eigenvalues)


def test_which_number_is_taken() -> None:
    mesh = ball(20.0)  # of 2562 vertices; Weyl's number of a sphere is 1304
    assert wanted({"left": 200, "right": 3}, mesh) == 200
    assert wanted({"left": 9000, "right": 3}, mesh) == 2562 // 2
    assert wanted("own", mesh) == 2562 // 2
    assert wanted(700, mesh) == 700
    elongated = ball(4.0, stretch=30.0)
    first = first_eigenvalue(*laplacian(elongated))
    assert wanted("own", elongated) == weyl_number(area(elongated), first, "paper") < 2562 // 2


def test_a_band_stands_for_all_modes_up_to_its_end_on_a_sphere() -> None:
    # λ = l(l + 1)/R², λ1 = 2/R²: below 2·4⁴/R² lie l = 0 to 21, each 2l + 1 times, and l = 22 by so little that the
    # finite elements lift it out
    assert wanted("B4", ball(20.0, subdivisions=5)) == 22**2


@pytest.mark.parametrize("last", [4, 5, 6])
def test_bands_are_held_entirely_with_no_more_modes_than_needed(last: int) -> None:
    # elongated, so that few modes lie below 4⁶ λ1
    mesh = ball(4.0, stretch=9.0)
    modes, reach = found(f"B{last}", mesh)
    bands = spectrum(mesh.vertices[:, 1], modes, laplacian(mesh)[1], edge_length_mm=1.0, reach=reach).bands
    assert bands["complete"].tolist() == [band <= last for band in range(7)]
    assert bands["denominator_complete"].all()
    # no band holds a mode that only shows that the one before is complete
    assert bands.loc[last + 1 :, "modes"].tolist() == [0] * (6 - last)
    assert (bands_of_modes(modes.eigenvalues) >= 0).all()


@pytest.mark.parametrize("subdivisions", [2, 3])
def test_a_coarse_surface_has_no_complete_b6(subdivisions: int) -> None:
    mesh = ball(20.0, subdivisions=subdivisions)
    assert wanted("B6", mesh) == len(mesh.vertices) // 2
