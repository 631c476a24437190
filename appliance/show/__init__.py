"""What a show and a venue need: the show bundle and the box file, typed and bounded."""
