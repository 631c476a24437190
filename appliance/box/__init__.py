"""Box: what all processes of a running show share."""
