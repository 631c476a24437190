"""Open Sound Control: templates packed once, dialects that fill them, receivers that get them."""
