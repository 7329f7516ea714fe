"""The picture of the regions on measured and simulated brains, the chart of their metrics, and the table."""

import numpy as np

from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure, write_html
from gyriflow.io.files import read_table
from gyriflow.io.label_files import read_vertex_labels
from gyriflow.io.surfaces import read_surface
from gyriflow.report.regions import regions_chart, regions_picture
from gyriflow.report.style import runs_by_name
from gyriflow.report.tables import html_table, region_table
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
shown = {"measured": params.measured, "synthetic": params.synthetic}
with step(snakemake.log[0]):
    brains, names = {}, {}
    places = zip(params.headings, files.left, files.right, files.left_regions, files.right_regions, strict=True)
    for heading, left, right, *paths in places:
        read = [read_vertex_labels(path) for path in paths]
        numbers = {name: names.setdefault(name, len(names) + 1) for _, table in read for name in table.values()}
        both = [np.array([numbers.get(table.get(n), 0) for n in labels.tolist()]) for labels, table in read]
        brains[heading] = merged(read_surface(left), read_surface(right)), np.concatenate(both)
    picture = regions_picture(brains, {number: name for name, number in names.items()}, **shown)
    write_figure(output.png, output.pdf, picture, dpi=params.dpi)
    tables = runs_by_name(read_table(files.regions)), runs_by_name(read_table(files.asymmetry))
    write_figure(output.chart, output.chart_pdf, regions_chart(*tables, **shown), dpi=params.dpi)
    write_html(output.table, html_table(region_table(*tables), caption="Metrics by region", **shown))
