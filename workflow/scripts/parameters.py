"""The validated parameters of a run, which its folding reads and which stay with its results."""

from gyriflow.growth.following import THICKNESS, followed_sizes
from gyriflow.io.files import read_json, read_table
from gyriflow.io.registrations import read_weekly_shapes
from gyriflow.io.yaml_files import write_yaml
from gyriflow.settings.folding import target_map
from gyriflow.step import step

files, weeks, settings = snakemake.input, snakemake.params.weeks, dict(snakemake.params.settings)
growth = dict(settings["growth"])
with step(snakemake.log[0]):
    if files.targets:
        targets = read_weekly_shapes(files.targets)
        at = targets.weeks.tolist()
        growth |= {name: dict(zip(at, sizes.tolist(), strict=True)) for name, sizes in targets.sizes.items()}
        settings["targets"] = {week: target_map(week) for week in at[1:]}
    curves = read_table(files.curves) if files.curves else None
    sizes = followed_sizes(growth, curves, snakemake.params.series, weeks, shrink=bool(files.targets))
    settings["growth"] = growth | sizes
    if THICKNESS in sizes:
        settings["thickness_mm"] = {"weeks": sizes[THICKNESS]}
    surface = read_json(files.surface)
    start = {"start_week": weeks[0], "output_weeks": list(weeks), "fissure_x_mm": surface["fissure_x_mm"]}
    start["side"] = surface.get("side")
    write_yaml(snakemake.output[0], start | settings)
