"""The registry of figures: what each is drawn by takes what it gives, and the report
has words on it."""

import inspect
from importlib import import_module

import h5py
import numpy as np
import pandas as pd
import pytest
import yaml
from matplotlib.figure import Figure as Drawing
from scripts import run_script

from gyriflow.growth.rates import growth_per_week, growth_sd
from gyriflow.io.files import write_json, write_table
from gyriflow.io.frames import read_pial_frames
from gyriflow.report.page import caption_html
from gyriflow.shipped import DEMO, SHIPPED
from gyriflow.study import figures, resolve
from gyriflow.study.figures import figures_of
from gyriflow.study.loading import load
from gyriflow.study.registry import by_rule, files_in, kinds, target_files
from gyriflow.units import SECONDS_PER_GW

KINDS = list(kinds().values())
SHAPE = {"semi_axes_mm": [20, 26, 18]}
BRAINS = [
    {"id": name, "week": week, "shape": SHAPE}
    for name, week in (("a", 21), ("b", 22), ("c", 23))
]
STUDY = {
    "brains": BRAINS,
    "start": "a",
    "folding": {"end_week": 22},
    "runs": {"thin": {}, "thick": {}},
}
STUDY |= {
    "studies": {
        "rate": {
            "base": "thin",
            "vary": {"growth_rate_per_s": [1e-7, 2e-7]},
            "compare_week": 22,
        }
    }
}


LABELS = (
    SHIPPED
    / "atlases"
    / "spina-bifida"
    / "fetal_SB_atlas_GA21_notoperated"
    / "parcellation.nii.gz"
)
OWN, OTHERS = (
    [
        {
            "id": f"{name}{week}",
            "week": week,
            "population": name,
            "labels": str(LABELS),
            "scheme": "spina-bifida-atlas",
        }
        for week in weeks
    ]
    for name, weeks in (("own", (22, 23)), ("atlas", (21, 22, 23, 24)))
)
ALONE = {
    "brains": [*OWN[:1], *OTHERS],
    "start": "own22",
    "folding": {"end_week": 23, "preset": "expected"},
}
PREDICTION = ALONE | {
    "brains": [*OWN, *OTHERS],
    "runs": {"expected": {"ensemble": 3}, "plain": {"preset": "fetalfoldsim"}},
}
PREDICTION |= {
    "metrics": {"regions": {"own22": {"volume": str(LABELS), "names": {5: "cortex"}}}}
}
EXAMPLES = SHIPPED / "config" / "examples"


def registry(study=STUDY):
    return figures_of(resolve(load(study)))


def examples():
    """Return the figures of studies that together have all kinds."""
    shipped = (
        EXAMPLES / f"{name}.yaml"
        for name in ("spina-bifida-atlas", "calibration", "paper")
    )
    studies = (
        resolve(load(yaml.safe_load(path.read_text()), EXAMPLES))
        for path in (DEMO, *shipped)
    )
    return [*map(figures_of, studies), *map(registry, (STUDY, ALONE, PREDICTION))]


def jobs_of(rule):
    return by_rule(registry())[rule]


def drawing_function(kind):
    module, _, function = kind.draw.partition(".")
    return getattr(import_module(f"gyriflow.report.{module}"), function)


def test_kinds_have_names_and_files_of_their_own():
    assert (
        len({kind.name for kind in KINDS})
        == len({kind.file for kind in KINDS})
        == len(KINDS)
        > 30
    )


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_kind_is_drawn_by_a_function_of_the_report_and_has_all_words_or_none(kind):
    assert not kind.draw or callable(drawing_function(kind))
    assert len({bool(words) for words in (kind.section, kind.title, kind.caption)}) == 1
    assert "system-message" not in caption_html(kind.caption)
    # what the target `paper` alone asks for is not in the report
    assert kind.targets
    assert not (kind.section and set(kind.targets) == {"paper"})


def test_every_function_of_figures_is_of_an_entry():
    functions = set(figures.FIGURES)
    assert functions < {kind.name for kind in KINDS}
    # a function says itself of what there is a figure
    assert {(kind.each, kind.needs) for kind in KINDS if kind.name in functions} == {
        ("study", "")
    }


def test_figures_give_their_function_its_arguments_and_fill_in_texts_and_file_names():
    found = [figure for study in examples() for figure in study]
    assert {figure.kind.name for figure in found} == {kind.name for kind in KINDS}
    for figure in found:
        if figure.kind.draw:
            inspect.signature(drawing_function(figure.kind)).bind(
                **figure.inputs, **figure.options
            )
        assert "{" not in "".join(
            (figure.kind.title + figure.kind.caption).format(**figure.names)
        )
        assert "{" not in "".join(figure.files)


def test_all_files_are_drawn_once_and_jobs_of_a_rule_alike():
    for study in examples():
        files = [file for figure in study for file in figure.files]
        assert len(set(files)) == len(files)
        for jobs in by_rule(study).values():
            assert len({tuple(figure.kind for figure in job) for job in jobs}) == 1


def test_the_paper_stands_in_its_own_figures_alone():
    published = {
        figure.path
        for figure in registry()
        if any("published" in file for file in files_in(figure.inputs))
    }
    assert published == {
        "results/study/figures/displacement_paper.png",
        "results/study/rate/figures/nearest_paper.png",
    }
    targets = (
        "figures",
        "growth",
        "validate",
        "influence_figures",
        "report",
        "brain",
        "quality",
    )
    assert not published & set(target_files(registry(), *targets))
    assert published < set(target_files(registry(), "paper"))


def test_runs_that_start_alike_have_one_figure_of_zones_which_only_the_paper_asks_for():
    figures = registry()
    zones = [
        "results/runs/thin/a/figures/zones.png",
        "results/runs/thin/a/figures/zones.pdf",
    ]
    assert [
        file for file in target_files(figures, "paper") if "/zones." in file
    ] == zones
    assert not any("/zones." in file for file in target_files(figures, "figures"))


