"""Recorder: the journal of a run, written, read and compared."""
