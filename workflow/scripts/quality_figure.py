"""The histograms of element quality."""

from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_json
from gyriflow.report.charts import quality_histogram
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    quality = read_json(snakemake.input[0])
    surface = (
        f"surface: 99 % within {quality['surface_distance_mm']['hausdorff99']:.3f} mm of the given one, "
        f"{quality['crossing_faces']} faces cross; volume {100 * quality['volume_change']:+.2f} %"
    ).replace("-", "−")
    if quality["gap_kept"] is not None:
        surface += f"; gaps open along {100 * quality['gap_kept']:.1f} % of their walls"
    figure = quality_histogram(quality["histogram"], gates=params.gates, surface=surface, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
