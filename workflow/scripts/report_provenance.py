"""Where the results come from: versions, commit, and the hashes of the input files."""

from gyriflow.cli.provenance import software
from gyriflow.io.downloads import sha256_of
from gyriflow.io.files import write_json
from gyriflow.step import step

with step(snakemake.log[0]):
    files = [{"brain": brain, "what": what, "sha256": sha256_of(path)} for brain, what, path in snakemake.params.files]
    write_json(snakemake.output[0], software() | {"files": files})
