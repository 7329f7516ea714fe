"""Scripts of the report on two brains and two runs: the numbers of each stand under its
own name."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image
from scripts import run_script
from shapes import sphere
from text_tables import frame

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
    WARNING,
    seen,
)

COLOURS = {"young": (200, 30, 30), "old": (30, 30, 200), "overview": (30, 160, 30)}
NAMES = ("young", "old")
FOLDED = [("thin", "young"), ("thick", "old")]
GROWTH = ["own", "population P"]
FIGURE = {"name": "picture", "section": "Surfaces", "technical": False, "first": False}
PARAMETERS = [
    {"thickness_mm": 1.5, "growth": {"model": "rates"}},
    {"thickness_mm": 2.5, "growth": {"model": "rates"}},
]
ZONES = """
order: 1
clamped_share: 0.1
initial_penetration_mm: 0.2
elements_through_cortex: 2.5
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A working directory with what the pages are made of, and results of two brains
    and runs."""
    monkeypatch.chdir(tmp_path)
    for name, colour in COLOURS.items():
        Image.new("RGB", (40, 30), colour).save(f"{name}.png", dpi=(20, 20))
    later = {"run": "thick", "start": "old", "start_week": 23.0}
    metrics = METRICS.assign(subject="old", week=23.0, value=[71.3, 120.0, 60.0, 0.1])
    runs = RUNS.assign(subject="old", end_week=25.0, **later)
    validation = VALIDATION.assign(week=[24.0, 25.0], distance_mm=[0.2, 0.9], **later)
    warnings = frame("subject message\nyoung M1\nold M2", run="", **WARNING)
    tables = MEASURES | {
        "metrics": pd.concat([METRICS, metrics]),
        "warnings": warnings,
        "runs": pd.concat([RUNS, runs]),
        "validation": pd.concat([VALIDATION, validation]),
    }
    for name, table in tables.items():
        write_table(f"{name}.csv", table)
    files = [
        {"brain": name, "what": "labels", "sha256": f"hash of {name}"} for name in NAMES
    ]
    write_json("provenance.json", PROVENANCE | {"files": files})
    write_text("methods.rst", "Two were *processed*.\n")
    for number, (run, brain) in enumerate(FOLDED):
        write_run(f"results/runs/{run}/{brain}", number, run)
        write_text(f"{brain}.nii.gz", f"voxels of {brain}")
        write_text(f"results/brains/{brain}/mesh/brain.h5", f"mesh of {brain}")
    return tmp_path


def write_run(at, number, run):
    """Write the results of a run into a folder."""
    write_text(f"{at}/folding/maps.h5", f"maps of {run}")
    write_yaml(f"{at}/params.yaml", PARAMETERS[number])
    write_json(f"{at}/folding/summary.json", {"steps": 7 + number})
    write_json(f"{at}/folding/zones.json", yaml.safe_load(ZONES))
    steps = f"week,elements_through_cortex\n22.0,{2.5 - number}\n"
    write_text(f"{at}/folding/steps.csv", steps)
    tet = np.vstack([np.zeros(3), np.eye(3)])
    frames = [f"{at}/{week}.h5" for week in (22.0, 23.0)]
    for week, file, moved in ((22.0, frames[0], 0), (23.0, frames[1], 1 + number)):
        write_frame(file, week, {"positions": tet + [moved, 0.0, 0.0]})
    join_frames(f"{at}/folding/frames.h5", np.array([[0, 1, 2, 3]]), frames)
    log = Path(at, "logs", "simulate.log")
    log.parent.mkdir()
    write_message(log, Message("warning", f"of-{run}"))
    record_usage(log, Usage(3600 + 3600 * number, 7200, 100))


def of_runs(name):
    return [f"results/runs/{run}/{brain}/{name}" for run, brain in FOLDED]


# pages


def pictured(text):
    """Return the names of the pictures that a page shows."""
    found = []
    for name in COLOURS:
        ((address, _),) = picture_addresses([f"{name}.png"], 1e6)
        found += [name] * text.count(address)
    return found


@pytest.mark.parametrize("has_runs", [True, False])
def test_the_report_and_its_pages_have_what_is_known_of_each_brain_and_run(
    folder, recorded, has_runs
):
    """Without runs, captions do not speak of simulated brains."""
    tables = ["quality", "warnings", "metrics", "centiles", "curves", "differences"]
    inputs = {name: PAGE / file for name, file in PARTS.items()}
    inputs |= {"runs": [], "validation": [], "intervals": []}
    tables += ["runs", "validation"] if has_runs else []
    inputs |= {name: f"{name}.csv" for name in tables}
    inputs |= {
        "page": PAGE / "page.html",
        "provenance": "provenance.json",
        "methods": "methods.rst",
        "captions": ["picture.rst"],
        "small": [f"{name}.png" for name in NAMES],
    }
    caption = "a picture\n\nSimulated brains: lines\nof runs\n\nthe end\n"
    write_text(folder / "picture.rst", f"Seen\n====\n{caption}")
    figures = {
        name: [FIGURE | {"names": {}, "path": str(folder / f"{name}.png")}]
        for name in COLOURS
    }
    ball = sphere(10.0, 1)
    write_surface("ball.surf.gii", ball)
    write_vertex_maps("ball.shape.gii", {"shape_index": ball.vertices[:, 2] / 10})
    frames = [[week, [["ball.surf.gii", "ball.shape.gii"]]] for week in (21.0, 22.0)]
    params = {
        "config": {"labels": "/data/Jane Roe/young.nii.gz"},
        "norm": "N",
        "brains": BRAINS,
        "prediction": None,
        "figures": figures["overview"],
        "brain_figures": {name: figures[name] for name in NAMES},
        "surfaces": {"runs": {"thin": frames}, "observed": frames[:1]},
        "observed_name": "healthy",
    }
    brains = [f"{name}.html" for name in NAMES]
    outputs = {"report": "report.html", "brains": brains, "view": "surfaces.json"}
    run_script("html_report.py", folder, inputs, outputs, params)
    pages = {}
    for path in ("report.html", *(brains if has_runs else [])):
        text = read_text(path)
        pages[path] = {"pictures": pictured(text), "words": seen(text)}
    recorded(pages)
    assert "Jane Roe" not in read_text("report.html")
    view = read_json("surfaces.json")["groups"]
    weeks = [[frame["week"] for frame in group["frames"]] for group in view]
    assert weeks == [[21, 22], [21]]


# records


def test_records_have_the_inputs_settings_results_and_times_of_each_brain_and_run(
    folder,
):
    brains = [
        {"id": brain, "labels": str(folder / f"{brain}.nii.gz")} for brain in NAMES
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
        "template": "template.rst",
        "run_params": of_runs("params.yaml"),
        "summaries": of_runs("folding/summary.json"),
        "atlases": "atlases.yaml",
        "differences": "differences.csv",
    }
    outputs = {
        "study": "results/study/provenance.json",
        "report": "results/report/provenance.json",
        "brains": [f"results/brains/{brain}/provenance.json" for brain in NAMES],
        "runs": of_runs("provenance.json"),
        "methods": "methods.rst",
        "config": "config.yaml",
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
        "files": [(brain["id"], "labels", brain["labels"]) for brain in brains],
        "known_brains": NAMES,
        "simulated": FOLDED,
    }
    run_script("study_records.py", folder, inputs, outputs, params)
    hours = read_table(outputs["resources"]).set_index("run")["hours"]
    assert hours[["thin", "thick"]].tolist() == [1, 2]
    warned = read_table("told.csv").set_index("run")[["subject", "message"]]
    assert warned.loc["thin"].tolist() == ["young", "of-thin"]
    assert warned.loc["thick"].tolist() == ["old", "of-thick"]
    methods = "thin young: own, 7; thick old: population P, 8; CRL: G. et al."
    assert read_text("methods.rst") == methods
    study = read_json(outputs["study"])
    assert outputs["resources"] in "".join(study["results"])
    for brain, path, (run, name), parameters in zip(
        brains, outputs["runs"], FOLDED, PARAMETERS, strict=True
    ):
        alone = read_json(f"results/brains/{name}/provenance.json")
        folded = read_json(path)
        mesh = f"results/brains/{name}/mesh/brain.h5"
        maps = str(folder / f"results/runs/{run}/{name}/folding/maps.h5")
        assert hashes(alone) == {brain["labels"]: sha256_of(brain["labels"])}
        further = {file: sha256_of(file) for file in (mesh, maps)}
        assert hashes(folded) == hashes(alone) | further
        assert study["inputs"][name] == alone["inputs"]
        assert alone["configuration"] == brain
        assert mesh in "".join(alone["results"])
        configured = {"run": run, "start": name, "parameters": parameters}
        assert folded["configuration"] == configured


def hashes(record):
    return {path: file["sha256"] for path, file in record["inputs"].items()}


@pytest.mark.usefixtures("recorded_outputs")
def test_tables_tell_runs_apart(folder):
    inputs = {
        "params": of_runs("params.yaml"),
        "steps": of_runs("folding/steps.csv"),
        "summaries": of_runs("folding/summary.json"),
        "zones": of_runs("folding/zones.json"),
        "frames": of_runs("folding/frames.h5"),
    }
    outputs = {"csv": "runs.csv", "table": "runs.html"}
    outputs["displacement"] = "displacement.csv"
    params = {"folded": FOLDED, "growth_of": GROWTH}
    run_script("run_tables.py", folder, inputs, outputs, params)
    # the tables themselves are recorded
    assert re.findall(r"(own|population P)</td>", read_text("runs.html")) == GROWTH
