"""Where the results come from, beside those of each brain, each run and the study: versions, settings, hashes."""

from pathlib import Path

from gyriflow.cli.provenance import software, texts_in
from gyriflow.io.files import files_in, fingerprints, write_json
from gyriflow.io.yaml_files import read_yaml
from gyriflow.step import step

output, params = snakemake.output, snakemake.params
OF_JOBS = ("logs", "benchmarks", "provenance.json")

with step(snakemake.log[0]):
    used = software()
    inputs = {brain["id"]: fingerprints(texts_in(brain)) for brain in params.brains}
    for path, brain in zip(output.brains, params.brains, strict=True):
        results = fingerprints(files_in(Path(path).parent, *OF_JOBS))
        write_json(path, used | {"configuration": brain, "inputs": inputs[brain["id"]], "results": results})
    for path, (run, brain) in zip(output.runs, params.folded, strict=True):
        folder = Path(path).parent
        start = fingerprints([f"results/brains/{brain}/mesh/brain.h5", folder / "folding" / "maps.h5"])
        results = fingerprints(files_in(folder, *OF_JOBS))
        settings = {"run": run, "start": brain, "parameters": read_yaml(folder / "params.yaml")}
        write_json(path, used | {"configuration": settings, "inputs": start | inputs[brain], "results": results})
    results = fingerprints(files_in(Path(output.study).parent, *OF_JOBS))
    write_json(output.study, used | {"configuration": params.config, "inputs": inputs, "results": results})
