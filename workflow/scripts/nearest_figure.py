"""How far the runs of a study are from the real brain by each measure, and which is nearest."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_table
from gyriflow.report.influence import nearest_chart, parameter_label
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    table, nearest = read_table(files.comparison), read_table(files.nearest)
    own = table[(table["subject"] == params.subject) & table["real"].isin(params.real)]
    flags = own["flag"].where(own["resolution"] == "ok", own["resolution"])
    known = nearest.dropna(subset=["paper"])
    published = dict(zip(known["measure"], known["paper"], strict=True))
    shown = {"varied": params.varied, "parameter": parameter_label(params.varied), "published": published}
    figure = nearest_chart(own.assign(flag=flags), **shown, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
