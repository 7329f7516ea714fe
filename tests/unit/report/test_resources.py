"""Energy and emissions against numbers worked out by hand and published ones; stages whose jobs are known."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.report.resources import (
    MOST_STAGES,
    Power,
    busy_seconds,
    energy_kwh,
    resources_html,
    resources_table,
    simulation,
    stage_resources,
)

POWER = Power(core_power_w=10.0, memory_w_per_gb=0.5, pue=2.0, carbon_intensity_g_per_kwh=400.0)
GB_IN_MIB = 1e9 / 2**20
SUMMARY = {"seconds": 3600.0, "ranks": 4, "peak_memory_MiB": 2000.0, "resumed_after_step": 0}
STEPS = pd.DataFrame({"seconds": [100.0, 200.0, 300.0]})
NOT_MEASURED = pd.DataFrame(columns=["rule", "run", "wall_s", "cpu_s", "memory_MiB"])


def jobs(*rows):
    return pd.DataFrame(rows, columns=NOT_MEASURED.columns)


def one(value):
    return pd.Series([value])


def test_energy_by_hand():
    # 2 h on 3 cores of 10 W, 8 GB of 0.5 W: (60 + 8) Wh, doubled by the data centre
    energy = energy_kwh(one(7200.0), one(3 * 7200.0), one(8 * GB_IN_MIB), POWER)
    assert energy.item() == pytest.approx(0.136)


def test_energy_and_emissions_that_the_paper_took_from_the_calculator():
    # 21 to 40 GW in 44 h 20 min on 4 CPUs: 3.72 kWh and 191 g. The calculator's own values give them with 6 GB:
    # an unknown processor has 12 W per core, a data centre a PUE of 1.67, France 51.28 g/kWh
    seconds = (44 + 20 / 60) * 3600
    power = Power(core_power_w=12.0, memory_w_per_gb=0.3725, pue=1.67, carbon_intensity_g_per_kwh=51.28)
    energy = energy_kwh(one(seconds), one(4 * seconds), one(6 * GB_IN_MIB), power).item()
    assert round(energy, 2) == 3.72
    assert round(energy * power.carbon_intensity_g_per_kwh) == 191


def test_defaults_are_those_of_the_calculator():
    from gyriflow.config.stages import ReportSettings

    assert Power(**ReportSettings().energy.model_dump()) == Power(12.0, 0.3725, 1.0, 475.0)


def test_the_time_after_the_last_sample_counts_up_to_the_wall_time():
    wall = pd.Series([10.0, 20.0, 100.0, 100.0, 100.0])
    sampled = pd.Series([4.0, 12.0, 50.0, 190.0, np.nan])
    np.testing.assert_allclose(busy_seconds(wall, sampled), [4.5, 20.0, 80.0, 190.0, 100.0])


def test_a_simulation_takes_its_ranks_time_and_what_came_before_an_interruption():
    told = simulation(SUMMARY | {"resumed_after_step": 2}, STEPS)
    assert told["earlier_wall_s"] == 300.0
    assert simulation(SUMMARY | {"cpu_seconds": 9000.0}, STEPS)["cpu_s"] == 9000.0
    (row,) = stage_resources(NOT_MEASURED, {"long": told}, POWER).to_dict("records")
    assert (row["stage"], row["run"], row["jobs"], row["unmeasured"]) == ("simulate", "long", 1, 0)
    assert (row["wall_s"], row["cpu_s"], row["peak_memory_MiB"]) == (3900.0, 4 * 3900.0, 2000.0)
    energy = (3900 / 3600) * (4 * 10 + 2000 / GB_IN_MIB * 0.5) * 2 / 1000
    assert row["energy_kWh"] == pytest.approx(energy)
    assert row["co2e_g"] == pytest.approx(400 * energy)


def test_a_simulation_has_the_larger_of_what_it_and_snakemake_say():
    measured = jobs(["simulate", "a", 3700.0, 100.0, 2500.0], ["simulate", "old", 1.0, 1.0, 1.0])
    simulations = {"a": simulation(SUMMARY, STEPS), "b": simulation(SUMMARY, STEPS)}
    stages = stage_resources(measured, simulations, POWER).set_index("run")
    assert list(stages.index) == ["a", "b"]
    # the ranks may be on other machines, where Snakemake does not see them
    assert stages["wall_s"].tolist() == [3700.0, 3600.0]
    assert stages["cpu_s"].tolist() == [14400.0, 14400.0]
    assert stages["peak_memory_MiB"].tolist() == [2500.0, 2000.0]


@pytest.fixture
def stages():
    measured = jobs(
        ["pial_from_labels", np.nan, 10.0, 8.0, 200.0],
        ["simulate", "a", np.nan, np.nan, np.nan],
        ["pial_from_labels", np.nan, 14.0, 20.0, 300.0],
        ["join", "a", 0.25, np.nan, np.nan],
        ["join", "b", np.nan, np.nan, np.nan],
        ["lost", np.nan, np.nan, np.nan, np.nan],
    )
    return stage_resources(measured, {"a": simulation(SUMMARY, STEPS)}, POWER)


def test_a_rule_has_the_sum_of_its_jobs_and_the_memory_of_the_largest(stages):
    assert stages["stage"].tolist() == ["simulate", "pial_from_labels", "join", "lost"]
    assert stages["run"].tolist() == ["a", "", "", ""]
    row = stages.set_index("stage").loc["pial_from_labels"]
    assert (row["jobs"], row["wall_s"], row["cpu_s"], row["peak_memory_MiB"]) == (2, 24.0, 28.5, 300.0)
    memory = (10 * 200 + 14 * 300) / GB_IN_MIB * 0.5
    assert row["energy_kWh"] == pytest.approx((28.5 * 10 + memory) / 3600 * 2 / 1000)


def test_jobs_without_measurements_are_counted_and_add_nothing(stages):
    rows = stages.set_index("stage")
    assert rows["unmeasured"].to_dict() == {"simulate": 0, "pial_from_labels": 0, "join": 1, "lost": 1}
    assert (rows.loc["join", "jobs"], rows.loc["join", "wall_s"], rows.loc["join", "cpu_s"]) == (2, 0.25, 0.25)
    assert np.isnan(rows.loc["join", "peak_memory_MiB"])
    assert rows.loc["lost", ["wall_s", "cpu_s", "peak_memory_MiB", "energy_kWh", "co2e_g"]].isna().all()


def test_the_printed_table_ends_in_the_sum(stages):
    table = resources_table(stages)
    assert table["stage"].tolist() == ["simulate", "pial from labels", "join", "lost", "all"]
    last = table.iloc[-1]
    assert (last["jobs"], last["wall time (min)"], last["peak memory (MiB)"]) == (6, 60.4, 2000.0)
    assert last["energy (kWh)"] == pytest.approx(stages["energy_kWh"].sum(), rel=5e-3)


def test_long_runs_are_shown_without_exponents():
    long = simulation(SUMMARY | {"seconds": 100_800.0 * 60, "peak_memory_MiB": 16_384.0}, STEPS)
    shown = resources_html(stage_resources(NOT_MEASURED, {"a": long}, POWER), POWER, caption="x")
    assert ">100800<" in shown
    assert ">16384<" in shown
    assert "e+" not in shown


def test_the_page_says_what_was_assumed_and_what_is_missing(stages):
    page = resources_html(stages, POWER, caption="Time & energy")
    assert "Time &amp; energy" in page
    assert "10 W per core, 0.5 W per GB, PUE 2, 400 g CO₂e per kWh" in page
    assert "Jobs without a time on record, which add nothing: 2 of 6." in page
    assert ">–<" in page
    assert "without a time" not in resources_html(stages[stages["unmeasured"] == 0], POWER, caption="")


def test_the_table_has_what_took_longest_and_the_others_together():
    count = MOST_STAGES + 3
    numbers = dict.fromkeys(("wall_s", "peak_memory_MiB", "energy_kWh", "co2e_g"), 60.0)
    stages = pd.DataFrame(
        {"stage": [f"s{i}" for i in range(count)], "run": "", "jobs": 1, "cpu_s": 60.0 * np.arange(1, count + 1)}
        | numbers
    )
    table = resources_table(stages)
    assert len(table) == MOST_STAGES + 2
    assert table["stage"].iloc[[0, -2, -1]].tolist() == [f"s{count - 1}", "3 others", "all"]
    assert table["CPU time (min)"].iloc[-2] == 1 + 2 + 3
