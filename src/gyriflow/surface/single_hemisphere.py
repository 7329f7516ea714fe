"""The pose of a hemisphere that is alone: by its file's axes where its shape agrees, else by its shape."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.alignment import angle_deg
from ..geometry.triangles import TriangleMesh, transformed
from .brain_pose import (
    DOUBTFUL_BRAIN,
    LEAST_TURN_DEG,
    narrowness,
)
from .hemisphere_pose import (
    CONVENTION_DEG,
    CONVENTIONS,
    LEAST_CONFIDENCE,
    MIRROR,
    SYLVIAN_AHEAD,
    hemisphere_by_shape,
)
from .outcome import PialSurface, describe
from .pial import motion, warn

# the medial wall's distance from the mid-sagittal plane
BESIDE_MM = 0.5


def require_one(mesh: TriangleMesh) -> None:
    """Raises InputError where a surface is that of a whole brain."""
    if (shape := narrowness(mesh)) > DOUBTFUL_BRAIN:
        raise InputError(
            "this is no single hemisphere",
            found=f"a narrowest extent that is {shape:.2f} of the longest",
            expected=f"at most {DOUBTFUL_BRAIN}",
            remedy="Give a whole brain as labels or pial, or its hemispheres as hemispheres.",
        )


def single_hemisphere(
    mesh: TriangleMesh, side: str, coordinates: str, report: dict[str, Any], week: float
) -> PialSurface:
    """Returns a clean hemisphere posed, in coordinates "ras", "lps" or "auto", with the whole report.

    With "auto", the axes of the file are kept where its shape says that they are RAS or LPS within 35°, and its medial
    wall is then turned upright; else the shape's pose is taken. The report's "coordinates", if it has any, become those
    that were found. InputError where the pose is ambiguous, or the shape is that of the other side.
    """
    mirrored = side == "left"
    shape = hemisphere_by_shape(transformed(mesh, MIRROR) if mirrored else mesh)
    mirror = MIRROR[:3, :3] if mirrored else np.eye(3)
    rotation = mirror @ shape.rotation @ mirror
    angles = {name: angle_deg(rotation @ axes.T) for name, axes in CONVENTIONS.items()}
    clear = shape.confidence >= LEAST_CONFIDENCE
    if coordinates == "auto" and clear and shape.sylvian < -SYLVIAN_AHEAD:
        raise InputError(
            f"the hemisphere seems to be the {'right' if mirrored else 'left'} one",
            found=f"the Sylvian fissure {-shape.sylvian:.2f} of the size behind the middle",
            expected="in front of the middle",
            remedy="Set the other side; or, if it is right, pose the file yourself and set coordinates: ras.",
        )
    if shape.sylvian < SYLVIAN_AHEAD:
        warn(report, f"the side, {side}, is taken from the configuration: it cannot be determined from the shape")
    if coordinates != "auto":
        chosen, report["pose_by"] = CONVENTIONS[coordinates], "configuration"
        if clear and angles[coordinates] > LEAST_TURN_DEG:
            warn(report, f"the shape says that the hemisphere is turned by {angles[coordinates]:.0f}° against the "
                 f"coordinates {coordinates}: check them, or set coordinates: auto")  # fmt: skip
    elif (nearest := min(angles, key=lambda name: angles[name])) and angles[nearest] < CONVENTION_DEG:
        # the smallest turn that sets the medial wall upright
        wall = CONVENTIONS[nearest] @ rotation.T @ np.array([1.0, 0.0, 0.0])
        upright, _ = Rotation.align_vectors([[1.0, 0.0, 0.0]], [wall])
        chosen, report["pose_by"] = upright.as_matrix() @ CONVENTIONS[nearest], "file"
        if nearest != "ras":
            # a volume has none but its affine, and other volumes of the brain are taken to share its mistake
            if "coordinates" in report:
                report["coordinates"] = nearest
            warn(report, f"the shape says that the coordinates are {nearest.upper()}")
    elif clear:
        chosen, report["pose_by"] = rotation, "shape"
        warn(report, f"the hemisphere was turned by {angles['ras']:.0f}°, as its shape says")
    else:
        raise InputError(
            "the pose of the hemisphere cannot be determined from its shape",
            found=f"the next best pose {shape.confidence:.2f} times worse",
            expected=f"at least {LEAST_CONFIDENCE} times, or RAS or LPS",
            remedy="Pose it and set coordinates: ras or lps.",
        )
    whole = transformed(mesh, motion(chosen))
    x = whole.vertices[:, 0]
    fissure_x = float(x.max() + BESIDE_MM if mirrored else x.min() - BESIDE_MM)
    report |= {
        "pose": motion(chosen).tolist(),
        "rotation_deg": angle_deg(chosen),
        "confidence": shape.confidence,
        "sylvian_ahead": shape.sylvian,
    }
    left, right = (whole, None) if mirrored else (None, whole)
    return describe(whole, left, right, fissure_x, report, week)
