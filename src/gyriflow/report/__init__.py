"""Figures and tables: data frames and meshes in, matplotlib figures, data frames and
HTML out; opens no files."""
