"""`bunraku sensors` and `provision`: what the running box knows of its sensors, and which are let in."""
