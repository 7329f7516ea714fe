"""The report is one page with everything inside, and tells no paths."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from markupsafe import Markup, escape

from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.atlas_curves import CURVES, DIFFERENCES
from gyriflow.report.page import (
    NOT_COMPARED,
    Tables,
    accuracy_sentence,
    brain_page,
    brain_rows,
    caption_html,
    hide_paths,
    methods_text,
    page_figures,
    report_page,
    run_verdict,
    scores_table,
    sections,
    study_page,
    verdict,
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
}
PARTS |= {"notice": "three.LICENSE.txt"}
BRAINS = [
    {
        "id": name,
        "week": week,
        "population": "healthy",
        "source": "labels",
        "synthetic": False,
        "licence": licence,
    }
    | {"covariates": covariates}
    for name, week, licence, covariates in (
        ("young", 21.0, "CC0 1.0", {"sex": "F"}),
        ("old", 23.0, None, {}),
    )
]
PICTURES = {"young": ("data:image/webp;base64,AAAA", 1.5)}
RUNS = pd.DataFrame(
    {
        "run": ["thin"],
        "subject": ["young"],
        "start_week": [21.0],
        "preset": ["measured"],
        "end_week": [23.0],
        "weeks": ["[21.0, 22.0]"],
        "min_J": [0.9],
        "elements_through_cortex": [1.2],
        "initial_penetration_mm": [0.0],
        "growth.model": ["rates"],
        "order": [1],
        "least_elements_through_cortex": [1.1],
        "unresolved_from_week": [21.5],
    }
)
VALIDATION = pd.DataFrame(
    {
        "run": "thin",
        "kind": "predicted",
        "start": "young",
        "start_week": 21.0,
        "week": [22.0, 23.0],
        "area_difference": [0.1, -0.0794],
        "volume_difference": [0.0, 0.02],
        "r_shape_index": [0.1, 0.566],
        "r_start_shape_index": [0.1, 0.568],
        "r_low_shape_index": [0.0, 0.51],
        "r_high_shape_index": [0.2, 0.61],
        "distance_mm": [0.1, 0.42],
        "gain_shape_index": [0.0, -0.002],
        "gain_low_shape_index": [0.0, -0.044],
        "gain_high_shape_index": [0.0, 0.045],
    }
)


NO_WARNINGS = pd.DataFrame({"subject": [], "run": [], "level": [], "message": []})
OWN_WARNING = pd.DataFrame(
    {
        "subject": ["young"],
        "run": np.nan,
        "step": "s",
        "level": "warning",
        "message": "own",
    }
)
QUALITY = pd.DataFrame(
    {
        "subject": ["young", "old"],
        "verdict": ["needs review", "refused"],
        "cause": [np.nan, "cropped"],
        "warnings": ["a bridge was cut", np.nan],
    }
)
METRICS = pd.DataFrame(
    {
        "subject": "young",
        "run": "observed",
        "week": 21.0,
        "hemisphere": ["whole", "whole", "left"],
        "metric": ["volume", "area", "area"],
        "value": [46.2, 90.0, 44.0],
        "unit": ["mL", "cm2", "cm2"],
    }
)
CENTILES = METRICS.iloc[:2].assign(
    expected=[40.0, 100.0],
    z=[1.2, np.nan],
    centile=[88.4, np.nan],
    centile_low=[70.0, np.nan],
    centile_high=[96.0, np.nan],
    flag=["ok", SPREAD_UNKNOWN],
)
MEASURES = {"quality": QUALITY, "metrics": METRICS, "centiles": CENTILES}
MEASURES["differences"] = pd.DataFrame(columns=DIFFERENCES)
MEASURES["curves"] = pd.DataFrame(columns=CURVES)
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


def shown(
    *rules: str,
    title: str = "{brain}",
    caption: str = "of *all* brains",
    content: str = "",
) -> list[dict]:
    """Return figures of rules, of which those that begin with "steps" are technical, in
    sections called as they."""
    figures = [
        {
            "name": rule,
            "section": rule,
            "title": title,
            "caption": caption,
            "technical": rule.startswith("steps"),
        }
        | {"first": rule in ("weekly_figure", "predicted_figure")}
        | {"path": f"{rule}{number}.png", "names": {"brain": "a"}}
        for number, rule in enumerate(rules)
    ]
    return page_figures(figures, {figure["path"]: content for figure in figures})


TABLES = MEASURES | {"runs": RUNS, "validation": VALIDATION, "warnings": NO_WARNINGS}
ORIGIN = {
    "provenance": PROVENANCE,
    "methods": "**Brains.** Two.",
    "configuration": "start: young\n",
}


def page(
    figures: list[dict],
    view: dict | None = None,
    prediction: dict | None = None,
    **tables,
) -> str:
    """Return the page of a study, with others than the usual tables."""
    about = {"norm": "the norm", "pictures": PICTURES, "prediction": prediction}
    return written(
        study_page(BRAINS, Tables(**TABLES | tables), figures, **about), view
    )


def elements(text: str, name: str) -> list[str]:
    """Return the texts inside the elements of a page that have a name, without their
    tags."""
    return [
        Markup(inside).striptags()
        for inside in re.findall(rf"<{name}\b[^>]*>(.*?)</{name}>", text, re.DOTALL)
    ]


def written(content: dict, view: dict | None = None) -> str:
    texts = {name: (PAGE / file).read_text() for name, file in PARTS.items()}
    return report_page(
        (PAGE / "page.html").read_text(),
        texts,
        view or {"groups": [], "maps": []},
        **ORIGIN,
        **content,
    )


def test_the_page_has_its_parts_and_asks_for_nothing_from_elsewhere():
    figures = [
        *shown("growth_figure", content="<table></table>"),
        *shown("weekly_figure", caption="first <page>"),
    ]
    text = page(figures, {"groups": [{"name": "</script><b>"}], "maps": []})
    outside = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', outside) == [
        'href="brains/young.html"'
    ]
    assert "</script><b>" not in text
    assert "<em>all</em>" in text
    ids = (
        f'<section id="{name}'
        for name in ("surfaces-in-3d", "growth_figure", "brains", "provenance")
    )
    order = [
        text.index(word)
        for word in ("first &lt;page", "results/study/validation.csv", *ids)
    ]
    assert order == sorted(order)
    assert Facts(2, 21, "23 GW", "healthy", "young", 1) in elements(text, "p")
    assert "12ab" in text
    assert Facts("2026-01-01 12:30 UTC", "0.1", "abc") in elements(text, "p")
    assert "commit abc, changed" in text
    assert "numpy" in text
    assert "absent" not in text


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
    figures = [
        {**item, "section": name}
        for item, name in zip(shown("steps", "maps", "rates"), "AAB", strict=True)
    ]
    found = [
        (name, [(item["number"], item["technical"]) for item in items])
        for name, items in sections(figures)
    ]
    assert found == [("A", [(1, False), (2, True)]), ("B", [(3, False)])]
    assert "<details><summary>2. a</summary>" in page(figures)


def test_the_verdict_tells_what_was_compared_and_the_worst_warning():
    none = pd.DataFrame({"level": [], "message": []})
    told = verdict(RUNS, VALIDATION, none)
    assert told == Facts("23 GW", "thin", "predicted", 0.57, "0.42 mm", 1.2, 2)
    # the warning names its run
    coarse = RUNS.assign(run="coarse")
    assert verdict(coarse, VALIDATION, none) == Facts("thin", "coarse", 1.2, 2)
    failed = pd.DataFrame(
        {"level": ["warning", "error"], "message": ["holes closed", "a step died."]}
    )
    assert (
        verdict(RUNS, VALIDATION, failed)
        == Facts("23 GW", "a step died.")
        != Facts("holes closed")
    )
    resolved = RUNS.assign(elements_through_cortex=8.5, unresolved_from_week=np.nan)
    # a warning about one element is not the worst of several
    doubts = pd.DataFrame({"level": "warning", "message": ["one element", "coarse"]})
    assert verdict(RUNS, VALIDATION, doubts) == told
    assert verdict(resolved, None, doubts) == Facts(2)
    assert verdict(resolved, None, doubts) != Facts("one element")
    assert verdict(resolved, None, doubts[:1]) == Facts("one element")
    alone = verdict(resolved, None, none)
    assert alone == Facts(NOT_COMPARED)
    assert not re.search(r"\d", alone)
    assert told in page(shown("growth_figure")).replace("&#39;", "'")


ATLASES = read_yaml(SHIPPED / "norms" / "atlases.yaml")["atlases"]
ACCURACY = read_yaml(SHIPPED / "norms" / "predictions.yaml")


def predicted(weeks: float) -> dict:
    """Return what the report of a prediction is given, so many weeks ahead of 22 GW."""
    atlas = {
        "name": "crl",
        "title": "An atlas",
        "reference": "A. et al., doi 10.1/x",
    }
    atlas["licence"] = {
        "name": "CRL licence",
        "url": None,
        "terms": "Research only.",
        "accept": True,
    }
    return {
        "run": "thin",
        "brain": "young",
        "start_week": 22.0,
        "week": 22 + weeks,
        "atlas_brain": "crl-30",
        "atlas_week": 30,
        "population": "well",
        "atlas": atlas,
        "accuracy": ACCURACY,
        "tests": {
            "errors": {"area": "largest error in 4 tests"},
            "starts": ["crl 22 GW"],
            "advantage": "",
        },
        "kept": pd.DataFrame(
            {
                "week": [23.0, 30.0, 34.0],
                "smooth_share": [0.9, 0.6, 0.5],
                "finer_share": [0.7, 0.1, 0.0],
                "difference_mm": 0.71,
            }
        ),
        "surfaces": ["results/a.surf.gii"],
        "atlas_surface": "results/atlas.surf.gii",
        "labels": "results/a_dseg.nii.gz",
    }


def test_the_report_of_a_prediction_says_what_it_is_how_accurate_and_in_which_files():
    figures = shown("predicted_figure", "weekly_figure", caption="of *all*")
    metrics = pd.concat(
        [METRICS, METRICS[1:2].assign(run="thin", week=29.5, value=210.5)]
    )
    text = " ".join(
        page(
            figures, validation=None, prediction=predicted(7.5), metrics=metrics
        ).split()
    )
    assert elements(text, "h1") == [Facts("young", "29.5 GW", "the atlas crl")]
    assert Facts("young", "22 GW", "29.5 GW", 7.5, "An atlas") in elements(text, "p")
    parts = (
        "</h1>",
        str(escape(accuracy_sentence(predicted(7.5)))),
        "210.5",
        "largest error in 4 tests",
        "0.71 mm",
        "crl 22 GW",
        "norms/predictions.yaml",
        "results/a.surf.gii",
        "results/atlas.surf.gii",
        "results/a_dseg.nii.gz",
        "A. et al., doi 10.1/x.",
        "CRL licence",
        "Research only.",
        '<section id="brains"',
    )
    order = [text.index(part) for part in parts]
    assert order == sorted(order)
    # no table of dashes, and the other figure in its section
    assert "results/study/validation.csv" not in text
    assert "<h2>weekly_figure" in text
    assert "results/study/validation.csv" in page(figures, prediction=predicted(7.5))
    # also beside an observed brain
    better = predicted(7.5)
    better["tests"] |= {"advantage": "The atlas was better."}
    assert "<strong>The atlas was better. At 23 GW" in page(figures, prediction=better)


def test_a_prediction_beyond_those_that_were_tried_says_so():
    last = max(row["horizon"] for row in ACCURACY["rows"])
    assert accuracy_sentence(predicted(last)).count(f"{last:g} weeks") == 1
    rows = [
        {"horizon": 2.0, "model": name, "distance_mm": 0.5, "r_shape_index": 0.8}
        for name in ("run", "atlas", "scaled")
    ]
    worse = [rows[0] | {"r_shape_index": 0.7}, *rows[1:]]
    told = [
        accuracy_sentence(predicted(2.0) | {"accuracy": {"rows": accuracy}})
        for accuracy in (rows, worse)
    ]
    assert ["shape index; it is stored with" in sentence for sentence in told] == [
        False,
        True,
    ]
    assert accuracy_sentence(predicted(last + 1)) == Facts(
        f"{last:g} weeks", f"{last + 1:g} weeks"
    )
    # where the atlas' own brain was better, that comes first
    brain = predicted(2.0)
    assert accuracy_sentence(brain).startswith("This is a prediction")
    brain["tests"] |= {"advantage": "The atlas was better."}
    assert accuracy_sentence(brain).startswith(
        "The atlas was better. This is a prediction"
    )


def test_shipped_accuracy_has_all_baselines_and_at_least_two_starts_at_each_horizon():
    rows = pd.DataFrame(ACCURACY["rows"])
    assert (rows.groupby("horizon")["start"].nunique() >= 2).all()
    assert not rows.duplicated(["start", "start_week", "horizon", "model"]).any()
    by_way = rows.pivot_table(
        "distance_mm", ["start", "start_week", "horizon"], "model"
    )
    assert set(by_way) == {"run", "target", "atlas", "atlas_deformed", "scaled"}
    assert by_way.notna().all(axis=None)
    # a prediction that is worth less than no folding would not be shipped
    assert (by_way["run"] < by_way["scaled"]).all()
    assert rows["r_shape_index"].between(0, 1).all()


def test_paths_are_hidden():
    named = {
        "labels": "/data/Smith_John.nii.gz",
        "brains": [{"id": "a", "pial": "C:\\x\\lh.pial", "image": "S.nii"}],
    }
    hidden = {
        "labels": "(file)",
        "brains": [{"id": "a", "pial": "(file)", "image": "(file)"}],
    }
    plain = {"population": "spina bifida aperta", "week": 21.0}
    assert hide_paths(named | plain) == hidden | plain


def test_a_brain_has_a_row_with_pictures_numbers_verdict_and_cause_or_warnings():
    tables = Tables(**TABLES)
    young, old = brain_rows(BRAINS, tables, linked=PICTURES)
    assert (young["verdict"], young["cause"]) == ("needs review", "a bridge was cut")
    assert (old["verdict"], old["cause"]) == ("refused", "cropped")
    assert young["facts"] == ["21 GW", "healthy", "sex: F", "CC0 1.0"]
    assert old["facts"][:3] == ["23 GW", "healthy", "labels"]
    assert [row["numbers"]["volume, with ventricles (mL)"] for row in (young, old)] == [
        ("46.2", ["88 (70 to 96), +1.2"]),
        ("–", []),
    ]
    # averages give no centile
    assert young["numbers"]["pial area (cm²)"] == ("90", ["−10.0 %"])
    # without a norm, atlases, and what a warning says of a metric
    quality = QUALITY.assign(area_is_lower_bound=[True, np.nan])
    unrated = {"quality": quality, "centiles": CENTILES.assign(centile=np.nan)}
    unrated["centiles"]["expected"] = np.nan
    unrated["differences"] = FROM_ATLAS
    young, old = brain_rows(BRAINS, Tables(**TABLES | unrated), linked=PICTURES)
    assert young["numbers"]["pial area (cm²)"] == ("90", ["lower bound", "−10.0 % CRL"])
    assert young["numbers"]["volume, with ventricles (mL)"] == ("46.2", [])
    text = page([], **unrated)
    assert [words for words in elements(text, "p") if "CRL" in words] == [
        Facts("CRL (Gholipour et al. 2017)")
    ]
    rows = re.findall(
        "<tr>.*?</tr>", page([]).partition('<div class="wide brains">')[2], re.DOTALL
    )[1:3]
    assert [("<img " in row, "href" in row) for row in rows] == [
        (True, True),
        (False, False),
    ]
    assert elements(rows[0], "td")[2:] == ["46.288 (70 to 96), +1.2", "90−10.0 %"]
    # the verdict is below the name, which is seen on narrow screens
    _, described, *numbers = elements(rows[1], "td")
    assert described.startswith("old23 GW;")
    assert described.endswith("refusedcropped")
    assert numbers == ["–", "–"]


def test_a_page_says_how_certain_its_centiles_are():
    few = pd.concat(
        [MEASURES["centiles"], MEASURES["centiles"].assign(flag="too few brains")]
    )
    # those of an atlas itself are not spoken of
    for text in (page(shown("growth_figure")), page([], centiles=few)):
        sentences = [sentence for sentence in elements(text, "p") if "norm" in sentence]
        assert sentences == [Facts("90 %", "z"), Facts("the norm")]
    published = ("ten", "z", "dhcp-19", "results/study/published_centiles.csv")
    for flag, facts in (("few brains", (30, 5, 95)), ("too few brains", published)):
        text = page([], centiles=MEASURES["centiles"].assign(flag=flag))
        assert [sentence for sentence in elements(text, "p") if "norm" in sentence] == [
            Facts(*facts)
        ]


def test_a_brain_has_a_page_of_its_own():
    warnings = pd.DataFrame(
        {
            "subject": ["young", "young", "old"],
            "run": [np.nan, "thin", np.nan],
            "step": "s",
            "level": "warning",
            "message": ["own", "of a run", "of another"],
        }
    )
    own = {"warnings": warnings, "differences": FROM_ATLAS}
    tables = Tables(**TABLES | own)
    text = written(brain_page(BRAINS[0], tables, shown("quality"), norm="the norm"))
    assert 'href="../report.html"' in text
    assert text.index("<th>left</th>") < text.index(">own<") < text.index("<h2>quality")
    assert ("of a run" in text, "of another" in text) == (False, False)
    # first both hemispheres, and where the brain stands
    before, _, _ = text.partition("<h2>quality")
    row = r"pial area \(cm²\)</td>.*90<.*44<.*−10.0 % \(&gt; 10 ×"
    assert re.search(row, before)
    assert "medical device" in before
    heads = [head for head in elements(before, "th") if "CRL" in head]
    assert heads == [Facts("difference from CRL", "multiples of the noise")]
    (compared,) = [words for words in elements(before, "p") if "Gholipour" in words]
    assert compared == Facts("CRL", "2017")
    tables = Tables(**TABLES)
    text = written(brain_page(BRAINS[0], tables, shown("quality"), norm="the norm"))
    assert "no atlas to compare with" in text


def sheet(**tables) -> str:
    """Return the first part of the page of a brain, with others than the usual
    tables."""
    all_tables = Tables(**TABLES | tables)
    text = written(brain_page(BRAINS[0], all_tables, [], norm="the norm"))
    return text.partition('<section id="brains">')[0]


def test_the_first_sheet_says_that_thickness_is_not_to_be_compared_with_atlases():
    thickness = METRICS[:1].assign(metric="mean_thickness", value=1.9, unit="mm")
    values = {
        atlas: pd.Series(
            facts["values"]["whole"]["mean_thickness"], index=facts["weeks"]
        )
        for atlas, facts in ATLASES.items()
    }
    ratio = (values["chinese"] / values["crl"]).dropna()
    smallest, largest = 100 * (1 - ratio.max()), 100 * (1 - ratio.min())
    text = sheet(differences=FROM_ATLAS, metrics=pd.concat([METRICS, thickness]))
    (compared,) = [words for words in elements(text, "p") if "Thickness" in words]
    assert compared == Facts(f"{smallest:.0f} to {largest:.0f} %")
    assert "Thickness" not in sheet(differences=FROM_ATLAS)


def test_the_first_sheet_says_by_how_much_parts_differ_from_the_volume():
    most = 0.0
    for facts in ATLASES.values():
        values = pd.DataFrame(facts["values"]["whole"])
        parts = values["volume_tissue"] + values["volume_ventricles"]
        most = max(most, 100 * (parts / values["volume"] - 1).abs().max())
    # those of the atlases; of small brains in large voxels it is more
    assert 1.0 < most < 3.0
    tissue = METRICS[:1].assign(metric="volume_tissue", value=40.0)
    text = sheet(differences=FROM_ATLAS, metrics=pd.concat([METRICS, tissue]))
    (told,) = [words for words in elements(text, "p") if "in voxels" in words]
    assert told == Facts("up to 3 %")
    assert "in voxels" not in sheet(differences=FROM_ATLAS)


@pytest.mark.parametrize(
    ("weeks", "words"),
    [
        ((20.0, 21.0, 22.0), "20 and 22 GW: volume −10.0 % and +30.0 %"),
        ((21.0, 22.0, 23.0), "22 GW: volume +10.0 %"),
    ],
)
def test_the_first_sheet_says_what_a_week_of_age_is_worth(weeks, words):
    values = {
        "volume": [9.0, 10.0, 13.0] if weeks[0] == 20 else [10.0, 11.0, 13.0],
        "area": [80.0, 100.0, 125.0],
        "gyrification_index": [1.0, 1.1, 1.21],
        "mean_sulcal_depth": [2.0, 3.0, 4.0],
        "mean_thickness": [1.0, 2.0, 3.0],
    }
    curves = pd.concat(
        pd.DataFrame({"metric": name, "week": weeks, "value": numbers})
        for name, numbers in values.items()
    ).assign(atlas="crl", hemisphere="whole")
    text = sheet(differences=FROM_ATLAS, curves=curves)
    (told,) = [line for line in elements(text, "p") if "week of age" in line]
    assert told == Facts(f"CRL at {words}")
    assert "thickness" not in told
    parts = told.partition("week of age")[2].split(", ")
    assert [part.split(" −")[0].split(" +")[0] for part in parts[1:4]] == [
        "pial area",
        "gyrification index",
        "mean depth below the hull",
    ]


def test_the_first_sheet_says_from_which_files_it_was_made_by_which_version_and_when():
    text = sheet(differences=FROM_ATLAS)
    (told,) = [line for line in elements(text, "p") if "SHA-256" in line]
    assert told == Facts("labels", "12ab", "gyriflow 0.1", "2026-01-01")


def test_a_verdict_of_fine_says_that_faults_may_give_no_warning():
    sentences = []
    for judged, warnings in (
        ("fine", NO_WARNINGS),
        ("fine", OWN_WARNING),
        ("needs review", OWN_WARNING),
    ):
        tables = Tables(
            **TABLES | {"quality": QUALITY.assign(verdict=judged), "warnings": warnings}
        )
        text = written(brain_page(BRAINS[0], tables, [], norm="the norm"))
        (found,) = [words for words in elements(text, "p") if "Quality of" in words]
        sentences.append(found)
    fine, warned, doubtful = sentences
    assert fine == Facts("fine: no automatic warning.", "docs/how-to/bad-inputs.md")
    assert warned == Facts("fine (warnings below", "docs/how-to/bad-inputs.md")
    assert doubtful == Facts("needs review (warnings below")
    assert "bad-inputs.md" not in doubtful


def test_a_measured_study_begins_with_how_many_brains_have_which_verdict():
    quality = pd.concat([QUALITY, QUALITY[:1].assign(subject="third")])
    text = page([], runs=None, validation=None, quality=quality)
    assert "3 brains: 2 need review, 1 refused." in text


def test_equal_warnings_are_one_row_with_each_brain_once():
    names = ["young", "old", "young"]
    warnings = pd.DataFrame({"subject": names, "run": np.nan, "step": "s"})
    warnings = warnings.assign(level="warning", message="too small")
    text = page([], warnings=warnings)
    assert text.count("too small") == 1
    assert "young; old<" in text


def test_a_run_is_judged_and_scored_at_its_last_compared_week():
    (row,) = scores_table(RUNS, VALIDATION).to_dict("records")
    assert row["verdict"] == Facts("22 GW", 23, 1.2, 2)
    assert row["observed brain"] == Facts("23 GW", "predicted")
    assert row["area (%)"] == "−7.9"
    assert (row["r"], row["gain"]) == ("0.57 (0.51 to 0.61)", "−0.00 (−0.04 to +0.04)")
    assert row["distance (mm)"] == "0.42"
    # of the same run from another brain of that week
    other = VALIDATION.assign(start="old", distance_mm=9.0)
    both = scores_table(RUNS, pd.concat([VALIDATION, other]))
    assert both["distance (mm)"].tolist() == ["0.42"]
    (alone,) = scores_table(RUNS).to_dict("records")
    assert alone["gain"] == "–"
    assert "GW" not in alone["observed brain"]


@pytest.mark.parametrize(
    ("order", "through", "facts"),
    [
        (1, (8.4, 8.2), []),
        (1, (2.0, 2.0), [["2 linear", "32 %", "4 %"]]),
        (2, (1.0, 1.0), []),
        (1, (1.0, 1.0), [[1, 2], ["32 %"]]),
        (2, (0.6, 0.5), [[0.6]]),
        (1, (2.3, 2.1, 1.9, 1.7), [["22.5 GW", 1.7, 2], ["27 %"]]),
        (2, (1.0, 0.9, 0.7, 0.6), [["22.5 GW", 0.6]]),
        (2, (1.0, 0.9, np.nan), [[0]]),
        (1, (np.nan, np.nan), [["nan", 2]]),
        (1, (2.3, 1.96), [["2.3 linear"]]),
    ],
)
def test_a_run_is_judged_by_the_elements_through_its_cortex(order, through, facts):
    # to its end, with so many elements before its steps of half a week and in them
    steps = pd.DataFrame(
        {
            "week": 21.5 + 0.5 * np.arange(len(through)),
            "elements_through_cortex": through,
        }
    )
    run = {
        **RUNS.iloc[0].to_dict(),
        "weeks": "[21.0, 23.0]",
        "elements_through_cortex": through[0],
    }
    run |= resolution_over_steps(order, steps, has_layers=True)
    reached, *doubts = run_verdict(run).split("; ")
    assert (reached, doubts) == (Facts("23 GW"), [Facts(*doubt) for doubt in facts])
    assert len(run_verdict(run | {"min_J": -0.1}).split("; ")) == 2 + len(doubts)
    assert run_verdict(run | {"initial_penetration_mm": 0.45}) == run_verdict(run)
    assert run_verdict(run | {"initial_penetration_mm": 0.55}) == Facts("0.55 mm")
    # layers do not enter growth towards shapes
    run |= {"growth.model": "shapes"} | resolution_over_steps(
        order, steps, has_layers=False
    )
    assert run_verdict(run) == reached
    assert np.isnan([run["element_error_percent"], run["unresolved_from_week"]]).all()


def test_the_methods_say_what_was_run():
    packages = dict.fromkeys(
        ("scikit-image", "fenics-dolfinx", "petsc4py", "snakemake"), "9.9"
    )
    software = {"gyriflow": "0.1", "packages": packages}
    parameters = {
        "start_week": 21.0,
        "step_s": 43200.0,
        "material": "neo-hookean",
        "shear_modulus_cortex_pa": 1500.0,
        "shear_modulus_core_pa": {"map": "core"},
        "poisson_ratio": 0.45,
        "thickness_mm": 1.5,
        "growth": {"model": "rates"},
        "growth_rate_per_s": 2e-7,
        "core_growth_rate_per_s": 0.0,
        "stress_memory_gw": 0.0,
        "contact": "global",
    }
    summary = {"weeks": [21.0, 24.5], "steps": 49, "tets": 1234}
    led = parameters | {"growth": {"model": "shapes", "of": "self"}}
    brains = [
        {
            "week": 21.0,
            "population": "spina bifida",
            "source": "labels",
            "synthetic": False,
        },
        {"week": 24.5, "population": None, "source": "shape", "synthetic": True},
    ]
    runs = [
        {
            "run": "stiff",
            "start": "young",
            "growth_of": "",
            "parameters": parameters,
            "summary": summary,
        },
        {
            "run": "led",
            "start": "a",
            "growth_of": "population cohort",
            "parameters": led,
            "summary": summary,
        },
        {
            "run": "own",
            "start": "a",
            "growth_of": "own",
            "parameters": led,
            "summary": summary,
        },
    ]
    template, metrics = (PAGE / "methods.rst").read_text(), {"curvature_radius_mm": 3.0}
    surface = {"ids": ["young"], "cortex": "white", "by_cortex": True}
    atlas = {"ids": ["old", "older"], "cortex": "measured", "by_cortex": False}
    text = methods_text(
        template,
        brains=brains,
        runs=runs,
        software=software,
        metrics=metrics,
        atlases={},
        filled=[surface, atlas],
        surface={"edge_length_mm": 0.8, "open_sulci": False},
        mesh={"order": 2, "mesher": "tetgen"},
    )
    # closed sulci make areas after 26 GW lower bounds
    assert text.split("\n\n")[0] == Facts(
        2, 21, 24.5, "GW", 1, "spina bifida", "gyriflow 0.1", 26, "0.8 mm"
    )
    assert text == Facts(
        "young, given as surfaces, was",
        "white and pial",
        "cerebrum and cortex",
        "old, older",
        "alone",
    )
    stiff, led, own = (line for line in text.splitlines() if line.startswith("- "))
    assert stiff == Facts(
        "*stiff*",
        "young",
        21,
        "24.5 GW",
        49,
        "12 h",
        1234,
        "quadratic",
        1500,
        "Pa",
        "2·10⁻⁷",
        "[4]",
    )
    assert "{" not in stiff
    assert led == Facts("*led*", "population cohort")
    assert led != Facts("atlas")
    assert not {"atlas", "population"} & set(own.split())
    alone, opened = (
        methods_text(
            template,
            brains=brains[:1],
            runs=[],
            software=software,
            metrics=metrics,
            atlases={"crl": "G. et al.: Curves", "own": "Own curves"} if opens else {},
            filled=[],
            surface={"edge_length_mm": 1, "open_sulci": opens},
        )
        for opens in (False, True)
    )
    assert "Simulation" not in opened
    assert "Tallinen" not in opened
    assert opened == Facts("Koenderink", "[1]")
    assert opened != Facts(26)
    assert alone == Facts(26)
    assert alone != Facts("slits")
    assert opened == Facts(
        "slits", "CRL [4]", "own [5]", "4. G. et al.: Curves", "5. Own curves"
    )
    assert caption_html(opened).count("<li><p>") == 5
    assert "atlas" not in alone
    assert "filled" not in opened
    assert caption_html(text).count("<li><p>") == 3 + 7
    assert "system-message" not in caption_html(text)


def test_messages_tell_files_without_their_folders(monkeypatch):
    monkeypatch.setitem(
        QUALITY,
        "warnings",
        ["/data/Smith John/x.nii.gz: cortex of 1 voxel, see https://a.b/c", ""],
    )
    text = page(shown("growth_figure"))
    assert "x.nii.gz: cortex of 1 voxel, see https://a.b/c" in text
    assert "Smith" not in text


def test_a_page_without_simulations_says_how_many_brains_were_measured():
    assert elements(page([], runs=None, validation=None), "strong")[0] == Facts(
        2, 1, "refused"
    )
