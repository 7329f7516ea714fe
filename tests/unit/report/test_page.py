"""The report is one page with everything inside, and tells no paths.

What pages say is recorded by `seen`, a line of the page each.
"""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from markupsafe import Markup
from text_tables import frame

from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.atlas_curves import CURVES, DIFFERENCES
from gyriflow.report.measures import Tables
from gyriflow.report.methods import methods_text
from gyriflow.report.page import (
    brain_page,
    caption_html,
    hide_paths,
    page_figures,
    report_page,
    study_page,
)
from gyriflow.report.tables import html_table, resolution_over_steps
from gyriflow.settings.terms import SPREAD_UNKNOWN
from gyriflow.shipped import SHIPPED

PAGE = Path(__file__).parents[3] / "workflow" / "report" / "page"
PARTS = {
    "style": "style.css",
    "three": "three.min.js",
    "controls": "OrbitControls.min.js",
    "viewer": "viewer.js",
    "notice": "three.LICENSE.txt",
}
BRAIN = {"population": "healthy", "source": "labels", "synthetic": False}
YOUNG = {"id": "young", "week": 21.0, "licence": "CC0 1.0", "covariates": {"sex": "F"}}
OLD = {"id": "old", "week": 23.0, "licence": None, "covariates": {}}
BRAINS = [BRAIN | YOUNG, BRAIN | OLD]
PICTURES = {"young": ("data:image/webp;base64,AAAA", 1.5)}
RUNS = frame(
    """
    run  subject start_week preset   end_week min_J elements_through_cortex order
    thin young   21         measured 23       0.9   1.2                     1
    """,
    weeks="[21.0, 22.0]",
    initial_penetration_mm=0.0,
    least_elements_through_cortex=1.1,
    unresolved_from_week=21.5,
    **{"growth.model": "rates"},
)
VALIDATION = frame(
    """
    week area_difference volume_difference distance_mm r_shape_index
    22   0.1             0.0               0.1         0.1
    23   -0.0794         0.02              0.42        0.566
    """,
    run="thin",
    kind="predicted",
    start="young",
    start_week=21.0,
    r_start_shape_index=[0.1, 0.568],
    r_low_shape_index=[0.0, 0.51],
    r_high_shape_index=[0.2, 0.61],
    gain_shape_index=[0.0, -0.002],
    gain_low_shape_index=[0.0, -0.044],
    gain_high_shape_index=[0.0, 0.045],
)
WARNING = {"step": "s", "level": "warning"}
NO_WARNINGS = pd.DataFrame({"subject": [], "run": [], "level": [], "message": []})
QUALITY = frame(
    "subject\nyoung\nold",
    verdict=["needs review", "refused"],
    cause=[np.nan, "cropped"],
    warnings=["a bridge was cut", np.nan],
)
METRICS = frame(
    """
    subject run      week hemisphere metric           value unit
    young   observed 21   whole      volume           46.2  mL
    young   observed 21   whole      area             90    cm2
    young   observed 21   left       area             44    cm2
    young   observed 21   whole      mean_shape_index -0.02 1
    """
)
# one is signed, of which a share means nothing
CENTILES = METRICS.drop(index=2).assign(
    expected=[40.0, 100.0, 0.02],
    z=[1.2, np.nan, np.nan],
    centile=[88.4, np.nan, np.nan],
    centile_low=[70.0, np.nan, np.nan],
    centile_high=[96.0, np.nan, np.nan],
    flag=["ok", SPREAD_UNKNOWN, SPREAD_UNKNOWN],
)
UNRATED = CENTILES.assign(centile=np.nan, expected=np.nan)
MEASURES = {"quality": QUALITY, "metrics": METRICS, "centiles": CENTILES}
MEASURES["differences"] = pd.DataFrame(columns=DIFFERENCES)
MEASURES["curves"] = pd.DataFrame(columns=CURVES)
TABLES = MEASURES | {"runs": RUNS, "validation": VALIDATION, "warnings": NO_WARNINGS}
MEASURED_ONLY = {"runs": None, "validation": None}
FROM_ATLAS = METRICS[1:2].assign(
    atlas="crl", relative_difference=-0.1, difference=-10.0, times_noise=-40.0
)
PROVENANCE = {
    "commit": "abc-dirty",
    "recorded": "2026-01-01T12:30:00+00:00",
    "gyriflow": "0.1",
    "python": "3.13",
    "packages": {"numpy": "2.0", "absent": None},
    "files": [{"brain": "young", "what": "labels", "sha256": "12ab"}],
}
ORIGIN = {
    "provenance": PROVENANCE,
    "methods": "**Brains.** Two.",
    "configuration": "start: young\n",
}
NO_VIEW = {"groups": [], "maps": []}


