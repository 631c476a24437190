"""Open Sound Control: templates packed once, and the dialects that fill them."""
