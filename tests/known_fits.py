"""Registrations of shapes that were searched from all sides once, however often copies
of a shape are turned, shifted and scaled."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from gyriflow.anatomy import template
from gyriflow.anatomy.template import (
    PointCloud,
    register_from_all_sides,
    template_shapes,
)
from gyriflow.geometry.alignment import RigidFit

KNOWN: list[tuple[PointCloud, tuple, RigidFit, float]] = []
"""A shape, its targets with the numbers of starts and points, its fit and the
confidence."""
TOL = 1e-6
"""Distance of points of copies, in sizes."""


def fit_found_once(shape: PointCloud, targets: tuple) -> tuple[RigidFit, float]:
    """Return what `register_from_all_sides` does, from a known copy if there is one."""
    search = targets, len(template.CUBE_ROTATIONS), len(shape.points)
    for known, known_search, fit, confidence in KNOWN:
        if known_search == search:
            turn, distance = Rotation.align_vectors(known.points, shape.points)
            if distance < TOL * np.sqrt(len(shape.points)):
                rotation = fit.rotation @ turn.as_matrix()
                return replace(fit, rotation=rotation), confidence
    fit, confidence = register_from_all_sides(shape, targets)
    KNOWN.append((shape, search, fit, confidence))
    return fit, confidence


@cache
def rough_templates(kind: str) -> tuple[PointCloud, ...]:
    """Return the template in as few points as `template.POINTS` is set to."""
    return template_shapes.__wrapped__(kind)
