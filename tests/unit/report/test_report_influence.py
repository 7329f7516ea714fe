"""Figures of a study show every member, and name the one that is nearest."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from shapes import ellipsoid_mesh

from gyriflow.errors import InputError
from gyriflow.geometry.tetrahedra import boundary_faces, boundary_surface
from gyriflow.geometry.triangles import TriangleMesh
from gyriflow.parameters.terms import FREE, LEFT_CONTACT
from gyriflow.report.contact_scheme import barrier_law, contact_scheme, penalty_law
from gyriflow.report.cost import MOST_STAGES, cost_chart
from gyriflow.report.cut_mesh import CORE_COLOUR, CORTEX_COLOUR, mesh_picture
from gyriflow.report.influence import ABSENT, influence_picture, influence_spectra, nearest_chart
from gyriflow.report.outlines import outlines_chart
from gyriflow.report.style import SIMULATED_SURFACE_COLOUR

BALL = ellipsoid_mesh(8, (20.0, 26.0, 18.0))
SURFACE, _ = boundary_surface(BALL)


def words(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.findobj(mpl.text.Text)}


def spectrum(run: str, power: float) -> pd.DataFrame:
    columns = {"run": run, "week": 28.0, "band": [4, 5, 6], "relative_power": [power, power / 2, power / 4]}
    sides = [pd.DataFrame(columns | {"hemisphere": side}) for side in ("left", "right")]
    return pd.concat(sides).assign(complete=True, denominator_complete=True, resolved=True)


def distances(values: dict[float, float], flag: str = "ok", **labels: str) -> pd.DataFrame:
    table = pd.DataFrame({"thickness_mm": list(values), "distance": list(values.values())})
    return table.assign(unit="mm", flag=flag, **({"hemisphere": "whole", "measure": "hausdorff95"} | labels))


def test_a_study_has_renders_and_maps_of_all_members_and_says_which_did_not_come_so_far():
    values = np.linspace(-1, 1, len(SURFACE.vertices))
    members = {"0.8 mm": None, "1.5 mm": (SURFACE, values), "2.25 mm": (SURFACE, values)}
    figure = influence_picture(members, (SURFACE, values), views=("left",), measured="real brain")
    shown = [axes for axes in figure.axes if axes.images]
    assert len(shown) == 6
    assert {"0.8 mm", "1.5 mm", "2.25 mm", "real brain", ABSENT, "a", "b"} <= words(figure)
    (bar,) = [axes for axes in figure.axes if "shape index" in axes.get_xlabel()]
    assert bar.get_xlim() == (-1.0, 1.0)
    last = np.asarray(shown[2].images[0].get_array())
    tone = last[(last < 250).any(axis=-1)].mean(axis=0)
    # the measured brain is beige
    assert tone[0] > tone[2]


def test_spectra_of_a_study_stand_in_its_order_from_pale_to_dark():
    spectra = pd.concat([spectrum("c", 0.3), spectrum("a", 0.1), spectrum("b", 0.2), spectrum("real", 0.15)])
    figure = influence_spectra(spectra, {"a": "0.8 mm", "b": "1.5 mm", "c": "6 mm"}, week=28.0)
    left = figure.axes[0]
    assert [bar.get_height() for bar in left.patches[::3]] == pytest.approx([0.1, 0.2, 0.3])
    brightness = [sum(bar.get_facecolor()[:3]) for bar in left.patches[::3]]
    assert brightness == sorted(brightness, reverse=True)
    assert [text.get_text() for text in figure.legends[0].get_texts()][:3] == ["0.8 mm", "1.5 mm", "6 mm"]


def test_the_nearest_member_is_named_and_one_that_is_not_trusted_is_not_it():
    good = distances({0.8: 3.0, 1.5: 2.0, 2.25: 1.0})
    bad = distances({6.0: 0.1}, flag="not resolved by the mesh")
    figure = nearest_chart(pd.concat([good, bad]), varied="thickness_mm", parameter="cortical thickness (mm)")
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.texts] == ["2.25"]
    assert axes.get_xlabel() == "cortical thickness (mm)"
    assert "hausdorff95 (mm)" in axes.get_title()
    faces = [
        line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o" and line.get_markersize() == 4.5
    ]
    assert [face == "white" for face in faces] == [False, False, False, True]


def test_hemispheres_are_drawn_apart_and_the_published_value_is_a_line():
    table = pd.concat(
        [
            distances({1.0: 2.0, 2.0: value}, hemisphere=side, measure="B4")
            for side, value in (("left", 1.0), ("right", 3.0))
        ]
    )
    figure = nearest_chart(table, varied="thickness_mm", parameter="H", published={"B4": 2.25})
    (axes,) = figure.axes
    assert sorted(text.get_text() for text in axes.texts) == ["1", "2"]
    assert [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == "--"] == [2.25]


def test_a_study_without_distances_is_refused():
    with pytest.raises(InputError, match="no distance"):
        nearest_chart(distances({1.0: np.nan}), varied="thickness_mm", parameter="H")


def test_the_mesh_is_cut_open_with_cortex_and_core_apart():
    deep = np.linalg.norm(BALL.vertices[BALL.tets].mean(axis=1) / [20.0, 26.0, 18.0], axis=1)
    figure = mesh_picture(BALL, deep > 0.7)
    whole, front, _ = (np.asarray(axes.images[0].get_array()).astype(int) for axes in figure.axes if axes.images)

    def share(image, colour):
        tone = np.array(mpl.colors.to_rgb(colour)) * 255
        inside = (image < 250).any(axis=-1)
        near = [
            image[inside] @ other / np.linalg.norm(image[inside], axis=1) / np.linalg.norm(other)
            for other in (
                np.array(mpl.colors.to_rgb(each)) * 255
                for each in (SIMULATED_SURFACE_COLOUR, CORTEX_COLOUR, CORE_COLOUR)
            )
        ]
        index = [SIMULATED_SURFACE_COLOUR, CORTEX_COLOUR, CORE_COLOUR].index(colour)
        assert tone is not None
        return float((np.argmax(near, axis=0) == index).mean())

    assert share(whole, SIMULATED_SURFACE_COLOUR) > 0.8
    assert share(front, CORTEX_COLOUR) > 0.2
    assert share(front, SIMULATED_SURFACE_COLOUR) < 0.2


def test_outlines_are_those_of_both_brains_at_one_scale():
    bigger = TriangleMesh(1.1 * SURFACE.vertices, SURFACE.faces)
    figure = outlines_chart({21.0: (SURFACE, SURFACE), 22.0: (SURFACE, bigger)}, planes=("axial",))
    first, second = figure.axes
    assert np.ptp(first.get_xlim()) == np.ptp(second.get_xlim())
    real, simulated = (np.concatenate(lines.get_segments()) for lines in second.collections)
    assert np.ptp(real[:, 0]) == pytest.approx(44.0, rel=0.01)
    assert np.ptp(simulated[:, 0]) == pytest.approx(40.0, rel=0.01)
    assert {"simulated", "real brain", "21 GW", "22 GW"} <= words(figure)


def test_a_penalty_presses_only_beyond_the_plane():
    law = penalty_law(5e5)
    assert law.pressure[law.at <= 0].max() == 0
    assert law.pressure[-1] == pytest.approx(500.0)


def test_a_barrier_repels_more_the_nearer_and_not_beyond_its_distance():
    law = barrier_law(lambda squared, reach: -((squared - reach) ** 2) * np.log(squared / reach))
    assert (np.diff(law.pressure[law.at < 1]) < 0).all()
    assert law.pressure[law.at > 1].max() == 0
    assert np.interp(0.5, law.at, law.pressure) == pytest.approx(1.0, rel=1e-2)


def test_the_scheme_shows_the_planes_where_there_are_any():
    facets = boundary_faces(BALL)[0]
    mesh = TriangleMesh(BALL.vertices, facets)
    zones = np.where(mesh.vertices[facets][:, :, 0].mean(axis=1) < 0, LEFT_CONTACT, FREE)
    law = penalty_law(5e5)
    with_planes = contact_scheme(mesh, zones, law, planes_mm=(-0.5, 0.5))
    planes = [line.get_xdata()[0] for line in with_planes.axes[0].lines if line.get_linestyle() == "--"]
    assert planes == [-0.5, 0.5]
    assert "left contact" in words(with_planes)
    without = contact_scheme(mesh, zones, law, planes_mm=None, distance="d̂ = 0.2 mm")
    assert "left contact" not in words(without)


def test_cost_has_the_longest_stages_first_and_the_others_together():
    count = MOST_STAGES + 3
    stages = pd.DataFrame(
        {
            "stage": [f"s{i}" for i in range(count)],
            "run": "",
            "wall_s": 60.0,
            "cpu_s": 60.0 * np.arange(1, count + 1),
            "energy_kWh": 1e-3,
        }
    )
    figure = cost_chart(stages)
    times, energy = figure.axes
    labels = [label.get_text() for label in times.get_yticklabels()]
    assert labels[0] == f"s{count - 1}"
    assert labels[-1] == "3 other stages"
    assert energy.patches[-1].get_width() == pytest.approx(3.0)
