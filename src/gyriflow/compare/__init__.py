"""Comparison of simulations with observed brains: validation, prediction, deviation,
sweeps and calibration."""
