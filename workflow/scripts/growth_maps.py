"""Write the growth that a run towards shapes has found, as maps on the pial surface:
one set per output week."""

from gyriflow.growth.rates import growth_per_week
from gyriflow.io.frames import read_pial_frames
from gyriflow.io.surfaces import write_vertex_maps
from gyriflow.io.yaml_files import read_yaml
from gyriflow.quantities import name_in_interval
from gyriflow.settings.folding import parameters_from
from gyriflow.step import step

files = snakemake.input
with step(snakemake.log[0]):
    growth = growth_per_week(
        read_pial_frames(files.frames), parameters_from(read_yaml(files.params)).step_s
    )
    maps = {
        name_in_interval(name, *interval): values
        for interval, found in growth.items()
        for name, values in found.items()
    }
    write_vertex_maps(snakemake.output[0], maps)
