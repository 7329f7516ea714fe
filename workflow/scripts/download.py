"""The files of the atlas that its folder lacks, fetched; those that are there, checked."""

import sys

from gyriflow.errors import InputError
from gyriflow.io.downloads import fetch
from gyriflow.step import step


def say(line: str) -> None:
    """Shows progress on the terminal."""
    print(f"gyriflow: {line}", file=sys.stderr, flush=True)


params = snakemake.params
with step(snakemake.log[0]):
    if not params.urls:
        raise InputError("nothing to download", expected="a section `atlas` in the configuration, with its folder")
    fetched = fetch(params.folder, params.urls, say, params.optional)
    say(f"{len(fetched)} files fetched into {params.folder}")
