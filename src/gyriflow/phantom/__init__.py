"""Synthetic fetal brains for the demo and the tests."""
