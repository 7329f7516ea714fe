"""Download one file of an atlas and check it."""

import logging

from gyriflow.io.downloads import fetch
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    fetch(
        snakemake.output[0],
        params.url,
        logging.info,
        sha256=params.sha256,
    )
