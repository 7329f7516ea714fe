"""Quality of a mesh: radius ratio, dihedral angles and volumes of its elements, and how its surface was kept."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import MeshError
from ..geometry.crossings import crossing_faces
from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, boundary_surface, signed_volumes
from ..geometry.triangles import TriangleMesh, area, face_areas, mean_edge_length
from .fidelity import gaps, surface_distance

EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
OPPOSITE = ((2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))


def radius_ratios(mesh: TetrahedralMesh) -> NDArray[np.float64]:
    """Returns the (m,) ratios 3 × inscribed / circumscribed radius: 1 for the regular element, 0 for a flat one."""
    a, b, c, d = mesh.vertices[mesh.tets].transpose(1, 0, 2)
    p, q, r = b - a, c - a, d - a
    volume6 = np.abs(np.einsum("ij,ij->i", np.cross(p, q), r))
    surface2 = sum(np.linalg.norm(np.cross(x, y), axis=1) for x, y in ((p, q), (q, r), (r, p), (q - p, r - p)))
    # circumradius = |p|²(q×r) + |q|²(r×p) + |r|²(p×q)| / (2·6V), inradius = 6V / (sum of twice the face areas)
    squared = [np.einsum("ij,ij->i", x, x)[:, None] for x in (p, q, r)]
    numerator = np.linalg.norm(
        squared[0] * np.cross(q, r) + squared[1] * np.cross(r, p) + squared[2] * np.cross(p, q), axis=1
    )
    return 6 * volume6**2 / np.maximum(surface2 * numerator, np.finfo(float).tiny)


def dihedral_angles(mesh: TetrahedralMesh) -> NDArray[np.float64]:
    """Returns the (m, 6) angles in degrees between the faces at each edge."""
    corner = mesh.vertices[mesh.tets]
    angles = np.empty((len(mesh.tets), 6))
    for i, ((a, b), (c, d)) in enumerate(zip(EDGES, OPPOSITE, strict=True)):
        edge = corner[:, b] - corner[:, a]
        first, second = (np.cross(edge, corner[:, k] - corner[:, a]) for k in (c, d))
        sine = np.linalg.norm(np.cross(first, second), axis=1)
        angles[:, i] = np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", first, second)))
    return angles


def element_quality(mesh: TetrahedralMesh) -> pd.DataFrame:
    """Returns per element radius_ratio, min_dihedral_deg, max_dihedral_deg and volume_mm3."""
    angles = dihedral_angles(mesh)
    return pd.DataFrame(
        {
            "radius_ratio": radius_ratios(mesh),
            "min_dihedral_deg": angles.min(axis=1),
            "max_dihedral_deg": angles.max(axis=1),
            "volume_mm3": signed_volumes(mesh),
        }
    )


def elements_through(mesh: TetrahedralMesh, thickness_mm: float) -> float:
    """Returns the elements through a layer below the surface: its thickness over the mean edge length in it.

    Those elements count whose centroid lies within `thickness_mm` of a vertex of the surface.
    """
    outer = np.unique(boundary_faces(mesh)[0])
    depth = cKDTree(mesh.vertices[outer]).query(mesh.vertices[mesh.tets].mean(axis=1))[0]
    corner = mesh.vertices[mesh.tets[depth <= thickness_mm]]
    lengths = [np.linalg.norm(corner[:, b] - corner[:, a], axis=1) for a, b in EDGES]
    return float(thickness_mm / np.mean(lengths))


def quality_summary(mesh: TetrahedralMesh, surface: TriangleMesh) -> dict[str, Any]:
    """Returns counts, extreme and mean qualities, edge lengths and areas of a mesh, ready for JSON.

    `surface` is the one that was filled: `surface_distance_mm` is that of the mesh's surface from it, and `gap_mm`
    holds the gaps of both (see `fidelity`). `histogram` holds for radius ratio, dihedral angles and volume the edges
    of the classes and the number of elements in each.
    """
    quality = element_quality(mesh)
    own, _ = boundary_surface(mesh)
    volume = quality["volume_mm3"]
    classes = {
        "radius_ratio": np.linspace(0, 1, 41),
        "min_dihedral_deg": np.linspace(0, 90, 46),
        "max_dihedral_deg": np.linspace(60, 180, 61),
        "volume_mm3": 10.0 ** (np.arange(*_tenths_of_decades(volume)) / 10),
    }
    return {
        "tets": len(mesh.tets),
        "vertices": len(mesh.vertices),
        "pial_faces": len(own.faces),
        "pial_edge_mm": mean_edge_length(own),
        "pial_area_mm2": area(own),
        "smallest_pial_face_mm2": float(face_areas(own).min()),
        "crossing_faces": crossing_faces(own),
        "surface_distance_mm": surface_distance(own, surface),
        "gap_mm": {"input": gaps(surface), "mesh": gaps(own)},
        "volume_mm3": float(volume.sum()),
        "min_radius_ratio": float(quality["radius_ratio"].min()),
        "mean_radius_ratio": float(quality["radius_ratio"].mean()),
        "median_radius_ratio": float(quality["radius_ratio"].median()),
        "min_dihedral_deg": float(quality["min_dihedral_deg"].min()),
        "max_dihedral_deg": float(quality["max_dihedral_deg"].max()),
        "min_volume_mm3": float(volume.min()),
        "histogram": {
            name: {"edges": edges.tolist(), "counts": np.histogram(quality[name], edges)[0].tolist()}
            for name, edges in classes.items()
        },
    }


def _tenths_of_decades(values: pd.Series) -> tuple[int, int]:
    """Returns the range of n for which 10^(n/10) are the edges of classes that hold all of some positive values."""
    logarithms = 10 * np.log10(values)
    return int(np.floor(logarithms.min())) - 1, int(np.ceil(logarithms.max())) + 2


def refuse_bad_mesh(
    mesh: TetrahedralMesh,
    summary: Mapping[str, Any],
    *,
    min_radius_ratio: float,
    min_dihedral_deg: float,
    max_dihedral_deg: float,
    max_surface_distance_mm: float,
) -> None:
    """Raises MeshError where a mesh with this `quality_summary` passes one of the limits, all of them named.

    For elements the message has the number of bad ones and the worst place. Faces of the mesh's surface that cross
    each other are always refused.
    """
    ratio, angles = radius_ratios(mesh), dihedral_angles(mesh)
    sharp, blunt = angles.min(axis=1), angles.max(axis=1)
    elements = [
        ("radius ratio", ratio, ratio < min_radius_ratio, ratio.argmin(), f"at least {min_radius_ratio:g}"),
        (
            "dihedral angle in degrees",
            sharp,
            sharp < min_dihedral_deg,
            sharp.argmin(),
            f"at least {min_dihedral_deg:g}",
        ),
        ("dihedral angle in degrees", blunt, blunt > max_dihedral_deg, blunt.argmax(), f"at most {max_dihedral_deg:g}"),
    ]
    found, expected = [], []
    for name, values, bad, worst, limit in elements:
        if bad.any():
            place = np.round(mesh.vertices[mesh.tets[worst]].mean(axis=0), 1).tolist()
            found.append(f"{int(bad.sum())} of {len(bad)} elements with {name} to {values[worst]:.4g} at {place} mm")
            expected.append(f"{name} {limit}")
    distance = summary["surface_distance_mm"]["hausdorff99"]
    if distance > max_surface_distance_mm:
        found.append(f"a surface {distance:.3f} mm from the one that was filled (99 % of it is nearer)")
        expected.append(f"at most {max_surface_distance_mm:g} mm (mesh.max_surface_distance_mm)")
    if summary["crossing_faces"]:
        found.append(f"{summary['crossing_faces']} faces of its surface that cross others")
        expected.append("none that cross")
    if found:
        raise MeshError(
            "the mesh is not good enough",
            found="; ".join(found),
            expected="; ".join(expected),
            remedy="Mesh with another mesh.envelope_mm, other edge lengths or another mesh.mesher, or lower the gates "
            "of mesh.",
        )
