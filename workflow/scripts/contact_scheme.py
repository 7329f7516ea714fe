"""The scheme of contact of a run: walls, planes or distance, and the law of the pressure."""

from gyriflow.folding.contact import BARRIER, DISTANCE_PER_EDGE
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.triangles import TriangleMesh, mean_edge_length
from gyriflow.io.figures import write_figure
from gyriflow.io.tetmeshes import read_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml
from gyriflow.parameters.reading import parameters_from
from gyriflow.report.contact_scheme import barrier_law, contact_scheme, penalty_law
from gyriflow.step import step

files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    mesh, run = read_tetrahedral_mesh(files.mesh), parameters_from(read_yaml(files.params))
    zones = zones_of_run(mesh, run)
    boundary, by_planes = TriangleMesh(mesh.vertices, zones.facets), run.contact.kind == "planes"
    distance = run.contact.distance_mm or DISTANCE_PER_EDGE * mean_edge_length(boundary)
    figure = contact_scheme(
        boundary,
        zones.facet_zone,
        penalty_law(run.contact.penalty_pa_per_m) if by_planes else barrier_law(BARRIER),
        planes_mm=zones.planes_mm if by_planes else None,
        distance=f"d̂ = {distance:.2g} mm",
        synthetic=params.synthetic,
    )
    write_figure(snakemake.output.png, snakemake.output.pdf, figure, dpi=params.dpi)
