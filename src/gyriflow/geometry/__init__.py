"""Plain geometry: triangle surfaces and tetrahedral meshes as frozen arrays."""