def test_simulated_and_measured_brains_are_not_exchanged():
    ((*rows, displacement),) = jobs_of("folding_figures")
    assert displacement.inputs["frames"] == {
        run: f"results/runs/{run}/a/folding/frames.h5" for run in ("thin", "thick")
    }
    for row in rows:
        real = {21.0: "results/brains/a/surface", 22.0: "results/brains/b/surface"}
        assert row.inputs["observed"] == {
            week: f"{folder}/pial.surf.gii" for week, folder in real.items()
        }
        for run, surfaces in row.inputs["runs"].items():
            assert surfaces == {
                w: f"results/runs/{run}/a/surfaces/week-{w:.2f}/pial.surf.gii"
                for w in (21.0, 22.0)
            }
    ((row,),) = jobs_of("shape_maps")
    for group, weeks in row.inputs["brains"].items():
        folder = (
            "results/brains/" if group == "ellipsoid" else f"results/runs/{group}/a/"
        )
        assert all(
            maps.startswith(folder) for halves in weeks.values() for _, maps in halves
        )


def test_members_of_a_study_that_ended_before_have_no_files():
    ((row,),) = jobs_of("influence_figure")
    assert row.may_end == ("a", 22)
    ended = list(row.inputs["members"])[1]
    members = row.reached_inputs(lambda run, *_: run != ended)["members"]
    assert [run for run, halves in members.items() if halves is None] == [ended]
    assert row.reached_inputs(lambda *_: True) == row.inputs


def drawn(monkeypatch, tmp_path, draw, inputs, **options):
    """Run the script of figures and return what it has the report's function draw."""
    module, _, function = draw.partition(".")
    given = {}

    def noted(**content):
        given.update(content)
        return Drawing()

    monkeypatch.setattr(import_module(f"gyriflow.report.{module}"), function, noted)
    files = [str(tmp_path / name) for name in ("a.png", "a.pdf")]
    figure = {"draw": draw, "inputs": inputs, "options": options, "files": files}
    run_script("draw.py", tmp_path, {}, {}, {"figures": [figure]})
    assert all((tmp_path / name).is_file() for name in ("a.png", "a.pdf"))
    return given


RUN = {"start_week": 21, "end_week": 22, "output_weeks": [21, 22], "fissure_x_mm": 0.0}
CORNERS = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
INSIDE = np.array([[2.0, 2, 2]])


@pytest.fixture
def frames(tmp_path):
    """A tetrahedron of four, with a node inside, that grows by a fifth from 21 to 22
    GW."""
    path = tmp_path / "frames.h5"
    with h5py.File(path, "w") as file:
        file["tets"] = [[0, 1, 2, 4], [0, 1, 4, 3], [0, 4, 2, 3], [4, 1, 2, 3]]
        for week, size in ((21, 1.0), (22, 1.2)):
            group = file.create_group(f"week_{week}.00")
            group["positions"] = size * np.concatenate([CORNERS, INSIDE])
            group["tangential_growth_per_step"] = [0.01] * 4 + [9.0]
            group["radial_growth_per_step"] = [0.02] * 4 + [9.0]
            group["growth_direction_per_step"] = np.eye(5, 3)
            group["cell_fields/J"] = np.ones(4)
    return str(path)


def test_growth_is_that_of_a_week_up_to_the_later_frame(frames):
    ((interval, maps),) = growth_per_week(
        read_pial_frames(frames), SECONDS_PER_GW / 4
    ).items()
    assert interval == (21.0, 22.0)
    # four steps a week, in both directions of the surface
    assert maps["area_growth_percent_per_gw"] == pytest.approx(
        np.full(4, 100 * np.expm1(2 * 4 * 0.01))
    )
    assert maps["thickness_growth_percent_per_gw"] == pytest.approx(
        np.full(4, 100 * np.expm1(4 * 0.02))
    )
    assert maps["growth_direction_y"] == pytest.approx([0, 4, 0, 0])
    repeats = [maps, {name: values + 2.0 for name, values in maps.items()}]
    found = growth_sd(maps, repeats)
    assert set(found) == {
        "area_growth_percent_per_gw",
        "thickness_growth_percent_per_gw",
    }
    assert found["area_growth_percent_per_gw"] == pytest.approx(np.full(4, np.sqrt(2)))
    assert np.isnan(growth_sd(maps, repeats[:1])["area_growth_percent_per_gw"]).all()


def test_files_are_read_wherever_they_stand_among_the_inputs(
    monkeypatch, tmp_path, frames
):
    write_json(tmp_path / "quality.json", {"tets": 7})
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(RUN))
    (tmp_path / "published.yaml").write_text("nearest: []")
    write_table(tmp_path / "spectra.csv", pd.DataFrame({"week": [21.0]}))
    at = {
        name: str(tmp_path / name)
        for name in ("quality.json", "params.yaml", "published.yaml", "spectra.csv")
    }
    inputs = {
        "quality": {"a": at["quality.json"]},
        "small": None,
        "tables": [at["spectra.csv"]],
    }
    inputs |= {
        "frames": {"thin": frames},
        "params": at["params.yaml"],
        "published": at["published.yaml"],
    }
    given = drawn(monkeypatch, tmp_path, "tables.mesh_quality_table", inputs, gates={})
    assert (given["quality"], given["small"], given["gates"]) == (
        {"a": {"tets": 7}},
        None,
        {},
    )
    assert given["params"].end_week == 22
    assert given["published"] == {"nearest": []}
    assert given["tables"][0]["week"].tolist() == [21.0]
    assert list(given["frames"]["thin"]) == [21.0, 22.0]
