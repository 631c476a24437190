"""`bunraku doctor`: looks at the machine, the venue's settings and the running box, and says what to do."""
