"""The mid-plane and the fissure of shifted, turned and asymmetric brains, and left and
right of closed surfaces."""

import numpy as np
import odd_brains
import pytest
from facts import Facts
from phantoms import CENTRE_MM
from scipy import ndimage
from shapes import (
    cerebrum_surface,
    ellipsoid,
    moved,
    phantom,
    rigid,
    scaling,
    sphere,
)

from gyriflow.anatomy.extraction import handles, isosurface, smooth_mask
from gyriflow.anatomy.fissure import (
    MidPlane,
    cut_sides,
    fissure_between,
    hidden_fissure,
    largest_pieces,
    left_faces,
    mid_plane,
    open_fissure,
    separate,
    side_distance,
    smallest_gap,
)
from gyriflow.anatomy.pial import from_labels
from gyriflow.anatomy.repair import pieces
from gyriflow.errors import InputError
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import (
    area,
    corners,
    face_areas,
    merged,
    submesh,
    transformed,
)
from gyriflow.io.yaml_files import SCHEMES

ELLIPSOID = ellipsoid((24.0, 33.0, 22.0))
BALL = sphere(10.0, 3)


def heights_of(mesh):
    """Return the x of each face: its height above a fissure x = 0."""
    return corners(mesh).mean(axis=1)[:, 0]


def test_two_closed_pieces_are_the_hemispheres_though_they_reach_over_the_plane():
    mesh = merged(moved(BALL, -8.0), moved(BALL, 12.5))
    left = left_faces(mesh, heights_of(mesh))
    assert left.tolist() == [True] * 1280 + [False] * 1280


@pytest.mark.parametrize(("radius_mm", "is_refused"), [(4.0, False), (8.7, True)])
def test_a_lump_beside_a_connected_brain_is_left_out_or_refused(radius_mm, is_refused):
    lump = sphere(radius_mm, 3, (-38.0, 0.0, 0.0))
    # the brain's middle is a little off the plane, on the other side than the lump
    mesh = merged(moved(ELLIPSOID, 0.5), lump)
    left = left_faces(mesh, heights_of(mesh))
    sides, to_file = {"left": left, "right": ~left}, rigid(shift=(100.0, 0.0, 0.0))
    percent = f"{100 * area(lump) / face_areas(mesh)[left].sum():.1f} %"
    facts = Facts("left", "2 pieces", percent, "(62, 0, 0)")
    if is_refused:
        with pytest.raises(InputError, check=facts):
            largest_pieces(mesh, sides, to_file)
        return
    kept, (warning,) = largest_pieces(mesh, sides, to_file)
    assert warning == facts
    assert len(pieces(submesh(mesh, kept)[0])) == 1


def test_stray_patches_leave_each_hemisphere_in_one_piece():
    x, y, z = corners(BALL).mean(axis=1).T
    # rings of the right within the left, and of the left within those
    from_pole = np.hypot(x + 10.0, y)
    rings = np.sin(from_pole * 3.0) + 0.2 * np.sin(9.0 * z)
    left = left_faces(BALL, np.where(from_pole < 4.0, rings, x))
    assert [len(pieces(side)) for side in cut_sides(BALL, left)] == [1, 1]
    assert left[x < -5.0].all()


@pytest.mark.usefixtures("few_starts")
def test_a_brain_of_one_piece_is_cut_in_its_fissure():
    labels, affine = phantom(24.0, 2.0)
    mesh = cerebrum_surface(odd_brains.bent_midline(labels, affine), affine)
    fissure = fissure_between(mesh, mid_plane(mesh))
    left = left_faces(mesh, fissure.height_above(corners(mesh).mean(axis=1)))
    assert [len(pieces(side)) for side in cut_sides(mesh, left)] == [1, 1]
    x, y, _ = (corners(mesh).mean(axis=1) - CENTRE_MM).T
    from_middle = x - 3.0 * np.sin(y / 12.0)
    wrong = np.where(left, from_middle, -from_middle) > 1.5
    assert face_areas(mesh)[wrong].sum() < 0.005 * area(mesh)


def test_cuts_that_do_not_part_the_surface_are_refused():
    with pytest.raises(InputError, check=Facts("37 %", "5 %")):
        left_faces(BALL, np.sin(heights_of(BALL) * 1.2))
    count = len(BALL.faces)
    for is_left in (True, False):
        with pytest.raises(InputError, check=Facts(f"{count * is_left} of {count}")):
            cut_sides(BALL, np.full(count, is_left))


MIDDLE = MidPlane(np.array([1.0, 0.0, 0.0]), 18.0, 0.0, 0)
"""The plane in the middle of the blocks below."""
AFFINE = scaling(0.9)


