"""Outputs of the box: the joint frame and its receivers."""
