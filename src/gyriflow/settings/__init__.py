"""Typed models of the configuration. They read no files."""
