"""Where the results come from: versions, commit, and the hashes of the input files."""

from gyriflow.cli.provenance import software
from gyriflow.io.downloads import sha256_of
from gyriflow.io.files import write_json
from gyriflow.step import step

params = snakemake.params
with step(snakemake.log[0]):
    files = [
        {"brain": brain, "what": what, "sha256": sha256_of(path)} | ({"path": path} if params.paths else {})
        for brain, what, path in params.files
    ]
    write_json(snakemake.output[0], software() | {"files": files})
