"""Cases with known answers for the folding solver, shared by `verification.py` and the
tests under MPI."""