def block(gap_voxels):
    """Return two blocks of core in cortex, joined by a bar, with a gap of CSF between
    their cortex."""
    brain, core = np.zeros((2, 41, 40, 30), dtype=bool)
    brain[4:37, 4:36, 4:26] = True
    core[6:18, 6:34, 6:24] = core[23:35, 6:34, 6:24] = core[18:23, 12:28, 6:12] = True
    gap = slice(20 - gap_voxels // 2, 20 - gap_voxels // 2 + gap_voxels)
    brain[gap, :, 14:] = brain[gap, :10] = brain[gap, 30:] = False
    return brain, core


def hidden_and_opened(brain, core, field, **options):
    """Return where the fissure of blocks is hidden, and their mask after it was
    opened in a field."""
    fissure = fissure_between(isosurface(smooth_mask(core), AFFINE), MIDDLE)
    side_mm = side_distance(brain, core, AFFINE, fissure)
    hidden = hidden_fissure(side_mm, brain, core, AFFINE, **options)
    distance = np.full(brain.shape, np.inf)
    if hidden.any():
        distance = ndimage.distance_transform_edt(~hidden, sampling=0.9)
    return hidden, open_fissure(field, AFFINE, side_mm, distance) > 0.5


@pytest.mark.parametrize(("gap_voxels", "is_opened"), [(0, True), (1, False)])
def test_only_a_fissure_that_is_hidden_is_opened(gap_voxels, is_opened):
    brain, core = block(gap_voxels)
    field = smooth_mask(brain, 0.5)
    _, left = hidden_and_opened(brain, core, field)
    # cortex beside a fissure that CSF shows stays; a hidden one is opened
    taken = (field > 0.5) & ~left
    assert taken[18:23, 15:25, 17:24].any() == is_opened
    assert not left[20, 20, 17:24].any()


def test_a_hidden_fissure_is_opened_where_no_tissue_joins_the_hemispheres():
    brain, core = block(0)
    core[18:23] = False
    hidden, _ = hidden_and_opened(brain, core, smooth_mask(brain))
    # from one end of the brain to the other, in layers beside the middle
    assert hidden[20, 8:32, 8:22].all()
    assert not hidden[:18].any()
    assert not hidden[23:].any()


def test_tissue_that_crosses_a_fissure_is_opened():
    brain, core = block(1)
    # no cortex between the tissue that joins the hemispheres and what lies below
    core[18:23, 12:28, 4:6] = True
    brain[20, 18:21, 25] = True
    field = brain.astype(np.float32)
    _, left = hidden_and_opened(brain, core, field, bridges=True)
    assert (handles(brain), handles(left)) == (1, 0)
    assert (brain & ~left)[:, :, 17:].sum() == 3


@pytest.mark.parametrize(("overlap_mm", "is_refused"), [(18.5, False), (20.5, True)])
def test_hemispheres_are_moved_apart_by_at_most_a_centimetre_each(
    overlap_mm, is_refused
):
    # along a direction that is no axis
    to_right = np.array([0.8, 0.6, 0.0])
    left, right = (
        sphere(15.0, 3, side * (15.0 - overlap_mm / 2) * to_right) for side in (-1, 1)
    )
    if is_refused:
        with pytest.raises(InputError, check=Facts("20 mm")):
            separate(left, right, 0.5, to_right)
        return
    first, second, moved_mm = separate(left, right, 0.5, to_right)
    assert moved_mm == pytest.approx(overlap_mm / 2 + 0.25, abs=0.3)
    assert smallest_gap(first, second) >= 0.5
    assert first.vertices == pytest.approx(left.vertices - moved_mm * to_right)
    assert second.vertices == pytest.approx(right.vertices + moved_mm * to_right)


@pytest.fixture(scope="module")
def centred():
    """The phantom's surface, whose fissure is x = 0."""
    return moved(cerebrum_surface(*phantom(24.0, 2.0)), *-CENTRE_MM)


def angle_to(plane, normal):
    cosine = plane.normal @ normal / np.linalg.norm(normal)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def test_turned_and_shifted_brain(centred):
    matrix = rigid(30, 20, -30, shift=(31.0, -4.0, 9.0))
    plane = mid_plane(transformed(centred, matrix))
    assert angle_to(plane, matrix[:3, 0]) < 1.0
    # the origin of the unmoved brain lies in its fissure
    assert plane.offset - plane.normal @ matrix[:3, 3] == pytest.approx(0.0, abs=0.4)
    assert plane.fissure_points > 500


def test_named_coordinates_are_kept_by_a_body_with_many_mirror_planes(centred):
    # of coarse and uneven triangles, a body of revolution about y
    body = remesh(ellipsoid((30.0, 36.0, 30.0), 3), 2.5)
    x_axis = np.array([1.0, 0, 0])
    plane = mid_plane(body, named=True)
    assert angle_to(plane, x_axis) == pytest.approx(0.0, abs=1e-6)
    # a brain has one plane, in whatever coordinates
    rotation = rigid(0, 15, -25)
    plane = mid_plane(transformed(centred, rotation), named=True)
    assert angle_to(plane, rotation[:3, 0]) < 1.0


@pytest.mark.usefixtures("few_starts")
def test_a_mask_whose_fissure_is_closed_is_reported_and_its_sulci_stay_fused():
    x, y, z = 2.0 * np.indices((28, 33, 28)) - np.reshape([28, 33, 28], (3, 1, 1, 1))
    mask = (x / 23) ** 2 + (y / 28) ** 2 + (z / 22) ** 2 < 1
    volume = mask.astype(np.int32), scaling(2.0), SCHEMES["binary"]
    surface = from_labels(*volume, week=24.0, edge_length_mm=4.0, open_sulci=True)
    assert surface.report["cut_share"] == pytest.approx(1.0, abs=0.03)
    facts = Facts("midline", "100 %", "33 %", "week 24")
    warnings = surface.report["warnings"]
    assert facts in warnings
    reason = surface.report["sulci"]["stays_fused"]
    assert reason == "the labels have no white matter"
    # at this week most sulci are open anyway
    assert reason not in " ".join(warnings)
