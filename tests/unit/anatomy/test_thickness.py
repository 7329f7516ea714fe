"""Cortical thickness from labels and white surfaces, on layers of known thickness;
white surfaces of spheres, and labels filled from surfaces of known shape."""

from functools import cache

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
    scaling,
    sphere,
)

from gyriflow.anatomy.extraction import smooth_mask
from gyriflow.anatomy.fissure import split
from gyriflow.anatomy.labels import read_cerebrum
from gyriflow.anatomy.repair import surface_of_mask
from gyriflow.anatomy.thickness import (
    Cortex,
    cortex_of,
    filled_labels,
    thickness_from_labels,
    thickness_from_white,
    white_from_labels,
    white_from_surfaces,
)
from gyriflow.errors import InputError
from gyriflow.geometry.alignment import angle_deg
from gyriflow.geometry.deformations import carry, transform_points
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    flipped,
    merged,
    transformed,
    volume_ml,
)
from gyriflow.growth import registration
from gyriflow.growth.registration import channels, register_and_measure, require_good
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.settings.schemes import FILLED, LabelScheme
from gyriflow.settings.terms import SIDES

VOXEL_MM, RADIUS_MM = 0.8, 16.0


@pytest.fixture(scope="module")
def ball():
    """A ball: its pial surface, the depth and the mask of its voxels, and their
    affine."""
    axis = np.arange(-RADIUS_MM - 4, RADIUS_MM + 4, VOXEL_MM) + 0.13
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    depth = RADIUS_MM - np.linalg.norm(points, axis=-1)
    inside, affine = depth > 0, scaling(VOXEL_MM, axis[0])
    volume = inside.sum() * VOXEL_MM**3
    pial = surface_of_mask(smooth_mask(inside), affine, volume, 1.0).mesh
    return pial, depth, inside, affine


def test_a_layer_between_concentric_spheres_is_measured_to_a_hundredth_on_average(
    ball, caplog
):
    pial, depth, inside, affine = ball
    thickness_mm = 1.7
    cortex = Cortex(inside, inside & (depth < thickness_mm), affine)
    found = thickness_from_labels(cortex, pial, Pose())
    assert found.is_measured.mean() > 0.99
    error = found.values_mm[found.is_measured] - thickness_mm
    assert abs(error.mean()) < 0.02
    assert error.std() < 0.12
    assert found.report["mean_mm"] == pytest.approx(thickness_mm, abs=0.02)
    through = found.report["voxels_through_cortex"]
    assert through == pytest.approx(thickness_mm / VOXEL_MM, rel=0.02)
    assert caplog.messages == []


def test_what_has_no_cortex_takes_the_value_of_its_neighbours_and_is_reported(ball):
    pial, depth, inside, affine = ball
    x = affine[0, 3] + 0.8 * np.arange(inside.shape[0])
    cortex = inside & (depth < 2.4) & (x < RADIUS_MM / 2)[:, None, None]
    found = thickness_from_labels(Cortex(inside, cortex, affine), pial, Pose())
    # a cap of a quarter of the sphere's area is bare
    assert found.report["measured_area_share"] == pytest.approx(0.75, abs=0.03)
    bare = pial.vertices[:, 0] > RADIUS_MM / 2 + 2
    assert not found.is_measured[bare].any()
    assert (found.values_mm > 0.8 / 3).all()
    edge = found.is_measured & (pial.vertices[:, 0] > RADIUS_MM / 2 - 3)
    assert np.isin(found.values_mm[bare], found.values_mm[edge]).all()


def thickness_of(labels, ball):
    """Return the thickness of the cortex, 5, in labels of the ball."""
    pial, _, _, affine = ball
    scheme = LabelScheme(name="a", cerebrum=(1, 5), cortex=(5,))
    cortex = cortex_of(read_cerebrum(labels, affine, scheme), scheme)
    return thickness_from_labels(cortex, pial, Pose())


@pytest.mark.parametrize(
    ("thickness_mm", "message"),
    [(8.0, Facts("cortex", "8.0 mm")), (0.9, Facts("cortex", "1.1 voxels"))],
)
def test_a_cortex_of_no_usual_thickness_or_of_about_a_voxel_is_reported(
    ball, caplog, thickness_mm, message
):
    _, depth, inside, _ = ball
    labels = np.where(inside, np.where(depth < thickness_mm, 5, 1), 0)
    found = thickness_of(labels, ball)
    assert found.report["mean_mm"] == pytest.approx(thickness_mm, abs=0.02)
    assert caplog.messages == [message]


