"""The chart of the age profile and of its check."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.ages import age_profile_chart
from gyriflow.report.style import run_names, runs_by_name
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    profile, similarity = (runs_by_name(read_table(files[name])) for name in ("profile", "similarity"))
    shown = {"measured": params.measured, "synthetic": params.synthetic}
    runs = run_names(params.folded)
    figure = age_profile_chart(profile, read_table(files.check), similarity, runs=runs, **shown)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
