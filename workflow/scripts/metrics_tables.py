"""Join the metrics of all brains into tables, and write change, asymmetry, norms and
distances between spectra."""

import logging

import pandas as pd

from gyriflow.io.files import read_json, read_tables, write_json, write_table
from gyriflow.io.yaml_files import read_yaml
from gyriflow.metrics.atlas_curves import atlas_curves, atlas_differences
from gyriflow.metrics.norms import (
    LabelledBrain,
    cohort_from_plain,
    cohort_norms,
    measured_scores,
    norm_curves,
    outlying_brains,
    published_norms,
    volume_tables,
)
from gyriflow.metrics.repeatability import with_change_noise, with_distance_noise
from gyriflow.metrics.spangy import spectral_distances
from gyriflow.metrics.tables import (
    asymmetry,
    change_between_scans,
    long_table,
    wide_table,
)
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    tables = {
        name: read_tables(files[name])
        for name in ("metrics", "spectra", "regions")
        if files[name]
    }
    metrics, regions = tables["metrics"], [tables["regions"]] if files.regions else []
    people = metrics.assign(person=metrics["subject"].map(params.subjects))
    reference = [] if files.cohort else params.reference
    population, noise = params.population, read_yaml(files.noise)
    if files.cohort:
        content = read_json(files.cohort[0])
        cohort, population = cohort_from_plain(content), content.get("population")
    else:
        cohort = cohort_norms(
            people,
            reference,
            individuals=params.individuals,
            made_with=params.made_with,
        )
    for brain, names in outlying_brains(people, reference, cohort).items():
        logging.warning(
            "%s is far from the norm of the other reference brains: %s. Look at it:"
            " with a brain that is badly segmented or not normal, norms are too wide",
            brain,
            ", ".join(names),
        )
    parts = [
        asymmetry(table.fillna({"region": ""}))
        for table in (metrics.assign(region=""), *regions)
    ]
    curves = atlas_curves(read_yaml(files.atlases), params.made_with)
    tables |= {
        "atlas_curves": curves,
        "atlas_differences": atlas_differences(metrics, curves, noise),
        "metrics_long": (long := long_table([metrics, *regions])),
        "metrics_wide": wide_table(long, params.covariates),
        "change": with_change_noise(change_between_scans(long, params.scans), noise),
        "asymmetry": pd.concat(parts, ignore_index=True),
        "norm_curves": norm_curves(cohort),
        "centiles": measured_scores(people, reference, cohort),
        "spectral_distance": with_distance_noise(
            spectral_distances(tables["spectra"]), noise, "metric"
        ),
    }
    if files.labelled:
        reports = [read_json(path)["volumes_by_number_mL"] for path in files.labelled]
        volumes = [
            {int(label): ml for label, ml in report.items()} for report in reports
        ]
        brains = [
            LabelledBrain(*brain, by_label)
            for brain, by_label in zip(params.labelled, volumes, strict=True)
        ]
        norms = published_norms(read_yaml(files.norms))
        tables["volumes"], tables["published_centiles"] = volume_tables(brains, norms)
    write_json(
        snakemake.output.norms,
        {"population": population, **cohort.plain},
    )
    for name, path in snakemake.output.items():
        if name in tables:
            write_table(path, tables[name])
