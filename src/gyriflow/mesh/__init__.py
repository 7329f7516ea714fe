"""From a closed surface to a tetrahedral mesh, fine in the cortex and coarse in the
core."""
