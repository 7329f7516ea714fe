"""All numbers of the room's functions on a phantom of long voxels, far from the origin
and wider on one side."""

from functools import cache

import numpy as np
import odd_brains
import pytest
import shapes
from atlas_brains import atlas_halves
from phantoms import CEREBELLUM, CORTEX
from recording import answer_of, numbers_in
from shapes import FAR, LONG_MM, rigid, scaling

from gyriflow.anatomy import (
    extraction,
    fissure,
    labels,
    misplaced,
    plausible,
    pose,
    repair,
    sulci,
    template,
    terraces,
    thickness,
)
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import (
    TriangleMesh,
    corners,
    merged,
    submesh,
    transformed,
    vertex_normals,
)
from gyriflow.io.yaml_files import SCHEMES

ATLAS = SCHEMES["spina-bifida-atlas"]
VOXEL_MM = (2.0, 2.4, 2.8)
ROUGH = 2e-3
"""Tolerance where a voxel or a face more or less is decided by rounding."""


@cache
def brain():
    """Return the labels of the phantom and their affine."""
    volume, affine = shapes.phantom(24.0, VOXEL_MM)
    wide = odd_brains.wide_hemisphere(volume, affine, 1.15)
    return wide, rigid(4.0, -3.0, 2.0, shift=(200.0, -180.0, 130.0)) @ affine


@cache
def field():
    """Return the smooth mask of the cerebrum, that inside the cortex, and their
    affine."""
    cerebrum = labels.read_cerebrum(*brain(), ATLAS)
    core = cerebrum.mask & ~np.isin(cerebrum.tissue, ATLAS.cortex)
    return cerebrum.mask, core, extraction.smooth_mask(cerebrum.mask), cerebrum.affine


@cache
def surface():
    """Return the surface of the cerebrum before it is made even."""
    _, _, smooth, affine = field()
    return extraction.isosurface(extraction.make_simple(smooth)[0], affine)


def test_numbers_of_label_volumes(recorded):
    volume, affine = brain()
    layout = labels.layout_of(volume)
    faulty = np.where(volume == CEREBELLUM, CORTEX, volume)
    faulty[2:6, 2:5, 2:4] = CORTEX
    around = misplaced.around_cerebrum(faulty, affine, ATLAS)
    without = np.where(np.isin(volume, ATLAS.ventricles), 0, volume)
    cut, its_affine = odd_brains.crop(volume, affine)
    schemes = {}
    for name, scheme in SCHEMES.items():
        schemes[name] = answer_of(labels.scheme_contradictions, layout, scheme)
    cerebrum = labels.read_cerebrum(volume, affine, ATLAS)
    recorded(
        {
            "cerebrum": cerebrum,
            "cut": answer_of(labels.read_cerebrum, cut, its_affine, ATLAS),
            "schemes": schemes,
            "counts": layout.count,
            "contacts": layout.contact,
            "unlabelled": labels.read_cerebrum(without, affine, ATLAS),
            "misplaced": answer_of(misplaced.misplaced_cortex, around),
        },
        rtol=ROUGH,
    )


