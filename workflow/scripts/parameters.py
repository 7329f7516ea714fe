"""The validated parameters of a run, which its folding reads and which stay with its results."""

from gyriflow.growth.following import THICKNESS, followed_sizes
from gyriflow.growth.rates import FOLDING_RATES, rate_curve
from gyriflow.growth.regional import map_names, target_map
from gyriflow.io.files import read_json, read_table
from gyriflow.io.registrations import read_targets
from gyriflow.io.yaml_files import write_yaml
from gyriflow.step import step

files, weeks, settings = snakemake.input, snakemake.params.weeks, dict(snakemake.params.settings)
regional_weeks = snakemake.params.regional_weeks
with step(snakemake.log[0]):
    for name, column in FOLDING_RATES.items():
        if settings[name] == "estimated":
            allowed = settings["allow_negative_growth"]
            rates = read_table(files.rates)
            rates = rates[rates["series"] == snakemake.params.estimated_from]
            curve = rate_curve(rates, column, allow_negative=allowed)
            settings[name] = {"weeks": dict(zip(*(numbers.tolist() for numbers in curve), strict=True))}
    if files.targets:
        targets = read_targets(files.targets)
        at, follow = targets.weeks.tolist(), settings["follow"]
        for name, sizes in targets.sizes.items():
            if follow[name] == "measured":
                follow[name] = dict(zip(at, sizes.tolist(), strict=True))
        if follow["loop"] == "closed":
            settings["targets"] = {week: target_map(week) for week in at[1:]}
        elif follow["regional"] or follow["directional"]:
            regional_weeks = at
    if settings["follow"] is not None:
        curves = read_table(files.curves) if files.curves else None
        shrink = settings["allow_negative_growth"] or bool(files.targets)
        sizes = followed_sizes(settings["follow"], curves, snakemake.params.estimated_from, weeks, shrink)
        settings["follow"] = settings["follow"] | sizes
        if THICKNESS in sizes:
            settings["thickness_mm"] = {"weeks": sizes[THICKNESS]}
        if regional_weeks:
            settings |= map_names(regional_weeks, settings["follow"], snakemake.params.unmatched)
    surface = read_json(files.surface)
    start = {"start_week": weeks[0], "output_weeks": list(weeks), "fissure_x_mm": surface["fissure_x_mm"]}
    start["side"] = surface.get("side")
    write_yaml(snakemake.output[0], start | settings)
