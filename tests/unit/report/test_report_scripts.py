"""Scripts of the report on two brains and two runs: the numbers of each stand under its
own name."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from scripts import run_script
from shapes import sphere

from gyriflow.io.downloads import sha256_of
from gyriflow.io.figures import picture_addresses
from gyriflow.io.files import (
    read_json,
    read_table,
    read_text,
    write_json,
    write_table,
    write_text,
)
from gyriflow.io.frames import join_frames, write_frame
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.io.yaml_files import write_yaml
from gyriflow.messages import Message, write_message
from gyriflow.step import Usage, record_usage

from .test_page import (
    BRAINS,
    FROM_ATLAS,
    MEASURES,
    METRICS,
    PAGE,
    PARTS,
    PROVENANCE,
    RUNS,
    VALIDATION,
)

COLOURS = {"young": (200, 30, 30), "old": (30, 30, 200), "overview": (30, 160, 30)}
NAMES = ("young", "old")
FOLDED = [("thin", "young"), ("thick", "old")]
GROWTH = ["own", "population P"]
FIGURE = {
    "section": "Surfaces",
    "technical": False,
    "first": False,
    "names": {},
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working directory with what the pages are made of, and results of two brains
    and runs."""
    monkeypatch.chdir(tmp_path)
    for name, colour in COLOURS.items():
        Image.new("RGB", (40, 30), colour).save(f"{name}.png", dpi=(20, 20))
    later = {"run": "thick", "start": "old", "start_week": 23.0}
    warnings = {
        "subject": ["young", "old"],
        "run": "",
        "step": "s",
        "level": "warning",
        "message": ["M1", "M2"],
    }
    tables = MEASURES | {
        "metrics": pd.concat(
            [
                METRICS,
                METRICS.assign(subject="old", week=23.0, value=[71.3, 120.0, 60.0]),
            ]
        ),
        "warnings": pd.DataFrame(warnings),
        "runs": pd.concat([RUNS, RUNS.assign(subject="old", end_week=25.0, **later)]),
        "validation": pd.concat(
            [
                VALIDATION,
                VALIDATION.assign(week=[24.0, 25.0], distance_mm=[0.2, 0.9], **later),
            ]
        ),
    }
    for name, table in tables.items():
        write_table(f"{name}.csv", table)
    files = [
        {"brain": name, "what": "labels", "sha256": f"hash of {name}"}
        for name in ("young", "old")
    ]
    write_json("provenance.json", PROVENANCE | {"files": files})
    write_text("methods.rst", "Two were *processed*.\n")
    for number, (run, brain) in enumerate(FOLDED):
        at = f"results/runs/{run}/{brain}"
        write_text(f"{brain}.nii.gz", f"voxels of {brain}")
        write_text(f"results/brains/{brain}/mesh/brain.h5", f"mesh of {brain}")
        write_text(f"{at}/folding/maps.h5", f"maps of {run}")
        write_yaml(
            f"{at}/params.yaml",
            {"thickness_mm": 1.5 + number, "growth": {"model": "rates"}},
        )
        write_json(f"{at}/folding/summary.json", {"steps": 7 + number})
        zones = {
            "order": 1,
            "clamped_share": 0.1,
            "initial_penetration_mm": 0.2,
            "elements_through_cortex": 2.5,
        }
        write_json(f"{at}/folding/zones.json", zones)
        write_text(
            f"{at}/folding/steps.csv",
            f"week,elements_through_cortex\n22.0,{2.5 - number}\n",
        )
        for week in (22.0, 23.0):
            moved = (1 + number) * (week - 22.0) * np.array([1.0, 0.0, 0.0])
            write_frame(
                f"{at}/{week}.h5",
                week,
                {"positions": np.vstack([np.zeros(3), np.eye(3)]) + moved},
            )
        frames = [f"{at}/{week}.h5" for week in (22.0, 23.0)]
        join_frames(f"{at}/folding/frames.h5", np.array([[0, 1, 2, 3]]), frames)
        log = Path(at, "logs", "simulate.log")
        log.parent.mkdir()
        write_message(log, Message("warning", f"of {run}"))
        record_usage(log, Usage(3600 + 3600 * number, 7200, 100))
    return tmp_path


def of_runs(name):
    return [f"results/runs/{run}/{brain}/{name}" for run, brain in FOLDED]


def row_with(text, words):
    """Return the one row of a table that has some words."""
    (row,) = [
        row for row in re.findall(r"<tr>.*?</tr>", text, re.DOTALL) if words in row
    ]
    return row