def test_numbers_of_masks(recorded):
    mask, core, smooth, affine = field()
    joined = mask.copy()
    # a bridge over the middle and a tunnel
    i, j, k = (size // 2 for size in mask.shape)
    joined[i : i + 2, j : j + 3, :] |= mask.any(axis=2)[i : i + 2, j : j + 3, None]
    joined[i + 4, :, k] = False
    simple, topology = extraction.make_simple(extraction.smooth_mask(joined))
    without, stalks = extraction.without_stalks(joined, affine)
    refined, fine = extraction.refine(smooth, affine, 2)
    parts, kept, dropped = extraction.main_parts(core)
    recorded(
        {
            "smooth": smooth,
            "simple": simple,
            "topology": topology,
            "handles": [extraction.handles(joined), extraction.handles(core)],
            "bridges": extraction.remove_bridges(mask, smooth),
            "refined": refined,
            "affine": fine,
            "parts": parts,
            "counts": [kept, dropped],
            "dilated": extraction.dilated(core, 2.2),
            "without stalks": without,
            "stalks": stalks,
            "unambiguous": extraction.unambiguous(smooth),
            "filled": repair.filled_warning(topology, affine),
            "surface": surface(),
        },
        rtol=ROUGH,
    )


@pytest.mark.usefixtures("few_starts")
def test_numbers_of_a_fissure(recorded):
    mask, core, smooth, affine = field()
    walls = extraction.isosurface(extraction.smooth_mask(core), affine)
    plane = fissure.mid_plane(walls)
    between = fissure.fissure_between(walls, plane)
    side_mm = fissure.side_distance(mask, core, affine, between)
    hidden = fissure.hidden_fissure(side_mm, mask, core, affine)
    bridges = fissure.hidden_fissure(side_mm, mask, core, affine, bridges=True)
    x, y, _ = np.indices(mask.shape)
    some = (x + y > 40) & (np.abs(side_mm) < 4.0)
    far = np.where(some, 0.0, 3.0).astype(np.float32)
    heights = fissure.sample(side_mm, affine, corners(surface()).mean(axis=1))
    is_left = fissure.left_faces(surface(), heights)
    left, right = fissure.cut_sides(surface(), is_left)
    matrix, angle = fissure.upright(plane, walls.vertices.mean(axis=0))
    upright = transformed(surface(), matrix)
    apart = fissure.separate(left, right, 2.0, plane.normal)
    labelled = fissure.plane_between_labels(
        mask & (side_mm < -1.0), mask & (side_mm > 1.0), affine, mask
    )
    recorded(
        {
            "plane": plane,
            "heights": between.heights,
            "side": side_mm,
            "hidden": [int(hidden.sum()), int(bridges.sum())],
            "opened": fissure.open_fissure(smooth, affine, side_mm, far),
            "is left": is_left,
            "cut share": fissure.cut_share(left, right),
            "middle": fissure.cut_middle(left, right),
            "gap": fissure.smallest_gap(left, right),
            "apart": apart,
            "between labels": labelled,
            "matrix": matrix,
            "angle": angle,
            "halves": fissure.split(upright, float(upright.vertices[:, 0].mean())),
            "nearer left": fissure.nearer_left(surface(), left, right),
        },
        rtol=ROUGH,
    )


TURNS = {
    "small": rigid(4.0, -3.0, 2.0),
    "oblique": rigid(30.0, 44.0, -10.0),
    "quarter": rigid(88.0, 3.0, 1.0),
    "half": rigid(2.0, -4.0, 176.0),
    "far": FAR[1],
}


def numbers_of(found):
    """Return the fields of a pose, of warnings only the numbers."""
    texts = [numbers_in(text) for text in found.warnings]
    return vars(found) | {"warnings": texts}


def test_numbers_of_poses(recorded):
    volume, affine = brain()
    sided = odd_brains.add_sides(volume, shapes.phantom(24.0, VOXEL_MM)[1])
    results = {}
    for name, turn in TURNS.items():
        for key, labelled, scheme in (
            ("labels", volume, ATLAS),
            ("sided", sided, SCHEMES["dhcp-19"]),
        ):
            found = pose.pose_of_labels(labelled, turn @ affine, scheme)
            results[f"{name}.{key}"] = numbers_of(found)
    recorded(results, rtol=ROUGH)


@pytest.mark.usefixtures("quick_poses")
def test_numbers_of_poses_by_shape(recorded):
    left, right = atlas_halves()
    results = {}
    for name in ("small", "far"):
        turn = TURNS[name]
        there = transformed(left, turn), transformed(right, turn)
        near = transformed(right, turn @ rigid(1.0, 0.0, 2.0, shift=(0.0, 1.0, -0.5)))
        results[name] = {
            "together": numbers_of(pose.pose_of_pair(*there)),
            "near": numbers_of(pose.pose_of_pair(there[0], near)),
            "apart": numbers_of(pose.pose_of_pair(there[0], right)),
            "hemisphere": numbers_of(pose.pose_of_hemisphere(near, "right", "auto")),
        }
    recorded(results, rtol=ROUGH)


def test_numbers_of_shapes(recorded):
    cloud = template.shape_of(shapes.uneven_surface(4))
    targets = template.template_shapes("left")
    wall, share = template.medial_wall(cloud, FAR[0][:3, 0])
    recorded(
        {
            "points": cloud.points,
            "normals": cloud.normals,
            "targets": [target.points for target in targets],
            "wall": wall,
            "share": share,
        }
    )


def test_verdicts_on_sizes_and_proportions(recorded):
    results = {}
    for share in (0.1, 0.3, 0.6, 1.0, 1.6, 2.6, 7.0, 1e3, 1e-9):
        volume = share * 1e3 * plausible.expected_volume_ml(27.0)
        results[f"volume {share}"] = answer_of(
            plausible.require_plausible_size, volume, 27.0
        )
    for median in (1e-4, 0.05, 0.2, 3.0, 25.0, 2e3):
        results[f"thickness {median}"] = answer_of(
            plausible.require_plausible_thickness, median * np.arange(-4, 6), 1.0, "a"
        )
    for extents in ((50, 70, 55), (30, 70, 55), (75, 70, 40), (50, 70, 75)):
        results[f"extents {extents}"] = answer_of(
            plausible.proportion_warnings, np.array(extents, dtype=float)
        )
    for week in (19.0, 22.5, 27.0, 33.3, 40.0):
        results[f"week {week}"] = {
            "volume": plausible.expected_volume_ml(week),
            "cut": plausible.max_cut_share(week),
            "warnings": answer_of(plausible.cut_warnings, 0.3, week),
        }
    for width in (0.4, 0.48, 0.54, 0.6):
        body = shapes.ellipsoid((width * 30.0, 30.0, 25.0), 2)
        body = transformed(body, FAR[0])
        results[f"width {width}"] = {
            "narrowness": plausible.narrowness(body),
            "hemisphere": answer_of(plausible.require_single_hemisphere, body),
            "whole": answer_of(plausible.require_whole, body, "volume"),
            "twins": answer_of(
                plausible.require_one_brain,
                merged(body, transformed(body, rigid(shift=(0.0, 90.0, 0.0)))),
                "volume",
            ),
        }
    for ratio in (1.05, 1.2, 1.5):
        left = transformed(shapes.hemisphere(-1), FAR[0])
        right = transformed(shapes.hemisphere(1), FAR[0] @ scaling((1.0, 1.0, ratio)))
        axis = FAR[0][:3, 0]
        results[f"pair {ratio}"] = {
            "pair": answer_of(plausible.require_pair, left, right, 1.3, "ras"),
            "swapped": answer_of(plausible.require_pair, right, left, 1.3, "auto"),
            "facing": answer_of(
                plausible.facing_warnings,
                left,
                transformed(right, rigid(shift=(0.0, 9 * ratio - 9, 0.0))),
                axis,
            ),
        }
    recorded(results)


def test_numbers_of_thickness(recorded):
    volume, affine = brain()
    mask, core, _, grid = field()
    plain = Pose()
    cortex = thickness.cortex_of(labels.read_cerebrum(volume, affine, ATLAS), ATLAS)
    found = thickness.thickness_from_labels(cortex, surface(), plain)
    inside = shapes.inner(surface(), 1.5)
    x = surface().vertices[:, 0]
    recorded(
        {
            "of labels": found,
            "border": thickness.border(core, grid),
            "voxels": thickness.Cortex(mask, mask & ~core, grid).voxels_through,
            "white": answer_of(
                thickness.thickness_from_white,
                surface(),
                plain,
                float(np.median(x)),
                {"whole": inside},
            ),
        },
        rtol=ROUGH,
    )


def test_numbers_of_filled_labels(recorded):
    whole = shapes.uneven_surface(4)
    middle = float(whole.vertices[:, 0].mean())
    sides = fissure.split(whole, middle)
    depth = 1.0 + 1.5 * shapes.smooth_field(whole.vertices, 25.0)
    points = whole.vertices - depth[:, None] * vertex_normals(whole)
    white = TriangleMesh(points, whole.faces)
    volume, affine = thickness.filled_labels(
        whole, sides, middle, whites=[white], voxel_mm=1.2
    )
    plain, _ = thickness.filled_labels(
        whole, [sides[0]], middle, thickness_mm=2.5, voxel_mm=1.5
    )
    recorded({"labels": volume, "affine": affine, "plain": plain}, rtol=ROUGH)


def test_numbers_of_repairs(recorded):
    body = shapes.uneven_surface(4)
    centres = corners(body).mean(axis=1)
    hole = np.linalg.norm(centres - centres[10], axis=1) > 1.5
    crumb = transformed(shapes.sphere(1.0, 2), FAR[0] @ rigid(shift=(40.0, 0.0, 0.0)))
    broken = merged(submesh(body, hole)[0], crumb)
    cleaned, counts, is_cap = repair.clean(broken, 5.0)
    voxels = scaling(np.multiply(2.0, LONG_MM), body.vertices.min(axis=0))
    scaled, report = repair._with_volume(body, 33000.0, 5800.0)
    recorded(
        {
            "cleaned": cleaned,
            "counts": counts,
            "cap": is_cap,
            "refused": answer_of(repair.clean, broken, 1.0),
            "pieces": repair.pieces(broken),
            "faults": repair.faults(broken),
            "scaled": scaled,
            "report": report,
            "flat": terraces.without_terraces(body, voxels),
        },
        rtol=ROUGH,
    )


def test_numbers_of_opened_sulci(recorded):
    places = np.stack(np.indices((34, 30, 26)), axis=-1) * [0.8, 0.9, 1.0]
    places = places - [13.0, 13.5, 12.5]
    depth = 11.0 - np.linalg.norm(places * [1.0, 0.95, 1.1], axis=-1)
    across = np.abs(places @ np.array([0.8, 0.36, 0.48]))
    to_end = np.hypot(across, np.maximum(depth - 5.0, 0.0))
    core = (depth > 2.0) & (to_end > 2.0)
    affine = FAR[1] @ np.diag([0.8, 0.9, 1.0, 1.0])
    smooth = extraction.smooth_mask(depth > 0)
    opened, fine, report = sulci.open_fused_sulci(smooth, affine, core)
    recorded({"opened": opened, "affine": fine, "report": report}, rtol=ROUGH)
