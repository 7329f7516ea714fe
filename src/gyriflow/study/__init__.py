"""Designs of runs: how near the runs of a study are to real brains, and calibration."""