def shown(
    *rules: str, title: str = "{brain}", caption: str = "of *all* brains", content=""
) -> list[dict]:
    """Return figures of rules, of which those that begin with "steps" are technical, in
    sections called as they."""
    usual = {"title": title, "caption": caption, "names": {"brain": "a"}}
    figures = []
    for number, rule in enumerate(rules):
        figure = {"name": rule, "section": rule, "path": f"{rule}{number}.png"}
        figure["technical"] = rule.startswith("steps")
        figure["first"] = rule in ("weekly_figure", "predicted_figure")
        figures.append(usual | figure)
    return page_figures(figures, {figure["path"]: content for figure in figures})


def written(content: dict, view: dict) -> str:
    texts = {name: (PAGE / file).read_text() for name, file in PARTS.items()}
    template = (PAGE / "page.html").read_text()
    return report_page(template, texts, view, **ORIGIN, **content)


def content_of(figures=(), brains=BRAINS, prediction=None, **tables) -> dict:
    """Return the content of the page of a study, with others than the usual tables."""
    about = {"norm": "the norm", "pictures": PICTURES, "prediction": prediction}
    return study_page(brains, Tables(**TABLES | tables), figures, **about)


def page(*arguments, view=NO_VIEW, **others) -> str:
    """Return the page of a study."""
    return written(content_of(*arguments, **others), view)


def sheet(**tables) -> str:
    """Return the page of a brain, with others than the usual tables."""
    figures = shown("quality", "steps")
    return written(
        brain_page(BRAINS[0], Tables(**TABLES | tables), figures, norm="the norm"),
        NO_VIEW,
    )


def without_scripts(text: str) -> str:
    return re.sub(r"<(script|style)\b.*?</\1>", "", text, flags=re.DOTALL)


def seen(text: str) -> dict[int, str]:
    """Return the words of a page, and what it links to, by line."""
    text = re.sub(r'<a href="(.*?)">', r"[\1] ", without_scripts(text))
    cells = text.replace("</td>", " |").replace("</th>", " |").replace("<br>", " / ")
    lines = [Markup(line).striptags() for line in cells.splitlines()]
    return dict(enumerate(filter(None, lines)))


# what pages say


def a_study_of_runs():
    """Equal warnings are one row, and technical figures are last in their section."""
    rows = "subject run\nyoung -\nold -\nyoung -\nyoung thin"
    messages = ["too small"] * 3 + ["it died."]
    warnings = frame(rows, message=messages, **WARNING)
    warnings["level"] = ["warning"] * 3 + ["error"]
    figures = [
        *shown("steps", "rates", "growth", content="<table></table>"),
        *shown("weekly_figure", caption="first <page>"),
    ]
    for figure, name in zip(figures, "AABC", strict=True):
        figure["section"] = name
    # the few brains of an atlas itself are not spoken of
    few = pd.concat([CENTILES, CENTILES.assign(flag="too few brains")])
    # scores from another start brain of that week are not the run's own
    other = VALIDATION.assign(start="old", distance_mm=9.0)
    scores = pd.concat([VALIDATION, other])
    return page(figures, warnings=warnings, centiles=few, validation=scores)


def a_study_of_measured_brains():
    """Numbers without a norm have their doubts and differences from atlases."""
    quality = QUALITY.assign(area_is_lower_bound=[True, np.nan])
    third = QUALITY[:1].assign(subject="third")
    return page(
        **MEASURED_ONLY,
        brains=[*BRAINS, BRAIN | OLD | {"id": "third", "synthetic": True}],
        quality=pd.concat([quality, third]),
        centiles=UNRATED.assign(flag="few brains"),
        differences=FROM_ATLAS,
    )


