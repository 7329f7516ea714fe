"""Quality of tetrahedral elements: radius ratio, dihedral angles, volumes."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import MeshError
from ..geometry.tetrahedra import TetrahedralMesh, boundary_surface, signed_volumes
from ..geometry.triangles import area, face_areas, mean_edge_length

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


def quality_summary(mesh: TetrahedralMesh) -> dict:
    """Returns counts, extreme and mean qualities, edge lengths and areas of a mesh, ready for JSON.

    `histogram` holds for radius ratio and dihedral angles the edges of the classes and the number of elements in each.
    """
    quality = element_quality(mesh)
    surface, _ = boundary_surface(mesh)
    classes = {
        "radius_ratio": np.linspace(0, 1, 41),
        "min_dihedral_deg": np.linspace(0, 90, 46),
        "max_dihedral_deg": np.linspace(60, 180, 61),
    }
    return {
        "tets": len(mesh.tets),
        "vertices": len(mesh.vertices),
        "pial_faces": len(surface.faces),
        "pial_edge_mm": mean_edge_length(surface),
        "pial_area_mm2": area(surface),
        "smallest_pial_face_mm2": float(face_areas(surface).min()),
        "volume_mm3": float(quality["volume_mm3"].sum()),
        "min_radius_ratio": float(quality["radius_ratio"].min()),
        "mean_radius_ratio": float(quality["radius_ratio"].mean()),
        "min_dihedral_deg": float(quality["min_dihedral_deg"].min()),
        "max_dihedral_deg": float(quality["max_dihedral_deg"].max()),
        "min_volume_mm3": float(quality["volume_mm3"].min()),
        "histogram": {
            name: {"edges": edges.tolist(), "counts": np.histogram(quality[name], edges)[0].tolist()}
            for name, edges in classes.items()
        },
    }


def refuse_bad_elements(mesh: TetrahedralMesh, min_radius_ratio: float) -> None:
    """Raises MeshError where an element's radius ratio is below the limit, with their number and the worst place."""
    ratio = radius_ratios(mesh)
    if (ratio < min_radius_ratio).any():
        worst = mesh.vertices[mesh.tets[ratio.argmin()]].mean(axis=0)
        raise MeshError(
            f"{int((ratio < min_radius_ratio).sum())} of {len(ratio)} elements are too flat",
            found=f"radius ratio {ratio.min():.4f} at {np.round(worst, 1).tolist()} mm",
            expected=f"at least {min_radius_ratio:g} (mesh.min_radius_ratio)",
            remedy="Mesh with a larger mesh.envelope_mm or other edge lengths, or lower the gate.",
        )
