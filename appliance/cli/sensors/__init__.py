"""`bunraku sensors` and `provision`: what the running box knows of its sensors, and which ones it admits."""