@pytest.mark.parametrize("hidden", [0.05, 0.1])
def test_area_that_fused_sulci_hide_is_reported_by_the_cortex_volume(
    ball, caplog, hidden
):
    """A fused sulcus through a ball: two banks of 2 mm that touch, as deep as hides a
    share of the area."""
    pial, depth, inside, affine = ball
    walls_mm2 = hidden / (1.0 - hidden) * area(pial)
    # the area of a circle's segment, by its depth
    deep = np.linspace(0.0, 2 * RADIUS_MM, 2001)
    half_chord = np.sqrt(np.maximum(deep * (2 * RADIUS_MM - deep), 0.0))
    segment = RADIUS_MM**2 * np.arccos(1.0 - deep / RADIUS_MM)
    segment -= (RADIUS_MM - deep) * half_chord
    shut_mm = np.interp(0.5 * walls_mm2, segment, deep)
    x, _, z = (affine[0, 3] + VOXEL_MM * index for index in np.indices(inside.shape))
    # at its end, the sulcus has cortex around it
    from_end = np.hypot(x, np.maximum(RADIUS_MM - shut_mm - z, 0.0))
    is_cortex = (depth < 2.0) | (from_end < 2.0)
    found = thickness_of(np.where(inside, np.where(is_cortex, 5, 1), 0), ball)
    ratio = found.report["area_ratio"]
    assert ratio == pytest.approx(1.0 - hidden, abs=0.03)
    is_told = hidden > 0.05
    assert caplog.messages == [Facts("cortex", f"{ratio:.2f}")] * is_told


def test_a_surface_that_lies_deep_in_the_labels_is_not_measured(ball):
    pial, depth, inside, affine = ball
    # the voxels go on beyond the surface, as where a fissure was opened
    larger = np.ones_like(inside)
    larger[:3] = False
    cortex = Cortex(larger, larger & (depth < 3.0), affine)
    with pytest.raises(InputError, check=Facts(cortex.mask.sum())):
        thickness_from_labels(cortex, pial, Pose())
    # but for opened sulci, on both sides of the fissure
    found = thickness_from_labels(cortex, pial, Pose(), fissure_x_mm=1.5)
    from_fissure = np.abs(pial.vertices[:, 0] - 1.5)
    assert found.is_measured[from_fissure > 3.5].all()
    assert not found.is_measured[from_fissure < 2.5].any()


PIAL = sphere(10.0, 4, (40.0, 5.0, 0.0))


@pytest.mark.parametrize(("shift_mm", "is_refused"), [(2.49, False), (2.6, True)])
def test_a_white_surface_may_cross_the_pial_one_by_a_hundredth_of_its_area(
    shift_mm, is_refused
):
    # off the middle, so that one side comes out
    white = sphere(8.0, 4, (40.0, 5.0 + shift_mm, 0.0))
    if not is_refused:
        found = thickness_from_white(PIAL, Pose(), 0.0, {"right": white})
        assert found.report["measured_area_share"] < 1.0
        return
    facts = Facts("right", "3 %", "0.6 mm", "1 %", "0.5 mm")
    with pytest.raises(InputError, check=facts):
        thickness_from_white(PIAL, Pose(), 0.0, {"right": white})


POSE = np.array([[0.0, -1, 0, 5], [1, 0, 0, -3], [0, 0, 1, 2], [0, 0, 0, 1]])
"""A quarter turn and some mm: the files lie elsewhere than the posed surface."""


def test_a_white_surface_is_of_its_side_and_inside_the_pial_one():
    white = sphere(8.0, 4, (40.0, 5.0, 0.0))
    in_file = transformed(white, np.linalg.inv(POSE))
    pose = Pose(files={"right": POSE})
    found = thickness_from_white(PIAL, pose, 39.0, {"right": in_file})
    assert found.values_mm == pytest.approx(2.0, abs=0.05)
    assert found.report["mean_mm"] == pytest.approx(2.0, abs=0.01)
    for side, fissure_x_mm in (("right", 41.5), ("left", 38.5)):
        facts = Facts(side, "x = 40.0 mm", f"{fissure_x_mm} mm")
        with pytest.raises(InputError, check=facts):
            thickness_from_white(PIAL, Pose(), fissure_x_mm, {side: white})
    same = sphere(9.75, 4, (40.0, 5.0, 0.0))
    with pytest.raises(InputError, check=Facts("0.25 mm", "0.3 mm")):
        thickness_from_white(PIAL, Pose(), 0.0, {"right": same})


