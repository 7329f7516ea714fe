"""The clean pial surface of a brain and of its hemispheres in RAS+ mm, from what the brain is given as."""

from gyriflow.anatomy.pial import from_hemispheres, from_labels, from_shape, from_surface
from gyriflow.io.downloads import require_checksums
from gyriflow.io.files import write_json
from gyriflow.io.surfaces import read_hemispheres, read_one_hemisphere, read_surface, write_brain
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
files, volumes = list(snakemake.input), {}
settings = {"week": params.week, **params.settings}
with step(snakemake.log[0], *files):
    require_checksums(params.checksums)
    if params.labels:
        volume = params.labels.read(cropped=True)
        surface = from_labels(volume.labels, volume.affine, params.labels.scheme, params.side, **settings)
        volumes = {"volumes_of_labels_mL": volume.volumes_ml}
    elif params.source == "hemispheres":
        left, right, declared = read_hemispheres(*files)
        settings |= {"coordinates": params.coordinates, **params.limits}
        surface = from_hemispheres(left, right, declared=declared, **settings)
    elif params.source == "shape":
        surface = from_shape(read_surface(files[0]), **settings)
    else:
        mesh = read_one_hemisphere(files[0], params.side) if params.side else read_surface(files[0])
        surface = from_surface(mesh, params.side, coordinates=params.coordinates, **settings)
    write_brain(output, surface.whole, surface.left, surface.right)
    write_json(output.report, surface.report | volumes)
