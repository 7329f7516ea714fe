"""Prepare a run of the calibration: the parameters of the base run with the values of
its round."""

from gyriflow.anatomy.fissure import nearer_left
from gyriflow.compare.calibration import calibrated_parameters
from gyriflow.folding.start_regions import start_regions
from gyriflow.io.files import read_table
from gyriflow.io.surfaces import read_surface
from gyriflow.io.tetmeshes import read_maps, read_tetrahedral_mesh, write_regions
from gyriflow.io.yaml_files import read_yaml, write_yaml
from gyriflow.settings.folding import parameters_from
from gyriflow.step import step

files, output = snakemake.input, snakemake.output
with step(snakemake.log[0]):
    design = read_table(files.design).set_index("run")
    values = design.loc[snakemake.wildcards.run].astype(float).to_dict()
    content = calibrated_parameters(
        read_yaml(files.base), values, snakemake.params.week
    )
    write_yaml(output.params, content)
    mesh = read_tetrahedral_mesh(files.mesh)
    maps = read_maps(files.maps) if files.maps else {}
    regions = start_regions(
        mesh,
        parameters_from(content),
        maps,
        lambda mesh: nearer_left(mesh, *map(read_surface, files.sides)),
    )
    write_regions(output.regions, regions)
