"""The space of a dancer's poses: its paths become dances, recordings become maps ('Beyond Imitation')."""