DIFFERENCES_OF_PARTS = frame(
    """
    subject run       hemisphere metric          atlas relative_difference times_noise
    young   observed  whole      volume          crl   -0.031              -22.2
    young   observed  whole      volume          own   0.001               1.9
    young   observed  whole      volume          three -                   3.0
    young   observed  whole      area            crl   -0.031              -22.2
    young   observed  left       spangy_B4_power crl   -0.031              -5.2
    young   observed  right      spangy_B4_power crl   0.001               1.9
    young   predicted whole      volume          crl   0.5                 9.0
    old     observed  whole      volume          crl   0.5                 9.0
    """,
    difference=1.0,
)


def a_brain_beside_atlases():
    """A metric that a warning is of has no multiple of the noise, others at most 10,
    and a metric of hemispheres has both."""
    further = frame(
        """
        hemisphere metric          value unit
        left       spangy_B4_power 9     1
        right      spangy_B4_power 9     1
        whole      volume_tissue   40    mL
        whole      mean_thickness  1.9   mm
        """
    )
    curves = frame(
        """
        week volume area gyrification_index mean_sulcal_depth mean_thickness
        20   9      80   1                  2                 1
        21   10     100  1.1                3                 2
        22   13     125  1.21               4                 3
        """
    )
    curves = curves.melt("week", var_name="metric").assign(hemisphere="whole")
    # one begins at the week of the brain
    later = curves[curves["week"] > 20].assign(atlas="own")
    return sheet(
        metrics=pd.concat([METRICS, further.assign(subject="young", run="observed")]),
        differences=DIFFERENCES_OF_PARTS,
        curves=pd.concat([curves.assign(atlas="crl"), later]),
        quality=QUALITY.assign(
            verdict="fine", area_is_lower_bound=[True, np.nan], warnings=""
        ),
        centiles=CENTILES.assign(flag=["skewed", "not converged", "few brains"]),
    )


def a_brain_without_a_norm_or_an_atlas():
    """Warnings of runs and of other brains are on other pages."""
    rows = "subject run message\nyoung - own\nyoung thin of-a-run\nold - of-another"
    return sheet(
        warnings=frame(rows, **WARNING),
        centiles=UNRATED.assign(flag="too few brains"),
    )


ACCURACY = {
    "note": "A note.",
    "mesh": {"elements": [7, 9], "surface_edge_mm": 0.7},
    "source": "benchmarks/horizon.py",
    "references": ["A. et al.", "W. et al."],
}
TESTS = frame(
    """
    start horizon model  distance_mm r_shape_index area_difference volume_difference
    crl   2.0     run    0.2         0.8           -0.02           -
    wu    2.0     run    0.3         0.9           0.01            -
    crl   2.0     atlas  0.5         0.4           0               0
    wu    2.0     atlas  0.7         0.4           0               0
    crl   2.0     scaled 0.7         0.4           0               0
    """
)
KEPT = """
week smooth_share finer_share difference_mm
23   0.9          0.7         0.71
24   0.6          0.1         0.71
26   0.1          0.0         0.71
"""
PREDICTED = frame(
    """
    subject run      week hemisphere metric         value expected z   centile
    young   observed 22   whole      area           100   -        -   -
    young   thin     23.5 whole      area           210   200      0.5 69
    young   thin     22   whole      area           101   -        -   -
    crl-30  observed 30   whole      area           200   -        -   -
    crl-29  observed 29   whole      area           190   -        -   -
    young   thin     23.5 whole      volume         150   -        -   -
    young   thin     23.5 whole      crossing_faces 0     -        -   -
    """,
    centile_low=60.0,
    centile_high=80.0,
    unit="1",
    flag="ok",
)


