"""Where results come from: versions, settings and hashes, beside those of each brain, run, study and the report."""

from pathlib import Path

from gyriflow.io.downloads import sha256_of
from gyriflow.io.files import files_in, fingerprints, read_json, read_text, write_json, write_text
from gyriflow.io.yaml_files import read_yaml, write_yaml
from gyriflow.report.page import methods_text
from gyriflow.running.provenance import software, texts_in
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
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
    hashed = [{"brain": brain, "what": what, "sha256": sha256_of(path)} for brain, what, path in params.files]
    write_json(output.report, used | {"files": hashed})
    of_runs = zip(params.folded, params.growth_of, files.run_params, files.summaries, strict=True)
    runs = [
        {
            "run": run,
            "start": brain,
            "growth_of": growth_of,
            "parameters": read_yaml(settings),
            "summary": read_json(summary),
        }
        for (run, brain), growth_of, settings, summary in of_runs
    ]
    write_text(output.methods, methods_text(read_text(files.template), runs=runs, software=used, **params.method))
    write_yaml(output.config, params.config)
    results = fingerprints(files_in(Path(output.study).parent, *OF_JOBS))
    write_json(output.study, used | {"configuration": params.config, "inputs": inputs, "results": results})
