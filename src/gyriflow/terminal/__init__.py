"""What a run of the workflow tells on the terminal: stages, weeks, warnings and failures; all else goes to a log."""
