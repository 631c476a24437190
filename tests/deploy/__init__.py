"""Tests of installation and of the files for systemd, udev and the network."""
