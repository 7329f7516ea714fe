"""All numbers of short simulations of an uneven body far from the origin, and of the
room's functions on it."""

from typing import get_args

import numpy as np
import pandas as pd
import pytest
from mpi4py import MPI
from recording import contents
from shapes import smooth_field, uneven_body

from gyriflow.folding import (
    elastic_fit,
    growth,
    layers,
    output,
    run,
    steering,
    stretches,
    targets,
)
from gyriflow.folding.checks import zone_report
from gyriflow.folding.contact import _stiffening
from gyriflow.folding.domain import bisect_points
from gyriflow.folding.points import IntegrationPoints
from gyriflow.folding.start_regions import start_regions
from gyriflow.folding.tangent import part_arms, rigid_motions
from gyriflow.folding.tissue import Elements, Tissue
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.jacobians import SLOPES
from gyriflow.geometry.paths import path_through
from gyriflow.geometry.tetrahedra import boundary_surface, quadratic
from gyriflow.geometry.triangles import corners, vertex_areas
from gyriflow.io.files import read_json
from gyriflow.settings.folding import parameters_from
from gyriflow.settings.terms import ELEMENT_FIELDS, VertexField

CENTRE_MM = uneven_body().vertices.mean(axis=0)
RUN = {
    "start_week": 21.0,
    "end_week": 22.0,
    "output_weeks": [21.0, 21.4, 22.0],
    "fissure_x_mm": float(CENTRE_MM[0]),
    "step_s": 172800.0,
    "thickness_mm": {"weeks": {21.0: 4.0, 22.0: 5.0}},
    "core_growth_rate_per_s": 5e-8,
    "newton_tolerance": 1e-8,
    "support": "free",
}
KINDS = {
    "rates, planes, ellipsoid": {
        "contact": "planes",
        "support": "ellipsoid",
        "stress_memory_gw": 1.5,
        "material": "compressible-neo-hookean",
    },
    "rates, global contact, quadratic": {"contact": "global"},
    "sizes": {
        "contact": "none",
        "growth": {
            "model": "sizes",
            "area_cm2": {21.0: 44.0, 22.0: 50.0},
            "volume_ml": {21.0: 24.0, 22.0: 31.0},
        },
    },
    "shapes": {
        "contact": "none",
        "growth": {
            "model": "shapes",
            "area_cm2": {21.0: 44.0, 22.0: 50.0},
            "volume_ml": {21.0: 24.0, 22.0: 27.0},
        },
        "targets": {22.0: "target"},
    },
}
"""Settings of short simulations."""
FIELDS = [name for name in get_args(VertexField) if name != "contact_pressure"]
FIELDS += ELEMENT_FIELDS
SOLVER = {"newton", "krylov", "rung", "residual"}
"""What rounding decides of a step."""


def target(mesh):
    """Return the places of a body that has grown and bent."""
    offset = mesh.vertices - CENTRE_MM
    bent = 0.5 * np.sin(offset[:, [1, 2, 0]] / 8.0)
    return CENTRE_MM + offset * [1.05, 1.03, 1.08] + bent


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_of_a_simulation(recorded, tmp_path, kind):
    mesh = quadratic(uneven_body(3)) if "quadratic" in kind else uneven_body(4)
    settings = {"fields": FIELDS if "rates" in kind else ["displacement", "growth"]}
    parameters = parameters_from(RUN | KINDS[kind] | settings)
    maps = {}
    if "shapes" in kind:
        for axis, values in zip("xyz", target(mesh).T, strict=True):
            maps[f"target_{axis}"] = values
    zones = zones_of_run(mesh, parameters)
    run.run(MPI.COMM_SELF, mesh, zones, parameters, maps, tmp_path)
    steps = pd.read_csv(tmp_path / "steps.csv")
    untold = [name for name in steps if "seconds" in name or name.endswith("_mib")]
    summary = read_json(tmp_path / "summary.json")
    told = ("steps", "reached_week", "weeks", "missed")
    totals = {"newton": "sum", "krylov": "sum", "min_J": "min"}
    found = {name: summary[name] for name in totals}
    assert found == pytest.approx(steps.agg(totals).to_dict())
    assert summary["seconds_per_step"] == pytest.approx(steps["seconds"].median())
    recorded(
        {
            "steps": steps.drop(columns=[*untold, *SOLVER.intersection(steps)]),
            "summary": {name: summary[name] for name in told if name in summary},
            "frames": contents(tmp_path / "frames.h5"),
        },
        rtol=5e-3,
    )


