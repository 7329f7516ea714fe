"""All numbers of the room's functions on shapes without a symmetry, far from the
origin."""

import numpy as np
import pytest
from shapes import (
    FAR,
    LONG_MM,
    inner,
    scaling,
    smooth_field,
    uneven_body,
    uneven_surface,
)

from gyriflow.geometry import (
    alignment,
    deformations,
    diffusion,
    jacobians,
    matching,
    paths,
    straightening,
    tetrahedra,
    triangles,
)
from gyriflow.geometry.poses import Pose, pose_from


@pytest.fixture(scope="module")
def surface():
    return uneven_surface()


@pytest.fixture(scope="module")
def body():
    return uneven_body()


def test_numbers_of_a_surface(recorded, surface):
    functions = [
        triangles.area_cm2,
        triangles.volume_ml,
        triangles.face_areas,
        triangles.face_normals,
        triangles.vertex_areas,
        triangles.vertex_normals,
        triangles.edges,
        triangles.mean_edge_length,
        triangles.euler_number,
        triangles.is_closed,
    ]
    height = triangles.corners(surface)[:, :, 2].mean(axis=1)
    part, used = triangles.submesh(surface, height > height.mean())
    recorded(
        {
            **{function.__name__: function(surface) for function in functions},
            "part": part,
            "part of": used,
            "euler of a part": triangles.euler_number(part),
            "rms": triangles.rms_length(surface.vertices),
            "hull area": triangles.area(triangles.convex_hull(surface)),
        }
    )


def test_numbers_of_matched_surfaces(recorded, surface):
    other = uneven_surface(2, 1)
    # a little apart, so that no faces lie in each other
    apart = alignment.motion(shift=(0.7, -0.4, 0.5))
    other = triangles.transformed(other, apart @ FAR[0] @ np.linalg.inv(FAR[1]))
    inside = inner(surface, 2.0)
    match = matching.match_surface(surface, other)
    deep = matching.match_layers(
        surface.vertices,
        triangles.vertex_normals(surface),
        inside.vertices,
        other,
        inner(other, 1.0).vertices,
    )
    thickness = matching.layer_thickness(surface, inside)
    mask, affine = matching.surface_mask(other, 3.0)
    long = scaling(np.multiply(4.0, LONG_MM), surface.vertices.min(axis=0) - 5.0)
    shape = (20, 19, 14)
    there, _, _ = matching.nearest_on(surface.vertices, other)
    back, _, _ = matching.nearest_on(other.vertices, surface)
    weights = [triangles.vertex_areas(mesh) for mesh in (surface, other)]
    recorded(
        {
            # round-off decides between the faces of an edge, but not these
            "distances": match.distance_mm,
            "agrees": match.agrees,
            "distances by layers": deep.distance_mm,
            "places by layers": matching.values_at(deep, other.vertices),
            "values": matching.values_at(match, smooth_field(other.vertices)),
            "vectors": matching.values_at(match, other.vertices),
            "matrix": matching.interpolation(match, len(other.vertices)),
            "labels": matching.labels_at(match, np.arange(len(other.vertices))),
            "thickness": thickness,
            "mask": mask,
            "affine": affine,
            "layers": matching.layer_labels(surface, thickness, shape, long),
            "distance": matching.surface_distance(
                [(there, weights[0]), (back, weights[1])]
            ),
            "crossing": matching.faces_that_cross(triangles.merged(surface, other)),
        }
    )


def test_numbers_of_an_alignment(recorded, surface):
    turned = uneven_surface(2, 1)
    start = triangles.transformed(turned, FAR[0] @ np.linalg.inv(FAR[1]))
    near = triangles.transformed(start, alignment.motion(shift=(3.0, -2.0, 1.0)))
    aligned = alignment.align(near, surface)
    weights = triangles.vertex_areas(turned)
    first, second = turned.vertices, start.vertices * [1.0, 1.05, 0.9]
    onto = alignment.rigid_fit(first, second, weights)
    normals = triangles.vertex_normals(start)
    distances = smooth_field(near.vertices)
    planes = alignment.Planes(near.vertices, normals, distances, weights)
    recorded(
        {
            # iterations end within some hundredths of a millimetre
            "aligned": np.round(aligned.vertices.mean(axis=0), 1),
            "fit": onto,
            "angle": alignment.angle_deg(onto[:3, :3]),
            "left": alignment.align_points(second, first, weights) - first,
            "step": alignment.follow_planes(
                np.eye(3), np.zeros(3), lambda *_: planes, 1, lambda *_: True
            ),
        }
    )


