"""Growth of a week, and its standard deviation over an ensemble."""

import h5py
import numpy as np
import pytest

from gyriflow.growth.rates import growth_per_week, growth_sd
from gyriflow.io.frames import read_pial_frames
from gyriflow.units import SECONDS_PER_GW

CORNERS = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
INSIDE = np.array([[2.0, 2, 2]])


@pytest.fixture
def frames(tmp_path):
    """A tetrahedron of four, with a node inside, that grows by a fifth from 21 to 22
    GW."""
    path = tmp_path / "frames.h5"
    with h5py.File(path, "w") as file:
        file["tets"] = [[0, 1, 2, 4], [0, 1, 4, 3], [0, 4, 2, 3], [4, 1, 2, 3]]
        for week, size in ((21, 1.0), (22, 1.2)):
            group = file.create_group(f"week_{week}.00")
            group["positions"] = size * np.concatenate([CORNERS, INSIDE])
            group["tangential_growth_per_step"] = [0.01] * 4 + [9.0]
            group["radial_growth_per_step"] = [0.02] * 4 + [9.0]
            group["growth_direction_per_step"] = np.eye(5, 3)
            group["cell_fields/J"] = np.ones(4)
    return str(path)


def test_growth_is_that_of_a_week_up_to_the_later_frame(frames):
    ((interval, maps),) = growth_per_week(
        read_pial_frames(frames), SECONDS_PER_GW / 4
    ).items()
    assert interval == (21.0, 22.0)
    # four steps a week, in both directions of the surface
    assert maps["area_growth_percent_per_gw"] == pytest.approx(
        np.full(4, 100 * np.expm1(2 * 4 * 0.01))
    )
    assert maps["thickness_growth_percent_per_gw"] == pytest.approx(
        np.full(4, 100 * np.expm1(4 * 0.02))
    )
    assert maps["growth_direction_y"] == pytest.approx([0, 4, 0, 0])
    repeats = [maps, {name: values + 2.0 for name, values in maps.items()}]
    found = growth_sd(maps, repeats)
    assert set(found) == {
        "area_growth_percent_per_gw",
        "thickness_growth_percent_per_gw",
    }
    assert found["area_growth_percent_per_gw"] == pytest.approx(np.full(4, np.sqrt(2)))
    assert np.isnan(growth_sd(maps, repeats[:1])["area_growth_percent_per_gw"]).all()
