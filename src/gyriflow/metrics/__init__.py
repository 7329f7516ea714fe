"""Metrics of folding: curvature, spectrum, gyrification, displacement, and distance
between surfaces."""
