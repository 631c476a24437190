"""Timecode and MIDI: commands that come from the house, given to show control as OSC."""
