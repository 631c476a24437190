"""The journal, the box's flight recorder: noted in memory by the stage, kept on the disk by the keeper."""
