"""The vocabulary that configuration, workflow and solver share: settings with units and bounds, names and codes."""
