"""Labels filled from surfaces of known shape, and their registration with a brain of
labels in another pose."""

import numpy as np
import pytest
from atlas_brains import atlas_labels
from facts import Facts
from scipy.linalg import polar
from shapes import (
    cerebrum_surface,
    ellipsoid,
    inner,
    moved,
    octasphere,
    rigid,
    sphere,
)

from gyriflow.anatomy.fissure import split
from gyriflow.anatomy.thickness import filled_labels
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.deformations import carry, transform_points
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.triangles import (
    TriangleMesh,
    flipped,
    merged,
    transformed,
    volume_ml,
)
from gyriflow.growth.registration import channels, register_and_measure, require_good
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.schemes import FILLED

CORTEX_MM = 2.5


def millilitres(labels, affine):
    """Return the volumes of cortex and of the tissue inside."""
    return [(labels == label).sum() * affine[0, 0] ** 3 / 1000 for label in (2, 1)]


@pytest.mark.parametrize("has_white", [True, False])
def test_cortex_and_inside_have_the_volumes_between_and_within_known_surfaces(
    has_white,
):
    whole = ellipsoid((22.0, 28.0, 24.0), 4)
    white = inner(whole, CORTEX_MM)
    # its triangles may be in either order
    layer = {"whites": [flipped(white)]} if has_white else {"thickness_mm": CORTEX_MM}
    labels = filled_labels(whole, split(whole, 0.0), 0.0, voxel_mm=1.0, **layer)
    cortex, inside = millilitres(*labels)
    assert inside == pytest.approx(volume_ml(white), rel=0.02)
    assert cortex == pytest.approx(volume_ml(whole) - volume_ml(white), rel=0.04)


def test_halves_that_nearly_touch_are_joined_at_the_midline_and_caps_have_no_cortex():
    whole = octasphere(20.0, 4)
    halves = split(whole, 0.0)
    caps = [
        TriangleMesh(part.vertices * [0.0, 1.0, 1.0], part.faces[:, ::-1])
        for part in halves
    ]

    def filled(gap_mm):
        shifts = (-gap_mm / 2, gap_mm / 2)
        sides = [moved(half, shift) for half, shift in zip(halves, shifts, strict=True)]
        closed = [moved(cap, shift) for cap, shift in zip(caps, shifts, strict=True)]
        return filled_labels(
            merged(*sides, *closed), sides, 0.0, thickness_mm=CORTEX_MM, voxel_mm=1.0
        )

    shut, near, (volume, grid) = filled(0.0), filled(1.0), filled(6.0)
    core = 4 / 3 * np.pi * (20.0 - CORTEX_MM) ** 3 / 1000
    cortex, inside = millilitres(*shut)
    assert inside == pytest.approx(core, rel=0.02)
    # the slit of a millimetre becomes tissue inside, with cortex at its rim only
    slit = 0.1 * np.pi * 1.75**2
    rim = 0.1 * np.pi * 2.0**2 - slit
    assert millilitres(*near) == pytest.approx([cortex + rim, core + slit], rel=0.03)
    # a wide gap stays, and the caps beside it are bare
    places = transform_points(np.array([[0.0, 0, 0], [4.0, 0, 0]]), np.linalg.inv(grid))
    assert volume[tuple(np.rint(places).astype(int).T)].tolist() == [0, 1]
    assert sum(millilitres(volume, grid)) == pytest.approx(volume_ml(whole), rel=0.02)


def test_there_is_no_cortex_where_white_and_pial_surfaces_coincide():
    whole = sphere(20.0, 4)
    bare = whole.vertices[:, 2] < 0
    depth = np.where(bare, 0.1, CORTEX_MM)
    white = TriangleMesh(whole.vertices * (1 - depth / 20.0)[:, None], whole.faces)
    labels, affine = filled_labels(whole, [whole], 0.0, whites=[white], voxel_mm=1.0)
    z = transform_points(np.argwhere(labels == 2), affine)[:, 2]
    assert (z > -1.5).all()
    assert (z > 2.0).mean() > 0.8


def test_a_filled_brain_registers_with_labels_in_an_oblique_pose_without_their_cortex(
    caplog,
):
    # the cortex of the shipped brains is thinner than these voxels
    surface, (labels, grid) = cerebrum_surface(*atlas_labels(24.0)), atlas_labels(25.0)
    voxel, x = np.abs(grid[:3, :3]).max(), surface.vertices[:, 0].mean()
    filled, affine = filled_labels(surface, split(surface, x), x, voxel_mm=voxel)
    pose = rigid(50.0, -35.0, 70.0, shift=(30.0, -9.0, 4.0))
    brains = []
    for volume, its_grid, scheme in (
        (filled, affine, FILLED),
        (labels, pose @ grid, SCHEMES["spina-bifida-atlas"]),
    ):
        tissues = {"cerebrum": scheme.cerebrum, "cortex": scheme.cortex}
        brains.append(channels(volume, its_grid, **tissues))
    found, quality = register_and_measure(*brains, is_filled=True)
    require_good(quality, pair="24 to 25")
    assert found.channels == ("cerebrum",)
    assert caplog.messages == [Facts("0.60")]
    turn, _ = polar(found.deformation.matrix[:3, :3])
    assert angle_deg(turn @ pose[:3, :3].T) < 6.0
    later = transformed(cerebrum_surface(labels, grid), pose)
    distance, _, _ = nearest_on(carry(found.deformation, surface.vertices), later)
    assert distance.mean() < 0.6 * voxel
    # two brains of labels would be refused
    _, quality = register_and_measure(*brains, is_filled=False)
    with pytest.raises(InputError, check=Facts("cortex", 0.6)):
        require_good(quality, pair="24 to 25")