def predicted(weeks: float, rows=TESTS, advantage="", **more) -> dict:
    """Return what the report of a prediction is given, so many weeks ahead of 22 GW."""
    licence = {"name": "CRL licence", "url": None, "terms": "Research only."}
    atlas = {"name": "crl", "title": "An atlas", "reference": "A. et al., doi 10.1/x"}
    tests = {"errors": {"area": "± 8 %"}, "starts": ["crl 22 GW"]}
    return {
        "run": "thin",
        "brain": "young",
        "start_week": 22.0,
        "week": 22 + weeks,
        "atlas_brain": "crl-30",
        "atlas_week": 30,
        "population": "well",
        "atlas": atlas | {"licence": licence | {"accept": True}},
        "accuracy": ACCURACY | {"rows": rows[::-1].to_dict("records")},
        "tests": tests | {"advantage": advantage},
        "kept": frame(KEPT),
        "surfaces": ["results/a.surf.gii"],
        "atlas_surface": "results/atlas.surf.gii",
        "labels": "results/a_dseg.nii.gz",
    } | more


FIGURES = shown("predicted_figure", "weekly_figure", caption="of *all*")


def a_prediction():
    """Without observed brains there are no scores, and what a brain has not is a
    dash."""
    tables = {"validation": None, "metrics": PREDICTED}
    unrated = PREDICTED.assign(centile=np.nan)
    return page(FIGURES, prediction=predicted(1.5), centiles=unrated, **tables)


def a_prediction_beside_an_observed_brain_with_centiles_and_an_interval():
    """The brains of a population are no atlas, and so small a difference is not far
    from the error of the match."""
    small = frame(KEPT).assign(smooth_share=0.1)
    own = {"atlas": None, "labels": None, "kept": small}
    told = predicted(1.5, advantage="The atlas was better.", **own)
    ends = frame("week low high\n22 100 100\n23.5 190 240", metric="area")
    tables = {"centiles": PREDICTED, "metrics": PREDICTED, "intervals": ends}
    return page(FIGURES, prediction=told, **tables)


PAGES = (
    a_study_of_runs,
    a_study_of_measured_brains,
    a_brain_beside_atlases,
    a_brain_without_a_norm_or_an_atlas,
    a_prediction,
    a_prediction_beside_an_observed_brain_with_centiles_and_an_interval,
)


@pytest.mark.parametrize("told", PAGES, ids=lambda told: told.__name__)
def test_a_page_says(told, recorded):
    recorded(seen(told()))


def test_the_page_asks_for_nothing_from_elsewhere():
    text = page(shown("weekly_figure"), view={"groups": [{"name": "a"}], "maps": []})
    links = re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', without_scripts(text))
    assert links == ['href="brains/young.html"']
    assert '<section id="surfaces-in-3d">' in text


def test_what_a_user_has_written_is_shown_as_text(monkeypatch):
    script = "<script>alert(1)</script><img src=x onerror=alert(1)>"
    monkeypatch.setitem(BRAINS[0], "population", script)
    monkeypatch.setitem(QUALITY, "warnings", [script, ""])
    table = html_table(pd.DataFrame({script: [script]}))
    figures = shown("growth_figure", title=script, caption=script, content=table)
    view = {"groups": [{"name": script}], "maps": [script]}
    # the data of the 3D view are JSON, in which no element ends
    shown_text = without_scripts(page(figures, view=view))
    assert shown_text.count("alert(1)") >= 5
    assert "<img src=x" not in shown_text
    assert "<script" not in shown_text


def test_messages_tell_files_without_their_folders(monkeypatch):
    message = "/data/Smith John/x.nii.gz: cortex of 1 voxel, see https://a.b/c"
    monkeypatch.setitem(QUALITY, "warnings", [message, ""])
    text = page()
    assert "x.nii.gz: cortex of 1 voxel, see https://a.b/c" in text
    assert "Smith" not in text


def test_paths_are_hidden():
    pial = {"id": "a", "pial": "C:\\x\\lh.pial", "image": "S.nii"}
    named = {"labels": "/data/Smith_John.nii.gz", "brains": [pial]}
    hidden = {"id": "a", "pial": "(file)", "image": "(file)"}
    plain = {"population": "spina bifida aperta", "week": 21.0}
    expected = {"labels": "(file)", "brains": [hidden]}
    assert hide_paths(named | plain) == expected | plain


