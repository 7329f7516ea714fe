"""Register a brain with one of a later week; refuse a failed registration."""

from gyriflow.growth.registration import (
    channels,
    perturb_labels,
    register_and_measure,
    require_good,
)
from gyriflow.io.registrations import write_correspondence
from gyriflow.io.volumes import read_values
from gyriflow.settings.schemes import FILLED
from gyriflow.step import step

files, params, names = snakemake.input, snakemake.params, snakemake.wildcards
with step(snakemake.log[0], *files.brains):
    brains, with_images = [], all(params.images)
    for brain, labels, image in zip(
        (names.earlier, names.later), params.brains, params.images, strict=True
    ):
        volume, scheme = labels.read(), labels.scheme
        found = (
            perturb_labels(volume.labels, params.seed, brain)
            if params.seed
            else volume.labels
        )
        intensity = (
            read_values(image, labels.affine_from, "grey values")
            if with_images
            else None
        )
        brains.append(
            channels(
                found,
                volume.affine,
                cerebrum=scheme.cerebrum,
                cortex=scheme.cortex,
                image=intensity,
            )
        )
    is_filled = any(labels.scheme == FILLED for labels in params.brains)
    settings = {"smoothing": params.smoothing, "threads": snakemake.threads}
    found, quality = register_and_measure(*brains, is_filled=is_filled, **settings)
    # one member of an ensemble must not end the study
    require_good(
        quality, pair=f"{names.earlier} to {names.later}", only_warn=params.is_varied
    )
    report = {
        "seconds": found.seconds,
        "channels": list(found.channels),
        "turned_deg": found.turned_deg,
    }
    write_correspondence(snakemake.output[0], found.deformation, report | quality)
