"""The only room that opens files: label volumes, surfaces, tetrahedral meshes, frames,
tables."""
