"""The box as an appliance: its real root boots under systemd, and everything that can go wrong does."""