def test_the_first_sheet_has_the_numbers_of_the_shipped_atlases():
    most, thickness = 0.0, {}
    for atlas, facts in read_yaml(SHIPPED / "norms" / "atlases.yaml")[
        "atlases"
    ].items():
        values = pd.DataFrame(facts["values"]["whole"], index=facts["weeks"])
        parts = values["volume_tissue"] + values["volume_ventricles"]
        most = max(most, 100 * (parts / values["volume"] - 1).abs().max())
        thickness[atlas] = values["mean_thickness"]
    text = a_brain_beside_atlases()
    # of small brains in large voxels it is more
    assert 1.0 < most < 3.0
    assert "differ by up to 3 %" in text
    thinner = 100 * (1 - thickness["chinese"] / thickness["crl"])
    assert f"differs by {thinner.min():.0f} to {thinner.max():.0f} %" in text


# verdicts

FINE = RUNS.assign(elements_through_cortex=8.5, unresolved_from_week=np.nan)
FAILED = pd.DataFrame({"level": ["warning", "error"], "message": ["holes", "it died."]})
TWO = pd.DataFrame({"level": "warning", "message": ["one element", "coarse"]})
ATLAS_BETTER = TESTS.assign(r_shape_index=[0.7, 0.7, 0.8, 0.8, 0.8])
STUDIES = {
    "a run of few elements": {},
    # the warning names its run
    "another run": {"runs": RUNS.assign(run="coarse")},
    "an error": {"warnings": FAILED},
    # a warning about one element is not the worst of several
    "two warnings and few elements": {"warnings": TWO},
    "two warnings": {"runs": FINE, "validation": None, "warnings": TWO},
    "a warning": {"runs": FINE, "validation": None, "warnings": TWO[:1]},
    "no warning": {"runs": FINE, "validation": None},
    "growth that was measured": {"validation": VALIDATION.assign(kind="explained")},
    "a prediction": {"prediction": predicted(2.0), "validation": None},
    "further than tested": {"prediction": predicted(3.0), "validation": None},
    "an atlas that was better in tests": {
        "prediction": predicted(2.0, ATLAS_BETTER),
        "validation": None,
    },
    # what was measured on the brain itself comes first
    "an atlas that is better": {
        "prediction": predicted(2.0, ATLAS_BETTER, "The atlas was better."),
        "validation": None,
    },
}


def test_verdicts_tell_what_was_compared_and_the_worst_warning(recorded):
    for changes in STUDIES.values():
        told = changes.get("warnings", NO_WARNINGS)
        changes["warnings"] = told.assign(subject="young", run="", step="s")
    told = {name: content_of(**changes)["verdict"] for name, changes in STUDIES.items()}
    recorded(told)


RESOLUTIONS = [
    (1, (8.4, 8.2)),
    (1, (2.0, 2.0)),
    (2, (1.0, 1.0)),
    (1, (1.0, 1.0)),
    (2, (0.6, 0.5)),
    (1, (2.3, 2.1, 1.9, 1.7)),
    (2, (1.0, 0.9, 0.7, 0.6)),
    (2, (1.0, 0.9, np.nan)),
    (1, (np.nan, np.nan)),
    (1, (2.3, 1.96)),
]


def test_a_run_is_judged_by_the_elements_through_its_cortex(recorded):
    """To its end, with so many elements before its steps of half a week and in them."""
    runs = {}
    base = RUNS.iloc[0].to_dict() | {"weeks": "[21.0, 23.0]"}
    for order, through in RESOLUTIONS:
        weeks = 21.5 + 0.5 * np.arange(len(through))
        steps = pd.DataFrame({"week": weeks, "elements_through_cortex": through})
        run = base | {"elements_through_cortex": through[0]}
        run |= resolution_over_steps(order, steps, has_layers=True)
        runs[f"order {order}, {through}"] = run
    # layers do not enter growth towards shapes
    shapes = run | resolution_over_steps(1, steps, has_layers=False)
    runs["shapes"] = shapes | {"growth.model": "shapes", "elements_through_cortex": 1.0}
    fine = runs["order 1, (8.4, 8.2)"]
    runs["inverted"] = fine | {"min_J": -0.1}
    runs["pressed a little"] = fine | {"initial_penetration_mm": 0.45}
    runs["pressed"] = fine | {"initial_penetration_mm": 0.55}
    found = {}
    for name, run in runs.items():
        text = content_of(runs=pd.DataFrame([run]), validation=None)["runs"]
        error, week = run["element_error_percent"], run["unresolved_from_week"]
        found[name] = f"{Markup(text).striptags()}; {error}, {week}"
    recorded(found)


