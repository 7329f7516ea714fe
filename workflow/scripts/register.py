"""The registration of a brain with one of a later week, refused where it has failed."""

from dataclasses import asdict

from gyriflow.io.registrations import write_deformation
from gyriflow.io.volumes import read_label_volume, read_values
from gyriflow.parameters.schemes import LabelScheme
from gyriflow.registration.channels import channels
from gyriflow.registration.diffeomorphic import register
from gyriflow.registration.quality import judge, require_good
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
with step(snakemake.log[0], files.earlier, files.later):
    brains = []
    given = zip((files.earlier, files.later), params.images, params.affine_from, params.schemes, strict=True)
    for path, image, affine_from, fields in given:
        volume, scheme = read_label_volume(path, affine_from=affine_from), LabelScheme(**fields)
        intensity = read_values(image, affine_from, "grey values") if all(params.images) else None
        brains.append(
            channels(volume.labels, volume.affine, cerebrum=scheme.cerebrum, cortex=scheme.cortex, image=intensity)
        )
    found = register(*brains, threads=snakemake.threads)
    quality = judge(*brains, found.deformation)
    require_good(quality, pair=f"{names.earlier} to {names.later}")
    report = {"seconds": found.seconds, "channels": list(found.channels), "turned_deg": found.turned_deg}
    write_deformation(snakemake.output[0], found.deformation, report | asdict(quality))