def pictured(text):
    """Return the names of the pictures that a page shows."""
    return [
        name
        for name in COLOURS
        if picture_addresses([f"{name}.png"], 1e6)[0][0] in text
    ]


def pages(folder, **others):
    """Return the report and the pages of both brains, with some other inputs."""
    tables = ("quality", "warnings", "metrics", "centiles", "runs", "validation")
    tables = (*tables, "curves", "differences")
    inputs = {name: f"{name}.csv" for name in tables} | {
        name: PAGE / file for name, file in PARTS.items()
    }
    inputs |= {
        "page": PAGE / "page.html",
        "intervals": [],
        "provenance": "provenance.json",
        "methods": "methods.rst",
        "captions": ["picture.rst"],
    }
    caption = "a picture\n\nSimulated brains: lines\nof runs\n\nthe end\n"
    write_text(folder / "picture.rst", f"Seen\n====\n{caption}")
    pictures = {
        name: FIGURE | {"name": "picture", "path": str(folder / f"{name}.png")}
        for name in COLOURS
    }
    params = {
        "config": {"labels": "/data/Jane Roe/young.nii.gz"},
        "norm": "N",
        "brains": BRAINS,
        "prediction": None,
    }
    params |= {
        "figures": [pictures["overview"]],
        "brain_figures": {name: [pictures[name]] for name in NAMES},
    }
    ball = sphere(10.0, 2)
    write_surface("ball.surf.gii", ball)
    write_vertex_maps("ball.shape.gii", {"shape_index": ball.vertices[:, 2] / 10})
    frames = [[week, [["ball.surf.gii", "ball.shape.gii"]]] for week in (21.0, 22.0)]
    params |= {
        "surfaces": {"runs": {"thin": frames}, "observed": frames[:1]},
        "observed_name": "healthy",
    }
    outputs = {
        "report": "report.html",
        "brains": [f"{name}.html" for name in NAMES],
        "view": "surfaces.json",
    }
    run_script(
        "html_report.py",
        folder,
        inputs | {"small": [f"{name}.png" for name in NAMES]} | others,
        outputs,
        params,
    )
    return [read_text(path) for path in ("report.html", "young.html", "old.html")]


def test_the_report_has_pictures_numbers_and_scores_of_each_brain_and_run(folder):
    text, *_ = pages(folder)
    view = read_json("surfaces.json")["groups"]
    groups = [
        (group["name"], [frame["week"] for frame in group["frames"]]) for group in view
    ]
    assert groups == [("thin", [21, 22]), ("healthy", [21])]
    assert read_text("surfaces.json").count("shape_index") >= 3
    assert '<section id="surfaces-in-3d">' in text
    rows = [row_with(text, f'href="brains/{name}.html"') for name in ("young", "old")]
    assert [pictured(row) for row in rows] == [["young"], ["old"]]
    assert [("46.2" in row, "refused" in row, "CC0 1.0" in row) for row in rows] == [
        (1, 0, 1),
        (0, 1, 0),
    ]
    for name in ("young", "old"):
        assert name in row_with(text, f"hash of {name}")
    assert (
        "0.42" in row_with(text, ">thin<"),
        "0.90" in row_with(text, ">thick<"),
    ) == (True, True)
    assert (
        "overview" in pictured(text),
        "<em>processed</em>" in text,
        "Jane Roe" in text,
    ) == (True, True, False)


def test_captions_speak_of_simulated_brains_only_if_there_are_some(folder):
    captions = []
    for others in ({}, {"runs": [], "validation": []}):
        text, *_ = pages(folder, **others)
        captions.append(
            [
                words
                for words in ("a picture", "Simulated brains: lines", "the end")
                if words in text
            ]
        )
    assert captions == [
        ["a picture", "Simulated brains: lines", "the end"],
        ["a picture", "the end"],
    ]


def test_the_page_of_a_brain_is_of_that_brain_alone(folder):
    words = (
        "young</h1>",
        "old</h1>",
        "46.2",
        "71.3",
        "M1",
        "M2",
        "hash of young",
        "hash of old",
    )
    said = [
        (pictured(text), [found for found in words if found in text])
        for text in pages(folder)[1:]
    ]
    assert said == [
        (["young"], ["young</h1>", "46.2", "M1", "hash of young"]),
        (["old"], ["old</h1>", "71.3", "M2", "hash of old"]),
    ]