def test_numbers_of_layers_and_zones(recorded):
    mesh = uneven_body(6)
    parameters = parameters_from(RUN)
    planes = parameters_from(RUN | KINDS["rates, planes, ellipsoid"])
    search = layers.PialSearch(mesh.vertices, zones_of_run(mesh, parameters).facets)
    distance, normals = search.distance_and_normals(mesh.vertices, np.inf)
    thickness = 2.0 + smooth_field(mesh.vertices)
    weight = layers.cortical_weight(distance, thickness)
    zones = zones_of_run(mesh, planes, 2.0)
    names = ["distance", "cortex_weight", "shear_modulus", "growth", "zone"]
    maps = {"thickness_mm": thickness}
    growths = growth.increments(parameters, weight, zones.growing, {}, 21.5, 1e5)
    inputs = growth.GrowthInputs(mesh, zones, {})
    before = inputs.size(mesh.vertices)
    after = inputs.size(mesh.vertices * 1.01)
    first = growth.StepStart(mesh.vertices, 0.0, planes.step_s)
    by_rates = growth.GrowthByRates(planes, first)
    is_left = x_of(mesh) < CENTRE_MM[0]
    recorded(
        {
            "distance": distance,
            "normals": normals,
            "weight": weight,
            "modulus": layers.shear_modulus(parameters, weight, maps, 21.5),
            "zones": zones,
            "free zones": zones_of_run(mesh, parameters),
            "report": zone_report(mesh, zones, 4.0),
            "fields": output.layer_fields(
                mesh.vertices, zones, by_rates, {}, 21.5, names[:4]
            ),
            "increments": growths,
            "sizes": [before, after],
            "rates": before.rates_to(after, 1e5),
            "free growth": steering._free_growth(
                parameters, mesh.vertices, inputs, 21.5
            ),
            "regions": start_regions(mesh, planes, {}, lambda _: is_left),
        },
        rtol=1e-3,
    )


def x_of(mesh):
    """Return the x of the centres of a body's boundary facets."""
    return corners(boundary_surface(mesh)[0])[:, :, 0].mean(axis=1)


def test_numbers_of_growth_on_a_path(recorded):
    mesh = uneven_body(4)
    p = parameters_from(RUN | KINDS["shapes"])
    inputs = growth.GrowthInputs(mesh, zones_of_run(mesh, p), {})
    path = path_through([21.0, 22.0], [mesh.vertices, target(mesh)], mesh)
    vertices = np.arange(len(mesh.vertices))
    elements = Elements(mesh.tets, vertices, IntegrationPoints.for_order(1))
    off = mesh.vertices + 0.3 * np.sin(mesh.vertices[:, [1, 2, 0]])
    starts = {
        "on the path": growth.StepStart(mesh.vertices, 0.0, p.step_s),
        "off the path": growth.StepStart(off, 0.0, p.step_s),
        "past its end": growth.StepStart(off, 500_000.0, p.step_s),
    }
    results = {}
    for name, start in starts.items():
        step = targets.growth_on_path(p, inputs, path, start)
        positions = start.positions_mm * 1e-3
        step.inverse(Tissue.of(elements, positions, inputs.zones, {}, p, 21.0))
        results[name] = {
            "goal": step.goal_mm,
            "misfit": step.misfit_mm,
            "shrinking": step.shrinking[-1],
        }
    recorded(results, rtol=1e-3)


