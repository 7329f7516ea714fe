"""Starting Snakemake and following its jobs: launch, terminal, status, provenance,
cost, logs, code hashes."""
