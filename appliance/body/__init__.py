"""A body for any skeleton: its surface, made once at the start, and how its joints move it."""
