"""Write parameters, zones and summaries of all runs, also as a table of the report, and
their displacements."""

import pandas as pd

from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.io.figures import write_html
from gyriflow.io.files import read_json, read_table, write_table
from gyriflow.io.frames import read_positions, read_tets, read_weeks
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.tables import weekly_norms
from gyriflow.report.tables import (
    COMMON_PARAMETERS,
    html_table,
    resolution_over_steps,
    runs_table,
)
from gyriflow.settings.growth import GROWTH_MODELS
from gyriflow.settings.terms import run_names
from gyriflow.step import step

BEFORE_THE_SOLVE = (
    "clamped_share",
    "initial_penetration_mm",
    "elements_through_cortex",
)

files, output, folded = snakemake.input, snakemake.output, snakemake.params.folded
with step(snakemake.log[0]):
    rows, runs, displacements = [], {}, []
    names = run_names(folded)
    for number, (run, brain) in enumerate(folded):
        report = read_json(files.zones[number])
        before = {name: report[name] for name in BEFORE_THE_SOLVE}
        settings = read_yaml(files.params[number])
        has_layers = GROWTH_MODELS[settings["growth"]["model"]].has_layers
        steps = read_table(files.steps[number])
        resolved = resolution_over_steps(report["order"], steps, has_layers=has_layers)
        found = {
            **read_json(files.summaries[number]),
            **before,
            **resolved,
        }
        settings["growth_of"] = snakemake.params.growth_of[number]
        rows.append(
            {
                "run": run,
                "subject": brain,
                **settings,
                **found,
            }
        )
        # targets are in files
        settings.pop("targets", None)
        common = {key: found[key] for key in found if key in COMMON_PARAMETERS}
        runs[names[number]] = settings | common
        frames = files.frames[number]
        weeks = read_weeks(frames)
        positions = [read_positions(frames, week) for week in weeks]
        _, pial = boundary_surface(
            TetrahedralMesh(
                positions[0],
                read_tets(frames),
            )
        )
        moved = weekly_norms(weeks, positions, pial)
        displacements.append(
            moved.assign(subject=brain, run=run)[["subject", "run", *moved.columns]]
        )
    write_table(output.csv, pd.json_normalize(rows))
    write_html(output.table, html_table(runs_table(runs)))
    write_table(output.displacement, pd.concat(displacements, ignore_index=True))
