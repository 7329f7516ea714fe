"""Which run of a study is nearest, by each measure, and what is said of it."""

import pandas as pd
import pytest

from gyriflow.compare.members import distances_to, member_row, nearest
from gyriflow.compare.published import with_published_nearest


def spectra(run, subject, powers):
    rows = [
        {"subject": subject, "run": run, "hemisphere": "left", "band": band, "relative_power": power,
         "relative_power_weyl": float("nan") if band == 6 else 2 * power, "complete": True, "resolved": band < 6}
        for band, power in zip((4, 5, 6), powers, strict=True)
    ]  # fmt: skip
    return pd.DataFrame(rows)


METRICS = pd.DataFrame(
    [
        ("sim", "a", "whole", "area", 90.0, "cm2"),
        ("real", "b", "whole", "area", 100.0, "cm2"),
        ("sim", "a", "left", "weyl_number", 600.0, "1"),
        ("real", "b", "left", "weyl_number", 700.0, "1"),
    ],
    columns=["run", "subject", "hemisphere", "metric", "value", "unit"],
)
SPECTRAL = pd.DataFrame(
    {"real": ["b"], "hemisphere": "left", "metric": "spectral_distance_B4", "value": 0.2, "flag": "ok"}
)
SURFACES = {"whole": {"symmetric_mean": 1.5}}


def test_distances_are_those_of_bands_sizes_spectra_and_surfaces():
    both = pd.concat([spectra("sim", "a", (0.5, 0.2, 0.1)), spectra("real", "b", (0.4, 0.3, 0.1))])
    table = distances_to("b", METRICS, both, SPECTRAL, SURFACES).set_index(["hemisphere", "measure"])
    cut_off = table.loc[("left", "relative_power_B6_weyl")]
    assert (cut_off["flag"], cut_off["distance"] == cut_off["distance"]) == ("cut off", False)
    assert table["distance"].dropna().to_dict() == {
        ("left", "relative_power_B4"): pytest.approx(0.1),
        ("left", "relative_power_B5"): pytest.approx(0.1),
        ("left", "relative_power_B4_weyl"): pytest.approx(0.2),
        ("left", "relative_power_B5_weyl"): pytest.approx(0.2),
        ("left", "relative_power_B6"): pytest.approx(0.0),
        ("whole", "area"): pytest.approx(0.1),
        ("left", "spectral_distance_B4"): 0.2,
        ("whole", "surface_symmetric_mean"): 1.5,
    }
    assert table.loc[("left", "relative_power_B6"), "flag"] == "not resolved"
    assert table.loc[("left", "relative_power_B4"), "real_value"] == 0.4
    # where a spectrum is cut is told, and is no likeness
    assert tuple(table.loc[("left", "weyl_number"), ["value", "real_value"]]) == (600, 700)


def member(run, thickness, through=2.0, diverged=None):
    return member_row(
        {"study": "thickness", "run": run, "subject": "a", "compare_week": 28},
        {"thickness_mm": thickness},
        {"thickness_mm": thickness, "shear_modulus_cortex_pa": 3000, "end_week": 28},
        {"elements_through_cortex": through, "order": 1},
        {"diverged": diverged, "reached_week": 28 if diverged is None else 26.5, "steps": 7, "cpu_seconds": 3.0},
    )


MEMBERS = pd.DataFrame([member("t1", 1.0, 1.3), member("t2", 2.0), member("t3", 3.0), member("t4", 9.0, 9, "det F")])


def compared(**distances):
    rows = [
        {"subject": "a", "run": run, "real": "b", "real_population": "other", "same_population": False,
         "hemisphere": "left", "measure": "relative_power_B4", "value": 0.1, "real_value": 0.3, "distance": distance,
         "unit": "1", "flag": "ok"}
        for run, distance in distances.items()
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_the_nearest_run_is_named_with_the_next_and_what_stands_against_it():
    (row,) = nearest(compared(t1=0.3, t2=0.1, t3=0.2), MEMBERS, ["thickness_mm"]).to_dict("records")
    assert (row["thickness_mm"], row["distance"], row["next_thickness_mm"], row["next_distance"]) == (2, 0.1, 3, 0.2)
    assert row["flag"] == "ok"
    (row,) = nearest(compared(t1=0.1, t2=0.3, t3=0.2), MEMBERS, ["thickness_mm"]).to_dict("records")
    assert row["flag"] == "not resolved by the mesh; at the end of the range"


def test_the_papers_value_stands_beside_ours_where_it_reports_one():
    published = {"nearest": [{"parameter": "thickness_mm", "week": 28, "measure": "relative_power_B4", "value": 2.25}]}
    table = nearest(compared(t1=0.3, t2=0.1), MEMBERS, ["thickness_mm"])
    for measure in ("relative_power_B4", "relative_power_B4_weyl"):
        found = with_published_nearest(table.assign(measure=measure), published, ["thickness_mm"], 28)
        assert found["paper"].tolist() == [2.25]
    assert with_published_nearest(table, published, ["thickness_mm"], 27)["paper"].isna().all()
    assert with_published_nearest(table, published, ["poisson_ratio"], 28)["paper"].isna().all()
