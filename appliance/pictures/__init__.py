"""Pictures: figures and filmstrips of poses, drawn with matplotlib."""
