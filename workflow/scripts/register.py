"""The registration of a brain with one of a later week, refused where it has failed."""

from dataclasses import asdict

from gyriflow.growth.channels import channels
from gyriflow.growth.diffeomorphic import register
from gyriflow.growth.registration_quality import judge, require_good
from gyriflow.io.registrations import write_correspondence
from gyriflow.io.volumes import read_label_volume, read_values
from gyriflow.settings.schemes import LabelScheme
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
with step(snakemake.log[0], files.earlier, files.later):
    brains, with_images = [], all(brain["image"] for brain in params.brains)
    for path, given in zip((files.earlier, files.later), params.brains, strict=True):
        affine_from, scheme = given["affine_from"], LabelScheme(**given["scheme"])
        volume = read_label_volume(path, affine_from=affine_from)
        intensity = read_values(given["image"], affine_from, "grey values") if with_images else None
        brains.append(
            channels(volume.labels, volume.affine, cerebrum=scheme.cerebrum, cortex=scheme.cortex, image=intensity)
        )
    found = register(*brains, threads=snakemake.threads)
    quality = judge(*brains, found.deformation)
    require_good(quality, pair=f"{names.earlier} to {names.later}")
    report = {"seconds": found.seconds, "channels": list(found.channels), "turned_deg": found.turned_deg}
    write_correspondence(snakemake.output[0], found.deformation, report | asdict(quality))
