"""Pial surfaces from label volumes and surface files: posed, closed, clean, split at
the fissure."""