def test_records_have_the_inputs_settings_results_and_times_of_each_brain_and_run(
    folder,
):
    brains = [
        {"id": brain, "labels": str(folder / f"{brain}.nii.gz")} for _, brain in FOLDED
    ]
    shown = (
        "{{ run.run }} {{ run.start }}: {{ run.growth_of }}, {{ run.summary.steps }}; "
    )
    cited = "{{ atlas_label('crl') }}: {{ atlases.crl }}"
    write_text("template.rst", f"{{% for run in runs %}}{shown}{{% endfor %}}{cited}")
    references = {"crl": {"reference": "G. et al."}, "chinese": {"reference": "W."}}
    write_yaml("atlases.yaml", {"atlases": references})
    write_table("differences.csv", FROM_ATLAS)
    inputs = {
        "run_params": of_runs("params.yaml"),
        "summaries": of_runs("folding/summary.json"),
        "atlases": "atlases.yaml",
        "differences": "differences.csv",
    }
    outputs = {name: f"results/{name}/provenance.json" for name in ("study", "report")}
    outputs |= {
        "brains": [f"results/brains/{brain}/provenance.json" for _, brain in FOLDED]
    }
    outputs |= {
        "runs": of_runs("provenance.json"),
        "methods": "methods.rst",
        "config": "config.yaml",
    }
    outputs |= {
        "resources": "results/study/resources.csv",
        "resources_page": "resources.html",
        "warnings": "told.csv",
    }
    params = {
        "brains": brains,
        "folded": FOLDED,
        "growth_of": GROWTH,
        "config": {},
        "method": {},
    }
    params["files"] = [(brain["id"], "labels", brain["labels"]) for brain in brains]
    params["known_brains"] = ["young", "old"]
    params["simulated"] = FOLDED
    run_script(
        "study_records.py",
        folder,
        inputs | {"template": "template.rst"},
        outputs,
        params,
    )
    assert read_table(outputs["resources"]).set_index("run")["hours"][
        ["thin", "thick"]
    ].tolist() == [1, 2]
    assert outputs["resources"] in "".join(read_json(outputs["study"])["results"])
    warned = read_table("told.csv")[["run", "subject", "message"]].to_numpy().tolist()
    assert sorted(warned) == [
        ["thick", "old", "of thick"],
        ["thin", "young", "of thin"],
    ]
    assert (
        read_text("methods.rst")
        == "thin young: own, 7; thick old: population P, 8; CRL: G. et al."
    )
    for brain, run, (name, start), thickness in zip(
        brains, outputs["runs"], FOLDED, (1.5, 2.5), strict=True
    ):
        alone = read_json(f"results/brains/{start}/provenance.json")
        folded = read_json(run)
        found = [
            {path: file["sha256"] for path, file in record["inputs"].items()}
            for record in (alone, folded)
        ]
        others = (
            f"results/brains/{start}/mesh/brain.h5",
            str(folder / f"results/runs/{name}/{start}/folding/maps.h5"),
        )
        assert found[0] == {brain["labels"]: sha256_of(brain["labels"])}
        assert found[1] == found[0] | {path: sha256_of(path) for path in others}
        assert read_json(outputs["study"])["inputs"][start] == alone["inputs"]
        assert (alone["configuration"], others[0] in "".join(alone["results"])) == (
            brain,
            True,
        )
        parameters = {"thickness_mm": thickness, "growth": {"model": "rates"}}
        assert folded["configuration"] == {
            "run": name,
            "start": start,
            "parameters": parameters,
        }


@pytest.mark.usefixtures("recorded_outputs")
def test_tables_tell_runs_apart(folder):
    files = {"params": "params.yaml", "steps": "folding/steps.csv"}
    files |= {
        "summaries": "folding/summary.json",
        "zones": "folding/zones.json",
        "frames": "folding/frames.h5",
    }
    inputs = {kind: of_runs(file) for kind, file in files.items()}
    outputs = {
        "csv": "runs.csv",
        "table": "runs.html",
        "displacement": "displacement.csv",
    }
    run_script(
        "run_tables.py",
        folder,
        inputs,
        outputs,
        {"folded": FOLDED, "growth_of": GROWTH},
    )
    columns = [
        "run",
        "subject",
        "growth_of",
        "thickness_mm",
        "least_elements_through_cortex",
        "steps",
    ]
    assert read_table("runs.csv")[columns].to_numpy().tolist() == [
        ["thin", "young", "own", 1.5, 2.5, 7],
        ["thick", "old", "population P", 2.5, 1.5, 8],
    ]
    assert re.findall(r"(own|population P)</td>", read_text("runs.html")) == GROWTH
    moved = read_table("displacement.csv")
    assert moved[
        ["subject", "run", "mean_mm"]
    ].drop_duplicates().to_numpy().tolist() == [
        ["young", "thin", 1.0],
        ["old", "thick", 2.0],
    ]
