"""Names that look like numbers, or like nothing, make the same tables as letters."""

import numpy as np
import pandas as pd
import pytest
from scripts import run_script

from gyriflow.io.files import read_table, write_table
from gyriflow.metrics.spangy import PART_POWERS
from gyriflow.shipped import SHIPPED

TABLES = (
    "metrics",
    "spectra",
    "regions",
    "metrics_long",
    "metrics_wide",
    "change",
    "asymmetry",
    "norm_curves",
    "centiles",
    "spectral_distance",
)
ODD = ("1e5", "NA", "None", "true", "1.0", "2024-01-01")
COHORTS = {
    "numbers": [f"{number:03d}" for number in range(12)],
    "odd": [*ODD, *(f"{number}e2" for number in range(6))],
}
KEYS = (
    "subject",
    "run",
    "week",
    "observed",
    "hemisphere",
    "region",
    "metric",
    "proxy",
    "to_week",
)
LETTERS = [f"brain{letter}" for letter in "abcdefghijkl"]


def write_tables(folder, ids, run, regions):
    """Write metrics, spectra and regions of twelve observed brains of as many weeks,
    and of a run of the first."""
    random, rows, by_region, spectra = np.random.default_rng(1), [], [], []
    places = [(name, "observed", 22.0 + number) for number, name in enumerate(ids)] + [
        (ids[0], run, 23.0)
    ]
    for name, what, week in places:
        for hemisphere in ("whole", "left", "right"):
            brain = {
                "subject": name,
                "run": what,
                "week": week,
                "hemisphere": hemisphere,
            }
            rows.append(
                brain
                | {
                    "metric": "area",
                    "value": 9 * week + random.normal(),
                    "unit": "cm2",
                }
            )
            if hemisphere != "whole":
                for band in range(1, 7):
                    wave = {
                        "proxy": "mean_curvature",
                        "band": band,
                        "wavelength_max_mm": 256.0 / 2**band,
                    }
                    wave |= {
                        "wavelength_min_mm": 128.0 / 2**band,
                        "modes": 9,
                        "is_open": False,
                    }
                    power = {
                        name: random.uniform()
                        for name in ("power", "relative_power", *PART_POWERS)
                    }
                    known = dict.fromkeys(
                        ("complete", "denominator_complete", "resolved"), True
                    )
                    spectra.append(brain | wave | power | known)
                by_region += [
                    brain
                    | {
                        "region": region,
                        "metric": "area",
                        "value": random.uniform(3, 9),
                        "unit": "cm2",
                    }
                    for region in regions
                ]
    for table, content in (
        ("metrics", rows),
        ("spectra", spectra),
        ("regions", by_region),
    ):
        write_table(folder / f"{table}.csv", pd.DataFrame(content))


def tables_of(folder, ids, run, regions, people):
    folder.mkdir()
    write_tables(folder, ids, run, regions)
    files = {name: [f"{name}.csv"] for name in ("metrics", "spectra", "regions")}
    params = {
        "labelled": [],
        "scans": {people[0]: list(ids[:3])},
        "covariates": {
            name: {"site": f"{number:02d}"} for number, name in enumerate(ids)
        },
        "reference": list(ids),
        "individuals": True,
        "subjects": dict(zip(ids, people, strict=True)),
        "made_with": {},
        "population": [None],
    }
    outputs = {name: f"out/{name}.csv" for name in TABLES} | {"norms": "out/norms.json"}
    files |= {
        "cohort": [],
        "labelled": [],
        "norms": "norms.yaml",
        "noise": SHIPPED / "norms/repeatability.yaml",
        "atlases": SHIPPED / "norms/atlases.yaml",
    }
    run_script("metrics_tables.py", folder, files, outputs, params)
    return {name: (folder / f"out/{name}.csv").read_text() for name in TABLES}


@pytest.mark.parametrize("ids", COHORTS.values(), ids=COHORTS)
def test_a_cohort_with_names_like_numbers_has_the_tables_of_one_with_letters(
    tmp_path, ids
):
    # two scans of the first subject
    odd = tables_of(tmp_path / "odd", ids, "1", ("NA", "7"), [ids[0], *ids[:11]])
    plain = tables_of(
        tmp_path / "plain",
        LETTERS,
        "runs",
        ("front", "back"),
        [LETTERS[0], *LETTERS[:11]],
    )
    names = dict(zip(ids, LETTERS, strict=True)) | {"1": "runs"}
    for name in TABLES:
        found = read_table(tmp_path / f"odd/out/{name}.csv")
        expected = read_table(tmp_path / f"plain/out/{name}.csv")
        assert len(found) == len(expected) > 0, name
        regions = {"NA": "front", "7": "back"}
        for column in (
            "subject",
            "run",
            "observed",
            "from_brain",
            "to_brain",
            "region",
        ):
            if column in found:
                table = regions if column == "region" else names
                found[column] = found[column].map(
                    lambda text, table=table: table.get(text, text)
                )
        found.columns = [
            column.replace("_NA_", "_front_").replace("_7_", "_back_")
            for column in found
        ]
        keys = [column for column in expected if column in KEYS]
        found, expected = (
            table.sort_values(keys, kind="stable").reset_index(drop=True)
            for table in (found, expected)
        )
        pd.testing.assert_frame_equal(found, expected)
    assert len(plain["centiles"].splitlines()) > 12
    sites = [line.split(",")[3] for line in odd["metrics_wide"].splitlines()]
    assert sites[:3] == ["site", "00", "01"]
    # a region called NA is not the whole hemisphere
    regions = read_table(tmp_path / "odd/out/asymmetry.csv")["region"]
    assert set(regions.dropna()) == {"NA", "7"}
