"""Show control, a process of its own: commands by OSC in, the house state and the heartbeat out."""