def test_shipped_accuracy_has_all_baselines_and_at_least_two_starts_at_each_horizon():
    rows = pd.DataFrame(read_yaml(SHIPPED / "norms" / "predictions.yaml")["rows"])
    assert (rows.groupby("horizon")["start"].nunique() >= 2).all()
    test = ["start", "start_week", "horizon"]
    assert not rows.duplicated([*test, "model"]).any()
    by_model = rows.pivot_table("distance_mm", test, "model")
    assert set(by_model) == {"run", "target", "atlas", "atlas_deformed", "scaled"}
    assert by_model.notna().all(axis=None)
    # a prediction that is worth less than no folding would not be shipped
    assert (by_model["run"] < by_model["scaled"]).all()
    assert rows["r_shape_index"].between(0, 1).all()


# methods

SOFTWARE = {
    "gyriflow": "0.1",
    "packages": dict.fromkeys(
        ("scikit-image", "fenics-dolfinx", "petsc4py", "snakemake"), "9.9"
    ),
}
MEASURED_BRAIN = {"week": 21.0, "population": "spina bifida", "source": "labels"}
MEASURED_BRAIN |= {"synthetic": False}
SHAPE = {"week": 24.5, "population": None, "source": "shape", "synthetic": True}
PARAMETERS = read_yaml(Path(__file__).with_name("parameters.yaml"))
RUN_SUMMARY = {"weeks": [21.0, 24.5], "steps": 49, "tets": 1234}


def run(name, growth_source, **growth):
    """Return what the methods get of a run from one start brain."""
    parameters = PARAMETERS | {"growth": growth}
    about = {"run": name, "start": "young", "growth_of": growth_source}
    return about | {"parameters": parameters, "summary": RUN_SUMMARY}


SIMULATIONS = {
    "brains": [MEASURED_BRAIN, SHAPE],
    "runs": [
        run("stiff", "", model="rates"),
        run("led", "population cohort", model="shapes", of="self"),
        run("own", "own", model="shapes", of="self"),
    ],
    "filled": [
        {"ids": ["young"], "cortex": "white", "by_cortex": True},
        {"ids": ["old", "older"], "cortex": "measured", "by_cortex": False},
    ],
    "mesh": {"order": 2, "mesher": "tetgen"},
}
SULCI_AND_ATLASES = {
    "atlases": {"crl": "G. et al.: Curves", "own": "Own curves"},
    "surface": {"edge_length_mm": 1, "open_sulci": True},
}


@pytest.mark.parametrize(
    ("used", "citations"),
    # closed sulci make areas after 26 GW lower bounds
    [(SIMULATIONS, 3 + 7), ({}, 3), (SULCI_AND_ATLASES, 5)],
    ids=["simulations", "measured", "sulci_and_atlases"],
)
def test_the_methods_say_what_was_done_and_cite(used, citations, recorded):
    usual = {"brains": [MEASURED_BRAIN], "runs": [], "atlases": {}, "filled": []}
    usual |= {"metrics": {"curvature_radius_mm": 3.0}, "software": SOFTWARE}
    usual |= {"surface": {"edge_length_mm": 0.8, "open_sulci": False}}
    text = methods_text((PAGE / "methods.rst").read_text(), **usual | used)
    recorded(dict(enumerate(text.splitlines())))
    assert caption_html(text).count("<li><p>") == citations
    assert "system-message" not in caption_html(text)