def test_numbers_of_correspondences_and_poses(recorded, surface):
    x, y, z = np.meshgrid(*(np.linspace(0.0, 1.0, n) for n in (5, 6, 7)), indexing="ij")
    displacement = np.stack([2 * x * y, y - z**2, 3 * z * x], axis=-1).astype(
        np.float32
    )
    low = surface.vertices.min(axis=0) - 3.0
    pair = deformations.Deformation(
        FAR[1], displacement, scaling(np.multiply(10.0, LONG_MM), low)
    )
    moved = deformations.between_moved(pair, FAR[1], FAR[0])
    matched = deformations.MatchedSurfaces(surface, surface.vertices[::-1])
    pose = Pose(FAR[0], {"left": FAR[1], "right": FAR[0]}, "shape", False, {"a": 1.5})
    recorded(
        {
            "carried": deformations.carry(pair, surface.vertices),
            "index": deformations.voxel_index(surface.vertices, pair.affine),
            "moved": moved,
            "surfaces": deformations.between_moved(matched, FAR[0], FAR[1]),
            "pose": pose_from(pose.then(FAR[1]).plain()),
            "inverse": pose.inverse,
            "of left": pose.of_file("left"),
        }
    )


def test_numbers_of_smoothing(recorded, surface, body):
    results = {}
    for name, points, cells in (
        ("surface", surface.vertices, surface.faces),
        ("body", body.vertices, body.tets),
    ):
        values = np.column_stack([smooth_field(points), points[:, 1]])
        of_cells = values[cells].mean(axis=1)
        integrals = diffusion.integrals_at_vertices(points, cells, of_cells)
        fixed = np.flatnonzero(values[:, 0] > 2.0)
        extend = diffusion.harmonic_continuation(points, cells, fixed)
        results[name] = {
            "of vertices": diffusion.vertex_sizes(points, cells),
            "smooth": diffusion.diffuse(points, cells, values, 4.0),
            "integrals": integrals,
            "smooth integrals": diffusion.smooth_integrals(
                points, cells, integrals, 5.0
            ),
            "continued": extend(values[fixed]),
            "stiffness": diffusion.stiffness_matrix(points, cells),
        }
    recorded(results, rtol=1e-3)


def test_numbers_of_elements(recorded, body):
    curved = tetrahedra.quadratic(body)
    middles = np.arange(len(curved.vertices)) >= len(body.vertices)
    bowed = curved.vertices.copy()
    bowed[middles] += 1.2 * np.sin(bowed[middles][:, [1, 2, 0]])
    mesh = tetrahedra.TetrahedralMesh(bowed, curved.tets)
    faces, elements = tetrahedra.boundary_faces(mesh)
    surface, used = tetrahedra.boundary_surface(mesh)
    finer, nodes = tetrahedra.finer_surface(faces)
    selected = np.arange(len(faces)) % 5 < 2
    far = body.vertices + 4.0 * np.sin(body.vertices)
    recorded(
        {
            "volumes": tetrahedra.signed_volumes(body),
            "between": tetrahedra.volumes_between(far, body.tets),
            "has volume": tetrahedra.has_volume(far, body.tets),
            "ratios": tetrahedra.radius_ratios(body),
            "parts": tetrahedra.connected_parts(body),
            "quadratic": curved,
            "pieces": tetrahedra.linear_pieces(mesh),
            "faces": faces,
            "elements": elements,
            "surface": surface,
            "nodes": used,
            "whole faces": tetrahedra.whole_faces(faces, mesh.order),
            "on whole faces": tetrahedra.on_whole_faces(selected, mesh.order),
            "finer": finer,
            "finer nodes": nodes,
            "bounds": jacobians.lower_bounds(bowed, mesh.tets),
            "coefficients": jacobians.coefficients(bowed, mesh.tets),
            "on the way": jacobians.inverted_on_the_way(body.vertices, far, body.tets),
            "straightness": straightening.straightness(bowed, mesh.tets),
            "may fold": straightening.may_fold_over(bowed, mesh.tets),
            "straight": straightening.straighten_sides(bowed, mesh.tets),
        }
    )


def test_numbers_of_a_path(recorded, body):
    weeks = [21.0, 21.3, 23.0, 24.0, 26.5]
    centre = body.vertices.mean(axis=0)
    offset = body.vertices - centre
    bent = np.sin(offset / 6.0)[:, [1, 2, 0]]
    shapes = []
    for number, week in enumerate(weeks):
        factor = 1.0 + 0.04 * (week - 21.0) + 0.02 * (number % 2)
        shapes.append(centre + factor * offset + number * bent)
    path = paths.path_through(weeks, shapes, body, 0.5, stops=[24.0])
    recorded(
        {
            "weeks": path.weeks,
            "inverted": [list(map(int, found)) for found in path.inverted],
            **{f"at {week}": path(week) for week in (21.15, 22.0, 23.5, 26.0)},
        }
    )
