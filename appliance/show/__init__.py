"""Configuration of a show and a venue: the show bundle and the box file, typed and bounded."""
