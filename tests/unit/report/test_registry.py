"""The registry of figures: what each is drawn by takes what it gives, and what the workflow works out for it."""

import inspect
from importlib import import_module

import h5py
import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure as Drawing
from scripts import SCRIPTS, run_script
from shapes import box

from gyriflow.io.files import write_json
from gyriflow.study import resolve
from gyriflow.study.figures import asked_for, by_rule, figures_of
from gyriflow.study.loading import load
from gyriflow.units import SECONDS_PER_GW

WORDS = yaml.safe_load((SCRIPTS.parent / "report" / "figures.yaml").read_text())
SHAPE = {"semi_axes_mm": [20, 26, 18]}
BRAINS = [{"id": name, "week": week, "shape": SHAPE} for name, week in (("a", 21), ("b", 22), ("c", 23))]
STUDY = {"brains": BRAINS, "start": "a", "folding": {"end_week": 22}, "runs": {"thin": {}, "thick": {}}}
STUDY |= {"studies": {"rate": {"base": "thin", "vary": {"growth_rate_per_s": [1e-7, 2e-7]}, "compare_week": 22}}}


def registry():
    return figures_of(resolve(load(STUDY)))


def rows_of(rule):
    return list(by_rule(registry())[rule].values())


@pytest.mark.parametrize("rule", by_rule(registry()))
def test_a_figure_gives_its_function_what_that_takes(rule):
    (row, *_) = rows_of(rule)
    given = {**row.inputs, **row.options}
    code = (SCRIPTS / "draw.py").read_text()
    if f"\ndef {rule}(" in code:
        names = code.partition(f"\ndef {rule}(")[2].partition(")")[0].split(", ")
        assert {name for name in names if not name.startswith("**")} <= set(given)
    else:
        module, _, function = row.draw.rpartition(".")
        inspect.signature(getattr(import_module(f"gyriflow.report.{module}"), function)).bind(**given)


def test_all_files_are_drawn_once_and_the_report_has_words_on_them():
    figures = registry()
    assert len({figure.path for figure in figures}) == len(figures)
    assert {figure.name for figure in figures if figure.target} - set(WORDS) == {"view_surfaces", "small_pictures"}
    for figure in figures:
        words = WORDS.get(figure.name, {"title": "", "caption": ""})
        assert "{" not in (words["title"] + words["caption"]).format(**figure.names)


def test_runs_that_start_alike_have_one_figure_of_their_zones_which_the_paper_alone_asks_for():
    figures = registry()
    zones = ["results/runs/thin/a/figures/zones.png", "results/runs/thin/a/figures/zones.pdf"]
    assert [file for file in asked_for(figures, "paper") if "/zones." in file] == zones
    assert not any("/zones." in file for file in asked_for(figures, "figures"))


def test_simulated_and_measured_brains_are_not_exchanged():
    for rule in ("weekly_figure", "outlines_figure"):
        (row,) = rows_of(rule)
        real = {21.0: "results/brains/a/surface", 22.0: "results/brains/b/surface"}
        assert row.inputs["real"] == {week: f"{folder}/pial.surf.gii" for week, folder in real.items()}
        for run, surfaces in row.inputs["runs"].items():
            assert surfaces == {w: f"results/runs/{run}/a/surfaces/week-{w:.2f}/pial.surf.gii" for w in (21.0, 22.0)}
    (row,) = rows_of("shape_maps")
    for group, weeks in row.inputs["brains"].items():
        folder = "results/brains/" if group == "ellipsoid" else f"results/runs/{group}/a/"
        assert all(maps.startswith(folder) for halves in weeks.values() for _, maps in halves)


def test_members_of_a_study_that_ended_before_have_no_files():
    (row,) = rows_of("influence_figure")
    ended = row.may_end[1]
    assert ended[1:] == ("a", 22)
    members = row.inputs_without([ended[0]])["members"]
    assert [run for run, halves in members.items() if halves is None] == [ended[0]]
    assert row.inputs_without([]) == row.inputs


def drawn(monkeypatch, tmp_path, rule, draw, inputs, **options):
    """Run the script of figures for a rule and return what it has the report's function draw."""
    module, _, function = draw.rpartition(".")
    given = {}

    def noted(**content):
        given.update(content)
        return Drawing()

    monkeypatch.setattr(import_module(f"gyriflow.report.{module}"), function, noted)
    params = {"draw": draw, "inputs": inputs, "options": options}
    run_script("draw.py", tmp_path, {}, {0: "a.png", 1: "a.pdf"}, params, rule=rule)
    return given


RUN = {"start_week": 21, "end_week": 22, "output_weeks": [21, 22], "fissure_x_mm": 0.0}
CORNERS = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])


@pytest.fixture
def frames(tmp_path):
    """A tetrahedron that grows by a fifth from 21 to 22 GW."""
    path = tmp_path / "frames.h5"
    with h5py.File(path, "w") as file:
        file["tets"] = [[0, 1, 2, 3]]
        for week, size in ((21, 1.0), (22, 1.2)):
            group = file.create_group(f"week_{week}.00")
            group["positions"] = size * CORNERS
            group["tangential_growth_per_step"] = np.full(4, 0.01)
            group["growth_direction_per_step"] = np.eye(4, 3)
    return str(path)


def test_displacement_is_between_the_weeks_on_the_later_surface(monkeypatch, tmp_path, frames):
    maps = drawn(monkeypatch, tmp_path, "displacement_maps", "pictures.displacement_maps", {"frames": {"thin": frames}})
    ((interval, (surface, norms)),) = maps["displacements"]["thin"].items()
    assert interval == (21.0, 22.0)
    assert sorted(norms) == pytest.approx([0, 2, 2, 2])
    assert surface.vertices.max() == pytest.approx(12)


def test_growth_of_area_is_shown_on_the_later_surface(monkeypatch, tmp_path, frames):
    settings = tmp_path / "params.yaml"
    settings.write_text(yaml.safe_dump(RUN | {"step_s": SECONDS_PER_GW / 4}))
    inputs = {"frames": frames, "params": str(settings)}
    growth = drawn(monkeypatch, tmp_path, "growth_found_figure", "pictures.scalar_maps", inputs)
    ((interval, (surface, values)),) = growth["maps"]["growth"].items()
    assert (interval, surface.vertices.max()) == ((21.0, 22.0), pytest.approx(12))
    # four steps a week, in both directions of the surface
    assert values == pytest.approx(100 * np.expm1(2 * 4 * 0.01))
    assert growth["directions"][interval].shape == (4, 3)


def test_outlines_are_laid_onto_the_real_brain(monkeypatch, tmp_path):
    real = box((20.0, 30.0, 10.0))
    moved = type(real)(real.vertices + [5.0, -3, 2], real.faces)
    brains = {"runs": {"thin": {22.0: moved}}, "real": {22.0: real}}
    aligned = drawn(monkeypatch, tmp_path, "outlines_figure", "sections.outlines_chart", brains, measured="real brain")
    assert aligned["runs"]["thin"][22.0].vertices == pytest.approx(real.vertices, abs=1e-3)
    assert aligned["measured"] == "real brain"


def test_files_are_read_wherever_they_stand_among_the_inputs(monkeypatch, tmp_path):
    write_json(tmp_path / "quality.json", {"tets": 7})
    inputs = {"quality": {"a": str(tmp_path / "quality.json")}, "ceiling": None}
    given = drawn(monkeypatch, tmp_path, "mesh_quality", "tables.mesh_quality_table", inputs, gates={})
    assert given == {"quality": {"a": {"tets": 7}}, "ceiling": None, "gates": {}}
