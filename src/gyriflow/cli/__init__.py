"""The command `gyriflow`: a study begun, checked, run, looked at and compared from the
terminal."""
