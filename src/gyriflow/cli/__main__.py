"""`python -m gyriflow.cli`, which is what `./run gyriflow` calls."""

from .commands import main

if __name__ == "__main__":
    main(prog_name="gyriflow")
