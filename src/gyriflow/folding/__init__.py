"""The folding solve: a growing neo-Hookean brain, step by step from an early week to a late one."""
