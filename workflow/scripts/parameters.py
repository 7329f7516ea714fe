"""The validated parameters of a run, which its folding reads and which stay with its results."""

from gyriflow.growth.following import THICKNESS, followed_sizes
from gyriflow.growth.rates import FOLDING_RATES, rate_curve
from gyriflow.growth.regional import CORTEX, STRAIN, known_weeks, regional_map
from gyriflow.io.files import read_json, read_table
from gyriflow.io.yaml_files import write_yaml
from gyriflow.step import step

files, weeks, settings = snakemake.input, snakemake.params.weeks, dict(snakemake.params.settings)
with step(snakemake.log[0]):
    for name, column in FOLDING_RATES.items():
        if settings[name] == "estimated":
            allowed = settings["allow_negative_growth"]
            rates = read_table(files.rates)
            rates = rates[rates["series"] == snakemake.params.estimated_from]
            curve = rate_curve(rates, column, allow_negative=allowed)
            settings[name] = {"weeks": dict(zip(*(numbers.tolist() for numbers in curve), strict=True))}
    if settings["follow"] is not None:
        curves = read_table(files.curves) if files.curves else None
        shrink = settings["allow_negative_growth"]
        sizes = followed_sizes(settings["follow"], curves, snakemake.params.estimated_from, weeks, shrink)
        settings["follow"] = settings["follow"] | sizes
        if THICKNESS in sizes:
            settings["thickness_mm"] = {"weeks": sizes[THICKNESS]}
        if snakemake.params.regional_weeks:
            until = settings["follow"]["known_until_gw"]
            known = known_weeks(snakemake.params.regional_weeks, until, snakemake.params.unmatched)
            settings["regional_growth"] = {week: regional_map(week) for week in known}
            if settings["follow"]["directional"] > 0:
                settings["regional_strain"] = {week: regional_map(week, STRAIN) for week in known}
            if settings["follow"]["cortex"] == "area":
                settings["regional_growth_of_cortex"] = {week: regional_map(week, CORTEX) for week in known}
    surface = read_json(files.surface)
    start = {"start_week": weeks[0], "output_weeks": list(weeks), "fissure_x_mm": surface["fissure_x_mm"]}
    start["side"] = surface.get("side")
    write_yaml(snakemake.output[0], start | settings)
