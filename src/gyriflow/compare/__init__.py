"""What a simulation is worth: compared with real brains, with no folding, and with chance."""
