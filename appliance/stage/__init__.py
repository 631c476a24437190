"""The stage: clock, tick, budget and the run itself."""