def test_numbers_of_tensors(recorded):
    mesh = uneven_body(3)
    gradients = stretches.deformation_gradients(
        mesh.vertices, target(mesh), mesh.tets, SLOPES[None]
    )
    flat = gradients.reshape(-1, 3, 3)
    logs = stretches.log_stretch(flat, limit=0.06)
    powers = np.where(np.arange(len(flat)) % 2, 1.0, 0.4)
    recorded(
        {
            "gradients": flat,
            "packed": stretches.packed(logs),
            "unpacked": stretches.unpacked(stretches.packed(logs)),
            "inverse growth": stretches.inverse_growth(flat, powers, 0.05),
            "left logs": stretches.log_stretch(flat, left=True),
            "left": stretches.left_stretch(flat, 0.4),
            "relaxed": stretches.relaxed(stretches.left_stretch(flat), 0.3, 1.2),
        },
        rtol=1e-3,
    )


def test_numbers_of_parts_and_contact(recorded):
    mesh = uneven_body(4)
    part = bisect_points(mesh.vertices, 5)
    arms = part_arms(mesh.vertices, part)
    recorded(
        {
            "parts": part,
            "arms": arms,
            "motions": rigid_motions(arms),
            "stiffening": [_stiffening(gap) for gap in (1e-9, 0.01, 0.3, np.inf)],
        }
    )


def test_numbers_of_an_elastic_fit(recorded):
    mesh = uneven_body(4)
    body = elastic_fit.ElasticFit(mesh)
    goals = body.boundary.vertices + 0.8 * np.sin(body.boundary.vertices / 5.0)
    drawn = body.draw(goals)
    followed = elastic_fit.ElasticFit(mesh).follow(target(mesh))
    recorded({"drawn": drawn, "followed": followed}, rtol=5e-3)


def test_numbers_of_the_steps_of_an_elastic_fit(recorded, monkeypatch):
    mesh = uneven_body(4)
    inside = np.setdiff1d(np.arange(len(mesh.vertices)), boundary_surface(mesh)[1])
    element = mesh.tets[(mesh.tets == inside[5]).any(axis=1)][0]
    others = element[element != inside[5]]
    way = mesh.vertices[others].mean(axis=0) - mesh.vertices[inside[5]]
    flat = mesh.vertices.copy()
    flat[inside[5]] += 0.9 * way
    outer = mesh.tets[~np.isin(mesh.tets, inside).any(axis=1)][0]
    pressed = flat.copy()
    pressed[outer[0]] += 0.95 * (flat[outer[1:]].mean(axis=0) - flat[outer[0]])
    steps = []

    def note_step(self, goals, lengths, strain):
        steps.append({"goals": goals, "lengths": lengths, "strain": strain})
        return "not solved"

    monkeypatch.setattr(elastic_fit.ElasticFit, "_step", note_step)
    body = elastic_fit.ElasticFit(mesh)
    used = boundary_surface(mesh)[1]
    goals = mesh.vertices[used] + 0.8 * np.sin(mesh.vertices[used] / 5.0)
    goals[::20] += [4.0, -3.0, 2.0]
    body.follow(target(mesh))
    body.positions_mm = pressed
    body.draw(goals)
    body.draw(body.boundary.vertices + 0.2 * (goals - body.boundary.vertices))
    body._springs.draw_to(
        goals, vertex_areas(body.boundary), np.linspace(1, 2, len(used))
    )
    recorded(
        {
            "steps": [step for step in steps if step["strain"] is not None],
            "drawn": [step["goals"] for step in steps if step["strain"] is None],
            "lengths": [step["lengths"] for step in steps],
            "springs": body._springs.energy(np.zeros((len(mesh.vertices), 3))),
            "flattening": body._flattening()[:, 0],
            "opened": body._opened(pressed),
            "distance": body._distance(mesh.vertices, target(mesh)),
            "untangled": body._untangled(mesh.vertices, flat, (1.0, 2.0))[0],
        },
        rtol=1e-3,
    )
