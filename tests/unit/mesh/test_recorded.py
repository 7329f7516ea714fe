"""All numbers of the room's functions on an uneven body far from the origin."""

import numpy as np
from recording import answer_of
from shapes import (
    FAR,
    LONG_MM,
    box,
    box_mesh,
    joined,
    scaling,
    smooth_field,
    uneven_body,
    uneven_surface,
)

from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_faces,
    boundary_surface,
    quadratic,
)
from gyriflow.geometry.triangles import merged
from gyriflow.mesh import (
    improvement,
    maps,
    nodes,
    quality,
    splitting,
    tetrahedralisation,
)


def test_numbers_of_maps_on_a_mesh(recorded):
    mesh = uneven_body(4)
    facets, _ = boundary_faces(mesh)
    boundary, _ = boundary_surface(uneven_body(6))
    values = smooth_field(boundary.vertices)
    shape = (21, 15, 11)
    affine = FAR[0] @ scaling(np.multiply(9.0, LONG_MM), -45.0)
    volume = np.fromfunction(lambda i, j, k: i + 0.5 * j - 0.2 * k**2, shape)
    moved = maps.move_to_mesh(boundary.vertices, boundary, np.eye(4))
    recorded(
        {
            "of a surface": maps.vertex_map_on_mesh(
                mesh.vertices, facets, boundary, values
            ),
            "of a volume": maps.volume_map_on_mesh(mesh.vertices, volume, affine),
            "refused": answer_of(
                maps.require_within, values, {"gt": 0.0, "le": 2.0}, "a"
            ),
            "moved": moved,
        },
        rtol=1e-3,
    )


def test_numbers_of_quality(recorded):
    mesh = uneven_body(4)
    boundary, _ = boundary_surface(mesh)
    surface = uneven_surface(3)
    curved = nodes.curve_edges(mesh, boundary)
    bent = quadratic(mesh)
    places = bent.vertices.copy()
    places[len(mesh.vertices) :] += 0.4 * np.sin(places[len(mesh.vertices) :])
    bent = TetrahedralMesh(places, bent.tets)
    below = box((8.0, 6.0, 2.0), subdivisions=3)
    above = box((7.0, 6.5, 2.0), (0.4, 0.3, 2.6), subdivisions=3)
    plates = box_mesh((8, 6, 2), (8.0, 6.0, 2.0))
    near = joined((plates, np.zeros(3)), (plates, [0.9, 0.3, 2.35]))
    summary = quality.quality_summary(mesh, surface)
    recorded(
        {
            "summary": summary,
            "of bent": quality.quality_summary(bent, surface),
            "of plates": quality.quality_summary(near, merged(below, above)),
            "Jacobians": quality.jacobian_ratios(bent),
            "curved": curved,
            "edges": tetrahedralisation._edge_length_at(
                np.linspace(0.0, 30.0, 40), 1.5, 4.0, 2
            ),
            "refused": [
                answer_of(
                    quality.refuse_bad_mesh,
                    mesh,
                    summary,
                    max_surface_distance_mm=limit,
                    max_volume_change=0.9 * limit,
                )
                for limit in (0.01, 1.0, 9.0)
            ],
        },
        rtol=1e-3,
    )


def test_numbers_of_changed_elements(recorded):
    mesh = uneven_body(3)
    flat = mesh.vertices.copy()
    inner = np.setdiff1d(np.arange(len(flat)), boundary_faces(mesh)[0])
    flat[inner] += 2.2 * np.sin(flat[inner][:, [1, 2, 0]])
    crooked = TetrahedralMesh(flat, mesh.tets)
    recorded(
        {
            "ratios": improvement.signed_ratios(flat[mesh.tets]),
            "improved": improvement.improve_flat_elements(crooked),
            "split": splitting.split_inner_edges(mesh),
        },
        rtol=1e-3,
    )
