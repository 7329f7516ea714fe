"""The report is one page with everything inside, and tells no paths."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from markupsafe import Markup

from gyriflow.io.yaml_files import read_yaml
from gyriflow.report.page import (
    Origin,
    Tables,
    brain_page,
    brains_table,
    caption_html,
    hide_paths,
    methods_text,
    report_page,
    run_verdict,
    scores_table,
    sections,
    shown_figures,
    study_page,
    verdict,
    worth_told,
)
from gyriflow.report.tables import html_table, resolution_over_steps
from gyriflow.settings.terms import SPREAD_UNKNOWN
from gyriflow.shipped import SHIPPED

PAGE = Path(__file__).parents[3] / "workflow" / "report" / "page"
PARTS = {"style": "style.css", "three": "three.min.js", "controls": "OrbitControls.js", "viewer": "viewer.js"}
PARTS |= {"notice": "three.LICENSE.txt"}
BRAINS = [
    {"id": name, "week": week, "population": "healthy", "source": "labels", "synthetic": False, "licence": licence}
    | {"covariates": covariates}
    for name, week, licence, covariates in (("young", 21.0, "CC0 1.0", {"sex": "F"}), ("old", 23.0, None, {}))
]
PICTURES = {"young": ("data:image/webp;base64,AAAA", 1.5)}
RUNS = pd.DataFrame(
    {
        "run": ["thin"], "subject": ["young"], "start_week": [21.0], "preset": ["measured"], "end_week": [23.0],
        "weeks": ["[21.0, 22.0]"], "min_J": [0.9], "elements_through_cortex": [1.2], "initial_penetration_mm": [0.0],
        "order": [1], "least_elements_through_cortex": [1.1], "unresolved_from_week": [21.5],
    }
)  # fmt: skip
VALIDATION = pd.DataFrame(
    {
        "run": "thin", "kind": "predicted", "start_week": 21.0, "week": [22.0, 23.0], "area_difference": [0.1, -0.0794],
        "volume_difference": [0.0, 0.02], "r_shape_index": [0.1, 0.566], "r_start_shape_index": [0.1, 0.568],
        "gain_shape_index": [0.0, -0.002], "gain_low_shape_index": [0.0, -0.044], "gain_high_shape_index": [0.0, 0.045],
        "skill_shape_index": [np.nan, np.nan], "distance_mm": [0.1, 0.42],
    }
)  # fmt: skip


NO_WARNINGS = pd.DataFrame({"subject": [], "level": [], "message": []})
QUALITY = pd.DataFrame(
    {
        "subject": ["young", "old"], "verdict": ["look", "refused"], "cause": [np.nan, "cropped"],
        "warnings": ["a bridge was cut", np.nan],
    }
)  # fmt: skip
METRICS = pd.DataFrame(
    {
        "subject": "young", "run": "real", "week": 21.0, "hemisphere": ["whole", "whole", "left"],
        "metric": ["volume", "area", "area"], "value": [46.2, 90.0, 44.0], "unit": ["mL", "cm2", "cm2"],
    }
)  # fmt: skip
CENTILES = METRICS.iloc[:2].assign(
    expected=[40.0, 100.0], z=[1.2, np.nan], centile=[88.4, np.nan], flag=["ok", SPREAD_UNKNOWN]
)
MEASURES = {"quality": QUALITY, "metrics": METRICS, "centiles": CENTILES}
PROVENANCE = {
    "commit": "abc-dirty",
    "recorded": "2026-01-01T12:30:00+00:00",
    "gyriflow": "0.1",
    "python": "3.13",
    "packages": {"numpy": "2.0", "absent": None},
    "files": [{"brain": "young", "what": "labels", "sha256": "12ab"}],
}


def shown(*rules: str, title: str = "{brain}", caption: str = "of *all* brains", content: str = "") -> list[dict]:
    """Return figures of rules, of which those that begin with "steps" are technical, in sections called as they."""
    figures = [
        {"name": rule, "section": rule, "title": title, "caption": caption, "technical": rule.startswith("steps")}
        | {"path": f"{rule}{number}.png", "names": {"brain": "a"}}
        for number, rule in enumerate(rules)
    ]
    return shown_figures(figures, {figure["path"]: content for figure in figures})


TABLES = MEASURES | {"runs": RUNS, "validation": VALIDATION, "warnings": NO_WARNINGS}
ORIGIN = Origin(PROVENANCE, "**Brains.** Two.", "start: young\n")


def page(figures: list[dict], view: dict | None = None, prediction: dict | None = None, **tables) -> str:
    """Return the page of a study, with others than the usual tables."""
    about = {"norm": "the norm", "pictures": PICTURES, "prediction": prediction}
    return written(study_page(BRAINS, Tables(**TABLES | tables), ORIGIN, figures, **about), view)


def written(content: dict, view: dict | None = None) -> str:
    texts = {name: (PAGE / file).read_text() for name, file in PARTS.items()}
    return report_page((PAGE / "page.html").read_text(), texts, view or {"groups": [], "maps": []}, **content)


def test_the_page_has_its_parts_and_asks_for_nothing_from_elsewhere():
    figures = [*shown("growth_figure", content="<table></table>"), *shown("weekly_figure", caption="first <page>")]
    text = page(figures, {"groups": [{"name": "</script><b>"}], "maps": []})
    outside = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', outside) == ['href="brains/young.html"']
    assert "</script><b>" not in text
    assert "<em>all</em>" in text
    parts = ("first &lt;page", "<h3>Runs", "<h2>Surfaces in 3D", "<h2>growth_figure", "<h2>Brains", "<h2>Provenance")
    order = [text.index(word) for word in parts]
    assert order == sorted(order)
    assert "2 brains of 21 to 23 GW were analysed, all of them healthy. young was meshed and" in " ".join(text.split())
    assert "grown to 23 GW in 1 simulation of" in " ".join(text.split())
    assert "12ab" in text
    assert "Made 2026-01-01 12:30 UTC by gyriflow 0.1, commit abc, changed." in text
    assert "numpy" in text
    assert "absent" not in text


@pytest.mark.fault(61)
def test_what_a_user_has_written_is_shown_as_text(monkeypatch):
    script = "<script>alert(1)</script><img src=x onerror=alert(1)>"
    monkeypatch.setitem(BRAINS[0], "population", script)
    monkeypatch.setitem(QUALITY, "warnings", [script, ""])
    table = html_table(pd.DataFrame({script: [script]}))
    figures = shown("growth_figure", title=script, caption=script, content=table)
    text = page(figures, {"groups": [{"name": script}], "maps": [script]})
    # the data of the 3D view are JSON, in which no element ends
    shown_text = re.sub(r"<script\b.*?</script>", "", text, flags=re.DOTALL)
    assert shown_text.count("alert(1)") >= 5
    assert "<img src=x" not in shown_text
    assert "<script" not in shown_text


def test_sections_stand_in_order_with_technical_figures_last_and_numbers_run_through():
    figures = [{**item, "section": name} for item, name in zip(shown("steps", "maps", "rates"), "AAB", strict=True)]
    found = [(name, [(item["number"], item["technical"]) for item in items]) for name, items in sections(figures)]
    assert found == [("A", [(1, False), (2, True)]), ("B", [(3, False)])]
    assert "<details><summary>2. a</summary>" in page(figures)


def test_the_verdict_tells_what_was_compared_and_the_worst_warning():
    none = pd.DataFrame({"level": [], "message": []})
    told = verdict(RUNS, VALIDATION, none)
    assert told.startswith(
        "At 23 GW, run thin agrees best with the real brain (predicted): shape index r 0.57, against"
    )
    assert "distance of 0.42 mm. Worst warning: cortex not resolved (1.2 elements through it, 2 needed)" in told
    failed = pd.DataFrame({"level": ["warning", "error"], "message": ["holes closed", "a step died."]})
    assert verdict(RUNS, VALIDATION, failed).endswith("Worst warning: a step died.")
    alone = verdict(RUNS.assign(elements_through_cortex=3.0, unresolved_from_week=np.nan), None, none)
    assert alone.startswith("There is no real brain of the same population")
    assert alone.endswith("There were no warnings.")
    assert told in page(shown("growth_figure")).replace("&#39;", "'")


WORTH = read_yaml(SHIPPED / "norms" / "predictions.yaml")


def foretold(weeks: float) -> dict:
    """Return what the report of a prediction is given, so many weeks ahead of 22 GW."""
    atlas = {"name": "crl", "title": "An atlas", "reference": {"citation": "A. et al.", "doi": "10.1/x", "url": None}}
    atlas["licence"] = {"name": "CRL licence", "url": None, "terms": "Research only.", "accept": True}
    return {
        "run": "thin", "brain": "young", "start_week": 22.0, "week": 22 + weeks, "beside": "crl-30", "beside_week": 30,
        "population": "well", "atlas": atlas, "worth": WORTH,
        "surfaces": ["results/a.surf.gii"], "labels": "results/a_dseg.nii.gz",
    }  # fmt: skip


def test_the_report_of_a_prediction_says_that_it_is_one_how_good_such_were_and_where_it_is():
    figures = shown("weekly_figure", "predicted_figure", caption="of *all*")
    metrics = pd.concat([METRICS, METRICS[1:2].assign(run="thin", week=29.5, value=210.5)])
    text = " ".join(page(figures, validation=None, prediction=foretold(7.5), metrics=metrics).split())
    parts = (
        "Prediction of young to 29.5 GW, by the growth of the atlas crl</h1>",
        *("This is a prediction, not a scan. In tests over 8", "7.5 weeks later", "210.5", "How accurate such"),
        *("norms/predictions.yaml", "results/a.surf.gii", "results/a_dseg.nii.gz"),
        *("Cite: A. et al., doi 10.1/x.", "CRL licence. Research only.", "<h2>Brains"),
    )
    order = [text.index(part) for part in parts]
    assert order == sorted(order)
    # no table of dashes, and the other figure in its section
    assert "<h3>Runs" not in text
    assert "<h2>weekly_figure" in text
    assert "<h3>Runs" in page(figures, prediction=foretold(7.5))


def test_a_prediction_beyond_those_that_were_tried_says_so():
    last = max(row["horizon"] for row in WORTH["rows"])
    assert "No test went" not in worth_told(foretold(last))
    assert f"In tests over {last:g} weeks, " in worth_told(foretold(last + 1))
    assert f"No test went as far as {last + 1:g} weeks." in worth_told(foretold(last + 1))


def test_the_shipped_worth_of_predictions_is_of_two_starts_at_each_horizon_beside_simpler_ways():
    rows = pd.DataFrame(WORTH["rows"])
    assert (rows.groupby("horizon")["start"].nunique() == 2).all()
    assert not rows.duplicated(["start", "horizon", "model"]).any()
    by_way = rows.pivot_table("distance_mm", ["start", "horizon"], "model")
    assert set(by_way) == {"run", "atlas", "atlas_deformed", "scaled"}
    assert by_way.notna().all(axis=None)
    # a prediction that is worth less than no folding would not be shipped
    assert (by_way["run"] < by_way["scaled"]).all()
    assert rows["r_shape_index"].between(0, 1).all()


def test_paths_are_hidden():
    named = {"labels": "/data/Smith_John.nii.gz", "brains": [{"id": "a", "pial": "C:\\x\\lh.pial", "image": "S.nii"}]}
    hidden = {"labels": "(file)", "brains": [{"id": "a", "pial": "(file)", "image": "(file)"}]}
    plain = {"population": "spina bifida aperta", "week": 21.0}
    assert hide_paths(named | plain) == hidden | plain


def test_a_brain_has_a_row_with_pictures_numbers_verdict_and_cause_or_warnings():
    young, old = brains_table(BRAINS, **MEASURES, pictures=PICTURES).to_dict("records")
    assert [Markup(row["verdict"]).striptags() for row in (young, old)] == ["looka bridge was cut", "refusedcropped"]
    assert [Markup(row["brain"]).striptags() for row in (young, old)] == [
        "young21 GW; healthy; sex: F; CC0 1.0", "old23 GW; healthy; labels; your own data"
    ]  # fmt: skip
    assert [Markup(row["volume (mL)"]).striptags() for row in (young, old)] == ["46.288 (+1.2)", "–"]
    # averages give no centile
    assert Markup(young["pial area (cm²)"]).striptags() == "90−10.0 %"
    assert ("<img " in young[""], old[""], "href" in old["brain"]) == (True, "", False)


def test_a_page_says_what_its_centiles_are_worth():
    text = page(shown("growth_figure"))
    assert "its centile (and z) for this age among the norm&#39;s other subjects." in text
    assert "the curve of the norm (the norm)" in text
    assert "the spread of individuals around the curve is unknown" in text
    assert "There are too few subjects" not in text
    # those of an atlas itself are not spoken of
    few = pd.concat([MEASURES["centiles"], MEASURES["centiles"].assign(flag="too few brains")])
    assert "There are too few subjects" not in page([], centiles=few)


def test_a_brain_has_a_page_of_its_own():
    warnings = pd.DataFrame(
        {"subject": ["young", "other"], "run": np.nan, "step": "s", "level": "warning", "message": ["own", "other's"]}
    )
    tables = Tables(**TABLES | {"warnings": warnings})
    text = written(brain_page(BRAINS[0], tables, ORIGIN, shown("quality"), norm="the norm"))
    assert "<h1>Measured cortical folding, young</h1>" in text
    assert 'href="../report.html"' in text
    assert "other&#39;s" not in text
    assert text.index(">own<") < text.index("<h2>quality") < text.index("<th>left</th>")
    # both hemispheres and where the brain stands
    assert re.search(r"pial area \(cm²\)</td>.*90<.*44<.*−10.0 %", text)


def test_a_run_is_judged_and_scored_at_its_last_compared_week():
    (row,) = scores_table(RUNS, VALIDATION).to_dict("records")
    assert row["verdict"].startswith("ended at 22 GW of 23; cortex not resolved (1.2 elements")
    assert row["real brain"] == "23 GW, predicted"
    assert row["area (%)"] == "−7.9"
    assert (row["gain"], row["95 % interval"]) == ("−0.00", "−0.04 to +0.04")
    assert row["distance (mm)"] == "0.42"
    (alone,) = scores_table(RUNS).to_dict("records")
    assert [alone[name] for name in ("real brain", "gain", "95 % interval")] == ["none", "–", "–"]


@pytest.mark.parametrize(
    ("order", "through", "verdict"),
    [
        (1, (2.4, 2.2), ""),
        (2, (1.0, 1.0), ""),
        (1, (1.0, 1.0), "(1 elements through it, 2 needed)"),
        (2, (0.6, 0.5), "not resolved (0.6 elements"),
        (1, (2.3, 2.1, 1.9, 1.7), "cortex not resolved from 22.5 GW on (down to 1.7 elements"),
        (2, (1.0, 0.9, 0.7, 0.6), "cortex not resolved from 22.5 GW on (down to 0.6 elements"),
        (2, (1.0, 0.9, np.nan), "(down to 0 elements"),
    ],
)
def test_a_run_is_judged_by_the_elements_through_its_cortex(order, through, verdict):
    # to its end, with so many elements before its steps of half a week and in them
    steps = pd.DataFrame({"week": 21.5 + 0.5 * np.arange(len(through)), "elements_through_cortex": through})
    run = {**RUNS.iloc[0].to_dict(), "weeks": "[21.0, 23.0]", "elements_through_cortex": through[0]}
    run |= resolution_over_steps(order, steps)
    assert verdict in run_verdict(run)
    assert verdict or run_verdict(run) == "reached 23 GW"
    assert "inverted" in run_verdict(run | {"min_J": -0.1})
    assert "beyond their planes" not in run_verdict(run | {"initial_penetration_mm": 0.45})
    assert "0.55 mm beyond their planes" in run_verdict(run | {"initial_penetration_mm": 0.55})


def test_the_methods_say_what_was_run():
    packages = dict.fromkeys(("scikit-image", "fenics-dolfinx", "petsc4py", "snakemake"), "9.9")
    software = {"gyriflow": "0.1", "packages": packages}
    parameters = {
        "start_week": 21.0, "step_s": 43200.0, "material": "neo-hookean", "shear_modulus_cortex_pa": 1500.0,
        "shear_modulus_core_pa": {"map": "core"}, "poisson_ratio": 0.45, "thickness_mm": 1.5,
        "growth": {"model": "rates"}, "growth_rate_per_s": 2e-7, "core_growth_rate_per_s": 0.0,
        "stress_memory_gw": 0.0, "contact": {"kind": "global"},
    }  # fmt: skip
    summary = {"weeks": [21.0, 24.5], "steps": 49, "tets": 1234}
    led = parameters | {"growth": {"model": "shapes", "of": "self"}}
    brains = [
        {"week": 21.0, "population": "spina bifida", "source": "labels", "synthetic": False},
        {"week": 24.5, "population": None, "source": "shape", "synthetic": True},
    ]
    runs = [
        {"run": "stiff", "start": "young", "growth_of": "", "parameters": parameters, "summary": summary},
        {"run": "led", "start": "a", "growth_of": "population cohort", "parameters": led, "summary": summary},
        {"run": "own", "start": "a", "growth_of": "own", "parameters": led, "summary": summary},
    ]
    template, metrics = (PAGE / "methods.rst").read_text(), {"curvature_radius_mm": 3.0}
    text = methods_text(
        template, brains=brains, runs=runs, software=software, metrics=metrics,
        surface={"edge_length_mm": 0.8, "open_sulci": True}, mesh={"order": 2, "mesher": "tetgen"},
    )  # fmt: skip
    assert "2 brains of 21 to 24.5 weeks of gestation (GW), 1 of them spina bifida, were processed with" in text
    assert "Run *stiff* folded young from 21 to 24.5 GW in 49 steps of at most 12 h, on 1234 quadratic" in text
    assert "Sulci that are closed in the labels were left closed, as mesh elements are wider than slits" in text
    assert "1500 and the values given for each week or place Pa" in text
    assert "tangentially at 2·10⁻⁷ per second" in text
    alone = methods_text(
        template, brains=brains[:1], runs=[], software=software, metrics=metrics,
        surface={"edge_length_mm": 1, "open_sulci": True},
    )  # fmt: skip
    assert "simulated" not in alone
    assert "Tallinen" not in alone
    assert "Sulci that are closed in the labels were opened by slits" in alone
    assert "van Doorn [1]" in alone
    assert "(population cohort), a population's growth and not the subject's own. Stress" in text
    assert text.count("its own later shape") == 1
    assert "was modelled [4]" in text
    assert "<li><p>Run <em>stiff</em>" in caption_html(text)
    assert "system-message" not in caption_html(text)


def test_messages_tell_files_without_their_folders(monkeypatch):
    monkeypatch.setitem(QUALITY, "warnings", ["/data/Smith John/x.nii.gz: cortex of 1 voxel, see https://a.b/c", ""])
    text = page(shown("growth_figure"))
    assert "x.nii.gz: cortex of 1 voxel, see https://a.b/c" in text
    assert "Smith" not in text


def test_a_page_without_simulations_says_how_many_brains_were_measured():
    said = "<strong>2 brains: 1 to look at, 1 refused.</strong>"
    assert said in page([], runs=None, validation=None)
