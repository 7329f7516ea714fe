"""The report is one page with everything inside, and tells no paths."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from facts import Facts
from markupsafe import Markup, escape
from text_tables import frame

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
    scores_table,
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
OWN_WARNING = frame("subject run message\nyoung - own", **WARNING)
QUALITY = frame(
    "subject\nyoung\nold",
    verdict=["needs review", "refused"],
    cause=[np.nan, "cropped"],
    warnings=["a bridge was cut", np.nan],
)
METRICS = frame(
    """
    subject run      week hemisphere metric value unit
    young   observed 21   whole      volume 46.2  mL
    young   observed 21   whole      area   90    cm2
    young   observed 21   left       area   44    cm2
    """
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


def shown(
    *rules: str,
    title: str = "{brain}",
    caption: str = "of *all* brains",
    content: str = "",
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


def written(content: dict, view: dict | None = None) -> str:
    texts = {name: (PAGE / file).read_text() for name, file in PARTS.items()}
    template = (PAGE / "page.html").read_text()
    no_view = {"groups": [], "maps": []}
    return report_page(template, texts, view or no_view, **ORIGIN, **content)


def page(
    figures: list[dict] = (),
    view: dict | None = None,
    prediction: dict | None = None,
    **tables,
) -> str:
    """Return the page of a study, with others than the usual tables."""
    about = {"norm": "the norm", "pictures": PICTURES, "prediction": prediction}
    return written(
        study_page(BRAINS, Tables(**TABLES | tables), figures, **about), view
    )


def sheet(**tables) -> str:
    """Return the first part of the page of a brain, with others than the usual
    tables."""
    all_tables = Tables(**TABLES | tables)
    content = brain_page(BRAINS[0], all_tables, shown("quality"), norm="the norm")
    return written(content).partition("<h2>quality")[0]


def elements(text: str, name: str, word: str = "") -> list[str]:
    """Return the texts inside the elements of a page that have a name, without their
    tags: those with a word."""
    inside = re.findall(rf"<{name}\b[^>]*>(.*?)</{name}>", text, re.DOTALL)
    texts = [Markup(part).striptags() for part in inside]
    return [text for text in texts if word in text]


def require_order(text: str, *parts: str) -> None:
    places = [text.index(part) for part in parts]
    assert places == sorted(places)


# the page of a study


def test_the_page_has_its_parts_and_asks_for_nothing_from_elsewhere():
    figures = [
        *shown("growth_figure", content="<table></table>"),
        *shown("weekly_figure", caption="first <page>"),
    ]
    text = page(figures, {"groups": [{"name": "</script><b>"}], "maps": []})
    outside = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    links = re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', outside)
    assert links == ['href="brains/young.html"']
    assert "</script><b>" not in text
    assert "<em>all</em>" in text
    names = ("surfaces-in-3d", "growth_figure", "brains", "provenance")
    ids = [f'<section id="{name}' for name in names]
    require_order(text, "first &lt;page", "results/study/validation.csv", *ids)
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


def test_messages_tell_files_without_their_folders(monkeypatch):
    message = "/data/Smith John/x.nii.gz: cortex of 1 voxel, see https://a.b/c"
    monkeypatch.setitem(QUALITY, "warnings", [message, ""])
    text = page()
    assert "x.nii.gz: cortex of 1 voxel, see https://a.b/c" in text
    assert "Smith" not in text


def test_sections_stand_in_order_with_technical_figures_last_and_numbers_run_through():
    figures = shown("steps", "maps", "rates")
    for figure, name in zip(figures, "AAB", strict=True):
        figure["section"] = name
    about = {"norm": "the norm", "pictures": PICTURES}
    content = study_page(BRAINS, Tables(**TABLES), figures, **about)
    found = [
        (name, [(item["number"], item["technical"]) for item in items])
        for name, items in content["sections"]
    ]
    assert found == [("A", [(1, False), (2, True)]), ("B", [(3, False)])]
    assert "<details><summary>2. a</summary>" in page(figures)


def test_a_study_without_simulations_says_how_many_brains_have_which_verdict():
    quality = pd.concat([QUALITY, QUALITY[:1].assign(subject="third")])
    text = page(**MEASURED_ONLY, quality=quality)
    assert elements(text, "strong")[0] == "3 brains: 2 need review, 1 refused."


def test_equal_warnings_are_one_row_with_each_brain_once():
    text = "subject run\nyoung -\nold -\nyoung -"
    warnings = frame(text, message="too small", **WARNING)
    text = page(warnings=warnings)
    assert text.count("too small") == 1
    assert "young; old<" in text


def test_paths_are_hidden():
    pial = {"id": "a", "pial": "C:\\x\\lh.pial", "image": "S.nii"}
    named = {"labels": "/data/Smith_John.nii.gz", "brains": [pial]}
    hidden = {"id": "a", "pial": "(file)", "image": "(file)"}
    plain = {"population": "spina bifida aperta", "week": 21.0}
    expected = {"labels": "(file)", "brains": [hidden]}
    assert hide_paths(named | plain) == expected | plain


# brains


def rows_of_brains(**tables):
    return brain_rows(BRAINS, Tables(**TABLES | tables), linked=PICTURES)


def test_a_brain_has_a_row_with_numbers_verdict_and_cause_or_warnings():
    young, old = rows_of_brains()
    assert (young["verdict"], young["cause"]) == ("needs review", "a bridge was cut")
    assert (old["verdict"], old["cause"]) == ("refused", "cropped")
    assert young["facts"] == ["21 GW", "healthy", "sex: F", "CC0 1.0"]
    assert old["facts"][:3] == ["23 GW", "healthy", "labels"]
    # averages give no centile
    assert young["numbers"] == {
        "volume, with ventricles (mL)": ("46.2", ["88 (70 to 96), +1.2"]),
        "pial area (cm²)": ("90", ["−10.0 %"]),
    }
    assert old["numbers"] == {title: ("–", []) for title in young["numbers"]}


def test_numbers_without_a_norm_have_their_warnings_and_differences_from_atlases():
    quality = QUALITY.assign(area_is_lower_bound=[True, np.nan])
    centiles = CENTILES.assign(centile=np.nan, expected=np.nan)
    unrated = {"quality": quality, "centiles": centiles, "differences": FROM_ATLAS}
    young, _ = rows_of_brains(**unrated)
    assert young["numbers"] == {
        "volume, with ventricles (mL)": ("46.2", []),
        "pial area (cm²)": ("90", ["lower bound", "−10.0 % CRL"]),
    }
    cited = Facts("CRL (Gholipour et al. 2017)")
    assert elements(page(**unrated), "p", "CRL") == [cited]


def test_the_table_of_brains_has_pictures_and_links_of_those_with_pages():
    table = page().partition('<div class="wide brains">')[2]
    _, young, old, *_ = re.findall("<tr>.*?</tr>", table, re.DOTALL)
    assert [("<img " in row, "href" in row) for row in (young, old)] == [
        (True, True),
        (False, False),
    ]
    assert elements(young, "td")[2:] == ["46.288 (70 to 96), +1.2", "90−10.0 %"]
    # the verdict is below the name, which is seen on narrow screens
    _, described, *numbers = elements(old, "td")
    assert described.startswith("old23 GW;")
    assert described.endswith("refusedcropped")
    assert numbers == ["–", "–"]


def test_a_page_says_how_certain_its_centiles_are():
    # the few brains of an atlas itself are not spoken of
    few = pd.concat([CENTILES, CENTILES.assign(flag="too few brains")])
    published = ("ten", "z", "dhcp-19", "results/study/published_centiles.csv")
    for centiles, facts in (
        (few, [("90 %", "z"), ("the norm",)]),
        (CENTILES.assign(flag="few brains"), [(30, 5, 95)]),
        (CENTILES.assign(flag="too few brains"), [published]),
    ):
        sentences = elements(page(centiles=centiles), "p", "norm")
        assert sentences == [Facts(*words) for words in facts]


# the page of a brain


def test_a_brain_has_a_page_of_its_own():
    text = "subject run message\nyoung - own\nyoung thin of-a-run\nold - of-another"
    tables = Tables(**TABLES | {"warnings": frame(text, **WARNING)})
    text = written(brain_page(BRAINS[0], tables, shown("quality"), norm="the norm"))
    assert 'href="../report.html"' in text
    require_order(text, "<th>left</th>", ">own<", "<h2>quality")
    assert ("of-a-run" in text, "of-another" in text) == (False, False)
    assert "no atlas to compare with" in text


def test_the_first_sheet_has_both_hemispheres_and_where_the_brain_stands():
    text = sheet(differences=FROM_ATLAS)
    row = r"pial area \(cm²\)</td>.*90<.*44<.*−10.0 % \(&gt; 10 ×"
    assert re.search(row, text)
    assert "medical device" in text
    noise = Facts("difference from CRL", "multiples of the noise")
    assert elements(text, "th", "CRL") == [noise]
    assert elements(text, "p", "Gholipour") == [Facts("CRL", "2017")]
    made = Facts("labels", "12ab", "gyriflow 0.1", "2026-01-01")
    assert elements(text, "p", "SHA-256") == [made]


ATLASES = read_yaml(SHIPPED / "norms" / "atlases.yaml")["atlases"]


def test_the_first_sheet_says_that_thickness_is_not_to_be_compared_with_atlases():
    thickness = METRICS[:1].assign(metric="mean_thickness", value=1.9, unit="mm")
    values = {}
    for atlas, facts in ATLASES.items():
        whole = facts["values"]["whole"]
        values[atlas] = pd.Series(whole["mean_thickness"], index=facts["weeks"])
    ratio = (values["chinese"] / values["crl"]).dropna()
    smallest, largest = 100 * (1 - ratio.max()), 100 * (1 - ratio.min())
    text = sheet(differences=FROM_ATLAS, metrics=pd.concat([METRICS, thickness]))
    differs = Facts(f"{smallest:.0f} to {largest:.0f} %")
    assert elements(text, "p", "Thickness") == [differs]
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
    assert elements(text, "p", "in voxels") == [Facts("up to 3 %")]
    assert "in voxels" not in sheet(differences=FROM_ATLAS)


@pytest.mark.parametrize(
    ("weeks", "volumes", "words"),
    [
        ((20, 21, 22), (9, 10, 13), "20 and 22 GW: volume −10.0 % and +30.0 %"),
        ((21, 22, 23), (10, 11, 13), "22 GW: volume +10.0 %"),
    ],
)
def test_the_first_sheet_says_what_a_week_of_age_is_worth(weeks, volumes, words):
    curves = frame(
        """
        volume area gyrification_index mean_sulcal_depth mean_thickness
        0      80   1                  2                 1
        0      100  1.1                3                 2
        0      125  1.21               4                 3
        """
    )
    curves = curves.assign(volume=volumes, week=weeks).melt("week", var_name="metric")
    curves = curves.assign(atlas="crl", hemisphere="whole")
    text = sheet(differences=FROM_ATLAS, curves=curves)
    (told,) = elements(text, "p", "week of age")
    assert told == Facts(f"CRL at {words}")
    names = (", pial area", ", gyrification index", ", mean depth below the hull")
    require_order(told, words, *names)
    assert "thickness" not in told


@pytest.mark.parametrize(
    ("judged", "warnings", "facts"),
    [
        ("fine", NO_WARNINGS, ["fine: no automatic warning.", "bad-inputs.md"]),
        ("fine", OWN_WARNING, ["fine (warnings below", "bad-inputs.md"]),
        ("needs review", OWN_WARNING, ["needs review (warnings below"]),
    ],
)
def test_a_verdict_of_fine_says_that_faults_may_give_no_warning(
    judged, warnings, facts
):
    text = sheet(quality=QUALITY.assign(verdict=judged), warnings=warnings)
    (found,) = elements(text, "p", "Quality of")
    assert found == Facts(*facts)
    assert ("bad-inputs.md" in found) == (judged == "fine")


# runs


FINE = RUNS.assign(elements_through_cortex=8.5, unresolved_from_week=np.nan)
NONE = frame("level message")
FAILED = pd.DataFrame({"level": ["warning", "error"], "message": ["holes", "it died."]})
TWO = pd.DataFrame({"level": "warning", "message": ["one element", "coarse"]})
COMPARED = ("23 GW", "thin", "predicted", 0.57, "0.42 mm")


@pytest.mark.parametrize(
    ("runs", "validation", "warnings", "facts", "without"),
    [
        (RUNS, VALIDATION, NONE, [*COMPARED, 1.2, 2], "warnings"),
        # the warning names its run
        (
            RUNS.assign(run="coarse"),
            VALIDATION,
            NONE,
            ["thin", "coarse", 1.2],
            "warnings",
        ),
        (RUNS, VALIDATION, FAILED, ["23 GW", "it died."], "holes"),
        # a warning about one element is not the worst of several
        (RUNS, VALIDATION, TWO, [*COMPARED, 1.2, 2], "one element"),
        (FINE, None, TWO, [NOT_COMPARED, "2 warnings"], "one element"),
        (FINE, None, TWO[:1], [NOT_COMPARED, "one element"], "warnings"),
        (FINE, None, NONE, [NOT_COMPARED, "no warnings"], "Worst"),
    ],
)
def test_the_verdict_tells_what_was_compared_and_the_worst_warning(
    runs, validation, warnings, facts, without
):
    told = verdict(runs, validation, warnings)
    assert told == Facts(*facts)
    assert without not in told
    tables = {"runs": runs, "validation": validation}
    if warnings is NONE:
        assert told in page(**tables).replace("&#39;", "'")


def run_verdict(run):
    (row,) = scores_table(pd.DataFrame([run])).to_dict("records")
    return row["verdict"]


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
    weeks = 21.5 + 0.5 * np.arange(len(through))
    steps = pd.DataFrame({"week": weeks, "elements_through_cortex": through})
    run = RUNS.iloc[0].to_dict() | {"elements_through_cortex": through[0]}
    run |= {"weeks": "[21.0, 23.0]"}
    run |= resolution_over_steps(order, steps, has_layers=True)
    reached, *doubts = run_verdict(run).split("; ")
    assert (reached, doubts) == (Facts("23 GW"), [Facts(*doubt) for doubt in facts])
    assert len(run_verdict(run | {"min_J": -0.1}).split("; ")) == 2 + len(doubts)
    assert run_verdict(run | {"initial_penetration_mm": 0.45}) == run_verdict(run)
    assert run_verdict(run | {"initial_penetration_mm": 0.55}) == Facts("0.55 mm")
    # layers do not enter growth towards shapes
    run |= resolution_over_steps(order, steps, has_layers=False)
    assert run_verdict(run | {"growth.model": "shapes"}) == reached
    assert np.isnan([run["element_error_percent"], run["unresolved_from_week"]]).all()


# predictions

ACCURACY = read_yaml(SHIPPED / "norms" / "predictions.yaml")
KEPT = """
week smooth_share finer_share difference_mm
23   0.9          0.7         0.71
30   0.6          0.1         0.71
34   0.5          0.0         0.71
"""


def predicted(weeks: float, advantage: str = "") -> dict:
    """Return what the report of a prediction is given, so many weeks ahead of 22 GW."""
    licence = {"name": "CRL licence", "url": None, "terms": "Research only."}
    atlas = {"name": "crl", "title": "An atlas", "reference": "A. et al., doi 10.1/x"}
    errors = {"area": "largest error in 4 tests"}
    return {
        "run": "thin",
        "brain": "young",
        "start_week": 22.0,
        "week": 22 + weeks,
        "atlas_brain": "crl-30",
        "atlas_week": 30,
        "population": "well",
        "atlas": atlas | {"licence": licence | {"accept": True}},
        "accuracy": ACCURACY,
        "tests": {"errors": errors, "starts": ["crl 22 GW"], "advantage": advantage},
        "kept": frame(KEPT),
        "surfaces": ["results/a.surf.gii"],
        "atlas_surface": "results/atlas.surf.gii",
        "labels": "results/a_dseg.nii.gz",
    }


FIGURES = shown("predicted_figure", "weekly_figure", caption="of *all*")


def test_the_report_of_a_prediction_says_what_it_is_how_accurate_and_in_which_files():
    then = METRICS[1:2].assign(run="thin", week=29.5, value=210.5)
    tables = {"validation": None, "metrics": pd.concat([METRICS, then])}
    text = " ".join(page(FIGURES, prediction=predicted(7.5), **tables).split())
    assert elements(text, "h1") == [Facts("young", "29.5 GW", "the atlas crl")]
    assert Facts("young", "22 GW", "29.5 GW", 7.5, "An atlas") in elements(text, "p")
    require_order(
        text,
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
    # no table of dashes, and the other figure in its section
    assert "results/study/validation.csv" not in text
    assert "<h2>weekly_figure" in text


def test_a_prediction_beside_an_observed_brain_has_scores_and_the_atlas_advantage():
    text = page(prediction=predicted(7.5, advantage="The atlas was better."))
    assert "results/study/validation.csv" in text
    assert "<strong>The atlas was better. At 23 GW" in text


def test_a_prediction_beyond_those_that_were_tried_says_so():
    last = max(row["horizon"] for row in ACCURACY["rows"])
    assert accuracy_sentence(predicted(last)).count(f"{last:g} weeks") == 1
    beyond = accuracy_sentence(predicted(last + 1))
    assert beyond == Facts(f"{last:g} weeks", f"{last + 1:g} weeks")


@pytest.mark.parametrize(
    ("r", "advantage", "begin", "is_simpler_better"),
    [
        (0.8, "", "This is a prediction", False),
        (0.7, "", "This is a prediction", True),
        # what was measured on the brain itself comes first
        (0.7, "The atlas was better.", "The atlas was better. This is", False),
    ],
)
def test_a_prediction_says_where_the_atlas_own_brain_was_better(
    r, advantage, begin, is_simpler_better
):
    rows = frame("model r_shape_index\natlas 0.8\nscaled 0.8\nrun 0.8")
    rows.loc[2, "r_shape_index"] = r
    rows = rows.assign(horizon=2.0, distance_mm=0.5).to_dict("records")
    told = accuracy_sentence(predicted(2.0, advantage) | {"accuracy": {"rows": rows}})
    assert told.startswith(begin)
    assert ("shape index; it is stored with" in told) == is_simpler_better


def test_shipped_accuracy_has_all_baselines_and_at_least_two_starts_at_each_horizon():
    rows = pd.DataFrame(ACCURACY["rows"])
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

TEMPLATE = (PAGE / "methods.rst").read_text()
SOFTWARE = {
    "gyriflow": "0.1",
    "packages": dict.fromkeys(
        ("scikit-image", "fenics-dolfinx", "petsc4py", "snakemake"), "9.9"
    ),
}
MEASURED_BRAIN = {"week": 21.0, "population": "spina bifida", "source": "labels"}
MEASURED_BRAIN |= {"synthetic": False}


def methods(**used) -> str:
    usual = {"brains": [MEASURED_BRAIN], "runs": [], "atlases": {}, "filled": []}
    usual |= {"metrics": {"curvature_radius_mm": 3.0}, "software": SOFTWARE}
    usual |= {"surface": {"edge_length_mm": 0.8, "open_sulci": False}}
    return methods_text(TEMPLATE, **usual | used)


PARAMETERS = read_yaml(Path(__file__).with_name("parameters.yaml"))
RUN_SUMMARY = {"weeks": [21.0, 24.5], "steps": 49, "tets": 1234}


def run(name, growth_source, growth):
    """Return what the methods get of a run from one start brain."""
    parameters = PARAMETERS | {"growth": growth}
    about = {"run": name, "start": "young", "growth_of": growth_source}
    return about | {"parameters": parameters, "summary": RUN_SUMMARY}


def test_the_methods_say_which_brains_and_runs_there_were(recorded):
    shape = {"week": 24.5, "population": None, "source": "shape", "synthetic": True}
    shapes = {"model": "shapes", "of": "self"}
    text = methods(
        brains=[MEASURED_BRAIN, shape],
        runs=[
            run("stiff", "", {"model": "rates"}),
            run("led", "population cohort", shapes),
            run("own", "own", shapes),
        ],
        filled=[
            {"ids": ["young"], "cortex": "white", "by_cortex": True},
            {"ids": ["old", "older"], "cortex": "measured", "by_cortex": False},
        ],
        mesh={"order": 2, "mesher": "tetgen"},
    )
    recorded(dict(enumerate(text.splitlines())))
    assert caption_html(text).count("<li><p>") == 3 + 7
    assert "system-message" not in caption_html(text)


def test_the_methods_of_measured_brains_are_without_those_of_simulations(recorded):
    # closed sulci make areas after 26 GW lower bounds
    recorded(dict(enumerate(methods().splitlines())))


def test_the_methods_cite_what_sulci_and_atlases_are_from(recorded):
    atlases = {"crl": "G. et al.: Curves", "own": "Own curves"}
    surface = {"edge_length_mm": 1, "open_sulci": True}
    text = methods(atlases=atlases, surface=surface)
    recorded(dict(enumerate(text.splitlines())))
    assert caption_html(text).count("<li><p>") == 5
