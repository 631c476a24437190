"""Two dances compared: versions of one dance, aligned in time, and two periods of a practice."""
