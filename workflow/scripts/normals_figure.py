"""Normals of the pial surface inside the brain at a run's first and last week, as arrows in sections."""

from gyriflow.folding.output import layer_fields
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.tetrahedra import TetrahedralMesh
from gyriflow.io.figures import write_figure
from gyriflow.io.frames import read_positions, read_weeks
from gyriflow.io.maps import read_maps
from gyriflow.io.regions import read_regions
from gyriflow.io.yaml_files import read_yaml
from gyriflow.parameters.reading import parameters_from
from gyriflow.parameters.terms import BASE
from gyriflow.report.sections import Normals, normal_arrows
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    start, run = read_regions(files.mesh), parameters_from(read_yaml(files.params))
    cortex = start.facets[start.facet_tags["zone"] < BASE]
    zones, maps = zones_of_run(start.mesh, run), read_maps(files.maps) if files.maps else {}
    shown = {}
    for week in dict.fromkeys((read_weeks(files.frames)[0], read_weeks(files.frames)[-1])):
        mesh = TetrahedralMesh(read_positions(files.frames, week), start.mesh.tets)
        fields = layer_fields(mesh.vertices, zones, run, maps, week, ("normal", "cortex_weight"))
        shown[week] = Normals(mesh, fields["pial_normal"], fields["cortex_weight"], cortex)
    figure = normal_arrows(shown, synthetic=params.synthetic)
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
