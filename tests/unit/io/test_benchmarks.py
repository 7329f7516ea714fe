"""Snakemake's benchmark files, the odd ones included."""

import numpy as np

from gyriflow.io.benchmarks import read_benchmarks

HEAD = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"
PATTERNS = {
    "pial_from_labels": r"results/brains/(?P<brain>a|b)/benchmarks/pial_from_labels\.tsv$",
    "simulate": r"results/runs/(?P<run>one|two)/(?P<brain>a)/benchmarks/simulate\.tsv$",
    "study_runs": r"results/study/benchmarks/study_runs\.tsv$",
}


def write(folder, name, *lines, head=HEAD):
    path = folder / "results" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(head + "".join(line + "\n" for line in lines))


def line(seconds, memory, cpu):
    return f"{seconds}\t0:00:00\t{memory}\t1\t1\t1\t1\t1\t90.00\t{cpu}"


def test_jobs_of_the_rules_are_found_with_their_runs_and_no_others(tmp_path):
    write(tmp_path, "brains/a/benchmarks/pial_from_labels.tsv", line(10.5, 200.25, 9.75))
    write(tmp_path, "brains/b/benchmarks/pial_from_labels.tsv", line(11, 210, 10))
    write(tmp_path, "runs/two/a/benchmarks/simulate.tsv", line("100.00", "1000.00", "190.00"))
    # of an earlier configuration
    write(tmp_path, "brains/c/benchmarks/pial_from_labels.tsv", line(1, 1, 1))
    write(tmp_path, "runs/three/a/benchmarks/simulate.tsv", line(1, 1, 1))
    jobs = read_benchmarks(tmp_path, PATTERNS)
    assert jobs["rule"].tolist() == ["pial_from_labels", "pial_from_labels", "simulate"]
    assert jobs["run"].isna().tolist() == [True, True, False]
    assert jobs[["run", "brain"]].iloc[-1].tolist() == ["two", "a"]
    assert jobs["brain"].tolist() == ["a", "b", "a"]
    np.testing.assert_array_equal(
        jobs[["wall_s", "cpu_s", "memory_MiB"]], [[10.5, 9.75, 200.25], [11, 10, 210], [100, 190, 1000]]
    )


def test_what_could_not_be_measured_is_nan(tmp_path):
    write(tmp_path, "brains/a/benchmarks/pial_from_labels.tsv", line(0.3, "NA", "NA"))
    write(tmp_path, "brains/b/benchmarks/pial_from_labels.tsv", line("-", "-", "-"))
    write(tmp_path, "runs/one/a/benchmarks/simulate.tsv", head="")
    write(tmp_path, "runs/two/a/benchmarks/simulate.tsv", "5.0\t0:00:05", head="s\th:m:s\n")
    write(tmp_path, "study/benchmarks/study_runs.tsv")
    jobs = read_benchmarks(tmp_path, PATTERNS)
    assert len(jobs) == 5
    np.testing.assert_array_equal(jobs["wall_s"], [0.3, np.nan, np.nan, 5.0, np.nan])
    assert jobs[["cpu_s", "memory_MiB"]].isna().all(axis=None)


def test_repeated_jobs_add_up_and_no_jobs_are_an_empty_table(tmp_path):
    assert read_benchmarks(tmp_path, PATTERNS).empty
    write(tmp_path, "study/benchmarks/study_runs.tsv", line(2, 50, 1), line(3, 70, "NA"))
    (job,) = read_benchmarks(tmp_path, PATTERNS).to_dict("records")
    assert (job["wall_s"], job["cpu_s"], job["memory_MiB"]) == (5.0, 1.0, 70.0)