@pytest.mark.parametrize("source", ["labels", "whole", "sides"])
def test_the_white_surface_of_concentric_spheres_is_the_inner_one(ball, source):
    pial = dict(zip(SIDES, split(sphere(RADIUS_MM, 4), 0.0), strict=True))
    radius_mm = RADIUS_MM - 3.0
    to_file = np.linalg.inv(POSE)
    if source == "labels":
        _, depth, inside, affine = ball
        labels = np.where(inside, np.where(depth < 3.0, 2, 1), 0)
        scheme = LabelScheme(name="two", cerebrum=(1, 2), cortex=(2,))
        found = white_from_labels(
            labels, to_file @ affine, scheme, pial, Pose(POSE), edge_length_mm=1.2
        )
    else:
        names = ("whole",) if source == "whole" else SIDES
        whites = dict.fromkeys(names, transformed(sphere(radius_mm, 4), to_file))
        pose = Pose(files={"whole": POSE})
        found = white_from_surfaces(whites, pial, pose, edge_length_mm=1.2)
    assert list(found) == ["left", "right"]
    points = np.concatenate([mesh.vertices for mesh in found.values()])
    radii = np.linalg.norm(points, axis=1)
    assert radii == pytest.approx(radius_mm, abs=VOXEL_MM / 4)
    assert radii.mean() == pytest.approx(radius_mm, abs=0.02)
    # two whole spheres where the files have one for each side
    sphere_mm2 = 4 * np.pi * radius_mm**2 * (1.0 if source == "sides" else 0.5)
    assert area(found["left"]) == pytest.approx(sphere_mm2, rel=0.03)
    ends = [mesh.vertices[:, 0].max() for mesh in found.values()]
    assert (ends[0] < 1.5 < ends[1]) == (source != "sides")


CORTEX_MM = 2.5


def millilitres(labels, affine):
    """Return the volumes of cortex and of the tissue inside."""
    return [(labels == label).sum() * affine[0, 0] ** 3 / 1000 for label in (2, 1)]


@pytest.mark.parametrize("has_white", [True, False])
def test_cortex_and_inside_have_the_volumes_between_and_within_known_surfaces(
    has_white,
):
    whole = ellipsoid((16.0, 21.0, 18.0), 4)
    white = inner(whole, CORTEX_MM)
    # its triangles may be in either order
    layer = {"whites": [flipped(white)]} if has_white else {"thickness_mm": CORTEX_MM}
    labels = filled_labels(whole, split(whole, 0.0), 0.0, voxel_mm=1.0, **layer)
    cortex, inside = millilitres(*labels)
    assert inside == pytest.approx(volume_ml(white), rel=0.02)
    assert cortex == pytest.approx(volume_ml(whole) - volume_ml(white), rel=0.04)


def test_halves_that_nearly_touch_are_joined_at_the_midline_and_caps_have_no_cortex():
    whole = octasphere(15.0, 4)
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
    core = 4 / 3 * np.pi * (15.0 - CORTEX_MM) ** 3 / 1000
    cortex, inside = millilitres(*shut)
    assert inside == pytest.approx(core, rel=0.02)
    # the slit of a millimetre becomes tissue inside, with cortex at its rim only
    slit = 0.1 * np.pi * 1.25**2
    rim = 0.1 * np.pi * 1.5**2 - slit
    assert millilitres(*near) == pytest.approx([cortex + rim, core + slit], rel=0.03)
    # a wide gap stays, and the caps beside it are bare
    places = transform_points(np.array([[0.0, 0, 0], [4.0, 0, 0]]), np.linalg.inv(grid))
    assert volume[tuple(np.rint(places).astype(int).T)].tolist() == [0, 1]
    assert sum(millilitres(volume, grid)) == pytest.approx(volume_ml(whole), rel=0.02)


def test_there_is_no_cortex_where_white_and_pial_surfaces_coincide():
    whole = sphere(15.0, 4)
    bare = whole.vertices[:, 2] < 0
    depth = np.where(bare, 0.1, CORTEX_MM)
    white = TriangleMesh(whole.vertices * (1 - depth / 15.0)[:, None], whole.faces)
    labels, affine = filled_labels(whole, [whole], 0.0, whites=[white], voxel_mm=1.0)
    z = transform_points(np.argwhere(labels == 2), affine)[:, 2]
    assert (z > -1.5).all()
    assert (z > 1.5).mean() > 0.8


def test_a_filled_brain_registers_with_labels_in_an_oblique_pose_without_their_cortex(
    caplog, monkeypatch
):
    # one of the registrations is done twice
    monkeypatch.setattr(registration, "register", cache(registration.register))
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
